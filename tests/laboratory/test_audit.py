"""Tests of the energy audit: closed forms, and scenes whose imbalance it must report."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.laboratory.audit import (
    BATCHES,
    Audit,
    FluxAndError,
    PhotonTracer,
    Tally,
    follow,
    scaling_cosines,
)
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.sun import sunlight
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import checked
from tests.knowing.budgets.plate_scene import AREA, EMISSIVITY, plate_scene
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import SQUARE, camera

L_300 = float(in_band_radiance(band("LWIR"), 300.0))
LID = [[-5, -5, 1], [-5, 5, 1], [5, 5, 1], [5, -5, 1]]  # faces down


def audited(photons=2**15, **shapes):
    scene = mi.load_dict(
        {"type": "scene", "integrator": {"type": "bounce_path"}, "sensor": camera(), **shapes},
        optimize=False,
    )
    result = mi_lcair.audit(checked(scene, Path("scene.xml"), {}), photons)
    # The sensor sees the backs of lids, which is told and is not what is audited
    result.remarks[:] = [remark for remark in result.remarks if "are backs" not in remark]
    return result


def agree(figure, expected, sigmas=4):
    value, error = figure
    assert abs(value - expected) <= sigmas * error + 1e-6 * abs(expected), (figure, expected)


def test_open_box():
    """A blackbody wall over a grey floor, against view factors.

    The floor receives the view factor times the wall's flux, and absorbs half of that.
    """
    result = mi_lcair.audit(mi_lcair.load("open_box"), 2**16)
    wall, floor = (0.02 * np.pi * float(in_band_radiance(band("total"), T)) for T in (800, 300))
    F = 0.24063600617696168
    agree(result.total["emitted"], wall + 0.5 * floor)
    agree(result.materials["diffuse"]["incident"], F * wall)
    agree(result.materials["diffuse"]["absorbed"], 0.5 * F * wall)
    # More than the share F of what the floor reflects returns to the wall, because most of it
    # leaves from near the common edge.
    assert (
        F * (0.5 * floor + 0.5 * F * wall)
        < result.materials["blackbody"]["absorbed"][0]
        < 1.5 * F * (0.5 * floor + 0.5 * F * wall)
    )
    agree(result.total["balance"], 0)
    assert result.remarks == []


def test_what_each_reflection_adds():
    """In a sphere of reflectance 1/2 with the opening f, (1/2 (1 - f))^k leaves after the k-th."""
    result = mi_lcair.audit(mi_lcair.load("cavity", opening=8), 2**16)
    assert len(result.by_reflection) == 8
    for number, (value, error) in enumerate(result.by_reflection, start=1):
        expected = (0.5 * (1 - 0.030902)) ** number
        agree((value, error), expected)
        assert error < 0.1 * expected


@pytest.mark.parametrize("tau", [0.25, 0.9])
def test_plume_emits_what_it_absorbs(plate, tau):  # noqa: F811
    """A sheet of plume over a black plate: both sides of it emit, and flux passes it."""
    result = audited(
        plate=plate(
            "plate",
            SQUARE,
            {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
            300.0,
            group="ground",
        ),
        sheet=plate("sheet", LID, {"type": "plume", "transmittance": tau}, 300.0, group="plume"),
    )
    flux = 100 * np.pi * L_300
    agree(result.total["emitted"], flux * (1 + 2 * (1 - tau)))
    agree(result.total["balance"], 0)
    agree(result.total["created"], 0)
    incident = result.materials["plume"]["incident"][0]
    assert result.materials["plume"]["absorbed"][0] == pytest.approx((1 - tau) * incident)
    assert result.materials["plume"]["reflected"][0] == pytest.approx(tau * incident)
    assert result.total["behind"][0] == 0


@pytest.mark.slow
def test_closed_room_keeps_everything():
    result = mi_lcair.audit(mi_lcair.load("furnace"), 2**15)
    assert (
        result.total["escaped"] == (0, 0)
        and result.total["behind"] == (0, 0)
        and result.remarks == []
    )
    agree(result.total["absorbed"], result.total["emitted"][0] + result.total["created"][0], 5)
    agree(result.total["balance"], 0)


@pytest.mark.slow
def test_a_mesh_turned_inside_out_keeps_its_flux():
    """A cube with flip_normals emits inward: nothing escapes, half of what arrives is absorbed."""
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    result = audited(
        room={
            "type": "cube",
            "flip_normals": True,
            "bsdf": grey,
            "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
        }
    )
    assert result.shares["scene"]["escaped"][0] < 1e-4 and result.shares["SmoothDiffuse"][
        "absorbed"
    ] == pytest.approx((0.5, 0), abs=1e-5)
    agree(result.total["emitted"], 0.5 * 24 * np.pi * L_300)
    agree(result.total["absorbed"], result.total["emitted"][0], 5)


def test_a_surface_of_unknown_absorption_is_refused(plate):
    black = {"type": "sandford_robertson", "epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0}
    lens = {**plate("lens", LID, {"type": "dielectric"})}
    with pytest.raises(
        InputError,
        match="shape lens has no emitter, and its absorption is not known .*; give it another BSDF",
    ):
        audited(floor=plate("floor", SQUARE, black, 300.0), lens=lens)


def test_a_reflector_that_absorbs_nothing(plate):
    """A plate of reflectance 1 neither absorbs nor emits; a black plate does both."""
    white = {"type": "sandford_robertson", "epsilon": 0.0, "rho_d": 1.0, "b": 0.0, "e": 1.0}
    black = {"type": "sandford_robertson", "epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0}
    result = audited(
        floor=plate("floor", SQUARE, black, 300.0), lid=plate("lid", LID, white, 300.0)
    )
    agree(result.total["emitted"], 100 * np.pi * L_300)
    agree(result.total["absorbed"], result.total["emitted"][0] - result.total["escaped"][0], 5)
    # Neither material has a name. The audit appends the names of their shapes.
    assert sorted(name.partition(" (")[2] for name in result.materials) == ["floor)", "lid)"]
    assert abs(result.total["created"][0]) < 1e-6 * result.total["emitted"][0]


def test_emissivity_of_another_origin_creates_energy(plate):
    """A lid of reflectance 0.5 and emissivity 0.9 absorbs and reflects 1.4 of what arrives."""
    black = {"type": "sandford_robertson", "epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0}
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    lid = plate("lid", LID, grey, 300.0)
    lid["emitter"]["emissivity"] = 0.9
    result = audited(floor=plate("floor", SQUARE, black, 300.0), lid=lid)
    assert any(
        "SmoothDiffuse creates" in remark
        and "facets 2, 3" in remark.replace("facets 3, 2", "facets 2, 3")
        for remark in result.remarks
    )
    grey = result.materials["SmoothDiffuse"]
    assert grey["created"][0] == pytest.approx(0.4 * grey["incident"][0], rel=1e-5)
    agree(result.total["balance"], 0, 5)


def test_what_only_reflects_absorbs_the_rest(plate):
    """A lid without an emitter, with a BSDF of Mitsuba's, absorbs what it does not reflect."""
    black = {"type": "sandford_robertson", "epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0}
    lid = plate(
        "lid", LID, {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}, 300.0
    )
    del lid["emitter"]
    result = audited(floor=plate("floor", SQUARE, black, 300.0), lid=lid)
    grey = result.materials["SmoothDiffuse"]
    assert result.shares["SmoothDiffuse"]["absorbed"] == pytest.approx((0.5, 0), abs=1e-5)
    assert result.remarks == [] and grey["absorbed"][0] == pytest.approx(
        0.5 * grey["incident"][0], rel=1e-5
    )


@pytest.mark.slow
def test_one_creates_what_another_loses(plate):
    """Two grey plates with the same BSDF class, one emitting too much and one too little.

    The audit names each of them, and their shares are exact.
    """

    def grey(name, corners, emissivity):
        shape = plate(
            name,
            corners,
            {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}},
            300.0,
        )
        shape["emitter"]["emissivity"] = emissivity
        return shape

    result = audited(floor=grey("floor", SQUARE, 0.7), lid=grey("lid", LID, 0.3))
    assert [remark.split()[3] for remark in sorted(result.remarks)] == ["creates", "loses"]
    assert [
        set(remark.rpartition("facets ")[2].split(", ")) for remark in sorted(result.remarks)
    ] == [{"0", "1"}, {"2", "3"}]
    for shape, created in (("floor", 0.2), ("lid", -0.2)):
        value, error = result.shares[f"SmoothDiffuse ({shape})"]["created"]
        assert value == pytest.approx(created, abs=1e-5) and error < 1e-5


