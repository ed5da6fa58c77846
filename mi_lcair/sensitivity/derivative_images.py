"""Images of the radiance and of its derivatives with respect to parameters of a scene."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import numpy as np
import scipy

from mi_lcair.formats.channels import pixel_axes
from mi_lcair.rendering.pixels.errors import around
from mi_lcair.results import Result, entry
from mi_lcair.results.charts import ChannelImages, Scale, named_channels
from mi_lcair.sensitivity.sensitivities import per_unit

if TYPE_CHECKING:
    import xarray

MOST_PANELS = 9  # the radiance and derivatives that are drawn without a choice


@dataclass(frozen=True, repr=False)
class DerivativeImages(Result):
    """Independent images of the radiance and of its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.rendering.parameters.values`.
    radiance : ndarray, shape (R, height, width), float32
        Radiance, W m^-2 sr^-1, in each of R independent randomisations.
    derivatives : ndarray, shape (R, K, height, width), float32
        Its derivatives, per unit of the parameter, from the same randomisations.
    missed : ndarray, shape (1 + K, height, width)
        Standard errors of the radiance and the derivatives from sources that no path has met.
    method : tuple of str
        How each derivative was found, as for `Sensitivities`.
    scene_name, band : str
        Names of the scene and of its band.
    units : tuple of str
        Units of the parameters; "1" for a dimensionless one.
    """

    names: tuple[str, ...] = entry()
    radiance: np.ndarray = entry()
    derivatives: np.ndarray = entry()
    missed: np.ndarray = entry()
    method: tuple[str, ...] = entry()
    scene_name: str
    band: str
    units: tuple[str, ...] = entry()

    kind = "derivative_images"
    computed = {"images": "as_rows"}
    saved_by = {".exr": "mi_lcair.rendering.images.exr:write_render"}

    @property
    def mean(self) -> np.ndarray:
        """Radiance, (height, width)."""
        return mean(self.radiance)

    @property
    def derivative(self) -> np.ndarray:
        """Derivatives of the radiance, (K, height, width)."""
        return mean(self.derivatives)

    @property
    def error(self) -> np.ndarray:
        """Standard error of `mean`, (height, width); infinite for one randomisation."""
        return np.hypot(standard_errors(self.radiance), self.missed[0])

    @property
    def derivative_error(self) -> np.ndarray:
        """Standard errors of `derivative`, (K, height, width); infinite for one randomisation."""
        return np.hypot(standard_errors(self.derivatives), self.missed[1:])

    @property
    def channels(self) -> dict[str, np.ndarray]:
        """Channels of an EXR, float32 (height, width), by name.

        Y is the radiance; d.NAME.Y are its derivatives per unit of the parameter. stderr.Y and
        stderr.d.NAME.Y are their standard errors, if there are several randomisations.
        """
        images = {"Y": (self.mean, self.error)}
        images |= {
            f"d.{name}.Y": (derivative, error)
            for name, derivative, error in zip(self.names, self.derivative, self.derivative_error)
        }
        channels = {name: value for name, (value, _) in images.items()}
        if len(self.radiance) > 1:
            channels |= {f"stderr.{name}": error for name, (_, error) in images.items()}
        return {name: values.astype(np.float32) for name, values in channels.items()}

    @property
    def header(self) -> dict[str, str]:
        """Header of the EXR."""
        return {
            "scene": self.scene_name,
            "band": self.band,
            "units": "W m^-2 sr^-1; d.NAME.Y per unit of the parameter",
            "parameters": json.dumps(dict(zip(self.names, self.units))),
        }

    def summary(self) -> str:
        """One line with the size of the images, the mean radiance and the number of parameters."""
        randomisations, height, width = self.radiance.shape
        means = self.radiance.mean(axis=(1, 2), dtype=float)
        error = f" +- {scipy.stats.sem(means):.2g}" if randomisations > 1 else ""
        return (
            f"derivatives of {self.scene_name}, {self.band}: {width} x {height} pixels, mean "
            f"radiance {means.mean():.6g}{error} W m^-2 sr^-1 (standard error), "
            f"{len(self.names)} parameters"
        )

    def entries(self) -> dict:
        """Entries for JSON: the table of `columns`, without the pixels."""
        randomisations, height, width = self.radiance.shape
        of_size = {"width": width, "height": height, "randomisations": randomisations}
        return super().entries() | of_size

    def picture(
        self, channels: Sequence[str] | None = None, **scale: Unpack[Scale]
    ) -> ChannelImages:
        """Channels of the images, each with its colour bar.

        channels: names of channels; by default the radiance and the first derivatives. scale:
        options of the colour scales.
        """
        known = self.channels
        if channels is None:
            channels = [name for name in known if not name.startswith("stderr.")][:MOST_PANELS]
        drawn = named_channels(known, channels, self.scene_name)
        return ChannelImages(drawn, f"{self.scene_name}, {self.band}", scale=scale)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for the radiance and for each derivative: mean, least and greatest pixel."""
        images = np.array([self.mean, *self.derivative])
        unit = "W m^-2 sr^-1"
        return {
            "image": np.array(["radiance", *self.names]),
            "mean": images.mean(axis=(1, 2)),
            "least": images.min(axis=(1, 2)),
            "greatest": images.max(axis=(1, 2)),
            "unit": np.array([unit, *(per_unit(unit, of) for of in self.units)]),
            "method": np.array(["", *self.method]),
        }

    def to_xarray(self) -> "xarray.Dataset":
        """The images as an xarray Dataset over (row, column), one variable for each.

        The derivatives and their errors are over (parameter, row, column). Raises InputError if
        xarray is not installed.
        """
        over = "row", "column"
        return self.dataset(
            {
                "radiance_W_m2_sr": (over, self.mean),
                "standard_error_W_m2_sr": (over, self.error),
                "derivative": (("parameter", *over), self.derivative),
                "derivative_standard_error": (("parameter", *over), self.derivative_error),
            },
            {
                "parameter": ("parameter", list(self.names)),
                "parameter_unit": ("parameter", list(self.units)),
                **pixel_axes(self.mean.shape),
            },
        )


def mean(images: np.ndarray) -> np.ndarray:
    return images.mean(axis=0, dtype=float)


def standard_errors(images: np.ndarray) -> np.ndarray:
    """Standard errors of the pixels of the mean over the first axis.

    They come from the variances in the pixels' neighbourhood, as those of `pixel_errors`.
    """
    if len(images) < 2:
        return np.full(images.shape[1:], np.inf)
    variance = images.var(axis=0, ddof=1, dtype=float) / len(images)
    return np.sqrt(around(variance))
