"""Meshes and scenes on disk: what Mitsuba reads back from them."""

from xml.etree import ElementTree

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.models3d import export, read
from mi_lcair.physics.materials import entries_of, over_hemisphere
from tests.models3d.shapes import SIDES, SKY, cube, obj

BOXES = (
    cube(label="f*bareAl*300*")
    + cube(at=(3, 0, 0), label="f*blackbody*500*group=plume*Cone.001")
    + cube(at=(6, 0, 0), label="s*blackbody*250*elevation_deg=4.5")
    + cube(at=(0, 3, 0), label="f*bareAl*310*")
    + cube(at=(0, 6, 0), label="t*diffuse*290*")
)


@pytest.fixture
def model(tmp_path):
    (tmp_path / "model.obj").write_text(BOXES)
    return read(tmp_path / "model.obj")


def mesh(path):
    """Corners (T, 3, 3), temperatures (T,) and facets (T,) of a PLY as Mitsuba loads it."""
    loaded = mi.traverse(mi.load_dict({"type": "ply", "filename": str(path), "face_normals": True}))
    points = loaded["vertex_positions"].numpy().reshape(-1, 3)
    return (
        points[loaded["faces"].numpy().reshape(-1, 3)],
        loaded["face_temperature"].numpy(),
        loaded["face_facet"].numpy(),
    )


def test_one_mesh_for_each_type_material_group_and_elevation(model, tmp_path):
    files = export(model, tmp_path / "boxes")
    assert [path.name for path in files] == [
        "boxes_f_bare_aluminum.ply",
        "boxes_f_blackbody_plume.ply",
        "boxes_s_blackbody_4.5deg.ply",
        "boxes_t_diffuse.ply",
        "model.xml",
        "scene.xml",
    ]
    assert sorted((tmp_path / "boxes").glob("[!.]*")) == files


def test_meshes_round_trip_through_mitsuba(model, tmp_path):
    """Temperatures, facet numbers and corners in the order of the OBJ, so that normals point
    outward.
    """
    export(model, tmp_path / "boxes")
    corners, temperatures, facets = mesh(tmp_path / "boxes" / "boxes_f_bare_aluminum.ply")
    assert facets.tolist() == [*np.repeat(np.arange(6), 2), *np.repeat(np.arange(18, 24), 2)]
    assert temperatures.tolist() == [300] * 12 + [310] * 12
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals[:12:2].tolist() == [
        [-1, 0, 0],
        [1, 0, 0],
        [0, -1, 0],
        [0, 1, 0],
        [0, 0, -1],
        [0, 0, 1],
    ]
    assert corners[:12].min(axis=(0, 1)).tolist() == [0, 0, 0] and corners[12:].max(
        axis=(0, 1)
    ).tolist() == [1, 4, 1]
    corners, temperatures, facets = mesh(tmp_path / "boxes" / "boxes_f_blackbody_plume.ply")
    assert (
        set(temperatures) == {500}
        and set(facets) == set(range(6, 12))
        and corners[..., 0].min() == 3
    )


def test_facets_without_area_are_left_out_but_counted(tmp_path):
    (tmp_path / "model.obj").write_text(
        obj([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 1, 3)])
    )
    export(read(tmp_path / "model.obj"), tmp_path / "out")
    assert mesh(tmp_path / "out" / "out_f_bare_aluminum.ply")[2].tolist() == [1]


def shapes(folder):
    return {
        shape.get("id"): shape
        for shape in ElementTree.parse(folder / "model.xml").getroot().iter("shape")
    }


def values(element):
    return {child.get("name"): child.get("value") for child in element}


def test_fragment(model, tmp_path):
    export(model, tmp_path / "boxes")
    found = shapes(tmp_path / "boxes")
    assert list(found) == [
        "boxes.f_bare_aluminum",
        "boxes.f_blackbody_plume",
        "boxes.s_blackbody_4.5deg",
        "boxes.t_diffuse",
    ]
    emitters = [values(shape.find("emitter")) for shape in found.values()]
    assert [emitter["group"] for emitter in emitters] == ["self", "plume", "sky", "terrain"]
    assert [emitter["facet_type"] for emitter in emitters] == ["model", "model", "sky", "terrain"]
    assert all("temperature" in emitter and "spectrum" not in emitter for emitter in emitters)
    assert [shape.find("transform") is not None for shape in found.values()] == [
        True,
        True,
        False,
        False,
    ]  # only the model turns
    root = ElementTree.parse(tmp_path / "boxes" / "model.xml").getroot()
    assert [values(bsdf)["material"] for bsdf in root.iter("bsdf")] == [
        "bare_aluminum",
        "blackbody",
        "diffuse",
    ]
    assert {default.get("name"): default.get("value") for default in root.iter("default")} == {
        "band": "LWIR",
        "allow_band": "false",
        "lobe": "brdf",
        "yaw_deg": "0",
        "pitch_deg": "0",
        "roll_deg": "0",
    }


