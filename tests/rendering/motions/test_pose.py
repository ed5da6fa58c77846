"""Motions move what is rendered as the scene's own $-parameters do, and leave no trace."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import mi_lcair
from mi_lcair import InputError
from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.motions.motion import scaled, shifted, turned
from mi_lcair.rendering.motions.pose import set_motions
from mi_lcair.rendering.parameters.values import changed
from tests.derivatives.motions.test_differences import CUBE, convex_hull, scene_of
from tests.derivatives.motions.test_registration import SCENE as IMAGE

ATTITUDE = {"yaw_deg": 30.0, "pitch_deg": 20.0, "roll_deg": 11.0}
SCENE = "cylinder_ir_range"


def model(scene):
    return next(shape for shape in scene.mi.shapes() if shape.emitter().group == "self")


def intensity(scene) -> float:
    return mi_lcair.signature(scene, spp=64).target.intensity


def test_attitude_is_that_of_the_scene_parameters():
    """`model.*` takes the model to the attitude that the $-parameters give, from any other one."""
    loaded = mi_lcair.load(SCENE, resolution=8, **ATTITUDE)
    motions = {f"model.{turn}": value for turn, value in ATTITUDE.items()}
    for before in ({}, {"yaw_deg": -70, "pitch_deg": 130, "roll_deg": 3}):
        scene = mi_lcair.load(SCENE, resolution=8, **before, **motions)
        corners = vertex_positions(model(scene))
        assert corners == pytest.approx(vertex_positions(model(loaded)), abs=2e-7)
        assert mi_lcair.parameters(scene)["model.pitch_deg"].value == 20
        assert intensity(scene) == pytest.approx(intensity(loaded), rel=2e-5)
    walls = scene.mi.shapes()[1], loaded.mi.shapes()[1]
    assert np.array_equal(*map(vertex_positions, walls))


def test_restored_bit_for_bit():
    scene = mi_lcair.load(SCENE, resolution=8, **ATTITUDE)
    state, value = scene.fingerprint, intensity(scene)
    with changed(scene, {"model.yaw_deg": 7, "self.size": 1.3, "self.temperature": 310}):
        assert scene.fingerprint != state
        turned_model = vertex_positions(model(scene))
        with changed(scene, {"self.x_m": 0.2}):
            shift = vertex_positions(model(scene)) - turned_model
        assert intensity(scene) > 1.3 * value
    assert scene.fingerprint == state and intensity(scene) == value
    assert np.linalg.norm(shift, axis=1) == pytest.approx(0.2, abs=1e-6)


def test_shifts_are_along_the_axes_of_the_model():
    shift = {"self.x_m": 0.2, "self.y_m": 0.3, "self.z_m": -0.4}
    scene = mi_lcair.load(SCENE, resolution=8, pitch_deg=0)
    before = vertex_positions(model(scene))
    with changed(scene, shift):
        moves = vertex_positions(model(scene)) - before
    assert moves == pytest.approx(np.tile([0.2, 0.3, -0.4], (len(moves), 1)), abs=1e-6)
    pitched = mi_lcair.load(SCENE, resolution=8, pitch_deg=90)
    before = vertex_positions(model(pitched))
    with changed(pitched, shift):
        moves = vertex_positions(model(pitched)) - before
    assert moves == pytest.approx(np.tile([0.4, 0.3, 0.2], (len(moves), 1)), abs=1e-6)


def test_model_turns_about_the_origin_of_its_file(tmp_path):
    """Also where the scene was moved for the renderer's single precision."""
    convex_hull("cube", CUBE).write_ply(str(tmp_path / "cube.ply"))
    place = '<transform name="to_world"> <translate y="5000" z="300"/> </transform> <boolean'
    sensor = 'origin="9, 5000, 300" target="0, 5000, 300"'
    text = IMAGE.replace("<boolean", place).replace('origin="9.4, 1, 3.4" target="0, 0, 0"', sensor)
    (tmp_path / "cube.xml").write_text(text)
    scene = mi_lcair.load(tmp_path / "cube.xml")
    assert scene.origin == (0, 5000, 300)
    with changed(scene, {"model.yaw_deg": 90}):
        middle = vertex_positions(scene.mi.shapes()[0]).mean(axis=0) + scene.origin
    assert middle == pytest.approx([-5000, 0, 300], abs=1e-2)


