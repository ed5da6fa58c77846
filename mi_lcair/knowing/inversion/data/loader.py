"""The data of a problem: measured images, numbers and trends, each with its scene."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from mi_lcair.errors import InputError, errors_of
from mi_lcair.estimate import WIDTH
from mi_lcair.knowing.inversion.data import readings
from mi_lcair.knowing.inversion.data.camera_image import COUNTS, CameraImage
from mi_lcair.knowing.inversion.data.datum import SPP_OF_VIEWS, Datum
from mi_lcair.knowing.inversion.data.nuisances import (
    GAIN,
    GRADIENT,
    MODEL,
    OFFSET,
    VIGNETTING,
    nuisances_of,
    shares_of_groups,
)
from mi_lcair.knowing.inversion.least_squares.newton import MOST_FACETS
from mi_lcair.knowing.inversion.least_squares.prediction import CommonNoise, DatumBlock
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings
from mi_lcair.knowing.inversion.unknowns import Where
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.paths.launch import UNIT
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.motions.table import Declared
from mi_lcair.rendering.parameters.modes import facet_temperatures
from mi_lcair.rendering.parameters.values import load_with_values, parameters_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.signatures.signature import measure_signature
from mi_lcair.table import read_table

DETAIL = 1e-3  # deviation from a goal that counts as one standard deviation, relative
RESOLUTION = 64  # pixels along each side of an aspect's view, which `spp` counts by
ASPECT, INTENSITY, ERROR = (
    ("azimuth_deg", "elevation_deg"),
    "intensity_W_sr",
    "standard_error_W_sr",
)


@dataclass
class Loader:
    """Loads the scenes of the data, each once for each set of parameters.

    motions: those that all scenes get.
    """

    motions: dict[str, Declared] = field(default_factory=dict)
    scenes: dict = field(default_factory=dict)

    def scene(self, entry: readings.Observation) -> Scene:
        key = entry.scene, tuple(sorted(entry.scene_parameters().items()))
        if key not in self.scenes:
            parameters = entry.scene_parameters()
            self.scenes[key] = load_with_values(entry.scene, parameters, motions=self.motions)
        return self.scenes[key]

    def datum(self, entry: readings.Observation, number: int, facet_groups: set[str]) -> Datum:
        """The datum of an entry; raises InputError with its name in front."""
        with errors_of(entry.name):
            return self._datum(entry, number, facet_groups)

    def _datum(self, entry: readings.Observation, number: int, facet_groups: set[str]) -> Datum:
        sight = None
        if isinstance(entry, readings.Measurement) and entry.contrast is not None:
            sight = readings.MeasuredContrast.of(entry.scene, entry.parameters, self.motions)
        camera = None
        if isinstance(entry, readings.Measurement) and entry.is_of_camera:
            camera = CameraImage.of(entry.scene, entry.parameters, self.motions)
        seen = sight or camera
        scene = seen.setting.view if seen else self.scene(entry)
        width, height = scene.sensor(entry.sensor).film().crop_size()
        scene.mi.integrator().check_differentiable()
        counts, views, aspects, sigma, common, spectrum = None, (), (), None, None, None
        plateau = None
        if isinstance(entry, readings.Candidate):
            counts = np.ones((height, width), dtype=bool)
            measured = np.full(height * width, np.nan)
        elif camera:
            values, counts, plateau = camera.measured(entry)
            measured = values[counts]
        elif entry.image is not None:
            values, sigma, counts, plateau = readings.measured_radiance(
                entry, scene.band, (height, width)
            )
            measured = values[counts]
            sigma = None if sigma is None else sigma[counts]
        elif entry.trend is not None:
            measured, sigma, views, aspects = from_trend(entry, scene)
        elif entry.spectrum is not None:
            spectrum = readings.MeasuredSpectrum.read(entry.spectrum, entry.sigma, scene)
            measured, sigma = spectrum.radiance, spectrum.sigma
        elif sight:
            measured = np.array([entry.contrast])
        else:
            measured, views = np.array([entry.intensity]), (scene,)
        measured_noise = noise_model(entry, scene.band, sigma)
        if camera:
            is_corrected = camera.scenario.camera.nuc and entry.quantity != COUNTS
            measured_noise = camera.noise(is_corrected, counts)
        noise = with_pixel_errors(measured_noise, entry)
        if not isinstance(entry, readings.Candidate):
            check_noise(noise(measured), measured)
            if counts is not None:
                ratios = entry.row_noise, entry.column_noise, entry.frame_noise
                common = CommonNoise.of_image(counts, float(np.mean(noise(measured))), *ratios)
        where = Where(
            entry.name,
            scene.band.name,
            entry.state,
            parameters_of(scene) | (seen.known() if seen else {}),
            facet_temperatures(scene, facet_groups),
            FacetTable(scene).centre if facet_groups else None,
        )
        if counts is None and where.facets:
            raise InputError(
                f"the facets of {min(where.facets)} are unknown, which needs images; this is a "
                "number"
            )
        has_few_facets = sum(map(len, where.facets.values())) <= MOST_FACETS
        has_shares = has_few_facets and counts is not None and camera is None
        shares = shares_of_groups(scene, entry.sensor, counts) if has_shares else {}
        return Datum(
            entry,
            number,
            scene,
            where,
            measured,
            noise,
            counts,
            views,
            aspects,
            sight=sight,
            shares=shares,
            nuisances=nuisances_of(entry, counts, shares) if has_few_facets else None,
            assumed=assumed_of(entry),
            plateau=plateau,
            camera=camera,
            common=common,
            is_spectral=has_spectral_materials(scene.mi),
            spectrum=spectrum,
        )


def goal_datum(
    goal: Goal, sampling: RenderSettings, motions: Mapping[str, Declared] = MappingProxyType({})
) -> Datum:
    """The datum of a goal: wanted intensities, all with the same small standard deviation."""
    entry = readings.Observation(goal.scene, "goal", dict(goal.parameters))
    scene = load_with_values(entry.scene, entry.scene_parameters(), motions=motions)
    scene.mi.integrator().check_differentiable()
    views = views_of(scene, goal.aspects)
    is_contrast = goal.background_K is not None
    of_view = Sampling(spp=sampling.spp or SPP_OF_VIEWS, seed=sampling.seed)
    signatures = [
        measure_signature(view, of_view, by_spectrum=is_contrast, parts=()) for view in views
    ]
    background = np.zeros(len(views))
    if is_contrast:
        area = np.array([result.effective_areas.projected_area for result in signatures])
        background = in_band_radiance(scene.band, goal.background_K) * area
    sigma = DETAIL * np.sqrt(np.mean([result.target.intensity**2 for result in signatures]))
    return Datum(
        entry=entry,
        number=0,
        scene=scene,
        where=Where(entry.name, scene.band.name, "", parameters_of(scene), {}),
        measured=(0.0 if goal.at_most else goal.value) + background,
        noise=lambda predicted: np.full(len(predicted), sigma),
        counts=None,
        views=views,
        aspects=goal.aspects,
        goal=goal,
        background=background,
        is_spectral=has_spectral_materials(scene.mi),
    )


def noise_model(entry: readings.Observation, band, sigma) -> Callable:
    """Function that gives the standard deviation of a measurement for predicted values."""
    if sigma is not None:
        return lambda predicted: sigma
    if entry.netd_mK is not None:
        return lambda predicted: readings.noise_of_netd(band, predicted, entry.netd_mK)
    return lambda predicted: np.full(len(predicted), entry.sigma)


def with_pixel_errors(noise: Callable, entry: readings.Observation) -> Callable:
    """Standard deviations with the error of each pixel's prediction that `model_sigma` states."""
    if entry.model_sigma is None:
        return noise
    return lambda predicted: np.hypot(noise(predicted), entry.model_error * predicted)


