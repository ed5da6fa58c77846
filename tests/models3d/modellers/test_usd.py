"""OpenUSD: places, sides, labels and units of meshes, and what is refused."""

import csv
import io
import sys
import tomllib

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.models3d import export, read, report
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import set_values
from tests.models3d.shapes import CORNERS, SIDES

pxr = pytest.importorskip("pxr")
PAINTED = {"material": "gloss_black", "temperature": 300.0}
METRES = 'metersPerUnit = 1\nupAxis = "Z"'
FLAT = 'uniform token subdivisionScheme = "none"'
SQUARE = ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])


def mesh(name="Box", points=CORNERS, faces=SIDES, more="", inside="", scheme=FLAT, spec="def"):
    """A mesh in USD's text; by default a cube of 1 m from 0 to 1."""
    corners = [corner for face in faces for corner in face]
    return f"""{spec} Mesh "{name}" {{
        int[] faceVertexCounts = {[len(face) for face in faces]}
        int[] faceVertexIndices = {corners}
        point3f[] points = {[tuple(map(float, point)) for point in points]}
        {scheme}
        {more}
        {inside}
    }}
    """


def xform(name, inside, more="", head=""):
    return f'def Xform "{name}" {head} {{\n{more}\n{inside}\n}}\n'


def moved(x, y, z, *others):
    """A translation, and operations that act before it."""
    names = ", ".join(
        f'"{name}"' for name in ("xformOp:translate", *(o.split()[1] for o in others))
    )
    lines = "\n".join(others)
    return (
        f"double3 xformOp:translate = ({x}, {y}, {z})\n{lines}\n"
        f"uniform token[] xformOpOrder = [{names}]"
    )


@pytest.fixture
def load(tmp_path):
    """A function that reads a stage of some prims: `load(text)`."""

    def load(*prims, head=METRES, name="stage.usda", **options):
        text = f"#usda 1.0\n(\n{head}\n)\n" + "\n".join(prims)
        (tmp_path / name).write_text(text, encoding="utf-8")
        return read(tmp_path / name, **(PAINTED | options))

    return load


def solid(model, volume, count=6):
    """The model is closed, faces outward and has a volume."""
    figures = report(model)
    assert figures["volume"] == pytest.approx(volume, rel=1e-6)
    assert figures["inward"] == figures["open_edges"] == 0 and model.count == count
    return model


# Places, units and axes
# ----------------------


def test_a_cube(load):
    model = solid(load(mesh()), 1)
    assert model.box.tolist() == [[0, 0, 0], [1, 1, 1]] and model.remarks == ()
    assert model.names.tolist() == ["Box"] * 6


def test_units_and_axes(load):
    """2 cm forward, 1 up: in USD's centimetres with y up, and in metres with z up."""
    size = [(2 * x, y, 3 * z) for x, y, z in CORNERS]  # y is up
    model = solid(load(mesh(points=size), head='metersPerUnit = 0.01\nupAxis = "Y"'), 6e-6)
    assert np.ptp(model.box, axis=0) == pytest.approx((0.02, 0.03, 0.01))
    assert model.box[:, 1] == pytest.approx((-0.03, 0))  # z of the file points backward
    same = load(mesh(points=size), head="")  # USD's defaults
    assert same.vertices == pytest.approx(model.vertices)
    assert [remark.split(":")[0] for remark in same.remarks] == [
        "metersPerUnit is missing, and USD's default of 0.01 is used",
        "upAxis is missing, and USD's default of Y is used",
    ]
    given = load(mesh(points=size), head="", scale=1, forward="Y", up="Z")
    assert np.ptp(given.box, axis=0) == pytest.approx((2, 1, 3))


@pytest.mark.parametrize("scale", [(2, 3, 4), (-2, 3, 4), (-2, -3, 4), (-2, -3, -4), (0.5, 0.5, 1)])
@pytest.mark.parametrize("hand", ["rightHanded", "leftHanded"])
def test_handedness(load, scale, hand):
    """Sides face outward for each number of mirrors, and for faces that run clockwise."""
    faces = SIDES if hand == "rightHanded" else [side[::-1] for side in SIDES]
    body = mesh(faces=faces, more=f'uniform token orientation = "{hand}"')
    turn = "float xformOp:rotateZ = 30", f"float3 xformOp:scale = {scale}"
    model = load(xform("Outer", xform("Inner", body, moved(5, 0, 0, *turn)), moved(0, 7, 0)))
    solid(model, abs(np.prod(scale)))


def test_a_projection(load):
    rows = "((1, 0, 0, 0.5), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
    operation = f"matrix4d xformOp:transform = {rows}\nuniform token[] xformOpOrder = "
    with pytest.raises(InputError, match="/X/Box: its transform is a projection"):
        load(xform("X", mesh(), operation + '["xformOp:transform"]'))


