"""Synthetic measurements of surfaces with known parameters."""

from functools import partial

import numpy as np
from drjit.llvm.ad import Array3f64, Float64

from mi_lcair import fitting
from mi_lcair.fitting.scatterometer.reading import Measurements
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.numpy_model import brdf

MODEL = MODELS["sandford_robertson"]  # the model that `numpy_model` computes
NAMES = MODEL.names
fit = partial(fitting.fit, model=MODEL.name)

# Harkiss 2007, Tables 2.2 and 2.3
THESIS_SETS = {
    "bare aluminum MWIR": (0.110, 0.020, 0.050, 0.0042),
    "bare aluminum LWIR": (0.080, 0.020, 0.050, 0.0042),
    "gloss black MWIR": (0.890, 0.001, 0.160, 0.005),
    "gloss black LWIR": (0.880, 0.00075, 0.160, 0.005),
}
ROUGH = (0.30, 0.20, 0.40, 0.25)  # a broad lobe and a strong floor determine all parameters


def scan(
    parameters, incidence=(20, 40, 60), step=0.5, form="thesis", noise=0.0, seed=0
) -> Measurements:
    """In-plane scans to +-80 degrees at each angle of incidence [degrees].

    noise: relative standard deviation of the BRDFs.
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


def scan_of(model, parameters, incidence=(20, 40, 60), step=2, noise=0.0, seed=0) -> Measurements:
    """As `scan`, for any reflection model in its first form, computed with the model's own f."""
    theta_i, theta_r = (
        np.radians(angles.ravel())
        for angles in np.meshgrid(
            np.asarray(incidence, float), np.arange(-80, 80 + step / 2, step), indexing="ij"
        )
    )
    surface = model.surface_of(parameters, model.forms[0])
    i = Array3f64(Float64(np.sin(theta_i)), 0, Float64(np.cos(theta_i)))
    r = Array3f64(Float64(-np.sin(theta_r)), 0, Float64(np.cos(theta_r)))
    values = np.array(model.f(surface, i, r))
    values *= 1 + noise * np.random.default_rng(seed).standard_normal(len(values))
    return Measurements(theta_i, theta_r, values, name="synthetic")


def without(measurements: Measurements, gone) -> Measurements:
    """The measurements without the points in the mask `gone`."""
    return Measurements(
        measurements.theta_i[~gone],
        measurements.theta_r[~gone],
        measurements.brdf[~gone],
        name="synthetic",
    )


def relative_errors(fit, parameters) -> np.ndarray:
    return np.abs(np.array(list(fit.parameters.values())) / parameters - 1)


def disc_average(theta_i, theta_r, parameters, half_angle, cells=501) -> np.ndarray:
    """The BRDF averaged over the disc of the source and weighted by the cosine.

    It is a sum over small square cells.
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