@pytest.mark.slow
def test_emissivity_of_the_model_loses_energy(plate):
    """The thesis's form with emissivity = model loses energy.

    d(theta_r) reduces the lobe, and the emissivity does not grow by the same amount.
    """
    glossy = {
        "type": "sandford_robertson",
        "epsilon": 0.2,
        "rho_d": 0.01,
        "b": 0.4,
        "e": 0.3,
        "emissivity": "model",
    }
    result = audited(
        floor=plate("floor", SQUARE, glossy, 300.0), lid=plate("lid", LID, glossy, 300.0)
    )
    assert any("loses" in remark for remark in result.remarks)
    agree(result.total["balance"], 0, 5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameters",
    [
        {"alpha": 0.3, "gamma": 2.0, "n": 10.0, "k": 30.0, "rho_d": 0.0},
        {"alpha": 0.4, "gamma": 3.0, "n": 1.4, "k": 0.2, "rho_d": 0.3},
    ],
    ids=["metal", "paint"],
)
def test_a_reciprocal_model_creates_nothing(plate, parameters):
    """Emissivity + DHR = 1 in each direction, so that no energy is created or lost.

    Between two near plates much arrives at grazing angles.
    """
    surface = {"type": "microfacet", **parameters}
    floor, lid = plate("floor", SQUARE, surface, 300.0), plate("lid", LID, surface, 350.0)
    result = audited(2**16, floor=floor, lid=lid)
    created, error = result.shares["bsdf"]["created"]
    assert abs(created) <= 4 * error and error < 2e-3
    agree(result.total["balance"], 0)
    assert all("hits other facets" in remark for remark in result.remarks)  # of the paint itself


