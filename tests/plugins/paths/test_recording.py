"""Recorded passes give the numbers of passes that are traced anew, whatever has changed between."""

import gc
import weakref

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.paths.channels import Channels
from mi_lcair.plugins.paths.recording import OFF, Recorded
from mi_lcair.rendering.scene import load

PATHS, BLOCK = 2**10, 128


class Random:
    """Random numbers of a path: one PCG stream each."""

    DRJIT_STRUCT = {"stream": mi.PCG32}

    def __init__(self, seed=None, index=None):
        self.stream = mi.PCG32() if seed is None else mi.PCG32(initstate=seed, initseq=index)

    def next_1d(self):
        return self.stream.next_float32()

    def next_2d(self):
        return mi.Point2f(self.stream.next_float32(), self.stream.next_float32())


def sums(tracer, split, block):
    """A pass: sums of radiance and channels over blocks of paths, from rays and a seed."""

    def trace(ray, seed, index):
        channels = Channels.empty(tracer.max_bounces, tracer.closure, tracer.emitters.sources)
        (L, _), _, channels, chance = tracer.walk(
            dr.ADMode.Primal,
            tracer.scene,
            Random(mi.UInt64(seed), mi.UInt64(index)),
            ray,
            None,
            None,
            mi.Bool(True),
            channels,
        )
        values = {"L": L[0], "chance": chance} | channels.samples(
            L[0], tracer.emitters.labels, tracer.emitters.sources, split == "target"
        )
        dr.eval(values)
        return {name: dr.block_sum(value, block) for name, value in values.items()}

    return trace


