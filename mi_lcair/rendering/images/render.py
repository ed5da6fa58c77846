"""Rendering in independent passes, with a given number of samples or to a tolerance."""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair import formats
from mi_lcair.charts import (
    ChannelImages,
    Curve,
    LineChart,
    LineCharts,
    Scale,
    by_wavelength,
    named_channels,
)
from mi_lcair.declared import percent
from mi_lcair.errors import InputError, option
from mi_lcair.formats import (
    check_channels,
    column_of,
    or_nan,
    pixel_axes,
    quantity_of_channel,
    spectral_channel,
    wavelengths_of,
)
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, spectral_temperature
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.plugins.recorders.radiance import BOUNCE_CHANNELS
from mi_lcair.rendering.images.files import window_of
from mi_lcair.rendering.images.spectral import (
    LAYOUT,
    apparent,
    check_bins,
    spectral_channels,
    spectral_measurands,
    through,
)
from mi_lcair.rendering.images.truth import (
    Truth,
    add_parts,
    check_has_truth,
    count_from_camera,
    drop_groups,
    truth_of_render,
    with_parts,
)
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.pixels import PixelError, pixel_errors
from mi_lcair.rendering.reflections import (
    counts,
    followed_row,
    share_left_out,
    words_on_left_out,
)
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals, invalid_remark
from mi_lcair.rendering.window import PILOT_SPP, PIXEL_RANDOMISATIONS, Windows, window_size
from mi_lcair.results import Result, entry
from mi_lcair.sections import Facts, Remarks, Section, error_row, unpacked, words_of

if TYPE_CHECKING:
    import xarray


# The image that `render` returns
# -------------------------------

DEFAULT = ("Y", "temperature.Y")  # channels of a picture
FIRST = ("apparent.Y", "Y", "temperature.Y")  # channels that are shown first, at most two
FIRST_OF_CAMERA = ("temperature.Y", "apparent.Y")
MEANINGS = {
    "stderr.Y": "stderr.Y is the standard error of Y",
    "apparent.Y": "apparent.Y is the radiance that arrives through the air",
    "temperature.Y": "temperature.Y is the brightness temperature",
    "range.Y": "range.Y is the distance to the surface that is seen",
}


