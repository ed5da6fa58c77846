"""Entries [[data]] and [[candidates]] that cannot be used."""

import pytest

from mi_lcair.errors import InputError
from mi_lcair.inversion.data.measurement import Candidate, Measurement, Observation

IMAGE = {"image": "a.npy", "quantity": "radiance", "netd_mK": 50.0}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({}, "image, intensity, contrast, trend and spectrum are missing; give one"),
        (IMAGE | {"trend": "t.csv"}, "has image and trend; give one of"),
        (IMAGE | {"sigma": 0.1}, "states its noise by netd_mK and sigma; give one of netd_mK"),
        ({"intensity": 0.0}, "states its noise by nothing; give sigma"),
        ({"intensity": 1.0, "netd_mK": 50.0}, "states its noise by netd_mK; give sigma"),
        ({"trend": "t.csv", "netd_mK": 50.0}, "states its noise by netd_mK; give sigma"),
        (IMAGE | {"netd_mK": 0.0}, "netd_mK = 0; must be positive"),
        ({"intensity": 1.0, "sigma": -1.0}, "sigma = -1; must be positive"),
        (IMAGE | {"scale": 0.0}, "scale = 0; must not be zero"),
        (IMAGE | {"sensor": -1}, "sensor = -1; "),
        ({"contrast": 1.0, "sigma": 1.0, "sensor": 1}, "a scenario has its observer"),
        ({"intensity": 1.0, "sigma": 1.0, "gain": True}, "gain needs image"),
        (IMAGE | {"offset_prior": (0.0, 1.0)}, "offset_prior needs offset = true"),
        (IMAGE | {"gain": True, "gain_prior": (1.0,)}, r"gain_prior = \[1.0\]; give 2 numbers"),
        (IMAGE | {"quantity": "counts"}, "unknown quantity 'counts'"),
        (IMAGE | {"name": "a, b"}, "name = 'a, b'; must have 1 to 64 characters"),
        (IMAGE | {"state": 65 * "s"}, "must have 1 to 64 characters"),
        (IMAGE | {"parameters": {"T": [1]}}, r"parameters: T = \[1\]; must be a text or a number"),
    ],
)
def test_unusable(entry, message):
    with pytest.raises(InputError, match=message):
        Measurement("cavity", **entry)


def test_usable():
    Measurement("cavity", **IMAGE | {"state": 64 * "s", "gain": True, "gain_prior": (1.0, 0.1)})
    Measurement("cavity", image="a.npy", sigma_image="s.npy")
    Measurement("cavity", trend="t.csv")
    Measurement("cavity", trend="t.csv", sigma=1.0)


def test_noise_of_candidates():
    assert Candidate("cavity", sigma=0.1).noises() == ["sigma"]
    with pytest.raises(InputError, match="netd_mK and sigma are missing; give one of them"):
        Candidate("cavity")
    with pytest.raises(InputError, match="has netd_mK and sigma; give one"):
        Candidate("cavity", sigma=0.1, netd_mK=50.0)


def test_parameters_of_a_scene_are_texts():
    one = Observation("cavity", parameters={"flag": True, "T": 310.5, "name": "x"})
    assert one.scene_parameters() == {"flag": "true", "T": "310.5", "name": "x"}


def test_shared_noise_belongs_to_an_image():
    for key in ("row_noise", "column_noise", "frame_noise"):
        with pytest.raises(InputError, match=f"{key} needs image; for a number raise sigma"):
            Measurement(scene="box.xml", intensity=1.0, sigma=0.1, **{key: 0.5})
        with pytest.raises(InputError, match=f"{key} = -1"):
            Measurement(scene="box.xml", image="a.exr", sigma=0.1, **{key: -1.0})
        entry = Measurement(scene="box.xml", image="a.exr", sigma=0.1, **{key: 0.5})
        assert getattr(entry, key) == 0.5
