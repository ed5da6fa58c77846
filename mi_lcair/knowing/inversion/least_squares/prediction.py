"""Predicted measurements near the values at which they were rendered, and unbiased products.

The radiance of a pixel is linear in the blackbody radiances of all sources. A `DatumBlock`
therefore follows temperatures exactly without a new render, and other parameters to first order.

A noisy render in the matrix of least squares biases the solution: the noise of the derivatives
times itself does not average out. Products of two independent randomisations of the render have no
bias (instrumental variables). `product` sums over all pairs of different randomisations.

Pixels of an image can share noise: a random error of each row, each column, or the frame. With the
standard deviations of the shared errors in the columns of U, and the weights w of the noise that
each pixel has for itself, the inverse covariance of all noise is w - w U (1 + U^T w U)^-1 U^T w
(Woodbury). It is never formed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import cho_solve

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope

# Smallest eigenvalue of the scaled covariance of the gradient, relative to the largest, that counts
RANK = 1e-13
LITTLE = 1e-4  # information, relative to what is known beforehand, that does not count
SIGNIFICANT = 3  # standard errors by which the squared derivatives must exceed 0


@dataclass(frozen=True)
class CommonNoise:
    """Standard deviations of errors that values share.

    columns: (n, G), dense or sparse, the change of each value for one standard deviation of each
    error.
    """

    columns: np.ndarray | sparse.csr_array

    @staticmethod
    def of_image(counts: np.ndarray, sigma: float, row: float, column: float, frame: float):
        """The noise of the pixels that count, (H, W) of bool, or None without any.

        row, column, frame: standard deviation of an error common to each row, each column and all
        pixels, in units of that of one pixel, `sigma`.
        """
        rows, columns = np.nonzero(counts)
        count = len(rows)
        groups = ((row, rows), (column, columns), (frame, np.zeros(count, dtype=int)))
        parts = [
            sparse.csr_array((np.full(count, ratio * sigma), (np.arange(count), number)))
            for ratio, number in groups
            if ratio > 0
        ]
        return CommonNoise(sparse.hstack(parts, format="csr")) if parts else None

    def beside(self, columns: np.ndarray) -> "CommonNoise":
        """These errors and others, (n, G) each, behind them."""
        return CommonNoise(beside(self.columns, columns))

    def factor(self, w: np.ndarray) -> np.ndarray:
        """Cholesky factor (G, G) of 1 + U^T w U, lower triangle."""
        inner = dense(self.columns.T @ weighted(self.columns, w))
        return np.linalg.cholesky(np.eye(len(inner)) + inner)

    def whitened(self, w: np.ndarray, values: list) -> list:
        """What products of values, each (n, K), lose to the shared errors: (G, K) each.

        a^T W b is a^T w b less the product of what a and b lose.
        """
        inverse = np.linalg.inv(self.factor(w))
        return [inverse @ dense(self.columns.T @ weighted(of, w)) for of in values]

    def removed(self, w: np.ndarray, values) -> np.ndarray:
        """Values (n, K) without their best estimate of the shared errors."""
        inverse = np.linalg.inv(self.factor(w))
        lost = inverse @ dense(self.columns.T @ weighted(values, w))
        return dense(values) - self.columns @ (inverse.T @ lost)

    def sizes(self, w: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Best estimate (G,) of the shared errors in values (n,), in their standard deviations."""
        return cho_solve((self.factor(w), True), self.columns.T @ (w * values))

    def expected(self, w: np.ndarray, variance: np.ndarray) -> float:
        """What the shared errors add to the expectation of the weighted squared residuals.

        variance: that which each value has for itself, (n,). Nothing if the weights are its
        inverse.
        """
        columns, lower = self.columns, self.factor(w)
        inner = dense(columns.T @ weighted(columns, w - w**2 * variance))
        return float(np.trace(cho_solve((lower, True), inner)))


