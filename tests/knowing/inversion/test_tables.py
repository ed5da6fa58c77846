"""Tables of a problem: entries that cannot be used, and the aspects of a goal."""

import pytest

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings, UnknownEntry


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"prior": (1.0,)}, r"prior = \[1.0\]; give 2 numbers"),
        ({"prior": (1.0, 0.0)}, "sigma is 0; must be positive"),
        ({"prior": (1.0, -1.0)}, "sigma is -1; must be positive"),
        ({"per": ("view",)}, "unknown per 'view'"),
        ({"lower": 2.0, "upper": 2.0}, "lower = 2 is not below upper = 2"),
    ],
)
def test_unusable_unknowns(entry, message):
    with pytest.raises(InputError, match=message):
        UnknownEntry(**entry)


def test_usable_unknowns():
    UnknownEntry(prior=(1.0, 1e-9), per=("band", "state", "data"), lower=1.0, upper=2.0)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ({"starts": 0}, "starts = 0; must lie in 1..100"),
        ({"starts": 101}, "starts = 101; must lie in 1..100"),
        ({"quantity": "radiance"}, "unknown quantity 'radiance'; known: intensity"),
        ({"background_K": 290.0}, "needed with quantity = 'contrast'"),
        ({"quantity": "contrast"}, "background_K is needed"),
        ({"quantity": "contrast", "background_K": 0.0}, "background_K = 0; must be positive"),
        ({"at_most": True}, "value = 0; must be positive with at_most"),
    ],
)
def test_unusable_goals(goal, message):
    with pytest.raises(InputError, match=message):
        Goal(**{"quantity": "intensity", "scene": "cavity"} | goal)


def test_aspects_of_a_goal():
    goal = Goal("intensity", "cavity", starts=100, azimuth_deg=(0, 90), elevation_deg=(-10, 20))
    assert goal.aspects == ((0, -10), (90, -10), (0, 20), (90, 20))


@pytest.mark.parametrize(
    ("key", "least", "most"),
    [
        ("spp", 2, 2**31),
        ("seed", 0, 2**32 - 1),
        ("randomisations", 2, 64),
        ("iterations", 1, 1000),
    ],
)
def test_limits_of_renders(key, least, most):
    for value in (least, most):
        assert getattr(RenderSettings(**{key: value}), key) == value
    for value in (least - 1, most + 1):
        with pytest.raises(InputError, match=f"{key} = {value}; must lie in {least}..{most}"):
            RenderSettings(**{key: value})
