"""NaN or infinite samples: many cause an error, few are reported in a remark."""

import drjit as dr
import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.walk import Walk
from tests.detection.disc_scenario import write_disc


@pytest.fixture
def poison(monkeypatch):
    """poison(every): one path in `every` becomes NaN."""

    def to(every):
        walk = Walk.walk

        def poisoned(self, *arguments, **keywords):
            (L, state), *others = walk(self, *arguments, **keywords)
            index = dr.arange(mi.UInt32, dr.width(L))
            return (dr.select(index % every == 0, dr.nan, L), state), *others

        monkeypatch.setattr(Walk, "walk", poisoned)

    return to


def box():
    return mi_lcair.load("open_box", resolution=16, max_bounces=2)


@pytest.mark.parametrize(
    "product",
    [
        lambda scene: mi_lcair.render(scene, spp=16),
        lambda scene: mi_lcair.render(scene, tolerance=0.01),
        lambda scene: mi_lcair.signature(scene, spp=16),
        lambda scene: mi_lcair.trend(scene, [0.0, 90.0], resolution=16, spp=16),
    ],
    ids=["render", "tolerance", "signature", "trend"],
)
@pytest.mark.parametrize("every", [1, 100])
def test_too_many_are_refused(poison, every, product):
    """All of them, and one in a hundred: no black image, no mean of what is left."""
    poison(every)
    with pytest.raises(InputError, match=r"open_box: \d+ of \d+ samples are NaN or infinite"):
        product(box())


def test_few_are_told_of(poison, tmp_path):
    poison(3000)
    assert mi_lcair.signature(box(), spp=64).invalid == 6
    write_disc(tmp_path)
    changes = {"render.resolution": "32", "render.max_bounces": "1"}
    remarks = mi_lcair.contrast(
        mi_lcair.detection.scenario.Scenario.read(tmp_path / "disc.toml", **changes)
    ).remarks
    assert any("samples were NaN or infinite and are ignored" in remark for remark in remarks)
