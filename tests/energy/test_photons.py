"""What becomes of photons: tallies, and a plate whose photons all escape."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.energy.photons import BATCHES, PhotonTracer, Tally, follow, scaling_cosines
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.facets.table import FacetTable
from tests.uncertainty.plate_scene import AREA, EMISSIVITY, plate_scene

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
