"""Temperatures of all facets from images, by linear least squares with noisy matrices."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.sensitivity.facets import FacetMatrix

LEAST_RANDOMISATIONS = 4  # two for each half
# The weights depend on the radiances of the facets. Those of the first solution are taken at equal
# radiances, those of the others at the solution before.
SOLUTIONS = 3
# Share of the image's mean in a pixel's variance of the rendering. The variance of few
# randomisations is small by chance in some pixels, and these would get too large a weight.
SHARE_OF_MEAN = 0.1
STEP = 1e-3  # difference of temperatures for the derivative of Planck's law [K]
# Right sides that SuperLU solves together. With a hundred or more, it starts threads that take far
# longer than the solution.
BATCH = 32


@dataclass(frozen=True)
class FacetEstimate:
    """Temperatures of facets, estimated from images.

    Attributes
    ----------
    facets : ndarray, shape (F,)
        The facets, numbered as in `FacetTable`.
    temperature, error : ndarray, shape (F,)
        Temperatures and their standard errors [K]. NaN and infinity for a facet whose estimated
        radiance is not positive.
    radiance : ndarray, shape (F,)
        Estimated in-band blackbody radiances [W m^-2 sr^-1].
    residuals : list of ndarray, shape (height, width)
        Measured minus predicted radiance of each image; NaN where the image has no data.
    """

    facets: np.ndarray
    temperature: np.ndarray
    error: np.ndarray
    radiance: np.ndarray
    residuals: list[np.ndarray]
    _slope: np.ndarray
    _normal: SuperLU
    _scatter: sparse.csr_array

    def covariance(self, columns) -> np.ndarray:
        """Covariance of the temperatures of some facets, given by their places in `facets` [K^2].

        It has one row and one column for each of them.
        """
        columns = np.asarray(columns)
        with np.errstate(divide="ignore", invalid="ignore"):
            rows = inverse_columns(self._normal, columns) / self._slope[columns]
        return rows.T @ (self._scatter @ rows)


@dataclass(frozen=True)
class Data:
    """All images as one list of pixels with data.

    matrices: one for each randomisation, (pixels, facets). rest: (R, pixels). measured, variance:
    radiance and variance of the camera's noise, (pixels,).
    """

    matrices: list[sparse.csr_array]
    rest: np.ndarray
    measured: np.ndarray
    variance: np.ndarray

    def predicted(self, radiance) -> np.ndarray:
        """Radiance of each randomisation for some radiances of the facets, (R, pixels)."""
        return np.array([matrix @ radiance for matrix in self.matrices]) + self.rest


@dataclass(frozen=True)
class Half:
    """Randomisations whose products form one half of the normal equations, and their weights."""

    members: Sequence[int]
    weights: np.ndarray


def estimate_facets(
    matrices: Sequence[FacetMatrix],
    images: Sequence[np.ndarray],
    noise,
    prior: tuple | None = None,
) -> FacetEstimate:
    """Estimate the temperatures of facets from images of them.

    Least squares for the blackbody radiances of the facets, to which the image is linear. A matrix
    from traced paths is noisy, and the square of its noise would pull the estimate toward zero. The
    normal equations therefore contain only products of different randomisations, whose noise is
    independent. A pixel's weight is the inverse of the variance of the camera and of the rendering.
    A weight that depends on the noise which it weights would also cause a bias. The randomisations
    are therefore split in halves, and each half is weighted by the variance in the other one.

    Parameters
    ----------
    matrices : sequence of FacetMatrix
        The views, with the same facets, each with another seed. They need LEAST_RANDOMISATIONS
        randomisations; eight make the weights good.
    images : sequence of ndarray, shape (height, width)
        Measured radiances of the views [W m^-2 sr^-1]. A pixel of value NaN is left out.
    noise : float, or sequence of float or ndarray
        Standard deviation of the camera's noise: for all images, or for each image one number or
        one number for each pixel [W m^-2 sr^-1].
    prior : (mean, sigma) or None
        Temperatures known beforehand, with independent standard deviations [K], each (F,) or a
        number.

    Returns
    -------
    FacetEstimate

    Raises
    ------
    InputError
        For images that do not match the matrices, noise or priors that are not positive, too few
        randomisations, more facets than data, and facets without data.
    """
    data = gathered(matrices, images, noise)
    facets, band = matrices[0].facets, matrices[0].band
    precision, pull = prior_terms(prior, band, len(facets))
    check_determined(data, facets, precision)
    radiance = None
    for _ in range(SOLUTIONS):
        halves = weighted(data, radiance)
        matrix, target = normal_equations(data, halves)
        normal = splu((matrix + sparse.diags_array(precision)).tocsc())
        radiance = normal.solve(target + pull)
    scatter = score_covariance(data, halves, radiance) + sparse.diags_array(precision)
    temperature = brightness_temperature(band, radiance)
    slope = radiance_slope(band, np.nan_to_num(temperature, nan=0.0))
    with np.errstate(divide="ignore"):
        error = radiance_errors(normal, scatter) / slope
    return FacetEstimate(
        facets=facets,
        temperature=temperature,
        error=error,
        radiance=radiance,
        residuals=[
            np.asarray(image)
            - (matrix.mean @ radiance + matrix.rest.mean(axis=0)).reshape(image.shape)
            for matrix, image in zip(matrices, images)
        ],
        _slope=slope,
        _normal=normal,
        _scatter=sparse.csr_array(scatter),
    )


# ---------------------------------------------------------------- Input


def gathered(matrices, images, noise) -> Data:
    """The pixels of all images; raises InputError for images that do not match the matrices."""
    if len(images) != len(matrices):
        raise InputError(f"{len(images)} images were given for {len(matrices)} facet matrices")
    noise = [noise] * len(images) if np.ndim(noise) == 0 else noise
    count = len(matrices[0].matrices)
    if count < LEAST_RANDOMISATIONS:
        raise InputError(
            f"the facet matrices have {count} randomisations; at least {LEAST_RANDOMISATIONS} are "
            "needed for an estimate without bias"
        )
    parts, rest, measured, variance = [], [], [], []
    for number, (matrix, image, sigma) in enumerate(zip(matrices, images, noise, strict=True)):
        if len(matrix.matrices) != count or not np.array_equal(matrix.facets, matrices[0].facets):
            raise InputError(
                f"facet matrix {number}: its facets or its number of randomisations differ from "
                "those of matrix 0"
            )
        if np.shape(image) != matrix.size[::-1]:
            raise InputError(
                f"image {number} has the shape {np.shape(image)}; its facet matrix has "
                f"{matrix.size[::-1]}"
            )
        image, sigma = np.ravel(image), np.broadcast_to(np.ravel(sigma), np.size(image))
        counts = np.isfinite(image)
        if not (sigma[counts] > 0).all():
            raise InputError(f"image {number}: the standard deviation of its noise is not positive")
        parts.append([part[counts] for part in matrix.matrices])
        rest.append(matrix.rest[:, counts])
        measured.append(image[counts])
        variance.append(sigma[counts] ** 2)
    return Data(
        [sparse.vstack(views, format="csr") for views in zip(*parts)],
        np.concatenate(rest, axis=1),
        np.concatenate(measured),
        np.concatenate(variance),
    )


def prior_terms(prior, band: Band, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Precision of the facets' radiances beforehand, and precision times mean, (F,) each."""
    if prior is None:
        return np.zeros(count), np.zeros(count)
    mean, sigma = (np.broadcast_to(np.asarray(values, float), count) for values in prior)
    if not ((sigma > 0).all() and (mean > 0).all()):
        raise InputError("the prior's temperatures and standard deviations must be positive")
    precision = 1 / (radiance_slope(band, mean) * sigma) ** 2
    return precision, precision * in_band_radiance(band, mean)


