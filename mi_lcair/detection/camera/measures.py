"""Measures of a camera, as a laboratory takes them from frames of uniform scenes and of an edge."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.detection.camera.electronics import (
    Camera,
    Pattern,
    apparent_temperature,
    counts,
    electrons,
    electrons_per_kelvin,
    frame,
    saturated,
    signal_of,
)
from mi_lcair.detection.camera.optics import MARGIN, OVERSAMPLING, Optics
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager

UNIFORM = 3 * 2**30  # first number of the frames of uniform scenes
FRAMES = 16  # frames of a uniform scene
SIDE = 64  # pixels along each side of the part of the array that a measurement reads
EDGE_PIXELS = 128  # pixels along each side of the image of the edge
# Columns by which the edge moves from one row to the next, as for an edge tilted by 5 degrees. A
# simple fraction would fill the bins unevenly.
EDGE_SLOPE = 0.08749
BINS = 4  # bins of the edge spread function in a pixel, as in ISO 12233


def netd(imager: Imager, electron_band: Band, temperature: float, glow: float = 0.0) -> float:
    """Noise-equivalent temperature difference at a temperature, K, in closed form.

    The noise of a pixel in time divided by the change of its electrons with temperature. glow:
    electrons of the optics' emission in it.
    """
    signal = float(electrons(electron_band, temperature)) + glow
    return float(imager.noise(signal)) / electrons_per_kelvin(electron_band, temperature)


def shot_noise_netd(electron_band: Band, temperature: float, glow: float = 0.0) -> float:
    """NETD, K, of a camera whose only noise is the shot noise of signal and glow."""
    signal = float(electrons(electron_band, temperature)) + glow
    return np.sqrt(signal) / electrons_per_kelvin(electron_band, temperature)


def uniform_frames(
    imager: Imager, signal: float, seed: int, first: int = 0, frames: int = FRAMES
) -> np.ndarray:
    """Counts of frames of a uniform scene, (frames, SIDE, SIDE), from a part of the array.

    The fixed pattern is that of this part. signal: mean electrons of a pixel. first: number of the
    first frame.
    """
    part = replace(imager, width=SIDE, height=SIDE)
    pattern = Pattern.of(part, seed)
    return np.array(
        [
            counts(part, frame(part, pattern, signal, seed, UNIFORM + first + k))
            for k in range(frames)
        ]
    )


def measured_netd(
    imager: Imager, electron_band: Band, temperature: float, seed: int, glow: float = 0.0
) -> float:
    """NETD, K, from frames of a uniform blackbody at `temperature`, K.

    It is the standard deviation of the apparent temperature in time, rms over the pixels. Its own
    relative standard error is 0.3 %.
    """
    signal = float(electrons(electron_band, temperature)) + glow
    recorded = signal_of(imager, uniform_frames(imager, signal, seed).astype(float))
    apparent = apparent_temperature(electron_band, recorded - glow)
    return float(np.sqrt(apparent.var(axis=0, ddof=1).mean()))


def edge_samples(size: int = EDGE_PIXELS, slope: float = EDGE_SLOPE) -> np.ndarray:
    """Samples of a straight edge between 0 and 1, (OVERSAMPLING size, OVERSAMPLING size).

    The edge passes through the middle. A sample holds the share of its square on the bright side,
    exact for an edge that does not cross both ends of a row of the square.
    """
    side = size * OVERSAMPLING
    finer = (np.arange(8) + 0.5) / 8
    y = (np.arange(side)[:, None] + finer - side / 2).reshape(-1)
    crossing = side / 2 + slope * y
    share = np.clip(np.arange(side) + 1 - crossing[:, None], 0, 1)
    return share.reshape(side, 8, side).mean(axis=1)


def slanted_edge_mtf(image) -> tuple[np.ndarray, np.ndarray]:
    """MTF across a slanted edge, as ISO 12233 measures it.

    The rows are shifted onto each other along the fitted edge, binned BINS to the pixel,
    differentiated, windowed and transformed. The response of the bins and of the difference is
    divided out.

    Parameters
    ----------
    image : ndarray, shape (H, W)
        Image of an edge that is brighter on the right and crosses all rows.

    Returns
    -------
    tuple of ndarray
        Frequencies, cycles per pixel, up to Nyquist, and the MTF.
    """
    height, width = image.shape
    difference = np.diff(image, axis=1)
    columns = np.arange(1.0, width)  # pixel k covers k..k+1
    rows = np.arange(height) + 0.5
    centroid = difference @ columns / difference.sum(axis=1)
    gradient, start = np.polyfit(rows, centroid, 1)
    # Distance of each pixel's centre from the edge along the row, and across the edge
    across = (np.arange(width) + 0.5 - (start + gradient * rows)[:, None]) / np.hypot(1, gradient)
    bins = np.floor(across * BINS).astype(int)
    half = BINS * (width // 2 - int(np.ceil(abs(gradient) * height / 2)) - 2)
    size = 2 * half + 1  # one more than the differences, whose frequencies then end at Nyquist
    inside = (bins >= -half) & (bins <= half)
    place = bins[inside] + half
    number = np.bincount(place, minlength=size)
    spread = np.bincount(place, image[inside], size) / np.maximum(number, 1)
    line = np.diff(spread) * np.hamming(size - 1)
    frequency = np.arange(len(line) // 2 + 1) * BINS / len(line)
    value = np.abs(np.fft.rfft(line))
    # Each bin is a mean over 1 / BINS, and the difference of neighbours is one over the same step
    value = value / value[0] / np.sinc(frequency / BINS) ** 2
    kept = frequency <= 0.5
    return frequency[kept], value[kept]


def measured_mtf(optics: Optics) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, cycles/mm, up to Nyquist, and the MTF on the image of a slanted edge."""
    cut = (-MARGIN, -MARGIN)
    image = optics.seen(edge_samples(EDGE_PIXELS + 2 * MARGIN), (cut, cut))
    frequency, value = slanted_edge_mtf(image)
    return frequency * 1e3 / optics.imager.pitch_um, value


