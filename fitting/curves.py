"""What a fit predicts, and its curves beside the measured points, for pictures and pages."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.fitting.model import Hemispherical, Scatterometer
from mi_lcair.physics import reflection

MOST_SCANS = 12  # largest number of angles that are drawn, evenly taken from all
POINTS = 300  # points of a fitted curve
# Scans without measurements: angles of incidence, and the largest angle of the observer [degrees]
INCIDENCES, WIDEST = (10.0, 30.0, 50.0, 70.0), 80.0


@dataclass(frozen=True)
class Scan:
    """The fitted curve and the measured points at one setting of one angle, over the other one.

    setting: of the fixed angle, degrees. curve: angles [degrees] and fitted BRDF [1/sr]. fitted,
    left_out: angles and BRDF of the points that the fit used and did not use. residuals: log10
    (measured / fitted) of the fitted points. band: angles and both ends of the curve's 95 %
    interval, 1/sr.
    """

    setting: float
    curve: tuple[np.ndarray, np.ndarray]
    fitted: tuple = ((), ())
    left_out: tuple = ((), ())
    residuals: np.ndarray | tuple = ()
    band: tuple = ((), (), ())


def scans_of(fit, measurements=None) -> tuple[str, str, list[Scan]]:
    """The scans of a fit, and which angle they go over and which one is fixed.

    The angle with more values is swept, "theta_r" or "theta_i". Points that are not positive are
    left out, as they have no place on a logarithmic axis. Without measurements there are scans at
    INCIDENCES.
    """
    if measurements is None:
        x = np.linspace(-WIDEST, WIDEST, POINTS)
        curves = [curve_of(fit, "theta_r", x, "theta_i", setting) for setting in INCIDENCES]
        scans = [Scan(setting, curve) for setting, curve in zip(INCIDENCES, curves)]
        return "theta_r", "theta_i", scans
    angles = {
        "theta_r": np.degrees(measurements.theta_r),
        "theta_i": np.degrees(measurements.theta_i),
    }
    counts = {name: len(np.unique(values)) for name, values in angles.items()}
    swept, fixed = sorted(angles, key=counts.get, reverse=True)
    settings = np.unique(angles[fixed])
    taken = np.unique(np.linspace(0, len(settings) - 1, MOST_SCANS).round().astype(int))
    brdf, used = measurements.brdf, np.asarray(fit.used_points, bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        residuals = np.log10(brdf / predicted(fit, measurements.theta_i, measurements.theta_r))
    ends = np.full((len(brdf), 2), np.nan)
    if fit.brdf_interval is not None:
        ends[used] = fit.brdf_interval
    scans = []
    for setting in settings[taken]:
        at_setting = angles[fixed] == setting
        x = angles[swept][at_setting]
        curve = curve_of(fit, swept, np.linspace(x.min(), x.max(), POINTS), fixed, setting)
        fitted, left_out = (at_setting & kept & (brdf > 0) for kept in (used, ~used))
        order = np.flatnonzero(fitted)[np.argsort(angles[swept][fitted], kind="stable")]
        scans.append(
            Scan(
                float(setting),
                curve,
                (angles[swept][fitted], brdf[fitted]),
                (angles[swept][left_out], brdf[left_out]),
                residuals[fitted],
                (angles[swept][order], *ends[order].T),
            )
        )
    return swept, fixed, scans


def curve_of(fit, swept: str, angles_deg, fixed: str, setting_deg: float) -> tuple:
    """Angles and fitted BRDF over one angle, with the other one fixed."""
    angles = {swept: np.radians(angles_deg)}
    angles[fixed] = np.full(len(angles_deg), np.radians(setting_deg))
    return angles_deg, predicted(fit, **angles)


def model_of(fit) -> str:
    """Title of the fitted model, with its form if it has several, and its restriction."""
    model = reflection.model(fit.model)
    form = [f"{fit.form} form"] if len(model.forms) > 1 else []
    restriction = [fit.restriction] if fit.restriction else []
    return ", ".join([model.title, *form, *restriction])


def coordinates(fit) -> np.ndarray:
    """Coordinates of a fit's parameters in the unit cube of its model, shape (1, n)."""
    return reflection.model(fit.model).to_cube([list(fit.parameters.values())])


def predicted(fit, theta_i, theta_r) -> np.ndarray:
    """The fitted BRDF, 1/sr, as the instrument measures it, at angles in radians."""
    half_angle = np.radians(fit.settings["source_half_angle_deg"])
    model = reflection.model(fit.model)
    instrument = Scatterometer(model, fit.form, theta_i, theta_r, half_angle)
    return instrument(coordinates(fit))[0][0]


def directional(fit, quantity: str, theta) -> np.ndarray:
    """The fitted emissivity or DHR at angles theta, radians."""
    model = reflection.model(fit.model)
    return Hemispherical(model, fit.form, theta, quantity)(coordinates(fit))[0][0]
