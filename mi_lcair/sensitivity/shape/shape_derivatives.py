"""Derivatives of an intensity with respect to the shape of a group, by vertex and by facet."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from mi_lcair.physics.bands import known_band
from mi_lcair.rendering.facets.polygons import WRITERS
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import window
from mi_lcair.results import Result, entry
from mi_lcair.results.charts import facets_section
from mi_lcair.results.result import summary_of
from mi_lcair.sensitivity.shape.estimation import Estimation, standard_errors
from mi_lcair.sensitivity.shape.surface import Surface


@dataclass(frozen=True, repr=False)
class ShapeDerivatives(Result):
    """How the target's intensity changes where the surface of a group is moved outward.

    Attributes
    ----------
    scene_name, band, group : str
        Names of the scene, of its band, and of the group.
    table : dict of str to ndarray, shape (facets,)
        Values of the group's facets, by name with unit. derivative_W_sr_m3 is the change of the
        intensity per metre of outward displacement and per square metre that is displaced. Its
        integral over the surface is `growth`.
    triangles, triangle_facet : ndarray, shapes (T, 3, 3) and (T,)
        Corners of the group's triangles [m], and the number of the facet of each.
    positions, normals : ndarray, shape (n, 3)
        Vertices of the group [m], and their outward normals.
    derivative, standard_error : ndarray, shape (n,)
        Derivatives with respect to the displacement of each vertex along its normal, W/sr per m.
        NaN where a vertex has no normal, as in a plate without thickness.
    growth, growth_error : float
        Sum of all derivatives, and its standard error, W/sr per m.
    paths : int
        Number of paths.
    axes : ndarray, shape (3, 3)
        Directions to the right and up in the sensor's film, and toward the sensor.
    """

    scene_name: str
    band: str
    group: str
    table: dict[str, np.ndarray] = entry("columns")
    triangles: np.ndarray = entry()
    triangle_facet: np.ndarray = entry()
    positions: np.ndarray = entry()
    normals: np.ndarray = entry()
    derivative: np.ndarray = entry()
    standard_error: np.ndarray = entry()
    growth: float = entry("growth_W_sr_m")
    growth_error: float = entry("standard_error_W_sr_m")
    paths: int
    axes: np.ndarray = entry()

    kind = "shape_derivatives"
    drawn_by = "mi_lcair.reports.pictures.shape_derivatives:figure"
    heading = "Facets"
    computed = {"vertices": "vertices"}
    saved_by = WRITERS

    def summary(self) -> str:
        """One line with the change of the intensity if the whole surface moves outward."""
        return (
            f"shape of {self.group} in {self.scene_name}, {self.band}: moved outward by 1 mm, it "
            f"changes the intensity by {1e-3 * self.growth:.4g} +- {1e-3 * self.growth_error:.2g} "
            "W/sr (standard error)"
        )

    def vertices(self) -> dict[str, np.ndarray]:
        """Positions, normals and derivatives of the vertices."""
        return {
            "position_m": self.positions,
            "normal": self.normals,
            "derivative_W_sr_m": self.derivative,
            "standard_error_W_sr_m": self.standard_error,
        }

    def facts(self) -> Iterator[Any]:
        """The growth in one line, and the facets in space."""
        yield summary_of(self)
        model = self.triangles, self.triangle_facet
        yield from facets_section(self.table, model, band=known_band(self.band)).parts

    def columns(self) -> dict[str, np.ndarray]:
        """The table, with a row for each facet of the group."""
        return self.table


def differentiate_shape(scene, group: str, sampling: Sampling) -> ShapeDerivatives:
    """The derivatives of a loaded scene's intensity with respect to the shape of a group."""
    surface = Surface(scene, group)
    result = Estimation(surface, surface.outward, sampling).run()
    inside, of_primitives = surface.in_group, FacetTable(scene).of_primitives
    facet = np.concatenate([of_primitives[mesh] for mesh in surface.meshes])[inside]
    numbers, rows = np.unique(facet, return_inverse=True)
    area = np.linalg.norm(surface.normals[inside], axis=1) / 2
    areas = np.bincount(rows, area)
    # Means over the facets' areas of the derivatives per displaced area, (facets, n)
    shape = len(numbers), len(inside)
    of_facets = csr_array((area / 3 / areas[rows], (rows, np.flatnonzero(inside))), shape=shape)
    means = csr_array(of_facets @ surface.has / surface.areas)
    has_normal = surface.outward.any(axis=1)
    by_block, mean, error, unscattered = (
        np.where(has_normal, values, np.nan)
        for values in (result.by_block, result.mean, result.error, result.unscattered)
    )
    scatter = standard_errors(by_block @ means.T)
    growth, growth_error = result.total
    _, right, down, direction = window(scene.sensor(sampling.sensor))
    axes = np.array([right, -down, -direction])
    return ShapeDerivatives(
        scene_name=scene.name,
        band=scene.band.name,
        group=group,
        table={
            "facet": numbers,
            "area_m2": areas,
            "derivative_W_sr_m3": means @ mean,
            "standard_error_W_sr_m3": np.hypot(scatter, means @ unscattered),
        },
        triangles=surface.vertices[surface.triangles[inside]],
        triangle_facet=facet,
        positions=surface.positions,
        normals=surface.outward,
        derivative=mean,
        standard_error=error,
        growth=growth,
        growth_error=growth_error,
        paths=result.paths,
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
    )