# Measures of a camera at a scenario's background, and of the target in its image
# -------------------------------------------------------------------------------

# Smallest noise of a pixel, in counts, that frames resolve. Below it the error of a count is not
# the independent one that the closed form assumes.
SMALLEST_NOISE = 0.5
# Measures in kelvin, and those in the unit of the signal, which end the names in JSON
IN_KELVIN = ("temperature", "netd", "netd_measured", "netd_shot", "render_error")
SIGNALS = ("background", "glow", "noise")


@dataclass(frozen=True)
class Measures:
    """Measures of a camera and of the target in its image.

    Attributes
    ----------
    temperature : float
        Apparent temperature of the background, K, or COLDEST_K if that is more. The NETD is stated
        there.
    background, glow : float
        Electrons of the background in a pixel on the optical axis, and of the optics' emission, of
        which `background` holds as many. For a bolometer they are powers, W.
    noise : float
        Noise of such a pixel in the same unit: in time, and without `nuc` the fixed pattern too.
        It includes what the camera states of rows, columns and the residual pattern.
    netd, netd_measured, netd_shot : float or None
        Noise-equivalent temperature difference, K: in closed form, from frames of a uniform scene,
        and of the shot noise alone. None if the uniform scene saturates; the measured one also if
        the noise is less than SMALLEST_NOISE counts, and that of shot noise for a bolometer.
    mtf : dict of str to ndarray
        frequency (cycles/mm), predicted and measured MTF up to Nyquist.
    pixels : float
        Number of pixels on the target.
    peak_snr : float
        Largest difference of a pixel from the background that the well keeps, divided by its noise.
    snr : float
        Signal-to-noise ratio of the whole target with a matched filter.
    render_error : float
        Rms standard error of the rendering over the pixels on the target, K.
    saturated : float
        Share of the pixels that are saturated.
    unit : str
        Unit of the signal: electrons, or W.
    """

    temperature: float
    background: float
    glow: float
    noise: float
    netd: float | None
    netd_measured: float | None
    netd_shot: float | None
    mtf: dict[str, np.ndarray]
    pixels: float
    peak_snr: float
    snr: float
    render_error: float
    saturated: float
    unit: str = "electrons"

    def as_dict(self) -> dict:
        """The measures for JSON, with units in the names; the curves of the MTF are not in it."""
        ends = dict.fromkeys(IN_KELVIN, "_K") | dict.fromkeys(SIGNALS, f"_{self.unit}")
        numbers = {k: value for k, value in vars(self).items() if k not in ("mtf", "unit")}
        return {name + ends.get(name, ""): value for name, value in numbers.items()}


