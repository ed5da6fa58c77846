"""The scenes with imported models.

Their files are as built, the observers are at the stated places, the range is closed, and the sky
has the spectra of its table.
"""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair import scenes
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.sky import spectrum
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.window import window
from mi_lcair.scenes.build.__main__ import main


@pytest.mark.slow
def test_models_are_as_built(tmp_path):
    """Every file in scenes/models equals what `python -m mi_lcair.scenes.build` writes."""
    main(tmp_path)
    built = {
        path.relative_to(tmp_path): path.read_bytes()
        for path in tmp_path.rglob("*")
        if path.is_file()
    }
    bundled = scenes.FOLDER / "models"
    assert built == {
        path.relative_to(bundled): path.read_bytes()
        for path in bundled.rglob("*")
        if path.is_file()
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    "position, distance, sideways", [(1, 1119, 500), (2, 510, 500), (3, 1128, 500)]
)
def test_positions(position, distance, sideways):
    """The observer is at the ranges of the thesis (3.8.3).

    It is 2 km from the threshold, 500 m to the side, and on the ground below the aircraft.
    """
    *_, view = window(mi_lcair.load("a340_landing", position=position, resolution=4).sensor(0))
    out, height = {1: (1000, 50), 2: (2000, 100), 3: (3000, 150)}[position]
    # Position relative to the aircraft, which heads for the threshold, +x.
    observer = np.array([out - 2000, sideways, -height])
    assert np.linalg.norm(observer) == pytest.approx(distance, abs=0.5)
    np.testing.assert_allclose(-view, observer / np.linalg.norm(observer), atol=1e-5)


def isothermal(scene, temperature):
    """Set every facet of the scene to one temperature."""
    parameters = mi.traverse(scene.mi)
    for key in parameters.keys():  # noqa: SIM118  SceneParameters is no dict
        if (
            key[0].endswith("face_temperature")
            if isinstance(key, tuple)
            else key.endswith("face_temperature")
        ):
            parameters[key] = np.full(len(parameters[key]), temperature, dtype=np.float32)
    parameters.update()
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    "finish, lobe",
    [("bare_aluminum", "brdf"), ("gloss_black", "brdf"), ("bare_aluminum", "mirror")],
)
def test_isothermal_range_is_a_blackbody(finish, lobe):
    """At one temperature model and walls have the blackbody's radiance for every reflection model.

    No energy is lost and none is created.
    """
    scene = isothermal(
        mi_lcair.load("cylinder_ir_range", finish=finish, lobe=lobe, max_bounces=32, resolution=32),
        280.0,
    )
    image = mi_lcair.render(scene, spp=128).channels["Y"].astype(float)
    expected = in_band_radiance(band("LWIR"), 280.0)
    assert image.mean() == pytest.approx(expected, rel=5e-4)
    assert np.abs(image / expected - 1).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("band_name", ["MWIR", "LWIR"])
@pytest.mark.parametrize("sky", ["us_standard_clear", "midlat_summer_altostratus"])
def test_the_sky_has_its_table_s_radiance(sky, band_name):
    """Each ring has the radiance of the table at the elevation of its middle.

    The terrain is a blackbody at 302.5 K.
    """
    scene = mi_lcair.load("a340_landing", sky=sky, band=band_name, resolution=4)
    with scene.prepared(by_spectrum=True) as tracer:
        sources = tracer.emitters.sources.list
    sky_radiance = {source.name: source.in_band for source in sources if source.group == "sky"}
    expected = {
        f"{sky} {k}.5 deg": spectrum(sky, k + 0.5).in_band_radiance(band(band_name))
        for k in range(4, 90, 9)
    }
    assert sky_radiance == pytest.approx(expected, rel=1e-6)
    others = {
        source.group: (source.temperature, source.in_band)
        for source in sources
        if source.group != "sky"
    }
    assert {group: T for group, (T, _) in others.items()} == {
        "self": 300,
        "plume": 500,
        "hot_parts": 800,
        "terrain": 302.5,
    }
    assert others["terrain"][1] == pytest.approx(
        float(in_band_radiance(band(band_name), 302.5)), rel=1e-6
    )


@pytest.mark.slow
def test_hot_parts_show_from_behind_only():
    """The observer sees the turbine annuli at position 1, but not at position 3.

    At position 2 they are nearly edge-on. They are pitched by 10 degrees and the observer is 11.3
    degrees below, so that the cosine is sin(10) sin(11.3) = 0.034. The plumes are visible from all
    positions.
    """
    by_seen = {
        position: mi_lcair.signature(
            mi_lcair.load("a340_landing", position=position, resolution=128), spp=16
        ).target.by_seen
        for position in (1, 2, 3)
    }
    behind, beside, ahead = (by_seen[position]["hot_parts"] for position in (1, 2, 3))
    assert ahead == 0 and 0 < beside < 0.15 * behind
    assert all(
        part["plume"] > 100 and part["sky"] == part["terrain"] == 0 for part in by_seen.values()
    )


@pytest.mark.slow
def test_splits_of_the_range():
    """The splits by emitting group and by first hit both add up to the intensity.

    This holds for the target, whose pixels show the model first, and for the whole scene.
    """
    result = mi_lcair.signature(
        mi_lcair.load("cylinder_ir_range", resolution=64), spp=64, by_spectrum=True, facets=True
    )
    assert set(result.scene.by_group) == set(result.scene.by_seen) == {"self", "walls"}
    for part in (result.target, result.scene):
        assert sum(part.by_group.values()) == pytest.approx(part.intensity, rel=1e-5)
        assert sum(part.by_seen.values()) == pytest.approx(part.intensity, rel=1e-5)
    assert len(result.facets.table["facet"]) == 1944
    assert result.facets.table["intensity_W_sr"].sum() == pytest.approx(
        result.target.intensity, rel=1e-5
    )
    temperatures = sorted({source.temperature for source in result.effective_areas.sources})
    assert temperatures == pytest.approx([253, 263, 301.7, 302.1, 303.2, 303.6, 303.7], abs=1e-4)


def test_facets_of_the_range():
    """The facets are numbered as 1944 of the model followed by 160 of the room."""
    table = FacetTable(mi_lcair.load("cylinder_ir_range", resolution=4))
    assert table.count == 1944 + 160 and list(np.unique(table.type[:1944])) == ["model"]
    assert sorted(np.unique(table.type[1944:])) == ["sky", "terrain"] and table.area[
        1944:
    ].sum() == pytest.approx(54, rel=1e-6)
