"""Measurements with a known answer, made with the NumPy model."""

import numpy as np

from mi_lcair.fitting.scatterometer.measurements import Measurements
from mi_lcair.physics.reflection import MODELS
from tests.fitting.numpy_model import brdf

MODEL = MODELS["sandford_robertson"]  # of the NumPy model
NAMES = MODEL.names

# Harkiss 2007, Tables 2.2 and 2.3
THESIS_SETS = {
    "bare aluminum MWIR": (0.110, 0.020, 0.050, 0.0042),
    "bare aluminum LWIR": (0.080, 0.020, 0.050, 0.0042),
    "gloss black MWIR": (0.890, 0.001, 0.160, 0.005),
    "gloss black LWIR": (0.880, 0.00075, 0.160, 0.005),
}
ROUGH = (0.30, 0.20, 0.40, 0.25)  # a broad lobe over a strong floor: all four parameters show


def scan(
    parameters, incidence=(20, 40, 60), step=0.5, form="thesis", noise=0.0, seed=0
) -> Measurements:
    """In-plane scans to +-80 degrees at each incidence [degrees]; noise: relative, one standard
    deviation.
    """
    theta_i, theta_r = (
        np.radians(angles.ravel())
        for angles in np.meshgrid(
            np.asarray(incidence, float), np.arange(-80, 80 + step / 2, step), indexing="ij"
        )
    )
    values = brdf(theta_i, theta_r, *parameters, form=form)
    values *= 1 + noise * np.random.default_rng(seed).standard_normal(len(values))
    return Measurements(theta_i, theta_r, values, name="synthetic")


def without(measurements: Measurements, gone) -> Measurements:
    """The measurements without the points of the mask `gone`."""
    return Measurements(
        measurements.theta_i[~gone],
        measurements.theta_r[~gone],
        measurements.brdf[~gone],
        name="synthetic",
    )


def relative_errors(fit, parameters) -> np.ndarray:
    return np.abs(np.array([fit.parameters[name] for name in NAMES]) / parameters - 1)


def disc_average(theta_i, theta_r, parameters, half_angle, cells=501) -> np.ndarray:
    """The BRDF averaged over a source disc, weighted by its cosine, as a sum over small square
    cells.
    """
    edge = half_angle * (2 * (np.arange(cells) + 0.5) / cells - 1)
    x, y = (side.ravel() for side in np.meshgrid(edge, edge))
    x, y = x[np.hypot(x, y) < half_angle], y[np.hypot(x, y) < half_angle]
    averages = []
    for i, r in zip(theta_i, theta_r):
        cosine = np.cos(i + x) * np.cos(y)
        tilted, azimuth = np.arccos(cosine), np.arctan2(np.sin(y), np.sin(i + x) * np.cos(y))
        f = brdf(tilted, r, *parameters, azimuth=azimuth)
        averages.append(np.sum(f * cosine * np.cos(y)) / np.sum(cosine * np.cos(y)))
    return np.array(averages)
