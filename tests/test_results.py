"""Every result answers: one line, a picture or a table, JSON, columns and files."""

import json
import re
import sys
from base64 import b64decode
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

import mi_lcair
from mi_lcair.cli.output import print_sections
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.physics.brdf_view import brdf_view
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.results import built, strict
from mi_lcair.sections import Facts, Lines, Table, blocks, part_html, unit_of
from mi_lcair.signatures.facets import hemispherical_view
from tests.cli.test_image import CAMERA
from tests.detection.disc_scenario import write_disc
from tests.fitting.results import measurements
from tests.knowing.budgets.plate_scene import plate_scene
from tests.knowing.inversion.plate import datum, write_scene

# Numbers without a unit: counts, fractions, names of rows
PURE = {
    "column",
    "detected",
    "electrons",
    "facet",
    "invalid",
    "max_bounces",
    "mean_cosine",
    "paths",
    "pixels",
    "reached",
    "response",
    "row",
    "samples",
    "share",
    "share_standard_error",
    "peak_detected",
    "peak_snr",
    "snr",
    "view_factor",
    "visible_fraction",
}


def rendered():
    return mi_lcair.render(mi_lcair.load("two_plates", resolution=8), spp=8)


def signature():
    return mi_lcair.signature(mi_lcair.load("two_plates", resolution=8), spp=8)


def spectral():
    scene = mi_lcair.load("cylinder_ir_range", resolution=16)
    return mi_lcair.signature(scene, spp=4, by_spectrum=True, facets=True)


def cylinder(**parameters):
    return mi_lcair.load("cylinder_ir_range", resolution=16, **parameters)


def disc(folder, **changes):
    """The scenario of a disc, with a camera."""
    file = write_disc(folder)
    file.write_text(file.read_text() + CAMERA)
    own = {"render.resolution": 8, "render.spp": 16}
    return Scenario.read(file, **own, **{name.replace("__", "."): v for name, v in changes.items()})


def budgeted(folder):
    sigma = {"sigma": {"plate.temperature": 2.0, "paint.reflectance": "5 %"}}
    return mi_lcair.budget(plate_scene(folder), sigma, spp=16, draws=10)


def solved(folder):
    write_scene(folder)
    (folder / "problem.toml").write_text(
        f"""[[data]]
        name = "cold"
        scene = "plate.xml"
        parameters = {{T = 305, R = 0.3}}
        image = "{datum(folder, "cold", 1)["name"]}.npy"
        quantity = "radiance"
        netd_mK = 50
        [unknowns]
        "plate.temperature" = {{}}
        """
    )
    return mi_lcair.invert(folder / "problem.toml", advise=False)


