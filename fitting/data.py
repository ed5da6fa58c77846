"""The data of one fit: BRDF points and directional tables, with their weights."""

from dataclasses import dataclass, field, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fitting.loss import SCALES, Residuals
from mi_lcair.fitting.model import Hemispherical, Scatterometer
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.selection import Variant

# Smallest standard deviation of a point, relative to its value. One that was computed from a few
# repeats can be too small by chance.
SIGMA_FLOOR = 0.01
# The detector is assumed to have saturated if at least PLATEAU points have the same largest value,
# and if they are less than the share RARE of all points.
PLATEAU, RARE = 3, 0.2
DIRECTIONAL_STD = 0.02  # standard deviation of an emissivity or DHR for which none is stated


@dataclass
class Data:
    """BRDF points and directional tables that are fitted together.

    Attributes
    ----------
    theta_i, theta_r
        Elevations of source and observer [radians], (p,).
    brdf
        Measured BRDFs [1/sr], (p,).
    half_angle
        Angular radius of the source [radians].
    scale
        Scale on which model and data are compared, a key of SCALES.
    spread
        Standard deviations of the points on this scale, (p,).
    has_sigma
        Whether the measurements came with standard deviations.
    directional
        Tables of emissivity or DHR that are fitted with the points.
    std_factor
        Factor by which the tables' standard deviations are multiplied.
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
        """Number of BRDF points."""
        return len(self.brdf)

    @property
    def rows(self) -> int:
        """Number of residuals: BRDF points and entries of the directional tables."""
        return self.points + sum(len(table.theta) for table in self.directional)

    def residuals(self, variant: Variant, aperture: bool = True) -> Residuals:
        """The residuals of a variant. aperture: False takes the source as a point."""
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
        """Change of each row when every BRDF f (points,) grows by one decade, (rows,).

        It is 0 for the rows of the directional tables.
        """
        change = SCALES[self.scale](f)[1] * f * np.log(10) / self.spread
        return np.concatenate([change, np.zeros(self.rows - self.points)])

    def jointly(self, variance: float, tables: list[DirectionalData]) -> "Data":
        """The same points, together with directional tables.

        variance: variance of a BRDF row, by which the rows are scaled to unit variance. A BRDF
        point and an entry of a table then have the right weight relative to each other.
        """
        return replace(self, spread=self.spread * np.sqrt(variance), directional=tables)

    def with_std_factor(self, factor: float) -> "Data":
        """The same data with the tables' standard deviations multiplied by `factor`."""
        return replace(self, std_factor=factor)

    def rms_dex(self, candidate) -> float:
        """Root mean square of log10(model / data) over the BRDF points [decades], for any loss."""
        f = self.residuals(candidate.variant).instrument(candidate.u[None])[0][0]
        return float(np.sqrt(np.mean(np.square(np.log10(np.maximum(f, 1e-30) / self.brdf)))))


def select(
    measurements: Measurements,
    scale: str,
    half_angle: float,
    max_angle_deg: float,
    min_brdf: float,
    fewest: int,
) -> tuple[Data, np.ndarray, dict[str, int]]:
    """Choose the points to fit.

    Parameters
    ----------
    measurements
        The measured points.
    scale
        Scale on which model and data are compared, a key of SCALES.
    half_angle
        Angular radius of the source [radians].
    max_angle_deg
        Largest |theta_i| and |theta_r| that are used [degrees].
    min_brdf
        BRDF above which points are used [1/sr].
    fewest
        Smallest number of points that can be fitted: the number of parameters.

    Returns
    -------
    tuple
        The `Data`, the mask of the points that were used, and the number of points that were
        dropped for each reason.

    Raises
    ------
    InputError
        If fewer than `fewest` points are left.
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
    spread, has_sigma = np.ones(used.sum()), measurements.sigma is not None
    if has_sigma:
        sigma = np.fmax(np.asarray(measurements.sigma, dtype=float)[used], SIGMA_FLOOR * brdf[used])
        spread = sigma * SCALES[scale](brdf[used])[1]
    data = Data(theta_i[used], theta_r[used], brdf[used], half_angle, scale, spread, has_sigma)
    return data, used, dropped


def with_std(table: DirectionalData, quantity: str) -> DirectionalData:
    """The table as `quantity`, with a standard deviation at each angle.

    Raises InputError for values outside 0..1 and angles outside 0..90 degrees.
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
