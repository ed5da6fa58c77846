"""A scene that changes between launches gives the sums of a scene that was loaded so, bit for bit.

The tracer of a changed scene takes over recordings and tables. What follows from a parameter has to
follow each change of it, also the second one, and a change of something else between.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.api.intensities import signature
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.scene import load
from tests.plugins.small_scenes import camera
from tests.plugins.small_scenes import scene as small_scene

SR = {"type": "sandford_robertson", "epsilon": 0.5, "rho_d": 0.2, "b": 0.3, "e": 0.1}
SEED, POINTS = 3, 64


def sums(scene):
    """The tracer of a scene, and the sums of a launch."""
    launch = Launch(1, 1, SEED, randomisations=8, points=POINTS)
    with scene.prepared() as tracer:
        return tracer, tracer.trace(scene.sensor(0), launch, Channels("target"))


def change(scene, values: dict) -> None:
    """Give a scene other values of parameters, by the end of their names."""
    parameters = mi.traverse(scene.mi)
    for ending, value in values.items():
        (key,) = (name for name, _ in parameters if name.endswith(ending))
        parameters[key] = type(parameters[key])(value)
    parameters.update()


def changed(scene, ending: str, function, is_own=True):
    """The value of a parameter after a change of its numbers, or of a transformation.

    is_own: whether an array is in Dr.Jit's memory, and not in NumPy's.
    """
    value = next(value for name, value in mi.traverse(scene.mi) if name.endswith(ending))
    if "to_world" in ending:
        return function(mi.Transform4f(value))
    numbers = function(value.numpy().astype(float))
    if len(numbers) == 1:
        return dr.opaque(mi.Float, numbers[0])
    return mi.Float(numbers) * dr.opaque(mi.Float, 1) if is_own else mi.Float(numbers)


def check(scene, build, values: dict):
    """The radiance of a changed scene, after a comparison with a new scene; and its tracer."""
    new = build()
    change(new, values)
    (tracer, found), (_, expected) = sums(scene), sums(new)
    np.testing.assert_array_equal(found.radiance, expected.radiance)
    np.testing.assert_array_equal(found.valid, expected.valid)
    np.testing.assert_equal(found.unmet, expected.unmet)
    np.testing.assert_equal(found.channels, expected.channels)
    one, two = (signature(each, spp=1, seed=SEED) for each in (scene, new))
    assert one.scene == two.scene and one.target == two.target
    return found.radiance, tracer


def scaled(factor):
    return lambda numbers: factor * numbers


def uneven(numbers):
    """Numbers by facet, of which neighbours differ, so that two triangles are no rectangle."""
    return numbers * (1 + 0.01 * (np.arange(len(numbers)) % 3))


def moved(transformation):
    return transformation @ mi.Transform4f().translate([0.02, 0.01, 0.0])


def turned(transformation):
    return transformation @ mi.Transform4f().rotate([0, 1, 0], 5.0)


BUNDLED = {
    "box": ("open_box", {}),
    "cavity": ("cavity", {}),
    "airliner": ("a340_landing", {"band": "LWIR"}),
    "cylinder": ("cylinder_ir_range", {"emitter_sampling": "true"}),
}
LESS = scaled(0.9), scaled(0.8)


@pytest.mark.parametrize(
    "name, ending, functions",
    [
        ("box", "floor.emitter.temperature", LESS),
        ("box", "floor.bsdf.emissivity", LESS),
        ("box", "floor.vertex_positions", LESS),
        ("box", "sensor.to_world", (moved, turned)),
        ("cavity", "emitter.temperature", LESS),
        ("cavity", "reflectance.value", LESS),
        ("airliner", "skin.epsilon", LESS),
        ("airliner", "skin.e", LESS),
        ("airliner", "skin.rho_d", LESS),
        ("airliner", "a340.skin.face_temperature", LESS),
        ("airliner", "a340.skin.vertex_positions", LESS),
        ("cylinder", "bare_aluminum.face_temperature", (scaled(0.9), uneven)),
        ("cylinder", "bare_aluminum.face_temperature", (uneven, scaled(0.9))),
    ],
)
def test_a_parameter_that_changes_twice(name, ending, functions):
    (bundled, given), results, recordings = BUNDLED[name], [], []
    build = lambda: load(bundled, resolution=16, **given)
    first, scene = build(), build()
    sums(scene), signature(scene, spp=1, seed=SEED)
    for function in functions:
        values = {ending: changed(first, ending, function)}
        change(scene, values)
        radiance, tracer = check(scene, build, values)
        results.append(radiance)
        recordings.append(tracer.recorded.frozen)
    assert not np.array_equal(*results)
    is_same_geometry = not ending.endswith("vertex_positions")
    assert uneven in functions or (recordings[0] is recordings[1]) == is_same_geometry


@pytest.mark.parametrize(
    "name, ending",
    [("box", "floor.vertex_positions"), ("cylinder", "bare_aluminum.face_temperature")],
)
def test_arrays_in_memory_of_numpys(name, ending):
    """Dr.Jit does not see whether an array is aligned as that of a recording."""
    bundled, given = BUNDLED[name]
    build = lambda: load(bundled, resolution=16, **given)
    first, scene = build(), build()
    for k in range(10):
        values = {ending: changed(first, ending, scaled(0.9 + 0.01 * k), is_own=k % 3 == 0)}
        change(scene, values)
        with scene.mi.integrator().prepared(scene.mi) as new:
            new.recorded.reason = "the test traces anew"
            launch = Launch(1, 1, SEED, randomisations=8, points=POINTS)
            expected = new.trace(scene.sensor(0), launch, Channels("target")).radiance
        np.testing.assert_array_equal(sums(scene)[1].radiance, expected)


def mesh(path, height, temperatures=None):
    """A square plate of four triangles, two rectangles, as a PLY file."""
    plate = mi.Mesh("plate", 6, 4)
    buffers = mi.traverse(plate)
    x, y = np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 1.0])
    buffers["vertex_positions"] = np.stack([x, y, 0 * x + height], axis=-1).ravel()
    buffers["faces"] = [0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4]
    buffers.update()
    if temperatures:
        plate.add_attribute("face_temperature", 1, temperatures)
    plate.write_ply(str(path))
    return {"type": "ply", "filename": str(path), "face_normals": True}


SKY = {"type": "sky", "sky": "250", "ground_temperature": 280.0, "ground_emissivity": 0.9}
CHANGES = [
    ("sky.temperature", scaled(1.05)),
    ("sky.temperature", scaled(1.1)),
    ("ground_emissivity", scaled(0.9)),
    ("plate.face_temperature", uneven),
    ("plate.face_temperature", scaled(1.1)),
    ("lamp.emitter.radiance", scaled(0.0)),
    ("lamp.emitter.radiance", scaled(2.0)),
    ("plate.vertex_positions", scaled(0.9)),
    ("plate.bsdf.epsilon", scaled(0.8)),
    ("plate.bsdf.epsilon", scaled(0.9)),
    ("lamp.vertex_positions", scaled(0.8)),
    ("sky.temperature", scaled(1.0)),
    ("plate.face_temperature", scaled(1.2)),
    ("camera.to_world", moved),
    ("plate.face_temperature", scaled(1.3)),
]


@pytest.mark.slow
@pytest.mark.parametrize("sampling, is_recorded", [(True, True), (True, False), (False, True)])
def test_many_parameters_that_change_in_turn(tmp_path, sampling, is_recorded):
    """With a sphere beside them, launches are not recorded, and tables are taken over alone. Each
    parameter then changes once.
    """
    changes = CHANGES if is_recorded else dict(reversed(CHANGES)).items()
    rest = {} if is_recorded else {"ball": {"type": "sphere", "center": [3, 0, 0], "bsdf": SR}}
    shapes = {
        "plate": mesh(tmp_path / "plate.ply", 0.0, [300.0] * 4)
        | {
            "bsdf": {**SR, "id": "coat"},
            "emitter": {
                "type": "thermal",
                "band": "LWIR",
                "temperature": {"type": "mesh_attribute", "name": "face_temperature"},
            },
        },
        "lamp": mesh(tmp_path / "lamp.ply", -2.0)
        | {
            "to_world": mi.ScalarTransform4f().translate([2, 0, 0]).rotate([1, 0, 0], 180),
            "bsdf": {"type": "grey", "emissivity": 0.9},
            "emitter": {"type": "thermal", "radiance": 40.0, "group": "lamp"},
        },
        "sky": {**SKY, "band": "LWIR"},
        **rest,
    }
    integrator = {"type": "bounce_path", "max_bounces": 3, "emitter_sampling": sampling}
    sensor = {**camera(8, 5.0), "id": "camera"}
    build = lambda: load(small_scene(integrator, sensor, **shapes))
    first, scene, values, results = build(), build(), {}, []
    for ending, function in changes:
        value = changed(first, ending, function)
        change(scene, {ending: value})
        values[ending] = value
        results.append(check(scene, build, values)[0].tobytes())
    assert len(set(results)) == len(changes)


def test_a_shape_that_is_no_mesh_and_a_lobe():
    plate = {"type": "rectangle", "bsdf": {**SR, "id": "coat"}}
    plate["emitter"] = {"type": "thermal", "band": "LWIR", "temperature": 300.0}
    integrator = {"type": "bounce_path", "max_bounces": 2, "emitter_sampling": True}
    build = lambda: load(small_scene(integrator, camera(8, 3.0), plate=plate))
    scene, results = build(), []
    for function in (moved, turned):
        values = {"plate.to_world": changed(build(), "plate.to_world", function)}
        change(scene, values)
        results.append(check(scene, build, values)[0])
    assert not np.array_equal(*results)
    scene.set_lobe("mirror")
    new = build()
    change(new, values)
    new.set_lobe("mirror")
    np.testing.assert_array_equal(sums(scene)[1].radiance, sums(new)[1].radiance)
