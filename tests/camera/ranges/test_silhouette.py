"""Outlines of targets in the frame, against hand calculations."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mi_lcair.camera.electronics.response import electron_band
from mi_lcair.camera.optics import OVERSAMPLING, Optics
from mi_lcair.camera.ranges.silhouette import Silhouette
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.setting import setting_of
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.views import View
from tests.camera.plate_scenario import CAMERA, plate

MIDDLE = 31.7, 24.2


def square(side_m=3.0, cells=60) -> Silhouette:
    """A square in the middle of a grid that is a fifth larger."""
    edges = np.linspace(-0.6, 0.6, cells + 1) * side_m
    inside = np.abs(edges[1:] + edges[:-1]) / 2 < side_m / 2
    meets = (inside[:, None] & inside).astype(float)
    return Silhouette(meets, edges, edges, MIDDLE, 1e-4)


def test_samples_hold_the_area_at_its_place():
    """3 m at 3 km are 10 pixels: 26.7 to 36.7 across and 19.2 to 29.2 down."""
    samples = square().samples(3000.0)
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
    assert cropped.meets.shape == (50, 50) and cropped.meets.all()
    assert cropped.nearest_m == pytest.approx(3.0 / 300 / 1e-4, rel=1e-9)
    assert cropped.samples(3000.0).sum() == pytest.approx(square().samples(3000.0).sum(), rel=1e-12)
    aside = replace(square(), meets=np.pad(square().meets, ((7, 0), (0, 3)))[:-7, 3:]).cropped()
    assert aside.samples(3e3).shape == (33, 33) and aside.down[0] == pytest.approx(-1.5 + 7 * 0.06)


@pytest.mark.parametrize("range_m", [1000.0, 10_000.0, 100_000.0])
def test_shares_of_pixels(range_m):
    """They are those of the image of the same square, summed by hand."""
    imager = Imager(**CAMERA | {"focal_length_mm": 150.0})
    electron = electron_band(band("MWIR"), imager)
    optics = Optics(imager, electron, partial(spectral_radiance, temperature=300.0))
    squares, peak = square().spread(optics, range_m)
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
        seen = silhouette.meets.sum() * np.diff(silhouette.across)[0] * np.diff(silhouette.down)[0]
        assert seen == pytest.approx(2 * (column + width / 2 - left) / width, rel=3e-3)
