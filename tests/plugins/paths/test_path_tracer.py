"""Recorded launches give the sums of launches that are traced anew, whatever changed between."""

import gc
import weakref

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.api.intensities import signature
from mi_lcair.api.sweeps import trend
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.derivatives import nodes
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.plugins.paths.path_tracer import OFF
from mi_lcair.plugins.paths.scene_state import is_recordable
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.views import Target, View, cameras
from mi_lcair.signatures.facets import FacetSums
from tests.matrix import some_of
from tests.plugins.small_scenes import SCENES, camera
from tests.plugins.small_scenes import scene as small_scene

POINTS = 64


def both(scene, seed=1, split="target", points=POINTS, sensor=None, by_spectrum=False, **numbers):
    """The tracer, and the sums of one launch, recorded and traced anew."""
    numbers = {"columns": 1, "rows": 1, "randomisations": 8} | numbers
    launch = Launch(seed=seed, points=points, **numbers)
    trace = lambda tracer: tracer.trace(sensor or scene.sensor(0), launch, Channels(split))
    with scene.prepared(by_spectrum) as tracer:
        recorded = trace(tracer)
    # A tracer that no one has used before
    with scene.mi.integrator().prepared(scene.mi, by_spectrum) as new:
        new.recorded.reason = "the test traces anew"
        anew = trace(new)
    return tracer, recorded, anew


def check(scene, *arguments, **options):
    """The radiance of a launch, after a check that both ways give the same; and the tracer."""
    tracer, recorded, anew = both(scene, *arguments, **options)
    assert tracer.recorded.reason is None and tracer.recorded.count > 0
    np.testing.assert_array_equal(recorded.valid, anew.valid)
    np.testing.assert_array_equal(recorded.radiance, anew.radiance)
    np.testing.assert_equal(recorded.unmet, anew.unmet)
    assert recorded.channels.keys() == anew.channels.keys()
    for name, values in anew.channels.items():
        np.testing.assert_array_equal(recorded.channels[name], values, err_msg=name)
    return recorded.radiance, tracer


def differ(results):
    return all(
        not np.array_equal(results[i], results[j]) for i in range(len(results)) for j in range(i)
    )


def parameter(scene, ending):
    """All parameters of a scene, and the name of the first one with this ending."""
    parameters = mi.traverse(scene.mi)
    return parameters, next(name for name, _ in parameters if name.endswith(ending))


@pytest.mark.parametrize("name", SCENES)
def test_new_seeds_and_sizes_repeat_one_recording(name):
    scene = load(name, **SCENES[name])
    found = [check(scene, seed) for seed in (1, 2, 3)]
    assert differ([radiance for radiance, _ in found])
    # `freeze` records again where two arrays have one length by chance, such as paths and a table
    found += [check(scene, points=points) for points in (264, 1032, 56)]
    found.append(check(scene, randomisations=4, first_point=64))
    tracers = {id(tracer) for _, tracer in found}
    assert len(tracers) == 1 and found[0][1].recorded.count <= 2


@pytest.mark.parametrize("sampler", ["independent", "lattice"])
def test_both_samplers_and_an_aim(sampler):
    scene = load("two_plates")
    film = {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "luminance"}
    place = mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])
    camera = mi.load_dict(
        {"type": "orthographic", "to_world": place, "film": film, "sampler": {"type": sampler}}
    )
    corner = np.zeros((256, 256))
    corner[:100, 50:120] = 1
    aims = [None, Aim.anywhere(), Aim.at(corner, corner > 0)]
    for _ in range(2):
        found = [check(scene, sensor=camera, aim=aim)[0] for aim in aims]
        assert differ(found[1:])  # an aim at all places changes nothing but rounding


@pytest.mark.parametrize(
    "name, ending, values",
    [
        ("two_plates", "emitter.temperature", [310.0, 330.0, 350.0]),
        ("two_plates", "bsdf.emissivity", [0.5, 0.6, 0.7]),
        ("cavity", "reflectance.value", [0.3, 0.5, 0.7]),
        ("furnace", "temperature", [400.0, 500.0, 600.0]),
        ("open_box", "temperature", [310.0, 330.0, 350.0]),
    ],
)
def test_changed_parameters_are_used(name, ending, values):
    scene, results = load(name), []
    parameters, key = parameter(scene, ending)
    for value in (*values, values[0]):
        parameters[key] = value
        parameters.update()
        results += [check(scene)[0], check(scene)[0]]
    assert differ(results[:6:2])
    np.testing.assert_array_equal(results[::2], results[1::2])
    np.testing.assert_array_equal(results[0], results[6])


