"""Unusable problems are refused in one line that says what would be right."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.inversion.problem import InverseProblem
from tests.inversion.plate import UNKNOWNS, datum, write_scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    write_scene(folder)
    return folder


@pytest.fixture(scope="module")
def entry(folder):
    return datum(folder, "image", 1)


def refused(tree, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(tree)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"netd_mK": None}, "states its noise by nothing; give one of netd_mK, sigma"),
        ({"sigma": 0.1}, "states its noise by netd_mK and sigma"),
        ({"netd_mK": -50}, "netd_mK = -50; must be positive"),
        ({"intensity": 1.0}, "has image and intensity; give one of"),
        ({"quantity": "radiannce"}, "unknown quantity 'radiannce'; known: radiance"),
        ({"gain_prior": [1, 0.1]}, "gain_prior needs gain = true"),
        ({"gain": True, "gain_prior": [1, 0]}, r"gain_prior = \[1.0, 0.0\]: sigma is 0"),
        ({"netd": 50}, "unknown key of .*'netd'; known: netd_mK"),
        ({"channel": "Y"}, "channel = 'Y' goes with an EXR file only"),
        ({"quantity": None}, "does not say what it holds; give quantity"),
        ({"quantity": "apparent_temperature", "scale": 0.5}, "must lie in 30..6000 K .degrees Cel"),
        ({"quantity": "apparent_temperature"}, "check unit, band and scale"),
        ({"scale": 7.3}, "give quantity = 'apparent_temperature' if these are kelvin"),
        ({"scale": 1e4}, "check unit, band and scale"),
        ({"saturation": 1.0}, "all pixels are masked, saturated or not finite"),
        ({"sensor": 3}, "sensor 3 does not exist"),
        ({"netd_mK": None, "sigma": 1e-30}, "the noise 1e-30 is below the single precision"),
        ({"netd_mK": 1e-9}, "is below the single precision of the renderer"),
    ],
)
def test_bad_data(entry, changes, message):
    changed = {key: value for key, value in (entry | changes).items() if value is not None}
    refused({"data": [changed], "unknowns": UNKNOWNS}, message)


@pytest.mark.parametrize(
    ("unknown", "message"),
    [
        ({"plate.temperatur": {}}, "unknown parameter .*'plate.temperatur'; known: plate.temp"),
        ({"plat.facets": {}}, "unknown parameter .*'plat.facets'; known: plate.facets|plat"),
        ({"plate.temperature [hot]": {}}, "unknown band, state or data 'hot'; known"),
        ({"plate.temperature": {"prior": [300, 0]}}, "sigma is 0; must be positive"),
        ({"plate.temperature": {"per": ["view"]}}, "unknown per 'view'; known: state"),
        ({"plate.temperature": {"lower": 320, "start": 310}}, "start = 310 is outside its bounds"),
        ({"plate.temperature": {"lower": 320, "upper": 300}}, "lower = 320 is not below upper"),
        ({"plate": {"temperature": {}}}, 'write the whole name in quotes, such as "plate.temp'),
        ({}, "no .unknowns.: name at least one"),
    ],
)
def test_bad_unknowns(entry, unknown, message):
    refused({"data": [entry], "unknowns": unknown}, message)


def test_tables(entry):
    refused({"data": [entry], "unknown": UNKNOWNS}, "unknown table 'unknown'; known: unknowns")
    refused({"unknowns": UNKNOWNS}, "no .*data.*: add a measurement, or a .goal.")
    nuisance = {"plate.temperature": {}}
    refused(
        {"data": [entry], "unknowns": UNKNOWNS, "nuisance": nuisance}, "is in .unknowns. and in"
    )
    refused({"data": entry, "unknowns": UNKNOWNS}, r"data must be tables, \[\[data\]\]")
    refused({"data": [entry, entry], "unknowns": UNKNOWNS}, "have the name 'image'")
    twice = {"plate.temperature": {}, "plate.temperature [LWIR]": {}}
    refused({"data": [entry], "unknowns": twice}, "without data; other entries name it")


def test_more_unknowns_than_data(entry):
    number = {key: entry[key] for key in ("scene", "parameters")} | {"intensity": 1, "sigma": 0.1}
    refused({"data": [number], "unknowns": UNKNOWNS}, "2 unknowns without a prior, but only 1")


def test_an_unknown_that_no_pixel_sees(entry):
    """The sky is not seen by a plate that reflects nothing."""
    black = entry | {"parameters": entry["parameters"] | {"R": 0.0}}
    refused(
        {"data": [black], "unknowns": {"sky.temperature": {}}},
        "'sky.temperature' is an unknown without any data",
    )


def test_size_and_band(entry, folder):
    np.save(folder / "small.npy", np.full((8, 16), 40.0))
    small = entry | {"image": str(folder / "small.npy")}
    refused({"data": [small], "unknowns": UNKNOWNS}, "has 16 x 8 pixels, and the scene's film 16 x")
    masked = entry | {"mask": str(folder / "small.npy")}
    refused({"data": [masked], "unknowns": UNKNOWNS}, "has 16 x 8 pixels")
    from mi_lcair.rendering.images.exr import write_exr

    write_exr(folder / "m.exr", {"Y": np.full((16, 16), 2.0)}, {"band": "MWIR"})
    other = {key: value for key, value in entry.items() if key != "quantity"}
    refused(
        {"data": [other | {"image": str(folder / "m.exr")}], "unknowns": UNKNOWNS},
        "is of band MWIR, and not of band LWIR",
    )


def test_closure_tail_has_no_derivatives(entry, folder):
    text = (folder / "plate.xml").read_text()
    tail = '<string name="closure" value="tail"/> </integrator>'
    (folder / "tail.xml").write_text(
        text.replace("</integrator>", tail, 1).replace(
            'max_bounces" value="1"', 'max_bounces" value="3"'
        )
    )
    other = entry | {"scene": str(folder / "tail.xml")}
    refused({"data": [other], "unknowns": UNKNOWNS}, "closure = tail has no derivatives")


def test_a_file_is_one_line(tmp_path):
    (tmp_path / "p.toml").write_text("[[data]\n")
    with pytest.raises(InputError, match="p.toml"):
        InverseProblem.read(tmp_path / "p.toml")
