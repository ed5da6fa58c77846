"""Materials: parameters of the thesis and of fitted surfaces, their bands, and users' files."""

import json
import os
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from drjit.llvm.ad import Float64

from mi_lcair.errors import InputError
from mi_lcair.physics import labels, materials
from mi_lcair.physics.bands import band
from mi_lcair.physics.brdf_view import brdf_view
from mi_lcair.physics.materials import (
    bands_of,
    emits_nothing,
    hemispherical_emissivity,
    material,
    names,
)
from mi_lcair.show.pictures.brdf import scale
from tests.physics import thesis

# (name, band): epsilon, rho_d, b, e from Harkiss 2007, Tables 2.2 and 2.3; of grey surfaces the
# emissivity (section 3.4.1: 96 %).
PRINTED = {
    ("bare_aluminum", "MWIR"): (0.110, 0.020, 0.050, 0.0042),
    ("bare_aluminum", "LWIR"): (0.080, 0.020, 0.050, 0.0042),
    ("gloss_black", "MWIR"): (0.890, 0.001, 0.160, 0.005),
    ("gloss_black", "LWIR"): (0.880, 0.00075, 0.160, 0.005),
    ("ir_range_wall", "MWIR"): (0.96,),
    ("ir_range_wall", "LWIR"): (0.96,),
    ("blackbody", "total"): (1,),
    ("diffuse", "SWIR"): (0,),
}
# Directional emissivities that were measured with the BRDFs (sample: angle in degrees, emissivity,
# standard deviation), from commit 41121a6 of github.com/MT-MRT/JSSS-GonioreflectometryBRDF.
MEASURED = {
    "rough_paint": [(15, 0.94304, 0.0602), (60, 0.90294, 0.0577), (80, 0.71751, 0.0464)],
    "smooth_paint": [(15, 0.90662, 0.0579), (60, 0.85687, 0.0548), (80, 0.59857, 0.0396)],
    "sandblasted_steel": [(15, 0.32112, 0.0273), (60, 0.36525, 0.0288), (80, 0.36811, 0.0289)],
}
THESIS = re.compile(r"Harkiss 2007, section \d\.\d")
FIT = re.compile(
    r"^github\.com/\S+, commit [0-9a-f]{40}, CC0-1\.0, sample [^;]+; fitted by "
    r"mi-lcair fit \S+\.csv --emissivity \S+\.csv --model (?P<model>\w+): "
    r"BRDF rms (?P<rms>0\.\d+) decades \(\d+ points\), emissivity rms (?P<emissivity>0\.\d+)$"
)
NUMBERS = "epsilon = 0.5\nrho_d = 0.1\nb = 0.2\ne = 0.1\n"


