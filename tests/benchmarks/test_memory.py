"""The largest memory of a run, of arrays of known sizes."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from benchmarks import memory
from benchmarks.memory import peak_memory


@pytest.mark.parametrize("size", [20, 80])
def test_arrays_of_a_known_size(size):
    """Also those that are freed before the run ends, and those of Dr.Jit."""
    count = size * 10**6 // 8
    assert peak_memory(lambda: np.ones(count).sum()) == pytest.approx(size, rel=0.05)

    def in_drjit():
        values = dr.arange(mi.Float, 2 * count)
        dr.eval(values)

    in_drjit()
    assert peak_memory(in_drjit) == pytest.approx(size, rel=0.1)
    assert peak_memory(lambda: None) < 1


def test_a_system_that_does_not_count(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "PROCESS", tmp_path / "none")
    assert np.isnan(peak_memory(lambda: None))
