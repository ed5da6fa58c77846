"""Exchange of heat against closed forms: plates, spheres, cubes, sky, and what is refused."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.heating.exchange import exchange
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.rendering.facets import FacetTable
from tests.heating.radiosity import extrapolated_cube
from tests.heating.scenes import (
    between,
    box,
    cube_of,
    emits,
    grey,
    mirror_box,
    rings_of,
    scene_of,
    spheres,
    square,
)
from tests.scenes.view_factors import parallel

T = mi.ScalarTransform4f()
OTHER_DIAGONAL = T.rotate([1, 0, 0], 180)  # turns a square over
SAME_DIAGONAL = OTHER_DIAGONAL @ T.rotate([0, 0, 1], 90)


@pytest.mark.parametrize(("e1", "e2"), [(0.9, 0.9), (0.5, 0.2), (0.1, 0.1)])
def test_plates_between_mirrors_are_infinite_plates(e1, e2):
    result = exchange(scene_of(**mirror_box(e1, e2)), rays=8192)
    assert between(result, "lower", "upper") == pytest.approx(4 / (1 / e1 + 1 / e2 - 1), rel=1e-4)


def test_concentric_diffuse_spheres():
    result = exchange(spheres(grey(0.5), grey(0.3)), rays=65536)
    A1, A2 = 4 * np.pi, 16 * np.pi
    expected = A1 / (1 / 0.5 + A1 / A2 * (1 / 0.3 - 1))
    assert between(result, "inner", "outer") == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize("is_flipped", [False, True])
def test_a_turned_sphere_exchanges_as_it_does_unturned(is_flipped):
    """All that it emits outward reaches the surroundings, and all that it emits inward itself."""
    turn = T.translate([3, -2, 1]).rotate([0, 0, 1], 70).rotate([1, 0, 0], 40).scale(0.2)
    ball = {"type": "sphere", "to_world": turn, "flip_normals": is_flipped, "bsdf": grey(0.7)}
    result = exchange(scene_of(ball=ball | {"emitter": emits()}), rays=1024)
    C, emitted = result.conductors, result.facets.emitting_area
    reached, other = (
        (C.parts["itself"], C.outward) if is_flipped else (C.outward, C.parts["itself"])
    )
    assert reached == pytest.approx(emitted, rel=1e-4)
    assert other == 0


def test_a_disc_that_faces_up_sees_the_sky():
    result = exchange(scene_of(disc={"type": "disk", "bsdf": grey(0.7), "emitter": emits()}), 64)
    C = result.conductors
    assert C.to_sky.sum() == pytest.approx(0.7 * np.pi, rel=1e-5) and C.to_ground.sum() == 0


def test_a_mirror_around_a_sphere_acts_as_a_plate():
    result = exchange(spheres(grey(0.5), grey(0.3, lobe="mirror")), rays=131072)
    expected = 4 * np.pi / (1 / 0.5 + 1 / 0.3 - 1)
    assert between(result, "inner", "outer") == pytest.approx(expected, rel=4e-5)


def test_an_enclosure_keeps_what_it_emits():
    result = exchange(scene_of(box=box(grey(0.3), emitter=emits())), rays=2048)
    kept = result.conductors.total
    assert kept.sum() == pytest.approx(0.3 * 24, rel=1e-4)
    assert result.conductors.to_sky.sum() + result.conductors.to_ground.sum() == 0


def test_paths_that_end_at_random_keep_the_means(monkeypatch):
    scene = scene_of(box=box(grey(0.3), emitter=emits()))
    monkeypatch.setattr("mi_lcair.heating.surfaces.FAINT", 1.0)  # at each reflection
    result = exchange(scene, rays=4096)
    (error,) = result.traced.standard_error(lambda C: np.array([C.total.sum()]))
    total = result.conductors.total.sum()
    assert abs(total - 0.3 * 24) < 4 * error < 0.01 * total


def test_what_is_left_after_the_last_reflection_is_told():
    """Each of 10,000 reflections absorbs 1e-5, which Float32 rounds by up to 3e-8."""
    result = exchange(scene_of(box=box(grey(1e-5), emitter=emits())), rays=64)
    kept = result.conductors.total.sum() / (1e-5 * 24)
    assert kept == pytest.approx(-np.expm1(-0.1), rel=6e-3)
    assert "90.5% of its radiation is left after 10000 reflections" in result.remarks[0]


def test_conductors_are_the_same_however_many_paths_a_launch_has(monkeypatch):
    scene = scene_of(box=box(grey(0.3), emitter=emits()))
    whole = exchange(scene, rays=64).conductors
    monkeypatch.setattr("mi_lcair.heating.surfaces.LANES", 100)
    monkeypatch.setattr("mi_lcair.heating.surfaces.PILOT", 100)
    monkeypatch.setattr("mi_lcair.heating.surfaces.SLOTS", 1000)
    parts = exchange(scene, rays=64).conductors
    np.testing.assert_allclose(parts.between.toarray(), whole.between.toarray(), rtol=1e-12)


def test_a_scene_that_does_not_fit_into_memory_is_refused_early(monkeypatch):
    scene = scene_of(box=box(grey(0.3), emitter=emits()))
    monkeypatch.setattr("mi_lcair.heating.surfaces.PILOT", 512)
    monkeypatch.setattr("mi_lcair.heating.surfaces.LANES", 512)
    needed = 150 * 8 * 12 * 11  # numbers between 12 facets, of which 2 lie in each plane
    monkeypatch.setattr("mi_lcair.rendering.measurands.available_memory", lambda: 1.1 * needed)
    exchange(scene, rays=512)
    monkeypatch.setattr("mi_lcair.rendering.measurands.available_memory", lambda: 0.5 * needed)
    with pytest.raises(InputError, match="exchange of 12 facets with 512 paths each needs 0.0 GiB"):
        exchange(scene, rays=512)


def test_view_factors_of_a_black_cube():
    scene = scene_of(box=box(grey(1.0), emitter=emits()))
    result = exchange(scene, rays=131072)
    normal = np.round(FacetTable(scene).normal).astype(int)
    GR = result.conductors.between.toarray()
    faces = np.unique(normal, axis=0)
    of_face = np.array([(normal == face).all(axis=1) for face in faces], dtype=float)
    F = of_face @ GR @ of_face.T / 4
    opposite = faces @ faces.T == -1
    beside = faces @ faces.T == 0
    np.testing.assert_allclose(F[opposite], 0.199825, rtol=1e-3)
    np.testing.assert_allclose(F[beside], 0.200044, rtol=1e-3)


def test_unlike_faces_of_a_grey_cube_exchange_as_by_fine_radiosity():
    emissivities = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 0.2])
    traced = exchange(scene_of(**cube_of(emissivities)), rays=16384).traced
    pairs = np.triu_indices(6, 1)
    error = traced.standard_error(lambda C: C.between.toarray()[pairs])
    expected = extrapolated_cube(emissivities)[pairs]
    z = (traced.mean.between.toarray()[pairs] - expected) / error
    assert np.all(error < 0.02 * expected)
    assert np.mean(z**2) < 3  # 1.4 for Student's distribution with 7 degrees of freedom


def test_a_square_that_faces_up_sees_the_rings_of_the_sky():
    result = exchange(scene_of(plate=square(grey(0.8), emitter=emits())), rays=8192)
    expected = 0.8 * 4 * rings_of(lambda h: np.sin(h) ** 2, RINGS_DEG)
    np.testing.assert_allclose(result.conductors.to_sky[0], expected, atol=2e-3)
    assert result.conductors.to_ground[0] == 0


def test_errors_where_the_randomisations_agree():
    """A square that faces down, tilted, sees hardly any sky; few paths, or none, meet it."""
    tilted = scene_of(plate=square(grey(0.3), T.rotate([1, 0, 0], 160), emitter=emits()))
    share, E = (1 + np.cos(np.radians(160))) / 2, []
    for seed in range(40):
        E.append(np.ravel(exchange(tilted, 64, seed, sky_K=350.0, ground_K=200.0).irradiance))
    value, error = np.transpose(E)
    exact = STEFAN_BOLTZMANN * (share * 350.0**4 + (1 - share) * 200.0**4)
    assert np.mean(abs(value - exact) < 2.36 * error) >= 0.9
    least = STEFAN_BOLTZMANN * 1.5 / 64 * (350.0**4 - 200.0**4)
    assert error.min() == pytest.approx(least, rel=1e-5)


def test_a_sheet_radiates_from_both_sides():
    sheet = square({"type": "twosided", "bsdf": grey(0.8)}, T.rotate([1, 0, 0], 90))
    result = exchange(scene_of(sheet=sheet | {"emitter": emits()}), rays=8192)
    C = result.conductors
    assert result.facets.sides.tolist() == [2]
    assert C.to_sky.sum() == pytest.approx(0.8 * 4, rel=1e-3)
    assert C.to_ground.sum() == pytest.approx(0.8 * 4, rel=1e-3)
    # Vertical: half of the hemisphere is sky, in rings of (2 h + sin 2h) / pi from the horizon
    expected = 3.2 * rings_of(lambda h: (2 * h + np.sin(2 * h)) / np.pi, RINGS_DEG)
    np.testing.assert_allclose(C.to_sky[0], expected, atol=6e-3)


def test_what_is_inside_a_body_is_buried():
    other = box(grey(0.5), inward=False, to_world=T.translate([1, 1, 1]))
    scene = scene_of(
        a=box(grey(0.5), inward=False, emitter=emits("a")), b=other | {"emitter": emits("b")}
    )
    result = exchange(scene, rays=2048)
    # A quarter of each of three of the six faces
    buried = (result.astray["buried"] * result.facets.area).sum() / result.facets.area.sum()
    assert buried == pytest.approx(0.125, rel=1e-2)


def test_an_open_shell_that_is_seen_from_behind_is_refused():
    plates = {
        "below": square(grey(0.8), emitter=emits("below")),
        "above": square(grey(0.8), T.translate([0, 0, 1]), emitter=emits("above")),
    }
    with pytest.raises(
        InputError, match=r"4[0-5]\.\d+% of .* group below .* 'above': its BSDF is one"
    ):
        exchange(scene_of(**plates), rays=256)


def test_a_surface_that_absorbs_and_does_not_emit_is_refused():
    scene = scene_of(
        below=square(grey(0.8), emitter=emits("below")),
        above=square(grey(0.5), T.translate([0, 0, 1]).rotate([1, 0, 0], 180)),
    )
    with pytest.raises(InputError, match="shape 'above': it does not emit"):
        exchange(scene, rays=256)


def test_a_facet_without_area_is_refused():
    mesh = mi.Mesh("flat", 3, 1, props=properties(grey(0.5), emits()))
    values = mi.traverse(mesh)
    values["vertex_positions"] = [0.0, 0, 0, 1, 0, 0, 2, 0, 0]
    values["faces"] = [0, 1, 2]
    values.update()
    with pytest.raises(InputError, match="facet 0 of shape 'flat' has no area"):
        exchange(scene_of(flat=mesh, plate=square(grey(0.8), emitter=emits())), rays=64)


def properties(bsdf: dict, emitter: dict):
    values = mi.Properties()
    values["mesh_bsdf"], values["mesh_emitter"] = mi.load_dict(bsdf), mi.load_dict(emitter)
    return values


def test_a_plume_that_transmits_is_refused():
    plume = square({"type": "plume", "transmittance": 0.5}, emitter=emits("plume"))
    with pytest.raises(InputError, match="shape 'plume': the transmittance of a plume"):
        exchange(scene_of(plume=plume), rays=256)


def strip_between(surface: dict):
    """A plate between a black strip above its middle and a black wall behind its edge."""
    above = T.translate([0.3, 0, 0.7]).rotate([1, 0, 0], 180).scale([0.3, 1, 1])
    beside = T.translate([-1, 0, 0.3]).rotate([0, 1, 0], 90).scale([0.3, 1, 1])
    return scene_of(
        plate=square(surface, emitter=emits("plate")),
        strip=square(grey(1.0), above, emitter=emits("strip")),
        wall=square(grey(1.0), beside, emitter=emits("wall")),
    )


@pytest.mark.parametrize(("e", "is_remarked"), [(0.005, False), (0.6, True)])
def test_a_rough_lobe_that_is_not_reciprocal_gets_a_remark(e, is_remarked):
    """Strip and wall exchange heat through the plate, from which one sees the other."""
    numbers = {"epsilon": 0.2, "rho_d": 0.05, "b": 0.1, "e": e}
    result = exchange(strip_between({"type": "sandford_robertson", **numbers}), rays=65536)
    assert any("not reciprocal" in remark for remark in result.remarks) == is_remarked
    (GR, error), scatter = (
        result.between_groups(),
        result.by_group(lambda C: C.between.toarray())[1],
    )
    assert (error > 1.5 * scatter).any() == is_remarked
    assert np.all(
        error >= is_remarked * (result.asymmetry.z > 4) * result.asymmetry.relative * GR / 2
    )


@pytest.mark.parametrize("turn", [SAME_DIAGONAL, OTHER_DIAGONAL])
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("gap", [0, 1e-5])
def test_a_sheet_of_two_facets_back_to_back(turn, is_first, gap):
    """Squares of 2 m above and below it: each sees one side, whichever facet comes first."""
    front = square(grey(1.0), emitter=emits("front"))
    back = square(grey(1.0), T.translate([0, 0, -gap]) @ turn, emitter=emits("back"))
    above, below = T.translate([0, 0, 1]) @ turn, T.translate([0, 0, -2])
    sheet = {"front": front, "back": back} if is_first else {"back": back, "front": front}
    result = exchange(
        scene_of(
            **sheet,
            above=square(grey(1.0), above, emitter=emits("above")),
            below=square(grey(1.0), below, emitter=emits("below")),
        ),
        rays=8192,
    )
    factors, errors = result.between_groups()
    side = np.array([-1.0, 1.0, -1.0, 1.0])
    F1, F2 = (4 * parallel(side, side, distance) for distance in (1, 2))
    assert result.facets.groups == ("above", "back", "below", "front")
    expected = np.array([[0, 0, 0, F1], [0, 0, F2, 0], [0, F2, 0, 0], [F1, 0, 0, 0]])
    assert np.all(np.abs(factors - expected) <= 3 * errors + 1e-12)
    assert result.remarks == ()
