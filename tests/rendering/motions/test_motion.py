"""Motions of sensors: what they do to the image, and derivatives of images."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair import InputError
from mi_lcair.derivatives.common_numbers import of_pixels
from mi_lcair.detection.scenario import Scenario
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from mi_lcair.knowing.inversion.data.loader import Loader
from mi_lcair.knowing.inversion.unknowns import InverseProblem
from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.motions.motion import middles_of_parts, placed, settings_of
from mi_lcair.rendering.motions.pose import known_motions, moved, value_of
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.window import window_axes
from tests.derivatives.motions.test_differences import CUBE, L, convex_hull, derivative, scene_of
from tests.detection.disc_scenario import write_disc

PLACE = mi.ScalarTransform4f().look_at(origin=[10, 1, 3], target=[0, 0, 0], up=[0, 0, 1])


def seen_by(kind: str):
    film = {"type": "hdrfilm", "width": 24, "height": 16, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "luminance", "component_format": "float32"}
    of_kind = {"fov": 20.0, "to_world": PLACE}
    if kind == "orthographic":
        of_kind = {"to_world": PLACE @ mi.ScalarTransform4f().scale([2, 2, 1])}
    sensor = {"type": kind, "near_clip": 1.0, "film": film, "sampler": {"type": "lattice"}}
    integrator = {"type": "bounce_path", "max_bounces": 0}
    scene = {"type": "scene", "integrator": integrator, "sensor": sensor | of_kind}
    return mi_lcair.load(mi.load_dict(scene | {"cube": convex_hull("cube", CUBE)}, optimize=False))


def image(scene) -> np.ndarray:
    return mi_lcair.render(scene, spp=256).channels["Y"]


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
def test_shift_of_an_image(kind):
    scene = seen_by(kind)
    before = image(scene)
    for name, shift in (("x_px", (0, 2)), ("y_px", (2, 0))):
        with changed(scene, {f"observer.{name}": 2}):
            after = image(scene)
        difference = np.abs(after - np.roll(before, shift, (0, 1))).mean()
        assert difference < 0.02 * np.abs(after - before).mean()
    assert np.array_equal(image(scene), before)


def test_a_shift_within_the_window_changes_no_intensity():
    result = mi_lcair.sensitivities(seen_by("orthographic"), ["observer.x_px"], paths=2**12)
    assert abs(result.derivative[0]) <= 4 * result.error[1] < 0.05 * result.value


def test_direction_is_that_of_the_scene_parameters():
    """The observer of `observer.*` is that of the scene's own parameters."""
    place = {"azimuth_deg": 150, "elevation_deg": 20}
    loaded = mi_lcair.load("cylinder_ir_range", resolution=8, **place)
    motions = {f"observer.{name}": value for name, value in place.items()}
    turned = mi_lcair.load("cylinder_ir_range", resolution=8, **motions)
    matrices = [np.array(mi.traverse(s.sensors[0])["to_world"].matrix) for s in (loaded, turned)]
    assert matrices[0] == pytest.approx(matrices[1], abs=1e-6)


def test_range_and_roll():
    scene = seen_by("perspective")
    known = mi_lcair.parameters(scene)
    assert known["observer.range_m"].value == pytest.approx(np.sqrt(110), rel=1e-6)
    assert known["observer.range_m"].lower == pytest.approx(1e-3 * np.sqrt(110))
    assert [known["observer.elevation_deg"].lower, known["observer.elevation_deg"].upper] == [
        -90,
        90,
    ]
    mean = image(scene).mean()
    with changed(scene, {"observer.range_m": 3 * np.sqrt(110)}):
        assert image(scene).mean() == pytest.approx(mean / 9, rel=0.05)
    rolled = seen_by("orthographic")
    with changed(rolled, {"observer.roll_deg": 90}):
        turned = image(rolled)
    inner = np.s_[:, 4:20]
    assert turned[inner] == pytest.approx(np.rot90(image(rolled)[inner]), abs=20)


def test_observer_turns_as_the_model_does():
    """An observer who goes round the model sees it turn the other way."""
    found = {}
    for name in ("observer.azimuth_deg", "cube.yaw_deg"):
        scene = scene_of(convex_hull("cube", CUBE))
        with changed(scene, {"cube.yaw_deg": 30.0}):
            found[name] = derivative(scene, name)
    a, b = found.values()
    assert a.derivative == pytest.approx(-b.derivative, abs=4 * np.hypot(a.error, b.error))


