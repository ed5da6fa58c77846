"""The width of the Sandford-Robertson lobe, as the pages state it."""

import numpy as np


def width_deg(e: float) -> float:
    """Return the full width at half maximum of the lobe of the parameter `e`, in degrees.

    It is the angle of the reflected directions in the plane of incidence over which the lobe's
    shape h = 1 / (e^2 cos^2 a + sin^2 a)^2 is above half of its maximum. The half-vector's angle a
    to the normal changes half as fast as the reflected direction.
    """
    half = np.arcsin(e * np.sqrt((np.sqrt(2) - 1) / (1 - e**2)))  # angle of the half-vector
    return float(np.degrees(4 * half))