def background_noise(camera: Camera) -> float:
    """Noise of a background pixel, see `Measures.noise`."""
    return float(camera.noise(camera.background + camera.design.offset, not camera.imager.nuc))


def matched_ratio(squares, shared, noise: float):
    """Signal-to-noise ratio of a matched filter.

    squares: sum of the squared differences D of the pixels. shared: what `Pattern.products` adds to
    it times noise^2. noise: standard deviation of a pixel. All may be arrays.
    """
    share = np.divide(shared, squares, out=np.zeros_like(shared), where=np.asarray(squares) > 0)
    # The rounding of differences that cancel must not leave a negative variance
    return np.sqrt(squares) / noise / np.sqrt(np.maximum(1 + share / noise**2, 1e-9))


def measured(
    camera: Camera,
    signal: np.ndarray,
    behind: np.ndarray | float,
    share: np.ndarray,
    error_K: np.ndarray,
    pixels: float,
) -> Measures:
    """The measures of a camera and of the target in an image, see `Measures`.

    Parameters
    ----------
    camera : Camera
    signal, behind, share, error_K : ndarray, shape (H, W)
        Mean electrons of each pixel, those without the target, share of it that the target fills,
        and standard error of the rendering, K.
    pixels : float
        Number of pixels on the target.
    """
    imager, band, glow = camera.imager, camera.band, camera.design.offset
    noise = background_noise(camera)
    frequency, value = measured_mtf(camera.optics)
    difference = camera.kept_contrast(behind - glow, signal - behind)
    shared = camera.pattern.products(difference[None])[0, 0]
    on = share >= 0.5
    on = on if on.any() else share >= share.max()
    # The well must hold the uniform scene and its noise, and counts must resolve the noise
    uniform_signal = electrons(band, camera.temperature) + glow
    uniform_noise = imager.noise(uniform_signal)
    room = min(imager.well - imager.dark - uniform_signal, uniform_signal - imager.floor)
    by_shot_noise = room > 0 and imager.detector == "photon"
    held = room > 6 * uniform_noise
    resolved = uniform_noise > SMALLEST_NOISE * imager.electrons_per_count
    uniform = replace(imager, gain_nonuniformity=0.0, offset_nonuniformity_e=0.0)
    return Measures(
        temperature=camera.temperature,
        background=camera.background + glow,
        glow=glow,
        noise=noise,
        netd=netd(imager, band, camera.temperature, glow) if room > 0 else None,
        netd_measured=measured_netd(uniform, band, camera.temperature, camera.seed, glow)
        if held and resolved
        else None,
        netd_shot=float(shot_noise_netd(band, camera.temperature, glow)) if by_shot_noise else None,
        mtf={"frequency": frequency, "predicted": camera.optics.mtf(frequency), "measured": value},
        pixels=pixels,
        peak_snr=float(np.abs(difference).max() / noise),
        snr=float(matched_ratio(np.sum(difference**2), shared, noise)),
        render_error=float(np.sqrt(np.mean(error_K[on] ** 2))),
        saturated=saturated(imager, signal),
        unit=imager.unit,
    )