def test_nested_transforms(load):
    """A quarter turn about z, outside a shift along x, outside a stretch."""
    inner = xform("Inner", mesh(), moved(10, 0, 0, "float3 xformOp:scale = (2, 1, 1)"))
    model = load(xform("Outer", inner, moved(0, 0, 5, "float xformOp:rotateZ = 90")))
    assert model.box == pytest.approx(np.array([[-1, 10, 5], [0, 12, 6]]))
    reset = moved(1, 2, 3).replace('["', '["!resetXformStack!", "')
    model = load(xform("Outer", xform("Inner", mesh(), reset), moved(0, 0, 5)))
    assert model.box[0].tolist() == [1, 2, 3]


# Instances
# ---------


def test_instanceable_prims(load):
    """Two instances of a prototype that holds two more: four cubes."""
    classes = [
        f'class "Part" {{\n{mesh()}\n}}',
        'class "Pair" {\n'
        + "".join(
            xform(f"P{k}", "", moved(3 * k, 0, 0), "(instanceable = true\ninherits = </Part>)")
            for k in range(2)
        )
        + "}",
    ]
    pairs = [
        xform(f"Pair_{k}", "", moved(0, 9 * k, 0), "(instanceable = true\ninherits = </Pair>)")
        for k in range(2)
    ]
    model = solid(load(*classes, *pairs), 4, 24)
    assert model.box.tolist() == [[0, 0, 0], [4, 10, 1]]
    assert {label.group for label in model.labels} == {"Pair_0", "Pair_1"}


def instancer(which, prototypes, more="", inside=""):
    positions = [(4.0 * k, 0.0, 0.0) for k in range(len(which))]
    return f"""def PointInstancer "Rows" {{
        int[] protoIndices = {list(which)}
        point3f[] positions = {positions}
        rel prototypes = [{", ".join(prototypes)}]
        {more}
        {inside}
    }}
    """


def test_point_instancers(load):
    """A large and a small prototype; one below an `over`, so that it is not drawn by itself."""
    small = 'over "Kept" {\n' + xform("Small", mesh(points=np.array(CORNERS) / 2)) + "}\n"
    rows = instancer(
        (0, 1, 0, 1),
        ("</Rows/Large>", "</Kept/Small>"),
        "float3[] scales = [(1, 1, 1), (-1, 1, 1), (2, 1, 1), (1, 1, 1)]\n"
        "int64[] ids = [10, 11, 12, 13]\nint64[] invisibleIds = [13]\n"
        "double[] primvars:thermal:kelvin = [300, 310, 320, 330]"
        ' (interpolation = "vertex")',
        xform("Large", mesh(), moved(0, 0, 1)),
    )
    model = solid(load(small, rows, temperature=None), 1 + 1 / 8 + 2, 18)
    assert model.box.tolist() == [[0, 0, 0], [10, 1, 2]]
    assert model.temperature[[0, 6, 12]].tolist() == [300, 310, 320]
    outer = instancer(
        (0, 0), ("</Rows/Proto>",), "", xform("Proto", rows.replace("/Rows", "/Rows/Proto/Rows"))
    )
    solid(load(small, outer), 2 * (1 + 1 / 8 + 2), 36)


# What is seen
# ------------


@pytest.mark.parametrize(
    "more, remark",
    [
        ('token visibility = "invisible"', "invisible, and is left out: /World/Other"),
        ('uniform token purpose = "guide"', "of purpose guide, and is left out: /World/Other/Box"),
        ('uniform token purpose = "proxy"', "of purpose proxy, and is left out: /World/Other/Box"),
    ],
)
def test_what_is_not_seen(load, more, remark):
    other = xform("Other", mesh(), moved(5, 0, 0) + "\n" + more)
    model = solid(load(xform("World", mesh() + other)), 1)
    assert model.remarks == (remark,)


def test_what_is_not_there(load):
    """Inactive prims, classes and overs."""
    others = xform("Off", mesh(), moved(5, 0, 0), "(active = false)"), f'class "C" {{\n{mesh()}}}'
    model = solid(load(mesh(), *others, mesh("Over", spec="over")), 1)
    assert model.remarks == ()


def test_what_is_no_mesh(load):
    others = 'def Sphere "Ball" {}\ndef DistantLight "Lamp" {}\ndef Camera "Eye" {}'
    model = solid(load(mesh(), others), 1)
    assert model.remarks == (
        "Sphere is not a mesh, and is left out: /Ball",
        "DistantLight is not a mesh, and is left out: /Lamp",
    )


def test_holes(load):
    """A cube with a lid that is a hole; its values by face stay in their places."""
    values = "double[] primvars:thermal:kelvin = [301, 302, 303, 304, 305, 306]"
    own = f'int[] holeIndices = [2]\n{values} (interpolation = "uniform")'
    model = load(mesh(more=own), temperature=None)
    assert model.count == 5 and report(model)["open_edges"] == 4
    assert model.temperature.tolist() == [301, 302, 304, 305, 306]


