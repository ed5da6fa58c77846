"""The command and the function `cavity`: budgets, own meshes, and bad input."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.laboratory.cavities.description import CavityDescription
from mi_lcair.laboratory.cavities.shape import CavityWall, OwnMesh, Shape, of_triangles

SPHERE = {"kind": "sphere", "radius_m": 0.5, "aperture_radius_m": 0.2}


def exact_sphere(epsilon, R, a):
    f = (1 - np.sqrt(1 - (a / R) ** 2)) / 2
    return epsilon / (1 - (1 - epsilon) * (1 - f))


@pytest.mark.parametrize("seed", range(5))
def test_budget_of_a_sphere(seed):
    """Sensitivities against derivatives of the closed form, and their sum in squares."""
    rng = np.random.default_rng(seed)
    numbers = epsilon, R, a = rng.uniform(0.3, 0.9), 0.5, rng.uniform(0.1, 0.3)
    sigma = {"emissivity": 0.005, "radius_m": 0.002, "aperture_radius_m": 0.001}
    result = mi_lcair.cavity(
        {
            "shape": SPHERE | {"aperture_radius_m": a},
            "wall": {"emissivity": epsilon},
            "view": {"wavelengths_um": 10},
            "sigma": sigma,
        }
    )
    assert result.effective[0] == pytest.approx(exact_sphere(*numbers), abs=1e-12)
    variance = 0.0
    for k, name in enumerate(sigma):
        low, high = (
            exact_sphere(*[value + (j == k) * step for j, value in enumerate(numbers)])
            for step in (-1e-6, 1e-6)
        )
        slope = (high - low) / 2e-6
        assert result.estimate[name].sensitivity[0] == pytest.approx(slope, rel=2e-3)
        variance += (slope * list(sigma.values())[k]) ** 2
    assert result.sigma[0] == pytest.approx(np.sqrt(variance), rel=2e-3)


def test_reference_and_common_temperature():
    """A wall that is 1 K warmer than the reference: Planck's law by Wien's derivative."""
    wall = {"emissivity": 0.7, "temperature_K": 501.0}
    view = {"wavelengths_um": 4.0, "reference_K": 500.0}
    result = mi_lcair.cavity(
        {"shape": SPHERE, "wall": wall, "view": view, "sigma": {"temperature_K": 0.01}}
    )
    x = 14387.76877 / 4
    ratio = np.expm1(x / 500) / np.expm1(x / 501)
    assert result.effective[0] == pytest.approx(exact_sphere(0.7, 0.5, 0.2) * ratio, rel=1e-9)
    slope = result.effective[0] * x / 501**2 / -np.expm1(-x / 501)
    assert result.estimate["temperature_K"].sensitivity[0] == pytest.approx(slope, rel=1e-4)


def test_uncertainties_are_numbers_shares_or_distributions():
    """A share of a value, and the standard deviation of a uniform distribution, by hand."""
    described = {"shape": SPHERE, "wall": {"emissivity": 0.7}}
    by_hand, stated = (
        mi_lcair.cavity(described | {"sigma": sigma}).sigma
        for sigma in (
            {"radius_m": 0.005, "emissivity": 0.03 / np.sqrt(3)},
            {"radius_m": "1 %", "emissivity": {"uniform": 0.03}},
        )
    )
    assert stated == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_own_mesh_is_the_shape(seed):
    """A mesh in any place, turned and with unordered triangles, has the shape's areas."""
    rng = np.random.default_rng(seed)
    shape = Shape(kind="cylinder", radius_m=0.1, length_m=0.3, aperture_radius_m=0.05)
    wall = CavityWall.of_shape(shape, 4)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    corners = wall.corners @ turn.T + rng.uniform(-2, 2, 3)
    faces = rng.permutation(wall.wall)
    if seed % 2:
        faces = faces[:, ::-1]
    mesh = of_triangles(corners, faces, "mesh")
    assert mesh.aperture == pytest.approx(0.05, rel=1e-4)
    assert mesh.aperture_area == pytest.approx(np.pi * 0.05**2, rel=1e-6)
    assert mesh.wall_area == pytest.approx(shape.wall_area, rel=1e-4)
    assert mesh.depth == pytest.approx(0.3, rel=1e-6)
    a, b, c = (mesh.triangles.corners[mesh.triangles.wall[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.array([0, 0, 0.15]) - a)
    assert (inward > -1e-9).all()
    a, b, c = (mesh.triangles.corners[mesh.triangles.aperture[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_meshes_that_are_no_cavity():
    wall = CavityWall.of_shape(Shape(kind="cylinder", radius_m=0.1, length_m=0.3), 2)
    with pytest.raises(InputError, match="holes that are not the aperture"):
        of_triangles(wall.corners, wall.wall[:-1], "m.ply")
    with pytest.raises(InputError, match="is closed"):
        of_triangles(wall.corners, np.vstack([wall.wall, wall.aperture]), "m.ply")
    bent = wall.corners + np.outer(wall.corners[:, 0] ** 2 * 10, [0, 0, 1])
    with pytest.raises(InputError, match="does not lie in a plane"):
        of_triangles(bent, wall.wall, "m.ply")
    twice = np.vstack([wall.wall, wall.wall[:1]])
    with pytest.raises(InputError, match="share an edge"):
        of_triangles(wall.corners, twice, "m.ply")
    with pytest.raises(InputError, match="has a depth"):
        of_triangles(np.eye(3), np.array([[0, 1, 2]]), "m.ply")


def test_a_mesh_that_is_none(tmp_path):
    (tmp_path / "m.ply").write_bytes(bytes(range(128, 255)))
    with pytest.raises(InputError, match="m.ply: is no PLY file"):
        OwnMesh.read({"mesh": "m.ply"}, tmp_path)


@pytest.mark.slow
def test_mesh_file(tmp_path):
    """An OBJ of a cylinder gives the effective emissivity of the cylinder."""
    shape = Shape(kind="cylinder", radius_m=0.1, length_m=0.2, aperture_radius_m=0.05)
    wall = CavityWall.of_shape(shape, 2)
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in wall.corners]
    lines += [f"f {a} {b} {c}" for a, b, c in wall.wall + 1]
    (tmp_path / "wall.obj").write_text("\n".join(lines) + "\n")
    text = '[shape]\nmesh = "wall.obj"\n[wall]\nemissivity = 0.8\n[view]\nspot_m = 0.09\n'
    (tmp_path / "own.toml").write_text(text)
    result = mi_lcair.cavity(tmp_path / "own.toml", tolerance=5e-4)
    exact = mi_lcair.cavity(
        {
            "shape": {name: value for name, value in vars(shape).items() if value is not None},
            "wall": {"emissivity": 0.8},
            "view": {"spot_m": 0.09},
        }
    )
    assert (result.method, exact.method) == ("paths", "rings")
    assert abs(result.effective - exact.effective).max() < 4.5 * result.numerical.max()


BAD = {
    "no table": ({"wall": {"emissivity": 0.5}}, "table [shape] is missing"),
    "kind": ({"shape": {"kind": "sphre", "radius_m": 1}}, "unknown kind 'sphre'"),
    "open sphere": ({"shape": {"kind": "sphere", "radius_m": 1}}, "aperture_radius_m below"),
    "cone": (
        {"shape": {"kind": "cone", "radius_m": 1, "length_m": 1, "angle_deg": 30}},
        "one of length_m and angle_deg",
    ),
    "lid": ({"shape": SPHERE | {"kind": "cylinder"}}, "needs length_m"),
    "two walls": ({"wall": {"emissivity": 0.5, "material": "gloss_black"}}, "give one of"),
    "emissivity": ({"wall": {"emissivity": 1.2}}, "emissivity = 1.2"),
    "material": ({"wall": {"material": "gloss_blac"}}, "gloss_blac"),
    "wavelength": (
        {"wall": {"material": "gloss_black"}, "view": {"wavelengths_um": 6}},
        "not at 6 um",
    ),
    "spot": ({"view": {"spot_m": 0.5}}, "wider than the aperture"),
    "direction": ({"view": {"from": "above"}}, "'above'"),
    "angle": ({"view": {"angle_deg": 10}}, "angle_deg needs"),
    "sigma": ({"sigma": {"length_m": 0.1}}, "the cavity has no such number"),
    "negative sigma": ({"sigma": {"radius_m": -0.1}}, "'radius_m' = -0.1; must be positive"),
    "no distribution": (
        {"sigma": {"radius_m": {"uniform": 0.1, "normal": 0.1}}},
        "must have one of uniform",
    ),
    "too large": ({"sigma": {"radius_m": 0.4}}, "sigma: radius_m = 0.4"),
    "profile": ({"wall": {"emissivity": 0.5, "profile": "none.csv"}}, "none.csv"),
    "table": ({"walls": {}}, "unknown table 'walls'; known: wall"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name):
    tables, message = BAD[name]
    tables = {"shape": SPHERE, "wall": {"emissivity": 0.5}} | tables
    if name == "no table":
        del tables["shape"]
    with pytest.raises(InputError) as error:
        mi_lcair.cavity(tables)
    assert message in str(error.value)


def test_profile_must_cover_the_cavity(tmp_path):
    (tmp_path / "short.csv").write_text("z_m,kelvin\n0,300\n0.1,310\n")
    wall = {"emissivity": 0.5, "profile": str(tmp_path / "short.csv")}
    with pytest.raises(InputError, match="needs 0..0.958"):
        CavityDescription.read({"shape": SPHERE, "wall": wall})


def test_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(
        '[shape]\nkind = "cone"\nradius_m = 0.1\nangle_deg = 40\n[wall]\nemissivity = 0.9\n'
        "[sigma]\nemissivity = 0.01\nangle_deg = 0.5\n"
    )
    answer = CliRunner().invoke(main, ["cavity", "c.toml", "--json", "-o", "c.png"])
    assert answer.exit_code == 0, answer.output
    entries = json.loads(answer.stdout)
    assert entries["method"] == "rings"
    assert [row["quantity"] for row in entries["estimate"]["contributions"]] == [
        "numerical error",
        "emissivity",
        "angle_deg",
    ]
    assert 0.9 < entries["estimate"]["value"][0] < 1
    assert Path("c.png").stat().st_size > 5000
    mi_lcair.cavity("c.toml").save("c.html")
    assert "How it was made" in Path("c.html").read_text()
    text = Path("c.toml").read_text()
    for old, new, message in (
        ("emissivity = 0.01", "emissivity = 0.91", "emissivity = 0.91; must be at most 0.9"),
        ("angle_deg = 0.5", "gradient_K = 301", "gradient_K = 301; must be at most 300"),
    ):
        Path("large.toml").write_text(text.replace(old, new))
        assert message in CliRunner().invoke(main, ["cavity", "large.toml"]).stderr
    bad = CliRunner().invoke(main, ["cavity", "missing.toml", "-o", "bad.png"])
    assert bad.exit_code == 2 and len(bad.stderr.splitlines()) == 1
    assert not Path("bad.png").exists()


@pytest.mark.slow
def test_tolerance_of_paths(monkeypatch):
    """Paths end at the tolerance, or say that they do not reach it."""
    cylinder = {"kind": "cylinder", "radius_m": 0.5, "length_m": 1.0}  # few triangles
    tables = {"shape": cylinder, "wall": {"emissivity": 0.8, "specular": 0.5}}
    result = mi_lcair.cavity(tables, tolerance=2e-3)
    assert 2.131 * result.numerical.max() <= 2e-3 and result.remarks == ()
    monkeypatch.setattr("mi_lcair.api.laboratory.MOST_PATHS", 2**12)
    result = mi_lcair.cavity(tables, tolerance=1e-5)
    assert "more than the tolerance of 1e-05" in result.remarks[0]
