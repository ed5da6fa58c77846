"""The data of a problem: measured images, numbers and trends, each with its scene."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.ndimage import maximum_filter

from mi_lcair.errors import InputError
from mi_lcair.inversion.facet_temperatures import facet_temperatures, with_facets
from mi_lcair.inversion.images import check_radiance, measured_radiance, noise_of_netd, slope
from mi_lcair.inversion.measurement import Candidate, Place
from mi_lcair.inversion.prediction import Block, variance_of_mean
from mi_lcair.inversion.tables import Goal, Sampling
from mi_lcair.inversion.unknowns import Unknown, Where
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.scene import Scene, load
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.sensitivity.differences import randomised_images
from mi_lcair.sensitivity.facets import facet_matrix
from mi_lcair.sensitivity.images import derivative_images
from mi_lcair.sensitivity.parameters import changed, parameters
from mi_lcair.sensitivity.window import sensitivities
from mi_lcair.signatures.signature import signature
from mi_lcair.table import read_table

SEEDS = 104_729  # distance between the seeds of two renders, whose noise must be independent
DETAIL = 1e-3  # deviation from a goal that counts as one standard deviation, relative
# Pixels along each side of an aspect's view, which `spp` counts by, and its default
RESOLUTION, SPP_OF_VIEWS = 64, 16
MAIN, PILOT = 0, 1  # kinds of renders, with seeds of their own
NEIGHBOURS = 5  # side of the square of pixels of which the largest variance of the render counts
ASPECT, INTENSITY, ERROR = (
    ("azimuth_deg", "elevation_deg"),
    "intensity_W_sr",
    "standard_error_W_sr",
)


@dataclass(frozen=True)
class Datum:
    """A measurement, or a candidate for one, with its scene.

    Attributes
    ----------
    place : Place
        The entry of the problem.
    number : int
        Its number among the data and candidates.
    scene : Scene
    where : Where
        What unknowns need to know of it.
    measured : ndarray, shape (n,)
        Measured values: radiances of the pixels that count, or intensities.
    noise : callable
        Standard deviations (n,) for predicted values (n,).
    counts : ndarray of bool, shape (H, W), or None
        Pixels that count; None for numbers.
    views : tuple of Scene
        For numbers: the scene as seen from each aspect.
    aspects : tuple
        Azimuth and elevation of the views of a trend, degrees.
    goal : Goal, optional
        What is wanted in place of a measurement.
    background : ndarray, shape (n,), or 0
        Intensity of the background that the target hides [W/sr], for a wanted contrast.
    """

    place: Place
    number: int
    scene: Scene
    where: Where
    measured: np.ndarray
    noise: Callable
    counts: np.ndarray | None
    views: tuple[Scene, ...] = ()
    aspects: tuple[tuple[float, float], ...] = ()
    goal: Goal | None = None
    background: np.ndarray | float = 0.0

    @property
    def label(self) -> str:
        return self.place.name

    @property
    def is_image(self) -> bool:
        return self.counts is not None

    @property
    def quantity(self) -> str:
        """What was measured, with its unit."""
        if self.is_image:
            return "radiance (W m^-2 sr^-1)"
        return f"{self.goal.quantity if self.goal else 'intensity'} (W/sr)"

    def image(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) of the pixels that count as an image (H, W), NaN elsewhere."""
        result = np.full(self.counts.shape, np.nan)
        result[self.counts] = values
        return result

    def own(self, unknowns: list[Unknown]) -> list[int]:
        """Numbers of the unknowns that affect this datum."""
        return [k for k, one in enumerate(unknowns) if self.number in one.data]

    def settings(self, unknowns: list[Unknown], x: np.ndarray) -> dict[str, float]:
        """Values of the scene's parameters by name."""
        return {
            unknowns[k].name: float(x[k])
            for k in self.own(unknowns)
            if unknowns[k].kind not in ("facet", "gain", "offset")
        }

    def facet_settings(self, unknowns: list[Unknown], x: np.ndarray) -> dict[int, float]:
        """Values of the unknown facet temperatures by facet."""
        return {
            unknowns[k].facet: float(x[k])
            for k in self.own(unknowns)
            if unknowns[k].kind == "facet"
        }

    def follows(self, one: Unknown) -> bool:
        """Whether the radiance is linear in the blackbody radiance, or the value, of an unknown."""
        if one.kind == "temperature":
            group = one.name.removesuffix(".temperature")
            return "@" in group or not any(
                name.startswith(f"{group}@") for name in self.where.parameters
            )
        return one.kind in ("facet", "radiance", "gain", "offset")

    @contextmanager
    def at(self, unknowns: list[Unknown], x: np.ndarray):
        """Context manager in which the scene has the values x of the unknowns."""
        with (
            changed(self.scene, self.settings(unknowns, x)),
            with_facets(self.scene, self.facet_settings(unknowns, x)),
        ):
            yield

    def weight(self, unknowns: list[Unknown], x: np.ndarray, sampling: Sampling) -> np.ndarray:
        """Weights (n,) of the measured values: inverse variances of measurement and render.

        They come from a render of their own. A variance of few samples is correlated with their
        mean: a pixel whose samples all missed a bright edge is too dark and seems to have no noise.
        Weights from the same samples would bias the solution.
        """
        if self.goal is not None:
            return self.noise(self.measured) ** -2.0
        with self.at(unknowns, x):
            if not self.is_image:
                radiance, _ = self._traced_numbers([], sampling, self._seed(sampling, PILOT))
                variance = variance_of_mean(radiance)
            else:
                images = randomised_images(
                    self.scene,
                    self.place.sensor,
                    sampling.spp,
                    self._seed(sampling, PILOT),
                    sampling.randomisations,
                ).astype(float)
                radiance = images[:, self.counts]
                variance = maximum_filter(variance_of_mean(images), NEIGHBOURS)[self.counts]
        return 1 / (self.noise(radiance.mean(axis=0)) ** 2 + variance)

    def _seed(self, sampling: Sampling, kind: int) -> int:
        return (sampling.seed + SEEDS * (2 * self.number + kind)) % 2**32

    def block(self, unknowns: list[Unknown], x: np.ndarray, sampling: Sampling) -> Block:
        """The prediction and its derivatives at the values x of the unknowns.

        Its weights are 1, see `weight`. Raises InputError for values that no surface can have.
        """
        own = self.own(unknowns)
        dense = [k for k in own if unknowns[k].kind not in ("facet", "gain", "offset")]
        facets = [k for k in own if unknowns[k].kind == "facet"]
        names = [unknowns[k].name for k in dense]
        seed = self._seed(sampling, MAIN)
        with self.at(unknowns, x):
            traced = self._traced_image if self.is_image else self._traced_numbers
            if names or not facets:
                radiance, columns = traced(names, sampling, seed)
            if facets:
                radiance, of_facets = self._facet_columns(
                    [unknowns[k] for k in facets], x[facets], sampling, seed
                )
                columns = (
                    [np.concatenate([a, b.toarray()], axis=1) for a, b in zip(columns, of_facets)]
                    if names
                    else of_facets
                )
        kinds = {unknowns[k].kind: k for k in own}
        numbers = np.array([*dense, *facets], dtype=int)
        return Block(
            measured=self.measured,
            noise=self.noise,
            radiance=radiance,
            columns=columns,
            unknown=numbers,
            reference=x[numbers],
            band=self.scene.band,
            is_temperature=np.array(
                [unknowns[k].kind in ("temperature", "facet") for k in numbers], dtype=bool
            ),
            weight=np.ones(len(self.measured)),
            gain=kinds.get("gain"),
            offset=kinds.get("offset"),
            half_width=self.goal.value if self.goal is not None and self.goal.at_most else 0.0,
        )

    def _traced_image(self, names, sampling: Sampling, seed: int):
        """Radiance (R, n) and columns [(n, K)] of the pixels that count."""
        found = derivative_images(
            self.scene,
            names,
            sensor=self.place.sensor,
            spp=sampling.spp,
            seed=seed,
            randomisations=sampling.randomisations,
        )
        radiance = found.radiance[:, self.counts].astype(float)
        columns = [of[:, self.counts].T.astype(float) for of in found.columns]
        return radiance, columns

    def _facet_columns(self, facets, values, sampling, seed):
        """Radiance and sparse columns of facets' temperatures."""
        groups = sorted({one.name for one in facets})
        found = facet_matrix(
            self.scene,
            groups=groups,
            sensor=self.place.sensor,
            spp=sampling.spp,
            seed=seed,
            randomisations=sampling.randomisations,
        )
        place = {facet: k for k, facet in enumerate(found.facets.tolist())}
        chosen = [place[one.facet] for one in facets]
        temperature = found.temperature.copy()
        temperature[chosen] = values
        rows = np.flatnonzero(self.counts.ravel())
        radiance = found.radiance(temperature).reshape(len(found.matrices), -1)[:, rows]
        rate = sparse.diags_array(slope(found.band, values))
        columns = [sparse.csr_array(matrix[rows][:, chosen] @ rate) for matrix in found.matrices]
        return radiance, columns

    def _traced_numbers(self, names, sampling: Sampling, seed: int):
        """Intensities (R, n) and columns [(n, K)], one row for each view."""
        radiance, columns = [], []
        for view in self.views:
            is_own = view is self.scene
            found = sensitivities(
                view,
                names,
                sensor=self.place.sensor if is_own else 0,
                spp=sampling.spp if is_own else sampling.spp or SPP_OF_VIEWS,
                seed=seed,
            )
            R = found.deviations.shape[1]
            each = found.deviations * np.sqrt(R * (R - 1))  # of one randomisation
            radiance.append(found.value + each[0])
            columns.append(found.derivative[:, None] + each[1:])
        radiance = np.array(radiance).T  # (R, n)
        by_view = np.array(columns).reshape(len(self.views), len(names), R)
        columns = list(by_view.transpose(2, 0, 1))
        return radiance, columns