def test_sheets_and_caps(load):
    """An open sheet that is doubleSided radiates on both sides; a closed body does not inside."""
    both = "uniform bool doubleSided = 1"
    model = load(mesh("Sheet", *SQUARE, more=both))
    assert model.count == 2 and report(model)["area_by_material"] == {"gloss_black": 2}
    corners = model.vertices[model.corners].reshape(2, 4, 3)
    assert np.cross(*(corners[:, 1:3] - corners[:, :1]).swapaxes(0, 1))[:, 2].tolist() == [1, -1]
    assert model.remarks == (
        "doubleSided and open: each face gets a second face for its back: /Sheet",
    )
    assert load(mesh("Sheet", *SQUARE)).count == 1
    solid(load(mesh(more=both)), 1)
    split = [point for side in SIDES for point in (CORNERS[corner] for corner in side)]
    apart = [tuple(range(4 * k, 4 * k + 4)) for k in range(6)]  # closed only by position
    solid(load(mesh(points=split, faces=apart, more=both)), 1)
    wall = [(0.5, y, z) for y, z in ((0, 0), (1, 0), (1, 1), (0, 1))]  # across, at no edge
    model = load(mesh(points=[*CORNERS, *wall], faces=[*SIDES, (8, 9, 10, 11)]))
    assert model.count == 7 and report(model)["open_edges"] == 4


def test_polygons(load):
    """An L of 6 corners and 3 m2, a triangle, and faces that are none."""
    points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    kelvin = 'float[] primvars:thermal:kelvin = [300, 300, 300, 303, 300, 300] (interpolation = "'
    faces = [(0, 1, 2, 3, 4, 5), (0, 1), (), (0, 1, 5), ()]
    model = load(mesh("L", points, faces, more=kelvin + 'vertex")'), temperature=None)
    assert model.count == 2 and report(model)["area_by_material"] == {"gloss_black": 5}
    assert model.temperature.tolist() == [300.5, 300]
    assert model.remarks == ("faces of fewer than 3 corners are left out: /L",)


def test_subdivision(load):
    """Cages stay. A step of Catmull and Clark takes half of the area of a cube, by hand."""
    model = solid(load(mesh(scheme="")), 1)
    (remark,) = model.remarks
    assert remark.startswith("subdivision catmullClark is not applied")
    # Of 24 quads with the diagonals from a face's middle to a corner, 5/9 of the way out, and
    # between the points of two edges, 3/4 of the way out
    diagonals = np.array([1, 0, 0]) - 5 / 9, 0.75 * np.array([0, 1, -1])
    left = 24 * np.linalg.norm(np.cross(*diagonals)) / 2 / 24  # of an area of 24
    assert f"by {100 * (left - 1):.2g} %" in remark
    assert load(mesh(scheme='uniform token subdivisionScheme = "bilinear"')).remarks == ()
    assert load(mesh("Flat", *SQUARE, scheme="")).remarks == ()
    # An octahedron's corners have 4 faces: ((1/3) + 2 (1/2) + 1) / 4 = 7/12; its edges' points 5/12
    points = [tuple(row) for row in (*np.eye(3), *-np.eye(3))]
    faces = [(i, j, k) for i, j, k in ((0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2))]
    model = load(mesh("Eight", points, [*faces, *[(b, a, 5) for a, b, _ in faces]], scheme=""))
    diagonals = np.full(3, 1 / 3) - [7 / 12, 0, 0], np.array([0, 5 / 12, -5 / 12])
    left = 24 * np.linalg.norm(np.cross(*diagonals)) / 2 / (4 * np.sqrt(3))
    assert f"by {100 * (left - 1):.2g} %" in model.remarks[0]


def test_normals_against_the_winding(load):
    """They count for no facet, and are remarked."""
    for sign in (1, -1):
        normals = [tuple(sign * (2.0 * x - 1) for x in corner) for corner in CORNERS]
        model = solid(load(mesh(more=f"normal3f[] normals = {normals}")), 1)
        against = "normals point against the winding of the faces, which is used: /Box"
        assert model.remarks == ((against,) if sign < 0 else ())


# What is said of faces
# ---------------------

SAID = 'custom double thermal:kelvin = {}\ncustom string thermal:material = "{}"'


def kinds(model):
    """Material, group and temperature of each facet."""
    labels = [model.labels[number] for number in model.label]
    return [(at.material, at.group, t) for at, t in zip(labels, model.temperature.tolist())]


@pytest.mark.parametrize(
    "form",
    ["custom {} {}", "custom {} userProperties:{}", "{} primvars:{}"],
)
def test_labels(load, form):
    lines = [
        form.format("double", "thermal:kelvin") + " = 290.1",
        form.format("string", "thermal:material") + ' = "blackbody"',
        form.format("string", "thermal:group") + ' = "nozzle"',
    ]
    model = load(mesh(more="\n".join(lines)), material=None, temperature=None)
    assert kinds(model) == [("blackbody", "nozzle", 290.1)] * 6
    assert kinds(load(mesh(more="\n".join(lines)))) == [("gloss_black", "nozzle", 300)] * 6


