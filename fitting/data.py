"""The points of one fit and what is compared with them."""

from dataclasses import dataclass, field, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fitting.loss import SCALES, Residuals
from mi_lcair.fitting.model import Hemispherical, Scatterometer
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.selection import Variant

SIGMA_FLOOR = 0.01  # of the value: a standard deviation from a few repeats can be small by chance
PLATEAU, RARE = (
    3,
    0.2,
)  # points of one largest value that look like saturation, unless they are this share of all
DIRECTIONAL_STD = 0.02  # of an emissivity or DHR that comes without one


@dataclass
class Data:
    """Points theta_i, theta_r [radians], brdf [1/sr], the scale (key of SCALES) on which they are
    compared and their spread on it; half_angle [radians] of the source; directional: tables that
    are fitted with them, whose std counts std_factor times.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    brdf: np.ndarray
    half_angle: float
    scale: str
    spread: np.ndarray
    has_sigma: bool
    directional: list[DirectionalData] = field(default_factory=list)
    std_factor: float = 1.0

    @property
    def points(self) -> int:
        return len(self.brdf)

    @property
    def rows(self) -> int:
        return self.points + sum(len(table.theta) for table in self.directional)

    def residuals(self, variant: Variant, aperture: bool = True) -> Residuals:
        model, form = variant.model, variant.form
        half_angle = self.half_angle if aperture else 0.0
        instrument = Scatterometer(model, form, self.theta_i, self.theta_r, half_angle)
        tables = [
            (
                Hemispherical(model, form, table.theta, table.quantity),
                table.value,
                self.std_factor * table.std,
            )
            for table in self.directional
        ]
        return Residuals(instrument, self.brdf, self.scale, self.spread, tables)

    def per_decade(self, f: np.ndarray) -> np.ndarray:
        """Change of each row (all rows, also the directional ones) when every BRDF f (points,)
        grows by one decade.
        """
        change = SCALES[self.scale](f)[1] * f * np.log(10) / self.spread
        return np.concatenate([change, np.zeros(self.rows - self.points)])

    def jointly(self, variance: float, tables: list[DirectionalData]) -> "Data":
        """The same points in units of their own standard deviation, together with directional
        tables.
        """
        return replace(self, spread=self.spread * np.sqrt(variance), directional=tables)

    def with_std_factor(self, factor: float) -> "Data":
        return replace(self, std_factor=factor)


def select(
    measurements: Measurements,
    scale: str,
    half_angle: float,
    max_angle_deg: float,
    min_brdf: float,
    fewest: int,
) -> tuple[Data, np.ndarray, dict[str, int]]:
    """The points to fit, the mask over the measurements that gave them, and how many were dropped,
    by reason.

    InputError if fewer are left than `fewest`, the number of parameters.
    """
    theta_i, theta_r, brdf = (
        np.asarray(column, dtype=float)
        for column in (measurements.theta_i, measurements.theta_r, measurements.brdf)
    )
    finite = np.isfinite(theta_i) & np.isfinite(theta_r) & np.isfinite(brdf)
    reach = np.maximum(np.abs(theta_i), np.abs(theta_r)) <= np.radians(max_angle_deg) + 1e-9
    bright = brdf > max(min_brdf, 0)
    used = finite & reach & bright
    saturated = used & (brdf >= (1 - 1e-9) * np.max(brdf, where=used, initial=0))
    saturated &= PLATEAU <= saturated.sum() < RARE * used.sum()
    used &= ~saturated
    dropped = {
        "not a number": int(np.sum(~finite)),
        f"theta_i or theta_r beyond {max_angle_deg:g} degrees": int(np.sum(finite & ~reach)),
        f"brdf not above {min_brdf:g} 1/sr": int(np.sum(finite & reach & ~bright)),
        "at one largest value, as if the detector saturated": int(np.sum(saturated)),
    }
    dropped = {reason: count for reason, count in dropped.items() if count}
    if used.sum() < fewest:
        why = "".join(f"; {count} dropped: {reason}" for reason, count in dropped.items())
        raise InputError(
            f"{measurements.name or 'measurements'}: {used.sum()} points to fit, fewer than the "
            f"{fewest} parameters{why}"
        )
    spread = np.ones(used.sum())
    if measurements.sigma is not None:
        sigma = np.fmax(np.asarray(measurements.sigma, dtype=float)[used], SIGMA_FLOOR * brdf[used])
        spread = sigma * SCALES[scale](brdf[used])[1]
    data = Data(
        theta_i[used],
        theta_r[used],
        brdf[used],
        half_angle,
        scale,
        spread,
        measurements.sigma is not None,
    )
    return data, used, dropped


def with_std(table: DirectionalData, quantity: str) -> DirectionalData:
    """The table as `quantity`, with a standard deviation at each angle. InputError for values
    outside 0..1.
    """
    value = np.asarray(table.value, dtype=float)
    if not (
        np.all((value >= 0) & (value <= 1))
        and np.all((table.theta >= 0) & (table.theta < np.pi / 2))
    ):
        raise InputError(
            f"{quantity}: values must lie in 0..1 and angles in 0..90 degrees, 90 excluded"
        )
    std = (
        np.full(len(value), DIRECTIONAL_STD)
        if table.std is None
        else np.maximum(table.std, DIRECTIONAL_STD / 10)
    )
    return DirectionalData(np.asarray(table.theta, dtype=float), value, std, quantity)
