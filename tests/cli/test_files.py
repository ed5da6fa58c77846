"""The command `report`: which pages it makes, and what it refuses."""

import json
import re
import sys

import numpy as np
import pytest

import mi_lcair
from mi_lcair import formats
from mi_lcair.rendering.images.files import write_exr
from mi_lcair.results import Result
from mi_lcair.scenes import FOLDER

CHANNELS = {
    "Y": np.linspace(1, 2, 12, dtype=np.float32).reshape(3, 4),
    "temperature.Y": np.full((3, 4), 300, np.float32),
}


@pytest.fixture
def image():
    write_exr("a.exr", CHANNELS, {"scene": "two_plates", "band": "MWIR", "seed": "7"})
    return "a.exr"


def test_page_of_an_image(run, image, folder):
    result = run("report", image, "-o", "a b.html")
    assert (result.exit_code, result.stdout) == (0, "a b.html\n")
    page = (folder / "a b.html").read_text()
    assert page.startswith("<!DOCTYPE html>")
    assert "two_plates (a.exr)" in page
    assert "mi-lcair report a.exr -o &#x27;a b.html&#x27;" in page
    assert '<th scope="row">seed</th><td>7</td>' in page


@pytest.mark.parametrize("window", ["2 1.5", None])
def test_an_image_file_has_axes_in_metres_if_its_header_states_them(run, folder, window):
    header = {"scene": "two_plates"} | ({"window_m": window} if window else {})
    write_exr("a.exr", CHANNELS, header)
    assert run("report", "a.exr", "-o", "a.html").exit_code == 0
    stated = re.search(r'"size_m": ?(null|\[[^]]*\])', (folder / "a.html").read_text())[1]
    assert json.loads(stated) == ([2.0, 1.5] if window else None)


def test_same_input_gives_the_same_page(run, image, folder):
    for _ in range(2):
        run("report", image, "-o", "a.html")
        (folder / "a.html").rename(folder / f"{len(list(folder.glob('*.html')))}.html")
    first, second = (path.read_bytes() for path in sorted(folder.glob("*.html")))
    assert first == second


def test_page_names_no_address(run, image, folder):
    """Nothing outside of plotly's own script, which is compressed, refers to a network."""
    run("report", image, "-o", "a.html")
    page = (folder / "a.html").read_text()
    assert "http:" not in page and "https:" not in page


def test_image_of_another_program(run, folder):
    write_exr("rgb.exr", dict.fromkeys("RGB", np.ones((2, 2), np.float32)), {})
    result = run("report", "rgb.exr", "-o", "rgb.html")
    assert result.exit_code == 0, result.output
    assert '"name": "R"' in (folder / "rgb.html").read_text()


def test_a_scenario_may_have_the_tolerance_that_a_limit_needs(refused):
    message = refused("report", "no.toml", "--max-spp", 8, "-o", "a.html")
    assert "no.toml" in message and "needs" not in message


def test_several_on_one_page(run, image, folder):
    (folder / "spectrum.csv").write_text("wavelength_um,target_W_sr_um\n3,1\n4,2\n")
    result = run("report", image, "spectrum.csv", "-o", "both.html")
    assert result.exit_code == 0, result.output
    page = (folder / "both.html").read_text()
    assert "two_plates (a.exr): Image" in page and "Spectrum (spectrum.csv): Spectral" in page


def test_tables_without_pictures_are_small(run, folder):
    (folder / "facets.csv").write_text("facet,radiance_W_m2_sr\n0,1\n1,\n")
    result = run("report", "facets.csv", "-o", "facets.html")
    assert "give --scene SCENE" in result.stderr
    assert (folder / "facets.html").stat().st_size < 100_000


@pytest.mark.slow
def test_signature_with_spectrum_and_facets(run, folder):
    options = ("signature", "cylinder_ir_range", "--spp", 4, "--json")
    spectrum, facets = ("--spectrum", "spectrum.csv"), ("--facets", "facets.csv")
    (folder / "signature.json").write_text(run(*options, *spectrum, *facets).stdout)
    result = run("report", "signature.json", "--scene", "cylinder_ir_range", "-o", "a.html")
    assert result.exit_code == 0, result.output
    page = (folder / "a.html").read_text()
    for kind in ("figure", "model", "table"):
        assert f'data-kind="{kind}"' in page
    result = run("report", "facets.csv", "--scene", "cylinder_ir_range", "-o", "b.html")
    assert 'data-kind="model"' in (folder / "b.html").read_text()


@pytest.mark.slow
def test_trend(run, folder):
    run("trend", "cylinder_ir_range", "--azimuth", "0:270:90", "--elevation", "0,20",
        "--spp", 4, "-o", "trend.csv")  # fmt: skip
    result = run("report", "trend.csv", "-o", "trend.html")
    assert result.exit_code == 0, result.output
    page = (folder / "trend.html").read_text()
    assert "Trend of cylinder_ir_range" in page and "elevation 20°" in page


