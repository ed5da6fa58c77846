"""Tests of `convert`: files that meshio, xarray, pandas and Pillow read."""

import json
from pathlib import Path

import meshio
import numpy as np
import pandas
import pytest
import xarray
from PIL import Image

from mi_lcair.fitting.report import to_json
from mi_lcair.fitting.scatterometer.reading import read_directional
from mi_lcair.physics.materials import entries_of
from mi_lcair.rendering.images.files import read_exr, write_exr
from mi_lcair.signatures.trend import Trend
from tests.fitting.results import fit_of, measurements

BOX = Path(__file__).parents[2] / "scenes" / "examples" / "box.obj"


def area(points) -> float:
    """Area of a planar polygon, by Newell's formula."""
    points = points - points[0]
    return np.linalg.norm(sum(np.cross(a, b) for a, b in zip(points, np.roll(points, -1, 0)))) / 2


def areas(mesh) -> np.ndarray:
    return np.array([area(mesh.points[row]) for block in mesh.cells for row in block.data])


@pytest.mark.slow
def test_facets_are_those_of_the_csv(run, folder):
    """`signature --facets` and `convert facets.csv` write the same cell data as the CSV has."""
    sample = ("signature", "cavity", "-D", "resolution=16", "--spp", 4)
    for name in ("f.csv", "f.vtu"):
        assert run(*sample, "--facets", name).exit_code == 0
    assert run("convert", "f.csv", "g.vtu", "--scene", "cavity").exit_code == 0
    table = pandas.read_csv(folder / "f.csv")
    for name in ("f.vtu", "g.vtu"):
        mesh = meshio.read(folder / name)
        data = {key: np.concatenate(values) for key, values in mesh.cell_data.items()}
        assert len(data["facet"]) == len(table)
        for column in table.select_dtypes("number"):
            expected = table[column].to_numpy()
            np.testing.assert_allclose(data[column], expected, rtol=1e-8, err_msg=column)
        np.testing.assert_allclose(areas(mesh), table.area_m2, rtol=1e-6)
        assert {"type_number", "group_number", "material_number"} <= set(data)


@pytest.mark.slow
def test_usd_and_back(run, folder):
    """Temperatures, radiances and labels of a signature's facets, exactly, and the import of it."""
    Usd = pytest.importorskip("pxr.Usd")
    kelvin = np.random.default_rng(1).uniform(250, 700, 7)
    rows = (f"{number},{value!r}\n" for number, value in enumerate(kelvin.tolist()))
    (folder / "t.csv").write_text("facet,kelvin\n" + "".join(rows))
    assert run("import", str(BOX), "--temperatures", "t.csv", "-o", "box").exit_code == 0
    sample = "box/scene.xml", "-D", "resolution=16", "--spp", 4, "--facets", "f.usda"
    result = run("signature", *sample, "--json")
    (folder / "s.json").write_text(result.stdout)
    facets = json.loads(result.stdout)["facets"]
    assert run("convert", "s.json", "s.usdc").exit_code == 0  # the folder `box` is its scene
    for name in ("f.usda", "s.usdc"):
        stage = Usd.Stage.Open(str(folder / name))
        mesh = stage.GetPrimAtPath("/facets")

        def values(primvar):
            return list(mesh.GetAttribute(f"primvars:{primvar}").Get())

        assert values("thermal:kelvin") == facets["temperature_K"]
        radiance = [np.nan if v is None else v for v in facets["radiance_W_m2_sr"]]
        np.testing.assert_allclose(values("facets:radiance_W_m2_sr"), radiance, rtol=1e-7)
        assert values("thermal:group") == facets["group"] and len(values("displayColor")) == 6
    assert run("convert", "box", "scene.usdc").exit_code == 0
    assert run("import", "scene.usdc", "-o", "again").exit_code == 0
    for name in ("box", "again"):
        assert run("convert", name, f"{name}.vtp").exit_code == 0
        assert run("convert", name, f"{name}.vtu").exit_code == 0
    first, again = (meshio.read(folder / f"{name}.vtu") for name in ("box", "again"))
    assert set(first.cell_data) == set(again.cell_data)
    for name, columns in first.cell_data.items():
        assert np.array_equal(columns, again.cell_data[name]) or name == "area_m2", name
    np.testing.assert_allclose(areas(first), areas(again), rtol=1e-6)
    given = np.concatenate(again.cell_data["temperature_K"])
    assert given.tolist() == kelvin.astype(np.float32).tolist()


