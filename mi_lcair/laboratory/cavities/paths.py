"""Effective emissivity of a cavity with any walls, by the renderer.

The isothermal part is 1 less the share of the rays that find their way out again. The aperture
therefore radiates, and what the sensor receives from it is that share. A wall of other
temperatures than the reference adds the share of what each radiates times its relative excess.
"""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

from mi_lcair.laboratory.cavities.rings import CavityView
from mi_lcair.laboratory.cavities.shape import CavityWall
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.triangles import set_triangles
from mi_lcair.rendering.measurands import ExcessFunction, Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, load
from mi_lcair.rendering.statistics import Totals, student_factor
from mi_lcair.rendering.window import Windows

RANDOMISATIONS = 16  # of the lattice, for intervals with 15 degrees of freedom
INTERVAL = student_factor(RANDOMISATIONS - 1)  # half a 95 % interval in standard errors
LEVELS = 60  # largest number of wall temperatures; those of a profile are rounded to as many
START = 1e-5  # distance of a ray's start from the aperture's plane, as a share of its radius
GLOW = 300.0  # temperature of the aperture, a blackbody, that shows what finds its way out [K]
LEFT = 1e-7  # radiance that the reflections beyond the last may add


@dataclass(frozen=True)
class Rays:
    """A view in place of a sensor. sampler: that of the scene's sensor."""

    view: CavityView
    random: mi.Sampler

    def class_name(self) -> str:
        return "CavityView"

    def sampler(self) -> mi.Sampler:
        return self.random

    def shutter_open(self) -> float:
        return 0.0

    def needs_aperture_sample(self) -> bool:
        return True

    def sample_ray(self, time, wavelength, place, sample):
        """Rays from the aperture's plane into the cavity, and their weight."""
        start, direction = self.view.ray(place, sample)
        start.z += START * self.view.spot
        return mi.Ray3f(start, direction), mi.Spectrum(1)


def reflections(emissivity: float) -> int:
    """Number of reflections after which LEFT remains, for the wall's emissivity."""
    return int(np.clip(np.ceil(np.log(LEFT) / np.log1p(-min(emissivity, 0.999))), 4, 10_000))


def scene_of_wall(
    wall: CavityWall, surface: dict, radiator: dict, kelvin: np.ndarray | None, most: int, band: str
) -> Scene:
    """The scene of a cavity.

    surface: the wall's BSDF. radiator: properties of its emission. kelvin: temperatures of its
    triangles [K]; None if it does not emit. most: number of reflections.
    """
    black = {"type": "diffuse", "reflectance": {"type": "spectrum", "value": 0.0}}
    glow = {"type": "thermal", "band": band, "temperature": GLOW, "group": "aperture"}
    shapes = {"aperture": _mesh("aperture", wall.corners, wall.aperture, black, glow)}
    walls = {}
    if kelvin is not None:
        temperature = {"type": "mesh_attribute", "name": "face_temperature"}
        walls = {"type": "thermal", "band": band, "group": "wall", "temperature": temperature}
        walls |= radiator
    shapes["wall"] = _mesh("wall", wall.corners, wall.wall, surface, walls, kelvin)
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "luminance"}
    return load(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {
                    "type": "bounce_path",
                    "max_bounces": most,
                    "emitter_sampling": False,
                },
                "sensor": {"type": "perspective", "film": film, "sampler": {"type": "lattice"}},
                **shapes,
            },
            optimize=False,
            parallel=False,
        )
    )


def _mesh(name, corners, faces, surface: dict, emission: dict, kelvin=None) -> mi.Mesh:
    """A mesh of the corners that its faces use."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(surface, parallel=False)
    if emission:
        properties["mesh_emitter"] = mi.load_dict(emission, parallel=False)
    properties["face_normals"] = True
    used, faces = np.unique(faces, return_inverse=True)
    mesh = mi.Mesh(name, len(used), len(faces.ravel()) // 3, props=properties)
    if kelvin is not None:
        mesh.add_attribute("face_temperature", 1, kelvin.astype(np.float32))
    set_triangles(mesh, corners[used], faces)
    return mesh


def rounded(kelvin: np.ndarray) -> np.ndarray:
    """Temperatures [K] rounded to LEVELS ones in even steps."""
    low, high = kelvin.min(), kelvin.max()
    if high == low:
        return kelvin
    step = (high - low) / (LEVELS - 1)
    return low + step * np.round((kelvin - low) / step)


def effective_emissivity(scene: Scene, view: CavityView, excess, sampling: Sampling) -> tuple:
    """Effective emissivity of a scene's cavity, and its standard error.

    Parameters
    ----------
    scene : Scene
        From `scene_of_wall`.
    view : View
    excess : callable or None
        Radiance of a blackbody at a temperature [K] as a ratio to that at the reference, less 1:
        (w,). It is -1 for the temperature None, which radiates nothing. None: isothermal.
    sampling : Sampling
        `tolerance` is that of the effective emissivity, half of the 95 % interval.

    Returns
    -------
    value, error : ndarray, shape (w,)
        For the wavelengths of `excess`; one for an isothermal cavity.
    paths : int
        Number of paths.
    """
    rays = Rays(view, scene.sensors[0].sampler())
    windows = Windows(rays, randomisations=RANDOMISATIONS)
    is_split = excess is not None
    measurands = Measurands.of("model" if is_split else None, is_split, parts=("group",))
    criterion = None
    if sampling.tolerance is not None:
        criterion = ExcessFunction(
            lambda total: INTERVAL * _estimate(total, excess)[1].max() / sampling.tolerance
        )
    total = measure(scene, windows, sampling, measurands, criterion)
    return *_estimate(total, excess), int(total.traced[0])


def _estimate(total: Totals, excess) -> tuple[np.ndarray, np.ndarray]:
    """Effective emissivities and their standard errors."""
    sources = total.emitters.sources.list
    if excess is None:
        L = in_band_radiance(total.emitters.band, GLOW)
        return 1 - total.mean() / L, total.standard_error() / L
    factors = np.array(
        [
            excess(None if source.group == "aperture" else source.temperature) / source.in_band
            for source in sources
        ]
    )
    names = [f"source.{k}" for k in range(len(sources))]
    value = 1 + np.array([total.mean(name)[0] for name in names]) @ factors
    deviations = np.array([total.deviations(name)[0] for name in names])
    scatter = np.sqrt(np.sum((factors.T @ deviations) ** 2, axis=1))
    missed = total.missed_error("group.aperture")[0] / in_band_radiance(total.emitters.band, GLOW)
    return value, np.hypot(scatter, missed)
