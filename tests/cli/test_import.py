"""Tests of mi-lcair import: output, files and errors."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import mi_lcair
from mi_lcair.show.pictures import model
from tests.models3d.shapes import SIDES, SKY, cube, obj

CHECKOUT = Path(mi_lcair.__file__).parents[1]
BOXES = (
    cube(without=[4])
    + cube(at=(3, 0, 0), size=2, label="f*glossBlack*310*")
    + cube(at=(-5, -5, -11), size=10, label="t*diffuse*290*")
)
SKY_CUBE = cube(label="s*blackbody*250*") + cube(at=(3, 0, 0))


@pytest.fixture(autouse=True)
def no_picture(monkeypatch):
    """A text in place of the model's picture, which its own tests draw."""
    monkeypatch.setattr(model, "png", lambda *what: repr(what).encode())


@pytest.fixture(autouse=True)
def files(folder):
    (folder / "model.obj").write_text(BOXES)
    (folder / "plain.obj").write_text(cube(label=None))
    (folder / "t.csv").write_text(
        "facet,kelvin\n" + "".join(f"{facet},{301 + facet}\n" for facet in range(6))
    )
    (folder / "own.toml").write_text("[rust.any]\nepsilon = 0.8\nrho_d = 0.1\nb = 0.2\ne = 0.3\n")
    (folder / "sky.csv").write_text(SKY)


@pytest.mark.parametrize("name, program", [("a.blend", "Blender"), ("a.FBX", "FBX")])
@pytest.mark.parametrize("command", [("import", "--check"), ("show",)])
def test_files_of_modelling_programs_are_named(refused, folder, name, program, command):
    (folder / name).write_bytes(b"BLENDER-v300\x00\xff")
    line = refused(command[0], name, *command[1:])
    assert f"{name}: is a {program} file" in line and "export the model as .obj" in line


@pytest.mark.parametrize(
    "entry, words",
    [
        ("epsilon = 1.92\nrho_d = 0.1\nb = 0.2\ne = 0.3\n", "epsilon"),
        ("epsilon = 0.5\nrho_d = 0.1\n", "lacks b, e"),
        ("epsilon = 0.7\nrho_d = 0.4\nb = 0.2\ne = 0.3\n", "epsilon + rho_d = 1.1"),
        ('model = "grey"\nemissivity = 92\n', "emissivity = 92; must lie in 0..1"),
        ('model = "grey"\n', "lacks emissivity"),
        ("", "lacks epsilon, rho_d, b, e"),
    ],
)
def test_impossible_materials_are_refused(folder, refused, entry, words):
    """Also in an entry that the model does not use."""
    text = (folder / "own.toml").read_text() + f"[paint.LWIR]\n{entry}"
    (folder / "bad.toml").write_text(text)
    line = refused("import", "model.obj", "--materials", "bad.toml", "-o", "out")
    assert words in line and "bad.toml: material 'paint', band 'LWIR'" in line
    assert not (folder / "out").exists()


def test_surroundings(run, folder):
    """Sky, ground and sun become emitters of the scene, whose words are its parameters."""
    words = ("--sky", "clear", "--ground", "290,gloss_black", "--sun", "40,30")
    result = run("import", "model.obj", "-o", "boxes", *words)
    assert result.exit_code == 0, result.output
    scene = mi_lcair.load(folder / "boxes", band="MWIR", sun_elevation_deg=50)
    assert {"sky", "ground", "sun"} <= set(scene.groups)
    parameters = mi_lcair.parameters(scene)
    assert parameters["ground.temperature"].value == 290
    assert {"sky.scale", "ground.emissivity", "sun.irradiance"} <= parameters.keys()
    scene = mi_lcair.load(folder / "boxes", sky=265, sun_elevation_deg=50, ground_material=0.7)
    assert mi_lcair.parameters(scene)["sky.temperature"].value == 265
    assert mi_lcair.parameters(scene)["ground.emissivity"].value == pytest.approx(0.7)