def assumed_of(entry: readings.Observation) -> frozenset[str]:
    """Names of the errors that an entry does not state."""
    faults = {GAIN, OFFSET, VIGNETTING, GRADIENT} if entry.camera_sigma is None else set()
    return frozenset(faults | ({MODEL} if entry.model_sigma is None else set()))


def check_noise(noise: np.ndarray, measured: np.ndarray) -> None:
    """Raise InputError for a standard deviation that the render's single precision cannot resolve.

    Rounding would then count as a difference of many standard deviations.
    """
    resolved = UNIT * np.sqrt(np.mean(np.square(measured)))
    if np.max(noise) < resolved:
        raise InputError(
            f"the noise {np.max(noise):.2g} is below the single precision of the renderer, "
            f"{resolved:.2g}; give a standard deviation that an instrument can have"
        )


def from_trend(entry, scene: Scene):
    """Intensities, standard deviations, views and aspects of a trend's CSV."""
    needed = (*ASPECT, INTENSITY, *(() if entry.sigma else (ERROR,)))
    table = read_table(entry.trend, needed)
    columns = table.numbers(needed)
    sigma = np.full(len(table.rows), entry.sigma) if entry.sigma else columns[ERROR]
    table.check_range(ERROR, sigma, WIDTH, "; or give sigma instead")
    aspects = tuple(zip(*(columns[name].tolist() for name in ASPECT)))
    return columns[INTENSITY], sigma, views_of(scene, aspects), aspects


def views_of(scene: Scene, aspects) -> tuple[Scene, ...]:
    """The scene as seen from each (azimuth, elevation), degrees."""
    return tuple(seen_from(scene, View(*aspect), RESOLUTION) for aspect in aspects)


def check_units(data: list[Datum], blocks: list[DatumBlock]) -> None:
    """Raise InputError for measured images whose unit is not that of the predicted radiance."""
    for datum, block in zip(data, blocks):
        if datum.is_image and datum.camera is None:
            readings.check_radiance(
                datum.entry.image, datum.measured, block.radiance.mean(axis=0), datum.scene.band
            )