def test_sky_and_materials_go_with_the_model(model, tmp_path):
    (tmp_path / "own.toml").write_text("[rust.any]\nepsilon = 0.8\nrho_d = 0.1\nb = 0.2\ne = 0.3\n")
    (tmp_path / "clear & dry.csv").write_text(SKY)
    export(
        model, tmp_path / "boxes", materials=tmp_path / "own.toml", sky=tmp_path / "clear & dry.csv"
    )
    assert (tmp_path / "boxes" / "materials.toml").read_text().startswith("[rust.any]")
    assert (tmp_path / "boxes" / "clear & dry.csv").is_file()
    emitters = [values(shape.find("emitter")) for shape in shapes(tmp_path / "boxes").values()]
    assert (
        emitters[2]["spectrum"] == "$sky"
        and emitters[2]["elevation_deg"] == "4.5"
        and "temperature" not in emitters[2]
    )
    assert "temperature" in emitters[1] and "spectrum" not in emitters[1]
    for file in ("model.xml", "scene.xml"):
        root = ElementTree.parse(tmp_path / "boxes" / file).getroot()
        assert {default.get("name"): default.get("value") for default in root.iter("default")}[
            "sky"
        ] == "clear & dry.csv"
    assert all(
        values(bsdf)["materials"] == "materials.toml"
        for bsdf in ElementTree.parse(tmp_path / "boxes" / "model.xml").getroot().iter("bsdf")
    )


def test_a_sky_that_no_facet_shows(tmp_path):
    (tmp_path / "model.obj").write_text(cube())
    (tmp_path / "sky.csv").write_text(SKY)
    with pytest.raises(InputError, match="no sky facet says at which elevation it lies"):
        export(read(tmp_path / "model.obj"), tmp_path / "out", sky=tmp_path / "sky.csv")
    assert not (tmp_path / "out").exists()


def test_meshes_of_like_names_do_not_meet(tmp_path):
    (tmp_path / "own.toml").write_text(
        "".join(
            f"['{name}'.any]\nepsilon = 1.0\nrho_d = 0.0\nb = 0.0\ne = 1.0\n"
            for name in ("a_b", "a", "a b")
        )
    )
    (tmp_path / "model.obj").write_text(
        cube(label="f*a_b*300*") + cube(label="f*a*300*group=b") + cube(label="f*a b*300*")
    )
    files = export(read(tmp_path / "model.obj", materials=tmp_path / "own.toml"), tmp_path / "out")
    facets = [set(mesh(path)[2]) for path in files if path.suffix == ".ply"]
    assert sorted(map(min, facets)) == [0, 6, 12] and sum(map(len, facets)) == 18


