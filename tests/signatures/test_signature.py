"""Tests of signatures: the sensor's window, the parts, and sensors without an intensity."""

import gc
import json
import weakref
from dataclasses import replace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.launch import rounding_error
from mi_lcair.rendering.scene import changed
from mi_lcair.sections import Remarks, Table
from mi_lcair.signatures.signature import facts_of_entries

SCENE = """<scene version="3.0.0">
    <default name="sensor" value="orthographic"/>
    <default name="crop" value="8"/> <default name="scale" value="2"/>
    <integrator type="bounce_path"/>
    <sensor type="$sensor">
        <transform name="to_world">
            <scale x="$scale" y="$scale"/>
            <lookat origin="0, 0, 3" target="0, 0, 0" up="0.3, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="8"/> <integer name="height" value="8"/>
            <integer name="crop_width" value="$crop"/> <integer name="crop_height" value="8"/>
            <rfilter type="box"/> <string name="pixel_format" value="luminance"/>
        </film>
    </sensor>
    <shape type="rectangle">
        <transform name="to_world"><scale x="5" y="5"/></transform>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape>
</scene>"""
L_300 = 38.5004239333  # W m^-2 sr^-1, 8-12 um


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "plate.xml"
    path.write_text(SCENE)
    return path


@pytest.mark.parametrize("crop, area", [(8, 16.0), (2, 4.0)])
def test_window(scene, crop, area):
    """A blackbody that fills the window of 4 m x 4 m, whole and cropped to a quarter."""
    result = mi_lcair.signature(mi_lcair.load(scene, crop=crop), spp=4)
    assert result.intensity == pytest.approx(L_300 * area, rel=1e-5)
    # All samples are equal. Only the rounding error of Float32 remains.
    assert result.standard_error == pytest.approx(rounding_error(4) * result.intensity, rel=1e-3)
    assert (
        result.scene.by_seen == {"self": pytest.approx(result.intensity)}
        and result.scene.by_group == result.scene.by_seen
    )
    assert result.target.intensity == pytest.approx(result.intensity)


CLOSED = """<scene version="3.0.0">
    <default name="max_bounces" value="60"/> <default name="closure" value="none"/>
    <integrator type="bounce_path">
        <integer name="max_bounces" value="$max_bounces"/> <string name="closure" value="$closure"/>
    </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <lookat origin="0, 0, 1.2" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="8"/> <integer name="height" value="8"/>
            <rfilter type="box"/> <string name="pixel_format" value="luminance"/>
        </film>
    </sensor>
    <shape type="sphere">
        <float name="radius" value="0.7"/>
        <bsdf type="grey"><float name="emissivity" value="0.15"/></bsdf>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape>
    <shape type="sphere">
        <float name="radius" value="2"/> <boolean name="flip_normals" value="true"/>
        <bsdf type="grey"><float name="emissivity" value="0.02"/></bsdf>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape>
</scene>"""


def closed(folder, emissivity="0.15", **parameters):
    """A sphere in a sphere, all at 300 K, which is a black body; its sphere has this emissivity."""
    path = folder / "closed.xml"
    path.write_text(CLOSED.replace('"0.15"', f'"{emissivity}"'))
    return mi_lcair.load(path, **parameters)


@pytest.mark.parametrize("tolerance", [None, 0.01])
@pytest.mark.parametrize("most, is_told", [(60, True), (100, True), (400, False)])
def test_reflections_that_are_left_out(tmp_path, most, is_told, tolerance):
    """What is missing of a black body is what is told."""
    scene = closed(tmp_path, max_bounces=most)
    result = mi_lcair.signature(scene, tolerance=tolerance, spp=None if tolerance else 256)
    missing = 4 * L_300 - result.intensity
    assert result.target.left_out == pytest.approx(missing, rel=0.15, abs=result.half_width)
    remarks = [line for line in result.remarks if line.startswith("reflections beyond max_bounces")]
    assert len(remarks) == is_told and result.reached == (tolerance and not is_told)


@pytest.mark.parametrize("parts", [True, False])
@pytest.mark.parametrize("most", [0, 1, 3, 10])
def test_few_reflections_that_take_turns(tmp_path, most, parts):
    """A pilot knows what a table of few reflections, between unlike surfaces, does not tell."""
    scene = closed(tmp_path, "0.9", max_bounces=most)
    result = mi_lcair.signature(scene, tolerance=0.01, parts=parts)
    missing = 4 * L_300 - result.intensity
    assert missing > 0.04 * result.intensity and not result.reached
    assert result.target.left_out == pytest.approx(missing, rel=0.1)


