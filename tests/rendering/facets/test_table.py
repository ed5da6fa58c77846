"""Facets are numbered as their models number them, described as the scene does, and recognised when
a ray meets them.
"""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.triangles import ABSENT
from mi_lcair.rendering.facets.table import FacetTable

SCENE = """<scene version="3.0.0"> <integrator type="bounce_path"/> \
<sensor type="orthographic"/> {shapes} </scene>"""
PLY = """<shape type="ply" id="{id}"> <string name="filename" value="{file}"/> \
<boolean name="face_normals" value="true"/>
    {extra} <bsdf type="sandford_robertson"> <string name="material" value="{material}"/> \
<string name="band" value="LWIR"/> </bsdf>
    <emitter type="thermal"> \
<string name="band" value="LWIR"/> {temperature} <string name="group" value="{group}"/> </emitter>
</shape>"""
PER_FACE = (
    '<texture type="mesh_attribute" name="temperature"> '
    '<string name="name" value="face_temperature"/> </texture>'
)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


def write_mesh(path, vertices, faces, **attributes):
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(np.ravel(vertices).astype(np.float32))
    parameters["faces"] = mi.UInt32(np.ravel(faces).astype(np.uint32))
    parameters.update()
    for name, values in attributes.items():
        mesh.add_attribute(f"face_{name}", 1, np.asarray(values, dtype=np.float32))
    mesh.write_ply(str(path))
    return path


@pytest.fixture
def table(tmp_path):
    def load(*shapes):
        (tmp_path / "scene.xml").write_text(SCENE.format(shapes="".join(shapes)))
        scene = mi_lcair.load(tmp_path / "scene.xml")
        return scene, FacetTable(scene)

    return load


def ply(
    file,
    id="",
    material="blackbody",
    temperature='<float name="temperature" value="300"/>',
    group="self",
    extra="",
):
    return PLY.format(
        id=id, file=file, material=material, temperature=temperature, group=group, extra=extra
    )


@pytest.fixture
def model(tmp_path):
    """A model of two parts whose facets interleave: 0 and 3 (two triangles) in one, 1 in the other;
    no facet 2.
    """
    write_mesh(
        tmp_path / "a.ply",
        np.concatenate([SQUARE, SQUARE + [2, 0, 0]]),
        [[0, 1, 2], [0, 2, 3], [4, 5, 6]],
        facet=[3, 3, 0],
        temperature=[310, 310, 290],
    )
    write_mesh(tmp_path / "b.ply", SQUARE + [0, 0, 5], [[0, 2, 1]], facet=[1], temperature=[400])
    return [
        ply("a.ply", "plane.f_gloss_black", "gloss_black", PER_FACE),
        ply("b.ply", "plane.f_blackbody_4.5deg", "blackbody", PER_FACE, group="hot"),
    ]


def test_parts_of_a_model_share_its_numbers(table, model):
    """Also with another shape between them; what follows starts after the model's last number."""
    between = '<shape type="sphere"> <point name="center" x="20" y="0" z="0"/> </shape>'
    _, facets = table(model[0], between, model[1])
    assert facets.count == 5
    assert facets.shape_index.tolist() == [0, 2, -1, 0, 1]
    assert facets.material.tolist() == [
        "gloss_black",
        "blackbody",
        "",
        "gloss_black",
        "SmoothDiffuse",
    ]
    assert facets.group.tolist() == ["self", "hot", "other", "self", "other"]
    assert facets.type.tolist() == ["model"] * 5
    np.testing.assert_array_equal(facets.temperature, [290, 400, np.nan, 310, np.nan])
    np.testing.assert_allclose(facets.area, [0.5, 0.5, 0, 1, 4 * np.pi], rtol=1e-6)
    np.testing.assert_allclose(facets.normal[[0, 1, 3]], [[0, 0, 1], [0, 0, -1], [0, 0, 1]])
    np.testing.assert_allclose(
        facets.centre[[0, 1, 3]],
        [[2 + 2 / 3, 1 / 3, 0], [2 / 3, 1 / 3, 5], [0.5, 0.5, 0]],
        rtol=1e-6,
    )
    assert np.isnan(facets.normal[[2, 4]]).all() and np.isnan(facets.centre[[2, 4]]).all()
    assert facets.triangles.shape == (4, 3, 3) and facets.triangle_facet.tolist() == [3, 3, 0, 1]
    np.testing.assert_allclose(facets.triangles[3], [[0, 0, 5], [1, 1, 5], [1, 0, 5]])


def test_a_ray_meets_the_facet_that_lies_there(table, model):
    scene, facets = table(
        *model,
        '<shape type="rectangle"> <transform name="to_world"> '
        '<translate x="-5"/> </transform> </shape>',
    )
    x = [0.2, 0.8, 2.8, 0.8, -5.5, -4.5, 9]
    y = [0.8, 0.2, 0.2, 0.2, 0.5, -0.5, 0]
    z = [1, 1, 1, 9, 1, 1, 1]
    si = scene.mi.ray_intersect(mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(0, 0, -1)))
    assert facets.number(si.shape, si.prim_index).numpy().tolist() == [3, 3, 0, 1, 4, 4, ABSENT]
    masked = facets.number(
        si.shape, si.prim_index, mi.Bool([False, True, True, True, True, True, True])
    )
    assert masked.numpy().tolist() == [ABSENT, 3, 0, 1, 4, 4, ABSENT]


