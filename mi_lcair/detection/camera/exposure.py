"""Electrons of the model and its background in the samples of a frame, before optics and noise."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.detection.camera.optics import OVERSAMPLING
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.setting import Setting
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.plugins.recorders.radiance import up_to_prefix
from mi_lcair.rendering.images.spectral import REST, Arrival
from mi_lcair.rendering.images.truth import add_parts, layer_of, parts_of, with_parts
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.pixels import PixelCriterion, averaged, pixel_errors, surroundings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import UNSEEN, Totals, student_factor
from mi_lcair.rendering.window import Windows

# Most ranges at which the air is computed, and the ratio of neighbouring ones less 1, if these are
# fewer. Values at other ranges are interpolated linearly.
RANGES, STEP = 129, 0.005
# Independent randomisations of a part's points. The error of a pixel averages over many parts, so
# that two of each are enough.
RANDOMISATIONS = 2
SMALLEST = 1e-3  # size of an image of a model's light, relative to the largest one
MOST_NOISY = 1e-3  # largest share of the frame with a larger error than the camera's noise
DIRECT = f"target.{up_to_prefix(0)}"  # beginning of the channels of paths without a reflection


@dataclass(frozen=True, kw_only=True)
class TracedModel:
    """What is known of the paths through a camera's window, whatever arrives of their light.

    Attributes
    ----------
    sources : Sources
        Sources of the channels.
    spp : int
        Paths through a pixel, or through the model where it is smaller.
    rms_error : float
        Rms standard error over the pixels on the model, as a fraction of its mean radiance.
    reached : bool or None
        Whether a tolerance was reached; None without one.
    invalid, paths : int
        Number of samples that do not count, and of all.
    followed : str
        What the paths follow, in words.
    """

    sources: Sources
    spp: int
    rms_error: float
    reached: bool | None
    invalid: int
    paths: int
    followed: str


@dataclass(frozen=True, kw_only=True)
class Exposure(TracedModel):
    """The model in the samples of a camera's window, through the air, less the background.

    Arrays have the shape (rows, columns) of the samples. The attributes of `TracedModel` come
    first.

    Attributes
    ----------
    contrast, radiance : ndarray
        Electrons of a pixel, and in-band radiance at the aperture with the detector's response, W
        m^-2 sr^-1, of each sample, less those of the background that the model hides.
    error : ndarray
        Standard error of `contrast` from the rendering, electrons.
    share : ndarray
        Share of each sample that the model fills.
    intensities : dict of str to float
        Intensity of the model before the air by channel, see `Arrival`; W/sr for a unit of it. It
        and `area` are those of the part in the frame.
    area : float
        Projected area of the model, m^2.
    variants : tuple of mapping of str to ndarray
        Electrons that arrive from the model with other temperatures of the sources, by channel.
    picture : TargetPicture or None
        The model in the parts of the window, for any of some ranges.
    truth : dict of str to ndarray, shape (H, W)
        Layers of the truth in the frame's pixels, see `frame_layers`; empty without it.
    """

    contrast: np.ndarray
    radiance: np.ndarray
    error: np.ndarray
    share: np.ndarray
    intensities: dict[str, float]
    area: float
    variants: tuple[Mapping[str, np.ndarray], ...] = ()
    picture: "TargetPicture | None" = None
    truth: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class TargetPicture:
    """What a model sends from the parts of a camera's window, for any range of a line of sight.

    The air changes the spectrum of each source in its own way. The light of the model is therefore
    the sum of few images, of which each range has its own amounts.

    Attributes
    ----------
    images : ndarray, shape (1 + K, rows, columns)
        Share of each part that the model fills, and K images of its light. Only parts in the frame
        count.
    weights : dict of str to ndarray, shape (K,)
        How much of each image the electrons for a unit of a channel add, see `amounts`.
    """

    images: np.ndarray
    weights: dict[str, np.ndarray]

    def amounts(self, arrival: Arrival) -> np.ndarray:
        """Amounts of the images of light at the ranges of an arrival, (K, r)."""
        amounts = np.zeros((len(self.images) - 1, len(arrival.path)))
        for name, weights in self.weights.items():
            amounts += np.multiply.outer(weights, arrival.arrives[name])
        return amounts

    @staticmethod
    def of(
        seen: dict[str, np.ndarray],
        arrival: Arrival,
        inside: np.ndarray,
        place: Callable[[np.ndarray], np.ndarray],
    ) -> "TargetPicture":
        """The picture of a model.

        Parameters
        ----------
        seen : dict of str to ndarray, shape (n,)
            Channels of the parts on the model.
        arrival : Arrival
            What arrives from ranges between which the picture is used.
        inside : ndarray, shape (n,)
            Whether a part is in the frame.
        place : callable
            Gives the image of values of the parts on the model.
        """
        channels = {name: seen[name] for name in arrival.in_band} | {REST: arrival.rest(seen)}
        sums = {name: float(np.sum(values[inside])) for name, values in channels.items()}
        names = [name for name, value in sums.items() if value > 0]
        table = np.zeros((len(names), len(arrival.path)))
        for row, name in zip(table, names):
            row[:] = sums[name] * arrival.arrives[name]
        bases, sizes, _ = np.linalg.svd(table, full_matrices=False)
        bases = bases[:, sizes > SMALLEST * sizes.max(initial=0.0)]
        images = [seen["target.hit"] * inside]
        for basis in bases.T:
            of_names = (part / sums[name] * channels[name] for part, name in zip(basis, names))
            images.append(sum(of_names, start=0.0 * inside) * inside)
        weights = {name: sums[name] * row for name, row in zip(names, bases)}
        return TargetPicture(np.array([place(image) for image in images]), weights)


def windows_of(view: CameraView, scene: Scene, by_randomisation: bool = False) -> Windows:
    """The samples of a camera's window as pixels."""
    columns, rows = view.size
    return Windows(
        view.sensor(scene),
        columns,
        rows,
        RANDOMISATIONS,
        parts=min(view.parts**2, columns * rows),
        are_pixels=True,
        by_randomisation=by_randomisation,
    )