def check_determined(data: Data, facets: np.ndarray, precision: np.ndarray) -> None:
    """Raise InputError for facets that contribute to no pixel and have no prior."""
    seen = sum(abs(matrix).sum(axis=0) for matrix in data.matrices) > 0
    unseen = facets[~seen & (precision == 0)]
    if len(unseen):
        names = ", ".join(map(str, unseen[:5])) + (", ..." if len(unseen) > 5 else "")
        raise InputError(
            f"{len(unseen)} facets reach no pixel ({names}); give them a prior or add views"
        )
    if len(data.measured) < np.count_nonzero(precision == 0):
        raise InputError(
            f"{len(facets)} temperatures are unknown, more than the {len(data.measured)} pixels"
        )


def radiance_slope(band: Band, temperature) -> np.ndarray:
    """Derivative of a blackbody's in-band radiance with respect to its temperature."""
    temperature = np.asarray(temperature, float)
    high, low = (in_band_radiance(band, temperature + step) for step in (STEP, -STEP))
    return (high - low) / (2 * STEP)


# ---------------------------------------------------------------- Estimation


def weighted(data: Data, radiance) -> list[Half]:
    """The halves of the randomisations, each with the weights that the other half gives.

    radiance: radiances of the facets, at which the variance of the rendering is taken; None for
    equal radiances of all facets at the level of the image.
    """
    count = len(data.matrices)
    halves = range(count // 2), range(count // 2, count)
    if radiance is None:
        rows = sum(matrix.sum(axis=1) for matrix in data.matrices) / count
        level = rows @ (data.measured - data.rest.mean(axis=0)) / (rows @ rows)
        radiance = np.full(data.matrices[0].shape[1], level)
    predicted = data.predicted(radiance)
    # The variance of the mean of all randomisations, estimated from one half
    own = [predicted[half].var(axis=0, ddof=1) / count for half in halves]
    expected = [
        (1 - SHARE_OF_MEAN) * variance + SHARE_OF_MEAN * variance.mean() for variance in own
    ]
    return [
        Half(half, 1 / (data.variance + variance))
        for half, variance in zip(halves, reversed(expected))
    ]


def normal_equations(data: Data, halves: list[Half]) -> tuple:
    """Matrix and right side of the normal equations, without products of one randomisation."""
    matrix, target = 0, 0
    for half in halves:
        parts = [data.matrices[r] for r in half.members]
        values = [half.weights * (data.measured - data.rest[r]) for r in half.members]
        total, count = sum(parts), len(parts)
        share = 1 / (len(halves) * count * (count - 1))
        same = sum(part.T @ scaled(part, half.weights) for part in parts)
        matrix = matrix + share * (total.T @ scaled(total, half.weights) - same)
        same = sum(part.T @ value for part, value in zip(parts, values))
        target = target + share * (total.T @ sum(values) - same)
    return matrix, target


def score_covariance(data: Data, halves: list[Half], radiance) -> sparse.csr_array:
    """Covariance of the right side minus the matrix times the true radiances.

    The variance of the rendering in each half comes from that half. Its weights come from the
    other one, so that the two are independent.
    """
    predicted = data.predicted(radiance)
    weights = sum(half.weights for half in halves) / len(halves)
    variance = weights**2 * data.variance
    for half in halves:
        own = predicted[half.members].var(axis=0, ddof=1) / len(half.members)
        variance += (half.weights / len(halves)) ** 2 * own
    mean = sum(data.matrices) / len(data.matrices)
    return mean.T @ scaled(mean, variance)


def scaled(matrix, factors: np.ndarray) -> sparse.csr_array:
    """The matrix with each row multiplied by its factor."""
    return sparse.diags_array(factors) @ matrix


def inverse_columns(normal: SuperLU, columns: np.ndarray) -> np.ndarray:
    """Columns of the inverse of the normal matrix, which is symmetric, (F, columns)."""
    unit = np.zeros((normal.shape[0], len(columns)))
    unit[columns, np.arange(len(columns))] = 1
    ends = range(BATCH, len(columns), BATCH)
    return np.hstack([normal.solve(part) for part in np.hsplit(unit, ends)])


def radiance_errors(normal: SuperLU, scatter) -> np.ndarray:
    """Standard errors of the radiances: the root of the diagonal of inverse, scatter, inverse."""
    variances = []
    for columns in np.split(np.arange(normal.shape[0]), range(BATCH, normal.shape[0], BATCH)):
        rows = inverse_columns(normal, columns)
        variances.append((rows * (scatter @ rows)).sum(axis=0))
    return np.sqrt(np.concatenate(variances))