def test_names_as_blender_writes_them(load):
    """A property without a colon, and an attribute of faces called thermal:kelvin."""
    lines = (
        'custom string userProperties:thermal_material = "blackbody"\n'
        "float[] primvars:thermal_kelvin = [301, 302, 303, 304, 305, 306.5] "
        '(interpolation = "uniform")\n'
        'custom string userProperties:blender:data_name = "Hull.001"'
    )
    model = load(mesh(more=lines), material=None, temperature=None)
    assert model.temperature.tolist() == [301, 302, 303, 304, 305, 306.5]
    assert {label.material for label in model.labels} == {"blackbody"}
    assert set(model.names) == {"Hull.001"}


def test_the_nearest_counts(load):
    """Prims above, the mesh, the bound material, a subset with its material, and the face."""
    paints = "".join(
        f'def Material "{name}" {{\n{SAID.format(kelvin, material)}\n}}\n'
        for name, kelvin, material in (("A", 310, "0.5"), ("B", 320, "0.6"))
    )
    subset = (
        'def GeomSubset "Hot" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n'
        'uniform token elementType = "face"\nuniform token familyName = "materialBind"\n'
        "int[] indices = [1, 3]\nrel material:binding = </World/B>\n}"
    )
    bound = "rel material:binding = </World/A>"
    head = SAID.format(305, "0.4") + '\ncustom string thermal:group = "all"'
    options = {"material": None, "temperature": None}
    world = xform("World", mesh(), head)
    assert kinds(load(world, **options)) == [("0.4", "all", 305)] * 6
    world = xform("World", mesh(more=SAID.format(306, "0.45")), head)
    assert kinds(load(world, **options)) == [("0.45", "all", 306)] * 6
    own = "custom double thermal:kelvin = 306"
    world = xform("World", paints + mesh(more=f"{bound}\n{own}", inside=subset), head)
    model = load(world, **options)
    expected = [("0.5", "all", 310), ("0.6", "all", 320)]
    assert kinds(model) == [expected[k in (1, 3)] for k in range(6)]
    assert model.remarks == (
        "its material's thermal:kelvin is used instead of its own: /World/Box",
    )
    values = 'string[] primvars:thermal:group = ["a", "b", "a", "b", "a", "a"]'
    faces = f'{values} (interpolation = "uniform")'
    model = load(xform("World", paints + mesh(more=f"{bound}\n{faces}", inside=subset)), **options)
    assert [group for _, group, _ in kinds(model)] == ["a", "b", "a", "b", "a", "a"]


def nonvisual(base, coating="none", more=""):
    """A material with SimReady's labels."""
    names = f'base = "{base}"', f'coating = "{coating}"', more
    lines = (f"custom token omni:simready:nonvisual:{name}\n" for name in filter(None, names))
    return f'def Material "Paint" {{\n{"".join(lines)}}}\n'


def test_labels_of_simready(load):
    """Base and coating name a material; attributes are remarked; thermal:material goes before."""
    bound = mesh(more="rel material:binding = </Paint>")
    for base, coating, name in (("steel", "paint", "steel+paint"), ("rubber", "none", "rubber")):
        model = load(nonvisual(base, coating), bound, material=None)
        assert {label.material for label in model.labels} == {name} and model.remarks == ()
    model = load(nonvisual("steel", "none", 'attributes = "retroreflective"'), bound, material=None)
    assert model.remarks == ("attributes retroreflective are not used: /Box",)
    two = nonvisual("steel", more="ATTRIBUTES").replace(
        "token omni:simready:nonvisual:ATTRIBUTES",
        'token[] omni:simready:nonvisual:attributes = ["emissive", "single_sided"]',
    )
    model = load(two, bound, material=None)
    assert model.remarks == ("attributes emissive, single_sided are not used: /Box",)
    many = nonvisual("steel") + xform("World", bound, "double[] thermal:kelvin = [300, 310]")
    model = load(many, material=None)
    assert model.remarks == ("several values count only on meshes and instancers: /World",)
    own = mesh(more='rel material:binding = </Paint>\ncustom string thermal:material = "0.8"')
    assert load(nonvisual("none"), own, material=None).labels[0].material == "0.8"
    both = nonvisual("steel").replace("custom", 'custom string thermal:material = "0.7"\ncustom', 1)
    assert load(both, bound, material=None).labels[0].material == "0.7"
    assert load(nonvisual("unobtainium"), bound).labels[0].material == "gloss_black"
    place = r"stage.usda: /Box \(6 faces, from facet 0 on\): "
    for base, coating, reason in (
        ("unobtainium", "none", "unknown base 'unobtainium'"),
        ("steel", "chocolate", "unknown coating 'chocolate'"),
        ("ice", "paint", "label 'ice.paint': no source gives its emissivity; there is ice"),
    ):
        with pytest.raises(InputError, match=place + reason):
            load(nonvisual(base, coating), bound, material=None)