@dataclass(frozen=True, repr=False)
class Render(Result):
    """A rendered scene.

    Attributes
    ----------
    channels : dict
        Channels of the radiance EXR by name, float32 (H, W) [W m^-2 sr^-1; temperature.Y: K;
        range.Y: m].
    header : dict
        Header of the radiance EXR.
    band : Band
    spp : int
        Samples per pixel.
    mean, mean_error : float
        Mean radiance and its standard error [W m^-2 sr^-1].
    rms_error : float or None
        Rms standard error over the pixels, as a fraction of the mean, see `Totals.rms_error`.
        None for one sample per pixel.
    reached : bool or None
        Whether the tolerance was reached. None if none was given.
    invalid : int
        Number of NaN or infinite samples, which are left out.
    paths : int
    closure_error : float or None
        Estimated error of closure = tail [W m^-2 sr^-1]. None for another closure.
    seconds : float
        Duration of the render.
    scene_name : str
        Name of the scene.
    window_m : tuple of float or None
        Width and height of an orthographic sensor's window [m]. None for another sensor.
    tolerance : float or None
        Requested tolerance.
    wavelengths_um : ndarray
        Wavelengths of the channels of spectral radiance [um]; empty for none.
    left_out : float or None
        Share of the mean radiance beyond max_bounces, from the test run of a tolerance. No error
        includes it.
    followed : str
        What the paths follow, in words.
    truth : Truth or None
        True content of each pixel; None if it was not requested.
    """

    channels: dict[str, np.ndarray] = entry()
    header: dict[str, str | int | float]
    band: Band = entry("band", "name")
    spp: int
    mean: float = entry("mean_radiance_W_m2_sr")
    mean_error: float | None = entry("standard_error_W_m2_sr")
    rms_error: float | None
    reached: bool | None
    invalid: int
    paths: int
    closure_error: float | None = entry("closure_error_W_m2_sr")
    seconds: float = entry("time_s")
    scene_name: str
    window_m: tuple[float, float] | None
    tolerance: float | None
    wavelengths_um: np.ndarray = entry(default_factory=lambda: np.empty(0))
    left_out: float | None = None
    followed: str = ""
    truth: Truth | None = entry(default=None)

    kind = "render"
    heading = "Image"
    computed = {"by_bounce_W_m2_sr": "by_bounce"}
    saved_by = {
        ".exr": "mi_lcair.rendering.images.files:write_render",
        ".tif": "mi_lcair.rendering.images.render:write_tiff",
        ".hdr": "mi_lcair.rendering.images.render:write_envi",
    }

    @property
    def cube(self) -> np.ndarray:
        """Spectral radiance [W m^-2 sr^-1 um^-1], (wavelengths, H, W); none without `bins`."""
        names = [spectral_channel(wavelength) for wavelength in self.wavelengths_um]
        return np.reshape([self.channels[name] for name in names], (-1, *self.channels["Y"].shape))

    @property
    def cube_temperature(self) -> np.ndarray:
        """Brightness temperatures [K], (wavelengths, H, W), of `cube`."""
        return spectral_temperature(self.wavelengths_um[:, None, None], self.cube)

    def suffixes(self) -> list[str]:
        """Suffixes of the files that `save` can write; an ENVI file needs `bins`."""
        known = super().suffixes()
        return [suffix for suffix in known if suffix != ".hdr" or self.wavelengths_um.size]

    @property
    def by_bounce(self) -> list[float]:
        """Mean radiance of the paths with 0, 1, ... reflections [W m^-2 sr^-1].

        The last entry holds all from the 16th on. It is empty without `parts`.
        """
        names = sorted(name for name in self.channels if name.startswith("bounce"))
        return [float(self.channels[name].mean(dtype=float)) for name in names]

    def summary(self) -> str:
        """One line with the size of the image and its mean radiance."""
        height, width = self.channels["Y"].shape
        error = "" if self.mean_error is None else f" +- {self.mean_error:.2g}"
        return (
            f"render of {self.scene_name}, {self.band.label}: {width} x {height} pixels, mean "
            f"radiance {self.mean:.6g}{error} W m^-2 sr^-1 (standard error), "
            f"{self.spp} samples per pixel"
        )

    def entries(self) -> dict:
        """Entries for JSON: the means, the errors and the channels, without their pixels."""
        height, width = self.channels["Y"].shape
        of_pixels = {
            name: {
                "least": values.min(),
                "mean": values.mean(dtype=float),
                "greatest": values.max(),
            }
            for name, values in self.images().items()
        }
        return super().entries() | {"width": width, "height": height, "channels": of_pixels}

    def facts(self) -> Iterator[Any]:
        """The image with its mean radiance and error, and how it was made."""
        height, width = self.channels["Y"].shape
        error = "the rms standard error over the pixels is " + (
            "unknown" if self.rms_error is None else f"{percent(self.rms_error)} of the mean"
        )
        yield "image", f"{width} x {height} pixels, {self.band.label}"
        yield "mean radiance", f"{self.mean:.6g} W m^-2 sr^-1"
        yield error_row(error, self.tolerance, self.reached)
        yield "samples per pixel", self.spp
        if self.followed:
            yield followed_row(self.followed, self.left_out)
        if self.closure_error is not None:
            yield "closure error", f"{self.closure_error:.2g} W m^-2 sr^-1 (estimated)"
        remarks = invalid_remark(self.invalid, self.paths)
        if not self.channels["Y"].any():
            remarks.append(
                "the image is 0 everywhere: the sensor sees no emission and no reflection; does "
                "it look away from the scene, or at the backs of surfaces?"
            )
        if self.left_out and counts(self.left_out, self.rms_error or 0.0, self.tolerance):
            remarks.append(words_on_left_out(percent(self.left_out)))
        yield Remarks(remarks)
        image, made = image_sections(self.channels, self.header)
        yield from [*image.parts, made]

    def picture(
        self,
        channels: Sequence[str] = DEFAULT,
        *,
        outlines: np.ndarray | None = None,
        **scale: Unpack[Scale],
    ) -> ChannelImages:
        """Channels of the image, each with its colour bar.

        channels: names of channels of the image. outlines: number of the facet in each pixel.
        scale: options of the colour scales. Raises InputError if the image has no such channel.
        """
        drawn = named_channels(self.channels, channels, self.scene_name)
        title = f"{self.scene_name}, {self.band.label}"
        return ChannelImages(drawn, title, self.window_m, outlines=outlines, scale=scale)

    def images(self) -> dict[str, np.ndarray]:
        """The channels, (H, W) each, by the names of their columns, which end in the unit."""
        return {column_of(name): values for name, values in self.channels.items()}

    @property
    def axes(self) -> dict[str, tuple[str, np.ndarray]]:
        """The `pixel_axes` of the image, with centres in metres if the sensor is orthographic."""
        return pixel_axes(self.channels["Y"].shape, self.window_m)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each pixel: its place and its channels."""
        images, shape = self.images(), self.channels["Y"].shape
        places = {
            name: np.broadcast_to(values[:, None] if along == "row" else values, shape)
            for name, (along, values) in self.axes.items()
        }
        return {name: values.ravel() for name, values in (places | images).items()}

    def to_xarray(self) -> "xarray.Dataset":
        """The channels as an xarray Dataset over (row, column), with x_m and y_m [m] if known.

        The spectral radiance and its brightness temperature are over wavelength_um, too. Raises
        InputError if xarray is not installed.
        """
        axes = self.axes
        by_wavelength = {spectral_channel(wavelength) for wavelength in self.wavelengths_um}
        variables = {
            column_of(name): (("row", "column"), values)
            for name, values in self.channels.items()
            if name not in by_wavelength
        }
        if by_wavelength:
            over = ("wavelength_um", "row", "column")
            axes["wavelength_um"] = ("wavelength_um", self.wavelengths_um)
            variables["spectral_radiance_W_m2_sr_um"] = over, self.cube
            variables["brightness_temperature_K"] = over, self.cube_temperature
        return self.dataset(variables, axes)


def write_tiff(path, render: Render, channel: str = "Y") -> None:
    """Write a channel of a render as a 32-bit floating point TIFF.

    It is the radiance [W m^-2 sr^-1], or another channel such as "temperature.Y" [K], with
    NaN where a pixel has no value. Raises InputError if the render has no such channel.
    """
    check_channels(f"channel of the render of {render.scene_name}", render.channels, channel)
    values = or_nan(channel, render.channels[channel])
    formats.write_tiff(path, values, f"{column_of(channel)} of {render.scene_name}")


def write_envi(path, render: Render) -> None:
    """Write the spectral radiance of a render as an ENVI file and its header."""
    what = f"spectral radiance of {render.scene_name} [W m^-2 sr^-1 um^-1]"
    formats.write_envi(path, render.cube, render.wavelengths_um, what)


def image_sections(channels: dict, header: dict) -> list[Section]:
    """The images of an EXR, and its header as how it was made.

    Axes are in metres if the header states the window of an orthographic sensor.
    """
    first = FIRST_OF_CAMERA if "counts.Y" in channels else FIRST
    shown = [name for name in first if name in channels][:2]
    height, width = next(iter(channels.values())).shape
    words = f"{width} × {height} pixels, {len(channels)} channels. {meanings(channels)}"
    drawing = ChannelImages(channels, words, window_of(header), shown)
    rows = [(words_of(name), unpacked(value)) for name, value in header.items()]
    parts = [words, drawing]
    if spectral := wavelengths_of(channels):
        brightest = sum(channels[name] for name in spectral).argmax()
        row, column = map(int, np.unravel_index(brightest, (height, width)))
        parts += [
            f"The brightest pixel, in row {row} and column {column}, by wavelength:",
            pixel_spectrum(channels, (row, column)),
        ]
    return [
        Section("Image", parts),
        Section("How the image was made", [Facts(rows)], is_detail=True),
    ]


def meanings(channels: dict) -> str:
    """What the channels of an image are, in a sentence or two."""
    words = [meaning for name, meaning in MEANINGS.items() if name in channels]
    if any(name.startswith("seen.") for name in channels):
        words.append(
            "group.LABEL.Y is radiance by emitting group, seen.LABEL.Y by the group that is seen"
        )
    return "; ".join(words) + "." if words else ""


def pixel_spectrum(
    channels: dict[str, np.ndarray], pixel: tuple[int, int], title: str = ""
) -> LineCharts:
    """Picture of the spectrum of a pixel (row, column), both from 0, beside that of the image.

    Raises InputError if the channels hold no spectrum, and for a pixel outside the image.
    """
    known = wavelengths_of(channels)
    if not known:
        raise InputError(
            f"the image has no spectral radiance; render it with {option('bins', True)}"
        )
    rows, columns = channels[next(iter(known))].shape
    row, column = pixel
    if not (0 <= row < rows and 0 <= column < columns):
        raise InputError(
            f"pixel {row},{column} is outside the image; rows are 0 to {rows - 1}, and columns "
            f"0 to {columns - 1}"
        )
    return LineCharts(
        pixel_charts(channels, pixel), f"{title}, pixel in row {row}, column {column}"
    )


def pixel_charts(channels: dict[str, np.ndarray], pixel: tuple[int, int]) -> list[LineChart]:
    """Spectral radiance and brightness temperature of a pixel, and of the mean of the image.

    Error bars are standard errors, where the image has them.
    """
    known = wavelengths_of(channels)
    x = np.array(list(known.values()))
    cube = np.array([channels[name] for name in known], float)
    errors = [
        channels[f"stderr.{name}"][pixel] if f"stderr.{name}" in channels else np.nan
        for name in known
    ]
    of_pixel, mean = cube[:, *pixel], cube.mean(axis=(1, 2))
    quantity, unit = quantity_of_channel(next(iter(known)))
    names = f"row {pixel[0]}, column {pixel[1]}", "mean of the image"
    radiances = (
        Curve(names[0], of_pixel, unit, errors=np.array(errors)),
        Curve(names[1], mean, unit, 0),
    )
    temperatures = [
        Curve(curve.name, spectral_temperature(x, curve.values), "K", curve.colour)
        for curve in radiances
    ]
    return [
        by_wavelength("", x, quantity, unit, list(radiances)),
        by_wavelength("", x, "brightness temperature", "K", temperatures, is_close=True),
    ]


def render_image(
    scene: Scene,
    sampling: Sampling,
    parts: Sequence[str] = (),
    atmosphere: Atmosphere | None = None,
    range_m: float | None = None,
    bins: int = 0,
    errors_um: Sequence[float] = (),
    truth: bool = False,
) -> Render:
    """Render the image of a loaded scene under its own settings.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is the rms standard error over the pixels, as a fraction of the mean.
    parts : sequence of str
        What the radiance is split by, see `Channels`.
    atmosphere : Atmosphere or None
        Air for the apparent radiance.
    range_m : float or None
        Range of the model for the atmosphere [m]. None: each pixel's own range.
    bins : int
        Number of wavelengths at which the spectral radiance is recorded; 0 for none.
    errors_um : sequence of float
        Wavelengths of which the nearest ones get a standard error of each pixel [um].
    truth : bool
        Whether the truth by pixel is recorded, see `Truth`.
    """
    check_bins(scene, bins, errors_um, atmosphere)
    if atmosphere is not None:
        atmosphere.check_covers(scene.band)
        if range_m is not None:
            atmosphere.path(range_m)  # raises InputError here, before anything is rendered
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    if truth:
        check_has_truth(camera)
    sampling = sampling.settled(camera)
    randomisations = min(PIXEL_RANDOMISATIONS, sampling.spp or PILOT_SPP)
    windows = Windows.of_image(camera, randomisations, bool(errors_um) or truth)
    split = "image" if atmosphere is None else "target"
    measurands = Measurands.of(split, split == "target", parts=parts)
    if bins:
        measurands = spectral_measurands(scene, bins, parts)
    measurands = with_parts(measurands) if truth else measurands
    criterion = None if sampling.tolerance is None else PixelError(sampling.tolerance)
    with through(scene, atmosphere, range_m):
        total = measure(scene, windows, sampling, measurands, criterion)
    count_from_camera(total, camera)
    spp = round(total.traced.mean())
    closure_error = None
    if total.tail is not None:
        closure_error = total.tail.error(scene.mi.integrator().max_bounces)
    beyond, rms_error = share_left_out(scene, sampling), total.rms_error()
    is_cut = beyond and counts(beyond, rms_error or 0.0, sampling.tolerance)
    size = windows.rows, windows.columns
    if truth:
        add_parts(total)
        drop_groups(total, keeps_all="group" in parts)
    channels = image_channels(total, scene.band, size)
    air, arriving = through_air(total, scene.band, atmosphere, range_m)
    wavelengths = Bins(scene.band, bins)
    of_image = header(scene, sampling, spp, total, closure_error) | air
    shown = truth_of_render(scene, camera, total, size, arriving) if truth else None
    channels |= arriving
    channels |= spectral_channels(total, wavelengths, size, errors_um) if bins else {}
    return Render(
        channels={
            name: np.ascontiguousarray(values.reshape(size), dtype=np.float32)
            for name, values in channels.items()
        },
        header=of_image | (LAYOUT if bins else {}),
        band=scene.band,
        spp=spp,
        mean=float(total.mean().mean()),
        mean_error=total.mean_error(),
        rms_error=rms_error,
        reached=False if is_cut else total.reached,
        invalid=total.invalid,
        paths=int(total.traced.sum()),
        closure_error=closure_error,
        seconds=time.perf_counter() - start,
        scene_name=scene.name,
        window_m=window_size(camera),
        tolerance=sampling.tolerance,
        wavelengths_um=wavelengths.nodes_um if bins else np.empty(0),
        left_out=beyond,
        followed=total.followed,
        truth=shown and replace(shown, header=of_image | shown.header),
    )


def through_air(
    total: Totals, band: Band, atmosphere: Atmosphere | None, range_m: float | None
) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Entries of the header about the air, and the channels behind it; none without air."""
    if atmosphere is None:
        return {}, {}
    stated = "range.Y" if range_m is None else f"{range_m:g}"
    means = {name: total.mean(name) for name in total.sums}
    sources = total.emitters.sources
    arriving = apparent(total.mean(), means, sources, band, atmosphere, range_m)
    return {"atmosphere": atmosphere.name, "atmosphere_range_m": stated}, arriving