def test_the_first_number_of_a_model(run, folder):
    """Between sky and ground, by one command; it is that of the scene it has written."""
    words = ("--sky", "clear", "--ground", "288", "--band", "MWIR")
    result = run("import", "model.obj", "-o", "boxes", *words, "--json")
    assert result.exit_code == 0, result.output
    first = json.loads(result.stdout)["signature"]
    again = mi_lcair.signature(folder / "boxes", tolerance=0.02, parameters={"band": "MWIR"})
    assert first["target"] == again.as_dict()["target"]


def test_a_sky_file_goes_with_the_scene(run, folder):
    (folder / "day.csv").write_text(SKY)
    assert run("import", "model.obj", "-o", "boxes", "--sky", "day.csv").exit_code == 0
    assert (folder / "boxes" / "day.csv").is_file()
    assert mi_lcair.load(folder / "boxes").groups.count("sky") == 1


def test_table(run, folder):
    """A box without a bottom has the volume of the closed box."""
    result = run("import", "model.obj", "-o", "boxes")
    assert result.exit_code == 0, result.output
    note, after = result.stderr.splitlines()
    assert after == "next: mi-lcair signature boxes/scene.xml"
    assert note.startswith("mi-lcair: warning: material diffuse reflects all radiation")
    assert (
        result.stdout
        == """\
facets                 17 (34 triangles)
bounding box           10 x 10 x 13 m
volume                 1009 m^3
area of bare_aluminum  5 m^2
area of diffuse        600 m^2
area of gloss_black    24 m^2
temperature            290 to 310 K
open edges             4
facing inward          0
without area           0
duplicate              0
not planar             0 (at most 0 mm off)
written to             boxes, 6 files
"""
    )
    assert len(list((folder / "boxes").glob("[!.]*"))) == 6


def test_json(run, folder):
    result = json.loads(run("import", "model.obj", "-o", "boxes", "--json").stdout)
    files = result.pop("files")
    assert files == [
        str(path.relative_to(folder)) for path in sorted((folder / "boxes").glob("[!.]*"))
    ]
    assert {
        key: result[key]
        for key in (
            "facets",
            "triangles",
            "open_edges",
            "inward",
            "degenerate",
            "duplicate",
            "non_planar",
        )
    } == {
        "facets": 17,
        "triangles": 34,
        "open_edges": 4,
        "inward": 0,
        "degenerate": 0,
        "duplicate": 0,
        "non_planar": 0,
    }
    assert result["area_by_material"] == pytest.approx(
        {"bare_aluminum": 5, "gloss_black": 24, "diffuse": 600}
    )
    assert result["bounding_box"] == [[-5, -5, -11], [5, 5, 2]] and result["non_planar_mm"] == 0


def test_the_next_command_can_be_pasted(run, folder):
    result = run("import", "model.obj", "-o", "my box", "--band", "MWIR")
    assert "next: mi-lcair signature 'my box/scene.xml' -D band=MWIR\n" in result.stderr


def test_check_only_reports(run, folder):
    before = set(folder.rglob("*"))
    result = run("import", "model.obj", "--check")
    assert result.exit_code == 0 and "written to" not in result.stdout
    assert json.loads(run("import", "model.obj", "--check", "--json").stdout)["files"] == []
    assert set(folder.rglob("*")) == before


def test_every_option_arrives(run, folder):
    result = json.loads(
        run(
            "import",
            "plain.obj",
            "-o",
            "out",
            "--temperatures",
            "t.csv",
            "--material",
            "rust",
            "--materials",
            "own.toml",
            "--scale",
            "0.1",
            "--json",
        ).stdout
    )
    assert result["area_by_material"] == pytest.approx({"rust": 0.06}) and result[
        "volume"
    ] == pytest.approx(0.001)
    assert (result["temperature_min"], result["temperature_max"]) == (301, 306)
    assert (folder / "out" / "materials.toml").read_bytes() == (folder / "own.toml").read_bytes()
    (folder / "sky.obj").write_text(cube(label="s*blackbody*250*elevation_deg=5"))
    assert (
        run("import", "sky.obj", "-o", "sky", "--sky", "sky.csv").exit_code == 0
        and (folder / "sky" / "sky.csv").is_file()
    )