def test_spectra_of_a_table_of_materials_come_along(tmp_path):
    """From another folder; the mean emissivity is that of the straight lines between the rows."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "glaze.csv").write_text("wavelength_um,emissivity\n8,0.5\n9,0.9\n12,0.7\n")
    (tmp_path / "own.toml").write_text("[glaze.spectral]\nemissivity = 'lab/glaze.csv'\n")
    (tmp_path / "model.obj").write_text(cube(label="f*glaze*300*"))
    read_model = read(tmp_path / "model.obj", materials=tmp_path / "own.toml")
    files = export(read_model, tmp_path / "out", materials=tmp_path / "own.toml")
    assert {"glaze.csv", "materials.toml"} <= {file.name for file in files}
    (tmp_path / "lab" / "glaze.csv").unlink()
    mi_lcair.load(tmp_path / "out" / "scene.xml", band="8-12")
    (glaze,) = entries_of(tmp_path / "out" / "materials.toml")
    mean = (0.7 * 1 + 0.8 * 3) / 4
    assert over_hemisphere(glaze) == pytest.approx(mean, abs=1e-9)


@pytest.mark.parametrize("folder", ["with space", "a--b", "a&b", "b.c", "$x", "-"])
def test_any_folder_will_do(model, tmp_path, folder):
    files = export(model, tmp_path / folder)
    for name in ("model.xml", "scene.xml"):
        ElementTree.parse(tmp_path / folder / name)
    assert len(files) == 6


# ------------------------------------------------------------------- rendered


@pytest.fixture
def boxes(tmp_path):
    """A blackbody box of 1 m x 2 m x 3 m, away from the origin, inside a cold black room."""
    points = [
        [20 + x, -7 + 2 * y, 5 + 3 * z]
        for x, y, z in [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    ]
    (tmp_path / "model.obj").write_text(
        obj(points, SIDES, "f*blackbody*400*")
        + cube(at=(10, -16, -4), size=21, flip=range(6), label="s*blackbody*70*")
    )
    export(read(tmp_path / "model.obj"), tmp_path / "boxes")
    return tmp_path / "boxes" / "scene.xml"


@pytest.mark.slow
@pytest.mark.parametrize(
    "view, area",
    [
        ({"azimuth_deg": 0}, 6),
        ({"azimuth_deg": 90}, 3),
        ({"azimuth_deg": 180}, 6),
        ({"elevation_deg": 90}, 2),
        ({"azimuth_deg": 0, "yaw_deg": 90}, 3),
        ({"azimuth_deg": 0, "pitch_deg": 90}, 2),
        ({"azimuth_deg": 90, "roll_deg": 90}, 2),
        ({"azimuth_deg": 90, "yaw_deg": 180, "pitch_deg": -90}, 3),
    ],
)
def test_the_sensor_is_framed_on_the_model(boxes, view, area):
    """However it is turned, the box is in the window, which is 1.02 of its diameter wide, and shows
    the area of one side.
    """
    scene = mi_lcair.load(boxes, band="total", resolution=64, **view)
    radiance = 5.670374419e-8 * 400**4 / np.pi
    seen = mi_lcair.render(scene, spp=16, parts=True).channels["group.self.Y"].mean() / radiance
    assert seen * 1.02**2 * (1 + 4 + 9) == pytest.approx(area, rel=0.02)


@pytest.mark.slow
def test_which_side_is_seen(tmp_path):
    """Each of the six views sees the side that it names: nose, left, tail, right, top, bottom have
    temperatures of their own.
    """
    sides = {"nose": 1, "left": 3, "tail": 0, "right": 2, "top": 5, "bottom": 4}
    (tmp_path / "model.obj").write_text(
        "".join(
            cube(without=set(range(6)) - {number}, label=f"f*blackbody*{300 + 50 * number}*")
            for number in range(6)
        )
    )
    export(read(tmp_path / "model.obj"), tmp_path / "out")
    views = {
        "nose": (0, 0),
        "left": (90, 0),
        "tail": (180, 0),
        "right": (270, 0),
        "top": (0, 90),
        "bottom": (0, -90),
    }
    for name, (azimuth, elevation) in views.items():
        scene = mi_lcair.load(
            tmp_path / "out" / "scene.xml",
            band="total",
            resolution=16,
            azimuth_deg=azimuth,
            elevation_deg=elevation,
        )
        middle = mi_lcair.render(scene, spp=1).channels["temperature.Y"][7:9, 7:9]
        assert middle == pytest.approx(np.full((2, 2), 300 + 50 * sides[name]), rel=1e-4), name


def test_a_sky_table_is_what_the_sky_shows(tmp_path):
    """A room whose walls lie at an elevation of 45 degrees, of 0.75 W m^-2 sr^-1 um^-1 there: 3 W
    m^-2 sr^-1 from 8 to 12 um.
    """
    (tmp_path / "model.obj").write_text(
        cube(label="f*blackbody*61*")
        + cube(at=(-5, -5, -5), size=11, flip=range(6), label="s*blackbody*288*elevation_deg=45")
    )
    (tmp_path / "sky.csv").write_text(SKY)
    export(read(tmp_path / "model.obj"), tmp_path / "out", sky=tmp_path / "sky.csv")
    image = mi_lcair.render(
        mi_lcair.load(tmp_path / "out" / "scene.xml", resolution=16), spp=1, parts=True
    ).channels
    assert (
        image["group.sky.Y"][0, 0] == pytest.approx(3, rel=1e-5) and image["group.sky.Y"][8, 8] == 0
    )


def test_a_band_without_a_measurement_is_allowed_by_the_parameter_that_the_message_names(tmp_path):
    """Bare aluminium is known in MWIR and LWIR. 8-14 um needs the permission."""
    (tmp_path / "model.obj").write_text(cube(label="f*bareAl*300*"))
    export(read(tmp_path / "model.obj"), tmp_path / "out")
    path = tmp_path / "out" / "scene.xml"
    with pytest.raises(InputError, match="not measured for band 8-14.*-D allow_band=true"):
        mi_lcair.load(path, band="8-14")
    assert mi_lcair.load(path, band="8-14", allow_band="true").band.name == "8-14"