@dataclass
class Loader:
    """Loads the scenes of the data, each once for each set of parameters."""

    scenes: dict = field(default_factory=dict)

    def scene(self, place: Place) -> Scene:
        key = place.scene, tuple(sorted(place.scene_parameters().items()))
        if key not in self.scenes:
            self.scenes[key] = load(place.scene, **place.scene_parameters())
        return self.scenes[key]

    def datum(self, place: Place, number: int, facet_groups: set[str]) -> Datum:
        """The datum of an entry; raises InputError with its name in front."""
        try:
            return self._datum(place, number, facet_groups)
        except InputError as error:
            raise InputError(f"{place.name}: {error}") from None

    def _datum(self, place: Place, number: int, facet_groups: set[str]) -> Datum:
        scene = self.scene(place)
        width, height = scene.sensor(place.sensor).film().crop_size()
        check_closure(scene)
        counts, views, aspects, sigma = None, (), (), None
        if isinstance(place, Candidate):
            counts = np.ones((height, width), dtype=bool)
            measured = np.full(height * width, np.nan)
        elif place.image is not None:
            values, sigma, counts = measured_radiance(place, scene.band, (height, width))
            measured = values[counts]
            sigma = None if sigma is None else sigma[counts]
        elif place.trend is not None:
            measured, sigma, views, aspects = from_trend(place, scene)
        else:
            measured, views = np.array([place.intensity]), (scene,)
        noise = noise_model(place, scene.band, sigma)
        where = Where(
            place.name,
            scene.band.name,
            place.state,
            parameters(scene),
            facet_temperatures(scene, facet_groups),
        )
        return Datum(place, number, scene, where, measured, noise, counts, views, aspects)