def test_remarks(run, folder):
    (folder / "model.obj").write_text(cube(flip=[1], label="f*bareAl*150*"))
    result = run("import", "model.obj", "--check")
    assert result.stderr.splitlines() == [
        "mi-lcair: warning: the lowest temperature is 150 K",
        "mi-lcair: warning: 1 model facet faces inward; the back of a facet neither emits nor "
        "reflects: turn their normals outward",
        "next: mi-lcair import model.obj -o model",
    ]


def test_files_are_replaced_and_others_left_alone(run, refused, folder):
    """An import replaces the files of an earlier import, but not files that a user has edited."""
    (folder / "boxes").mkdir()
    (folder / "boxes" / "mine.txt").write_text("old")
    (folder / "model.obj").write_text(cube())
    assert run("import", "model.obj", "-o", "boxes").exit_code == 0
    small = (folder / "boxes" / "scene.xml").read_text()
    (folder / "model.obj").write_text(cube(size=2))
    assert run("import", "model.obj", "-o", "boxes").exit_code == 0
    assert (folder / "boxes" / "mine.txt").read_text() == "old"
    assert (folder / "boxes" / "scene.xml").read_text() != small
    assert len(list((folder / "boxes").glob("[!.]*"))) == 5
    assert run("import", "model.obj", "-o", ".").exit_code == 0 and (folder / "scene.xml").is_file()
    for file, edit in (("scene.xml", ('value="LWIR"', 'value="MWIR"')), ("model.xml", ("\n", " "))):
        path = folder / "boxes" / file
        written = path.read_text()
        edited = written.replace(*edit)
        path.write_text(edited)
        assert f"{file}: was written by somebody else or edited" in refused(
            "import", "model.obj", "-o", "boxes"
        )
        assert path.read_text() == edited
        path.write_text(written)


@pytest.mark.parametrize("suffix", [".obj", ".xml"])
def test_an_unknown_band_is_refused_before_anything_is_written(refused, folder, suffix):
    (folder / "model.obj").write_text(cube())
    (folder / "model.xml").write_text('<scene version="3.0.0"><shape type="sphere"/></scene>')
    options = ["--temperature", 300] if suffix == ".xml" else []
    message = refused("import", f"model{suffix}", "-o", "boxes", "--band", "lwer", *options)
    assert "unknown band 'lwer'" in message
    assert not (folder / "boxes").exists()


def test_remarks_have_the_names_of_the_file(run, folder):
    """What an object of Blender is called, and not the numbers of its facets alone."""
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    faces = "o Wing.001\nusemtl Skin\nf 1 2 3 4\no Fin\nusemtl Skin\nf 1 2 3 4\n"
    (folder / "model.obj").write_text(square + faces)
    names = folder / "names.csv"
    names.write_text("name,material,kelvin\nSkin,bareAl,300\n")
    remarks = run("import", "model.obj", "--names", names, "--check").stderr
    assert "facets 0 (Wing.001) and 1 (Fin) overlap" in remarks
    (folder / "model.obj").write_text(cube(flip=[1], label="Tail\nusemtl Skin"))
    remarks = run("import", "model.obj", "--names", names, "--check").stderr
    assert "1 model facet faces inward (Tail)" in remarks


def test_thin_sheets_are_remarked(run, folder):
    """Two facets in one place; not those back to back, such as a wing without thickness."""
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    (folder / "model.obj").write_text(f"o f*bareAl*300*\n{square}f 1 2 3 4\nf 4 3 2 1\n")
    result = run("import", "model.obj", "--check")
    assert "lie" not in result.stderr
    (folder / "model.obj").write_text(
        f"o f*bareAl*300*\n{square}f 1 2 3 4\n" + square.replace("1", "0.5") + "f 5 6 7 8\n"
    )
    assert "facets 0 and 1 overlap" in run("import", "model.obj", "--check").stderr
    (folder / "model.obj").write_text(cube())
    assert "lie" not in run("import", "model.obj", "--check").stderr


@pytest.mark.slow
def test_a_plate_seen_edge_on_ends(run, folder):
    """Its first intensity is 0, to which no number of paths is near enough."""
    plate = "o f*bareAl*300*\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
    (folder / "model.obj").write_text(plate)
    result = run("import", "model.obj", "-o", "plate", "--band", "LWIR")
    assert "scene 0 +- " in result.stdout


