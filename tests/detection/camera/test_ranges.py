"""A target at other ranges, against closed forms in vacuum and by Bouguer's law."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.detection.camera.electronics import Correction, Pattern, electron_band, electrons
from mi_lcair.detection.camera.exposure import TargetPicture
from mi_lcair.detection.camera.optics import OVERSAMPLING, Optics
from mi_lcair.detection.camera.ranges import (
    RangedTarget,
    Silhouette,
    at_ranges,
    backgrounds,
    table_ranges,
)
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.setting import setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import AtmosphereTable, atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.imager import Imager
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.views import View
from tests.detection.camera.plate_scenario import CAMERA, plate

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
POINT = 1.7  # pixels over which the camera spreads a point
NEAREST = 1500.0  # range from which on the outline is put into the frame, m
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
    picture = TargetPicture(np.zeros((2, 1, 1)), {"target.source.0": np.array([radiance])})
    exposure.picture = picture
    camera = SimpleNamespace(
        band=ELECTRONS,
        imager=IMAGER,
        pattern=Pattern.of(IMAGER, 0),
        kept_contrast=lambda background, contrast: contrast,
    )
    silhouette = SimpleNamespace(nearest_m=NEAREST, seen=lambda _, range_m: seen(range_m))
    return RangedTarget(camera, exposure, silhouette, MWIR, air, NOISE, snr)


def seen(range_m):
    """Outline and light in pixels, alike: the strongest of n + 1.7 pixels has half of an even one.

    The root of the sum of squares is n / sqrt(n + 1.7).
    """
    pixels = AREA / (range_m * 1.5e-4) ** 2
    strongest, count = 0.5 * pixels / (pixels + POINT), 4 * (pixels + POINT)
    image = np.full(int(count) + 1, strongest)
    image[-1] *= np.sqrt(count - int(count))
    return np.array([[image], [image]])


def rows(target, ranges, level):
    """The rows of a target before a background that is the same at all ranges."""
    ranges, levels = np.array(ranges), np.full(len(ranges), level)
    return target.rows(ranges, levels, target.spread(ranges, levels))


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
    found = rows(target(atmosphere("vacuum")), ranges, LEVEL)
    contrast = float(electrons(ELECTRONS, HOT)) - LEVEL
    for row, range_m in zip(found, ranges):
        pixels = AREA / (range_m * 1.5e-4) ** 2
        assert row.range_m == range_m
        assert row.pixels == pytest.approx(pixels, rel=1e-9)
        assert row.electrons == pytest.approx(contrast * pixels, rel=1e-9)
        expected = contrast * pixels / (NOISE * np.sqrt(pixels + POINT))
        assert row.snr == pytest.approx(expected, rel=1e-9)
        peak = contrast * pixels / NOISE * 0.5 / (pixels + POINT)
        assert row.peak_snr == pytest.approx(peak, rel=1e-9)
    # 133, 21 and 0.21 pixels; the last one has 16 standard deviations
    assert [row.detected for row in found] == [True, True, False]
    assert [row.lacks for row in found] == ["", "", "pixels"]
    strict = rows(target(atmosphere("vacuum"), snr=1e9), ranges, LEVEL)
    assert [row.lacks for row in strict] == [*["signal to noise"] * 2, "signal to noise and pixels"]


def test_a_cold_target_has_a_ratio_too():
    level = 3 * float(electrons(ELECTRONS, HOT))
    (row,) = rows(target(atmosphere("vacuum")), [2000.0], level)
    assert row.electrons < 0 < row.snr


def test_through_grey_air():
    """The target's electrons are dimmed, and the path adds its own over the target's area."""
    (row,) = rows(target(grey(0.4)), [3000.0], LEVEL)
    dimmed = np.exp(-1.2) * float(electrons(ELECTRONS, HOT))
    path = (1 - np.exp(-1.2)) * 0.05 * float(electrons(ELECTRONS, 290.0))
    pixels = AREA / 0.45**2
    assert row.electrons == pytest.approx((dimmed + path - LEVEL) * pixels, rel=1e-4)


def test_largest_range_of_a_detection():
    """In vacuum, 2 pixels are covered up to sqrt(12 / 2) / 1.5e-4 = 16.33 km."""
    backdrop = Backdrop("grey", lambda x: np.full(len(x), 1e-3), np.empty(0))
    found, detected_to_m, by_peak_to_m = at_ranges(
        target(atmosphere("vacuum")), backdrop, np.array([1000.0, 10_000.0, 40_000.0])
    )
    assert [row.range_m for row in found] == [1000, 10_000, 40_000]
    assert [row.detected for row in found] == [True, True, False]
    assert 16_329 < detected_to_m < np.sqrt(12 / 2) / 1.5e-4
    assert by_peak_to_m == detected_to_m
    assert at_ranges(target(atmosphere("vacuum"), 1e9), backdrop, np.array([1e3, 4e4]))[1:] == (
        None,
        None,
    )


def test_the_peak_pixel_is_detected_less_far_than_the_target():
    """The peak falls below the ratio where 0.5 C n / (n + 1.7) = noise x snr; 10 % of C here."""
    backdrop = Backdrop("grey", lambda x: np.full(len(x), 1e-3), np.empty(0))
    level = float(ELECTRONS.weights_um.sum()) * 1e-3
    contrast = float(electrons(ELECTRONS, HOT)) - level
    ranged = target(atmosphere("vacuum"), 0.3 * contrast / NOISE)
    ranges = np.array([2000.0, 10_000.0, 16_000.0])
    found, detected_to_m, by_peak_to_m = at_ranges(ranged, backdrop, ranges)
    pixels = 0.6 * POINT / 0.4
    assert by_peak_to_m == pytest.approx(np.sqrt(AREA / pixels) / 1.5e-4, rel=0.01)
    pixels = (0.09 + np.sqrt(0.09**2 + 4 * 0.09 * POINT)) / 2  # n / sqrt(n + 1.7) = 0.3
    assert detected_to_m == pytest.approx(min(np.sqrt(AREA / pixels) / 1.5e-4, 16_000), rel=0.01)
    assert [row.peak_detected for row in found] == [True, True, False]


def test_a_target_that_is_too_near_for_the_frame():
    """Its pixels share the light as from the nearest range, and their number grows as 1 / R^2."""
    spread = target(atmosphere("vacuum")).spread(np.array([300.0, NEAREST]), np.full(2, LEVEL))
    near, far = spread.products
    assert near == pytest.approx(far * 25, rel=1e-12)
    assert spread.strongest[0] == pytest.approx(spread.strongest[1] / 5, rel=1e-12)


def test_spread_between_ranges():
    """Sums of squares fall by 8 decades between ranges that are 100 times apart."""
    ranged, knots = target(atmosphere("vacuum")), np.geomspace(2e3, 2e5, 16)
    at = np.sqrt(knots[1:] * knots[:-1])
    found = ranged.spread(knots, np.full(16, LEVEL)).between(knots, at)
    expected = ranged.spread(at, np.full(15, LEVEL))
    assert found.products == pytest.approx(expected.products, rel=5e-3)
    assert found.strongest == pytest.approx(expected.strongest, rel=0.02)


def test_ranges_of_the_table():
    """1, 2, 5 in each decade from the shortest range on, and the scenario's own range."""
    vacuum, air = atmosphere("vacuum"), grey(0.4)
    assert table_ranges(air, 10.4, 3000.0).tolist() == [
        *(20, 50, 100, 200, 500, 1000, 2000, 3000, 5000, 10_000)
    ]
    assert table_ranges(air, 10.0, 3000.0)[0] == 10
    assert table_ranges(air, 10.0, 7.0)[0] == 7  # nearer than the shortest range
    assert table_ranges(air, 200.0, 20_000.0).tolist()[-2:] == [10_000, 20_000]
    assert table_ranges(vacuum, 200.0, 300.0)[[0, 1, 2, -1]].tolist() == [200, 300, 500, 200_000]
    assert table_ranges(vacuum, 200.0, 200.0)[[0, -1]].tolist() == [200, 200_000]
    assert table_ranges(vacuum, 200.0, 499.6)[-1] == 200_000


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


