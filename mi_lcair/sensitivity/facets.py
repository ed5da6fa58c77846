"""Radiance of an image as a sparse matrix times the blackbody radiances of the emitting facets."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.spectral_bsdf import has_spectral_materials
from mi_lcair.plugins.emitters.thermal_emitter import thermal_shapes
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.contributions import (
    Contributions,
    column_table,
    contributions,
    slots,
    unit_radiance,
)
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.limits import check_paths
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import check_valid

# Independent randomisations of a pixel's points. An estimate from the matrices weights one half of
# them by the variance in the other half, which needs at least four in each.
RANDOMISATIONS = 8
# Entries for contributions in one pass. They need 16 bytes each while they are sorted.
PASS_SLOTS = 2**23


@dataclass(frozen=True)
class FacetMatrix:
    """Radiance of the pixels of an image by emitting facet.

    For each independent randomisation of the paths,
    radiance = matrix @ in_band_radiance(band, temperatures of the facets) + rest.

    Attributes
    ----------
    matrices : list of scipy.sparse.csr_array
        One for each randomisation, (pixels, facets), pixels row by row. An entry is the radiance of
        a pixel for a blackbody radiance of 1 of the facet.
    rest : ndarray, shape (R, pixels)
        Radiance from everything but the facets of the chosen groups [W m^-2 sr^-1].
    facets : ndarray, shape (F,)
        Facets of the columns, numbered as in `FacetTable`.
    temperature : ndarray, shape (F,)
        Temperatures of these facets in the scene [K].
    band : Band
    size : (int, int)
        Width and height of the image.
    """

    matrices: list[sparse.csr_array]
    rest: np.ndarray
    facets: np.ndarray
    temperature: np.ndarray
    band: Band
    size: tuple[int, int]

    @property
    def mean(self) -> sparse.csr_array:
        """Mean of the matrices, (pixels, facets)."""
        return sparse.csr_array(sum(self.matrices) / len(self.matrices))

    def radiance(self, temperature=None) -> np.ndarray:
        """Radiance of each randomisation, (R, height, width) [W m^-2 sr^-1].

        temperature: temperatures of the facets [K], (F,) or a number; None takes the scene's.
        """
        temperature = self.temperature if temperature is None else temperature
        source = in_band_radiance(self.band, np.broadcast_to(temperature, self.facets.shape))
        of_facets = [matrix @ source for matrix in self.matrices]
        return (np.array(of_facets) + self.rest).reshape(len(of_facets), *self.size[::-1])


def facet_matrix(
    scene: Scene,
    *,
    groups=None,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = RANDOMISATIONS,
    model_only: bool = False,
) -> FacetMatrix:
    """Trace a scene once, for the images of all temperatures of its facets.

    The paths are those of `mi_lcair.render` if the seed and the numbers of samples and of
    randomisations are the same. With `emitter_sampling`, the emitters are drawn by their radiances
    at the scene's own temperatures. The matrix then also holds for other temperatures, but a render
    at these has other paths.

    Parameters
    ----------
    scene : Scene
    groups : iterable of str or None
        Groups whose facets get columns. None: all groups with temperatures. Facets without a
        temperature of their own, such as those of a texture, belong to the rest.
    sensor : int
        Number of the sensor, counted from 0.
    spp : int or None
        Samples per pixel (the number in the scene), rounded up to a multiple of `randomisations`.
    seed : int
    randomisations : int
        Number of independent randomisations of each pixel's points.
    model_only : bool
        Whether only paths that first hit the model count, as those of a target's intensity.

    Returns
    -------
    FacetMatrix

    Raises
    ------
    InputError
        For an unknown group, groups without temperatures, and closure = tail, whose radiance is not
        linear in that of the facets.
    """
    camera = scene.sensor(sensor)
    spp = camera.sampler().sample_count() if spp is None else spp
    for name, value in (("spp", spp), ("randomisations", randomisations)):
        if not value > 0:
            raise InputError(f"{name} = {value} must be positive")
    width, height = camera.film().crop_size()
    check_paths(width * height, spp=spp)
    points = -(-spp // randomisations)
    if has_spectral_materials(scene.mi):
        raise InputError(
            f"{scene.name}: temperatures of facets are no unknowns with materials by wavelength; "
            "give these `average_K`"
        )
    with scene.prepared() as tracer:
        if tracer.closure == "tail":
            raise InputError(
                f"{scene.name}: closure = tail is not linear in the radiance of the facets; "
                "use none or ambient"
            )
        emitters, facets, columns, temperature = chosen_facets(scene, groups)
        table = column_table(emitters, columns)
        shape = (width * height, randomisations, len(facets))
        blocks, invalid, done = {}, 0, 0
        with unit_radiance(emitters):
            for launch in launches(width, height, seed, randomisations, points, slots(tracer)):
                traced = contributions(tracer, camera, launch, table, model_only)
                invalid += int((~traced.valid).sum())
                summed = pass_sums(traced, launch, shape[-1])
                before = blocks.get(launch.first)
                blocks[launch.first] = (
                    summed if before is None else [a + b for a, b in zip(before, summed)]
                )
                done += launch.paths
        check_valid(invalid, done, scene.name)
    sums, rest, valid = zip(*blocks.values())
    valid = np.maximum(np.concatenate(valid), 1)
    matrix = sparse.vstack(sums, format="csr")
    matrix.data /= np.repeat(valid, np.diff(matrix.indptr))
    return FacetMatrix(
        matrices=[matrix[r::randomisations] for r in range(randomisations)],
        rest=(np.concatenate(rest) / valid).reshape(shape[:2]).T,
        facets=facets,
        temperature=temperature,
        band=scene.band,
        size=(width, height),
    )


def launches(width: int, height: int, seed: int, randomisations: int, points: int, slots: int):
    """Yield launches that trace `points` points of each randomisation of each pixel.

    They have at most about PASS_SLOTS / slots paths each.
    """
    paths = max(1, PASS_SLOTS // slots)
    step = min(points, max(1, paths // randomisations))
    run = max(1, paths // (step * randomisations))
    for first_point in range(0, points, step):
        for first in range(0, width * height, run):
            yield Launch(
                columns=width,
                rows=height,
                seed=seed,
                randomisations=randomisations,
                points=min(step, points - first_point),
                first_point=first_point,
                first=first,
                windows=min(run, width * height - first),
            )


def pass_sums(found: Contributions, launch: Launch, facets: int) -> list:
    """Sums over the points of each randomisation of a launch.

    Returns the sums by facet, (windows * randomisations, facets), of the rest and of the valid
    paths.
    """
    rows = launch.windows * launch.randomisations
    begin = np.searchsorted(found.path, np.arange(rows + 1) * launch.points)
    by_facet = sparse.csr_array((found.value, found.column, begin), shape=(rows, facets))
    by_facet.sum_duplicates()

    def total(values):
        return values.reshape(rows, -1).sum(axis=1, dtype=np.float64)

    return [by_facet, total(found.rest), total(found.valid)]


def chosen_facets(scene: Scene, groups) -> tuple:
    """Emitters whose facets get columns, the facets, each emitter's columns, the temperatures.

    The columns of an emitter are those of the primitives of its shape, (primitives,).
    """
    facets = FacetTable(scene)
    shapes = thermal_shapes(scene.mi)
    with_temperature = [shape for shape in shapes if shape.emitter().temperatures() is not None]
    known = {shape.emitter().group for shape in with_temperature}
    for group in known if groups is None else groups:
        if group not in {shape.emitter().group for shape in shapes}:
            raise unknown("group", group, known)
        if group not in known:
            raise InputError(f"{scene.name}: group {group} has no facets with temperatures")
    wanted = [
        shape for shape in with_temperature if groups is None or shape.emitter().group in groups
    ]
    if not wanted:
        raise InputError(f"{scene.name}: no facets with temperatures were chosen")
    numbers = [facets.of_primitives[shape] for shape in wanted]
    used, columns = np.unique(np.concatenate(numbers), return_inverse=True)
    ends = np.cumsum([len(of_shape) for of_shape in numbers])[:-1]
    emitters = [shape.emitter() for shape in wanted]
    return emitters, used, np.split(columns, ends), facets.temperature[used]