@pytest.mark.parametrize("name", ["cylinder_ir_range", "a340_landing"])
@pytest.mark.parametrize("in_place", [False, True])
def test_changed_facet_temperatures_are_used(name, in_place):
    scene, results = load(name, **SCENES[name]), []
    parameters, key = parameter(scene, "face_temperature")
    for factor in (1.0, 1.05, 1.1):
        if in_place:
            parameters[key] *= factor
        else:
            parameters[key] = parameters[key] * dr.opaque(mi.Float, factor)
        parameters.update()
        results += [check(scene)[0], check(scene)[0]]
    assert differ(results[::2])


def test_changed_geometry_is_used():
    scene, results = load("two_plates"), []
    parameters, key = parameter(scene, "vertex_positions")
    positions = mi.Float(parameters[key])
    for factor in (1.0, 0.9, 0.8):
        parameters[key] = positions * factor
        parameters.update()
        results.append(check(scene)[0])
    assert differ(results)


def test_changed_lobes_bounces_and_splits_are_used():
    scene = load("two_plates")
    integrator = scene.mi.integrator()
    for _ in range(2):
        results = []
        for lobe in ("brdf", "mirror", "diffuse"):
            scene.set_lobe(lobe)
            results.append(check(scene)[0])
        for bounces in (0, 1):
            integrator.max_bounces = bounces
            results.append(check(scene)[0])
        assert differ(results[1:3]) and differ(results[3:])
        integrator.emitter_sampling = False
        assert differ([results[4], check(scene)[0]])
        integrator.emitter_sampling = True
        for split in ("target", "image", "model", None):
            check(scene, split=split)
    check(scene, by_spectrum=True)


def test_changed_ambient_temperature_is_used():
    scene, results = load("cavity", max_bounces=2), []
    scene.mi.integrator().closure = "ambient"
    for kelvin in (500.0, 600.0, 700.0):
        scene.mi.integrator().ambient_temperature = kelvin
        results.append(check(scene)[0])
    assert differ(results)


def test_views_of_a_trend():
    """Other directions need no other recording, and most numbers of views need none."""
    scene = load("two_plates")
    target = Target.of(scene)
    counts = []
    for turn in (0, 10, 20):
        for views in (1, 3, 5):
            sensor = cameras(scene, target, [View(turn + 30 * k, 20) for k in range(views)])
            _, tracer = check(scene, sensor=sensor, columns=views, windows=views)
            counts.append(tracer.recorded.count)
    assert counts[-1] < 9


def test_another_kind_of_sensor_is_traced():
    """Changes of a perspective sensor are used; a recording would not see them."""
    scene, results = load("two_plates"), []
    film = {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "luminance"}
    place = mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])
    camera = mi.load_dict({"type": "perspective", "to_world": place, "fov": 10.0, "film": film})
    parameters = mi.traverse(camera)
    for clip in (10.0, 4.96, 4.9):
        parameters["far_clip"] = clip
        parameters.update()
        tracer, found, _ = both(scene, sensor=camera)
        results.append(found.radiance)
    assert tracer.recorded.count == 0 and differ(results[::2])


def test_several_scenes():
    scenes = [load(name) for name in ("two_plates", "open_box", "furnace")]
    first = [[check(scene)[0] for scene in scenes] for _ in range(2)][1]
    last = scenes.pop()
    del last
    gc.collect()
    for scene, radiance in zip(scenes, first):
        np.testing.assert_array_equal(check(scene)[0], radiance)


def test_recordings_keep_no_scene():
    scene = load("two_plates")
    check(scene)
    gone = weakref.ref(scene.surfaces()[0])
    del scene
    gc.collect()
    assert gone() is None


def test_temperatures_by_vertex_are_traced(tmp_path):
    """A recording of them would end the process."""
    mesh = mi.Mesh("plate", 3, 1)
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"], buffers["faces"] = [-9.0, -9, 0, 9, -9, 0, 0, 9, 0], [0, 1, 2]
    buffers.update()
    mesh.add_attribute("vertex_temperature", 1, [300.0] * 3)
    mesh.write_ply(str(tmp_path / "plate.ply"))
    texture = {"type": "mesh_attribute", "name": "vertex_temperature"}
    plate = {
        "type": "ply",
        "filename": str(tmp_path / "plate.ply"),
        "bsdf": {"type": "grey", "emissivity": 1.0},
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": texture},
    }
    scene = load(small_scene({"type": "bounce_path"}, camera(4, 1.0), plate=plate))
    expected = in_band_radiance(band("LWIR"), 300.0)
    result = signature(scene, spp=4)
    assert result.scene.intensity == pytest.approx(expected * result.window_area, rel=1e-5)
    assert is_recordable(mi.load_dict({**texture, "name": "face_temperature"}))