def test_edited_files_are_not_replaced_silently(run, refused, folder):
    """A second import names all files that were edited, and replaces them with --overwrite only."""
    options = ("--materials", "own.toml", "--material", "rust")
    command = ("import", "model.obj", "-o", "boxes", *options)
    assert run(*command).exit_code == 0
    mesh = next((folder / "boxes").glob("*_f_rust.ply"))
    edited = sorted([folder / "boxes" / "materials.toml", folder / "boxes" / "model.png", mesh])
    (folder / "model.obj").write_text(cube(size=3))
    (folder / "own.toml").write_text((folder / "own.toml").read_text() + "# newer\n")
    assert run(*command).exit_code == 0  # nothing was edited
    for path in edited:
        path.write_bytes(path.read_bytes() + b" ")
    before = {path: path.read_bytes() for path in (folder / "boxes").iterdir()}
    message = refused(*command)
    assert f"{', '.join(str(path.relative_to(folder)) for path in edited)}: were written" in message
    assert message.count("boxes/") == 3 and "give --overwrite" in message
    assert {path: path.read_bytes() for path in (folder / "boxes").iterdir()} == before
    assert run(*command, "--overwrite").exit_code == 0
    assert all(path.read_bytes() != before[path] for path in edited)
    assert run(*command).exit_code == 0


def test_files_of_others_are_not_replaced(run, refused, folder):
    """Without model.xml nothing says what an import wrote; what differs is kept."""
    assert run("import", "model.obj", "-o", "boxes").exit_code == 0
    (folder / "boxes" / "model.xml").unlink()
    assert run("import", "model.obj", "-o", "boxes").exit_code == 0  # the files are the same
    (folder / "boxes" / "model.xml").unlink()
    (folder / "boxes" / "model.png").write_bytes(b"mine")
    assert "boxes/model.png: was written by somebody else" in refused(
        "import", "model.obj", "-o", "boxes"
    )


def test_axes(run, refused, folder):
    """A model that lies on its side is remarked, and turned upright by Blender's two options."""
    points = [(x, z, -y) for x in (0, 3) for y in (-1, 1) for z in (0, 5)]
    (folder / "lying.obj").write_text("# Blender 4.5.1\n" + obj(points, SIDES))
    upright = ("import", "lying.obj", "--forward", "-Z", "--up", "Y", "--check")
    result = run("import", "lying.obj", "--check")
    assert "bounding box           3 x 5 x 2 m" in result.stdout
    note, after = result.stderr.splitlines()
    assert after == "next: mi-lcair import lying.obj -o lying"
    assert "Blender 4.5.1 wrote the file" in note and "give --forward -Z --up Y" in note
    result = run(*upright)
    assert "bounding box           3 x 2 x 5 m" in result.stdout and "warning" not in result.stderr
    assert "bounding box           2 x 3 x 5 m" in run(*upright, "--nose", "Y").stdout
    assert "--forward Y --up Y lie on one line" in refused(
        "import", "lying.obj", "--up", "Y", "--check"
    )
    assert "'--up'" in refused("import", "lying.obj", "--up", "up", "--check")


def test_names_and_one_temperature(run, refused, folder):
    """Files without labels: one material and temperature for all, or a table of names."""
    result = run(
        "import", "plain.obj", "--material", "blackbody", "--temperature", "320", "--check"
    )
    assert "320 to 320 K" in result.stdout, result.output
    (folder / "names.csv").write_text("name,material,kelvin\nCube,bareAl,333\nBall,,\n")
    result = run("import", "plain.obj", "--names", "names.csv", "--check")
    assert "333 to 333 K" in result.stdout, result.output
    assert "warning: names.csv: nothing in plain.obj is called Ball" in result.stderr
    result = run("import", "plain.obj", "--names", "names.csv", "--temperature", "340", "--check")
    assert "340 to 340 K" in result.stdout, result.output
    for options, reason in (
        (["--temperature", "20"], "temperature '20' looks like degrees Celsius"),
        (["--temperature", "300", "--temperatures", "t.csv"], "exclude each other"),
        (["--names", "t.csv"], "the header must name name"),
        (["--names", "none.csv"], "none.csv: cannot be read"),
    ):
        assert reason in refused(
            "import", "plain.obj", *options, "--material", "diffuse", "--check"
        ), options


