"""Tests of hemispherical views: exact view factors, solid angles by quadrature, and the map."""

from math import pi, tan

import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from mi_lcair.errors import InputError
from mi_lcair.reports.pictures.hemispherical_view import places
from mi_lcair.scenes import build_meshes
from mi_lcair.signatures.hemispherical_view import (
    MAP_PHI,
    MAP_THETA,
    NOTHING,
    frame,
    hemispherical_view,
)

# View factors between the walls of a cube (Howell C-11, C-14).
OPPOSITE, ADJACENT = 0.19982489569838746, 0.20004377607540316
CUBE = """<scene version="3.0.0"> <integrator type="bounce_path"/>
    <sensor type="orthographic">
        <film type="hdrfilm"> <string name="pixel_format" value="luminance"/> </film>
    </sensor>
    <shape type="ply"> <string name="filename" value="cube.ply"/>
        <boolean name="face_normals" value="true"/> <bsdf type="diffuse"/>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape> {more}
</scene>"""


@pytest.fixture
def cube(tmp_path):
    """A closed room of 2 m; its facets 0 to 5 lie at x = -1, 1, y = -1, 1, z = -1, 1."""

    def load(more=""):
        (tmp_path / "cube.ply").write_bytes(
            build_meshes.ply(*build_meshes.box((2, 2, 2), inward=True))
        )
        (tmp_path / "cube.xml").write_text(CUBE.format(more=more))
        return mi_lcair.load(tmp_path / "cube.xml")

    return load