RESULTS = {
    "render": lambda folder: rendered(),
    "signature": lambda folder: signature(),
    "signature with spectrum": lambda folder: spectral(),
    "effective_areas": lambda folder: spectral().effective_areas,
    "facets": lambda folder: spectral().facets,
    "trend": lambda folder: mi_lcair.trend(cylinder(), [0, 90, 180, 270], [0, 30], spp=2),
    "audit": lambda folder: mi_lcair.audit(cylinder(), paths=2**10),
    "contrast": lambda folder: mi_lcair.contrast(disc(folder, sensor__nei=1e-9)),
    "detection_range": lambda folder: mi_lcair.contrast(
        disc(folder, sensor__nei=1e-9)
    ).detection_ranges()[0],
    "image": lambda folder: mi_lcair.image(disc(folder), frames=2),
    "budget": budgeted,
    "solution": solved,
    "sensitivities": lambda folder: mi_lcair.sensitivities(
        cylinder(), ["walls.temperature", "bare_aluminum.epsilon"], spp=4
    ),
    "derivative_images": lambda folder: mi_lcair.derivative_images(
        cylinder(), ["walls.temperature", "bare_aluminum.epsilon"], spp=4
    ),
    "hemispherical_view": lambda folder: hemispherical_view(
        mi_lcair.load("two_plates"), 0, rays=2**10
    ),
    "brdf": lambda folder: brdf_view("gloss_black", "LWIR"),
    "fit": lambda folder: mi_lcair.fit(measurements(), model="sandford_robertson", starts=4),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The results of RESULTS, each computed once."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = RESULTS[name](tmp_path_factory.mktemp("files"))
        return made[name]

    return get


@pytest.fixture(params=RESULTS)
def result(request, results):
    return results(request.param)


class Tags(HTMLParser):
    """Checks that every tag is closed in its order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images = [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        if tag == "img":
            self.images.append(dict(attrs)["src"])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_a_result_is_one_short_line(result):
    """It has a number with its error and its unit, or a count."""
    text = repr(result)
    assert 20 < len(text) < 200 and "\n" not in text
    assert re.search(r"\d", text) and "object at" not in text and "array(" not in text
    assert text == result.summary()


def test_a_notebook_shows_the_picture_or_the_table(result):
    html = result._repr_html_()
    images = Tags(html).images
    assert len(html) < 500_000
    if result.has_picture:
        (source,) = images
        data = source.removeprefix("data:image/png;base64,")
        assert b64decode(data, validate=True).startswith(b"\x89PNG")
    else:
        assert "<table" in html


def test_the_dictionary_is_strict_json(result):
    entries = result.as_dict()
    assert entries["kind"] == result.kind
    if result.kind not in ("detection_range", "fit"):
        names = ("scene_name", "scenario_name", "what", "problem", "material")
        assert [name for name in names if entries.get(name)]
    assert json.loads(json.dumps(entries, allow_nan=False)) == entries


def test_columns_are_equally_long_and_name_their_units(result):
    columns = result.columns()
    assert len({len(values) for values in columns.values()}) == 1
    for name, values in columns.items():
        assert isinstance(values, np.ndarray) and values.ndim == 1
        if values.dtype.kind in "iuf" and "unit" not in columns:
            assert unit_of(name) or name in PURE, name


def test_a_table_is_a_data_frame(result):
    frame = result.to_dataframe()
    assert list(frame.columns) == list(result.columns())
    for name, values in result.columns().items():
        np.testing.assert_array_equal(frame[name].to_numpy(), values)


def test_a_dataset_has_units(result):
    dataset = result.to_xarray()
    assert dataset.attrs["kind"] == result.kind
    for name, variable in dataset.variables.items():
        assert variable.attrs.get("units", "") == unit_of(name)


def test_the_axes_of_a_picture_are_labelled(result):
    if not result.has_picture:
        with pytest.raises(InputError, match="has no picture"):
            result.plot()
        return
    figure = result.plot()
    panels = [axes for axes in figure.axes if axes.axison]
    assert panels
    for axes in panels:
        assert axes.name == "polar" or axes.get_xlabel() or axes.get_ylabel()
    texts = [text for axes in panels for text in (axes.get_xlabel(), axes.get_ylabel())]
    assert any("(" in text for text in [*texts, figure.get_suptitle()])


def test_every_format_that_a_result_names_is_written(result, tmp_path):
    beginnings = {
        ".json": b"{",
        ".csv": next(iter(result.columns())).encode(),
        ".nc": b"CDF",
        ".exr": b"\x76\x2f\x31\x01",
        ".png": b"\x89PNG",
        ".svg": b"<?xml",
        ".pdf": b"%PDF",
        ".html": b"<!DOCTYPE html>",
        ".tif": b"II*\0",
        ".vtp": b"<?xml",
        ".vtu": b"<?xml",
        ".usd": b"PXR-USDC",
        ".usda": b"#usda 1.0",
        ".usdc": b"PXR-USDC",
    }
    suffixes = set(result.suffixes())
    assert {".json", ".csv", ".nc"} <= suffixes
    assert suffixes & set(PICTURES) == set(PICTURES if result.has_picture else ())
    if result.kind != "signature":
        suffixes -= {".png", ".pdf"}  # drawing is slow, and the writer is the same for all
    for suffix in suffixes:
        path = tmp_path / f"result{suffix.upper()}"
        result.save(path)
        assert path.read_bytes().startswith(beginnings[suffix]), suffix
    assert json.loads((tmp_path / "result.JSON").read_text()) == result.as_dict()
    beside = result.kind == "trend"  # FILE.csv.json
    assert len(list(tmp_path.iterdir())) == len(suffixes) + beside


@pytest.mark.parametrize("name", ["result.xyz", "result", ".json", "missing/result.json"])
def test_a_file_that_cannot_be_written_is_one_line(result, tmp_path, name):
    with pytest.raises(InputError) as refusal:
        result.save(tmp_path / name)
    if "missing" not in name:
        for suffix in result.suffixes():
            assert suffix in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_a_picture_is_no_table(result, tmp_path):
    with pytest.raises(InputError):
        result.plot(tmp_path / "picture.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("library, convert", [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_a_missing_library_is_named(results, monkeypatch, library, convert):
    monkeypatch.setitem(sys.modules, library, None)
    for name in ("render", "signature", "trend"):
        with pytest.raises(InputError, match=rf"needs {library}; python -m pip install"):
            getattr(results(name), convert)()


def test_values_that_cannot_be_drawn_are_shown_as_a_table(results):
    render = results("render")
    bright = replace(render, channels=render.channels | {"Y": render.channels["Y"] + np.inf})
    huge = replace(render, channels=render.channels | {"Y": np.full((8, 8), 2e37, np.float32)})
    assert "<img" in bright._repr_html_() and "<table" in huge._repr_html_()


def test_an_image_is_saved_whole(results, tmp_path):
    """The EXR has all channels; the columns and the dataset have the same pixels in metres."""
    render = results("render")
    render.save(tmp_path / "image.exr")
    channels, header = read_exr(tmp_path / "image.exr")
    assert list(channels) == sorted(render.channels) and header["scene"] == "two_plates"
    width, height = render.window_m
    assert [float(text) for text in header["window_m"].split()] == pytest.approx([width, height])
    dataset = render.to_xarray()
    assert dataset["radiance_W_m2_sr"].dims == ("row", "column")
    x, y = dataset["x_m"].to_numpy(), dataset["y_m"].to_numpy()
    assert np.ptp(x) == pytest.approx(width * 7 / 8) and x.mean() == pytest.approx(0, abs=1e-12)
    assert np.all(np.diff(x) > 0) and np.all(np.diff(y) < 0)
    columns = render.columns()
    k = 8 * 3 + 5
    assert (columns["row"][k], columns["column"][k]) == (3, 5)
    assert (columns["x_m"][k], columns["y_m"][k]) == (x[5], y[3])
    assert columns["temperature_K"][k] == render.channels["temperature.Y"][3, 5]
    assert dataset["temperature_K"][3, 5] == columns["temperature_K"][k]


def test_a_channel_is_saved_as_tiff(results, tmp_path):
    render = results("render")
    for options, channel in (({}, "Y"), ({"channel": "temperature.Y"}, "temperature.Y")):
        render.save(tmp_path / "image.tif", **options)
        expected = render.channels[channel]
        if channel == "temperature.Y":
            assert (expected == 0).any()
            expected = np.where(expected == 0, np.nan, expected)  # nothing has no temperature
        with Image.open(tmp_path / "image.tif") as image:
            np.testing.assert_array_equal(np.array(image), expected)


def test_an_unknown_channel_is_named(results, tmp_path):
    with pytest.raises(InputError, match="unknown channel .* 'Z'; known: Y,"):
        results("render").plot(tmp_path / "image.png", channels="Z")
    with pytest.raises(InputError, match="unknown channel .* 'Z'; known: Y,"):
        results("render").save(tmp_path / "image.tif", channel="Z")
    assert not list(tmp_path.iterdir())


def test_an_unknown_option_is_named(results, tmp_path):
    """An option that a format does not have is not ignored, and nothing is written."""
    render, path = results("render"), tmp_path / "image"
    with pytest.raises(InputError, match="option of the picture .* 'channel'; known: channels, "):
        render.plot(channel="Y")
    for suffix in (".json", ".csv", ".nc", ".exr", ".tif", ".html", ".png"):
        with pytest.raises(InputError, match=r"^unknown option of .* 'chanel'; known: "):
            render.save(path.with_suffix(suffix), chanel="Y")
    assert not list(tmp_path.iterdir())


def test_the_page_of_a_signature_takes_a_scene_by_name(results, tmp_path):
    pytest.importorskip("plotly")
    signature = results("signature with spectrum")
    assert signature.scene_name == "cylinder_ir_range"
    signature.save(tmp_path / "page.html", scene=signature.scene_name)
    with pytest.raises(InputError, match="option of the page .* 'scen'; known: scene, sensor"):
        signature.save(tmp_path / "other.html", scen="cavity")
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]


def test_a_signature_holds_its_spectrum_and_its_facets(results):
    """They are part of the JSON, so that a report can be made from the file."""
    result = results("signature with spectrum")
    entries = result.as_dict()
    assert entries["spectrum"]["target_W_sr_um"] == pytest.approx(
        result.effective_areas.columns()["target_W_sr_um"]
    )
    assert entries["facets"]["facet"] == result.facets.columns()["facet"].tolist()
    assert None in entries["facets"]["radiance_W_m2_sr"]  # facets that the sensor does not see
    table = result.columns()
    assert (table["part"][0], table["target_W_sr"][0]) == ("all", result.target.intensity)
    bounces = table["part"] == "bounce"
    assert table["target_W_sr"][bounces].tolist() == result.target.by_bounce


def test_the_console_prints_the_sections_of_every_result(result, capsys):
    """Each has facts; printed and shown on a page are the same numbers."""
    sections = result.sections()
    rows = [row for block in blocks(sections) for row in block]
    assert rows and all(isinstance(cell, str) for row in rows for cell in row)
    print_sections(sections)
    printed = capsys.readouterr().out
    assert printed.count("\n") >= len(rows)
    for section in sections:
        for part in section.parts:
            if isinstance(part, (str, Facts, Table, Lines)):
                Tags(part_html(part).replace("<th scope=col", "<th"))
    assert result.page_title()[0].isupper() or not result.page_title()[0].isalpha()


# Results from the entries of their JSON: whatever can be written comes back
# --------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    name: str
    value: float
    among: tuple["Part", ...] = ()


@dataclass(frozen=True)
class Whole:
    count: int
    is_done: bool
    numbers: np.ndarray
    interval: tuple[float, float]
    by_number: dict[int, float]
    parts: list[Part]
    first: Part | None = None
    rest: list = field(default_factory=list)


def entries_of(whole):
    """What JSON makes of an object and its parts."""
    plain = json.dumps(strict({**vars(whole), "parts": [of_part(part) for part in whole.parts]}
        | {"first": whole.first and of_part(whole.first)}), allow_nan=False)  # fmt: skip
    return json.loads(plain)


def of_part(part):
    return {**vars(part), "among": [of_part(inner) for inner in part.among]}


@pytest.mark.parametrize("seed", range(20))
def test_what_is_written_comes_back(seed):
    random = np.random.default_rng(seed)

    def part(depth):
        inner = tuple(part(depth - 1) for _ in range(random.integers(3))) if depth else ()
        return Part(str(random.integers(100)), float(random.normal()), inner)

    whole = Whole(
        count=int(random.integers(100)),
        is_done=bool(random.integers(2)),
        numbers=random.normal(size=random.integers(1, 4, 2)),
        interval=tuple(random.normal(size=2).tolist()),
        by_number={int(k): float(k) for k in random.integers(0, 99, 3)},
        parts=[part(2) for _ in range(random.integers(4))],
        first=part(0) if random.integers(2) else None,
        rest=random.integers(0, 9, 3).tolist(),
    )
    read = built(Whole, entries_of(whole))
    np.testing.assert_array_equal(read.numbers, whole.numbers)
    assert all(type(key) is int for key in read.by_number)
    same = {name: value for name, value in vars(read).items() if name != "numbers"}
    assert same == {name: value for name, value in vars(whole).items() if name != "numbers"}


def test_numbers_that_do_not_exist_and_integers():
    assert np.isnan(built(Part, {"name": "a", "value": None}).value)
    np.testing.assert_array_equal(built(np.ndarray, [1.5, None]), [1.5, np.nan])
    assert built(np.ndarray, [1, 2]).dtype.kind == "i"  # indices stay indices


@pytest.mark.parametrize(
    "entries", [{"name": "a"}, {"name": 1, "value": 1.0}, {"name": "a", "value": "1"}, []]
)
def test_refuses_other_entries(entries):
    with pytest.raises((KeyError, TypeError, ValueError)):
        built(Part, entries)