@pytest.mark.slow
def test_a_fit_is_a_material(run, folder):
    """A fit's file in a label, as --material and as --materials: the scene works from another
    folder, and all three give the same intensity.
    """
    fit = {
        "parameters": {"epsilon": 0.5, "rho_d": 0.1, "b": 0.3, "e": 0.2},
        "form": "thesis",
        "band": "8-12",
    }
    (folder / "fits").mkdir()
    (folder / "fits" / "paint.json").write_text(json.dumps(fit))
    (folder / "labelled.obj").write_text(cube(label="f*fits/paint.json*300*"))
    (folder / "model.obj").write_text(cube(label="f*paint*300*"))
    imports = {
        "in_label": ["labelled.obj"],
        "as_material": ["plain.obj", "--material", "fits/paint.json", "--temperature", "300"],
        "as_materials": ["model.obj", "--materials", "fits/paint.json"],
    }
    intensities = []
    for name, words in imports.items():
        result = run("import", *words, "-o", name)
        assert result.exit_code == 0, result.output
        assert (folder / name / "paint.json").is_file()
    (folder / "fits").rename(folder / "elsewhere")
    for name in imports:
        (folder / name).rename(folder / "elsewhere" / name)
        scene = mi_lcair.load(folder / "elsewhere" / name / "scene.xml", resolution=16)
        intensities.append(mi_lcair.signature(scene, spp=16).target.intensity)
    assert intensities == [intensities[0]] * 3 and intensities[0] > 0


@pytest.mark.parametrize(
    "text, reason",
    [
        (None, "fits.json: cannot be read"),
        ("{", "materials file fits.json: "),
        ("{}", "fits.json: lacks parameters"),
        ('{"materials": 3}', "key 'materials' must be a table"),
    ],
)
def test_a_file_that_is_no_fit(refused, folder, text, reason):
    if text is not None:
        (folder / "fits.json").write_text(text)
    (folder / "labelled.obj").write_text(cube(label="f*fits.json*300*"))
    for words in (["labelled.obj"], ["model.obj", "--material", "fits.json"]):
        message = refused("import", *words, "-o", "out")
        assert reason in message and not (folder / "out").exists()
    assert "fits.json" in refused("import", "model.obj", "--materials", "fits.json", "-o", "out")


def test_two_fits_of_one_name(refused, folder):
    parameters = {"epsilon": 0.5, "rho_d": 0.1, "b": 0.2, "e": 0.3}
    fit = json.dumps({"parameters": parameters, "form": "thesis", "band": "any"})
    for name in ("a", "b"):
        (folder / name).mkdir()
        (folder / name / "paint.json").write_text(fit)
    (folder / "model.obj").write_text(
        cube(label="f*a/paint.json*300*") + cube(at=(3, 0, 0), label="f*b/paint.json*300*")
    )
    assert "has the same name" in refused("import", "model.obj", "-o", "out")


