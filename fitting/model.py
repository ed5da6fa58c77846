"""Predicted readings of the instruments, with derivatives, at points of a model's unit cube.

They are computed for many sets of parameters at once, with Dr.Jit in Float64. A scatterometer's
source is often wider than the lobe. The measured peak is then an average over the `Disc`.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np
from drjit.llvm.ad import Array3f64, Float64, UInt32

from mi_lcair.physics import reflection
from mi_lcair.physics.reflection.interface import ReflectionModel, unit_rule

# Each rule has the largest distance from the mirror direction, in radii of the source, up to which
# it is used, and its numbers of Gauss nodes in each panel, in the plane of incidence and across it.
# With these rules the average has an error below 2e-3 for lobe widths from 0.0005 to 0.7.
RULES = ((4, (9, 7)), (12, (5, 3)), (np.inf, (3, 2)))


def parameters_at(model, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters of a reflection model, and their derivatives with respect to the coordinates.

    u: coordinates (m, n). Returns parameters (m, n) and derivatives (m, n parameters, n
    coordinates).
    """
    # Each parameter is computed in a graph of its own. If a parameter depended on another one in
    # the same graph, the other one would be an interior node, and Dr.Jit would clear its tangent.
    values, slopes = with_tangents(
        lambda *u: tuple(model.from_cube(u)[k] for k in range(len(u))), np.atleast_2d(u)
    )
    return model.exact_bounds(values), slopes


def with_tangents(
    function, u: np.ndarray, repeat=lambda coordinate: coordinate
) -> tuple[np.ndarray, np.ndarray]:
    """Values of a function of n coordinates and its derivatives, by forward differentiation.

    Parameters
    ----------
    function
        Function of n Dr.Jit arrays (l lanes). It returns one Dr.Jit array (l lanes) or k of them.
    u
        Coordinates, (m, n).
    repeat
        Function that spreads one coordinate (m lanes) over the l lanes.

    Returns
    -------
    tuple
        Values, (l,) or (l, k), and derivatives with respect to each coordinate, (l, n) or (l, k,
        n).
    """
    lanes = [dr.detach(repeat(Float64(np.ascontiguousarray(column)))) for column in u.T]
    dr.enable_grad(lanes)
    outputs = function(*lanes)
    single = not isinstance(outputs, tuple)
    outputs = (outputs,) if single else outputs
    tangents = []
    for lane in lanes:
        dr.set_grad(lane, 1)
        # Not ClearInput: an output may be the coordinate itself.
        dr.forward_from(lane, flags=dr.ADFlag.ClearInterior)
        tangents.append([dr.grad(output) for output in outputs])
        dr.clear_grad((lane, outputs))
    outputs = [dr.detach(output) for output in outputs]
    dr.eval(outputs, tangents)
    values = np.stack([output.numpy() for output in outputs], axis=-1)
    slopes = np.stack([np.stack([t.numpy() for t in row], axis=-1) for row in tangents], axis=-1)
    return (values[..., 0], slopes[..., 0, :]) if single else (values, slopes)