def test_values_of_points_and_corners(load):
    """Means over the corners of a face."""
    x = [300 + 10 * point[0] for point in CORNERS]
    corners = [x[corner] for side in SIDES for corner in side]
    for over, values in (("vertex", x), ("faceVarying", corners)):
        line = f'float[] primvars:thermal:kelvin = {values} (interpolation = "{over}")'
        model = load(mesh(more=line), temperature=None)
        assert model.temperature.tolist() == [300, 310, 305, 305, 305, 305]
    indexed = "int[] primvars:thermal:kelvin:indices = [0, 1, 0, 1, 0, 1]"
    line = 'double[] primvars:thermal:kelvin = [300.1, 310] (interpolation = "uniform")\n'
    assert (
        load(mesh(more=line + indexed), temperature=None).temperature.tolist() == [300.1, 310] * 3
    )


def test_hierarchy_as_groups(load):
    """Where it forks; a group that is named goes before it, and terrain has its own."""
    left = xform("Left", xform("Deep", mesh("A")))
    right = xform("Right", mesh("B", more='custom string thermal:group = "own"'), moved(3, 0, 0))
    ground = 'custom string thermal:type = "t"\ncustom double thermal:emissivity = 0.9\n'
    below = xform(
        "Below", mesh("C", *SQUARE), moved(0, 0, -1) + f"\n{ground}custom int thermal:kelvin = 280"
    )
    model = load(xform("World", xform("Car", left + right + below)))
    groups = [group for _, group, _ in kinds(model)]
    assert groups == ["Left"] * 6 + ["own"] * 6 + ["terrain"]
    assert kinds(model)[-1] == ("0.9", "terrain", 280)


def test_many_branches(load):
    """More than 64 are no groups."""
    for count, groups in ((64, 64), (65, 1)):
        parts = "".join(mesh(f"P{k}", *SQUARE) for k in range(count))
        model = load(xform("World", parts))
        assert len({label.group for label in model.labels}) == groups
        assert [remark.split(" ")[-1] for remark in model.remarks] == ["/World"] * (count > 64)


def test_what_is_said_above_instances(load):
    """Of a point instancer, and of the second mesh of a stage, whose facets follow."""
    rows = instancer((0, 0), ("</World/Rows/A>",), "", xform("A", mesh()))
    world = xform("World", rows, SAID.format(305, "0.4"))
    model = load(world, material=None, temperature=None)
    assert kinds(model) == [("0.4", "self", 305)] * 12
    second = mesh("Second", more=SAID.format(300, "gold_plate"))
    with pytest.raises(
        InputError, match=r"/Second \(6 faces, from facet 12 on\): unknown material"
    ):
        load(world, second, material=None, temperature=None)


def test_first_guess(load):
    """Only where it is asked for, and where nothing else is said."""
    paint = """def Material "Paint" {
        token outputs:surface.connect = </Paint/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:metallic = 1
            float inputs:roughness = 0.2
            token outputs:surface
        }
    }"""
    bound = mesh(more="rel material:binding = </Paint>\nfloat[] primvars:displayColor = [1]")
    with pytest.raises(InputError, match="has no label"):
        load(paint, bound, material=None)
    model = load(paint, bound, material=None, guess=True)
    assert model.labels[0].material == "0.1" and "guessed from" in model.remarks[0]
    said = mesh(
        more='rel material:binding = </Paint>\ncustom string thermal:material = "blackbody"'
    )
    assert load(paint, said, material=None, guess=True).labels[0].material == "blackbody"


def test_tables_of_names(load, tmp_path):
    """A table goes before what the file says, also before temperatures of faces."""
    (tmp_path / "names.csv").write_text("name,material,kelvin\nCar,0.7,333\n")
    faces = "float[] primvars:thermal_kelvin = [301, 302, 303, 304, 305, 306.5]"
    car = xform("Car", mesh(more=faces))
    model = load(car, material=None, temperature=None, names=tmp_path / "names.csv")
    assert kinds(model) == [("0.7", "self", 333)] * 6


# Other files and variants
# ------------------------


def test_variants(load):
    sizes = "".join(
        f'"{name}" {{\n{mesh(points=[tuple(k * x for x in p) for p in CORNERS])}\n}}\n'
        for k, name in ((1, "small"), (2, "large"))
    )
    head = '(variants = {\nstring size = "small"\n}\nprepend variantSets = "size")'
    body = f'def Xform "Car" {head} {{\nvariantSet "size" = {{\n{sizes}\n}}\n}}'
    model = solid(load(body), 1)
    assert model.remarks == ("variant size=small of large, small is read: /Car",)
    solid(load(body, variants={"size": "large"}), 8)
    with pytest.raises(InputError, match="unknown variant of 'size' 'huge'; known: .*small"):
        load(body, variants={"size": "huge"})
    with pytest.raises(InputError, match="unknown variant set of stage.usda 'paint'; known: size"):
        load(body, variants={"paint": "red"})