def test_the_void_around_a_surface_is_named(plate):
    """A surface that reflects and stands alone has a remark, in a room that surrounds it none."""
    paint = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    result = audited(2**6, floor=plate("floor", SQUARE, paint, 300.0))
    assert len(result.remarks) == 1 and "100 % of the target's reflections" in result.remarks[0]
    assert "see nothing (0 K)" in result.as_dict()["remarks"][0]


@pytest.mark.slow
def test_a_scaled_brdf_is_named(plate):
    """A BRDF whose HDR would exceed 1 near grazing (b = 0.05, e = 0.3) is reported.

    Much of the flux between two near plates arrives there.
    """
    broad = {
        "type": "sandford_robertson",
        "epsilon": 0.02,
        "rho_d": 0.02,
        "b": 0.05,
        "e": 0.3,
        "form": "normalized",
    }
    shapes = {"floor": plate("floor", SQUARE, broad, 300.0), "lid": plate("lid", LID, broad, 300.0)}
    result = audited(2**11, **shapes)
    assert any(
        "scaled down at grazing" in remark and "facets" in remark for remark in result.remarks
    )


def test_the_back_of_a_surface_is_named(plate):
    black = {"type": "sandford_robertson", "epsilon": 1.0, "rho_d": 0.0, "b": 0.0, "e": 1.0}
    result = audited(
        floor=plate("floor", SQUARE, black, 300.0), lid=plate("lid", LID[::-1], black, 300.0)
    )
    assert any(
        "the back of one-sided surfaces; most at facets" in remark for remark in result.remarks
    )
    agree(result.total["balance"], 0)