def test_derivative_of_an_image():
    """The sum over the pixels is the derivative of the intensity; a shift has none."""
    scene = scene_of(convex_hull("cube", CUBE))
    with changed(scene, {"cube.yaw_deg": 30.0, "cube.size": 0.7}):
        names = ["cube.yaw_deg", "observer.x_px", "cube.size"]
        images = mi_lcair.derivative_images(scene, names, spp=256)
        expected = [derivative(scene, name).derivative for name in (names[0], names[2])]
    sums = images.derivative.sum(axis=(1, 2)) * 16 / 64  # area of a pixel [m^2]
    assert sums == pytest.approx([expected[0], 0, expected[1]], rel=1e-3, abs=1e-3)
    assert np.abs(images.derivative[1]).max() > 50


def test_derivative_of_a_perspective_image():
    """Of a distant observer's image: the cube covers pixels as the square of size over range."""
    scene = seen_by("perspective")
    with changed(scene, {"observer.range_m": 60.0, "observer.roll_deg": 20.0}):
        set_field_of_view(scene, 4.0)
        names = ["cube.size", "observer.range_m", "observer.y_px", "cube.yaw_deg"]
        images = mi_lcair.derivative_images(scene, names, spp=256)
        with changed(scene, {"cube.yaw_deg": 0.5}):
            high = image(scene).sum()
        with changed(scene, {"cube.yaw_deg": -0.5}):
            low = image(scene).sum()
    sums, total = images.derivative.sum(axis=(1, 2)), images.radiance.mean(axis=0).sum()
    assert sums[0] == pytest.approx(2 * total, rel=0.05)
    assert sums[1] == pytest.approx(-2 / 60 * total, rel=0.05)
    assert abs(sums[2]) < 0.01 * np.abs(images.derivative[2]).sum()
    assert sums[3] == pytest.approx(high - low, rel=0.2)


def set_field_of_view(scene, degrees: float):
    parameters = mi.traverse(scene.sensors[0])
    parameters["x_fov"] = degrees
    parameters.update()


def test_sun_stands_where_the_scene_parameters_put_it():
    """The sun moves with its light through the air, and goes back exactly."""
    place = {"sun_azimuth_deg": 20, "sun_elevation_deg": 30}
    day = {"light": "day", "band": "MWIR", "resolution": 8, "sky": "midlat_summer_clear"}
    loaded = mi_lcair.load("a340_landing", **day, **place)
    scene = mi_lcair.load("a340_landing", **day)
    state, expected = scene.fingerprint, mi_lcair.parameters(loaded)["sun.irradiance"].value
    values = mi_lcair.parameters(scene)
    usual = values["sun.irradiance"].value
    assert (values["sun.azimuth_deg"].value, values["sun.elevation_deg"].value) == (60, 45)
    with changed(scene, {"sun.azimuth_deg": 20, "sun.elevation_deg": 30}):
        there = mi_lcair.parameters(scene)["sun.irradiance"].value
        assert there == pytest.approx(expected, rel=1e-6) and there < 0.97 * usual
        intensities = [mi_lcair.signature(s, spp=16).target.intensity for s in (scene, loaded)]
        assert intensities[0] == pytest.approx(intensities[1], rel=1e-5)
    assert scene.fingerprint == state
    with pytest.raises(InputError, match="elevation of the sun = -5 degrees"):
        mi_lcair.load("a340_landing", **day, **{"sun.elevation_deg": -5})
    with pytest.raises(InputError), changed(scene, {"sun.elevation_deg": -5}):
        pass
    assert scene.fingerprint == state
    irradiance = []
    for elevation in (89, 91):  # on both sides of the zenith
        with moved(scene, {"sun.elevation_deg": elevation}):
            irradiance.append(mi_lcair.parameters(scene)["sun.irradiance"].value)
    assert irradiance[0] == pytest.approx(irradiance[1], rel=1e-6)


