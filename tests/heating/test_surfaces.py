"""Materials in the band of heat and of sunlight: their entries, and what stands in for them."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.heating.surfaces import SOLAR, TOTAL, Surfaces, hemispherical_emissivity
from mi_lcair.physics import materials
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from tests.heating.scenes import emits, scene_of, square

FILE = """
[whole.LWIR]
model = "grey"
emissivity = 0.5
[whole.total]
model = "grey"
emissivity = 0.8
[whole."0.3-2.5"]
model = "grey"
emissivity = 0.3
[partial.LWIR]
model = "grey"
emissivity = 0.6
[partial.SWIR]
model = "grey"
emissivity = 0.4
[coat.spectral]
emissivity = "coat.csv"
[ideal.any]
model = "grey"
emissivity = 0.7
"""


def surfaces(folder, name: str, of_band: str, used_in: str = "LWIR") -> tuple[float, list[str]]:
    """The emissivity of a material of FILE in a band, and the remarks."""
    (folder / "own.toml").write_text(FILE)
    rows = "\n".join(f"{um:g},{0.9 if um < 10 else 0.2}" for um in (0.25, 2, 9.99, 10, 50))
    (folder / "coat.csv").write_text(f"wavelength_um,emissivity\n{rows}\n")
    bsdf = {"type": "material", "material": name, "band": used_in}
    bsdf["materials"] = str(folder / "own.toml")
    emitter = emits() | {"band": used_in}
    made = Surfaces.of(scene_of(plate=square(bsdf, emitter=emitter)), of_band)
    return hemispherical_emissivity(made.different[0]), made.remarks


@pytest.mark.parametrize(
    ("name", "of_band", "emissivity"),
    [("whole", TOTAL, 0.8), ("whole", SOLAR, 0.3), ("ideal", TOTAL, 0.7), ("ideal", SOLAR, 0.7)],
)
def test_the_entry_of_the_band_is_taken(tmp_path, name, of_band, emissivity):
    value, remarks = surfaces(tmp_path, name, of_band)
    assert value == pytest.approx(emissivity, rel=1e-6) and not remarks


@pytest.mark.parametrize(
    ("of_band", "emissivity", "remark"),
    [
        (TOTAL, 0.6, "LWIR 8-12 um stand in for total, although that band holds 26% of the heat"),
        (SOLAR, 0.4, "SWIR 1-3 um stand in for 0.3-2.5, although that band holds 26% of the sunl"),
    ],
)
def test_another_entry_stands_in_with_a_remark(tmp_path, of_band, emissivity, remark):
    value, (line,) = surfaces(tmp_path, "partial", of_band)
    assert value == pytest.approx(emissivity, rel=1e-6) and remark in line


def test_a_spectrum_is_averaged_over_room_temperature(tmp_path):
    value, (line,) = surfaces(tmp_path, "coat", TOTAL)
    um = np.linspace(0.25, 50, 20001)
    emissivity = np.where(um < 10, 0.9, 0.2)
    weights = spectral_radiance(um, 300.0)
    assert value == pytest.approx(weights @ emissivity / weights.sum(), rel=3e-3)
    assert "material 'coat'" in line
    value, remarks = surfaces(tmp_path, "coat", SOLAR)
    assert value == pytest.approx(0.9, rel=1e-6) and not remarks


def test_a_material_with_neither_band_is_refused(tmp_path):
    (tmp_path / "short.toml").write_text('[short.MWIR]\nmodel = "grey"\nemissivity = 0.2\n')
    bsdf = {"type": "material", "material": "short", "band": "MWIR"}
    bsdf["materials"] = str(tmp_path / "short.toml")
    scene = scene_of(plate=square(bsdf, emitter=emits()))
    with pytest.raises(InputError, match="'short': has no entry for the band total or LWIR"):
        Surfaces.of(scene, TOTAL)


def test_numbers_of_a_model_stand_in_for_their_band():
    numbers = {"epsilon": 0.2, "rho_d": 0.05, "b": 0.1, "e": 0.3}
    emitter = emits() | {"band": "MWIR"}
    bsdf = {"type": "sandford_robertson", "id": "rough", **numbers}
    made = Surfaces.of(scene_of(plate=square(bsdf, emitter=emitter)), TOTAL)
    assert "MWIR 3-5 um stand in for total" in made.remarks[0]


@pytest.mark.parametrize(
    ("bsdf", "emitter", "named"),
    [
        ({"emissivity": "model", "id": "paint"}, {}, "bsdf 'paint'"),
        ({}, {"emissivity": 0.5}, "shape 'plate'"),
    ],
)
def test_a_stated_emissivity_that_is_not_used_has_a_remark(bsdf, emitter, named):
    paint = {"type": "material", "material": "gloss_black", "band": "LWIR", **bsdf}
    made = Surfaces.of(scene_of(plate=square(paint, emitter=emits() | emitter)), TOTAL)
    assert any(line.startswith(f"{named}: its emissivity is not used") for line in made.remarks)


def test_a_grey_surface_of_numbers_is_grey_everywhere():
    plate = square({"type": "grey", "emissivity": 0.5}, emitter=emits() | {"band": "MWIR"})
    assert Surfaces.of(scene_of(plate=plate), TOTAL).remarks == []


@pytest.mark.parametrize("sheet", [False, True])
def test_the_hemispherical_emissivity_is_that_of_the_model(sheet):
    bsdf = {"type": "material", "material": "gloss_black", "band": "LWIR"}
    if sheet:
        bsdf = {"type": "twosided", "bsdf": bsdf}
    made = Surfaces.of(scene_of(plate=square(bsdf, emitter=emits())), TOTAL)
    expected = materials.hemispherical_emissivity("gloss_black", band("LWIR"))
    assert hemispherical_emissivity(made.different[0]) == pytest.approx(expected, rel=1e-4)


def test_equal_surfaces_are_one():
    plates = {
        f"p{k}": square({"type": "grey", "emissivity": e}, emitter=emits())
        for k, e in enumerate((0.5, 0.5, 0.7))
    }
    made = Surfaces.of(scene_of(**plates), TOTAL)
    assert made.of_shape == [0, 0, 1] and len(made.different) == 2