@pytest.mark.parametrize(
    "text, args, reason",
    [
        (None, [], "Missing argument 'MODEL'"),
        (BOXES, ["--scale", "mm"], "--scale"),
        (BOXES, ["-o", "out", "--check"], "give either -o FOLDER or --check"),
        (BOXES, [], "give either -o FOLDER or --check"),
        ("", ["-o", "out"], "model.obj: no faces"),
        ("v 0 0 x\n", ["-o", "out"], "model.obj, line 1: a vertex must be three numbers"),
        (cube() + "f 1 2 99\n", ["-o", "out"], "model.obj, line 16: face index 99 is out of range"),
        (
            cube(label="f*bareAl*20*"),
            ["-o", "out"],
            "line 1: object 'f*bareAl*20*': temperature '20' looks like degrees Celsius; give "
            "kelvin: 293.15",
        ),
        (
            cube(label="f*gold*300*"),
            ["-o", "out"],
            "object 'f*gold*300*': unknown material 'gold'; known:",
        ),
        (cube(label=None), ["-o", "out"], "line 10: the face has no label"),
        (BOXES, ["-o", "out", "--temperatures", "t.csv"], "6 temperatures for 17 facets"),
        (BOXES, ["-o", "out", "--material", "gold"], "unknown material 'gold'"),
        (BOXES, ["-o", "out", "--materials", "none.toml"], "none.toml"),
        (BOXES, ["-o", "out", "--scale", "-1"], "scale = -1 m; must be positive and finite"),
        (SKY_CUBE, ["-o", "out", "--sky", "clear"], "already has sky facets"),
        (BOXES, ["-o", "out", "--sky", "sunny"], "sky table 'sunny'"),
        (BOXES, ["-o", "out", "--ground", "288,2"], "must lie in 0..1"),
        (BOXES, ["-o", "out", "--sun", "40"], "sky and ground are missing"),
        (BOXES, ["--check", "--ground", "288"], "--check writes nothing"),
        (BOXES, ["--check", "--sky", "sky.csv"], "--check writes nothing"),
        (BOXES, ["--check", "--overwrite"], "--check writes nothing"),
        (
            cube(at=(5000, 0, 0)),
            ["-o", "out"],
            "the model, 1 m in size, lies 5001 m from the origin",
        ),
        (BOXES, ["-o", "out", "--sky", "none.csv"], "none.csv: cannot be read"),
        (BOXES, ["-o", "out", "--sky", "t.csv"], "spectrum t.csv: the header must name"),
        (BOXES, ["-o", "out", "--emissivity", "1"], "--emissivity needs a scene of Mitsuba"),
        (BOXES, ["--check", "-D", "spp=1"], "-D needs a scene of Mitsuba"),
        (BOXES, ["-o", "t.csv"], "output 't.csv' is not a folder"),
        (BOXES, ["-o", "none/out"], "output folder 'none' does not exist"),
        (BOXES, ["-o", "busy"], "it is a folder; remove it"),
    ],
)
def test_refused(refused, folder, text, args, reason):
    (folder / "busy" / "scene.xml").mkdir(parents=True)
    if text is not None:
        (folder / "model.obj").write_text(text)
    before = {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")}
    assert reason in refused("import", *(["model.obj"] if text is not None else []), *args)
    assert {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")} == before


@pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="needs a folder in which not even root may write"
)
def test_a_folder_that_cannot_be_written(refused):
    assert "cannot write '/proc/self/out'" in refused("import", "model.obj", "-o", "/proc/self/out")


def test_an_interrupt_leaves_nothing(run, folder, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(importlib.import_module("mi_lcair.models3d.export"), "scene", interrupt)
    (folder / "there").mkdir()
    before = set(folder.rglob("*"))
    for output in ("out", "there"):
        assert run("import", "model.obj", "-o", output).exit_code == 130
    assert set(folder.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "what, unneeded",
    [
        (["-o", "out"], {"mitsuba", "drjit", "colour", "trimesh"}),
        (["--check"], {"mitsuba", "drjit", "colour", "trimesh", "matplotlib"}),
    ],
)
def test_needs_no_renderer(folder, what, unneeded):
    """The command imports neither Mitsuba nor Dr.Jit, which are slow to load. It imports Matplotlib
    only to draw a picture.
    """
    code = (
        "import sys\nfrom mi_lcair.cli import main\ntry:\n"
        f"    main(['import', 'model.obj', *{what}])\n"
        f"except SystemExit as end:\n    assert not end.code\nassert not {unneeded} & "
        "set(sys.modules)\n"
    )
    subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        check=True,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )


def test_a_material_that_emits_nothing_is_told_of(run, folder):
    """`diffuse` reflects all that arrives: a terrain of it would be black."""
    (folder / "model.obj").write_text(cube(label="t*diffuse*300*"))
    notes = run("import", "model.obj", "--check").stderr
    assert "material diffuse reflects all radiation and emits nothing" in notes
    (folder / "model.obj").write_text(cube(label="t*gloss_black*300*"))
    assert "emits nothing" not in run("import", "model.obj", "--check").stderr