def test_place_of_a_moved_scene():
    """The observer turns about the origin of the file, from which the scene was moved."""
    origin, rest = np.array([100.0, 0, 0]), {"azimuth_deg": 0.0, "elevation_deg": 0.0}
    place = mi.ScalarTransform4f().look_at(origin=[10, 0, 0], target=[0, 0, 0], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    to_world = place @ mi.ScalarTransform4f().scale([2, 2, 3])  # also along the axis
    sensor = mi.load_dict({"type": "orthographic", "to_world": to_world, "film": film})
    names = ("azimuth_deg", "elevation_deg", "roll_deg", "x_px", "y_px", "range_m")
    for name, by, position, axis in (
        ("azimuth_deg", 90, [-100, 110, 0], [0, -1, 0]),
        ("elevation_deg", 90, [-100, 0, 110], [0, 0, -1]),
        ("roll_deg", 90, [10, 0, 0], [-1, 0, 0]),
        ("range_m", 2, [12, 0, 0], [-1, 0, 0]),
    ):
        change = dict.fromkeys(names, 0.0) | {name: by}
        settings = placed(sensor, settings_of(sensor), change, rest, origin)
        matrix = settings["to_world"]
        assert matrix[:3, 3] == pytest.approx(position, abs=1e-4)
        assert matrix[:3, 2] == pytest.approx(3 * np.array(axis), abs=1e-5)
        assert np.linalg.det(matrix[:3, :3]) == pytest.approx(12, rel=1e-5)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("cube.yaw_deg", 0.19),
        ("cube.size", 0.2),
        ("cube.y_m", 0.2),
        ("observer.azimuth_deg", 0.15),
        ("observer.elevation_deg", 0.15),
        ("observer.roll_deg", 0.04),  # that of the film's corners is a quarter of a pixel
        ("observer.x_px", 0.249),
    ],
)
def test_step_of_an_image(name, least):
    """It moves what the pixels show by a quarter of a pixel, at most."""
    scene = seen_by("orthographic")
    sensor, (shape,) = scene.sensors[0], scene.mi.shapes()

    def places():
        corner, axes = window_axes(sensor)
        return (vertex_positions(shape) - corner) @ axes * sensor.film().size()

    before, step = places(), of_pixels(scene, sensor, known_motions(scene)[name])
    with moved(scene, {name: value_of(scene, known_motions(scene)[name]) + step}):
        shift = np.linalg.norm(places() - before, axis=1).max()
    assert least < shift < 0.2501


# Motions that a TOML file declares: what they move, and what is refused
# ----------------------------------------------------------------------


def declared(folder, text: str):
    file = folder / "motions.toml"
    file.write_text(f"[motions]\n{text}\n")
    return file


def test_middles_of_parts():
    """Two triangles with a common vertex at different indices, and one apart."""
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 0, 0], [4, 0, 6], [2, 2, 0]])
    vertices = np.concatenate([vertices, vertices[:3] + 10]).astype(float)
    middles = middles_of_parts(vertices, np.arange(9).reshape(3, 3))
    assert np.array_equal(middles[:6], np.tile([2.0, 1, 3], (6, 1)))
    assert np.array_equal(middles[6:], np.tile([11.0, 11, 10], (3, 1)))


def test_radius_of_each_exhaust(tmp_path):
    """Each exhaust grows about its own axis, also where the aircraft is pitched."""
    text = '"exhaust.radius" = {groups = ["hot_parts"], scale = [0, 1, 1], each = true}'
    file = declared(tmp_path, text)

    def corners(pitch: float, radius: float):
        scene = mi_lcair.load(
            "a340_landing",
            motions=file,
            pitch_deg=pitch,
            **{"exhaust.radius": radius, "model.pitch_deg": 0},
        )
        return vertex_positions(
            next(s for s in scene.mi.shapes() if s.emitter().group == "hot_parts")
        )

    base, wide = corners(0, 0), corners(0, 0.2)
    assert corners(10, 0.2) == pytest.approx(wide, abs=2e-5)
    left = base[:, 1] > 0
    inner = np.abs(base[:, 1]) < np.abs(base[:, 1]).mean()
    for part in (left & inner, ~left & inner):
        sides, wider = (np.ptp(points[part], axis=0) for points in (base, wide))
        assert wider[1:] == pytest.approx(1.2 * sides[1:], rel=1e-4)
        assert wider[0] == pytest.approx(sides[0], rel=1e-5)