def test_files_in_files(load, tmp_path):
    """A part in centimetres in a stage in metres: USD does not convert, which is remarked."""
    load(xform("Part", mesh()), head='defaultPrim = "Part"\nmetersPerUnit = 0.01', name="part.usda")
    car = xform("Car", "", "", "(references = @part.usda@)")
    model = solid(load(car), 1)
    (remark,) = model.remarks
    assert "metersPerUnit is 0.01 where the stage has 1" in remark and "part.usda" in remark
    (tmp_path / "part.usda").unlink()
    with pytest.raises(InputError, match="stage.usda: is incomplete: Could not open asset @part"):
        load(car)


@pytest.mark.parametrize("suffix", ["usd", "usdc", "usdz"])
def test_forms_of_files(load, tmp_path, suffix):
    from pxr import Usd, UsdUtils

    load(mesh())
    if suffix == "usdz":
        UsdUtils.CreateNewUsdzPackage(str(tmp_path / "stage.usda"), str(tmp_path / "a.usdz"))
    else:
        Usd.Stage.Open(str(tmp_path / "stage.usda")).Export(str(tmp_path / f"a.{suffix}"))
    solid(read(tmp_path / f"a.{suffix}", **PAINTED), 1)


def test_time_samples(load):
    """The first time of the stage counts."""
    head = METRES + "\nstartTimeCode = 10\nendTimeCode = 20"
    line = "double thermal:kelvin.timeSamples = {1: 300, 10: 310, 20: 320}"
    model = load(mesh(more=line), head=head, temperature=None)
    assert set(model.temperature) == {310}
    assert model.remarks == (
        "changes with time, and is read at the first time: /Box.thermal:kelvin",
    )


SUBSET = 'def GeomSubset "S" {\nuniform token elementType = "face"\nint[] indices = [9]\n}'
BAD = [
    ("", r"no mesh that is seen \(export meshes\)"),
    ('def Cube "A" {}', r"no mesh that is seen \(Cube is not a mesh, and is left out: /A\)"),
    ('def Mesh "A" {\npoint3f[] points = [(0, 0]\n}', "cannot be read as USD: .*stage.usda:7"),
    (mesh(points=CORNERS[:7]), "/Box: Out of range face vertex index 7"),
    (mesh().replace("[4, 4, 4", "[4, 4, 5"), "/Box: Sum of faceVertexCounts"),
    (mesh().replace("[4, 4, 4", "[-4, 8, 8"), "/Box: "),
    (mesh().replace("(0.0, 0.0, 0.0)", "(nan, 0.0, 0.0)"), "/Box: a coordinate is not finite"),
    (mesh(more="int[] holeIndices = [6]"), "/Box: holeIndices: an index is none of the 6"),
    (mesh(inside=SUBSET), "/Box/S: an index is none of the 6"),
    (mesh(more="custom double thermal:celsius = 20"), "/Box: unknown attribute 'celsius'"),
    (mesh(more=SAID.format(20, "blackbody")), "looks like degrees Celsius"),
    (mesh(more="double[] thermal:kelvin = [300, 20, 300, 300, 300, 300]"), "Celsius"),
    (mesh(more="double[] thermal:kelvin = [300, 310]"), "kelvin has 2 values; the mesh has 6 f"),
    (mesh(more=SAID.format(300, "0.8*600*")), "material '0.8.600.' must have no '.'"),
    (mesh(more=SAID.format(300, "gold_plate")), r"\(6 faces, from facet 0 on\): unknown material"),
    (mesh(more="custom double thermal:kelvin = 300"), "lacks material or emissivity; give it"),
    (mesh(more="custom double thermal:emissivity = 2\n" + SAID.format(300, "1")), "give one of"),
    (instancer((0, 1), ("</Rows/A>",), "", xform("A", mesh())), "/Rows: its protoIndices"),
    (
        instancer((0, 0), ("</Rows/A>",), "int[] thermal:kelvin = [1, 2, 3]", xform("A", mesh())),
        "/Rows: kelvin has 3 values for 2 instances",
    ),
    ('def Xform "A" (references = </B>) {\n}\n' + mesh(), "is incomplete: Unresolved reference"),
]


@pytest.mark.parametrize("text, reason", BAD)
def test_refused(load, capfd, text, reason):
    with pytest.raises(InputError, match=reason) as refusal:
        load(text, material=None, temperature=None)
    assert "\n" not in str(refusal.value) and "stage.usda" in str(refusal.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "head, reason",
    [
        ('metersPerUnit = -1\nupAxis = "Z"', "metersPerUnit = -1 m; must be positive"),
        ('metersPerUnit = 1\nupAxis = "X"', "unknown upAxis 'X'; known: Y, Z"),
    ],
)
def test_impossible_stages(load, head, reason):
    with pytest.raises(InputError, match=f"stage.usda: {reason}"):
        load(mesh(), head=head)


