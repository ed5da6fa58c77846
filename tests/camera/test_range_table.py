"""A target at other ranges, against closed forms in vacuum and by Bouguer's law."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.camera.electronics.response import electron_band, electrons
from mi_lcair.camera.range_table import (
    RangedTarget,
    at_ranges,
    backgrounds,
    fine_ranges,
    table_ranges,
)
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import AtmosphereTable, atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.imager import Imager
from mi_lcair.plugins.emission.source import Source

AREA = 12.0  # m^2
HOT = 400.0
IMAGER = Imager(
    focal_length_mm=100.0,
    f_number=4.0,
    pitch_um=15.0,
    width=64,
    height=48,
    integration_time_ms=0.5,
    well_Me=5.0,
    least_pixels=2.0,
)
MWIR = band("MWIR")
ELECTRONS = electron_band(MWIR, IMAGER)
SPREAD = 1.7  # pixels over which the camera spreads a point
LEVEL = 1e4  # electrons of the background
NOISE = 300.0


def target(air, snr=10.0) -> RangedTarget:
    """A blackbody of 400 K and 12 m^2 before a background."""
    radiance = float(in_band_radiance(MWIR, HOT))
    intensity = radiance * AREA
    exposure = SimpleNamespace(
        sources=SimpleNamespace(
            list=[Source("self", "400 K", radiance, HOT)], wavelengths_um=np.empty(0)
        ),
        intensities={"target": intensity, "target.source.0": intensity, "target.hit": AREA},
        area=AREA,
    )
    camera = SimpleNamespace(
        band=ELECTRONS, imager=IMAGER, optics=SimpleNamespace(noise_equivalent_pixels=SPREAD)
    )
    return RangedTarget(camera, exposure, MWIR, air, NOISE, snr)


def grey(per_km):
    """An atmosphere with one optical depth per km and a path radiance."""
    x = np.linspace(2.9, 5.1, 111)
    ranges = np.array([100.0, 1000.0, 10_000.0])
    transmittance = np.exp(-per_km * ranges[:, None] / 1e3) * np.ones(len(x))
    air_radiance = 0.05 * spectral_radiance(x, 290.0)
    return AtmosphereTable("grey", ranges, x, transmittance, (1 - transmittance) * air_radiance)


def test_in_vacuum():
    """A pixel covers (R x 1.5e-4)^2 m^2 of the target."""
    ranges = np.array([2000.0, 5000.0, 50_000.0])
    rows = target(atmosphere("vacuum")).rows(ranges, np.full(3, LEVEL))
    contrast = float(electrons(ELECTRONS, HOT)) - LEVEL
    for row, range_m in zip(rows, ranges):
        pixels = AREA / (range_m * 1.5e-4) ** 2
        assert row.range_m == range_m
        assert row.pixels == pytest.approx(pixels, rel=1e-9)
        assert row.electrons == pytest.approx(contrast * pixels, rel=1e-9)
        expected = contrast * pixels / (NOISE * np.sqrt(pixels + SPREAD))
        assert row.snr == pytest.approx(expected, rel=1e-9)
    # 133, 21 and 0.21 pixels; the last one has 16 standard deviations
    assert [row.detected for row in rows] == [True, True, False]
    assert [row.lacks for row in rows] == ["", "", "pixels"]
    strict = target(atmosphere("vacuum"), snr=1e9).rows(ranges, np.full(3, LEVEL))
    assert [row.lacks for row in strict] == [*["signal to noise"] * 2, "signal to noise and pixels"]


def test_a_cold_target_has_a_ratio_too():
    level = 3 * float(electrons(ELECTRONS, HOT))
    (row,) = target(atmosphere("vacuum")).rows([2000.0], np.array([level]))
    assert row.electrons < 0 < row.snr


def test_through_grey_air():
    """The target's electrons are dimmed, and the path adds its own over the target's area."""
    (row,) = target(grey(0.4)).rows([3000.0], np.array([LEVEL]))
    dimmed = np.exp(-1.2) * float(electrons(ELECTRONS, HOT))
    path = (1 - np.exp(-1.2)) * 0.05 * float(electrons(ELECTRONS, 290.0))
    pixels = AREA / 0.45**2
    assert row.electrons == pytest.approx((dimmed + path - LEVEL) * pixels, rel=1e-4)


def test_largest_range_of_a_detection():
    """In vacuum, 2 pixels are covered up to sqrt(12 / 2) / 1.5e-4 = 16.33 km."""
    backdrop = Backdrop("grey", lambda x: np.full(len(x), 1e-3), np.empty(0))
    rows, detected_to_m = at_ranges(
        target(atmosphere("vacuum")), backdrop, np.array([1000.0, 10_000.0, 40_000.0])
    )
    assert [row.range_m for row in rows] == [1000, 10_000, 40_000]
    assert [row.detected for row in rows] == [True, True, False]
    assert 16_330 * 40 ** (-1 / 399) < detected_to_m < 16_330
    assert at_ranges(target(atmosphere("vacuum"), 1e9), backdrop, np.array([1e3, 4e4]))[1] is None


def test_ranges_of_the_table():
    """1, 2, 5 in each decade from 4 radii of the target on, and the scenario's own range."""
    vacuum, air = atmosphere("vacuum"), grey(0.4)
    assert table_ranges(air, 2.6, 3000.0).tolist() == [
        *(20, 50, 100, 200, 500, 1000, 2000, 3000, 5000, 10_000)
    ]
    assert table_ranges(air, 2.5, 3000.0)[0] == 10
    assert table_ranges(air, 2.5, 7.0)[0] == 7  # nearer than 4 radii
    assert table_ranges(air, 50.0, 20_000.0).tolist()[-2:] == [10_000, 20_000]
    assert table_ranges(vacuum, 50.0, 300.0)[[0, 1, 2, -1]].tolist() == [200, 300, 500, 200_000]
    assert table_ranges(vacuum, 50.0, 200.0)[[0, -1]].tolist() == [200, 200_000]


def test_ranges_at_which_the_background_is_known():
    def path_at(range_m):
        if range_m > 500:
            raise InputError("beyond the table")
        return atmosphere("vacuum").path(range_m)

    level = 2e-3
    backdrop = Backdrop("ground", lambda x: np.full(len(x), level), np.empty(0), path_at)
    ranges, levels = backgrounds(backdrop, MWIR, [100.0, 500.0, 501.0])
    assert ranges.tolist() == [100, 500]
    assert levels == pytest.approx(2 * level, rel=1e-9)  # over 2 um


def test_fine_ranges():
    """400 ranges in equal ratios, of which none is beyond the last one."""
    fine = fine_ranges(np.array([100.0, 300.0, 1600.0]))
    assert len(fine) == 400 and fine[0] == pytest.approx(100) and fine[-1] < 1600
    assert fine[-1] == pytest.approx(1600, rel=1e-11)
    assert fine[1:] / fine[:-1] == pytest.approx(16 ** (1 / 399), rel=1e-9)