def test_recording_is_switched_off(monkeypatch):
    monkeypatch.setenv(OFF, "1")
    tracer, recorded, anew = both(load("two_plates"))
    np.testing.assert_array_equal(recorded.radiance, anew.radiance)
    assert tracer.recorded.count == 0 and OFF in tracer.recorded.reason


def test_a_launch_that_cannot_be_recorded_is_traced(monkeypatch):
    scene, outside = load("two_plates"), dr.opaque(mi.Float, 2)
    with scene.prepared() as tracer:
        monkeypatch.setattr(
            type(tracer), "block_sums", lambda self, paths, *_: paths.lane + outside
        )
        paths = Launch(1, 1, 1, 8, 16).paths_from(scene.sensor(0).sampler())
        with pytest.warns(UserWarning, match="not recorded"):
            result = tracer.recorded(tracer, paths)
        assert result[3] == 5 and "before recording" in tracer.recorded.reason
    monkeypatch.undo()
    assert scene.surfaces()[0].lobe == "brdf"  # the plugins have their attributes again
    assert check(load("two_plates"))[0].sum() > 0


def test_garbage_waits_while_a_launch_is_recorded(monkeypatch):
    """Dr.Jit ends the process if an array in memory of NumPy's is freed while it records."""
    scene, enabled = load("two_plates"), []
    with scene.prepared() as tracer:
        original = type(tracer).block_sums

        def block_sums(self, *arguments):
            enabled.append(gc.isenabled())
            return original(self, *arguments)

        monkeypatch.setattr(type(tracer), "block_sums", block_sums)
        tracer.trace(scene.sensor(0), Launch(1, 1, 1, 8, POINTS))
    assert enabled == [False] and gc.isenabled() and tracer.recorded.count == 1


@pytest.mark.parametrize(
    "name, ending", [("two_plates", "emitter.temperature"), ("cavity", "reflectance.value")]
)
def test_parameters_with_gradients_are_traced(name, ending):
    scene = load(name)
    plain, _ = check(scene)
    parameters, key = parameter(scene, ending)
    dr.enable_grad(parameters[key])
    parameters.update()
    tracer, attached, _ = both(scene)
    assert tracer.recorded.count == 0 and "gradients" in tracer.recorded.reason
    np.testing.assert_array_equal(attached.radiance, plain)
    dr.disable_grad(parameters[key])
    parameters.update()
    np.testing.assert_array_equal(check(scene)[0], plain)


def test_facets_are_traced():
    scene = load("two_plates")
    launch = Launch(1, 1, 1, 8, POINTS)
    with scene.prepared() as tracer:
        sums = FacetSums(FacetTable(scene), tracer.max_bounces)
        found = tracer.trace(scene.sensor(0), launch, Channels("target"), sums)
        assert tracer.recorded.count == 0 and sums.samples == launch.paths
        plain = tracer.trace(scene.sensor(0), launch, Channels("target"))
    np.testing.assert_allclose(found.radiance, plain.radiance, rtol=1e-6)


class Users(mi.BSDF):
    """A user's BSDF whose reflectance is a Python number that Mitsuba does not know."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]
        self.number = 0.5

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.eta = mi.warp.square_to_cosine_hemisphere(sample2), 1
        bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(bs.wo)
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        return bs, mi.Spectrum(self.number)

    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(self.number * wo.z * dr.inv_pi)

    def pdf(self, ctx, si, wo, active=True):
        return mi.warp.square_to_cosine_hemisphere_pdf(wo)

    def to_string(self):
        return f"Users[{self.number}]"


class Hidden(Users):
    """A user's BSDF with an array where `freeze` does not look for it."""

    class Holder:
        """No PyTree. It refers to the plugin, so only the garbage collector deletes both."""

        def __init__(self, plugin):
            self.plugin, self.array = plugin, dr.opaque(mi.Float, 0.5)

    def __init__(self, props):
        super().__init__(props)
        self.holder = self.Holder(self)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = super().sample(ctx, si, sample1, sample2, active)
        return bs, weight * self.holder.array


SR = {"type": "sandford_robertson", "epsilon": 0.5, "rho_d": 0.2, "b": 0.3, "e": 0.1}
GLOW = {"type": "thermal", "band": "MWIR", "temperature": 400.0}


@pytest.mark.parametrize(
    "alone",
    some_of(
        [
            SR,
            {"type": "diffuse", "reflectance": 0.3},
            {"type": "roughconductor", "alpha": 0.3},
            {"type": "sphere", "emitter": GLOW, "bsdf": SR},
            {"type": "diffuse", "reflectance": {"type": "checkerboard"}},
            GLOW,
        ],
        3,
    ),
)
def test_an_object_without_a_scene_is_alive(alone):
    """Dr.Jit records calls of its methods too."""
    kept = mi.load_dict(alone)
    for name in ("two_plates", "open_box"):
        check(load(name))
    del kept