@pytest.mark.slow
def test_a_perfect_closed_reflector_is_unfinished(monkeypatch):
    """In a closed room of reflectance 1 no flux is absorbed, and the audit says so."""
    monkeypatch.setattr("mi_lcair.laboratory.audit.MAX_REFLECTIONS", 20)
    scene = mi_lcair.load("furnace")
    parameters = mi.traverse(scene.mi)
    for key in parameters.keys():  # noqa: SIM118, Mitsuba's parameters are no dictionary
        if key.endswith(("bsdf.epsilon", "body.epsilon", "bsdf.emissivity")):
            parameters[key] = 1e-4
        elif key.endswith(("bsdf.rho_d", "body.rho_d")):
            parameters[key] = 0.9
    parameters.update()
    result = mi_lcair.audit(scene, 2**12)
    assert any("still travels after 20 reflections" in remark for remark in result.remarks)


def test_command(run_audit):
    text = run_audit("two_plates", "--paths", "4096")
    assert "emitted" in text and "balance" in text and "no warnings" in text


@pytest.fixture
def run_audit():
    from click.testing import CliRunner

    from mi_lcair.cli import main

    def run(*arguments):
        result = CliRunner().invoke(main, ["audit", *arguments])
        assert result.exit_code == 0, result.output
        return result.stdout

    return run


def test_other_emitters_are_refused(plate):
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    lamp = {
        **plate("lamp", LID, black),
        "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
    }
    with pytest.raises(InputError, match="only the flux of thermal emitters"):
        audited(floor=plate("floor", SQUARE, black, 300.0), lamp=lamp)


@pytest.mark.slow
@pytest.mark.parametrize("with_sky", [False, True])
def test_sunlight_is_absorbed_or_escapes(plate, with_sky):
    """A grey plate in sunlight absorbs (1 - rho) E cos A; the sky lets the sunlight in."""
    sun = {"type": "sun", "elevation_deg": 40.0, "azimuth_deg": 70.0, "band": "LWIR"}
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.3}}
    shapes = {"floor": plate("floor", SQUARE, grey, 1.0), "sun": sun}
    if with_sky:
        shapes["sky"] = {
            "type": "cube",
            "to_world": mi.ScalarTransform4f().scale(40),
            "flip_normals": True,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
            "emitter": {"type": "thermal", "band": "LWIR", "temperature": 1.0, "facet_type": "sky"},
        }
    result = audited(2**14, **shapes)
    E = sunlight().in_band_radiance(band("LWIR"))
    on_plate = E * np.sin(np.radians(40)) * 100
    disc = np.pi * 50 * (1 + 2 * np.tan(np.radians(0.265))) ** 2
    assert result.total["emitted"][0] == pytest.approx(E * disc, rel=1e-4)
    incident = sum(flux["incident"][0] for flux in result.materials.values())
    reflected = 0.3 * on_plate if with_sky else 0.0  # arrives at the sky
    error = 4 * result.total["escaped"][1]
    assert incident == pytest.approx(on_plate + reflected, abs=error)
    assert result.total["escaped"][0] == pytest.approx(
        E * disc - on_plate + (0 if with_sky else 0.3 * on_plate), abs=error
    )
    agree(result.total["balance"], 0)


def test_irradiance_and_exitance_by_facet():
    """The two plates: irradiance by the view factor, and the exitance of the reflector the same."""
    columns = mi_lcair.audit(mi_lcair.load("two_plates", band="total"), 2**16).facets
    black = 5.670374419e-8 * 800**4
    received = 22.0755 * np.pi / 0.02  # intensity of the diffuse reflector, normal to it
    reflector, emitter = 0, 1
    expected = {
        "irradiance": {reflector: received},
        "exitance": {reflector: received, emitter: black},
        "emitted": {reflector: 0.0, emitter: black},
    }
    for name, facets in expected.items():
        for facet, value in facets.items():
            error = columns[f"{name}_standard_error_W_m2"][facet]
            agree((columns[f"{name}_W_m2"][facet], error), value, sigmas=5)
            assert error < 0.02 * max(value, 1)
    np.testing.assert_allclose(columns["area_m2"], 0.02, rtol=1e-6)


# What becomes of photons: tallies, and a plate whose photons all escape
# ----------------------------------------------------------------------