def is_told(result) -> bool:
    """Whether a remark says what is left out."""
    remarks = [line for part in result.facts() if isinstance(part, Remarks) for line in part.lines]
    return any("are left out, and the errors do not include them" in line for line in remarks)


@pytest.mark.parametrize("most, reached", [(3, False), (50, True)])
def test_an_image_that_leaves_reflections_out(tmp_path, most, reached):
    """What its mean lacks of a black body is told, and keeps a tolerance from being reached."""
    scene = closed(tmp_path, "0.9", max_bounces=most)
    image = mi_lcair.render(scene, tolerance=0.02)
    missing = 1 - image.mean / L_300
    assert image.left_out == pytest.approx(missing, rel=0.1, abs=0.01) and image.reached == reached
    assert is_told(image) is not reached


def test_a_trend_that_leaves_reflections_out():
    """The largest share of the views, against the same trend with all reflections."""
    few, all_of_them = (
        mi_lcair.trend("open_box", [0, 90], elevations_deg=[60], tolerance=0.01, max_bounces=most)
        for most in (0, 30)
    )
    shares = 1 - few.table["intensity_W_sr"] / all_of_them.table["intensity_W_sr"]
    assert few.left_out == pytest.approx(shares.max(), rel=0.1) and shares.max() > 0.02
    assert few.missed == 2 and few.reached() is False and all_of_them.reached()
    assert [is_told(trend) for trend in (few, all_of_them)] == [True, False]


def test_a_pilot_finds_nothing_where_nothing_is_left_out(scene):
    """A black plate, whose table of reflections is too short to be continued."""
    result = mi_lcair.signature(mi_lcair.load(scene), tolerance=0.01)
    assert result.target.left_out == 0 and result.reached


def test_error_of_a_tail(tmp_path):
    """A tail that continues the reflections of unlike surfaces says how wrong it may be."""
    scene = closed(tmp_path, "0.9", closure="tail", max_bounces=10)
    result = mi_lcair.signature(scene, tolerance=0.01)
    assert abs(4 * L_300 - result.intensity) < result.target.left_out and not result.reached
    assert "the contribution of closure = tail may be wrong by up to about" in result.remarks[-1]


def test_as_dict():
    result = mi_lcair.signature(mi_lcair.load("open_box", resolution=16, max_bounces=2), spp=64)
    entries = result.as_dict()
    assert {
        "kind",
        "scene_name",
        "band",
        "target",
        "scene",
        "window_area_m2",
        "time_s",
        "paths",
    } <= set(entries)
    for part in ("target", "scene"):
        own = entries[part]
        intensity = own["intensity_W_sr"]
        assert len(own["by_bounce_W_sr"]) == len(own["by_bounce_error_W_sr"]) == 3
        assert own["up_to_bounce_W_sr"] == pytest.approx(np.cumsum(own["by_bounce_W_sr"]))
        for parts in (own["by_group_W_sr"].values(), own["by_seen_W_sr"].values()):
            assert sum(parts) == pytest.approx(intensity, rel=1e-5)
        assert sum(own["by_bounce_W_sr"]) == pytest.approx(intensity, rel=1e-6)
    assert entries["paths"] == 64 * 256


@pytest.mark.parametrize("asked", [{}, {"by_spectrum": True, "facets": True}])
@pytest.mark.parametrize("name", ["cavity", "furnace"])
def test_a_signature_without_parts(name, asked, tmp_path):
    """The same numbers bit for bit, no tables, and files that can be read."""
    scene = mi_lcair.load(name, resolution=16, band="MWIR", max_bounces=4)
    whole, lean = (mi_lcair.signature(scene, spp=16, parts=parts, **asked) for parts in (1, 0))
    for part in ("target", "scene"):
        of_whole, of_lean = getattr(whole, part), getattr(lean, part)
        for number in ("intensity", "standard_error", "half_width"):
            assert getattr(of_lean, number) == getattr(of_whole, number)
        assert of_lean.by_bounce == of_lean.up_to_bounce == [] and of_lean.closure is None
        assert of_lean.by_group == of_lean.by_seen == {} and of_whole.by_group
    assert (lean.missed, lean.paths, lean.systematic) == (
        whole.missed,
        whole.paths,
        whole.systematic,
    )
    if asked:
        np.testing.assert_array_equal(lean.effective_areas.error, whole.effective_areas.error)
        for column, values in lean.facets.columns().items():
            np.testing.assert_array_equal(values, whole.facets.columns()[column])
    for suffix in (".json", ".csv", ".html", ".png"):
        lean.save(tmp_path / f"lean{suffix}")
    assert lean.columns()["part"].tolist() == ["all"]
    entries = json.loads((tmp_path / "lean.json").read_text())
    for result, tables in ((lean.as_dict(), 0), (entries, 0), (whole.as_dict(), 3)):
        facts = facts_of_entries(result)
        assert sum(isinstance(fact, Table) for fact in facts) == tables
    assert [chart.names for chart in lean.picture().charts] == [["all"]]