@pytest.fixture
def user_file(tmp_path):
    def write(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name, where", PRINTED)
def test_built_in_materials_have_the_printed_numbers(name, where):
    computed = material(name, band(where))
    assert computed.values == PRINTED[name, where]
    model = computed.model.name
    assert model == ("sandford_robertson" if len(computed.values) == 4 else "grey")
    assert computed.name == name and computed.band in (where, "any")


def entries():
    """Name, band and table of each built-in entry."""
    return [
        (name, where, entry)
        for name, bands in tomllib.loads(materials.BUILT_IN.read_text()).items()
        for where, entry in bands.items()
    ]


def test_every_built_in_entry_states_its_source_and_ideal_surfaces_alone_hold_in_every_band():
    """A source is a section of the thesis, or the data, the command and the misfit of a fit.

    The misfit is within the limit that the file states.
    """
    for name, where, entry in entries():
        fit = FIT.match(entry["source"])
        if name not in MEASURED:
            assert THESIS.search(entry["source"]) and fit is None, name
            assert entry.get("model", "grey") == "grey"
        else:
            assert where == "2-5.7" and fit["model"] == entry["model"], name
            assert float(fit["rms"]) < 0.3 and float(fit["emissivity"]) < 0.06, name
    assert {name for name, where, _ in entries() if where == "any"} == {"blackbody", "diffuse"}
    built_in = list(dict.fromkeys(name for name, _, _ in entries()))
    assert names() == [*built_in, *labels.tables()]
    assert set(MEASURED) < set(names())


@pytest.mark.parametrize("name", MEASURED)
def test_measured_surfaces_have_the_measured_emissivity(name):
    """They agree within 2.5 standard deviations of the measurement, as the file states."""
    theta_deg, measured, std = np.transpose(MEASURED[name])
    entry = material(name, band("MWIR"))
    emissivity = 1 - entry.model.HDR(entry.surface(), Float64(np.radians(theta_deg))).numpy()
    assert np.all(np.abs(emissivity - measured) < 2.5 * std)
    with pytest.raises(InputError, match="not measured for band LWIR 8-12 um, only for 2-5.7"):
        material(name, band("LWIR"))


@pytest.mark.parametrize("wanted, taken", [("3.5-4.2", "MWIR"), ("3-5", "MWIR"), ("8-8.5", "LWIR")])
def test_a_part_of_the_measured_band_will_do(wanted, taken):
    assert material("gloss_black", band(wanted)).band == taken


@pytest.mark.parametrize(
    "wanted, nearest",
    [
        ("SWIR", "MWIR"),
        ("2.9-5", "MWIR"),
        ("4-9", "MWIR"),
        ("4.9-12", "LWIR"),
        ("5.5-6", "MWIR"),
        ("14-20", "LWIR"),
        ("total", "LWIR"),  # "total" is the wider band
    ],
)
def test_another_band_is_refused_unless_allowed_and_then_the_nearest_is_taken(wanted, nearest):
    with pytest.raises(
        InputError,
        match="'gloss_black': not measured for band .*, only for MWIR, LWIR; set allow_band",
    ):
        material("gloss_black", band(wanted))
    assert material("gloss_black", band(wanted), allow_band=True).band == nearest


def test_without_a_band_only_ideal_surfaces_are_known():
    assert material("diffuse", None).parameters["emissivity"] == 0
    with pytest.raises(InputError, match="'gloss_black': needs a band; measured for MWIR, LWIR"):
        material("gloss_black", None, allow_band=True)


def test_an_unknown_material_lists_the_known_nearest_first(user_file):
    with pytest.raises(InputError, match="unknown material 'gloss_blak'; known: gloss_black, "):
        material("gloss_blak", band("MWIR"))
    with pytest.raises(InputError, match="known: rust, "):
        material("rusty", band("MWIR"), user_file(f"[rust.any]\n{NUMBERS}"))


def test_a_users_file_comes_first_and_the_built_in_materials_stay_known(user_file):
    path = user_file(
        f"[gloss_black.MWIR]\n{NUMBERS}"
        f"[steel.'2-5.7']\n{NUMBERS}form = 'normalized'\nsource = 'lab book 7'\n"
    )
    assert (
        names(path)[:2] == ["gloss_black", "steel"]
        and "diffuse" in names(path)
        and len(names(path)) == len(names())  # steel is a label too
    )
    assert material("gloss_black", band("MWIR"), path).parameters["epsilon"] == 0.5
    assert material("gloss_black", band("MWIR"), str(path)).source == str(path)
    assert material("diffuse", band("MWIR"), path).parameters["emissivity"] == 0
    steel = material("steel", band("MWIR"), path)
    assert (steel.band, steel.form, steel.source) == ("2-5.7", "normalized", "lab book 7")


def test_the_narrowest_entry_that_covers_the_band_is_taken(user_file):
    path = user_file(
        "".join(f"[paint.{key}]\n{NUMBERS}" for key in ("any", "total", "MWIR", "'3.5-4.5'"))
    )
    taken = {
        wanted: material("paint", band(wanted), path).band
        for wanted in ("4-4.2", "4-5", "LWIR", "total")
    }
    assert taken == {"4-4.2": "3.5-4.5", "4-5": "MWIR", "LWIR": "any", "total": "total"}


def test_an_average_over_the_whole_spectrum_is_not_one_over_a_band(user_file):
    with pytest.raises(InputError, match="not measured for band MWIR 3-5 um, only for total"):
        material("paint", band("MWIR"), user_file(f"[paint.total]\n{NUMBERS}"))


@pytest.mark.parametrize("text", ["0.92", ".92", "1", "0", "9.2e-1"])
def test_a_number_is_the_emissivity_of_a_grey_surface(text):
    entry = material(text, band("LWIR"))
    assert (entry.model.name, entry.values) == ("grey", (float(text),))
    assert material(text, None).band == "any" and bands_of(text) == ["any"]
    assert emits_nothing(text) == (text == "0")


@pytest.mark.parametrize("text", ["1.92", "-0.1", "92"])
def test_a_number_that_is_no_emissivity_is_refused(text):
    with pytest.raises(InputError, match=f"emissivity = {text}; must lie in 0..1"):
        material(text, band("LWIR"))


def test_an_edited_file_is_read_again(tmp_path):
    """By its time if the size is the same, and by its size if the time is the same."""
    file = tmp_path / "edited.toml"
    for e, time in (("0.2", 1), ("0.3", 2), ("0.125", 2)):
        file.write_text(f"[paint.MWIR]\nepsilon = 0.5\nrho_d = 0.1\nb = 0.1\ne = {e}\n")
        os.utime(file, ns=(time, time))
        assert material("paint", band("MWIR"), file).parameters["e"] == float(e)


def test_a_fit_serves_as_a_material(user_file):
    report = {
        "parameters": {"epsilon": 0.1, "rho_d": 0.2, "b": 0.3, "e": 0.04},
        "form": "normalized",
        "band": "2-5.7",
        "rms": 0.01,
    }
    path = user_file(json.dumps(report), "fit.json")
    computed = material(str(path), band("MWIR"))
    assert computed.values == (0.1, 0.2, 0.3, 0.04)
    assert (computed.name, computed.band, computed.form, computed.source) == (
        str(path),
        "2-5.7",
        "normalized",
        str(path),
    )
    with pytest.raises(InputError, match="not measured for band LWIR"):
        material(str(path), band("LWIR"))


def test_a_fit_of_several_bands_serves_each(user_file):
    def report(epsilon, limits):
        return {
            "parameters": {"epsilon": epsilon, "rho_d": 0.2, "b": 0.3, "e": 0.04},
            "form": "thesis",
            "band": limits,
        }

    path = str(
        user_file(
            json.dumps({"materials": {"3-5": report(0.1, "3-5"), "8-12": report(0.3, "8-12")}}),
            "fit.json",
        )
    )
    assert [material(path, band(name)).parameters["epsilon"] for name in ("MWIR", "LWIR")] == [
        0.1,
        0.3,
    ]
    with pytest.raises(InputError, match="not measured for band SWIR 1-3 um, only for 3-5, 8-12"):
        material(path, band("SWIR"))


@pytest.mark.parametrize(
    "text, message",
    [
        (
            "[paint.MWIR]\nepsilon = 0.5\nb = 0.2\ne = 0.1\n",
            "material 'paint', band 'MWIR': lacks rho_d",
        ),
        (
            f"[paint.MWIR]\n{NUMBERS}rhod = 0.1\n",
            "material 'paint', band 'MWIR': unknown key 'rhod'; known: rho_d",
        ),
        (
            f"[paint.MWIR]\n{NUMBERS}".replace("0.2", "'0.2'"),
            "material 'paint', band 'MWIR': b = '0.2'; must be a finite number",
        ),
        (f"[paint.MWIR]\n{NUMBERS}".replace("0.2", "true"), "b = True; must be a finite number"),
        (f"[paint.MWIR]\n{NUMBERS}".replace("0.2", "nan"), "b = nan; must be a finite number"),
        (f"[paint.MWIR]\n{NUMBERS}source = 3\n", "source = 3; must be a text"),
        (
            f"[paint.MIWR]\n{NUMBERS}",
            "material 'paint', band 'MIWR': unknown band 'MIWR'; known: MWIR",
        ),
        (
            f"[paint]\n{NUMBERS}",
            r"material 'paint': needs a table for each band, such as \[paint.MWIR\]",
        ),
        ("paint = 3", "material 'paint': needs a table for each band"),
        ("[paint]", "material 'paint': needs a table for each band"),
        ("[paint\n", "line 1"),
    ],
)
def test_an_unusable_entry_is_one_line_that_names_file_material_and_key(user_file, text, message):
    path = user_file(text)
    with pytest.raises(InputError, match=message) as error:
        material("paint", band("MWIR"), path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)


@pytest.mark.parametrize(
    "text, message",
    [
        ("{", "line 1"),
        ("[]", "must be a table"),
        ('{"form": "thesis", "band": "MWIR"}', "lacks parameters"),
        ('{"kind": "signature"}', "its kind is 'signature'; a material needs the JSON of a fit"),
        ('{"parameters": {}, "form": "thesis"}', "lacks band"),
        (
            '{"parameters": {}, "form": "thesis", "band": null}',
            "the fitted data had no band; add '# band_um: 3 5'",
        ),
        ('{"materials": {}}', "'materials' must be a table with a fit for each band"),
        ('{"materials": {"3-5": 1}}', "'materials' must be a table with a fit for each band"),
        ('{"parameters": {}, "form": 1, "band": "MWIR"}', "form = 1; must be a text"),
        ('{"parameters": {}, "form": "thesis", "band": "MWIR"}', "lacks epsilon, rho_d, b, e"),
        (
            '{"parameters": {"epsilon": NaN}, "form": "thesis", "band": "MWIR"}',
            "epsilon = nan; must be a finite number",
        ),
    ],
)
def test_an_unusable_fit_is_one_line_that_names_file_and_key(user_file, text, message):
    path = user_file(text, "fit.json")
    with pytest.raises(InputError, match=message) as error:
        material(str(path), band("MWIR"))
    assert "\n" not in str(error.value) and str(path) in str(error.value)


@pytest.mark.parametrize(
    "name, file", [("paint", "missing.toml"), ("missing.json", None), (Path("missing.json"), None)]
)
def test_a_missing_file_is_named(name, file):
    with pytest.raises(InputError, match="missing.*: No such file or directory"):
        material(name, band("MWIR"), file)


@pytest.mark.parametrize("name", sorted({name for name, _, _ in entries()}))
def test_what_emits_nothing_says_so(name):
    """The key `emits` of the built-in materials against what their models reflect."""
    bands = tomllib.loads(materials.BUILT_IN.read_text(encoding="utf-8"))[name]
    theta = Float64(0.0, 1.0)
    for entry in bands:
        found = material(name, None if entry == "any" else band(entry))
        reflects_all = min(found.model.HDR(found.surface(), theta)) > 1 - 1e-9
        assert reflects_all == emits_nothing(name)


def test_emits_must_be_true_or_false(user_file):
    own = user_file('[a.any]\nemits = "no"\n')
    with pytest.raises(InputError, match="emits = 'no'; must be true or false"):
        material("a", None, own)


@pytest.mark.parametrize("name", ["gloss_black", "bare_aluminum"])
def test_hemispherical_emissivity(name):
    """1 less the mean of HDR over the squared sine of the angle."""
    entry, MWIR = material(name, band("MWIR")), band("MWIR")
    edges = np.linspace(0, 1, 20_001)
    theta = Float64(np.arcsin(np.sqrt((edges[1:] + edges[:-1]) / 2)))
    mean = entry.model.HDR(entry.surface(), theta).numpy().mean()
    assert hemispherical_emissivity(name, MWIR) == pytest.approx(1 - mean, abs=5e-5)
    assert hemispherical_emissivity("0.3", MWIR) == 0.3


# The tables and the picture of a BRDF show the model's values and its reflectance
# --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, band, theta_i", [("bare_aluminum", "MWIR", 30), ("gloss_black", "LWIR", 60)]
)
def test_values_are_the_models(name, band, theta_i):
    """The values agree with the thesis's equations, in the plane of incidence and outside it.

    The peak lies in the mirror direction.
    """
    view = brdf_view(name, band, theta_i)
    m = view.material
    rows = np.linspace(0, len(view.theta_r) - 1, 9).astype(int)
    columns = np.linspace(0, len(view.azimuth) - 1, 8).astype(int)
    for row in rows:
        for column in columns:
            angles = np.radians([theta_i, view.theta_r[row], 180 - view.azimuth[column]])
            expected = thesis.brdf(np, *angles, *m.values)
            assert view.brdf[row, column] == pytest.approx(expected, rel=1e-6)
    row, column = np.unravel_index(view.brdf.argmax(), view.brdf.shape)
    assert (view.theta_r[row], view.azimuth[column]) == (
        pytest.approx(theta_i, abs=0.1),
        pytest.approx(0, abs=1e-9),
    )
    assert view.cut_theta_r[view.cut.argmax()] == pytest.approx(theta_i, abs=0.1)