def test_names_in_other_letters(load):
    """Two branches are two groups, also where their names have no letter that groups may have."""
    model = load(mesh("\u5de6"), mesh("\u53f3"), mesh("sky"))
    assert {label.group for label in model.labels} == {"_", "__", "sky_"}


def test_damaged_files(load, tmp_path):
    for name, content, reason in (
        ("a.usdc", b"PXR-USDC\x00\x08", "a.usdc: cannot be read as USD: File too small"),
        ("a.usdz", b"PK\x03\x04", "a.usdz: cannot be read as USD: "),
        ("a.usd", b"", "a.usd: cannot be read as USD: "),
        ("a.usda", b"#usda 1.0\ndef \xff\x80 {", "a.usda: cannot be read as USD: "),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=reason):
            read(tmp_path / name, **PAINTED)
    with pytest.raises(InputError, match="parse error matching TupleValueClose at"):
        load('def Mesh "A" {\npoint3f[] points = [(0, 0]\n}')
    with pytest.raises(InputError, match="none.usd: cannot be read: No such file"):
        read(tmp_path / "none.usd", **PAINTED)


def test_without_the_library(load, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(InputError, match=r"a USD file needs pxr; .*'mi_lcair\[usd\]'"):
        load(mesh())


# Time samples: the path of a flight, and motions of groups
# ---------------------------------------------------------

TIMES = (
    'startTimeCode = 0\nendTimeCode = 4\ntimeCodesPerSecond = 2\nmetersPerUnit = 1\nupAxis = "Z"'
)
AXES = {"Z": np.eye(3), "Y": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])}


def samples(*values):
    return "{" + ", ".join(f"{time}: {value}" for time, value in values) + "}"


def moving(*operations):
    """Operations of time samples; the first ones act last."""
    names = ", ".join(f'"{line.split()[1].removesuffix(".timeSamples")}"' for line in operations)
    return "\n".join(operations) + f"\nuniform token[] xformOpOrder = [{names}]"


