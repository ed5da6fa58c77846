"""What an instrument gave: in-plane BRDF points, and a directional emissivity or reflectance beside
them.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Measurements:
    """In-plane BRDF points of one surface in one band; arrays are NumPy Float64 of one length.

    theta_i, theta_r [radians]: elevation of source and observer, 0 <= theta_i < pi/2; theta_r is
    positive on the specular side, so that the mirror peak lies at theta_r = theta_i. brdf [1/sr];
    sigma [1/sr]: standard deviation of each, or None. band_um: its bounds, or None if unknown.
    source_half_angle [radians]: of the source seen from the sample, 0 for none. source: the files,
    {"file", "sha256"} each. dropped: how many rows reading left out, by reason. reading: how the
    file was understood (columns, signs, quantity), for the record.
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


@dataclass
class DirectionalData:
    """A measured directional quantity: theta [radians, 0..pi/2], value [0..1], std (its standard
    deviation) or None.

    quantity: "emissivity" (1 - HDR, by observer angle) or "dhr" (by source angle). source: as in
    `Measurements`.
    """

    theta: np.ndarray
    value: np.ndarray
    std: np.ndarray | None = None
    quantity: str = "emissivity"
    source: list[dict[str, str]] = field(default_factory=list)
