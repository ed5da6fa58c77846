"""Which unknowns the entries of a problem stand for, with their bounds and first guesses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.readings import Measurement
from mi_lcair.knowing.inversion.tables import UnknownEntry
from mi_lcair.knowing.inversion.unknowns import (
    InverseProblem,
    Where,
    instruments,
    unknowns,
    with_entry,
)
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.toml_table import filled
from tests.knowing.inversion.blocks import kelvin, unknown
from tests.knowing.inversion.plate import UNKNOWNS, datum, write_scene


def where(name, band, state, temperature=300.0, b=0.3):
    known = {
        "lid.temperature": Parameter("lid.temperature", "temperature", temperature, "K", 0, np.inf),
        "paint.b": Parameter("paint.b", "material", b, "1", 0.0, 1.0),
        "sky.radiance": Parameter("sky.radiance", "radiance", 20.0, "W m^-2 sr^-1", 0.0, np.inf),
    }
    return Where(name, band, state, known, {"body": {2: 290.0, 5: 295.0}})


DATA = [
    where("a", "LWIR", "cold"),
    where("b", "LWIR", "hot", 350.0),
    where("c", "MWIR", "hot", 350.0, 0.5),
]


def named(sought, nuisance=None, data=DATA, measured=None):
    entries = {name: filled(UnknownEntry, entry, name) for name, entry in sought.items()}
    others = {name: filled(UnknownEntry, entry, name) for name, entry in (nuisance or {}).items()}
    return unknowns(entries, others, data, len(data) if measured is None else measured)


def labels(*arguments, **options):
    return {one.label: one.data for one in named(*arguments, **options)}


def test_values_for_each_state_or_band():
    """Temperatures by state, materials by band, radiances by both."""
    assert labels({"lid.temperature": {}}) == {
        "lid.temperature [cold]": (0,),
        "lid.temperature [hot]": (1, 2),
    }
    assert labels({"paint.b": {}}) == {"paint.b [LWIR]": (0, 1), "paint.b [MWIR]": (2,)}
    assert labels({"sky.radiance": {}}) == {
        "sky.radiance [LWIR, cold]": (0,),
        "sky.radiance [LWIR, hot]": (1,),
        "sky.radiance [MWIR, hot]": (2,),
    }
    assert labels({"paint.b": {"per": []}}) == {"paint.b": (0, 1, 2)}
    assert labels({"paint.b": {"per": ["data"]}}) == {
        f"paint.b [{k}]": (i,) for i, k in enumerate("abc")
    }


def test_what_they_are():
    hot = named({"lid.temperature [hot]": {}})[0]
    assert (hot.name, hot.kind, hot.unit, hot.start) == ("lid.temperature", "temperature", "K", 350)
    assert (hot.lower, hot.upper, hot.prior, hot.is_sought, hot.facet) == (
        0,
        np.inf,
        None,
        True,
        None,
    )
    facets = named({"body.facets": {"prior": [300.0, 5.0]}}, data=DATA[:1])
    assert [one.label for one in facets] == ["body.facets[2]", "body.facets[5]"]
    assert [(one.name, one.kind, one.facet, one.start) for one in facets] == [
        ("body", "facet", 2, 300.0),
        ("body", "facet", 5, 300.0),
    ]
    (narrow,) = named(
        {"paint.b": {"per": []}}, data=[DATA[0], bounded(0.2, 0.9), bounded(0.1, 0.7)]
    )
    assert (narrow.lower, narrow.upper) == (0.2, 0.7)


def bounded(lower, upper):
    one = where("d", "LWIR", "hot")
    entry = replace(one.parameters["paint.b"], lower=lower, upper=upper)
    return replace(one, parameters=one.parameters | {"paint.b": entry})


def test_an_entry_with_labels_comes_before_one_without():
    """Nuisance parameters come last, those of one entry in the order of the problem."""
    found = named(
        {"lid.temperature": {}, "lid.temperature [hot]": {"start": 340}},
        {"paint.b": {}},
    )
    assert [one.label for one in found] == [
        "lid.temperature [hot]",
        "lid.temperature",
        "paint.b [LWIR]",
        "paint.b [MWIR]",
    ]
    assert [one.is_sought for one in found] == [True, True, False, False]
    assert found[0].start == 340 and found[1].data == (0,)


@pytest.mark.parametrize(
    ("sought", "measured", "message"),
    [
        ({"paint.c": {}}, None, "unknown parameter of the data's scenes 'paint.c'; known: paint.b"),
        ({"observer.range_m": {}}, None, r"give range_m in \[observer\], or parameters ="),
        ({"paint.b [SWIR]": {}}, None, "unknown band, state or data 'SWIR'"),
        ({"paint.b [MWIR, cold]": {}}, None, "'paint.b .MWIR, cold.' is an unknown without data$"),
        ({"paint.b [MWIR]": {}}, 2, "unknown band, state or data 'MWIR'"),
        ({"paint.b": {}, "paint.b [LWIR, MWIR]": {}}, None, "without data$"),
        (
            {"paint.b [MWIR]": {}, "paint.b [hot]": {}},
            None,
            "'paint.b .MWIR.' and 'paint.b .hot.' are the same parameter of 'c'; keep one",
        ),
        (
            {"paint.b": {}, "paint.b [LWIR]": {}, "paint.b [MWIR]": {}},
            None,
            "'paint.b' is an unknown without data; other entries name it for all data",
        ),
    ],
)
def test_entries_that_cannot_be_used(sought, measured, message):
    with pytest.raises(InputError, match=message):
        named(sought, measured=measured)


def test_first_guesses_and_bounds():
    """An own start must lie within the bounds; the scene's value is moved there."""
    one = unknown()
    assert with_entry(one, UnknownEntry()).start == 0.3
    assert with_entry(one, UnknownEntry(lower=0.4)).start == 0.4
    assert with_entry(one, UnknownEntry(upper=0.2)).start == 0.2
    assert with_entry(one, UnknownEntry(prior=(0.6, 0.1))).start == 0.6
    assert with_entry(one, UnknownEntry(prior=(0.6, 0.1), upper=0.5)).start == 0.5
    assert with_entry(one, UnknownEntry(start=0.7, prior=(0.6, 0.1))).start == 0.7
    wide = with_entry(one, UnknownEntry(lower=-1.0, upper=2.0))
    assert (wide.lower, wide.upper) == (0, 1)
    with pytest.raises(InputError, match="start = 0.7 is outside its bounds 0..0.5"):
        with_entry(one, UnknownEntry(start=0.7, upper=0.5))
    with pytest.raises(InputError, match="no value lies in its bounds 1.5..1"):
        with_entry(one, UnknownEntry(lower=1.5))
    assert with_entry(one, UnknownEntry(prior=(-0.29, 0.1))).start == 0
    for mean in (-0.31, 1.31):
        with pytest.raises(InputError, match="excludes all values; they lie in 0..1"):
            with_entry(one, UnknownEntry(prior=(mean, 0.1)))