mi.set_variant("llvm_ad_mono")


def test_a_tally_adds():
    tally = Tally.of(3)
    batch, facet = np.array([0, 0, 7, 0]), np.array([1, 1, 2, 0])
    for _ in range(2):
        tally.add("absorbed", batch, facet, np.array([1.0, 2.0, 4.0, 8.0]))
    expected = np.zeros((BATCHES, 3))
    expected[0, :2], expected[7, 2] = (16, 6), 8
    np.testing.assert_array_equal(tally.by_facet.absorbed, expected)
    assert not tally.by_facet.emitted.any()
    tally.end("escaped", batch, np.ones(4))
    assert tally.ends["escaped"].tolist() == [3, 0, 0, 0, 0, 0, 0, 1]
    flux = tally.by_facet
    flux.reflected[0, 0], flux.behind[0, 0], flux.incident[0, 0] = 3.0, 2.0, 20.0
    assert flux.created[0, 0] == 16 + 3 + 2 - 20


def test_a_plate_emits_and_loses_all(tmp_path):
    """eps A pi B(T) escapes: a flux over the hemisphere of a Lambertian source."""
    scene = plate_scene(tmp_path)
    table = FacetTable(scene)
    tally = Tally.of(table.count)
    with scene.prepared():
        follow(PhotonTracer(scene, table), scene.mi.emitters()[0], 2**14, 0, tally)
    expected = EMISSIVITY * AREA * np.pi * float(in_band_radiance(band("LWIR"), 310.0))
    emitted = tally.by_facet.emitted.sum()
    assert emitted == pytest.approx(expected, rel=0.02)  # half of the photons are at the back
    assert tally.ends["escaped"].sum() == pytest.approx(emitted, rel=1e-6)
    assert not tally.by_facet.incident.any()


def test_angles_of_scaled_brdfs():
    """Bare aluminium in its normalized form has an HDR of 1 before 90 degrees; black paint none."""
    scene = mi_lcair.load("furnace")
    table = FacetTable(scene)
    cosines = scaling_cosines(scene, table)
    for surface in scene.surfaces():
        angle = surface.first_saturated_angle_deg()
        expected = 0.0 if angle is None else np.cos(np.radians(angle))
        assert cosines[table.material == surface.material] == pytest.approx(expected)


# Words and tables of an audit
# ----------------------------

FLUX = {"incident": FluxAndError(50.0, 2.0), "absorbed": FluxAndError(30.0, 1.0)}
AUDIT = Audit(
    scene_name="room",
    band="LWIR",
    total={"emitted": FluxAndError(100.0, 1.0), "balance": FluxAndError(0.5, 0.2)},
    materials={"paint": FLUX},
    shares={
        "scene": {"emitted": FluxAndError(1.0, 0.0), "balance": FluxAndError(0.005, 0.002)},
        "paint": {"incident": FluxAndError(1.0, 0.0), "absorbed": FluxAndError(0.6, 0.01)},
    },
    remarks=[],
    photons=1000,
)


@pytest.mark.parametrize("paths", [0, -8, "many"])
def test_numbers_of_paths_that_cannot_be_used(paths):
    with pytest.raises(InputError, match=f"paths = {paths!r}; must be "):
        mi_lcair.audit("open_box", paths=paths)


def test_summary():
    assert AUDIT.summary() == (
        "audit of room, LWIR: 100 +- 1 W emitted, balance 0.5 +- 0.2 % of it (standard errors), "
        "no warnings"
    )


def test_entries_and_rows():
    entries = AUDIT.as_dict()
    assert entries["total_W"]["balance"] == {"value": 0.5, "standard_error": 0.2}
    assert entries["materials_W"]["paint"]["absorbed"] == {"value": 30.0, "standard_error": 1.0}
    assert entries["shares"]["paint"]["absorbed"] == {"value": 0.6, "standard_error": 0.01}
    assert all(len(column) == 4 for column in AUDIT.columns().values())
    assert np.isfinite(
        np.concatenate([c for c in AUDIT.columns().values() if c.dtype == float])
    ).all()