def test_displaced(tmp_path):
    scene = mi_lcair.load("cylinder_ir_range", resolution=8, pitch_deg=0)
    shape = scene.mi.shapes()[0]
    goal = vertex_positions(shape) * [1, 2, 1] + [0, 0, 0.5]
    buffers = mi.traverse(shape)
    buffers["vertex_positions"] = mi.Float(goal.ravel().astype(np.float32))
    buffers.update()
    shape.write_ply(str(tmp_path / "goal.ply"))
    file = declared(tmp_path, '"a.b" = {groups = ["self"], displaced = "goal.ply"}')
    for pitch in (0, 45):
        moved = mi_lcair.load(
            "cylinder_ir_range",
            motions=file,
            resolution=8,
            pitch_deg=pitch,
            **{"a.b": 1, "model.pitch_deg": 0},
        )
        assert vertex_positions(moved.mi.shapes()[0]) == pytest.approx(goal, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"radius" = {groups = ["self"], scale = [1, 1, 1]}', "OWNER.NAME"),
        (
            '"a.b" = {groups = ["self"]}',
            "scale, displaced and control_points are missing; give one of them",
        ),
        ('"a.b" = {groups = ["self"], scale = [1, 1]}', "give 3 numbers"),
        ('"a.b" = {groups = ["selv"], scale = [1, 1, 1]}', "unknown group of meshes"),
        ('"a.b" = {groups = ["self"], scale = [0, 0, 0]}', "moves no vertex"),
        ('"self.size" = {groups = ["self"], scale = [1, 1, 1]}', "is a motion of a group"),
        ('"a.b" = {groups = ["self"], displaced = "FURNACE"}', "triangles"),
        ('"a.b" = {groups = ["self"], displaced = "no.ply"}', "no.ply"),
        ('"a.b" = {groups = [], scale = [1, 1, 1]}', "name at least one group"),
        ('"a.b" = {groups = ["self"], control_points = 9, each = true}', "cannot be combined"),
        ("a = 1\n[other]", "one table"),
    ],
)
def test_refused(tmp_path, text, message):
    text = text.replace("FURNACE", str(Path("scenes/meshes/furnace_slab.ply").absolute()))
    with pytest.raises(InputError, match=message):
        mi_lcair.load("cylinder_ir_range", motions=declared(tmp_path, text), resolution=8)


TABLE = """
[motions]
"disc.wide" = {groups = ["self"], scale = [0, 1, 0]}
"""


def test_table_of_a_scenario(tmp_path):
    """The contrast grows with the area that the scenario's own motion changes."""
    file = write_disc(tmp_path)
    file.write_text(file.read_text() + TABLE)
    render = {"render.resolution": 8, "render.spp": 16}
    values = []
    for value in (0, 0.5):
        scenario = Scenario.read(file, **render, **{"target.parameters.disc.wide": value})
        values.append(mi_lcair.contrast(scenario).rows[-1].total.value)
    assert values[1] == pytest.approx(1.5 * values[0], rel=1e-3)


def test_table_of_uncertainties():
    """The motion is declared in the scene's present pose, and the table [sigma] takes it."""
    scene = scene_of(convex_hull("cube", CUBE))
    stated = {"sigma": {"cube.long": 0.1}, "motions": motion_of("cube", [0, 0, 1])}
    with changed(scene, {"cube.yaw_deg": 30.0}):
        budget = mi_lcair.budget(scene, stated, spp=16)
        assert mi_lcair.parameters(scene)["cube.yaw_deg"].value == 30
    sides = L * np.cos(np.radians(20)) * (np.cos(np.radians(30)) + 0.5)
    assert budget.sigma_of_quantities == pytest.approx(0.1 * sides, rel=0.01)


def test_table_of_a_problem(tmp_path):
    """Scenes, and the targets of contrasts and of a camera's images, have the motion."""
    write_disc(tmp_path)
    plain = {"scene": "cylinder_ir_range", "parameters": {"resolution": 8}, "intensity": 1.0}
    contrast = {"scene": str(tmp_path / "disc.toml"), "contrast": 1e-6}
    problem = InverseProblem.of(
        {
            "motions": motion_of("self", [1, 1, 1]),
            "data": [plain | {"sigma": 1.0}, contrast | {"sigma": 1e-8}],
            "unknowns": {"self.long": {}},
        }
    )
    loader = Loader(problem.motions)
    for number, entry in enumerate(problem.data):
        assert "self.long" in loader.datum(entry, number, set()).where.parameters


def motion_of(group: str, scale: list) -> dict:
    """The table [motions] of one motion, GROUP.long."""
    return {f"{group}.long": {"groups": [group], "scale": scale}}


@pytest.mark.parametrize("kind", ["problem", "uncertainties", "scenario"])
def test_refused_beside_others(tmp_path, kind):
    table = {"motions": {"wide": {"groups": ["self"], "scale": [0, 1, 0]}}}
    with pytest.raises(InputError, match=r"\[motions\]: 'wide' must be of the form"):
        if kind == "problem":
            InverseProblem.of(table)
        elif kind == "uncertainties":
            Uncertainties.read(table | {"sigma": {"wide": 1}})
        else:
            write_disc(tmp_path)
            file = tmp_path / "disc.toml"
            file.write_text(file.read_text() + TABLE.replace("disc.wide", "wide"))
            Scenario.read(file)