def factors(view):
    return dict(zip(view.neighbour.tolist(), view.view_factor.tolist()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, facet, other, expected",
    [
        ("two_plates", 0, 1, exact.perpendicular_view_factor(0.1, 0.2, 0.2)),
        ("two_plates", 1, 0, exact.perpendicular_view_factor(0.1, 0.2, 0.2)),
        ("open_box", 0, 1, exact.perpendicular_view_factor(0.2, 0.1, 0.1)),
    ],
)
def test_plates(name, facet, other, expected):
    """View factors of two plates are within 0.5 % (measured: 0.05 %); other rays hit nothing."""
    view = hemispherical_view(mi_lcair.load(name), facet)
    assert view.neighbour.tolist() == [other, NOTHING]
    assert view.view_factor == pytest.approx([expected, 1 - expected], rel=5e-3)
    assert view.view_factor.sum() == pytest.approx(1, abs=1e-3)
    assert view.solid_angle.sum() == pytest.approx(2 * pi, abs=1e-3)


@pytest.mark.slow
def test_closed_cube(cube):
    """View factors and solid angles of a cube's walls are within 0.5 %.

    The exact solid angle is the integral of the cosine at the other wall over the squared distance.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    x, y, u, v = np.meshgrid(*[nodes] * 4, indexing="ij")
    w = np.multiply.outer(np.multiply.outer(weights, weights), np.multiply.outer(weights, weights))
    opposite = np.sum(w * 2 / ((x - u) ** 2 + (y - v) ** 2 + 4) ** 1.5) / 4
    expected = {1: opposite, **dict.fromkeys((2, 3, 4, 5), (2 * pi - opposite) / 4)}

    view = hemispherical_view(cube(), 0)
    assert sorted(view.neighbour[:-1]) == [1, 2, 3, 4, 5] and view.neighbour[-1] == NOTHING
    for number, share in factors(view).items():
        assert share == pytest.approx({1: OPPOSITE, NOTHING: 0}.get(number, ADJACENT), rel=5e-3)
    for number, angle in zip(view.neighbour[:-1].tolist(), view.solid_angle):
        assert angle == pytest.approx(expected[number], rel=5e-3)
    assert view.view_factor.sum() == pytest.approx(
        1, abs=1e-3
    ) and view.solid_angle.sum() == pytest.approx(2 * pi, abs=1e-3)


def test_the_back_of_a_surface_hides_what_is_behind_it(cube):
    """A wall sees little but the back of a plate in front of it."""
    plate = """<shape type="rectangle">
        <transform name="to_world"> <scale value="0.99"/> <translate z="-0.99"/> </transform>
    </shape>"""
    view = hemispherical_view(cube(plate), 4, rays=2**14)
    assert view.facets.count == 7 and view.neighbour[0] == 6 and view.view_factor[0] > 0.97


def test_map_follows_the_thesis_azimuth():
    """The map of two_plates' reflector has the azimuth of the thesis.

    The reflector has its centre at (0.1, 0) and its second vertex at (0.2, -0.05). The middle of
    the emitter, toward -x, therefore lies at the azimuth 180 + atan(1/2) degrees. The emitter's top
    lies there at tan(theta) = 0.1 / 0.2.
    """
    view = hemispherical_view(mi_lcair.load("two_plates"), 0, rays=2**10)
    reference, positive, normal = frame(view.facets, 0)
    np.testing.assert_allclose(reference, np.array([2, -1, 0]) / 5**0.5, atol=1e-6)
    np.testing.assert_allclose(np.cross(reference, positive), normal, atol=1e-12)
    on_emitter = view.map == 1
    columns = np.flatnonzero(on_emitter.any(axis=0))
    phi = (columns + 0.5) / MAP_PHI * 360 - 180
    assert (phi.min(), phi.max()) == (
        pytest.approx(-180, abs=0.3),
        pytest.approx(-180 + 26.565 * 2, abs=0.3),
    )
    top = np.argmax(on_emitter[:, columns[np.argmin(abs(phi + 153.435))]]) / MAP_THETA * pi / 2
    assert tan(top) == pytest.approx(0.5, abs=0.01)
    assert set(np.unique(view.map)) == {NOTHING, 1}


@pytest.mark.slow
def test_map_agrees_with_the_table(cube, tmp_path):
    """The solid angles of the map's pixels add up to those of the table.

    The facet is a tiny tilted plate inside the room.
    """
    plate = build_meshes.rectangle((-5e-4, -5e-4, 0), (1e-3, 0, 0), (0, 1e-3, 0))
    (tmp_path / "plate.ply").write_bytes(build_meshes.ply(*plate))
    view = hemispherical_view(
        cube("""<shape type="ply"> <string name="filename" value="plate.ply"/>
        <boolean name="face_normals" value="true"/> <transform name="to_world">
        <rotate x="0.6" y="0.8" angle="50"/> <translate x="0.3" y="-0.2" z="0.1"/>
        </transform> </shape>"""),
        6,
    )
    edges = np.cos(np.linspace(0, pi / 2, MAP_THETA + 1))
    pixel = np.broadcast_to((edges[:-1] - edges[1:])[:, None] * 2 * pi / MAP_PHI, view.map.shape)
    for number, angle in zip(view.neighbour[:-1].tolist(), view.solid_angle):
        assert pixel[view.map == number].sum() == pytest.approx(angle, abs=2e-3)


@pytest.mark.slow
def test_seed_and_rays(cube):
    scene = cube()
    few = [hemispherical_view(scene, 0, rays=1000, seed=seed) for seed in (1, 1, 2)]
    assert few[0].rays == 1024
    assert factors(few[0]) == factors(few[1]) != factors(few[2])


@pytest.mark.parametrize(
    "facet, reason",
    [
        (6, "facet 6 .* has no normal"),
        (7, "facet 7 .* from 0 to 6"),
        (-1, "facet -1 .* from 0 to 6"),
    ],
)
def test_what_has_no_view(cube, facet, reason):
    scene = cube('<shape type="sphere"> <float name="radius" value="0.1"/> </shape>')
    with pytest.raises(InputError, match=reason):
        hemispherical_view(scene, facet)


@pytest.mark.slow
def test_picture(tmp_path):
    """The number of each facet lies inside its region of the picture."""
    view = hemispherical_view(mi_lcair.load("furnace"), 2, rays=2**12)
    labels = {number: (column, row) for number, column, row in places(view.map)}
    assert {0, 1, 3, 4, 5} <= set(labels)
    for number, (column, row) in labels.items():
        assert view.map[int(row), int(column)] == number
    view.plot(tmp_path / "view.png")
    assert (tmp_path / "view.png").read_bytes().startswith(b"\x89PNG")


def test_json_has_a_row_for_what_escapes():
    table = hemispherical_view(mi_lcair.load("two_plates"), 0, rays=2**10).as_dict()
    assert list(zip(table["columns"]["facet"], table["columns"]["material"])) == [
        (1, "blackbody"),
        (-1, "nothing"),
    ]
    assert table["area_m2"] == pytest.approx(0.02) and table["view_factor"] == 1
