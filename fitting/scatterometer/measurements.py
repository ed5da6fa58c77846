"""Measured data: in-plane BRDF points, and directional emissivities or reflectances."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Measurements:
    """In-plane BRDF points of one surface in one band.

    Attributes
    ----------
    theta_i, theta_r
        Angles of source and observer to the normal [radians], Float64 (p,), with
        0 <= theta_i < pi/2. theta_r is positive on the specular side, so that the mirror direction
        is theta_r = theta_i.
    brdf
        BRDFs [1/sr], (p,).
    sigma
        Standard deviations of the BRDFs [1/sr], (p,), or None.
    sigma_freedom
        Degrees of freedom of the repeated scans from which sigma was computed; infinite if sigma
        was given.
    band_um
        Limits of the band [um], or None if unknown.
    source_half_angle
        Angular radius of the source as seen from the sample [radians]; 0 for a point source.
    source
        Name and checksum of each file, {"file", "sha256"}.
    dropped
        Number of rows that the reader left out, by reason.
    name
        Name of the sample.
    reading
        How the reader understood the file: columns, signs and quantity.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    brdf: np.ndarray
    sigma: np.ndarray | None = None
    band_um: tuple[float, float] | None = None
    source_half_angle: float = 0.0
    source: list[dict[str, str]] = field(default_factory=list)
    dropped: dict[str, int] = field(default_factory=dict)
    name: str = ""
    reading: dict = field(default_factory=dict)
    sigma_freedom: float = np.inf


@dataclass
class DirectionalData:
    """A measured directional emissivity or reflectance.

    Attributes
    ----------
    theta
        Angles to the normal, 0..pi/2 [radians], (a,): of the observer for an emissivity, of the
        source for a DHR.
    value
        Values, 0..1, (a,).
    std
        Standard deviations of the values, (a,), or None.
    quantity
        "emissivity" (1 - HDR) or "dhr".
    source
        Name and checksum of each file, {"file", "sha256"}.
    """

    theta: np.ndarray
    value: np.ndarray
    std: np.ndarray | None = None
    quantity: str = "emissivity"
    source: list[dict[str, str]] = field(default_factory=list)