class Disc:
    """Quadrature over the disc of the source around each theta_i, with dense nodes at the peak.

    The offset in the plane of incidence runs over two panels. They meet at the mirror direction of
    theta_r, or at the point of the rim that is nearest to it. The offset across the plane runs over
    the upper half of the disc. Both are anchor + width sinh(t): the nodes are as fine as the lobe
    at its centre, and they cover the whole disc.

    Parameters
    ----------
    theta_i, theta_r
        Elevations of source and observer at each point [radians], (p,).
    half_angle
        Angular radius of the source [radians].
    """

    def __init__(self, theta_i, theta_r, half_angle: float):
        self.half_angle = half_angle
        offset = np.asarray(theta_r) - np.asarray(theta_i)
        rule_of = np.searchsorted([reach * half_angle for reach, _ in RULES], np.abs(offset))
        columns = []
        for number, (_, nodes) in enumerate(RULES):
            t, s, weight = panel(*nodes)
            for side in (-1, 1):
                # A panel is empty if the mirror direction lies beyond the rim on its side.
                points = np.flatnonzero((rule_of == number) & (side * offset < half_angle))
                columns.append(
                    [np.repeat(points, len(t)), np.full(len(t) * len(points), side)]
                    + [np.tile(column, len(points)) for column in (t, s, weight)]
                )
        point, side, t, s, weight = np.concatenate(columns, axis=1)
        order = np.argsort(point, kind="stable")
        self.point = point[order].astype(np.int64)
        self.first = np.searchsorted(self.point, np.arange(len(offset)))
        self.side, self.t, self.s, self.weight = (
            Float64(column[order]) for column in (side, t, s, weight)
        )
        dr.eval(self.side, self.t, self.s, self.weight)

    def direction(self, theta_i, theta_r, lobe_width, node) -> tuple[Array3f64, Float64]:
        """Unit vectors to the source and quadrature weights at nodes.

        Parameters
        ----------
        theta_i, theta_r
            Elevations of source and observer at each node's point [radians], Float64 (l,).
        lobe_width
            Width of the lobe, as `ReflectionModel.lobe_width`.
        node
            Indices of the nodes, UInt32 (l,).

        Returns
        -------
        tuple
            Unit vectors to the source, and weights proportional to cosine times solid angle.
        """
        side, t, s, weight = (
            dr.gather(Float64, column, node) for column in (self.side, self.t, self.s, self.weight)
        )
        R = dr.opaque(Float64, self.half_angle)
        mirror = theta_r - theta_i
        anchor = dr.clip(mirror, -R, R)
        in_plane, slope = graded(t, R - side * anchor, 2 * lobe_width + dr.abs(mirror - anchor))
        in_plane = anchor + side * in_plane
        height = dr.safe_sqrt(dr.square(R) - dr.square(in_plane))
        across, slope_across = graded(
            s, height, dr.cos(theta_i) * dr.hypot(2 * lobe_width, in_plane - mirror)
        )
        sin, cos = dr.sincos(theta_i + in_plane)
        sin_across, cos_across = dr.sincos(across)
        cosine = cos * cos_across
        weight *= slope * slope_across * cos_across * dr.maximum(cosine, 0)
        return Array3f64(sin * cos_across, sin_across, cosine), weight

    def average(self, values, slopes) -> tuple[np.ndarray, np.ndarray]:
        """Weighted means of the BRDF and of its derivatives over each point's nodes.

        Parameters
        ----------
        values
            Products f * weight, and the weights, (m, nodes, 2).
        slopes
            Products of the derivatives of f and the weights, (m, nodes, n).

        Returns
        -------
        tuple
            Means of f, (m, points), and of its derivatives, (m, points, n).
        """
        sums = np.add.reduceat(values, self.first, axis=1)
        slope_sums = np.add.reduceat(slopes, self.first, axis=1)
        return sums[..., 0] / sums[..., 1], slope_sums / sums[..., 1:]


def panel(in_plane: int, across: int):
    """Nodes t, s of a product rule on the unit square, flattened, and their weights.

    The height of the disc varies as a square root near the rim, t = 1 (and t = 0). If there are
    more than 3 nodes in the plane, they are made denser there.
    """
    t, t_weight = unit_rule(in_plane)
    s, s_weight = unit_rule(across)
    if in_plane > 3:
        t, t_weight = t * t * (3 - 2 * t), t_weight * 6 * t * (1 - t)
    return np.tile(t, across), np.repeat(s, in_plane), np.outer(s_weight, t_weight).ravel()


def graded(t, length, width):
    """Position in 0..length for t in 0..1, and its derivative with respect to t.

    The scale is fine at distances up to `width` from 0.
    """
    end = dr.asinh(length / width)
    return width * dr.sinh(end * t), width * end * dr.cosh(end * t)