@dataclass(frozen=True, kw_only=True)
class WindowPaths(TracedModel):
    """What the paths through a camera's window know of the model, before the air and the detector.

    It serves any air, background and detector within the band of the render, and other temperatures
    of the sources. The attributes of `TracedModel` come first.

    Attributes
    ----------
    view : CameraView
    band : Band
        Band of the render.
    on : ndarray of bool, shape (parts,)
        Which parts of the window have a share of the model.
    seen : dict of str to ndarray, shape (n,)
        Means of the channels in those parts.
    sums : dict of str to ndarray, shape (1,)
        Sums of the channels over the window.
    variance : ndarray, shape (n,)
        Squared standard errors of the radiance in those parts.
    variances : dict of str to ndarray, shape (n,)
        Squared random errors of the channels of the truth; empty without it.
    systematic : float
        Relative error of all radiances that more paths do not reduce.
    """

    view: CameraView
    band: Band
    on: np.ndarray
    seen: dict[str, np.ndarray]
    sums: dict[str, np.ndarray]
    variance: np.ndarray
    variances: dict[str, np.ndarray] = field(default_factory=dict)
    systematic: float = 0.0

    def at_temperatures(self, sources: Sources) -> "WindowPaths":
        """The same paths with other temperatures of their sources, see `Sources.replaced`.

        The standard errors change in proportion to the radiance of the whole model.
        """
        pairs = enumerate(zip(self.sources.list, sources.list))
        changes = {
            k: (source.group, other.in_band / source.in_band - 1)
            for k, (source, other) in pairs
            if source.in_band and other != source
        }

        sums = changed_channels(self.sums, changes)
        before, after = (
            parts_of(some, "target.") | {"target": some["target"]} for some in (self.sums, sums)
        )
        ratio = {
            name: (after[name].item() / value.item()) ** 2 if value.item() else 1.0
            for name, value in before.items()
        }
        ratio["contrast"] = ratio["target"]
        return replace(
            self,
            sources=sources,
            seen=changed_channels(self.seen, changes),
            sums=sums,
            variance=self.variance * ratio["target"],
            variances={name: v * ratio[name] for name, v in self.variances.items()},
        )


