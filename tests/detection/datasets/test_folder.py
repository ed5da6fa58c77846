"""A data set as a whole: its files, the same bytes after a kill and on workers, and bad input."""

import json
from hashlib import sha256

import numpy as np
import pytest
from PIL import Image as Picture

import mi_lcair
from mi_lcair.detection.camera import exposure
from mi_lcair.detection.datasets.frames import ViewRecorder
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.rendering.images.files import read_exr
from tests.detection.datasets.box_set import SCENARIO, write_box
from tests.docs.fences import EXAMPLES

pytestmark = pytest.mark.filterwarnings("ignore:nothing")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a data set `whole`, and its result."""
    folder, traced = tmp_path_factory.mktemp("set"), []
    measure = exposure.measure
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exposure, "measure", lambda *a: traced.append(1) or measure(*a))
        result = mi_lcair.dataset(write_box(folder), folder / "whole")
    return folder, result, len(traced)


def pixels(path):
    with Picture.open(path) as picture:
        return np.asarray(picture)


def counts_of(kelvin, imager):
    """Counts of a blackbody of each temperature, by Planck's law for photons from 8 to 12 um.

    A 64th of the counts is below the electrons.
    """
    x = np.linspace(8e-6, 12e-6, 401)
    photons = 2 * 2.99792458e8 / x**4 / np.expm1(1.438776877e-2 / x / kelvin[..., None])
    seen = imager.quantum_efficiency * np.pi / 4 / 2**2 * 15e-6**2 * 0.2e-3
    return (1 + 63 * seen * np.trapezoid(photons, x) / 20e6) / 64 * (2**14 - 1)


def contents(folder):
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_each_view_is_traced_once(made):
    """Of two cases, which have another background and another temperature of a group."""
    _, result, traced = made
    assert traced == result.traced == 3 and (result.views, result.images) == (3, 6)
    assert sum(result.splits.values()) == 3 and set(result.splits) == {"train", "val", "test"}
    assert "3 views" in result.summary() and "6 images" in result.summary()


def test_images_are_those_of_separate_calls(made):
    """Of `image` with the changes that the record states; the first case to the bit."""
    folder, *_ = made
    for number in (2, 3):
        record = json.loads((folder / f"whole/frames/{number:06}.json").read_text())
        scenario = Scenario.read(folder / "scenario.toml", **record["changes"])
        image = mi_lcair.image(
            scenario, frames=number + 1, seed=record["camera_seed"], truth=number == 2
        )
        channels, _ = read_exr(folder / f"whole/radiance/{number:06}.exr")
        assert "counts.Y" not in channels
        for name in ("apparent.Y", "electrons.Y", "mean_temperature.Y"):
            np.testing.assert_allclose(channels[name], image.channels[name], rtol=3e-6)
        if number == 2:
            assert all(np.array_equal(v, image.channels[name]) for name, v in channels.items())
            counts = pixels(folder / f"whole/images/{number:06}.png")
            assert counts.dtype == np.uint16 and np.array_equal(counts, image.counts[number])
            kelvin = pixels(folder / f"whole/kelvin/{number:06}.png")
            assert kelvin.dtype == np.uint16
            assert kelvin.min() > 26000  # 260 K
            expected = counts_of(kelvin / 100, image.view.imager)
            np.testing.assert_allclose(counts, expected, atol=1.5)  # 0.005 K
            truth, _ = read_exr(folder / f"whole/truth/{number:06}.truth.exr")
            for name, values in truth.items():
                np.testing.assert_array_equal(values, image.truth.channels[name])
            mask = pixels(folder / f"whole/masks/{number:06}.png")
            np.testing.assert_array_equal(mask == 255, truth["mask.Y"] >= 0.5)
            depth = np.load(folder / f"whole/depth/{number:06}.npy")
            np.testing.assert_allclose(depth / 1e3, truth["Depth.Z"], rtol=1e-6)


def test_the_manifest_has_all_files_and_how_they_were_made(made):
    folder, result, _ = made
    files = contents(folder / "whole")
    manifest = json.loads(files.pop("manifest.json"))
    assert manifest["files"] == {
        name: {"sha256": sha256(content).hexdigest(), "bytes": len(content)}
        for name, content in files.items()
    }
    assert result.files == len(files) + 1 and manifest["dataset"]["frames"]["seed"] == 7
    assert manifest["scenario"]["camera"]["width"] == 32 and manifest["versions"]["mi_lcair"]
    card = files["README.md"].decode()
    assert "of scenario: The box. 6 images in LWIR" in card and "kelvin/NUMBER.png" in card
    assert "3 views" in card and "contact.png" in card and "[draws]" in card
    for picture in ("contact.png", "statistics.png"):
        assert pixels(folder / "whole" / picture).shape[1] > 100


def test_annotations_are_those_of_the_pixels(made):
    """COCO: run lengths over columns, from pixels outside; numbers rise through all images."""
    folder, *_ = made
    known = set()
    for split in ("train", "val", "test"):
        coco = json.loads((folder / f"whole/coco_{split}.json").read_text())
        assert [entry["id"] for entry in coco["annotations"]] == [
            *range(1, len(coco["annotations"]) + 1)
        ]
        names = {category["id"]: category["name"] for category in coco["categories"]}
        for image in coco["images"]:
            known.add(image["file_name"])
            mask = pixels(folder / "whole" / image["file_name"].replace("images", "masks"))
            (of_target,) = (
                entry
                for entry in coco["annotations"]
                if entry["image_id"] == image["id"] and names[entry["category_id"]] == "target"
            )
            lengths = of_target["segmentation"]["counts"]
            flat = np.repeat(np.arange(len(lengths)) % 2, lengths)
            np.testing.assert_array_equal(flat.reshape(32, 24).T, mask // 255)
    assert known == {f"images/{number:06}.png" for number in range(6)}


def test_a_killed_set_goes_on_with_the_same_bytes(made, monkeypatch):
    """Two views are there, of which one has a damaged file."""
    folder, *_ = made
    view = ViewRecorder.view

    def killed(recorder, cases):
        if cases[0].view == 2:
            raise KeyboardInterrupt
        return view(recorder, cases)

    monkeypatch.setattr(ViewRecorder, "view", killed)
    with pytest.raises(KeyboardInterrupt):
        mi_lcair.dataset(folder / "dataset.toml", folder / "again")
    assert "images" not in json.loads((folder / "again/manifest.json").read_text())
    monkeypatch.setattr(ViewRecorder, "view", view)
    (folder / "again/radiance/000003.exr").write_bytes(b"damaged")
    done = []
    result = mi_lcair.dataset(
        folder / "dataset.toml", folder / "again", lambda *pair: done.append(pair)
    )
    assert result.traced == 2 and done == [(1, 3), (2, 3), (3, 3)]
    assert contents(folder / "again") == contents(folder / "whole")
    assert mi_lcair.dataset(folder / "dataset.toml", folder / "again").traced == 0


def test_another_set_or_other_files_are_refused(made, tmp_path):
    folder, *_ = made
    tree = {
        "base": {"scenario": str(folder / "scenario.toml")},
        "views": {"random": 1, "range_m": [50]},
    }
    with pytest.raises(InputError, match="contains another data set, with other"):
        mi_lcair.dataset(tree, folder / "whole")
    (tmp_path / "notes.txt").write_text("")
    for place, message in (
        (tmp_path, "contains other files; name a new or an empty folder"),
        (tmp_path / "notes.txt", "is no folder"),
        (tmp_path / "no/where", "its folder does not exist"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.dataset(tree, place)


@pytest.mark.slow
def test_workers_give_the_same_bytes(made):
    folder, *_ = made
    with mi_lcair.workers(2):
        mi_lcair.dataset(folder / "dataset.toml", folder / "workers")
    assert contents(folder / "workers") == contents(folder / "whole")


@pytest.mark.parametrize(
    "tables, message",
    [
        ({"views": {"random": 2, "range_m": [0.5]}}, "view 0: the observer is inside the target"),
        (
            {"views": {"random": 2, "range_m": [50], "right_deg": [30]}},
            "view 0: .*no part of the target is in the frame",
        ),
        (
            {"views": {"sphere": 2, "range_m": [50], "elevation_deg": [-60, -50]}},
            "view 0: the target is hidden",
        ),
        (
            {"draws": {"lid.temperature": {"uniform": [-5, 300]}}},
            "lid.temperature = .*; must lie",
        ),
        ({"draws": {"gloss_black.epsilon": 0.5}}, "gloss_black.epsilon = .*; must lie"),
        ({"draws": {"lid.temperature": "sigma"}}, "its material has no sigma"),
        ({"draws": {"lid.temperature": 5, "target.parameters.lid.temperature": 5}}, "the same"),
        ({"draws": {"lid.heat": 5}}, "unknown quantity 'lid.heat'"),
        ({"draws": {"background.sky": 5}}, "background.sky has no value"),
        ({"draws": {"camera.f_numbr": 5}}, r"unknown key of \[camera\] 'f_numbr'"),
        ({"draws": {"atmosphere.table": {"choice": ["no_air"]}}}, "view 0: .*no_air"),
        ({"base": {"scenario": "no.toml"}}, "no.toml"),
        ({"bands": {"MWIR": {"sensor.bnd": "MWIR"}}}, "bnd"),
        (
            {"bands": {"LWIR": {}, "MWIR": {"camera.projection": "orthographic"}}},
            "view 0: .*orthographic camera has no pose",
        ),
        ({"bands": {"LWIR": {"camera.nuc": True, "camera.well_Me": 0.1}}}, "view 0: .*saturates"),
        ({"draws": {"target.parameters.wings": {"uniform": [1, 2]}}}, "view 0: .*'wings'"),
        (
            {"bands": {"LWIR": {"background.temperature": 280}}},
            "background.temperature is that of band 'LWIR'",
        ),
        ({"views": {"file": "no.csv"}}, "no.csv: cannot be read"),
    ],
)
def test_what_is_not_possible_is_said_before_anything_is_traced(made, tables, message, tmp_path):
    folder, *_ = made
    file = write_box(folder, **tables)
    with pytest.raises(InputError, match=message) as error:
        mi_lcair.dataset(file, tmp_path / "out")
    assert "\n" not in str(error.value) and not (tmp_path / "out").exists()
    write_box(folder)


def test_a_scenario_without_a_camera(made, tmp_path):
    folder, *_ = made
    text = (folder / "scenario.toml").read_text()
    for start, end, message in (
        ("[camera]", None, "has no table .camera."),
        ("width = 32\n", 'width = 32\nprojection = "orthographic"\n', "orthographic camera has no"),
        ("temperature = 285", 'sky = "midlat_summer_clear"', "view 0: .* looks down"),
    ):
        changed = text[: text.index(start)] if end is None else text.replace(start, end)
        file = folder / "other.toml"
        file.write_text(changed)
        description = write_box(folder, base={"scenario": "other.toml"}, draws=None)
        with pytest.raises(InputError, match=message):
            mi_lcair.dataset(description, tmp_path / "out")
    write_box(folder)
    assert not (tmp_path / "out").exists() and SCENARIO["camera"]["width"] == 32


def test_facets_have_the_temperatures_of_the_hour(made, tmp_path):
    """Those of `heat` at the nearest time, with the sun of that time; none by night."""
    folder, *_ = made
    (folder / "day.csv").write_bytes((EXAMPLES / "day.csv").read_bytes())
    text = (EXAMPLES / "heat.toml").read_text()
    text = text[: text.index("[sigma]")] + "[run]\nsteps = 24\nrays = 64\n"
    (folder / "heat.toml").write_text(text)
    scenario = (folder / "scenario.toml").read_text()
    scenario = scenario.replace(
        "[background]\ntemperature = 285", '[surroundings]\nsky = "270"\nsun = "40,10"'
    )
    (folder / "sunny.toml").write_text(scenario)
    tables = {"base": {"scenario": "sunny.toml", "heat": "heat.toml"}, "splits": None}
    tables |= {
        "draws": {"hour": {"choice": [3, 14]}},
        "frames": {"cases": 2, "truth": True, "seed": 1},
    }
    tables |= {"views": {"sphere": 1, "range_m": 50, "elevation_deg": 40}}
    file = write_box(folder, **tables)
    result = mi_lcair.dataset(file, tmp_path / "day")
    heat, seen = mi_lcair.heat(folder / "heat.toml"), set()
    for number in range(2):
        record = json.loads((tmp_path / f"day/frames/{number:06}.json").read_text())
        hour, changes = record["hour"], record["changes"]
        row = heat.row(hour)
        seen.add(hour)
        sun = None if hour == 3 else pytest.approx([56.04, 214.52 - 360], abs=0.01)
        stated = changes["surroundings.sun"]
        assert (None if stated is None else [*map(float, stated.split(","))]) == sun
        truth, _ = read_exr(tmp_path / f"day/truth/{number:06}.truth.exr")
        shown = truth["true_temperature.Y"][truth["IndexFacet.X"] > 0]
        facets = truth["IndexFacet.X"][truth["IndexFacet.X"] > 0].astype(int) - 1
        np.testing.assert_allclose(shown, heat.of_scene(heat.kelvin)[row, facets], atol=1e-3)
    assert result.traced == len(seen)
    write_box(folder)


def test_a_bolometer_records_power(tmp_path):
    """Its image has another channel than that of a photon detector. A turned model is noted."""
    camera = {f"camera.{name}": 24 for name in ("width", "height")} | {
        "camera.detector": "bolometer",
        "camera.netd_mK": 50,
        "camera.span_K": [250, 400],
    }
    one = {"sphere": 1, "elevation_deg": [20], "range_m": [40]}
    splits = {"train": 1, "val": 0, "test": 0}
    draws = {"pose.yaw_deg": {"uniform": [10, 80]}}
    file = write_box(tmp_path, views=one, bands={"LWIR": camera}, splits=splits, draws=draws)
    result = mi_lcair.dataset(file, tmp_path / "set")
    assert any("[draws] moves the model, but points3D.txt" in remark for remark in result.remarks)
    channels, _ = read_exr(tmp_path / "set/LWIR/radiance/000000.exr")
    assert "power.Y" in channels and channels["power.Y"].min() > 0
    assert pixels(tmp_path / "set/LWIR/images/000000.png").std() > 0