def rows_of(text):
    rows = [*csv.DictReader(io.StringIO(text))]
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def turned(yaw_deg, pitch_deg, roll_deg):
    """Roll about x, then pitch about -y, then yaw about z."""
    matrix = np.eye(3)
    for degrees, axis in ((roll_deg, 0), (-pitch_deg, 1), (yaw_deg, 2)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        j, k = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[[j, j, k, k], [j, k, j, k]] = c, -s, s, c
        matrix = step @ matrix
    return matrix


@pytest.mark.parametrize("up", ["Z", "Y"])
def test_flights(load, tmp_path, up):
    """Where USD itself has the points at each time; also straight up, and with a stretch."""
    from pxr import Usd, UsdGeom

    turns = samples((0, "(10, 20, 30)"), (1, "(40, -90, 200)"), (4, "(300, 50, 400)"))
    place = moving(
        "double3 xformOp:translate.timeSamples = " + samples((0, "(500, 6, 7)"), (4, "(0, 0, 9)")),
        f"float3 xformOp:rotateXYZ.timeSamples = {turns}",
        "float3 xformOp:scale.timeSamples = " + samples((0, "(2, 3, 4)")),
    )
    head = TIMES.replace('"Z"', f'"{up}"').replace("metersPerUnit = 1", "metersPerUnit = 0.01")
    model = load(xform("Car", mesh(), place), head=head)
    assert model.remarks == ("the model moves with time: flight.csv is a path for [flight]",)
    assert list(model.files) == ["flight.csv"]
    rows = rows_of(model.files["flight.csv"])
    assert rows["time_s"].tolist() == [0, 0.5, 1, 1.5, 2]
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    box = UsdGeom.Mesh(stage.GetPrimAtPath("/Car/Box"))
    points = np.c_[np.array(box.GetPointsAttr().Get()), np.ones(8)]
    for k in range(5):
        matrix = np.array(UsdGeom.XformCache(k).GetLocalToWorldTransform(box.GetPrim()))
        expected = 0.01 * (points @ matrix)[:, :3] @ AXES[up].T
        attitude = turned(*(rows[f"{name}_deg"][k] for name in ("yaw", "pitch", "roll")))
        position = np.array([rows[f"{axis}_m"][k] for axis in "xyz"])
        found = (model.vertices - model.box.mean(axis=0)) @ attitude.T + position
        assert found == pytest.approx(expected, abs=1e-7)
    # In its own axes the model is not turned, and stays by the origin
    assert np.sort(np.ptp(model.box, axis=0)) == pytest.approx([0.02, 0.03, 0.04])
    assert abs(model.box).max() < 0.05


def heli(*rotor, inside=""):
    """A hull that stays, and what is above it."""
    return xform("Heli", mesh("Hull") + xform("Rotor", mesh("Blade"), moving(*rotor)) + inside)


ROTOR = (
    "double3 xformOp:translate.timeSamples = " + samples((0, "(3, 0, 0)"), (4, "(3, 0, 8)")),
    "float xformOp:rotateZ.timeSamples = " + samples((0, 0), (4, 480)),
)


def test_motions_of_groups(load, tmp_path):
    """The blade turns about its corner and rises; the scene has it where USD has it."""
    model = load(heli(*ROTOR), head=TIMES)
    (remark,) = model.remarks
    assert remark == "groups move with time (Rotor): motion.toml is a sweep over motion.csv"
    conditions = tomllib.loads(model.files["motion.toml"])["conditions"]
    assert {*conditions} == {f"Rotor.{name}" for name in ("x_m", "y_m", "z_m", "yaw_deg")}
    rows = rows_of(model.files["motion.csv"])
    assert {entry["column"] for entry in conditions.values()} == rows.keys() - {"time_s"}
    export(model, tmp_path / "heli")
    for k in (1, 3):
        values = {name: rows[name][k] for name in rows if name != "time_s"}
        scene = mi_lcair.load(tmp_path / "heli" / "scene.xml")
        set_values(scene, values)
        blade = next(s for s in scene.mi.shapes() if s.emitter().group == "Rotor")
        vertices = blade.vertex_positions_buffer().numpy().reshape(-1, 3)
        still = load(heli(*ROTOR), head=TIMES.replace("startTimeCode = 0", f"startTimeCode = {k}"))
        expected = still.vertices[np.unique(still.corners[still.first[6] :])]
        for point in expected:
            assert abs(vertices - point).max(axis=1).min() < 1e-5


@pytest.mark.parametrize(
    "rotor, inside, remark",
    [
        (
            ("float3 xformOp:scale.timeSamples = {0: (1, 1, 1), 4: (1, 1, 2)}",),
            "",
            "changes size or shape with time, and keeps the first one: /Heli/Rotor/Blade",
        ),
        (
            ("double3 xformOp:translate.timeSamples = {0: (3, 0, 0), 4: (3, 0, 8)}",),
            xform("Tail", mesh("A", more='custom string thermal:group = "Rotor"')),
            "parts of group Rotor move apart, and keep the first pose",
        ),
        (
            ROTOR,
            mesh("B", more='token visibility.timeSamples = {0: "inherited", 2: "invisible"}'),
            "meshes appear or vanish with time; no motion is read: /",
        ),
    ],
)
def test_what_is_no_motion(load, rotor, inside, remark):
    model = load(heli(*rotor, inside=inside), head=TIMES)
    assert remark in model.remarks and model.files == {}


def test_moving_instances(load):
    """Of a point instancer: one rises, and both are one group, whose parts move apart."""
    rows = instancer((0, 0), ("</Rows/A>",), "", xform("A", mesh()))
    still, risen = "[(0, 0, 0), (4, 0, 0)]", "[(0, 0, 0), (4, 0, 9)]"
    samples_of = f"point3f[] positions.timeSamples = {{0: {still}, 4: {risen}}}"
    rows = rows.replace("point3f[] positions = [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)]", samples_of)
    model = load(rows, head=TIMES)
    assert model.remarks == ("parts of group self move apart, and keep the first pose",)
    many = load(rows, head=TIMES.replace("endTimeCode = 4", "endTimeCode = 1e9"))
    assert many.remarks == ("too many times to read a motion: /",)


def test_one_sample_is_no_motion(load):
    place = moving("double3 xformOp:translate.timeSamples = {1: (1, 2, 3)}")
    model = load(xform("Car", mesh(), place), head=TIMES)
    assert model.files == {} and model.remarks == () and model.box[0].tolist() == [1, 2, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    "inside",
    [
        xform("Mirrored", mesh(), moved(0, 0, 0, "float3 xformOp:scale = (-1, 1, 1)")),
        mesh(faces=[side[::-1] for side in SIDES], more='uniform token orientation = "leftHanded"'),
        mesh("Sheet", *SQUARE, more="uniform bool doubleSided = 1"),
    ],
)
def test_radiances(load, tmp_path, inside):
    """A grey face of 1 m2 at 320 K sends .8 of a blackbody's intensity, seen from both sides."""
    model = load(inside, material="0.8", temperature=320.0)
    export(model, tmp_path / "out")
    for elevation_deg in (90, -90):
        view = {"elevation_deg": elevation_deg, "resolution": 16}
        scene = mi_lcair.load(tmp_path / "out" / "scene.xml", **view)
        expected = 0.8 * in_band_radiance(scene.band, 320.0)
        assert mi_lcair.signature(scene, spp=64).intensity == pytest.approx(expected, rel=0.01)
