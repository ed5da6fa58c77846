"""The image that `render` returns."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.errors import check_known
from mi_lcair.formats import envi, tiff
from mi_lcair.formats.channels import column_of, or_nan, pixel_axes, spectral_channel
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_temperature
from mi_lcair.results import Result

if TYPE_CHECKING:
    import xarray


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
        Tolerance that was asked for.
    wavelengths_um : ndarray
        Wavelengths of the channels of spectral radiance [um]; empty for none.
    """

    channels: dict[str, np.ndarray]
    header: dict[str, str | int | float]
    band: Band
    spp: int
    mean: float
    mean_error: float | None
    rms_error: float | None
    reached: bool | None
    invalid: int
    paths: int
    closure_error: float | None
    seconds: float
    scene_name: str
    window_m: tuple[float, float] | None
    tolerance: float | None
    wavelengths_um: np.ndarray = field(default_factory=lambda: np.empty(0))

    kind = "render"
    saved_by = {
        ".exr": "mi_lcair.rendering.images.exr:write_render",
        ".tif": "mi_lcair.rendering.images.render_result:write_tiff",
        ".hdr": "mi_lcair.rendering.images.render_result:write_envi",
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

        The last entry holds all from the 16th on. It is empty without the channels bounceNN.Y.
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
        return {
            "scene_name": self.scene_name,
            "band": self.band.name,
            "width": width,
            "height": height,
            "window_m": self.window_m,
            "mean_radiance_W_m2_sr": float(self.mean),
            "standard_error_W_m2_sr": self.mean_error,
            "rms_error": self.rms_error,
            "by_bounce_W_m2_sr": self.by_bounce,
            "spp": self.spp,
            "tolerance": self.tolerance,
            "reached": self.reached,
            "invalid": self.invalid,
            "closure_error_W_m2_sr": self.closure_error,
            "paths": self.paths,
            "time_s": self.seconds,
            "header": self.header,
            "channels": {
                name: {
                    "least": values.min(),
                    "mean": values.mean(dtype=float),
                    "greatest": values.max(),
                }
                for name, values in self.images().items()
            },
        }

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
    check_known(f"channel of the render of {render.scene_name}", render.channels, channel)
    values = or_nan(channel, render.channels[channel])
    tiff.write(path, values, f"{column_of(channel)} of {render.scene_name}")


def write_envi(path, render: Render) -> None:
    """Write the spectral radiance of a render as an ENVI file and its header."""
    what = f"spectral radiance of {render.scene_name} [W m^-2 sr^-1 um^-1]"
    envi.write(path, render.cube, render.wavelengths_um, what)