# Outlines of targets in the frame, against hand calculations
# -----------------------------------------------------------

MIDDLE = 31.7, 24.2


def square(side_m=3.0, cells=60) -> Silhouette:
    """A square in the middle of a grid that is a fifth larger."""
    edges = np.linspace(-0.6, 0.6, cells + 1) * side_m
    inside = np.abs(edges[1:] + edges[:-1]) / 2 < side_m / 2
    meets = (inside[:, None] & inside).astype(float)
    return Silhouette(meets[None], edges, edges, MIDDLE, 1e-4)


def test_samples_hold_the_area_at_its_place():
    """3 m at 3 km are 10 pixels: 26.7 to 36.7 across and 19.2 to 29.2 down."""
    samples = square().samples(square().images[0], 3000.0)
    # The grid is 12 pixels wide, from 25.7 and 18.2 on; its samples begin at 25 and 18
    assert samples.sum() / OVERSAMPLING**2 == pytest.approx(100, rel=1e-12)
    rows, columns = samples.mean(axis=1), samples.mean(axis=0)
    x = 25 + (np.arange(len(columns)) + 0.5) / 3
    y = 18 + (np.arange(len(rows)) + 0.5) / 3
    assert columns @ x / columns.sum() == pytest.approx(MIDDLE[0], rel=1e-12)
    assert rows @ y / rows.sum() == pytest.approx(MIDDLE[1], rel=1e-12)
    filled = (x > 26.7 + 1 / 6) & (x < 36.7 - 1 / 6)
    assert samples[len(rows) // 2, filled] == pytest.approx(1, rel=1e-12)
    # 0.3 of the sample from 26 2/3 to 27 is outside
    assert samples[len(rows) // 2, 5] == pytest.approx(0.9, rel=1e-9)


def test_a_target_of_300_pixels_is_nearest():
    """Without the grid around it, which would take memory where the frame shows a small part."""
    cropped = square().cropped()
    assert cropped.images.shape == (1, 50, 50) and cropped.images.all()
    assert cropped.nearest_m == pytest.approx(3.0 / 300 / 1e-4, rel=1e-9)
    whole, part = (of.samples(of.images[0], 3000.0).sum() for of in (square(), cropped))
    assert part == pytest.approx(whole, rel=1e-12)
    moved = np.pad(square().images, ((0, 0), (7, 0), (0, 3)))[:, :-7, 3:]
    aside = replace(square(), images=moved).cropped()
    assert aside.samples(aside.images[0], 3e3).shape == (33, 33)
    assert aside.down[0] == pytest.approx(-1.5 + 7 * 0.06)


@pytest.mark.parametrize("width, room", [(64, 31.7), (40, 8.3), (25, 24.2)])
def test_nearest_range_at_which_the_frame_holds_the_target(width, room):
    """Half of the square is 1.5 m. Beside a middle outside the frame only the other side counts."""
    imager = replace(IMAGER, width=width, height=60)
    nearest = 1.5 / (min(room, 24.2) * 1e-4)
    assert square().cropped().fits_from(imager) == pytest.approx(nearest, rel=1e-9)


@pytest.mark.parametrize("range_m", [1000.0, 10_000.0, 100_000.0])
def test_shares_of_pixels(range_m):
    """They are those of the image of the same square, summed by hand."""
    imager = Imager(**CAMERA | {"focal_length_mm": 150.0})
    electron = electron_band(band("MWIR"), imager)
    optics = Optics(imager, electron, partial(spectral_radiance, temperature=300.0))
    whole = SimpleNamespace(optics=optics, imager=imager, design=Correction())
    pixels = square().seen(whole, range_m)[0] / (3.0 / range_m / 1e-4) ** 2
    squares, peak = np.linalg.norm(pixels), pixels.max()
    # The image is the integral of MTF x sinc x sinc over the frequencies
    side = 3.0 / range_m / 1e-4
    f = (np.arange(-128, 128) + 0.5) / 128  # cycles per pixel, up to the cut-off of 1.2
    fx, fy = np.meshgrid(f, f)
    spectrum = np.sinc(side * fx) * np.sinc(side * fy) * np.sinc(fx) * np.sinc(fy)
    spectrum *= np.interp(np.hypot(fx, fy), optics.profile[0] * 15e-3, optics.profile[1])
    size = int(side / 2) + 12
    at = np.arange(-size, size) + 0.5
    x = np.exp(2j * np.pi * np.outer(at + np.floor(MIDDLE[0]) - MIDDLE[0], f))
    y = np.exp(2j * np.pi * np.outer(at + np.floor(MIDDLE[1]) - MIDDLE[1], f))
    shares = (y @ spectrum @ x.T).real / 128**2
    assert squares == pytest.approx(np.sqrt(np.sum(shares**2)), rel=0.01)
    assert peak == pytest.approx(shares.max(), rel=0.02)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_outline_is_where_the_frame_shows_it(tmp_path, projection):
    """A plate beside the axis: the middle of its outline, and its part in the frame."""
    scenario = plate(tmp_path, 2.0, 1.0, camera__projection=projection, observer__range_m=1000)
    setting = setting_of(scenario)
    for right, up in ((0.0, 0.0), (0.1, -0.05), (0.25, 0.0)):
        imager = replace(scenario.camera, right_deg=right, up_deg=up)
        view = CameraView.of(setting.target, View(0.0, 0.0), 1000.0, imager)
        silhouette = Silhouette.of(setting.view, view, 1000.0)
        column, row = 32 - np.radians(right) / 1.5e-4, 24 + np.radians(up) / 1.5e-4
        assert silhouette.middle == pytest.approx((column, row), abs=0.01)
        width = 2 / 0.15
        left = max(column - width / 2, 0)
        seen = silhouette.images.sum() * np.diff(silhouette.across)[0] * np.diff(silhouette.down)[0]
        assert seen == pytest.approx(2 * (column + width / 2 - left) / width, rel=3e-3)
