"""Measures of a camera at a scenario's background, and of the target in its image."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.camera.camera import Camera
from mi_lcair.camera.electronics.frames import saturated
from mi_lcair.camera.electronics.response import electrons
from mi_lcair.camera.measures import measured_mtf, measured_netd, netd, shot_noise_netd

# Smallest noise of a pixel, in counts, that frames resolve. Below it the error of a count is not
# the independent one that the closed form assumes.
SMALLEST_NOISE = 0.5
# Ends of the names of measures in JSON
UNITS = {
    **dict.fromkeys(("temperature", "netd", "netd_measured", "netd_shot", "render_error"), "_K"),
    **dict.fromkeys(("background", "glow", "noise"), "_electrons"),
}


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
        which `background` holds as many.
    noise : float
        Noise of such a pixel, electrons: in time, and without `nuc` the fixed pattern too.
    netd, netd_measured, netd_shot : float or None
        Noise-equivalent temperature difference, K: in closed form, from frames of a uniform scene,
        and of the shot noise alone. The measured one is None if the uniform scene saturates, or if
        the noise is less than SMALLEST_NOISE counts.
    mtf : dict of str to ndarray
        frequency (cycles/mm), predicted and measured MTF up to Nyquist.
    pixels : float
        Number of pixels on the target.
    peak_snr : float
        Largest difference of a pixel from the background, divided by its noise.
    snr : float
        Signal-to-noise ratio of the whole target with a matched filter.
    render_error : float
        Rms standard error of the rendering over the pixels on the target, K.
    saturated : float
        Share of the pixels that are saturated.
    """

    temperature: float
    background: float
    glow: float
    noise: float
    netd: float
    netd_measured: float | None
    netd_shot: float
    mtf: dict[str, np.ndarray]
    pixels: float
    peak_snr: float
    snr: float
    render_error: float
    saturated: float

    def as_dict(self) -> dict:
        """The measures for JSON, with units in the names; the curves of the MTF are not in it."""
        numbers = {name: value for name, value in vars(self).items() if name != "mtf"}
        return {name + UNITS.get(name, ""): value for name, value in numbers.items()}


def background_noise(camera: Camera) -> float:
    """Noise of a background pixel, electrons: in time, and without `nuc` the fixed pattern too."""
    imager = camera.imager
    return float(imager.noise(camera.background + camera.design.offset, not imager.nuc))


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
    difference = signal - behind
    on = share >= 0.5
    on = on if on.any() else share >= share.max()
    # The well must hold the uniform scene and its noise, and counts must resolve the noise
    uniform_signal = electrons(band, camera.temperature) + glow
    uniform_noise = imager.noise(uniform_signal)
    held = uniform_signal + imager.dark + 6 * uniform_noise < imager.well
    resolved = uniform_noise > SMALLEST_NOISE * imager.electrons_per_count
    uniform = replace(imager, gain_nonuniformity=0.0, offset_nonuniformity_e=0.0)
    return Measures(
        temperature=camera.temperature,
        background=camera.background + glow,
        glow=glow,
        noise=noise,
        netd=netd(imager, band, camera.temperature, glow),
        netd_measured=measured_netd(uniform, band, camera.temperature, camera.seed, glow)
        if held and resolved
        else None,
        netd_shot=float(shot_noise_netd(band, camera.temperature, glow)),
        mtf={"frequency": frequency, "predicted": camera.optics.mtf(frequency), "measured": value},
        pixels=pixels,
        peak_snr=float(np.abs(difference).max() / noise),
        snr=float(np.sqrt(np.sum(difference**2)) / noise),
        render_error=float(np.sqrt(np.mean(error_K[on] ** 2))),
        saturated=saturated(imager, signal),
    )