def test_the_grid_resolves_the_lobe():
    """The sum of f cos(theta_r) over the picture's nodes is the DHR within 1 %.

    This shows that no peak lies between the nodes.
    """
    view = brdf_view("bare_aluminum", "MWIR", 30)
    theta = np.radians(view.theta_r)
    inner = (
        np.trapezoid(view.brdf, np.radians(view.azimuth), axis=1) * np.cos(theta) * np.sin(theta)
    )
    assert np.trapezoid(inner, theta) == pytest.approx(view.dhr, rel=0.01)
    assert view.dhr + view.emissivity == pytest.approx(1, abs=0.01)


def test_ideal_surfaces():
    diffuse, black = brdf_view("diffuse", "MWIR"), brdf_view("blackbody", "3.5-4.2", 0)
    assert (
        np.allclose(diffuse.brdf, 1 / np.pi)
        and diffuse.dhr == pytest.approx(1)
        and diffuse.emissivity == pytest.approx(0, abs=1e-9)
    )
    assert not black.brdf.any() and (black.dhr, black.emissivity) == (0, 1)
    assert scale(diffuse) == pytest.approx((10**-0.5 / np.pi, 10**0.5 / np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("name, theta_i", [("gloss_black", 75), ("diffuse", 0), ("blackbody", 30)])
def test_picture(tmp_path, name, theta_i):
    """A picture is drawn without a warning, also for a constant BRDF and for one that is 0."""
    brdf_view(name, "LWIR", theta_i).plot(tmp_path / "brdf.png")
    assert (tmp_path / "brdf.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("theta_i", [-1, 90, float("nan")])
def test_angles_beyond_the_hemisphere(theta_i):
    with pytest.raises(InputError, match="must lie in 0..90"):
        brdf_view("diffuse", "MWIR", theta_i)


def test_impossible_parameters(tmp_path):
    (tmp_path / "fit.json").write_text(
        '{"parameters": {"epsilon": 0.9, "rho_d": 0.2, "b": 0, "e": 0.1}, '
        '"form": "thesis", "band": "MWIR"}'
    )
    with pytest.raises(InputError, match="epsilon \\+ rho_d = 1.1"):
        brdf_view(str(tmp_path / "fit.json"), "MWIR")
