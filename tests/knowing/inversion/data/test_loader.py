"""Noise of measurements, and trends in files."""

from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.loader import (
    Loader,
    check_noise,
    check_units,
    from_trend,
    goal_datum,
    noise_model,
)
from mi_lcair.knowing.inversion.data.readings import Candidate, Observation, noise_of_netd
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.knowing.inversion.plate import write_scene

LWIR = band("LWIR")


def test_models_of_the_noise():
    """An image of standard deviations goes before a NETD, and that before a number."""
    radiance, sigma = np.array([20.0, 30.0]), np.array([1.0, 2.0])
    with_netd = Observation("x", netd_mK=50.0)
    assert noise_model(with_netd, LWIR, sigma)(radiance) is sigma
    np.testing.assert_allclose(
        noise_model(with_netd, LWIR, None)(radiance), noise_of_netd(LWIR, radiance, 50.0)
    )
    assert noise_model(Observation("x", sigma=0.3), LWIR, None)(radiance).tolist() == [0.3, 0.3]


def test_noise_below_single_precision():
    """2^-24 of the rms of 3 and 4, which is 3.536."""
    limit = 2.0**-24 * np.sqrt(12.5)
    check_noise(np.array([0.0, 1.001 * limit]), np.array([3.0, 4.0]))
    with pytest.raises(InputError, match="is below the single precision of the renderer, 2.1e-07"):
        check_noise(np.array([0.999 * limit]), np.array([3.0, 4.0]))


def test_trends(tmp_path):
    """Standard deviations of the file, or one for all."""
    write_scene(tmp_path)
    scene = mi_lcair.load(tmp_path / "plate.xml")
    (tmp_path / "t.csv").write_text(
        "azimuth_deg,elevation_deg,intensity_W_sr,standard_error_W_sr\n10,0,5,0.1\n20,30,6,0.2\n"
    )
    entry = SimpleNamespace(trend=str(tmp_path / "t.csv"), sigma=None)
    values, sigma, views, aspects = from_trend(entry, scene)
    assert values.tolist() == [5, 6] and sigma.tolist() == [0.1, 0.2]
    assert aspects == ((10, 0), (20, 30)) and len(views) == 2
    entry.sigma = 0.5
    assert from_trend(entry, scene)[1].tolist() == [0.5, 0.5]
    (tmp_path / "t.csv").write_text((tmp_path / "t.csv").read_text().replace("0.2", "0"))
    entry.sigma = None
    with pytest.raises(InputError, match="line 3: standard_error_W_sr = .*; must be positive"):
        from_trend(entry, scene)


def test_a_candidate_has_no_values(tmp_path):
    write_scene(tmp_path)
    loader = Loader()
    entry = Candidate(str(tmp_path / "plate.xml"), "more", {"size": 4}, netd_mK=50.0)
    datum = loader.datum(entry, 3, set())
    assert np.isnan(datum.measured).all() and datum.counts.shape == (4, 4) and datum.counts.all()
    assert (datum.number, datum.where.band, datum.is_image) == (3, "LWIR", True)
    assert loader.datum(entry, 4, set()).scene is datum.scene


def test_a_wanted_contrast(tmp_path):
    """The wanted values are relative to the background that the plate hides, B(T0) A.

    The plate of 4 m^2 fills the view. The deviations count in a thousandth of its intensity.
    """
    write_scene(tmp_path)
    goal = {"scene": str(tmp_path / "plate.xml"), "elevation_deg": (90.0,)}
    datum = goal_datum(
        Goal("contrast", background_K=290.0, value=3.0, **goal), RenderSettings(spp=16)
    )
    B = lambda T: float(in_band_radiance(LWIR, T))
    assert datum.background == pytest.approx(4 * B(290), rel=0.01)
    np.testing.assert_allclose(datum.measured, 3 + datum.background)
    assert datum.noise(np.zeros(1)) == pytest.approx(
        1e-3 * 4 * (0.7 * B(310) + 0.3 * B(290)), rel=0.01
    )
    least = goal_datum(Goal("intensity", value=3.0, at_most=True, **goal), RenderSettings(spp=16))
    assert least.measured.tolist() == [0.0] and least.background.tolist() == [0.0]


def test_units_of_images():
    """Only images are compared with the prediction."""
    block = SimpleNamespace(radiance=np.full((2, 3), 30.0))
    datum = SimpleNamespace(
        is_image=True,
        camera=None,
        entry=SimpleNamespace(image="a.npy"),
        measured=np.full(3, 1e-3),
        scene=SimpleNamespace(band=LWIR),
    )
    with pytest.raises(InputError, match="check unit, band and scale"):
        check_units([datum], [block])
    datum.camera = "in electrons"
    check_units([datum], [block])
    datum.is_image, datum.camera = False, None
    check_units([datum], [block])