def changed_channels(
    channels: dict[str, np.ndarray], changes: dict[int, tuple[str, float]]
) -> dict[str, np.ndarray]:
    """Channels with other temperatures of their sources.

    changes: group of the sources that change, and what is added to a unit of each, by number.
    """
    hot = dict(channels)
    for k, (group, factor) in changes.items():
        for beginning, whole in (("target.", "target"), (DIRECT, "")):
            name = f"{beginning}source.{k}"
            for changed in {name, f"{beginning}group.{group}", whole} & channels.keys():
                if name in channels:
                    hot[changed] = hot[changed] + factor * channels[name]
    if not any(name.startswith(f"{DIRECT}source.") for name in channels):
        # Materials by wavelength: all light of a group is taken to change alike
        for name in [name for name in channels if name.startswith(f"{DIRECT}group.")]:
            after, before = (of[name.replace(DIRECT, "target.")] for of in (hot, channels))
            hot[name] = channels[name] * after / np.where(before == 0, 1, before)
    return hot


def traced(
    setting: Setting,
    view: CameraView,
    sampling: Sampling,
    detector: Band,
    behind: Callable[[Band], np.ndarray],
    truth: bool = False,
) -> WindowPaths:
    """Trace the model in the samples of a camera's window.

    Air, background and detector only choose the number of paths. truth: whether the truth by pixel
    is wanted. The other parameters are those of `exposure`.
    """
    scene = setting.view
    hidden = detector_mean(setting.backdrop.at_sensor(setting.path.range_m), scene.band)
    windows = windows_of(view, scene, by_randomisation=truth)
    measurands = Measurands(
        Channels("model", ()), by_spectrum=True, reduced=partial(of_model, hidden=hidden)
    )
    measurands = with_parts(measurands) if truth else measurands
    of_hidden, arrival = unit_of(setting, detector, behind)

    def electrons(total: Totals) -> float:
        return electrons_for_unit(sums_of(total), total.emitters.sources, arrival, of_hidden)

    criterion = criterion_of(sampling, windows.parts, view, electrons, behind(detector))
    total = measure(scene, windows, sampling, measurands, criterion)
    on = total.mean("target.hit") > 0
    if not on.any():
        raise InputError("no ray hit the target; raise spp of [render]")
    variance = total.standard_error() ** 2 + missed(total)
    squares = model_squares(total, windows.parts, variance)
    variances = squared_errors(total, view, on) if truth else {}
    return WindowPaths(
        view=view,
        band=scene.band,
        sources=total.emitters.sources,
        on=on,
        sums=sums_of(total),
        seen=means_in_place_of_sums(total, on),
        variance=variance[on],
        spp=windows.parts * round(total.traced.mean()),
        rms_error=float(np.sqrt(squares.mean())),
        reached=total.reached,
        invalid=total.invalid,
        paths=int(total.traced.sum()),
        followed=total.followed,
        variances=variances,
        systematic=total.systematic,
    )


def squared_errors(total: Totals, view: CameraView, on: np.ndarray) -> dict[str, np.ndarray]:
    """Squared random errors of the channels of the truth in the parts `on`, (n,).

    `contrast` is the radiance less that of the hidden background.
    """
    names = ("contrast", "target", *add_parts(total, "target."))
    variances = {}
    for name in names:
        channel = None if name == "contrast" else name
        errors = pixel_errors(total, view.size[::-1], channel, with_bounds=False)
        variances[name] = errors[on] ** 2
        if name not in names[:2]:
            del total.sums[name]
    return variances


