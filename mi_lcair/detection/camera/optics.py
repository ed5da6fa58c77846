"""Modulation transfer function (MTF) of a camera and the air, and its effect on an image.

Frequencies are in the plane of the image, in cycles per mm. The MTF is the product of five parts.
"""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager

# Samples along each side of a pixel, in which the scene is rendered. The number is odd, so that
# the middle of a pixel is the middle of a sample.
OVERSAMPLING = 3
MARGIN = 32  # pixels beyond the frame that are rendered; a camera spreads light no further
FARTHEST = 384  # pixels over which diffraction is followed, at most
SPILL = 2e-4  # share of an even scene's light that may be lost beyond these pixels
# From the transform of its MTF's first term: 3.44 Gamma(8/3) sin(5 pi / 6) / (2 pi)^(8/3) 2 3/5
SEEING = 3.44 * scipy.special.gamma(8 / 3) * 0.6 / (2 * np.pi) ** (8 / 3)
FRAME = ((0, 0), (0, 0))  # samples that fill the frame


def diffraction(frequency, f_number: float, wavelengths_um, weights):
    """MTF of diffraction at a circular aperture, mean over a spectrum.

    2 / pi (arccos u - u sqrt(1 - u^2)) with u = wavelength * f_number * frequency, and 0 for u >= 1
    (Goodman, Introduction to Fourier Optics, 3rd edition, Eq 6-31).

    Parameters
    ----------
    frequency : ndarray
        Spatial frequencies, cycles/mm.
    f_number : float
    wavelengths_um, weights : ndarray, shape (n,)
        Wavelengths, um, and the electrons at each.
    """
    u = np.minimum(1e-3 * f_number * np.multiply.outer(wavelengths_um, np.abs(frequency)), 1)
    of_each = 2 / np.pi * (np.arccos(u) - u * np.sqrt(1 - u * u))
    return np.tensordot(weights / np.sum(weights), of_each, 1)


def footprint(frequency, width_um: float):
    """MTF of a square pixel with this side, um, along one axis: sinc of frequency times width."""
    return np.sinc(1e-3 * width_um * np.asarray(frequency))


def jitter(frequency, sigma_um: float):
    """MTF of Gaussian jitter with this standard deviation in the image plane, um."""
    return np.exp(-2 * (np.pi * 1e-3 * sigma_um * np.asarray(frequency)) ** 2)


def defocus(frequency, diameter_um: float):
    """MTF of defocus: that of a disc of uniform light with this diameter, um.

    This is the approximation of geometrical optics, 2 J1(x) / x with x = pi * diameter * frequency.
    """
    x = np.pi * 1e-3 * diameter_um * np.asarray(frequency, dtype=float)
    return np.divide(2 * scipy.special.j1(x), x, out=np.ones_like(x), where=x != 0)


@dataclass(frozen=True)
class Turbulence:
    """Turbulence with the same strength everywhere along a path, in a long exposure.

    Attributes
    ----------
    cn2 : float
        Structure parameter of the refractive index, m^(-2/3).
    wave : str
        "plane", or "spherical" for light of a point at the path's end.
    range_m : float
        Length of the path, m.
    """

    cn2: float
    wave: str
    range_m: float

    def coherence_m(self, wavelength_um: float) -> float:
        """Fried's coherence diameter r0 = (0.423 k^2 cn2 R)^(-3/5), m (Fried 1966).

        A spherical wave has 3/8 of the structure function of a plane one.
        """
        wave_number = 2 * np.pi / (1e-6 * wavelength_um)
        weight = 3 / 8 if self.wave == "spherical" else 1.0
        return (0.423 * weight * wave_number**2 * self.cn2 * self.range_m) ** -0.6

    def mtf(self, cycles_per_rad, wavelengths_um, weights):
        """MTF exp(-3.44 (wavelength frequency / r0)^(5/3)), mean over a spectrum."""
        radii = 1e-6 * wavelengths_um / self.coherence_m(wavelengths_um)
        of_each = np.exp(-3.44 * np.multiply.outer(radii, np.abs(cycles_per_rad)) ** (5 / 3))
        return np.tensordot(weights / np.sum(weights), of_each, 1)