def test_the_table_of_a_sweep(run, refused, folder):
    """A table of azimuths and elevations with errors of each quantity is no trend."""
    names = "azimuth_deg", "elevation_deg", "intensity_W_sr", "intensity_half_width_W_sr", "air"
    rows = ["0,5,2.5,0.1,us_standard", "90,5,4.5,0.2,midlat_summer"]
    (folder / "s.csv").write_text("\n".join([",".join(names), *rows]))
    columns = {name: np.array([0.5, 7.5]) for name in names[:4]}
    formats.write_netcdf("s.nc", formats.table(columns, title="sweep of a box"))
    for name, extremes in (("s.csv", "2.5 to 4.5"), ("s.nc", "0.5 to 7.5")):
        assert run("report", name, "-o", "page.html").exit_code == 0
        page = (folder / "page.html").read_text()
        assert extremes in page and ("sweep of a box" in page) == (name == "s.nc")
        assert f"'{name}' is a table of results; report shows it" in refused("show", name)


@pytest.mark.slow
def test_scene_that_has_no_signature(run, folder):
    """A perspective camera gives an image, and is refused with what only a signature takes."""
    for name in ("plate.xml", "plate.ply"):
        (folder / name).write_bytes((FOLDER / "examples" / name).read_bytes())
    text = (folder / "plate.xml").read_text()
    (folder / "view.xml").write_text(text.replace('"orthographic"', '"perspective"'))
    result = run("report", "view.xml", "--spp", 4, "-o", "a.html")
    assert result.exit_code == 0, result.output
    page = (folder / "a.html").read_text()
    assert ">Image<" in page and ">Intensity<" not in page
    result = run("report", "view.xml", "--tolerance", "1%", "-o", "b.html")
    assert result.exit_code == 2 and "orthographic" in result.stderr
    assert not (folder / "b.html").exists()


@pytest.mark.slow
def test_results_in_memory_are_saved_as_pages(folder):
    scene = mi_lcair.load("cylinder_ir_range")
    for result in (
        mi_lcair.render(scene, spp=4),
        mi_lcair.signature(scene, spp=4, by_spectrum=True, facets=True),
    ):
        assert isinstance(result, Result)
        result.save(f"{result.kind}.html")
        assert f"{result.scene_name}" in (folder / f"{result.kind}.html").read_text()
    result.facets.save("facets.html")
    assert 'data-kind="model"' in (folder / "facets.html").read_text()


@pytest.mark.parametrize(
    ("content", "name", "words"),
    [
        (None, "nothing", "'nothing' is no image (.exr)"),
        (None, "missing.exr", "missing.exr"),
        ("text", "notes.txt", "'notes.txt' is no image (.exr)"),
        (None, "bare_aluminum", "is a material, which no page shows; report takes"),
        ("no image", "a.exr", "is not an OpenEXR image"),
        ("{", "a.json", "not JSON"),
        ("[" * 100_000, "a.json", "'a.json': not JSON: nested too deeply"),
        ("[1]", "a.json", "not the JSON of a result"),
        ('{"kind": "signature"}', "a.json", "a signature that is incomplete"),
        ('{"kind": "fit"}', "a.json", "a fit that is incomplete"),
        ('{"kind": "fit", "materials": {}}', "a.json", "a fit that is incomplete"),
        ("azimuth_deg,elevation_deg,intensity_W_sr\n", "a.csv", "no rows of data"),
        ("azimuth_deg,elevation_deg,intensity_W_sr\n0,0,x\n", "a.csv", "is not a number"),
        ("a,b\n1,2\n", "a.csv", "neither a trend"),
        ("", "a.csv", "a.csv"),
        ("[target]\n", "a.toml", "a.toml"),
        ("<scene/>", "a.xml", "a.xml"),
    ],
)
def test_refuses_what_it_cannot_show(refused, folder, content, name, words):
    if content is not None:
        (folder / name).write_text(content)
    assert words in refused("report", name, "-o", "page.html")
    assert not (folder / "page.html").exists()


def test_refuses_a_table_of_another_model(refused, folder):
    (folder / "facets.csv").write_text("facet,radiance_W_m2_sr\n0,1\n100000,2\n")
    message = refused("report", "facets.csv", "--scene", "two_plates", "-o", "page.html")
    assert "does not fit the model" in message
    assert not (folder / "page.html").exists()


def test_refuses_outputs_that_are_no_page(refused, image, folder):
    assert "does not end in .html or .htm" in refused("report", image, "-o", "page.pdf")
    assert "does not exist" in refused("report", image, "-o", "none/page.html")
    assert [path.name for path in folder.iterdir()] == ["a.exr"]


def test_says_how_to_install_plotly(refused, image, folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", None)
    assert "pip install 'mi_lcair[report]'" in refused("report", image, "-o", "page.html")
    assert not (folder / "page.html").exists()


def test_fit_with_its_data(run, folder):
    """The data are shown if they lie beside the report, and the curves in any case."""
    data = (FOLDER / "examples" / "paint.csv").read_text()
    (folder / "paint.csv").write_text(data)
    result = run(
        "fit", "paint.csv", "--model", "sandford_robertson", "-o", "fit.json", "--starts", 1
    )
    assert result.exit_code == 0, result.output
    run("report", "fit.json", "-o", "with.html")
    (folder / "paint.csv").write_text(data + "\n")  # no longer what was fitted
    run("report", "fit.json", "-o", "without.html")
    pages = [(folder / f"{name}.html").read_text() for name in ("with", "without")]
    assert ["The measured data are not in the report" in page for page in pages] == [
        False,
        True,
    ]
    verdict = json.loads((folder / "fit.json").read_text())["verdict"]
    assert all(text in pages[0] for text in verdict.values())