def test_usd_refusals(refused, run, folder):
    (folder / "s.json").write_text('{"kind": "signature", "scene_name": "two_plates"}')
    assert "'s.json': has no facets" in refused("convert", "s.json", "a.usda")
    table = {"facet": [0, 1], "area_m2": [9.0, 1.0]}
    entries = {"kind": "signature", "scene_name": "nowhere", "facets": table}
    (folder / "s.json").write_text(json.dumps(entries))
    assert "scene 'nowhere' (another: --scene)" in refused("convert", "s.json", "a.usda")
    line = refused("convert", "s.json", "a.usda", "--scene", "two_plates")
    assert "is not of scene 'two_plates', whose facets have other areas" in line
    assert "a.usdz" in refused("convert", "two_plates", "a.usdz") and not [*folder.glob("a.*")]


@pytest.mark.slow
def test_models(run, folder):
    """The same polygons from the OBJ and from the scene that import made of it."""
    assert run("import", str(BOX), "-o", "box").exit_code == 0
    for source, name in ((str(BOX), "a.vtu"), ("box", "b.vtu")):
        assert run("convert", source, name).exit_code == 0
        mesh = meshio.read(folder / name)
        assert [block.type for block in mesh.cells] == ["quad"] and len(areas(mesh)) == 7
        data = {key: np.concatenate(values) for key, values in mesh.cell_data.items()}
        np.testing.assert_allclose(areas(mesh), data["area_m2"], rtol=1e-6)
        assert sorted(data["temperature_K"]) == [290, 310, 310, 310, 310, 310, 330]


def test_images(run, folder):
    pixels = np.linspace(280, 320, 12, dtype=np.float32).reshape(3, 4)
    header = {"band": "MWIR", "scene": "x", "units": "W m^-2 sr^-1", "window_m": "4 3"}
    write_exr("seen.exr", {"Y": pixels / 100, "temperature.Y": pixels}, header)
    assert run("convert", "seen.exr", "kelvin.tif", "-c", "temperature.Y").exit_code == 0
    with Image.open("kelvin.tif") as image:
        assert image.mode == "F" and image.tag_v2[270] == "temperature.Y, K"
        np.testing.assert_array_equal(np.array(image), pixels)
    write_exr("gaps.exr", {"temperature.Y": np.where(pixels < 290, 0, pixels)}, header)
    assert run("convert", "gaps.exr", "gaps.tif", "-c", "temperature.Y").exit_code == 0
    with Image.open("gaps.tif") as image:  # 0 K is nothing, and NaN in a TIFF
        np.testing.assert_array_equal(np.isnan(np.array(image)), pixels < 290)
    assert list(read_exr("seen.exr")[0]) == ["Y", "temperature.Y"]  # the source is as it was


def test_tables_there_and_back(run, folder):
    text = "azimuth_deg,elevation_deg,intensity_W_sr\n0,0,1\n90,0,2\n0,10,3\n90,10,4\n"
    (folder / "t.csv").write_text(text)
    assert run("convert", "t.csv", "t.nc").exit_code == 0
    with xarray.open_dataset("t.nc") as data:
        assert data.intensity_W_sr.sel(elevation_deg=10, azimuth_deg=90) == 4
    made = {"made": {"scene": "truck", "band": "LWIR", "seed": "0"}, "batches": {}}
    (folder / "t.csv.json").write_text(json.dumps(made))
    assert run("convert", "t.csv", "t.nc").exit_code == 0
    trends = [Trend.read(folder / name) for name in ("t.csv", "t.nc")]
    assert [(trend.scene_name, trend.band) for trend in trends] == [("truck", "LWIR")] * 2
    assert run("convert", "t.nc", "u.csv").exit_code == 0
    back_again = Trend.read(folder / "u.csv")
    assert (back_again.scene_name, back_again.band) == ("truck", "LWIR")
    columns = ["azimuth_deg", "elevation_deg", "intensity_W_sr"]
    back = pandas.read_csv("u.csv")[columns].sort_values(columns[1::-1], ignore_index=True)
    pandas.testing.assert_frame_equal(back, pandas.read_csv("t.csv"), check_dtype=False)