def test_the_observer_rests_where_the_file_has_it():
    """At azimuth 180, elevation 0; a shift of a pixel is one of the window's width over 8."""
    scene = mi_lcair.load(SCENE, resolution=8)
    matrix = lambda of: np.array(mi.traverse(of.sensors[0])["to_world"].matrix).reshape(4, 4)
    before, place = matrix(scene), {"azimuth_deg": 150.0, "elevation_deg": 20.0}
    with changed(scene, {f"observer.{name}": value for name, value in place.items()}):
        loaded = mi_lcair.load(SCENE, resolution=8, **place)
        assert matrix(scene) == pytest.approx(matrix(loaded), abs=1e-6)
        assert mi_lcair.parameters(scene)["observer.azimuth_deg"].value == 150
    assert np.array_equal(matrix(scene), before)
    with changed(scene, {"observer.x_px": 1.0}):
        shift = matrix(scene)[:3, 3] - before[:3, 3]
    assert np.linalg.norm(shift) == pytest.approx(1.3 / 8, rel=1e-5)
    # Another sensor than those of the scene has no motions
    other = replace(scene, sensors=[mi.load_dict({"type": "orthographic"})])
    assert not any(name.startswith("observer.") for name in mi_lcair.parameters(other))


def test_groups_move_about_their_middle():
    points = CUBE * [1, 2, 3] + [4, 5, 6]
    scene = scene_of(convex_hull("box", points))
    shape = scene.mi.shapes()[0]
    with changed(scene, {"box.size": 2}):
        sides = np.sort(vertex_positions(shape), axis=0)[[0, -1]]
    assert sides == pytest.approx(np.array([[3, 3, 3], [5, 7, 9]]))
    with changed(scene, {"box.yaw_deg": 90}):
        sides = np.sort(vertex_positions(shape), axis=0)[[0, -1]]
    assert sides == pytest.approx(np.array([[3, 4.5, 4.5], [5, 5.5, 7.5]]))


@settings(max_examples=20, deadline=None)
@given(st.floats(-360, 360), st.floats(-360, 360), st.floats(-360, 360))
def test_turns_are_rotations(yaw, pitch, roll):
    """The order and the signs, compared with SciPy's rotations."""
    points, middle = np.random.default_rng(1).normal(size=(5, 3)), np.array([1.0, -2, 3])
    vertices = points
    for turn, angle in (("roll_deg", roll), ("pitch_deg", pitch), ("yaw_deg", yaw)):
        vertices = turned(vertices, angle, turn, middle)
    expected = Rotation.from_euler("xyz", [roll, -pitch, yaw], degrees=True)
    assert vertices - middle == pytest.approx(expected.apply(points - middle), abs=1e-12)
    assert np.ptp(shifted(points, 2.0, 1) - points, axis=0) == pytest.approx(0, abs=1e-12)
    assert scaled(points, 1.5, middle) - middle == pytest.approx(1.5 * (points - middle))


def test_vertices_changed_by_a_caller():
    """A changed mesh is rendered as it is, and is the new rest of the motions."""
    scene = mi_lcair.load(SCENE, resolution=8)
    before = mi_lcair.signature(scene, tolerance=0.005).target.intensity
    set_motions(scene, {"model.yaw_deg": 5.0})
    parameters = mi.traverse(model(scene))
    parameters["vertex_positions"] = mi.Float(0.5 * vertex_positions(model(scene)).ravel())
    parameters.update()
    small = mi_lcair.signature(scene, tolerance=0.005).target.intensity
    assert small < 0.35 * before
    fresh = mi_lcair.load(SCENE, resolution=8, **{"model.yaw_deg": 5, "self.size": 0.5})
    expected = mi_lcair.signature(fresh, tolerance=0.005).target
    assert small == pytest.approx(expected.intensity, rel=0.01)
    assert mi_lcair.parameters(scene)["self.size"].value == 1


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("self.size", 0, "self.size = 0 is outside its bounds"),
        ("model.yaw_deg", 1e4, "must lie in -360..360 deg"),
        ("model.yaw", 1, "model.yaw_deg"),
        ("model.yaw_deg", "ten", "model.yaw_deg = ten is no number"),
        ("model.yaw_deg", "nan", "is outside its bounds"),
    ],
)
def test_refused(name, value, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.load(SCENE, resolution=8, **{name: value})
