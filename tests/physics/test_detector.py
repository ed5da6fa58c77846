"""The detector: its solid angle, its threshold, and the values that it refuses."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.detector import Detector


def test_solid_angle():
    """A hemisphere has 2 pi; a narrow cone has pi (angle / 2)^2 exactly."""
    assert Detector("MWIR").solid_angle is None
    assert Detector("MWIR", field_of_view_deg=180).solid_angle == pytest.approx(
        2 * np.pi, rel=1e-14
    )
    assert Detector("MWIR", field_of_view_deg=60).solid_angle == pytest.approx(
        2 * np.pi * (1 - np.sqrt(3) / 2), rel=1e-12
    )
    assert Detector("MWIR", field_of_view_deg=1e-6).solid_angle == pytest.approx(
        np.pi * np.radians(0.5e-6) ** 2, rel=1e-12
    )


def test_threshold():
    """The thesis's weakest signal, 5.72e-4 W/m^2, requires an nei of 5.72e-5 W/m^2.

    Source: thesis 4.3.5 and Eq 3.14.

    The sign of the signal does not matter. Optics with a transmittance of 0.5 lower the nei.
    """
    detector = Detector("LWIR", nei=5.72e-5)
    assert detector.band.name == "LWIR" and detector.snr == 10
    assert detector.nei_max(5.72e-4) == pytest.approx(5.72e-5) == detector.nei_max(-5.72e-4)
    assert detector.detects(np.array([5.73e-4, 5.71e-4, -5.73e-4])).tolist() == [True, False, True]
    behind = Detector("LWIR", optics_transmittance=0.5, nei=5.72e-5, snr=5)
    assert behind.signal(-4.0) == -2 and behind.nei_max(5.72e-4) == pytest.approx(5.72e-5)
    assert behind.detects(5.73e-4) and not behind.detects(5.71e-4)
    assert Detector("LWIR", nei=1.0, snr=1).detects(-1.0)
    with pytest.raises(InputError, match="nei is missing"):
        Detector("LWIR").detects(1.0)


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("optics_transmittance", 0, "at most 1"),
        ("optics_transmittance", 1.01, "at most 1"),
        ("field_of_view_deg", 181, "at most 180"),
        ("field_of_view_deg", 0, "positive"),
        ("nei", 0, "positive and finite"),
        ("nei", np.inf, "finite"),
        ("snr", -1, "positive"),
        ("snr", np.nan, "positive"),
    ],
)
def test_unusable(name, value, message):
    with pytest.raises(InputError, match=f"sensor: {name} = {value}.*; must be .*{message}"):
        Detector("MWIR", **{name: value})


def test_unusable_band():
    with pytest.raises(InputError, match="unknown band 'MWR'; known: MWIR"):
        Detector("MWR")
