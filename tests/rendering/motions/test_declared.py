"""Motions that a TOML file declares: what they move, and what is refused."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair import InputError
from mi_lcair.detection.scenario import Scenario
from mi_lcair.inversion.data.loader import Loader
from mi_lcair.inversion.problem import InverseProblem
from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.motions.declared import middles_of_parts
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.uncertainty.uncertainties import Uncertainties
from tests.detection.disc_scenario import write_disc
from tests.sensitivity.motions.test_differences import CUBE, L, convex_hull, scene_of


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
        ('"a.b" = {groups = ["self"]}', "scale and displaced are missing; give one of them"),
        ('"a.b" = {groups = ["self"], scale = [1, 1]}', "give 3 numbers"),
        ('"a.b" = {groups = ["selv"], scale = [1, 1, 1]}', "unknown group of meshes"),
        ('"a.b" = {groups = ["self"], scale = [0, 0, 0]}', "moves no vertex"),
        ('"self.size" = {groups = ["self"], scale = [1, 1, 1]}', "is a motion of a group"),
        ('"a.b" = {groups = ["self"], displaced = "FURNACE"}', "triangles"),
        ('"a.b" = {groups = ["self"], displaced = "no.ply"}', "no.ply"),
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
