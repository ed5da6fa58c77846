"""Which unknowns affect a datum, and how it follows them."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.knowing.inversion.data.datum import Datum
from mi_lcair.knowing.inversion.data.loader import Loader
from mi_lcair.knowing.inversion.data.readings import Candidate, Observation
from mi_lcair.knowing.inversion.tables import RenderSettings
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.knowing.inversion import corner
from tests.knowing.inversion.blocks import kelvin, unknown
from tests.knowing.inversion.plate import write_scene

UNKNOWNS = [
    kelvin("plate.temperature", data=(0, 1)),
    unknown("paint.reflectance", data=(1,)),
    kelvin("f[2]", name="f", kind="facet", facet=2, data=(1, 2)),
    unknown("gain [b]", kind="gain", data=(1,)),
]


def datum(number=1, parameters=("plate.temperature",), **changes):
    where = SimpleNamespace(parameters=dict.fromkeys(parameters))
    counts = changes.pop("counts", None)
    return Datum(Observation("x", "b"), number, None, where, np.zeros(2), None, counts, **changes)


def test_unknowns_of_a_datum():
    x = np.array([300.0, 0.3, 290.0, 1.1])
    assert datum().numbers(UNKNOWNS) == [0, 1, 2, 3] and datum(2).numbers(UNKNOWNS) == [2]
    assert datum().settings(UNKNOWNS, x) == {"plate.temperature": 300, "paint.reflectance": 0.3}
    assert datum().facet_settings(UNKNOWNS, x) == {2: 290}


def test_what_is_followed_without_a_render():
    """Temperatures, unless a group has several, or a contrast is weighted by the air."""
    follows = [datum().follows(one) for one in UNKNOWNS]
    assert follows == [True, False, True, True]
    several = datum(parameters=("plate.temperature", "plate@300.temperature"))
    assert not several.follows(UNKNOWNS[0])
    assert several.follows(kelvin("plate@300.temperature"))
    assert datum(sight=object()).follows(unknown(kind="radiance"))
    assert not datum(sight=object()).follows(UNKNOWNS[0])
    assert not datum(is_spectral=True).follows(UNKNOWNS[0])


def test_words_and_images():
    assert datum().quantity == "intensity (W/sr)" and datum().label == "b"
    assert datum(sight=object()).quantity == "contrast (W m^-2)"
    assert datum(goal=SimpleNamespace(quantity="contrast")).quantity == "contrast (W/sr)"
    counts = np.array([[True, False], [False, True]])
    image = datum(counts=counts)
    assert image.is_image and image.quantity == "radiance (W m^-2 sr^-1)"
    np.testing.assert_array_equal(image.image(np.array([1.0, 2.0])), [[1, np.nan], [np.nan, 2]])


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    entry = Candidate(write_scene(folder), "plate", {"size": 4}, netd_mK=50.0)
    return Loader().datum(entry, 0, set())


def test_shares_of_groups_follow_a_motion(tmp_path):
    """An image that moves by one pixel has the same shares one pixel further right."""
    entry = Candidate(corner.write_scene(tmp_path), "corner", netd_mK=50.0)
    still = Loader().datum(entry, 0, set())
    shift = unknown("observer.x_px", kind="motion", unit="pixel", lower=-9.0, upper=9.0)
    moved = still.moved([shift], np.array([1.0]))
    for group, share in still.shares.items():
        before, after = share.reshape(16, 16), moved.shares[group].reshape(16, 16)
        np.testing.assert_allclose(after[:, 1:], before[:, :-1], atol=0.05)
        assert not np.allclose(after, before, atol=0.1)
    pattern = moved.nuisances.labels.index("radiance of s0")
    np.testing.assert_allclose(moved.nuisances.patterns[:, pattern], 0.01 * moved.shares["s0"])
    assert still.moved([unknown("paint0.reflectance")], np.array([0.3])) is still


def test_block_and_weights_in_closed_form(plate):
    """L = (1 - R) B(T) + R B(S): dL/dT = (1 - R) B'(T) and dL/dR = B(S) - B(T)."""
    ones = [kelvin("plate.temperature"), unknown("paint.reflectance"), unknown("sky", data=(7,))]
    x, sampling = np.array([320.0, 0.4, 0.5]), RenderSettings(spp=16, randomisations=3)
    block = plate.block(ones, x, sampling)
    LWIR = band("LWIR")
    B = lambda T: float(in_band_radiance(LWIR, T))
    assert block.radiance.shape == (3, 16) and len(block.columns) == 3
    np.testing.assert_allclose(block.radiance, 0.6 * B(320) + 0.4 * B(290), rtol=1e-4)
    expected = [0.6 * (B(320.5) - B(319.5)), B(290) - B(320)]
    for J in block.columns:
        np.testing.assert_allclose(J, np.tile(expected, (16, 1)), rtol=2e-3)
    assert block.unknown.tolist() == [0, 1] and block.reference.tolist() == [320, 0.4]
    assert block.is_temperature.tolist() == [True, False]
    assert block.gain is None and block.half_width == 0
    # This scene has no noise of the render, so that the weights are those of the camera: NETD at
    # 300 K, and shot noise above
    L = 0.6 * B(320) + 0.4 * B(290)
    variance = (0.05 * (B(300.5) - B(299.5))) ** 2 * L / B(300)
    np.testing.assert_allclose(plate.weighing(ones, x, sampling).weight, 1 / variance, rtol=2e-3)