def both(recorded, scene, seed, split="target", paths=PATHS, sensor=None, by_spectrum=False):
    """Sums of one pass, recorded and traced anew, as NumPy arrays."""
    with scene.prepared(by_spectrum) as tracer:
        recorded.update(tracer.scene, tracer.emitters, tracer.ambient_radiance)
        index = dr.arange(mi.UInt32, paths)
        at = mi.Point2f(index % 32 + 0.5, index // 32 % 32 + 0.5) / 32
        ray, _ = (sensor or scene.sensor(0)).sample_ray(0, 0, at, mi.Point2f(0.5))
        arrays = ray, dr.opaque(mi.UInt32, seed), index
        dr.eval(arrays)
        key = (
            split,
            BLOCK,
            tracer.max_bounces,
            tracer.emitter_sampling,
            tracer.closure,
            len(tracer.emitters.labels),
        )
        trace = sums(tracer, split, BLOCK)
        return [
            {name: value.numpy() for name, value in result.items()}
            for result in (
                recorded(trace, tracer.scene, key, *arrays),
                trace(*arrays),
            )
        ]


def check(recorded, scene, seed=1, **options):
    """The sums of a pass, after a check that both ways give the same."""
    replayed, traced = both(recorded, scene, seed, **options)
    assert recorded.reason is None
    assert replayed.keys() == traced.keys()
    for name, value in traced.items():
        np.testing.assert_array_equal(replayed[name], value, err_msg=name)
    return replayed["L"]


def differ(results):
    return all(
        not np.array_equal(results[i], results[j]) for i in range(len(results)) for j in range(i)
    )


@pytest.fixture
def recorded():
    return Recorded()


@pytest.mark.parametrize("name", ["two_plates", "cavity", "cylinder_ir_range"])
def test_new_seeds_repeat_one_recording(recorded, name):
    scene = load(name)
    assert differ([check(recorded, scene, seed) for seed in (1, 2, 3)])
    assert recorded.count == 1


def test_changed_temperatures_are_used(recorded):
    scene = load("two_plates")
    parameters = mi.traverse(scene.mi)
    name = next(key for key, _ in parameters if key.endswith("emitter.temperature"))
    results = []
    for kelvin in (310.0, 330.0, 350.0, 310.0):
        parameters[name] = kelvin
        parameters.update()
        results.append(check(recorded, scene))
    assert differ(results[:3])
    np.testing.assert_array_equal(results[0], results[3])
    assert recorded.count == 1


def test_changed_facet_temperatures_are_used(recorded):
    scene = load("cylinder_ir_range")
    parameters = mi.traverse(scene.mi)
    name = next(key for key, _ in parameters if key.endswith("face_temperature"))
    first, results = mi.Float(parameters[name]), []
    for factor in (1.0, 1.05, 1.1, 1.0):
        parameters[name] = first * dr.opaque(mi.Float, factor)
        parameters.update()
        results.append(check(recorded, scene))
    assert differ(results[:3])
    np.testing.assert_array_equal(results[0], results[3])
    assert recorded.count == 1


def test_changed_materials_are_used(recorded):
    scene = load("two_plates")
    parameters = mi.traverse(scene.mi)
    key = next(key for key, _ in parameters if key.endswith("rho_d") and parameters[key][0] == 1)
    results = []
    for value in (1.0, 0.9, 0.8, 1.0):
        parameters[key] = value
        parameters.update()
        results.append(check(recorded, scene))
    assert differ(results[:3])
    np.testing.assert_array_equal(results[0], results[3])
    assert recorded.count == 1


def test_changed_lobes_bounces_and_splits_are_recorded_once_each(recorded):
    scene = load("two_plates")
    for _ in range(2):
        for lobe in ("brdf", "mirror", "diffuse"):
            scene.set_lobe(lobe)
            check(recorded, scene)
        scene.set_lobe("brdf")
        for bounces in (0, 3):
            scene.mi.integrator().max_bounces = bounces
            check(recorded, scene)
        scene.mi.integrator().max_bounces = 1
        check(recorded, scene, split="image")
    assert recorded.count == 6


def test_changed_ambient_temperature_is_used(recorded):
    scene = load("cavity", max_bounces=2)
    scene.mi.integrator().closure, results = "ambient", []
    for kelvin in (500.0, 600.0, 700.0):
        scene.mi.integrator().ambient_temperature = kelvin
        results.append(check(recorded, scene))
    assert differ(results)
    assert recorded.count == 1


def test_changed_parameters_of_other_plugins_are_used(recorded):
    scene = load("cavity")
    parameters = mi.traverse(scene.mi)
    key = next(key for key, _ in parameters if "reflectance" in key)
    results = []
    for value in (0.3, 0.5, 0.7):
        parameters[key] = value
        parameters.update()
        results.append(check(recorded, scene))
    assert differ(results)


def test_changed_geometry_is_used(recorded):
    scene = load("two_plates")
    parameters = mi.traverse(scene.mi)
    key = next(key for key, _ in parameters if key.endswith("vertex_positions"))
    positions, results = mi.Float(parameters[key]), []
    for factor in (1.0, 0.9, 0.8):
        parameters[key] = positions * factor
        parameters.update()
        results.append(check(recorded, scene))
    assert differ(results)


def test_another_sensor_and_more_paths_need_no_recording(recorded):
    scene = load("two_plates")
    film = {"type": "hdrfilm", "width": 32, "height": 32, "pixel_format": "luminance"}
    place = mi.ScalarTransform4f().look_at(origin=[0.3, 4, 5], target=[0, 0, 0], up=[0, 0, 1])
    sensor = mi.load_dict({"type": "perspective", "to_world": place, "film": film})
    check(recorded, scene)
    check(recorded, scene, paths=4 * PATHS)
    check(recorded, scene, paths=3 * BLOCK)
    assert recorded.count == 1
    check(recorded, scene, sensor=sensor)  # its rays differ in direction as well
    check(recorded, scene, sensor=sensor, seed=5)
    assert recorded.count == 2


def test_emitter_sampling_and_spectra(recorded):
    scene = load("cylinder_ir_range")
    scene.mi.integrator().emitter_sampling = True
    parameters = mi.traverse(scene.mi)
    name = next(key for key, _ in parameters if key.endswith("face_temperature"))
    for factor in (1.0, 1.03, 1.06):
        parameters[name] = parameters[name] * factor
        parameters.update()
        check(recorded, scene)
        check(recorded, scene, by_spectrum=True)


def test_another_scene_may_come_and_go(recorded):
    scene = load("two_plates")
    first = check(recorded, scene)
    other = load("open_box")
    check(recorded, scene)
    check(Recorded(), other)
    del other
    gc.collect()
    np.testing.assert_array_equal(check(recorded, scene), first)


def test_recordings_keep_no_scene():
    scene, recorded = load("two_plates"), Recorded()
    check(recorded, scene)
    gone = weakref.ref(scene.surfaces()[0])
    recorded.plugins = []
    del scene
    gc.collect()
    assert gone() is None


def test_recording_is_switched_off(recorded, monkeypatch):
    monkeypatch.setenv(OFF, "1")
    replayed, traced = both(recorded, load("two_plates"), 1)
    np.testing.assert_array_equal(replayed["L"], traced["L"])
    assert recorded.count == 0 and OFF in recorded.reason


def test_a_pass_that_cannot_be_recorded_is_traced(recorded):
    scene, outside = load("two_plates"), dr.opaque(mi.Float, 2)
    with scene.prepared() as tracer:
        recorded.update(tracer.scene, tracer.emitters)
        with pytest.warns(UserWarning, match="not recorded"):
            result = recorded(lambda x: x + outside, tracer.scene, (), dr.opaque(mi.Float, 1, 4))
        assert result[0] == 3 and "before recording" in recorded.reason
        assert scene.surfaces()[0].lobe == "brdf"  # the plugins have their attributes again
    assert check(Recorded(), scene).sum() > 0


class Users(mi.BSDF):
    """A user's BSDF that reflects nothing. Its Python number would go into a recording unseen."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.m_components, self.m_flags = [mi.BSDFFlags.DiffuseReflection | 0], 0
        self.number = 0.0


def test_a_users_plugin_in_python_is_not_recorded(recorded):
    mi.register_bsdf("users_number", Users)
    scene = mi.load_dict({"type": "scene", "s": {"type": "sphere", "b": {"type": "users_number"}}})
    recorded.update(scene)
    assert "from elsewhere" in recorded.reason
    calls = []
    for _ in range(2):
        recorded(lambda x: calls.append(x), scene, (), dr.opaque(mi.Float, 1, 4))
    assert len(calls) == 2 and recorded.count == 0