@pytest.mark.parametrize(
    ("one", "span"),
    [
        (kelvin(), 100.0),
        (kelvin(lower=290.0, upper=310.0), 20.0),
        (kelvin(kind="facet"), 100.0),
        (unknown(kind="offset", lower=-np.inf, upper=np.inf), 100.0),
        (unknown(kind="gain", start=1.2, upper=np.inf), 2.4),
        (unknown(kind="radiance", start=-3.0, lower=-10.0, upper=np.inf), 6.0),
        (unknown(kind="radiance", start=3.0, lower=0.0, upper=4.0), 4.0),
        (unknown(kind="emissivity", lower=0.2, upper=0.9), 0.7),
    ],
)
def test_width_of_what_is_known_beforehand(one, span):
    assert one.span == pytest.approx(span)


@pytest.mark.parametrize(
    ("one", "value", "limit"),
    [
        (kelvin(), 300.0, 1.0),
        (unknown(kind="radiance"), -40.0, 2.0),
        (unknown(kind="emissivity"), 0.9, 0.02),
        (unknown("paint.reflectance"), 0.2, 0.05),
        (unknown("paint.reflectance"), 0.01, 0.02),
        (unknown("paint.e"), 0.004, 0.001),
        (unknown("paint.epsilon"), 0.1, 0.025),
        (unknown("paint.epsilon"), 0.8, 0.08),
        (unknown(kind="gain"), 1.1, 0.055),
        (unknown(kind="offset"), 1.0, 1e9),
    ],
)
def test_precision_of_a_determined_unknown(one, value, limit):
    assert one.is_determined(value, 0.999 * limit)
    assert one.kind == "offset" or not one.is_determined(value, 1.001 * limit)


def test_instruments():
    camera = {"image": "a.npy", "quantity": "radiance", "netd_mK": 50}
    data = [
        Measurement("cavity", "plain", **camera),
        Measurement("cavity", "camera", gain=True, offset=True, offset_prior=(0.4, 0.1), **camera),
    ]
    data = [SimpleNamespace(entry=entry, number=number) for number, entry in enumerate(data)]
    gain, offset = instruments(data)
    assert (gain.label, gain.kind, gain.unit) == ("gain [camera]", "gain", "1")
    assert (gain.start, gain.lower, gain.upper, gain.data) == (1, 0, np.inf, (1,))
    assert (offset.label, offset.unit, offset.prior) == (
        "offset [camera]",
        "W m^-2 sr^-1",
        (0.4, 0.1),
    )
    assert (offset.start, offset.lower, offset.is_sought) == (0.4, -np.inf, False)


def test_facets_that_are_alike():
    centres = np.arange(18.0).reshape(6, 3)
    data = [replace(place, centres=centres) for place in DATA]
    facets = named({"body.facets": {"correlation_m": 0.4, "per": []}}, data=data)
    assert [facet.centre for facet in facets] == [(6, 7, 8), (15, 16, 17)]
    assert {facet.correlation_m for facet in facets} == {0.4}
    with pytest.raises(InputError, match="'lid.temperature': correlation_m is of facets"):
        named({"lid.temperature": {"correlation_m": 0.4}})
    with pytest.raises(InputError, match="correlation_m"):
        UnknownEntry(correlation_m=0.0)


# Unusable problems are refused in one line that says what would be right
# -----------------------------------------------------------------------


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
        ({"netd_mK": None}, "gives its noise by nothing; give one of netd_mK, sigma"),
        ({"sigma": 0.1}, "gives its noise by netd_mK and sigma"),
        ({"netd_mK": -50}, "netd_mK = -50; must be positive"),
        ({"intensity": 1.0}, "has image and intensity; give one of"),
        ({"quantity": "radiannce"}, "unknown quantity 'radiannce'; known: radiance"),
        ({"gain_prior": [1, 0.1]}, "gain_prior needs gain = true"),
        ({"gain": True, "gain_prior": [1, 0]}, r"gain_prior = \[1.0, 0.0\]: sigma is 0"),
        ({"netd": 50}, "unknown key of .*'netd'; known: netd_mK"),
        ({"channel": "Y"}, "channel = 'Y' is possible only for an EXR file"),
        ({"quantity": None}, "does not say what its values are; give quantity"),
        ({"quantity": "apparent_temperature", "scale": 0.5}, "must lie in 30..6000 .degrees Cel"),
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
    from mi_lcair.rendering.images.files import write_exr

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