def exposure(
    setting: Setting,
    view: CameraView,
    sampling: Sampling,
    detector: Band,
    behind: Callable[[Band], np.ndarray],
    variants: Callable[[Sources], Iterable[Sources]] = lambda sources: (),
) -> Exposure:
    """Render the model into the samples of a camera's window.

    Every source has its own spectrum, and its electrons are the integral of this spectrum, of the
    air's transmittance at the sample's own range and of the camera's response. Radiance of unknown
    spectrum (of `closure`, or of an emitter that is not thermal) is taken as constant over the
    band.

    Parameters
    ----------
    setting : Setting
        Scene, air, background and range.
    view : CameraView
    sampling : Sampling
        Its spp and max_spp are paths through a pixel, or through the model where it is smaller. Its
        tolerance is the `rms_error`. Without both, the camera's noise decides. Its progress is in
        paths through a pixel.
    detector : Band
        Band whose values are electrons.
    behind : callable
        Gives the in-band values of the background behind the parts of the window, (rows, columns).
    variants : callable
        Gives the sources with other temperatures for which what arrives is computed too, by
        channel, from the same paths.

    Raises
    ------
    InputError
        For settings out of bounds, and if no ray meets the model.
    """
    paths = traced(setting, view, sampling, detector, behind)
    return exposure_of(paths, setting, detector, behind, variants)


def exposure_of(
    paths: WindowPaths,
    setting: Setting,
    detector: Band,
    behind: Callable[[Band], np.ndarray],
    variants: Callable[[Sources], Iterable[Sources]] = lambda sources: (),
    ranges_m: ArrayLike = (),
) -> Exposure:
    """What arrives of traced paths through an air at a detector.

    paths: those of a scene of the same geometry and reflectances. ranges_m: ranges between which a
    picture of the model is wanted. The other parameters are those of `exposure`.
    """
    view, seen, on, sources, band = paths.view, paths.seen, paths.on, paths.sources, paths.band
    air, extrapolate = setting.air, setting.sight.extrapolate
    of_hidden, from_middle = unit_of(setting, detector, behind)
    # Errors are those of the radiance, in the unit of electrons at the aperture
    unit = electrons_for_unit(paths.sums, sources, from_middle, of_hidden)
    share = seen["target.hit"]
    ranges = seen["target.range"] / share + view.near_range().ravel()[on]
    # The middle of the model is within the table, but parts of it may be beyond its end
    is_open = air.is_vacuum or extrapolate
    through = ranges if is_open else np.minimum(ranges, air.ranges_m[-1])

    def arrival(rule: Band, emitting: Sources) -> Arrival:
        return interpolated(
            lambda at: Arrival.of(emitting, band, rule, air, at, extrapolate), through
        )

    def arriving(rule: Band) -> np.ndarray:
        """In-band values of the samples at a detector, less those of the hidden background."""
        arrival_at = arrival(rule, sources)
        return arrival_at.of_parts(seen) + share * (arrival_at.path - behind(rule).ravel()[on])

    def by_channel(emitting: Sources) -> Mapping[str, np.ndarray]:
        """Electrons of the samples from each source, if it had another temperature."""
        at_detector = arrival(detector, emitting)
        ratios = {
            name: other.in_band / source.in_band
            for k, (source, other) in enumerate(zip(sources.list, emitting.list))
            if (name := f"target.source.{k}") in at_detector.in_band and source.in_band
        }
        return OnReading(
            ratios, lambda name: image(at_detector.arrives[name] * seen[name] * ratios[name])
        )

    areas = part_areas(view, on, ranges) * view.inside.ravel()[on]
    intensities = {
        name: weighted(values, areas) for name, values in seen.items() if name != "target.range"
    }

    place = partial(placed, on=on, shape=view.size[::-1])

    def image(values: np.ndarray) -> np.ndarray:
        return view.samples(place(values))

    picture = None
    if len(ranges_m):
        from_ranges = Arrival.of(sources, band, detector, air, ranges_m, extrapolate=True)
        picture = TargetPicture.of(seen, from_ranges, view.inside.ravel()[on], place)

    return Exposure(
        contrast=image(arriving(detector)),
        radiance=image(arriving(setting.detector.band)),
        error=unit * np.sqrt(image(paths.variance)) * OVERSAMPLING / view.parts,
        share=image(share),
        intensities=intensities,
        area=intensities["target.hit"],
        variants=tuple(by_channel(emitting) for emitting in variants(sources)),
        picture=picture,
        truth=frame_layers(paths, setting, arrival, behind) if paths.variances else {},
        **{of.name: getattr(paths, of.name) for of in fields(TracedModel)},
    )