@pytest.mark.parametrize(
    "args, reason",
    [
        (["t.csv", "t.vtp"], "becomes .nc; output 't.vtp' does not end in .nc"),
        (["f.csv", "f.vtp", "--scene", "two_plates"], "facet '7.0' is not in the scene"),
        (["f.csv", "f.png", "--scene", "two_plates"], "does not end in .vtp, .vtu, .usd"),
        (["t.csv", "t.nc", "-c", "Y"], "cannot be combined with 't.csv'"),
        (["none.exr", "a.tif"], "No such file"),
        (["none.csv", "a.nc"], "No such file"),
        (["empty.csv", "a.nc"], "empty.csv"),
        (["gloss_black", "a.vtp"], "'gloss_black' is a material, which is not converted"),
        (["t.csv", "no/t.nc"], "does not exist"),
        (["nothing", "a.vtp"], "'nothing' is no image"),
        (["two_plates", "a.vtk"], "does not end in .vtp, .vtu, .usd"),
        (["fit.json", "e.csv"], "convert a whole fit of one"),
        (["half.json", "e.csv"], "a fit that is incomplete: entry 'predicted' is missing"),
        (["none.json", "e.csv"], "a fit that is incomplete: an emissivity is no number"),
    ],
)
def test_refused(refused, folder, args, reason):
    half = {"theta_deg": [0]}
    none = half | {"predicted": [None], "standard_error": [0.1]}
    for name, emissivity in (("half", half), ("none", none)):
        content = {"kind": "fit", "emissivity": emissivity}
        (folder / f"{name}.json").write_text(json.dumps(content))
    (folder / "t.csv").write_text("a,b\n1,2\n")
    (folder / "empty.csv").write_text("a,b\n")
    (folder / "f.csv").write_text("facet,b\n7.0,2\n")
    (folder / "fit.json").write_text('{"kind": "fit"}')
    before = sorted(folder.iterdir())
    assert reason in refused("convert", *args)
    assert sorted(folder.iterdir()) == before


def test_emissivity_of_a_fit(run, refused, folder):
    """The CSV has the curve of the report; that of two bands is refused."""
    fit = fit_of(measurements())
    report = fit.as_dict()
    (folder / "fit.json").write_text(to_json(report))
    assert run("convert", "fit.json", "e.csv").exit_code == 0
    curve = read_directional("e.csv", "emissivity")
    np.testing.assert_allclose(np.degrees(curve.theta), report["emissivity"]["theta_deg"])
    np.testing.assert_allclose(curve.value, report["emissivity"]["predicted"])
    np.testing.assert_allclose(curve.std, report["emissivity"]["standard_error"])
    for name in ("m.xomp", "m.json"):
        assert run("convert", "fit.json", name).exit_code == 0
        (back,), (entry,) = entries_of(name), entries_of("fit.json")
        assert (back.parameters, back.form, back.band) == (entry.parameters, entry.form, "3-5")
        assert back.sigma == {k: s for k, s in report["standard_error"].items() if s}
        properties = json.loads((folder / name).read_text())["materialProperties"]
        assert 0 < properties["emissivityData"]["emissivityCoefficient"] < 1
        rms, length, _ = properties["surfaceRoughness"].values()
        slope = entry.parameters.get("alpha", entry.parameters.get("e"))
        assert 2**0.5 * rms / length == pytest.approx(slope, rel=1e-12)
    both = {"kind": "fit", "materials": {"3-5": report, "8-12": report}}
    (folder / "both.json").write_text(json.dumps(both))
    assert "'both.json': has fits of 2 bands" in refused("convert", "both.json", "f.csv")