class Scatterometer:
    """In-plane BRDFs as a scatterometer measures them.

    A measured BRDF is the average over the disc of the source, weighted by the cosine of the angle
    of incidence.

    Parameters
    ----------
    model, form
        Reflection model of the surfaces, and the form of its equations.
    theta_i, theta_r
        Elevations of source and observer as in `Measurements` [radians], (p,).
    half_angle
        Angular radius of the source [radians], 0 for a point source.
    """

    def __init__(
        self, model: ReflectionModel, form: str, theta_i, theta_r, half_angle: float = 0.0
    ):
        self.model, self.form = model, form
        self.disc = Disc(theta_i, theta_r, half_angle) if half_angle else None
        point = self.disc.point if half_angle else np.arange(len(theta_i))
        self.nodes = len(point)
        self.theta_i, self.theta_r = (
            Float64(np.asarray(theta_i)[point]),
            Float64(np.asarray(theta_r)[point]),
        )
        dr.eval(self.theta_i, self.theta_r)

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """BRDFs [1/sr] of the surfaces at coordinates u (m, n), and their derivatives.

        The BRDFs are (m, points), their derivatives with respect to u are (m, points, n).
        """
        surface, node = lanes(len(u), self.nodes)
        theta_i, theta_r = (
            dr.gather(Float64, self.theta_i, node),
            dr.gather(Float64, self.theta_r, node),
        )
        sin_r, cos_r = dr.sincos(theta_r)
        r = Array3f64(-sin_r, 0, cos_r)  # the source has x > 0, the specular side x < 0

        def brdf(*u):
            S = self.model.surface(*self.model.from_cube(u), form=self.form)
            if self.disc is None:
                sin_i, cos_i = dr.sincos(theta_i)
                return self.model.f(S, Array3f64(sin_i, 0, cos_i), r)
            # The width only places the nodes. The average does not depend on it.
            lobe_width = dr.detach(self.model.lobe_width(S))
            i, weight = self.disc.direction(theta_i, theta_r, lobe_width, node)
            return self.model.f(S, i, r) * weight, weight

        values, slopes = with_tangents(
            brdf, u, lambda coordinate: dr.gather(Float64, coordinate, surface)
        )
        if self.disc is None:
            return values.reshape(len(u), -1), slopes.reshape(len(u), self.nodes, -1)
        return self.disc.average(
            values.reshape(len(u), self.nodes, 2), slopes[:, 0].reshape(len(u), self.nodes, -1)
        )


class Hemispherical:
    """Directional emissivities or reflectances as an instrument measures them.

    Parameters
    ----------
    model, form
        Reflection model of the surfaces, and the form of its equations.
    theta
        Angles [radians], (a,).
    quantity
        "emissivity" for 1 - HDR(theta_r), or "dhr" for DHR(theta_i).
    """

    def __init__(self, model: ReflectionModel, form: str, theta, quantity: str):
        self.model, self.form, self.quantity = model, form, quantity
        self.theta = Float64(np.asarray(theta, dtype=float))

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values of the surfaces at coordinates u (m, n), and their derivatives.

        The values are (m, angles), their derivatives with respect to u are (m, angles, n).
        """
        count = dr.width(self.theta)
        surface, angle = lanes(len(u), count)
        theta = dr.gather(Float64, self.theta, angle)

        def directional(*u):
            S = self.model.surface(*self.model.from_cube(u), form=self.form)
            if self.quantity == "dhr":
                return self.model.DHR(S, theta)
            return 1 - self.model.HDR(S, theta)

        values, slopes = with_tangents(
            directional, u, lambda coordinate: dr.gather(Float64, coordinate, surface)
        )
        return values.reshape(len(u), count), slopes.reshape(len(u), count, -1)


def lanes(surfaces: int, rows: int) -> tuple[UInt32, UInt32]:
    """Index of the surface and of the row for each of the surfaces * rows lanes.

    The number of rows is opaque to Dr.Jit, so that the same kernel is used for any number.
    """
    lane, rows = dr.arange(UInt32, surfaces * rows), dr.opaque(UInt32, rows)
    surface = lane // rows
    return surface, lane - surface * rows


# What a fit predicts, and its curves beside the measured points, for pictures and pages
# --------------------------------------------------------------------------------------

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