def test_a_plugin_that_waits_for_the_garbage_collector():
    mi.register_bsdf("hidden", Hidden)
    gc.collect()
    gc.disable()
    try:
        gone = weakref.ref(mi.load_dict({"type": "hidden"}).holder)
        assert gone()
        check(load("two_plates"))
        assert gone() is None
    finally:
        gc.enable()


def test_beside_a_plugin_that_cannot_be_recorded():
    mi.register_bsdf("hidden", Hidden)
    kept = mi.load_dict({"type": "hidden"})
    with pytest.warns(UserWarning, match="plugin of another scene"):
        tracer, recorded, anew = both(load("two_plates"))
    np.testing.assert_array_equal(recorded.radiance, anew.radiance)
    assert tracer.recorded.count == 0
    del kept, tracer
    gc.collect()
    check(load("two_plates"))


def test_a_users_plugin_in_python_gets_a_new_tracer_each_time():
    mi.register_bsdf("users_number", Users)
    glow = {"type": "thermal", "band": "MWIR", "temperature": 400.0}
    built = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 2},
            "sensor": {"type": "orthographic", "to_world": mi.ScalarTransform4f().scale(1.5)},
            "plate": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, 3]).rotate([0, 1, 0], 150),
                "bsdf": {"type": "users_number", "id": "users"},
            },
            "lamp": {
                "type": "sphere",
                "center": [0, 0, -3],
                "radius": 2.0,
                "emitter": glow | {"emissivity": 0.9},
            },
        },
        optimize=False,
    )
    plugin = next(node for node in nodes(built) if isinstance(node, Users))
    launch, kept, results = Launch(1, 1, 1, 8, POINTS), {}, []
    for number in (0.5, 0.3, 0.1):
        plugin.number = number
        with built.integrator().prepared(built, kept=kept) as tracer:
            results.append(tracer.trace(built.sensors()[0], launch).radiance)
            assert tracer.recorded.count == 0
    assert differ(results)


# ------------------------------------------------ Kernels


LEAST = 4096  # smallest size of a kernel that counts; smaller ones compute tables and rays


def compiled(run) -> int:
    """Number of kernels over paths that are compiled, or found on disk, while a function runs."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        run()
        dr.sync_thread()
        history = dr.kernel_history([dr.KernelType.JIT])
    paths = [entry for entry in history if entry["size"] >= LEAST]
    assert paths
    return sum(not entry["cache_hit"] for entry in paths)


@pytest.mark.parametrize("name", ["two_plates", "cylinder_ir_range"])
def test_signatures_in_a_sweep_compile_nothing(name):
    scene = load(name)
    temperature = "face_temperature" if name == "cylinder_ir_range" else "emitter.temperature"
    parameters, key = parameter(scene, temperature)
    _, of_material = parameter(scene, "bsdf.emissivity" if name == "two_plates" else ".e")

    def step(k):
        parameters[key] = parameters[key] * dr.opaque(mi.Float, 1 + 0.01 * k)
        parameters[of_material] = parameters[of_material] * dr.opaque(mi.Float, 1 - 0.01 * k)
        parameters.update()
        signature(scene, spp=1 + k, seed=k)

    step(0)
    step(1)
    assert [compiled(lambda k=k: step(k)) for k in range(2, 5)] == [0, 0, 0]


def test_views_of_all_batches_compile_nothing():
    scene = load("two_plates")
    sweep = lambda count, first: trend(
        scene, [first + 10.0 * k for k in range(count)], spp=1, seed=count
    )
    sweep(3, 0)
    sweep(4, 0)
    assert [compiled(lambda: sweep(5, 5)), compiled(lambda: sweep(4, 50))] == [0, 0]


def test_steps_of_an_optimisation_compile_nothing():
    gc.collect()  # kernels hold the emitters of all scenes that are alive
    scene = load("two_plates", resolution=32)
    parameters, key = parameter(scene, "bsdf.emissivity")

    def step(k):
        parameters[key] = dr.opaque(mi.Float, 0.5 + 0.01 * k)
        dr.enable_grad(parameters[key])
        parameters.update()
        image = mi.render(scene.mi, parameters, spp=4, seed=k)
        dr.backward(dr.mean(dr.square(image)))
        assert dr.grad(parameters[key])[0] != 0

    step(0)
    step(1)
    assert [compiled(lambda k=k: step(k)) for k in range(2, 5)] == [0, 0, 0]