@dataclass(frozen=True)
class Nuisances:
    """Errors that values share, relative to the predicted values.

    names: of each, by its kind. labels: of each, by itself. patterns: (n, G), the relative change
    for one standard deviation. is_offset: (G,) of bool, those that are relative to the mean value.
    """

    names: list[str]
    labels: list[str]
    patterns: np.ndarray
    is_offset: np.ndarray

    def added_to(self, common: CommonNoise | None, predicted: np.ndarray) -> CommonNoise:
        """These errors of predicted values (n,) behind others that the values share."""
        columns = self.columns(predicted)
        return CommonNoise(columns) if common is None else common.beside(columns)

    def columns(self, predicted: np.ndarray) -> np.ndarray:
        """Changes (n, G) of predicted values (n,) for one standard deviation of each error."""
        level = np.where(self.is_offset, predicted.mean(), predicted[:, None])
        return level * self.patterns

    def beside(self, other: "Nuisances") -> "Nuisances":
        """These errors and others behind them."""
        return Nuisances(
            [*self.names, *other.names],
            [*self.labels, *other.labels],
            np.hstack([self.patterns, other.patterns]),
            np.append(self.is_offset, other.is_offset),
        )


def weighted(columns, w: np.ndarray):
    """diag(w) columns, dense or sparse."""
    if sparse.issparse(columns):
        return sparse.diags_array(w) @ columns
    return w[:, None] * columns


def mean_of(columns: list):
    """Mean (n, K) of the derivatives of all randomisations, dense or sparse."""
    return sum(columns[1:], columns[0]) * (1 / len(columns))


def dense(values) -> np.ndarray:
    return values.toarray() if sparse.issparse(values) else values


class Weighing(NamedTuple):
    """How measured values are weighed: weights (n,), and noise that they share."""

    weight: np.ndarray
    common: CommonNoise | None = None


