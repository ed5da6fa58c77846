"""Sources that are hotter or brighter."""

import numpy as np
import pytest

from mi_lcair.physics.bands import Spectrum, band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.source import Source

LWIR = band("LWIR")


def test_other_sources():
    hot = Source("body", "300 K", 1.0, 300.0).hotter(20.0, LWIR)
    assert (hot.temperature, hot.in_band) == (320, pytest.approx(in_band_radiance(LWIR, 320)))
    sky = Source(
        "sky", "sky", 24.0, spectrum=Spectrum("sky", np.array([8.0, 12.0]), np.array([5.0, 7.0]))
    )
    bright = sky.scaled(1.5)
    assert bright.in_band == 36 and bright.spectrum.radiance.tolist() == [7.5, 10.5]
    assert sky.hotter(20.0, LWIR) is sky