def image_channels(total: Totals, band: Band, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """Channels of the radiance EXR by name, in the order in which it has them, (P,) each.

    size: height and width of the image.
    """
    mean = total.mean()
    channels = {"Y": mean, "temperature.Y": brightness_temperature(band, mean)}
    if total.randomisations > 1:
        channels["stderr.Y"] = pixel_errors(total, size)
    if np.ptp(total.traced):
        channels["spp.Y"] = total.traced
    by_bounce = [total.mean(name) for name in total.sums if name.startswith("bounce.")]
    for k in range(min(len(by_bounce), BOUNCE_CHANNELS)):
        channels[f"bounce{k:02d}.Y"] = (
            by_bounce[k] if k < BOUNCE_CHANNELS - 1 else sum(by_bounce[k:])
        )
    alike = ("closure", "group.", "seen.")
    channels |= {f"{name}.Y": total.mean(name) for name in total.sums if name.startswith(alike)}
    channels["target.Y"] = total.mean("target")
    # Mean over the paths that hit something
    channels["range.Y"] = total.mean("range") / np.maximum(total.mean("hit"), 1e-30)
    return channels


def header(scene: Scene, sampling: Sampling, spp: int, total: Totals, closure_error) -> dict:
    """Header of the radiance EXR: the scene, the settings and the versions."""
    integrator = scene.mi.integrator()
    entries = {
        "scene": scene.name,
        **scene.band.header,
        "units": "W m^-2 sr^-1 (temperature.Y: K, range.Y: m, 0 where nothing was hit)",
        "parameters": json.dumps(scene.parameters),
        "sensor": sampling.sensor,
        "spp": spp,
        "randomisations": total.randomisations,
        "seed": str(sampling.seed),
        "paths": str(int(total.traced.sum())),
        "invalid_samples": str(total.invalid),
        "max_bounces": integrator.max_bounces,
        "emitter_sampling": str(integrator.emitter_sampling),
        "opening_sampling": str(integrator.opening_sampling),
        "closure": integrator.closure,
        "lobes": json.dumps({surface.material: surface.lobe for surface in scene.surfaces()}),
        "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, "
        f"drjit {dr.__version__}, {mi.variant()}",
    }
    size = window_size(scene.sensor(sampling.sensor))
    if total.bins:
        entries["wavelengths"] = total.bins
    if size is not None:
        entries["window_m"] = f"{size[0]:.6g} {size[1]:.6g}"
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
