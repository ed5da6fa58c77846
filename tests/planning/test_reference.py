"""The probe under full fidelity: when it traces more paths, or samples emitters."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.planning.probe import FEW_COUNTS, Settings, half_width
from mi_lcair.planning.reference import expected_paths, reference_probe
from mi_lcair.rendering.statistics import student_factor
from tests.planning.probes import SCATTER, Probes, probe

OWN = Settings({"paint": "mirror"}, 4, False)
PATHS = 2**13


def series(chance, noise=1e-4, with_sampling=0.0, mean_with_sampling=1.0):
    """Probes with a source that may add `chance` to all paths together, in units of the mean.

    The mean is 2, or twice `mean_with_sampling`. `noise` is in units of the mean, too.
    """

    def give(settings):
        paths = PATHS * probes.factor
        if settings.emitter_sampling:
            mean = 2 * mean_with_sampling
            return probe(mean, 2 * noise, paths=paths, chance=2 * with_sampling)
        return probe(2.0, 2 * noise, paths=paths, chance=2 * chance)

    probes = Probes(give)
    return probes


def test_full_fidelity():
    """All lobes are BRDFs; at least 32 reflections are followed, few of them counted apart."""
    probes = series(0.0)
    full, reference = reference_probe(probes, OWN, 0.01, None)
    assert full == Settings({"paint": "brdf"}, 32, False) and reference.mean == 2
    assert probes.counts == [{"counted": FEW_COUNTS}]
    probes = series(0.0)
    full, _ = reference_probe(probes, replace(OWN, max_bounces=16), 0.01, None)
    assert full.max_bounces == 32 and probes.counts == [{"counted": None}]
    probes = series(0.0)
    assert reference_probe(probes, replace(OWN, max_bounces=40), 0.01, None)[0].max_bounces == 40
    probes.each_pixel = True
    reference_probe(probes, replace(OWN, max_bounces=16), 0.01, None)
    assert probes.counts[-1] == {"counted": FEW_COUNTS}


def test_a_source_needs_more_paths():
    """A lack of 0.003 is allowed; one of 0.0123 takes 4.1 times the paths, and 20 % more."""
    probes = series(0.0123 * PATHS)
    full, reference = reference_probe(probes, OWN, 0.01, lambda probe: 1e9)
    assert probes.factor == 5 and reference.paths == 5 * PATHS
    assert not full.emitter_sampling and len(probes.asked) == 2
    within = series(0.0029 * PATHS)
    reference_probe(within, OWN, 0.01, None)
    assert within.factor == 1


def test_a_probe_as_long_as_the_render_is_left_out():
    """If the noise is larger than the source, and the paths more than half of the render's."""
    noise = 0.5  # half width of 0.125 of the mean
    for expected, factor in ((2 * 4.1 * PATHS + 100, 5), (2 * 4.1 * PATHS - 100, 1)):
        probes = series(0.0123 * PATHS, noise)
        reference_probe(probes, OWN, 0.01, lambda probe, paths=expected: paths)
        assert probes.factor == factor
    quiet = series(0.0123 * PATHS, 1e-3)
    reference_probe(quiet, OWN, 0.01, lambda probe: 1)
    assert quiet.factor == 5


def test_a_source_that_takes_too_many_paths_is_sampled():
    """2^19 paths suffice for 0.003 x 2^19; a larger source needs emitter sampling."""
    most = 0.003 * 2**19
    probes = series(0.99 * most)
    full, _ = reference_probe(probes, OWN, 0.01, lambda probe: 1e9)
    assert not full.emitter_sampling
    probes = series(1.01 * most)
    full, reference = reference_probe(probes, OWN, 0.01, lambda probe: 1e9)
    assert full.emitter_sampling and reference.chance == 0
    assert [asked.emitter_sampling for asked in probes.asked] == [False, True]


def test_sampling_that_excludes_no_more():
    """It is adopted if it finds radiance that paths missed; 2^20 paths are the most."""
    most = 0.003 * 2**19
    probes = series(1.5 * most, with_sampling=2 * most)
    full, _ = reference_probe(probes, OWN, 0.01, lambda probe: 1e9)
    assert not full.emitter_sampling and probes.factor == int(np.ceil(1.2 * 1.5 * 64))
    probes = series(1.5 * most, with_sampling=1.9 * most, mean_with_sampling=1.5)
    full, _ = reference_probe(probes, OWN, 0.01, lambda probe: 1e9)
    assert full.emitter_sampling
    probes = series(2.1 * most, with_sampling=3 * most)
    with pytest.raises(InputError, match="takes 1.1e.06 paths; allow a larger tolerance"):
        reference_probe(probes, OWN, 0.01, lambda probe: 1e9)


def test_dark_scenes():
    probes = Probes(lambda settings: probe(0.0))
    with pytest.raises(InputError, match="the target is dark; .* radiates in band LWIR"):
        reference_probe(probes, OWN, 0.01, None)
    probes.each_pixel = True
    with pytest.raises(InputError, match="the image is dark"):
        reference_probe(probes, OWN, 0.01, None)


def test_expected_paths_of_an_intensity():
    """paths x ((noise / tolerance)^1.5 + lack / tolerance), from a half width of 0.0125 on."""
    one = probe(2.0, 0.1, chance=0.004 * PATHS)
    noise = student_factor(63) * 0.05 / 8
    assert half_width(one.value[:, 0]) == pytest.approx(2 * noise)
    expected = PATHS * ((noise / 0.001) ** 1.5 + 2)
    assert expected_paths(one, 0.001, False, 256) == pytest.approx(expected)
    few = expected_paths(one, 0.5, False, 256)
    assert few == expected_paths(one, 0.9, False, 256) > 0


def test_expected_paths_of_an_image():
    """spp (standard error / tolerance)^2 for each of 1000 pixels, of which 4 were probed."""
    value = 2 + 0.2 * np.broadcast_to(SCATTER, (64, 4))
    one = probe(value=value, paths=64 * 4 * 8)
    error = 0.1 / 8
    expected = 1000 * 64 * 8 * (error / 0.001) ** 2
    assert expected_paths(one, 0.001, True, 1000) == pytest.approx(expected)
    assert expected_paths(one, 0.5, True, 1000) == expected_paths(one, 0.9, True, 1000)
