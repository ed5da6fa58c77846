"""Position of the sun by place and time, against published values."""

import sys

import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.sun.position import sun_position, utc


def test_against_the_solar_position_algorithm():
    """The example of NREL's algorithm (Reda and Andreas 2004), whose air is thinner."""
    pytest.importorskip("astropy")
    found = sun_position(39.742476, -105.1786, "2003-10-17T12:30:30-07:00")
    assert found.compass_deg == pytest.approx(194.34024, abs=0.005)
    assert found.elevation_deg == pytest.approx(90 - 50.11162, abs=0.005)
    assert found.distance_au == pytest.approx(0.9965422974, abs=1e-5)


def test_far_from_the_tables_of_the_rotation():
    pytest.importorskip("astropy")
    noon = [sun_position(0, 0, f"{year}-03-21T12:00:00Z").elevation_deg for year in (1950, 2090)]
    assert noon == pytest.approx([88, 88], abs=1.5)


@pytest.mark.parametrize(
    "time, message",
    [
        ("noon", "must be a date and time"),
        ("2026-06-21T12:00", "with a time zone"),
        ("1800-01-01T12:00Z", "between the years 1900 and 2100"),
    ],
)
def test_times(time, message):
    with pytest.raises(InputError, match=message):
        utc(time)


def test_without_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "astropy", None)
    with pytest.raises(InputError, match=r"pip install 'mi_lcair\[place\]'"):
        sun_position(0, 0, "2026-06-21T12:00Z")
