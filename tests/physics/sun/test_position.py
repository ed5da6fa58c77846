"""Position of the sun by place and time, against published values."""

import sys

import numpy as np
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


@pytest.mark.parametrize("time", ["2026-03-21T07:30:00Z", "2026-06-21T08:30:00Z"])
def test_refraction(time):
    """(n - 1) / tan(elevation), with n - 1 = 77.56e-6 P / T in the infrared, P in hPa, to 1 %."""
    pytest.importorskip("astropy")
    from astropy import coordinates
    from astropy.time import Time

    when, place = Time(time[:-1]), coordinates.EarthLocation.from_geodetic(20, 50)
    airless = coordinates.AltAz(obstime=when, location=place)
    elevation = coordinates.get_sun(when).transform_to(airless).alt.deg
    raised = np.radians(sun_position(50, 20, time).elevation_deg - elevation)
    expected = 77.56e-6 * 1013.25 / 288.15 / np.tan(np.radians(elevation))
    assert raised == pytest.approx(expected, rel=0.01)


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
