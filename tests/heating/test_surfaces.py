"""Materials in the band of heat and of sunlight: their entries, and what stands in for them."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.heating.surfaces import (
    RANDOMISATIONS,
    SOLAR,
    TOTAL,
    Parts,
    Surfaces,
    closed_shapes,
    hemispherical_emissivity,
    solar_areas,
)
from mi_lcair.physics import materials
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.rendering.facets import FacetTable
from tests.heating.scenes import box, emits, grey, scene_of, square

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


def of_coat(um):
    """A step in sunlight, and one in heat."""
    return np.where(um < 1, 0.5, np.where(um < 10, 0.9, 0.2))


def surfaces(folder, name: str, of_band: str, used_in: str = "LWIR") -> tuple[float, list[str]]:
    """The emissivity of a material of FILE in a band, and the remarks."""
    (folder / "own.toml").write_text(FILE)
    rows = "\n".join(f"{um:g},{of_coat(um)}" for um in (0.25, 0.999, 1, 9.99, 10, 50))
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
        (TOTAL, 0.6, "LWIR 8-12 um are used for total, although that band contains only 26%"),
        (SOLAR, 0.4, "SWIR 1-3 um are used for 0.3-2.5, although that band contains only 26%"),
    ],
)
def test_another_entry_stands_in_with_a_remark(tmp_path, of_band, emissivity, remark):
    value, (line,) = surfaces(tmp_path, "partial", of_band)
    assert value == pytest.approx(emissivity, rel=1e-6) and remark in line


def test_a_spectrum_is_averaged_over_room_temperature_and_sunlight(tmp_path):
    value, (line,) = surfaces(tmp_path, "coat", TOTAL)
    um = np.linspace(0.25, 50, 20001)
    weights = spectral_radiance(um, 300.0)
    assert value == pytest.approx(weights @ of_coat(um) / weights.sum(), rel=3e-3)
    assert "material 'coat'" in line
    value, remarks = surfaces(tmp_path, "coat", SOLAR)
    um = np.linspace(0.3, 2.5, 20001)
    weights = spectral_radiance(um, 5772.0)
    assert value == pytest.approx(weights @ of_coat(um) / weights.sum(), rel=3e-3) and not remarks


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
    assert "MWIR 3-5 um are used for total" in made.remarks[0]


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


# Absorbed sunlight: squares, sheets, shadows, and light that other facets reflect
# --------------------------------------------------------------------------------

T = mi.ScalarTransform4f()
UP = np.array([[0.0, 0.0, 1.0]])


def slanted(degrees: float) -> np.ndarray:
    h = np.radians(degrees)
    return np.array([[np.cos(h), 0, np.sin(h)]])


def test_a_square_absorbs_by_the_cosine():
    both = np.concatenate([UP, slanted(30), slanted(-30)])
    areas = solar_areas(scene_of(plate=square(grey(0.7), emitter=emits())), both, 64, 64)
    assert areas.lit.shape == (RANDOMISATIONS, 3, 1)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[:, 0], [4, 2, 0], rtol=1e-5)
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [2.8, 1.4, 0], rtol=1e-5)
    assert np.all(areas.reflected == 0)


def test_a_sheet_is_lit_on_the_side_of_the_sun():
    sheet = square({"type": "twosided", "bsdf": grey(0.7)}, emitter=emits())
    suns = np.concatenate([slanted(30), slanted(-30)])
    areas = solar_areas(scene_of(sheet=sheet), suns, 64, 64)
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [1.4, 1.4], rtol=1e-5)
    # Each side absorbs what comes from its half of the sphere
    assert areas.sky.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)
    assert areas.ground.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)


@pytest.mark.parametrize(("elevation", "absorptance"), [(30, 0.7), (-30, 0.1)])
def test_the_absorptance_of_a_sheet_is_that_of_its_lit_side(elevation, absorptance):
    sides = {"type": "twosided", "front": grey(0.7), "back": grey(0.1)}
    areas = solar_areas(scene_of(sheet=square(sides, emitter=emits())), slanted(elevation), 64, 64)
    assert areas.absorptance == pytest.approx(absorptance, rel=1e-5)
    np.testing.assert_allclose(areas.direct, absorptance * areas.lit, rtol=1e-5)


def test_areas_are_the_same_however_many_suns_a_launch_has(monkeypatch):
    scene = scene_of(plate=square(grey(0.7), emitter=emits()))
    suns = np.concatenate([UP, slanted(30), slanted(60)])
    together = solar_areas(scene, suns, 64, 64).direct
    monkeypatch.setattr("mi_lcair.heating.surfaces.LANES", 1)
    # Sums of a launch are divided among threads, so that rounding depends on their number
    np.testing.assert_allclose(solar_areas(scene, suns, 64, 64).direct, together, rtol=1e-6)


def test_a_roof_casts_its_shadow():
    scene = scene_of(
        floor=square(grey(0.7), emitter=emits("floor")),
        roof=square(
            {"type": "twosided", "bsdf": grey(1.0)},
            T.translate([0, 0, 1]).scale([0.5, 0.5, 1]),
            emitter=emits("roof"),
        ),
    )
    areas = solar_areas(scene, UP, 64, 8192)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[0], [3, 1], rtol=2e-3)


def test_what_one_wall_reflects_another_absorbs():
    """Two squares along an edge: a diffuse floor lights a wall with the view factor 0.2."""
    wall = square(grey(1.0), T.translate([1, 0, 1]).rotate([0, 1, 0], -90), emitter=emits("wall"))
    scene = scene_of(floor=square(grey(0.4), emitter=emits("floor")), wall=wall)
    areas = solar_areas(scene, UP, 32768, 64)
    assert areas.direct.mean(axis=0)[0] == pytest.approx([1.6, 0], abs=1e-5)
    assert areas.reflected.mean(axis=0)[0] == pytest.approx([0, 2.4 * 0.200044], rel=3e-3, abs=1e-6)
    assert areas.onward[[0], [1]] == pytest.approx(0.200044, rel=3e-3)


def test_light_in_a_sheets_lee_does_not_come_through():
    """What the upper side of a sheet reflects does not reach a wall below it."""
    sheet = square({"type": "twosided", "bsdf": grey(0.4)}, emitter=emits("sheet"))
    wall = square(grey(1.0), T.translate([0, 0, -1]), emitter=emits("wall"))
    areas = solar_areas(scene_of(sheet=sheet, wall=wall), UP, 1024, 64)
    assert areas.reflected.max() == 0


def test_what_a_convex_box_reflects_escapes():
    """Half of what its sides absorb of an even surrounding comes from the sky."""
    scene = scene_of(box=box(grey(0.3), inward=False, emitter=emits()))
    areas = solar_areas(scene, UP, 256, 64)
    whole = (areas.sky + areas.ground).mean(axis=0).sum()
    assert whole == pytest.approx(0.3 * 24, rel=1e-5)
    assert areas.sky.mean(axis=0).sum() == pytest.approx(0.3 * 12, rel=1e-2)
    assert areas.reflected.max() == 0 and areas.onward.nnz == 0


# Points of facets that have several unequal triangles, and which shapes are closed
# ---------------------------------------------------------------------------------


def test_points_are_even_over_the_triangles_of_a_facet():
    props = mi.Properties()
    props["mesh_bsdf"], props["mesh_emitter"] = mi.load_dict(grey(0.5)), mi.load_dict(emits())
    mesh = mi.Mesh("model", 5, 3, props=props)
    mesh.add_attribute("face_facet", 1, [0.0, 0.0, 1.0])
    values = mi.traverse(mesh)
    values["vertex_positions"] = [3.0, 2, 0, 4, 2, 0, 3, 3, 0, 13, 22, 0, 20, 20, 1]
    values["faces"] = [0, 1, 2, 1, 3, 2, 1, 4, 3]
    values.update()
    scene = scene_of(model=mesh)
    table, count = FacetTable(scene), 40_000
    parts = Parts.of(table, np.array([0, 1]), list(scene.mi.shapes()))
    u, x, y = (mi.Float(row) for row in np.random.default_rng(0).random((3, 2 * count)))
    facet = dr.arange(mi.UInt32, 2 * count) // count
    points = np.array(parts.point(facet, u, mi.Point2f(x, y)).p).T.reshape(2, count, 3)
    error = points.std(axis=1) / np.sqrt(count)
    assert np.all(abs(points.mean(axis=1) - table.centre[:2]) < 5 * error + 1e-6)


TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


@pytest.mark.parametrize(
    ("triangles", "one_sided", "closed"),
    [
        (TETRAHEDRON, [True, True], [True, True]),
        (TETRAHEDRON[:3], [True, True], [False, False]),
        ([*TETRAHEDRON[:3], TETRAHEDRON[3, ::-1]], [True, True], [False, False]),
        (TETRAHEDRON, [True, False], [False, True]),
    ],
)
def test_a_body_is_closed_if_its_triangles_meet_at_all_edges(triangles, one_sided, closed):
    """Two triangles of a tetrahedron are those of one shape, and the others of another."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])[np.array(triangles)]
    numbers = np.arange(len(triangles))
    table = SimpleNamespace(triangles=corners, triangle_facet=numbers, shape_index=numbers // 2)
    shapes = [SimpleNamespace(class_name=lambda: "Mesh")] * 2
    np.testing.assert_array_equal(closed_shapes(table, shapes, np.array(one_sided)), closed)