def frame_layers(
    paths: WindowPaths,
    setting: Setting,
    arrival: Callable[[Band, Sources], Arrival],
    behind: Callable[[Band], np.ndarray],
) -> dict[str, np.ndarray]:
    """Layers of the truth in the frame's pixels, (H, W), without the background beside the model.

    Beside those of `Truth`: arrives, what arrives of the model at the detector; hidden, the
    background that it hides; contrast_error, the standard error of its radiance less that of the
    background.
    """
    view, seen, rule = paths.view, paths.seen, setting.detector.band

    def frame(values: np.ndarray) -> np.ndarray:
        return view.frame(placed(values, paths.on, view.size[::-1]))

    def error(variance: np.ndarray) -> np.ndarray:
        return np.sqrt(frame(variance)) / view.parts

    at_detector, share = arrival(rule, paths.sources), seen["target.hit"]
    layers = {
        "mask.Y": frame(share),
        "path.Y": frame(share * at_detector.path),
        "arrives": frame(at_detector.of_parts(seen)),
        "hidden": frame(share * behind(rule).ravel()[paths.on]),
        "contrast_error": error(paths.variances["contrast"]),
    }
    parts = parts_of(seen, "target.") | {"target": seen["target"]}
    for name, values in parts.items():
        layer = layer_of(name)
        layers[layer] = frame(values)
        systematic = paths.systematic * layers[layer]
        layers[f"stderr.{layer}"] = np.hypot(error(paths.variances[name]), systematic)
    if setting.view.mi.integrator().closure != "none":
        layers["rest.Y"] = layers["target.Y"] - sum(
            layers[layer_of(name)] for name in parts if name != "target"
        )
    return layers


def unit_of(
    setting: Setting, detector: Band, behind: Callable[[Band], np.ndarray]
) -> tuple[float, Callable[[Sources], Arrival]]:
    """Electrons for a unit of the hidden background's radiance, and what arrives of sources."""
    band, range_m = setting.view.band, setting.path.range_m
    hidden = detector_mean(setting.backdrop.at_sensor(range_m), band)

    def arrival(sources: Sources) -> Arrival:
        at = np.array([range_m])
        return Arrival.of(sources, band, detector, setting.air, at, setting.sight.extrapolate)

    return float(np.mean(behind(detector))) / max(hidden, 1e-300), arrival


def electrons_for_unit(
    sums: dict[str, np.ndarray],
    sources: Sources,
    arrival: Callable[[Sources], Arrival],
    of_hidden: float,
) -> float:
    """Electrons at the aperture for a unit of the model's mean radiance, from one range.

    A model that sends none still hides the background, of whose radiance a unit counts then.

    sums: see `sums_of`. arrival: gives what arrives of the sources. of_hidden: electrons for that
    unit.
    """
    if not sums["target"].any():
        return of_hidden
    return arrival(sources).of_parts(sums).item() / sums["target"].sum()


def sums_of(total: Totals) -> dict[str, np.ndarray]:
    """Sums of all channels over the window, (1,)."""
    sums = total.sums.items()
    return {name: values.sum(dtype=float, keepdims=True).ravel() for name, values in sums}


