"""Noise that pixels of an image share: a random error of each row, each column, or the frame.

With the standard deviations of the shared errors in the columns of U, and the weights w of the
noise that each pixel has for itself, the inverse covariance of all noise is
w - w U (1 + U^T w U)^-1 U^T w (Woodbury). It is never formed.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import cho_solve, solve_triangular


@dataclass(frozen=True)
class CommonNoise:
    """Standard deviations of errors that values share.

    columns: sparse (n, G), the change of each value for one standard deviation of each error.
    """

    columns: sparse.csr_array

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

    def factor(self, w: np.ndarray) -> np.ndarray:
        """Cholesky factor (G, G) of 1 + U^T w U, lower triangle."""
        inner = (self.columns.T @ (sparse.diags_array(w) @ self.columns)).toarray()
        return np.linalg.cholesky(np.eye(len(inner)) + inner)

    def whitened(self, w: np.ndarray, values: list) -> list:
        """What products of values, each (n, K), lose to the shared errors: (G, K) each.

        a^T W b is a^T w b less the product of what a and b lose.
        """
        lower = self.factor(w)
        return [
            solve_triangular(lower, dense(self.columns.T @ weighted(of, w)), lower=True)
            for of in values
        ]

    def removed(self, w: np.ndarray, values) -> np.ndarray:
        """Values (n, K) without their best estimate of the shared errors."""
        lower = self.factor(w)
        (lost,) = self.whitened(w, [values])
        return dense(values) - self.columns @ solve_triangular(lower, lost, lower=True, trans="T")

    def expected(self, w: np.ndarray, variance: np.ndarray) -> float:
        """What the shared errors add to the expectation of the weighted squared residuals.

        variance: that which each value has for itself, (n,). Nothing if the weights are its
        inverse.
        """
        columns, lower = self.columns, self.factor(w)
        inner = (columns.T @ (sparse.diags_array(w - w**2 * variance) @ columns)).toarray()
        return float(np.trace(cho_solve((lower, True), inner)))


def weighted(columns, w: np.ndarray):
    """diag(w) columns, dense or sparse."""
    if sparse.issparse(columns):
        return sparse.diags_array(w) @ columns
    return w[:, None] * columns


def dense(values) -> np.ndarray:
    return values.toarray() if sparse.issparse(values) else values