def goal_datum(goal: Goal, sampling: Sampling) -> Datum:
    """The datum of a goal: wanted intensities, all with the same small standard deviation."""
    place = Place(goal.scene, "goal", dict(goal.parameters))
    scene = load(place.scene, **place.scene_parameters())
    check_closure(scene)
    views = views_of(scene, goal.aspects)
    is_contrast = goal.background_K is not None
    found = [
        signature(
            view, spp=sampling.spp or SPP_OF_VIEWS, seed=sampling.seed, by_spectrum=is_contrast
        )
        for view in views
    ]
    background = np.zeros(len(views))
    if is_contrast:
        area = np.array([result.effective_areas.projected_area for result in found])
        background = in_band_radiance(scene.band, goal.background_K) * area
    sigma = DETAIL * np.sqrt(np.mean([result.target.intensity**2 for result in found]))
    return Datum(
        place=place,
        number=0,
        scene=scene,
        where=Where(place.name, scene.band.name, "", parameters(scene), {}),
        measured=(0.0 if goal.at_most else goal.value) + background,
        noise=lambda predicted: np.full(len(predicted), sigma),
        counts=None,
        views=views,
        aspects=goal.aspects,
        goal=goal,
        background=background,
    )


def noise_model(place: Place, band, sigma) -> Callable:
    """Function that gives the standard deviation of a measurement for predicted values."""
    if sigma is not None:
        return lambda predicted: sigma
    if place.netd_mK is not None:
        return lambda predicted: noise_of_netd(band, predicted, place.netd_mK)
    return lambda predicted: np.full(len(predicted), place.sigma)


def from_trend(place, scene: Scene):
    """Intensities, standard deviations, views and aspects of a trend's CSV."""
    needed = (*ASPECT, INTENSITY, *(() if place.sigma else (ERROR,)))
    table = read_table(place.trend, needed)
    columns = table.numbers(needed)
    sigma = np.full(len(table.rows), place.sigma) if place.sigma else columns[ERROR]
    if not (sigma > 0).all():
        line = table.rows[int(np.argmin(sigma > 0))][0]
        raise InputError(f"{place.trend}, line {line}: {ERROR} is not positive; give sigma instead")
    aspects = tuple(zip(*(columns[name].tolist() for name in ASPECT)))
    return columns[INTENSITY], sigma, views_of(scene, aspects), aspects


def views_of(scene: Scene, aspects) -> tuple[Scene, ...]:
    """The scene as seen from each (azimuth, elevation), degrees."""
    return tuple(seen_from(scene, View(*aspect), RESOLUTION) for aspect in aspects)


def check_closure(scene: Scene) -> None:
    """Raise InputError for a scene whose radiance has no derivatives."""
    if getattr(scene.mi.integrator(), "closure", None) == "tail":
        raise InputError(f"{scene.name}: closure = tail has no derivatives; use none or ambient")


def check_units(data: list[Datum], blocks: list[Block]) -> None:
    """Raise InputError for measured images whose unit is not that of the predicted radiance."""
    for datum, block in zip(data, blocks):
        if datum.is_image:
            check_radiance(
                datum.place.image, datum.measured, block.radiance.mean(axis=0), datum.scene.band
            )