class Optics:
    """MTF of a camera with its pixels, and of the air before it.

    Parameters
    ----------
    imager : Imager
    electron_band : Band
        Band whose values are electrons; see `electronics.electron_band`.
    spectrum : callable
        Spectral radiance at an array of wavelengths, um, in any unit. It weights diffraction and
        turbulence.
    turbulence : Turbulence or None
        Turbulence between target and camera.
    """

    def __init__(
        self, imager: Imager, electron_band: Band, spectrum, turbulence: Turbulence | None = None
    ):
        self.imager, self.turbulence = imager, turbulence
        self.wavelengths_um = electron_band.wavelengths_um
        self.weights = electron_band.weights_um * spectrum(electron_band.wavelengths_um)

    def at(self, range_m: float) -> "Optics":
        """The same camera at another range of the target, m, through the same turbulence."""
        if self.turbulence is None:
            return self
        other = copy(self)
        other.turbulence = replace(self.turbulence, range_m=range_m)
        other.__dict__.pop("profile", None)
        return other

    @property
    def mean_wavelength_um(self) -> float:
        """Mean wavelength of the electrons, um."""
        return float(np.average(self.wavelengths_um, weights=self.weights))

    @property
    def seeing_um(self) -> float:
        """Angle wavelength / r0 by which turbulence spreads light, um in the plane of the image."""
        if self.turbulence is None:
            return 0.0
        wavelength = self.mean_wavelength_um
        angle = 1e-6 * wavelength / self.turbulence.coherence_m(wavelength)
        return 1e3 * angle * self.imager.focal_length_mm

    def check_spread(self) -> None:
        """Raise InputError if the camera spreads the light of a point over too many pixels."""
        camera, turbulence = self.imager, self.turbulence
        jitter_um = 1e-3 * camera.jitter_urad * camera.focal_length_mm
        for entry, value, spread_um in (
            ("[camera]: jitter_urad", camera.jitter_urad, 4 * jitter_um),
            ("[camera]: defocus_um", camera.defocus_um, abs(camera.defocus_um) / camera.f_number),
            (
                "[camera]: f_number",
                camera.f_number,
                2 * camera.f_number * self.wavelengths_um.max(),
            ),
            ("[atmosphere]: cn2", turbulence.cn2 if turbulence else 0, 2 * self.seeing_um),
        ):
            if spread_um > MARGIN * camera.pitch_um:
                raise InputError(
                    f"{entry} = {value:g} spreads the light of a point over "
                    f"{spread_um / camera.pitch_um:.3g} pixels; at most {MARGIN} are covered"
                )

    def parts(self, frequency) -> dict[str, np.ndarray]:
        """The parts of the MTF along one axis by name, at these frequencies, cycles/mm."""
        return self.round_parts(np.abs(frequency)) | {
            "pixel": footprint(frequency, self.pixel_width_um)
        }

    def mtf(self, frequency) -> np.ndarray:
        """The MTF along one axis at these frequencies, cycles/mm."""
        return np.prod(list(self.parts(frequency).values()), axis=0)

    @property
    def pixel_width_um(self) -> float:
        """Side of the sensitive square of a pixel, um."""
        return self.imager.pitch_um * np.sqrt(self.imager.fill_factor)

    def round_parts(self, frequency) -> dict[str, np.ndarray]:
        """The parts that depend on the size of the frequency only, not on its direction."""
        camera = self.imager
        return {
            "diffraction": diffraction(
                frequency, camera.f_number, self.wavelengths_um, self.weights
            ),
            "jitter": jitter(frequency, 1e-3 * camera.jitter_urad * camera.focal_length_mm),
            "defocus": defocus(frequency, abs(camera.defocus_um) / camera.f_number),
            "turbulence": np.ones(np.shape(frequency))
            if self.turbulence is None
            else self.turbulence.mtf(
                frequency * camera.focal_length_mm, self.wavelengths_um, self.weights
            ),
        }

    def transfer(self, shape: tuple[int, int]) -> np.ndarray:
        """Factors of the real FFT of an image with OVERSAMPLING samples in a pixel.

        The samples are means over their own squares, whose footprint is divided out.
        """
        step = self.imager.pitch_um / OVERSAMPLING
        y, x = (scipy.fft.rfftfreq(count, 1e-3 * step) for count in shape)
        rows, columns = (
            footprint(along, self.pixel_width_um) / footprint(along, step) for along in (y, x)
        )
        factors = np.interp(np.hypot(y[:, None], x), *self.profile) * rows[:, None] * columns
        place = np.arange(shape[0])  # the factors of y and -y are equal
        return factors[np.minimum(place, shape[0] - place)]

    @cached_property
    def profile(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies, cycles/mm, and the product of the round parts there, which are smooth.

        They go up to the diagonal of the frequencies of `transfer`.
        """
        highest = np.sqrt(0.5) * OVERSAMPLING * 1e3 / self.imager.pitch_um
        frequency = np.linspace(0, highest, 8192)
        return frequency, np.prod(list(self.round_parts(frequency).values()), axis=0)

    def seen(self, samples, around=FRAME) -> np.ndarray:
        """The image at the centres of the frame's pixels.

        Outside the samples the image is assumed to be 0, so a background must be subtracted. The
        sum over the pixels times OVERSAMPLING^2 is that over the samples if the frame holds all
        pixels in their `reach`.

        Parameters
        ----------
        samples : ndarray, shape (OVERSAMPLING h, OVERSAMPLING w)
            Means over the squares of the samples.
        around : ((int, int), (int, int))
            Pixels above and below the samples, left and right of them, to the frame's border.
            Negative where the samples go beyond it.

        Returns
        -------
        ndarray, shape (H, W)
            Values of the frame's pixels.
        """
        return self.blurred(samples, around, self.transfer)

    def seen_along_columns(self, samples, ends: tuple[int, int]) -> np.ndarray:
        """The image of a scene that hardly changes along the rows, such as a level horizon.

        Each column is blurred by the line spread function.

        Parameters
        ----------
        samples : ndarray, shape (OVERSAMPLING h, W)
            Values in the middles of the frame's columns.
        ends : (int, int)
            Pixels above and below the samples to the frame's border, negative where the samples go
            beyond it.

        Returns
        -------
        ndarray, shape (H, W)
        """
        count = len(samples) // OVERSAMPLING
        reach = self.reach(samples.size)
        length = scipy.fft.next_fast_len(OVERSAMPLING * (count + reach), real=True)
        step = self.imager.pitch_um / OVERSAMPLING
        y = scipy.fft.rfftfreq(length, 1e-3 * step)
        factors = np.interp(y, *self.profile) * footprint(y, self.pixel_width_um)
        factors /= footprint(y, step)
        blurred = scipy.fft.irfft(
            scipy.fft.rfft(samples, length, axis=0) * factors[:, None], length, axis=0
        )
        place = np.arange(-ends[0], count + ends[1])
        return blurred[OVERSAMPLING * place + OVERSAMPLING // 2]

    def variance(self, variances, around=FRAME) -> np.ndarray:
        """Variances of the image at the pixels' centres, for independent errors of the samples.

        variances: variance of each sample. They, `around` and the result are as those of `seen`.
        """

        def transfer(shape):
            return scipy.fft.rfft2(scipy.fft.irfft2(self.transfer(shape), shape) ** 2)

        return np.maximum(self.blurred(variances, around, transfer), 0)

    def blurred(self, samples, around, transfer) -> np.ndarray:
        """The samples at the centres of the frame's pixels, see `seen`.

        transfer: function that gives the factors of the real FFT of an image of some shape.
        """
        samples = np.asarray(samples)
        sides = [n // OVERSAMPLING for n in samples.shape]
        reach = self.reach(np.prod(sides))
        places = [np.arange(-start, n + end) for n, (start, end) in zip(sides, around)]
        # The FFT repeats the samples. The next copy is out of reach of all pixels.
        shape = tuple(
            scipy.fft.next_fast_len(
                OVERSAMPLING * (n + min(max(*ends, 0), reach) + reach), real=True
            )
            for n, ends in zip(sides, around)
        )
        blurred = scipy.fft.irfft2(scipy.fft.rfft2(samples, shape) * transfer(shape), shape)
        near = [(-reach <= place) & (place < n + reach) for n, place in zip(sides, places)]
        image = np.zeros([len(place) for place in places])
        image[np.ix_(*near)] = blurred[
            np.ix_(
                *(
                    (OVERSAMPLING * place[on] + OVERSAMPLING // 2) % n
                    for n, place, on in zip(shape, places, near)
                )
            )
        ]
        return image

    def reach(self, pixels: float) -> int:
        """Pixels beyond which an even area of so many pixels sends SPILL of its value or less.

        Far from a point of light its diffraction falls as wavelength N / (pi r)^3. A half plane
        sends 2 wavelength N / (pi^3 r) further than r, and a smaller area at most its own share.
        Turbulence sends SEEING (wavelength / r0 / r)^(5/3) of a half plane's light further than r.
        """
        pitch = self.imager.pitch_um
        far = self.mean_wavelength_um * self.imager.f_number / pitch / np.pi**3 / SPILL
        by_turbulence = self.seeing_um / pitch * (SEEING / SPILL) ** 0.6
        reach = min(2 * far, np.cbrt(pixels * far)) + by_turbulence
        return int(np.clip(np.ceil(reach), MARGIN, FARTHEST))
