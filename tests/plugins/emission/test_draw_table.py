"""Upper bounds of what emitters radiate: of every kind, and of none that is not known."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.emission.draw_table import FieldOfView, radiance_bound, texels, texture_bound
from tests.plugins.conftest import (
    FILM,
    plate,  # noqa: F401, fixture
)
from tests.plugins.small_scenes import GREY, SQUARE, blackbody, camera

PICTURE = np.array([[1.0, 2.0], [3.0, 400.0]], dtype=np.float32)


def bitmap():
    return {"type": "bitmap", "bitmap": mi.Bitmap(PICTURE), "raw": True}


@pytest.mark.parametrize(
    "emitter, expected",
    [
        ({"type": "thermal", "radiance": 7.0}, 7.0),
        ({"type": "thermal", "radiance": 7.0, "emissivity": 0.5}, 3.5),
        ({"type": "thermal", "band": "LWIR", "temperature": 500.0}, blackbody(500.0)),
        ({"type": "thermal", "band": "LWIR", "temperature": bitmap()}, blackbody(400.0)),
        ({"type": "area", "radiance": {"type": "uniform", "value": 3.0}}, 3.0),
        ({"type": "area", "radiance": bitmap()}, 400.0),
        (
            {
                "type": "area",
                "radiance": {
                    "type": "checkerboard",
                    "color0": {"type": "uniform", "value": 3.0},
                    "color1": bitmap(),
                },
            },
            400.0,
        ),
    ],
)
def test_on_a_shape(emitter, expected):
    shape = mi.load_dict({"type": "rectangle", "emitter": emitter})
    assert radiance_bound(shape.emitter()) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "emitter, expected",
    [
        ({"type": "constant", "radiance": {"type": "uniform", "value": 5.0}}, 5.0),
        ({"type": "envmap", "bitmap": mi.Bitmap(PICTURE), "scale": 2.0}, 800.0),
    ],
)
def test_around_the_scene(emitter, expected):
    assert radiance_bound(mi.load_dict(emitter)) == pytest.approx(expected, rel=1e-6)


def test_per_facet(plate):  # noqa: F811
    mesh = mi.load_dict(plate("two", SQUARE, GREY, [300.0, 700.0]))
    mesh.emitter().refresh()
    np.testing.assert_allclose(
        radiance_bound(mesh.emitter()), [blackbody(300.0), blackbody(700.0)], rtol=1e-6
    )


def attribute(name):
    return {"type": "mesh_attribute", "name": name, "scale": 2.0}


def board(*colours):
    return {"type": "checkerboard"} | dict(zip(("color0", "color1"), colours))


@pytest.mark.parametrize(
    "radiance, expected",
    [
        (attribute("face_glow"), [8.0, 1400.0]),
        (attribute("vertex_glow"), [18.0]),
        (board(attribute("face_glow"), attribute("vertex_glow")), [18.0, 1400.0]),
        (board(attribute("face_glow"), {"type": "uniform", "value": 30.0}), [30.0, 1400.0]),
        (
            board(attribute("face_glow"), {"type": "volume", "volume": {"type": "constvolume"}}),
            None,
        ),
        (board(attribute("face_missing"), {"type": "uniform", "value": 30.0}), None),
    ],
)
def test_textures_of_a_mesh(radiance, expected):
    """Values of facets stay by facet, also beside others; the largest of the corners counts."""
    mesh = mi.Mesh("square", 4, 2)
    mesh.add_attribute("face_glow", 1, [4.0, 700.0])
    mesh.add_attribute("vertex_glow", 1, [1.0, 9.0, 3.0, 2.0])
    bound = texture_bound(mi.load_dict(radiance), mesh)
    assert bound is None if expected is None else bound.tolist() == expected


def test_not_known():
    projector = {"type": "projector", "irradiance": {"type": "uniform", "value": 1.0}}
    assert radiance_bound(mi.load_dict(projector)) is None


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
def test_field_of_view(kind):
    """What lies beside, above or behind a camera at z = 20 that looks down on 10 m is excluded."""
    sensor = camera(4, 10.0)
    if kind == "perspective":
        sensor = {
            "type": "perspective",
            "fov": 2 * np.degrees(np.arctan(5 / 20)),
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 20], [0, 0, 0], [0, 1, 0]),
            "film": sensor["film"],
        }
    field = FieldOfView(mi.load_dict(sensor))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    places = [[0, 0, 0], [4.5, 4.5, 0], [5.5, 0, 0], [0, -6.5, 0], [0, 0, 25]]
    triangles = corners + np.array(places, dtype=float)[:, None]
    assert field.excludes(triangles).tolist() == [False, False, True, True, True]


def test_any_other_sensor_sees_everything():
    field = FieldOfView(
        mi.load_dict({"type": "radiancemeter", "film": {**FILM, "width": 1, "height": 1}})
    )
    assert not field.excludes(np.full((1, 3, 3), 1e9)).any()


def test_texels_of_8_bits_are_fractions():
    np.testing.assert_allclose(texels(mi.TensorXu8(np.uint8([0, 51, 255]))), [0, 0.2, 1])
    np.testing.assert_allclose(texels(mi.TensorXf([0.0, 51.0])), [0, 51])