def test_reflections_and_closure_add_up_to_the_intensity():
    scene = mi_lcair.load("cavity", resolution=8, max_bounces=4)
    with changed(scene, closure="tail"):
        result = mi_lcair.signature(scene, spp=16)
    assert result.target.closure > 0
    assert sum(result.target.by_bounce) + result.target.closure == pytest.approx(
        result.target.intensity, rel=1e-6
    )


def test_a_part_of_the_intensity_is_that_of_target_or_scene():
    """The intensity itself is that of the part to which a tolerance refers."""
    result = mi_lcair.signature(mi_lcair.load("open_box", resolution=16), spp=4)
    assert result.main_part == "target" and result.main is result.target
    for name in ("intensity", "standard_error", "half_width"):
        assert getattr(result, name) == getattr(result.target, name)
    dark = replace(result, target=replace(result.target, intensity=0.0))
    assert dark.main_part == "scene" and dark.intensity == result.scene.intensity


def test_a_criterion_of_ones_own_ends_the_paths():
    """Paths are added until the criterion holds, or max_spp is reached."""
    scene, asked = mi_lcair.load("open_box", resolution=16, max_bounces=2), []

    def excess(result):
        asked.append(result)
        return result.target.half_width / 0.05

    result = mi_lcair.signature(scene, excess=excess)
    assert result.reached and result.target.half_width <= 0.05 < asked[0].target.half_width
    assert all(earlier.paths < later.paths for earlier, later in zip(asked, asked[1:-1]))
    assert (result.degrees_of_freedom, result.tolerance) == (7, None)
    assert 0 < result.missed < result.target.half_width
    short = mi_lcair.signature(scene, excess=lambda result: 2.0, max_spp=32)
    assert short.reached is False and short.paths == 32 * 256


def test_a_tolerance_is_that_of_the_target():
    result = mi_lcair.signature(mi_lcair.load("open_box", resolution=16), tolerance=0.01)
    assert result.reached and result.target.half_width <= 0.01 * result.target.intensity
    entries = result.as_dict()
    assert (entries["tolerance"], entries["reached"]) == (0.01, True)
    assert entries["target"]["half_width_W_sr"] == result.target.half_width
    assert mi_lcair.signature(mi_lcair.load("open_box", resolution=16), spp=4).reached is None


@pytest.mark.parametrize("other", [{"tolerance": 0.1}, {"max_spp": 8}, {"excess": lambda _: 0.0}])
def test_a_number_of_paths_stands_alone(other):
    with pytest.raises(InputError, match="spp sets a fixed number of samples"):
        mi_lcair.signature(mi_lcair.load("open_box", resolution=16), spp=4, **other)


def test_perspective_is_refused(scene):
    with pytest.raises(
        InputError,
        match="an intensity needs an orthographic sensor, and this one is PerspectiveCamera",
    ):
        mi_lcair.signature(mi_lcair.load(scene, sensor="perspective", scale=1), spp=4)


def test_missing_sensor(scene):
    with pytest.raises(InputError, match="sensor 1 does not exist; the scene has 1"):
        mi_lcair.signature(mi_lcair.load(scene), sensor=1)


def test_a_scene_is_deleted_with_its_last_name(tmp_path):
    """Also without the garbage collector: kernels are compiled for all scenes that are alive."""
    (tmp_path / "plate.xml").write_text(SCENE)
    gc.collect()
    gc.disable()
    try:
        scene = mi_lcair.load(tmp_path / "plate.xml")
        gone = weakref.ref(scene.mi.integrator())
        mi_lcair.signature(scene, tolerance=0.1)
        del scene
        assert gone() is None
    finally:
        gc.enable()


def test_no_part_is_known_worse_than_the_whole():
    """Few paths in a furnace: late reflections are one row, and no cell is less than its error."""
    found = mi_lcair.signature("furnace", spp=1, parameters={"resolution": 16})
    tables = (part for section in found.sections() for part in section.parts)
    bounces, *others = (part for part in tables if isinstance(part, Table))
    *rows, last = bounces.rows
    assert last[0] == f"{len(rows)} to {len(found.target.by_bounce) - 1}"
    assert last[2] == found.target.up_to_bounce[-1]
    most = found.target.intensity + found.target.half_width
    assert sum(found.target.by_bounce[len(rows) :]) < float(last[1].removeprefix("< ")) <= most
    cells = [cell for table in (bounces, *others) for row in table.rows for cell in row]
    assert all(cell[0] >= cell[1] for cell in cells if isinstance(cell, tuple))
