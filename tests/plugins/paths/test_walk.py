"""What is recorded along paths whose packets part: some pass a surface, others are reflected."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.walk import FAINT, roulette
from mi_lcair.plugins.recorders.channels import Channels
from tests.plugins.small_scenes import GREY, SQUARE, camera, scene

SHEETS = {
    "two": [(1.0, 0.7), (1.5, 0.5)],
    "three": [(1.0, 0.7), (1.5, 0.5), (2.0, 0.9)],
}


@dr.syntax
def counted(place, turns):
    """Ten lines that show a fault of Dr.Jit 1.5: sums by an index that differs between lanes."""
    sums = dr.alloc_local(mi.Float, 8, value=mi.Float(0))
    turn, lane = mi.UInt32(0), dr.arange(mi.UInt32, 4)
    while turn < turns:
        sums.write(sums.read(place) + 1, place)
        place += dr.select(lane > 0, mi.UInt32(1), 0)
        turn += 1
    return np.array([sums.read(mi.UInt32(k)).numpy() for k in range(4)])


def test_an_index_that_begins_as_an_array_is_read_for_each_lane():
    """The index of a path's own array must begin as an array, not as one number for all lanes."""
    begin = dr.zeros(mi.UInt32, 4)
    dr.make_opaque(begin)
    expected = [[4, 1, 1, 1], [0, 1, 1, 1], [0, 1, 1, 1], [0, 1, 1, 1]]
    np.testing.assert_array_equal(counted(begin, dr.opaque(mi.UInt32, 4)), expected)


def half_covered(plate, sheets, closure="none"):
    """A grey floor and wall behind sheets of plume that cover half of the window."""
    integrator = {"type": "bounce_path", "max_bounces": 4, "closure": closure}
    parts = {}
    for k, (z, tau) in enumerate(sheets):
        corners = [[0, -1, z], [1, -1, z], [1, 1, z], [0, 1, z]]
        bsdf = {"type": "plume", "transmittance": tau}
        parts[f"sheet{k}"] = plate(f"sheet{k}", corners, bsdf, 700.0, group=f"plume{k}")
    wall = [[-1, 1.2, 0], [1, 1.2, 0], [1, 1.2, 2], [-1, 1.2, 2]]
    return scene(
        integrator,
        camera(1, 1.0),
        floor=plate("floor", SQUARE, GREY, 300.0, group="floor"),
        wall=plate("wall", wall, {"type": "twosided", "bsdf": GREY}, 500.0, group="wall"),
        **parts,
    )


@pytest.mark.parametrize("closure", ["none", "tail"])
@pytest.mark.parametrize("sheets", SHEETS.values(), ids=SHEETS)
def test_channels_behind_plumes_are_those_of_evaluated_loops(plate, sheets, closure):
    """Every channel; with the fault, a quarter of bounce.0 was lost and the tail was wrong."""
    sums = []
    for symbolic in (True, False):
        made = half_covered(plate, sheets, closure)
        flag = dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, symbolic)
        with flag, made.integrator().prepared(made) as tracer:
            launch = Launch(1, 1, 1, 4, 2**9)
            sums.append(tracer.trace(made.sensors()[0], launch, Channels("target")))
    symbolic, evaluated = sums
    assert symbolic.channels.keys() == evaluated.channels.keys()
    for name, values in evaluated.channels.items():
        scale = abs(values).max() + 1e-6
        np.testing.assert_allclose(symbolic.channels[name], values, atol=2e-5 * scale, err_msg=name)
    parts = [symbolic.channels[f"bounce.{k}"] for k in range(5)] + [symbolic.channels["closure"]]
    np.testing.assert_allclose(sum(parts), symbolic.radiance, rtol=1e-5)
    assert all((part > 0).all() for part in parts[:2])


def after_roulette(before, weight, seed=1):
    """Throughputs after Russian roulette, for hits and directions at random."""
    numbers = np.random.default_rng(seed)
    count = len(weight)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.p = mi.Point3f(*numbers.random((3, count)).astype(np.float32))
    bs = dr.zeros(mi.BSDFSample3f, count)
    bs.wo = mi.Vector3f(*numbers.normal(size=(3, count)).astype(np.float32))
    path = SimpleNamespace(throughput=mi.Spectrum(before))
    scattering = SimpleNamespace(bs=bs, weight=mi.Spectrum(mi.Float(weight)))
    return before * np.array(roulette(path, si, scattering)[0])


@pytest.mark.parametrize("throughput", [0.5, 1e-2, 1e-5])
def test_russian_roulette_keeps_the_mean(throughput):
    """Of 2^18 faint paths the expected share goes on, within four standard deviations."""
    count, before = 2**18, 2e-3
    after = after_roulette(before, np.full(count, throughput * FAINT / before))
    share = np.count_nonzero(after) / count
    assert after[after > 0] == pytest.approx(FAINT, rel=1e-6)
    assert abs(share - throughput) < 4 * np.sqrt(throughput * (1 - throughput) / count)


def test_russian_roulette_leaves_other_paths_as_they_are():
    """Bright paths, ended ones, and those that are not a number, which are reported later."""
    weight = np.repeat([1.0, 1.001 * FAINT, 0.0, np.nan, np.inf], 1000)
    np.testing.assert_allclose(after_roulette(1.0, weight), weight, rtol=1e-6)


def test_russian_roulette_of_aligned_hits():
    """Hits along a line and one direction, as between two mirrors: both outcomes occur."""
    count = 2**12
    si, bs = dr.zeros(mi.SurfaceInteraction3f, count), dr.zeros(mi.BSDFSample3f, count)
    si.p.x, bs.wo = mi.Float(np.linspace(0, 1, count)), mi.Vector3f(0, 0, 1)
    scattering = SimpleNamespace(bs=bs, weight=mi.Spectrum(FAINT / 2))
    after = roulette(SimpleNamespace(throughput=mi.Spectrum(1)), si, scattering)[0].numpy()
    assert abs(np.count_nonzero(after) / count - 0.5) < 4 * 0.5 / np.sqrt(count)


def test_a_thousand_reflections_are_those_that_paths_carry():
    """A deep cavity with at most 1000 reflections is that with 100: roulette has ended all paths.

    Emission beyond the 64th reflection is the last channel.
    """
    few, many = (
        mi_lcair.signature(mi_lcair.load("cavity", max_bounces=most), spp=4) for most in (100, 1000)
    )
    assert many.scene.by_bounce == pytest.approx(few.scene.by_bounce, rel=1e-5)
