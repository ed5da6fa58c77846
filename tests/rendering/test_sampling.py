"""How a render is sampled: what goes together, and what a sensor or a part of the work gets."""

from types import SimpleNamespace

import pytest

from mi_lcair.errors import InputError
from mi_lcair.rendering.sampling import Sampling

SENSOR = SimpleNamespace(sampler=lambda: SimpleNamespace(sample_count=lambda: 24))


@pytest.mark.parametrize("name", ["spp", "paths", "tolerance", "max_spp"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_only_positive_numbers(name, value):
    with pytest.raises(InputError, match=f"{name} = {value} must be positive"):
        Sampling(**{name: value})


@pytest.mark.parametrize("other", [{"tolerance": 0.1}, {"max_spp": 8}])
def test_a_number_of_samples_or_a_tolerance(other):
    with pytest.raises(InputError, match="spp sets a fixed number of samples"):
        Sampling(spp=4, **other)


def test_limit_of_samples():
    assert Sampling().limit == 65536
    assert Sampling(tolerance=0.1, max_spp=8).limit == 8


def test_the_sensors_own_number_of_samples():
    """It counts where nothing else chooses one."""
    assert Sampling(seed=3).settled(SENSOR) == Sampling(spp=24, seed=3)
    for given in (Sampling(spp=2), Sampling(paths=2), Sampling(tolerance=0.1)):
        assert given.settled(SENSOR) is given


def test_progress_of_the_third_of_four_renders():
    reports = []
    whole = Sampling(spp=4, progress=lambda *work: reports.append(work))
    part = whole.part(2, 4)
    part.progress(5, 10)
    part.progress(10, 10)
    assert reports == [(25, 40), (30, 40)] and part.spp == 4
    assert Sampling(spp=4).part(2, 4) == Sampling(spp=4)
