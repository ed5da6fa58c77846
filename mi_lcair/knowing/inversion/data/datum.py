"""A measurement with its scene: what the scene predicts for it, and the derivatives."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse
from scipy.ndimage import maximum_filter

from mi_lcair.derivatives.images import differentiate_image, facet_matrix, randomised_images
from mi_lcair.derivatives.window import differentiate_intensity
from mi_lcair.knowing.inversion.data import readings
from mi_lcair.knowing.inversion.data.camera_image import ROOM, CameraImage
from mi_lcair.knowing.inversion.data.nuisances import nuisances_of, shares_of_groups
from mi_lcair.knowing.inversion.least_squares.prediction import (
    CommonNoise,
    DatumBlock,
    Nuisances,
    Weighing,
    variance_of_mean,
)
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings
from mi_lcair.knowing.inversion.unknowns import INSTRUMENT, Unknown, Where
from mi_lcair.physics.blackbody import in_band_slope
from mi_lcair.rendering.parameters.modes import with_facets
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene

SEEDS = 104_729  # distance between the seeds of two renders, whose noise must be independent
SPP_OF_VIEWS = 16  # default of `spp` for the aspects of a trend
MAIN, PILOT = 0, 1  # kinds of renders, with seeds of their own
NEIGHBOURS = 5  # side of the square of pixels of which the largest variance of the render counts


@dataclass(frozen=True)
class Datum:
    """A measurement, or a candidate for one, with its scene.

    Attributes
    ----------
    entry : Observation
        The entry of the problem.
    number : int
        Its number among the data and candidates.
    scene : Scene
    where : Where
        Its name, band and state, and the parameters of its scene.
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
    sight : MeasuredContrast, optional
        Line of sight along which a contrast was measured.
    nuisances : Nuisances, optional
        Errors of the camera and of the scene that pixels share.
    assumed : frozenset of str
        Names of those of them that the problem does not state.
    plateau : ndarray of bool, shape (H, W), or None
        Pixels that do not count because they seem to be saturated.
    shares : dict of str to ndarray, shape (n,)
        Share of each value that comes from each group; empty if it is not known.
    camera : CameraImage, optional
        Camera whose image was measured; the values are electrons.
    common : CommonNoise, optional
        Noise that rows, columns or all pixels share.
    is_spectral : bool
        Whether the scene has materials by wavelength.
    spectrum : MeasuredSpectrum, optional
        Spectrum that was measured.
    """

    entry: readings.Observation
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
    sight: readings.MeasuredContrast | None = None
    nuisances: Nuisances | None = None
    assumed: frozenset[str] = frozenset()
    plateau: np.ndarray | None = None
    shares: dict[str, np.ndarray] = field(default_factory=dict)
    camera: CameraImage | None = None
    common: CommonNoise | None = None
    is_spectral: bool = False
    spectrum: readings.MeasuredSpectrum | None = None

    @property
    def label(self) -> str:
        return self.entry.name

    @property
    def is_image(self) -> bool:
        return self.counts is not None

    @property
    def quantity(self) -> str:
        """What was measured, with its unit."""
        if self.camera:
            return "signal (electrons)"
        if self.is_image:
            return "radiance (W m^-2 sr^-1)"
        if self.spectrum:
            return "spectral radiance (W m^-2 sr^-1 um^-1)"
        if self.sight:
            return "contrast (W m^-2)"
        return f"{self.goal.quantity if self.goal else 'intensity'} (W/sr)"

    def image(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) of the pixels that count as an image (H, W), NaN elsewhere."""
        result = np.full(self.counts.shape, np.nan)
        result[self.counts] = values
        return result

    def bad_pixels(self, block: DatumBlock) -> list[tuple[int, int]]:
        """Row and column of the pixels of an image that an estimate left out."""
        if not self.is_image:
            return []
        is_bad = block.weight == 0
        return [(int(row), int(column)) for row, column in np.argwhere(self.counts)[is_bad]]

    def numbers(self, unknowns: list[Unknown]) -> list[int]:
        """Numbers of the unknowns that affect this datum."""
        return [k for k, unknown in enumerate(unknowns) if self.number in unknown.data]

    def settings(self, unknowns: list[Unknown], x: np.ndarray) -> dict[str, float]:
        """Values of the scene's parameters by name."""
        return {
            unknowns[k].name: float(x[k])
            for k in self.numbers(unknowns)
            if unknowns[k].kind not in ("facet", *INSTRUMENT)
        }

    def facet_settings(self, unknowns: list[Unknown], x: np.ndarray) -> dict[int, float]:
        """Values of the unknown facet temperatures by facet."""
        return {
            unknowns[k].facet: float(x[k])
            for k in self.numbers(unknowns)
            if unknowns[k].kind == "facet"
        }

    def follows(self, unknown: Unknown) -> bool:
        """Whether the radiance is linear in the blackbody radiance, or the value, of an unknown.

        A contrast and a camera's image are not: air and detector weigh the wavelengths. Nor is that
        of materials by wavelength.
        """
        if (self.sight or self.camera or self.is_spectral) and unknown.kind == "temperature":
            return False
        if unknown.kind == "temperature":
            group = unknown.name.removesuffix(".temperature")
            return "@" in group or not any(
                name.startswith(f"{group}@") for name in self.where.parameters
            )
        return unknown.kind in ("facet", "radiance", *INSTRUMENT)

    @contextmanager
    def at(self, unknowns: list[Unknown], x: np.ndarray):
        """Context manager in which the scene has the values x of the unknowns.

        It gives the datum with the weather and the pointing of its camera that they say.
        """
        values, datum = self.settings(unknowns, x), self
        measured = {name: of for name in ("sight", "camera") if (of := getattr(self, name))}
        around = [name for of in measured.values() for name in of.known() if name in values]
        if conditions := {name: values.pop(name) for name in around}:
            datum = replace(self, **{n: of.in_conditions(conditions) for n, of in measured.items()})
        with changed(self.scene, values), with_facets(self.scene, self.facet_settings(unknowns, x)):
            if datum.camera and any(unknowns[k].kind == "motion" for k in self.numbers(unknowns)):
                datum = replace(datum, camera=datum.camera.facing(ROOM))
            yield datum

    def moved(self, unknowns: list[Unknown], x: np.ndarray) -> "Datum":
        """The datum with the shares of groups at the values x, where motions change them.

        An error of a group with edges in wrong places would seem to be another pattern than that
        of its temperature.
        """
        kinds = {unknowns[k].kind for k in self.numbers(unknowns)}
        if not self.shares or "motion" not in kinds:
            return self
        with self.at(unknowns, x):
            shares = shares_of_groups(self.scene, self.entry.sensor, self.counts)
        return replace(self, shares=shares, nuisances=nuisances_of(self.entry, self.counts, shares))

    def weighing(
        self, unknowns: list[Unknown], x: np.ndarray, sampling: RenderSettings
    ) -> Weighing:
        """Weights of the measured values, inverse variances of measurement and render, and errors
        that they share.

        They come from a render of their own. A variance of few samples is correlated with their
        mean: a pixel whose samples all missed a bright edge is too dark and seems to have no noise.
        Weights from the same samples would bias the solution, and so would shared errors.
        """
        if self.goal is not None:
            return Weighing(self.noise(self.measured) ** -2.0)
        with self.at(unknowns, x) as datum:
            if not self.is_image:
                radiance, _ = datum._traced_numbers([], sampling, self._seed(sampling, PILOT))
                variance = variance_of_mean(radiance)
            else:
                images = datum._images(sampling, self._seed(sampling, PILOT))
                radiance = images[:, self.counts]
                variance = maximum_filter(variance_of_mean(images), NEIGHBOURS)[self.counts]
        predicted, common = radiance.mean(axis=0), self.common
        if (nuisances := self.moved(unknowns, x).nuisances) is not None:
            common = nuisances.added_to(common, predicted)
        return Weighing(1 / (self.noise(predicted) ** 2 + self._spread * variance), common)

    @property
    def _spread(self) -> float:
        """Number of pixels that share an error of the render, see `DatumBlock`."""
        return self.camera.spread if self.camera else 1.0

    def _images(self, sampling: RenderSettings, seed: int) -> np.ndarray:
        """Independent predictions of the whole image, (R, H, W)."""
        count = sampling.randomisations
        if self.camera:
            return self.camera.predicted([], sampling.spp, seed, count)[0]
        settings = self._sampling(sampling, seed)
        return randomised_images(self.scene, settings, count).astype(float)

    def _seed(self, sampling: RenderSettings, kind: int) -> int:
        return (sampling.seed + SEEDS * (2 * self.number + kind)) % 2**32

    def block(self, unknowns: list[Unknown], x: np.ndarray, sampling: RenderSettings) -> DatumBlock:
        """The prediction and its derivatives at the values x of the unknowns.

        Its weights are 1, see `weighing`. Raises InputError for values that no surface can have.
        """
        numbers = self.numbers(unknowns)
        dense = [k for k in numbers if unknowns[k].kind not in ("facet", *INSTRUMENT)]
        facets = [k for k in numbers if unknowns[k].kind == "facet"]
        names = [unknowns[k].name for k in dense]
        seed = self._seed(sampling, MAIN)
        with self.at(unknowns, x) as datum:
            traced = datum._traced_image if self.is_image else datum._traced_numbers
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
        kinds, own = {unknowns[k].kind: k for k in numbers}, [unknowns[k] for k in dense]
        linear_in_value = self.camera or self.is_spectral
        columns_of = np.array([*dense, *facets], dtype=int)
        return DatumBlock(
            measured=self.measured,
            noise=self.noise,
            radiance=radiance,
            columns=columns,
            unknown=columns_of,
            reference=x[columns_of],
            band=self.scene.band,
            is_temperature=np.array(
                [
                    unknowns[k].kind in ("temperature", "facet") and not linear_in_value
                    for k in columns_of
                ],
                dtype=bool,
            ),
            weight=np.ones(len(self.measured)),
            gain=kinds.get("gain"),
            offset=kinds.get("offset"),
            paths=self._paths(sampling),
            is_image=self.is_image,
            spread=self._spread,
            # One direction says little about the products of many nodes or points
            learns_curvature=self.spectrum is None and not any(u.centre for u in own),
            half_width=self.goal.value if self.goal is not None and self.goal.at_most else 0.0,
        )

    def _paths(self, sampling: RenderSettings) -> int:
        """Paths of a render with derivatives; 0 for a contrast, whose scenario chooses them."""
        if self.sight:
            return 0
        total = 0
        for view in self.views or (self.scene,):
            settings = self._sampling(sampling, 0, view)
            camera = view.sensor(settings.sensor)
            total += int(settings.settled(camera).spp * np.prod(camera.film().crop_size()))
        return total

    def _sampling(self, sampling: RenderSettings, seed: int, view: Scene | None = None) -> Sampling:
        """How its scene is rendered, or a view of it from another aspect."""
        if view in (None, self.scene):
            return Sampling(spp=sampling.spp, seed=seed, sensor=self.entry.sensor)
        return Sampling(spp=sampling.spp or SPP_OF_VIEWS, seed=seed)

    def _traced_image(self, names, sampling: RenderSettings, seed: int):
        """Radiance (R, n) and columns [(n, K)] of the pixels that count."""
        if self.camera:
            radiance, derivatives = self.camera.predicted(
                names, sampling.spp, seed, sampling.randomisations
            )
            columns = [of[:, self.counts].T for of in derivatives]
            return radiance[:, self.counts], columns
        settings = self._sampling(sampling, seed)
        images = differentiate_image(self.scene, names, settings, sampling.randomisations)
        radiance = images.radiance[:, self.counts].astype(float)
        columns = [of[:, self.counts].T.astype(float) for of in images.derivatives]
        return radiance, columns

    def _facet_columns(self, facets, values, sampling, seed):
        """Radiance and sparse columns of facets' temperatures."""
        groups = sorted({unknown.name for unknown in facets})
        seen = facet_matrix(
            self.scene,
            groups=groups,
            sensor=self.entry.sensor,
            spp=sampling.spp,
            seed=seed,
            randomisations=sampling.randomisations,
        )
        column_of = {facet: k for k, facet in enumerate(seen.facets.tolist())}
        wanted = [column_of[unknown.facet] for unknown in facets]
        temperature = seen.temperature.copy()
        temperature[wanted] = values
        rows = np.flatnonzero(self.counts.ravel())
        radiance = seen.radiance(temperature).reshape(len(seen.matrices), -1)[:, rows]
        rate = sparse.diags_array(in_band_slope(seen.band, values))
        columns = [sparse.csr_array(matrix[rows][:, wanted] @ rate) for matrix in seen.matrices]
        return radiance, columns

    def _traced_numbers(self, names, sampling: RenderSettings, seed: int):
        """Intensities (R, n) and columns [(n, K)]: of views, a contrast or a spectrum."""
        if self.spectrum:
            return self.spectrum.predicted(self.scene, names, self._sampling(sampling, seed))
        if self.sight:
            how = sampling.spp, seed, sampling.randomisations
            contrast, columns = self.sight.contrast(names, *how)
            return contrast[:, None], list(columns.T[:, None, :])
        radiance, columns = [], []
        for view in self.views:
            of_view = self._sampling(sampling, seed, view)
            slopes = differentiate_intensity(view, names, of_view)
            each = readings.spread(slopes.deviations)
            radiance.append(slopes.value + each[0])
            columns.append(slopes.derivative[:, None] + each[1:])
        radiance = np.array(radiance).T  # (R, n)
        by_view = np.array(columns).reshape(len(self.views), len(names), len(radiance))
        columns = list(by_view.transpose(2, 0, 1))
        return radiance, columns