@dataclass(frozen=True)
class DatumBlock:
    """What one datum predicts near the values at which it was rendered.

    Attributes
    ----------
    measured : ndarray, shape (n,)
        Measured values.
    noise : callable
        Standard deviations (n,) of the measurement for predicted values (n,).
    radiance : ndarray, shape (R, n)
        Prediction of each independent randomisation.
    columns : list of R arrays, each (n, K)
        Its derivatives, dense or sparse.
    unknown : ndarray of int, shape (K,)
        Index of the unknown to which each column belongs.
    reference : ndarray, shape (K,)
        Values at which the datum was rendered.
    band : Band or None
        Band of the blackbody radiances; None if no column is a temperature.
    is_temperature : ndarray of bool, shape (K,)
        Columns in which the radiance is linear in the blackbody radiance of the unknown.
    weight : ndarray, shape (n,)
        Weights, independent of the randomisations of `radiance` and `columns`.
    gain, offset : int or None
        Numbers of the unknown gain and offset.
    half_width : float
        Values that differ from the measured ones by less than this are as good as equal.
    paths : int
        Paths of a render; 0 if they are not known.
    spread : float
        Number of values that share an error of the render, as optics spread light over pixels.
    is_image : bool
        Whether the values are pixels of a measured image, some of which may be bad.
    curvature : ndarray, shape (R, n, K, K), or None
        Second derivatives with respect to the coordinates, see `coordinates`; None for 0.
    learns_curvature : bool
        Whether second derivatives are learned from the renders of an iteration.
    common : CommonNoise or None
        Noise that several values share, beside `noise`, which each has for itself.
    """

    measured: np.ndarray
    noise: Callable
    radiance: np.ndarray
    columns: list
    unknown: np.ndarray
    reference: np.ndarray
    band: Band | None
    is_temperature: np.ndarray
    weight: np.ndarray
    gain: int | None = None
    offset: int | None = None
    half_width: float = 0.0
    paths: int = 0
    spread: float = 1.0
    is_image: bool = False
    curvature: np.ndarray | None = None
    learns_curvature: bool = True
    common: CommonNoise | None = None

    def coordinates(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (K,) of the columns' unknowns, and their derivatives (K,) by the values.

        They are the blackbody radiance of a temperature that is followed, and the value of others.
        """
        u, rate, hot = values.astype(float), np.ones(len(values)), self.is_temperature
        if hot.any():
            u[hot] = in_band_radiance(self.band, values[hot])
            rate[hot] = in_band_slope(self.band, values[hot])
        return u, rate

    @cached_property
    def rendered_coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        return self.coordinates(self.reference)

    def change(self, x: np.ndarray) -> float:
        """Largest relative change of a predicted value from the rendered one at the values x."""
        rendered = np.abs(self.radiance.mean(axis=0))
        change = np.abs(self.at(x).mean - rendered)
        return float(np.max(change / np.maximum(rendered, np.mean(rendered))))

    def weighed(self, weighing: Weighing) -> "DatumBlock":
        return replace(self, weight=weighing.weight, common=weighing.common)

    def weighed_as(self, other: "DatumBlock") -> "DatumBlock":
        """This block with the covariance and the second derivatives of another one."""
        names = "weight", "curvature", "common"
        return replace(self, **{name: getattr(other, name) for name in names})

    def at(self, x: np.ndarray) -> "Prediction":
        """The prediction for the values x of all unknowns, (N,)."""
        u, rate = self.coordinates(x[self.unknown])
        rendered_u, rendered_rate = self.rendered_coordinates
        moved = u - rendered_u
        radiance, columns = list(self.radiance), self.columns
        if moved.any():
            ahead = moved / rendered_rate
            radiance = [F + J @ ahead for F, J in zip(radiance, columns)]
        columns = [scaled(J, rate / rendered_rate) for J in columns]
        if self.curvature is not None and moved.any():
            bent = self.curvature @ moved
            radiance = [F + of @ moved / 2 for F, of in zip(radiance, bent)]
            columns = [J + of * rate for J, of in zip(columns, bent)]
        extra = [k for k in (self.gain, self.offset) if k is not None]
        unknown = np.append(self.unknown, extra).astype(int)
        if extra:
            gain = 1.0 if self.gain is None else x[self.gain]
            zero = 0.0 if self.offset is None else x[self.offset]
            columns = [
                beside(J * gain, self.instrument_columns(F)) for J, F in zip(columns, radiance)
            ]
            radiance = [gain * F + zero for F in radiance]
        return Prediction(self, np.array(radiance), columns, unknown)

    def instrument_columns(self, radiance) -> np.ndarray:
        """Derivatives of gain * radiance + offset: (n, those of the two that exist)."""
        columns = [] if self.gain is None else [radiance]
        columns += [] if self.offset is None else [np.ones(len(radiance))]
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class Prediction:
    """A block's prediction for given values: radiance (R, n), columns [(n, K)], unknown (K,)."""

    block: DatumBlock
    radiance: np.ndarray
    columns: list
    unknown: np.ndarray

    @cached_property
    def mean(self) -> np.ndarray:
        return self.radiance.mean(axis=0)

    def without_common(self, residual: np.ndarray) -> np.ndarray:
        """Residuals (n,) without the best estimate of the errors that values share."""
        if self.block.common is None:
            return residual
        return self.block.common.removed(self.block.weight, residual[:, None])[:, 0]

    @property
    def variance(self) -> np.ndarray:
        """Variance of `mean` from the noise of the render, (n,)."""
        return variance_of_mean(self.radiance)

    @property
    def noise(self) -> np.ndarray:
        """Standard deviation of the measurement, (n,)."""
        return self.block.noise(self.mean)

    @property
    def residuals(self) -> np.ndarray:
        """Measured less predicted value of each randomisation, (R, n)."""
        measured, half = self.block.measured, self.block.half_width
        if half:
            measured = np.clip(self.mean, measured - half, measured + half)
        return measured - self.radiance


@dataclass(frozen=True)
class Equations:
    """Normal equations matrix (x_true - x) = gradient + noise of all blocks at some values x.

    Attributes
    ----------
    matrix : array or sparse array, (N, N)
        J^T W J from products of different randomisations.
    gradient : ndarray, shape (N,)
        J^T W residual, likewise.
    noise : array or sparse array, (N, N)
        Covariance of the gradient: noise of measurement and render. The noise of J is in it too,
        because it comes from the product of the same randomisations.
    measured_noise : array or sparse array, (N, N)
        The part of `noise` that comes from the noise of the measurement.
    """

    matrix: np.ndarray
    gradient: np.ndarray
    noise: np.ndarray
    measured_noise: np.ndarray

    @cached_property
    def transfer(self) -> np.ndarray:
        """matrix^T noise^-1, (N, N): least squares of the normal equations themselves.

        Without noise of the render, `noise` is the matrix, and this is the unit matrix. It is small
        for derivatives that are smaller than their own noise. They then give no information.
        """
        return self.matrix.T @ self.inverse_noise

    @cached_property
    def inverse_noise(self) -> np.ndarray:
        """Pseudoinverse (N, N) of the dense noise; raises InputError if it is not finite."""
        if not np.isfinite(self.noise).all():
            raise InputError(
                "the measured values and their derivatives cannot be predicted, because an unknown "
                "is almost 0, such as a temperature below 5 K; give another start or prior"
            )
        scale = np.sqrt(np.diag(self.noise))
        scale[scale == 0] = 1
        values, vectors = np.linalg.eigh(self.noise / np.outer(scale, scale))
        kept = values > RANK * max(values[-1], 0)
        inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        return inverse / np.outer(scale, scale)

    def weighed_as(self, other: "Equations") -> "Equations":
        """The same equations with the noise of others."""
        result = replace(self, noise=other.noise)
        if not sparse.issparse(self.noise):
            vars(result)["inverse_noise"] = other.inverse_noise
        return result

    def pressure(self, known: np.ndarray) -> Callable[["Equations"], float]:
        """Function gradient^T noise^-1 gradient of other equations: 0 at a solution.

        known: inverse variances (N,) that are known beforehand. Directions of which the data know
        next to nothing beside them do not count: their gradient is that of rounding errors.
        """
        if sparse.issparse(self.noise):
            inverse = sparse.diags_array(
                1 / np.maximum(self.noise.diagonal(), np.finfo(float).tiny)
            )
        else:
            sigma = known[:, None] ** -0.5
            values, vectors = np.linalg.eigh(self.noise * (sigma * sigma.T))
            directions = sigma * vectors[:, values > LITTLE]
            inverse = directions @ (directions / values[values > LITTLE]).T
        return lambda other: float(other.gradient @ (inverse @ other.gradient))

    @cached_property
    def information(self) -> np.ndarray:
        """Inverse covariance (N, N) that the data give the unknowns."""
        if sparse.issparse(self.matrix):
            return self.matrix
        both = self.transfer @ self.matrix
        return (both + both.T) / 2

    @cached_property
    def pull(self) -> np.ndarray:
        """Right side (N,) that belongs to `information`."""
        return self.gradient if sparse.issparse(self.matrix) else self.transfer @ self.gradient


def equations(blocks: list[DatumBlock], x: np.ndarray, is_sparse: bool = False) -> Equations:
    """Normal equations at the values x, (N,)."""
    count = len(x)
    gradient = np.zeros(count)
    matrix, noise, measured = (
        sparse.csr_array((count, count)) if is_sparse else np.zeros((count, count))
        for _ in range(3)
    )
    for block in blocks:
        prediction = block.at(x)
        w, J, r = block.weight, prediction.columns, [row[:, None] for row in prediction.residuals]
        unknown = prediction.unknown
        common = block.common
        gradient[unknown] += np.ravel(weighed_product(w, common, J, r))
        mean, variance = mean_of(J), prediction.noise**2
        matrix = placed(matrix, weighed_product(w, common, J, J), unknown)
        if common:
            mean = common.removed(w, mean)
            shared = common.columns.T @ weighted(mean, w)
            noise, measured = (placed(of, shared.T @ shared, unknown) for of in (noise, measured))
        both = weighted(mean, w**2 * (variance + block.spread * prediction.variance))
        noise = placed(noise, mean.T @ both, unknown)
        measured = placed(measured, mean.T @ weighted(mean, w**2 * variance), unknown)
    return Equations(matrix, gradient, noise, measured)


def change_of_gradient(blocks: list[DatumBlock], x: np.ndarray, new: np.ndarray) -> np.ndarray:
    """J^T W times the change of the prediction from the values x to new ones, (N,)."""
    change = np.zeros(len(x))
    for block in blocks:
        here, there = block.at(x), block.at(new)
        moved = [row[:, None] for row in there.radiance - here.radiance]
        change[here.unknown] += np.ravel(
            weighed_product(block.weight, block.common, here.columns, moved)
        )
    return change


def cost_of(blocks: list[DatumBlock], x: np.ndarray) -> float:
    """Sum of the weighted squared residuals at the values x, without the render's own noise."""
    total = 0.0
    for block in blocks:
        r = [row[:, None] for row in block.at(x).residuals]
        total += float(np.ravel(weighed_product(block.weight, block.common, r, r))[0])
    return total


def weighed_product(w: np.ndarray, common: CommonNoise | None, a: list, b: list):
    """`product` with the inverse covariance of all noise of values: weights w and shared errors."""
    total = product(a, w, b)
    if common is None:
        return total
    lost_a = common.whitened(w, a)
    lost_b = lost_a if b is a else common.whitened(w, b)
    lost = product(lost_a, np.ones(len(lost_a[0])), lost_b)
    return (total.toarray() if sparse.issparse(total) else total) - lost


def variance_of_mean(radiance: np.ndarray) -> np.ndarray:
    """Variance of the mean over the first axis, that of the independent randomisations."""
    if len(radiance) == 1:
        return np.zeros(radiance.shape[1:])  # a prediction without noise
    return radiance.var(axis=0, ddof=1) / len(radiance)


def product(a: list, w: np.ndarray, b: list):
    """Mean of a_r^T diag(w) b_s over all pairs of different randomisations r, s."""
    R = len(a)
    if R == 1:
        return a[0].T @ weighted(b[0], w)  # a prediction without noise
    both = sum(a[1:], a[0]).T @ weighted(sum(b[1:], b[0]), w)
    same = [left.T @ weighted(right, w) for left, right in zip(a, b)]
    return (both - sum(same[1:], same[0])) / (R * (R - 1))


def scaled(columns, factors: np.ndarray):
    """columns diag(factors), dense or sparse."""
    if (factors == 1).all():
        return columns
    if sparse.issparse(columns):
        return columns @ sparse.diags_array(factors)
    return columns * factors


def beside(columns, more: np.ndarray):
    """Columns with dense columns behind them."""
    if sparse.issparse(columns):
        return sparse.hstack([columns, sparse.csr_array(more)], format="csr")
    return np.concatenate([columns, more], axis=1)


def placed(total, part, unknown: np.ndarray):
    """The total with a block's part added at the rows and columns of its unknowns."""
    if sparse.issparse(total):
        part = sparse.coo_array(part)
        at = (unknown[part.coords[0]], unknown[part.coords[1]])
        return total + sparse.csr_array((part.data, at), shape=total.shape)
    total[np.ix_(unknown, unknown)] += part.toarray() if sparse.issparse(part) else part
    return total


def hidden(blocks: list[DatumBlock], count: int, judges_sparse: bool = False) -> np.ndarray:
    """Unknowns (count,) whose derivatives the noise of the render hides.

    The diagonal of J^T W J is found without one randomisation after the other. Its scatter gives
    its standard error (jackknife). An estimate with such a derivative would be biased, and its
    error too small. Sparse columns are only judged if `judges_sparse` says so.
    """
    total, variance = np.zeros((2, count))
    judged = np.zeros(count, dtype=bool)
    for block in blocks:
        R = len(block.columns)
        if R < 3 or sparse.issparse(block.columns[0]) and not judges_sparse:
            continue
        J = block.columns
        weighed = [weighted(single, block.weight) for single in J]
        pairs = np.array([[(a * b).sum(axis=0) for b in weighed] for a in J])
        same = pairs[range(R), range(R)]
        both, rows = pairs.sum(axis=(0, 1)) - same.sum(axis=0), pairs.sum(axis=1) - same
        without = (both - 2 * rows) / ((R - 1) * (R - 2))
        total[block.unknown] += both / (R * (R - 1))
        variance[block.unknown] += (R - 1) * without.var(axis=0)
        judged[block.unknown] |= same.any(axis=0)
    return judged & (total < SIGNIFICANT * np.sqrt(variance))


def without(block: DatumBlock, unknowns: np.ndarray) -> DatumBlock:
    """The block with derivatives of 0 for some unknowns, (N,) of bool."""
    kept = np.where(unknowns[block.unknown], 0.0, 1.0)
    return replace(block, columns=[scaled(J, kept) for J in block.columns])