def means_in_place_of_sums(total: Totals, on: np.ndarray) -> dict[str, np.ndarray]:
    """Means of all channels in the parts that are `on`. The sums, which take much memory, go."""
    means = {}
    for name in list(total.sums):
        means[name] = total.mean(name)[on].astype(total.sums[name].dtype)
        del total.sums[name]
    return means


def of_model(sums: Sums, hidden: float) -> Sums:
    """The channels of the model; as radiance, its difference from the `hidden` background.

    Those by source, which may be hundreds, are in single precision.
    """
    channels = {"target": sums.channels["target"]}
    for name, values in sums.channels.items():
        if name in ("hit", "range"):
            channels[f"target.{name}"] = values
        elif name.startswith(("source.", "wavelength.", "group.", up_to_prefix(0))):
            channels[f"target.{name}"] = values.astype(np.float32)
    contrast = channels["target"] - hidden * channels["target.hit"]
    return replace(sums, channels=channels, radiance=contrast)


@dataclass(frozen=True)
class OnReading(Mapping):
    """Arrays by name that `of` a name are made when they are read, since all take much memory."""

    names: Collection[str]
    of: Callable[[str], np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.of(name)

    def __iter__(self):
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def interpolated(arrival_from: Callable[[np.ndarray], Arrival], ranges: np.ndarray) -> Arrival:
    """What arrives from many ranges, m, linear between RANGES of them or fewer.

    arrival_from: gives what arrives from an array of ranges.
    """
    steps = np.log(ranges.max() / ranges.min()) / STEP
    count = min(int(np.ceil(steps)) + 2, RANGES)
    if len(ranges) <= count:
        return arrival_from(ranges)
    at = np.geomspace(ranges.min(), ranges.max(), count)
    arrival = arrival_from(at)
    return Arrival(
        arrival.in_band,
        OnReading(arrival.arrives, lambda name: np.interp(ranges, at, arrival.arrives[name])),
        np.interp(ranges, at, arrival.path),
    )


def detector_mean(backdrop: Backdrop, detector: Band) -> float:
    """In-band value of the background at a detector."""
    if len(backdrop.rows_um):
        detector.check_covered(backdrop.rows_um, f"background {backdrop.name}")
        return float(detector.integral(backdrop.rows_um, backdrop.at(backdrop.rows_um)))
    return float(detector.weights_um @ backdrop.at(detector.wavelengths_um))


@dataclass(frozen=True)
class ModelError(PixelCriterion):
    """The rms standard error over the pixels on the model is below a fraction of its mean."""

    tolerance: float
    in_pixel: int

    def check(self, tracer, name):
        """Nothing is refused: a tolerance that is not reached is reported."""

    def squares(self, total):
        return model_squares(total, self.in_pixel, total.standard_error() ** 2) / self.tolerance**2

    def unmet(self, total):
        squares = model_squares(total, self.in_pixel, missed(total))
        return float(np.sqrt(squares.mean())) / self.tolerance


@dataclass(frozen=True)
class NoiseError(PixelCriterion):
    """The standard error of a pixel is below the camera's noise, in all but few of the frame.

    It is that of a square of the size of a pixel around each part, without the optics, which make
    it smaller.

    Attributes
    ----------
    view : CameraView
    electrons : callable
        Electrons for a unit of the model's radiance, from the totals.
    behind : ndarray, shape (rows, columns)
        Electrons of the background behind the parts.
    """

    view: CameraView
    electrons: Callable[[Totals], float]
    behind: np.ndarray

    def check(self, tracer, name):
        """Nothing is refused: pixels with a larger error are marked."""

    @property
    def size(self) -> tuple[int, int]:
        return self.view.size[::-1]

    def ratio(self, variance: np.ndarray, contrast: np.ndarray, total: Totals) -> np.ndarray:
        """Squared ratio of the error of pixels to their noise, from those of the parts, (P,)."""
        unit = self.electrons(total)
        noise = self.view.imager.noise(self.behind.ravel() + unit * contrast)
        return variance * (unit / self.view.parts / noise) ** 2

    def squares(self, total):
        contrast = averaged(total.mean(), self.size, self.view.parts)
        return self.ratio(total.standard_error() ** 2, contrast, total)

    def expected(self, squares, more):
        return float(np.sqrt(self.largest(averaged(squares / more, self.size, self.view.parts))))

    def weight(self, total, size):
        variance, contrast = (
            surroundings(np.maximum(values, 0), size)
            for values in (total.scatter_error() ** 2, total.mean())
        )
        weight = self.ratio(variance, contrast, total)
        return np.minimum(weight, self.largest(weight))

    def largest(self, squares) -> float:
        """The largest square without those of MOST_NOISY of the frame."""
        imager, parts = self.view.imager, self.view.parts
        above = MOST_NOISY * imager.width * imager.height * parts**2 / len(squares)
        return float(np.quantile(squares, max(1 - above, 0)))


def criterion_of(
    sampling: Sampling,
    in_pixel: int,
    view: CameraView,
    electrons: Callable[[Totals], float],
    behind: np.ndarray,
) -> PixelCriterion | None:
    """The criterion of a sampling: its tolerance, or the camera's noise; None for fixed paths."""
    if sampling.tolerance is not None:
        return ModelError(sampling.tolerance, in_pixel)
    return NoiseError(view, electrons, behind) if sampling.spp is None else None


def missed(total: Totals) -> np.ndarray:
    """Squared errors of the parts, (P,), if one on the model missed a source that no path has met.

    Which of them has done so is not known, so that they share the squared error. What a source adds
    that paths have met elsewhere shows in the scatter.
    """
    on, unmet = total.mean("target.hit") > 0, [0.0]
    for k, source in enumerate(total.emitters.sources.list):
        sums = total.sums.get(f"target.source.{k}")
        if sums is not None and not sums.any():
            # A whole group, of unknown spectrum, may also have no emitter
            unmet.append(
                total.emitters.brightest_of.get(source.group, 0.0)
                if source.in_band is None
                else source.in_band
            )
    largest = UNSEEN * max(unmet) / student_factor(np.inf) / np.maximum(total.paths, 1)
    error = np.minimum(total.missed_error(), largest)
    return np.where(on, np.sum(error**2 * on) / max(on.sum(), 1) ** 2, 0)


def model_squares(total: Totals, in_pixel: int, variance: np.ndarray) -> np.ndarray:
    """Squared ratios of the errors of parts to the model's mean radiance, (P,).

    variance: squared errors of the parts, (P,), in the unit of the radiance.

    Their mean over all parts is that of the pixels on the model. A pixel is the mean of `in_pixel`
    parts with independent errors. A model that is smaller has fewer parts.
    """
    on = total.mean("target.hit") > 0
    mean = total.mean("target")[on].mean() if on.any() else 0.0
    if not mean > 0:
        return np.zeros(len(on))
    share = on.mean() * min(in_pixel, on.sum())
    return np.where(on, variance, 0) / (mean**2 * share)


def weighted(values: np.ndarray, weights: np.ndarray) -> float:
    """Sum of weighted values (n,), the same on any number of threads, which BLAS's is not."""
    return float(np.sum(values * weights))


def part_areas(view: CameraView, on, ranges) -> np.ndarray:
    """Areas across the optical axis that the parts `on` cover at their ranges, m^2."""
    if view.imager.projection == "orthographic":
        return np.full(len(ranges), (view.pixel_m / view.parts) ** 2)
    distance = ranges * (view.near_m / view.near_range()).ravel()[on]  # along the axis
    return (distance * view.imager.pixel_angle / view.parts) ** 2


def placed(values, on, shape) -> np.ndarray:
    """The values at the places `on` of an image of zeros."""
    image = np.zeros(on.size)
    image[on] = values
    return image.reshape(shape)
