"""Pose of a camera from points of a model and their pixels (resection), by least squares."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.statistics import student_factor

FEWEST = 4  # points; three have up to four poses
ON_A_LINE = 1e-4  # width of points that count as one line, relative to their length
IN_A_PLANE = 0.05  # thickness of points that count as a plane for the first guess, likewise
NEAREST = 1e-6  # smallest depth of a point during the search, relative to the points' extent
MISFIT_PX = 3.0  # rms residual from which on the points are tried behind the camera
BETTER = 3.0  # factor by which the residual must fall then
ALIKE = 9.0  # difference in chi-square up to which a second pose explains the points as well
APART = 3.0  # least distance of a second pose, in standard errors


@dataclass(frozen=True)
class Minimum:
    """A pose at which the sum of the squared residuals has a minimum.

    Attributes
    ----------
    eye : ndarray, shape (3,)
        Position of the camera [m].
    sides : ndarray, shape (3, 3)
        Unit vectors to the right, upward, and along the optical axis, one a row.
    residual_px : ndarray, shape (n, 2)
        Predicted columns and rows less the measured ones.
    slopes : ndarray, shape (2n, 6)
        Derivatives of the residuals with respect to turns about right, up and axis [1/rad], and to
        the position [1/m].
    """

    eye: np.ndarray
    sides: np.ndarray
    residual_px: np.ndarray
    slopes: np.ndarray

    @property
    def square(self) -> float:
        """Sum of the squared residuals [pixels^2]."""
        return float(np.sum(self.residual_px**2))

    @property
    def rms_px(self) -> float:
        """Rms residual of a column or row [pixels]."""
        return float(np.sqrt(np.mean(self.residual_px**2)))


@dataclass(frozen=True)
class Solved(Minimum):
    """The deepest minimum, and how well the points determine it.

    errors: standard errors of the turns [rad] and of the position [m], (6,). factor: half of a 95 %
    interval in standard errors. second: another pose that explains the points as well, or None.
    """

    errors: np.ndarray
    factor: float
    second: Minimum | None


def pixels(points: np.ndarray, eye: np.ndarray, sides: np.ndarray, imager: Imager) -> np.ndarray:
    """Columns and rows at which a camera sees points, (n, 2).

    The corner of the frame is 0, the middle of its first pixel 0.5. Rows go down.
    """
    right, up, depth = sides @ (points - eye).T
    depth = np.maximum(depth, NEAREST * np.ptp(points, axis=0).max())
    across = np.stack([right, -up]) / (depth * imager.pixel_angle)
    return across.T + [imager.width / 2, imager.height / 2]


def solve(points: np.ndarray, places: np.ndarray, imager: Imager, sigma_px: float | None) -> Solved:
    """The pose in which a camera sees points at their places in the frame.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        In the scene's axes [m].
    places : ndarray, shape (n, 2)
        Columns and rows, as of `pixels`.
    imager : Imager
    sigma_px : float or None
        Standard deviation of a column or row [pixels]. None: that of the residuals.

    Raises
    ------
    InputError
        For points that do not determine a pose.
    """
    check_points(points, places)
    best, *others = minima(points, places, imager)
    if best.rms_px > MISFIT_PX:
        # Seen through the camera's middle, points behind it are those in front of it, inverted
        middle = points.mean(axis=0)
        behind = minima(2 * middle - points, places, imager)[0]
        if BETTER * behind.rms_px < best.rms_px:
            raise InputError(
                f"the points would be behind the camera: in front of it they miss their pixels by "
                f"{best.rms_px:.3g} (rms); are x, y, z right-handed, and do the rows go down?"
            )
    freedom = places.size - 6
    variance = best.square / freedom if sigma_px is None else sigma_px**2
    try:
        covariance = variance * np.linalg.inv(best.slopes.T @ best.slopes)
    except LinAlgError:
        raise InputError("the points do not determine the pose; add points beside them") from None
    errors = np.sqrt(np.diag(covariance))
    second = None
    for other in others:
        alike = other.square - best.square < ALIKE * max(variance, 1e-12)
        if alike and np.any(abs(other.eye - best.eye) > APART * errors[3:]):
            second = other
    factor = student_factor(freedom if sigma_px is None else np.inf)
    return Solved(**vars(best), errors=errors, factor=factor, second=second)


def check_points(points: np.ndarray, places: np.ndarray) -> None:
    """Raise InputError for points that no pose follows from, whatever their pixels are."""
    if len(points) < FEWEST:
        raise InputError(
            f"{len(points)} points; a pose needs {FEWEST} or more, and six or more for its errors"
        )
    _, sizes, _ = np.linalg.svd(points - points.mean(axis=0))
    if sizes[1] <= ON_A_LINE * sizes[0]:
        raise InputError(
            "the points lie on a line, about which the camera may turn; add one beside it"
        )
    if np.linalg.svd(places - places.mean(axis=0))[1][1] < 1e-9:
        raise InputError("the pixels lie on a line; such points do not determine a pose")


def starts(points: np.ndarray, places: np.ndarray, imager: Imager) -> list[tuple]:
    """First guesses (eye, sides) from a parallel projection with a scale.

    With p the points from their middle, the tangents are x = x0 + I.p and y = y0 + J.p, where I and
    J are the vectors to the right and upward divided by the distance (DeMenthon and Davis 1995).
    Points that are nearly in a plane leave the parts of I and J across it open. Both must be
    equally long and at right angles, which has two solutions.
    """
    middle = points.mean(axis=0)
    x = (places - [imager.width / 2, imager.height / 2]) * [1, -1] * imager.pixel_angle
    offset = x.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle)
    if sizes[2] > IN_A_PLANE * sizes[0]:
        guesses = [np.linalg.lstsq(points - middle, x - offset, rcond=None)[0].T]
    else:
        flat = (points - middle) @ axes[:2].T
        inside = np.linalg.lstsq(flat, x - offset, rcond=None)[0].T @ axes[:2]
        difference = inside[1] @ inside[1] - inside[0] @ inside[0]
        product = -inside[0] @ inside[1]
        across = np.sqrt(max((difference + np.hypot(difference, 2 * product)) / 2, 0))
        along = np.sqrt(max(across**2 - difference, 0)) * (np.sign(product) or 1)
        guesses = [inside + sign * np.outer([across, along], axes[2]) for sign in (1, -1)]
    result = []
    for right, up in guesses:
        lengths = np.linalg.norm([right, up], axis=1)
        if lengths.min() <= 1e-6 * lengths.max():
            continue
        # The nearest pair of unit vectors at right angles
        u, _, v = np.linalg.svd(np.stack([right, up]) / lengths.mean(), full_matrices=False)
        right, up = u @ v
        sides = np.stack([right, up, np.cross(up, right)])
        toward = sides[2] + offset @ sides[:2]
        result.append((middle - toward / lengths.mean(), sides))
    return result


def minima(points: np.ndarray, places: np.ndarray, imager: Imager) -> list[Minimum]:
    """The minima of the squared residuals that the first guesses lead to, the deepest first."""
    result = []
    for eye, sides in starts(points, places, imager):
        scale = np.linalg.norm(points.mean(axis=0) - eye)

        def placed(step, eye=eye, sides=sides, scale=scale):
            return eye + scale * step[3:], Rotation.from_rotvec(step[:3]).as_matrix() @ sides

        def residuals(step, placed=placed):
            return (pixels(points, *placed(step), imager) - places).ravel()

        fit = least_squares(residuals, np.zeros(6), method="lm", max_nfev=2000, xtol=1e-12)
        eye, sides = placed(fit.x)

        def turned(step, eye=eye, sides=sides):
            turn = Rotation.from_rotvec(-(step[:3] @ sides)).as_matrix()
            return (pixels(points, eye + step[3:], sides @ turn, imager) - places).ravel()

        slopes = least_squares(turned, np.zeros(6), x_scale=[1, 1, 1, *[scale] * 3], max_nfev=1).jac
        result.append(Minimum(eye, sides, fit.fun.reshape(-1, 2), slopes))
    if not result:
        raise InputError("the pixels do not fit to a view of the points; check their order")
    return sorted(result, key=lambda minimum: minimum.square)
