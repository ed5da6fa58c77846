"""Simpler lobes by invented probes, and the rungs of materials."""

from types import SimpleNamespace

import pytest

from mi_lcair.physics.reflection.interface import Rung
from mi_lcair.planning.lobes import candidates, rungs, simpler_lobes
from tests.planning.probes import FULL, Probes, probe


def surface(material, lobe=None, exact=False):
    rung = lobe and Rung(lobe, exact)
    model = SimpleNamespace(lower_rung=lambda *values, form: rung)
    return SimpleNamespace(material=material, model=model, values=(), form="f")


def scene(*surfaces):
    return SimpleNamespace(surfaces=lambda: list(surfaces))


def test_rungs():
    """Materials of one name share a rung, exact if it is exact for all; unlike ones have none."""
    found = scene(
        surface("black", "mirror"),
        surface("paint", "diffuse", True),
        surface("paint", "diffuse", False),
        surface("", "diffuse", True),
        surface("steel", "mirror"),
        surface("steel", "diffuse"),
        surface("glass", "mirror"),
        surface("glass"),
    )
    assert rungs(found) == {
        "black": Rung("mirror", False),
        "paint": Rung("diffuse", False),
        "": Rung("diffuse", True),
    }
    assert candidates(found, exact=True) == {"": "diffuse"}
    assert candidates(found, exact=False) == {"black": "mirror", "paint": "diffuse"}


def test_lobes_that_suffice():
    """Each is tried on top of those that were taken; errors that probes do not see are added."""
    means = {"black": 1.004, "paint": 1.02, "": 1.006}

    def give(settings):
        return probe(max(means[name] for name, lobe in settings.lobe.items() if lobe != "brdf"))

    probes = Probes(give)
    probes.scene = scene(
        surface("black", "mirror"), surface("paint", "diffuse"), surface("", "diffuse")
    )
    settings, error, last, left_out = simpler_lobes(
        probes, FULL, probe(1.0), 0.001, 0.002, budget=0.009
    )
    assert settings.lobe == {"paint": "brdf", "black": "mirror", "": "diffuse"}
    assert error == pytest.approx(0.006 + 0.002) and last.mean == pytest.approx(1.006)
    assert [asked.lobe for asked in probes.asked[1:]] == [
        {"paint": "diffuse", "black": "mirror"},
        {"paint": "brdf", "black": "mirror", "": "diffuse"},
    ]
    assert left_out == [
        "the BRDF of black, taken as mirror: error so far at most 0.006 of the mean",
        "the BRDF of an unnamed material, taken as diffuse: error so far at most 0.008 of the mean",
    ]
    unchanged = simpler_lobes(probes, FULL, probe(1.0), 0.001, 0.002, budget=0.0059)
    assert unchanged == (FULL, 0.001, None, [])