def test_a_shape_that_is_no_mesh_is_one_facet(table, tmp_path):
    """Also a curve, whose hits tell its segments apart."""
    (tmp_path / "curve.txt").write_text("".join(f"{x} 0 0 0.1\n" for x in range(6)))
    write_mesh(tmp_path / "a.ply", SQUARE + [9, 0, 0], [[0, 1, 2], [0, 2, 3]])
    curve = '<shape type="bsplinecurve"> <string name="filename" value="curve.txt"/> </shape>'
    scene, facets = table(curve, ply("a.ply"))
    si = scene.mi.ray_intersect(
        mi.Ray3f(mi.Point3f([1.5, 3.5, 9.2], [0, 0, 0.8], 1), mi.Vector3f(0, 0, -1))
    )
    assert si.prim_index.numpy()[1] > 0
    assert facets.number(si.shape, si.prim_index).numpy().tolist() == [0, 0, 2]
    np.testing.assert_array_equal(facets.area, [np.nan, 0.5, 0.5])


def test_numbering_and_rays_agree_everywhere(table):
    """From each facet's centre a ray starts along its normal and comes back: it meets that facet.
    (Furnace's slabs share one mesh, turned by the scene.)
    """
    scene = mi_lcair.load("furnace")
    facets = FacetTable(scene)
    assert facets.count == 6 + 400 + 6 + 6
    start = mi.Point3f((facets.centre + 1e-3 * facets.normal).T)
    si = scene.mi.ray_intersect(mi.Ray3f(start, mi.Vector3f(-facets.normal.T)))
    assert np.array_equal(facets.number(si.shape, si.prim_index).numpy(), np.arange(facets.count))
    np.testing.assert_allclose(si.n.numpy().T, facets.normal, atol=1e-5)


def test_a_mesh_without_facets_has_one_per_triangle(table, tmp_path):
    """And each such mesh numbers for itself, whatever its name; `facet_type` need not be given."""
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], temperature=[300, 310])
    _, facets = table(ply("a.ply", "plane.left", temperature=PER_FACE), ply("a.ply", "plane.right"))
    assert facets.temperature.tolist() == [300, 310, 300, 300]
    assert facets.shape_index.tolist() == [0, 0, 1, 1]


def test_flipped_normals(table, tmp_path):
    """The normal is that of the reflecting side; the triangles run anticlockwise about it."""
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2]])
    _, facets = table(ply("a.ply", extra='<boolean name="flip_normals" value="true"/>'))
    np.testing.assert_allclose(facets.normal, [[0, 0, -1]])


def test_a_source_that_is_no_blackbody_has_no_temperature(table, tmp_path):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2]])
    _, facets = table(ply("a.ply"), ply("a.ply", temperature='<float name="radiance" value="3"/>'))
    np.testing.assert_array_equal(facets.temperature, [300, np.nan])


@pytest.mark.parametrize(
    "attributes, reason",
    [
        ({"facet": [0, 0], "temperature": [300, 310]}, "different temperatures, 300 to 310 K"),
        ({"facet": [0, 0.5], "temperature": [300, 300]}, "face_facet = 0.5"),
        ({"facet": [-1, 0], "temperature": [300, 300]}, "face_facet = -1"),
    ],
)
def test_unsound_facets_are_refused(table, tmp_path, attributes, reason):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], **attributes)
    with pytest.raises(InputError, match=reason):
        table(ply("a.ply", "plane.f", temperature=PER_FACE))


def test_a_facet_in_two_parts_is_refused(table, tmp_path):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], facet=[0, 7])
    write_mesh(tmp_path / "b.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], facet=[7, 1])
    with pytest.raises(InputError, match="'plane.a' and 'plane.b' both have facet 7"):
        table(ply("a.ply", "plane.a"), ply("b.ply", "plane.b"))


PATHS = {"type": "bounce_path"}


def test_a_scene_of_a_sky_alone():
    """It has no facets, and an intensity, toward whose error no paths can be aimed."""
    film = {"type": "hdrfilm", "pixel_format": "luminance"}
    sensor, sky = {"type": "orthographic", "film": film}, {"type": "sky", "band": "LWIR"}
    scene = mi.load_dict({"type": "scene", "path": PATHS, "sensor": sensor, "sky": sky})
    with pytest.raises(InputError, match="has no shapes, and therefore no facets"):
        mi_lcair.exchange(scene)
    result = mi_lcair.signature(scene, tolerance=1e-5, max_spp=1)
    assert result.intensity > 0
    assert not result.reached


def test_a_curve_whose_area_is_unknown_has_parameters(tmp_path):
    (tmp_path / "curve.txt").write_text("0 0 0 0.1\n0 0 1 0.1\n")
    emitter = {"type": "thermal", "band": "LWIR", "temperature": 320.0}
    curve = {"type": "linearcurve", "filename": str(tmp_path / "curve.txt"), "emitter": emitter}
    sensor = {"type": "orthographic"}
    scene = mi.load_dict({"type": "scene", "path": PATHS, "sensor": sensor, "curve": curve})
    assert mi_lcair.parameters(scene)["self.temperature"].value == 320
