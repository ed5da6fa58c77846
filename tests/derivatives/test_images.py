"""Errors of derivatives by pixel, against closed forms."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.lit import X, Y, turned_to_front
from docs.studies.claims.scene_file import BLACK, UP, Place, SceneFile, diffuse, thermal
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import to_polygon
from mi_lcair.derivatives import images as facets
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.rendering.window import PIXEL_RANDOMISATIONS
from tests.derivatives.waist import smooth_temperatures, write_scene

# The matrix of facets gives the image at any temperatures of the facets
# ----------------------------------------------------------------------

RINGS = SEGMENTS = 6
ROUNDING = 2e-6  # of Float32, relative to the brightest pixel
WARM = smooth_temperatures(RINGS, SEGMENTS)


@pytest.fixture
def load(tmp_path):
    def loaded(temperature=WARM, **settings):
        settings = {"size": 16, "views": 1, **settings}
        return mi_lcair.load(write_scene(tmp_path, temperature, RINGS, SEGMENTS, **settings))

    return loaded


def image(scene, **settings):
    return mi_lcair.render(scene, spp=16, seed=3, **settings).channels["Y"]


def matrix_of(scene, **settings):
    return facet_matrix(scene, spp=16, seed=3, randomisations=PIXEL_RANDOMISATIONS, **settings)


def assert_same(found, expected):
    assert np.abs(found - expected).max() < ROUNDING * expected.max()


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"emitter_sampling": True},
        {
            "extra": '<string name="closure" value="ambient"/> '
            '<float name="ambient_temperature" value="280"/>',
            "max_bounces": 1,
        },
    ],
)
def test_it_gives_the_render(load, settings):
    """Also with a part that belongs to no facet: the ambient closure's, and the sky's."""
    scene = load(**settings)
    rendered = image(scene)
    for groups in (None, ["body"]):
        assert_same(matrix_of(scene, groups=groups).radiance().mean(axis=0), rendered)


def test_other_temperatures_need_no_other_paths(load):
    scene = load()
    matrix = matrix_of(scene, groups=["body"])
    hotter = WARM + np.linspace(-20, 40, len(WARM))
    assert_same(matrix.radiance(hotter).mean(axis=0), image(load(hotter)))


def test_a_temperature_set_in_the_scene_counts(load):
    scene = load()
    parameters = mi.traverse(scene.mi)
    parameters["body.face_temperature"] = parameters["body.face_temperature"] + 10
    parameters.update()
    found = matrix_of(scene, groups=["body"])
    assert found.temperature == pytest.approx(WARM + 10, abs=1e-4)
    assert_same(found.radiance().mean(axis=0), image(scene))


def test_facets_too_cold_to_radiate_have_columns(load):
    cold = WARM.copy()
    cold[::2] = 2.0
    warm, found = matrix_of(load()), matrix_of(load(cold))
    for a, b in zip(warm.matrices, found.matrices):
        assert a.nnz > 100
        assert abs(a - b).max() == 0


def test_rows_in_a_furnace_add_up_to_one(load):
    """A diffuse lobe reflects with a constant weight, so that every path gives 1."""
    scene = load(np.full(len(WARM), 300.0), sky=300.0, max_bounces=16, lobe="diffuse")
    found = matrix_of(scene)
    sums = np.array([matrix.sum(axis=1) for matrix in found.matrices])
    assert sums == pytest.approx(1, abs=1e-5)
    assert not found.rest.any()


def test_columns_are_the_facets_of_the_groups(load):
    scene = load()
    assert matrix_of(scene).facets.tolist() == list(range(len(WARM) + 1))
    assert matrix_of(scene, groups=["sky"]).facets.tolist() == [len(WARM)]
    of_body = matrix_of(scene, groups=["body"])
    assert of_body.temperature == pytest.approx(WARM, abs=1e-4)
    assert of_body.rest.max() > 1


def test_many_passes_give_the_same(load, monkeypatch):
    """Passes over some pixels, and passes over some points of one pixel."""
    scene = load(size=6)
    whole = matrix_of(scene)
    for slots in (300, 20):
        monkeypatch.setattr(facets, "PASS_SLOTS", slots)
        parts = matrix_of(scene)
        assert abs(parts.matrices[1] - whole.matrices[1]).max() < 1e-12
        assert parts.rest == pytest.approx(whole.rest, rel=1e-12)


def test_randomisations_are_independent(load):
    """They differ, and the mean of many is that of another seed within its errors."""
    scene = load()
    found = facet_matrix(scene, spp=16, randomisations=8)
    other = facet_matrix(scene, spp=512, seed=9, randomisations=2).radiance().mean(axis=0)
    images = found.radiance()
    errors = images.std(axis=0, ddof=1) / np.sqrt(8)
    assert len(found.matrices) == 8
    assert np.abs(images.mean(axis=0) - other).mean() < 3 * errors.mean()
    assert (errors > 0).mean() > 0.3


def test_bad_input_is_one_line(load):
    with pytest.raises(InputError, match="unknown group 'bdy'; known: body, sky"):
        matrix_of(load(), groups=["bdy"])
    with pytest.raises(InputError, match="spp = 0; must be positive"):
        facet_matrix(load(), spp=0)
    tail = load(extra='<string name="closure" value="tail"/>')
    with pytest.raises(InputError, match="closure = tail is not linear"):
        matrix_of(tail)


REFLECTANCE, HOT, HALF_WINDOW = 0.5, 1000.0, 0.02


@pytest.mark.parametrize("sampling", ["false", "true"])
def test_errors_hold_a_lamp_that_no_path_meets(tmp_path, sampling):
    """8 x 8 pixels of a floor below a lamp of 1 cm, which fills 1.3e-4 of its hemisphere."""
    file, height = SceneFile(Place()), 0.5
    file.rectangle(np.zeros(3), X, Y, diffuse(REFLECTANCE, "floor") + thermal("floor", 250.0))
    lamp = turned_to_front((height * UP, 5e-3 * X, 5e-3 * Y), -UP)
    file.rectangle(*lamp, BLACK + thermal("lamp", HOT))
    file.camera(0.2 * UP, -UP, Y, HALF_WINDOW, 4.0)
    scene = mi_lcair.load(file.write(tmp_path, "MWIR", 1, sampling))
    names = ["lamp.temperature", "floor.reflectance"]
    result = mi_lcair.derivative_images(scene, names, spp=16, seed=1)
    share = to_polygon(np.zeros((1, 3)), UP, corners(lamp))[0]
    radiance = {T: planck.in_band_radiance("MWIR", T) for T in (HOT - 1, HOT, HOT + 1, 250.0)}
    slope = (radiance[HOT + 1] - radiance[HOT - 1]) / 2
    truths = [REFLECTANCE * share * slope, share * radiance[HOT] - radiance[250.0]]
    for truth, value, error in zip(truths, result.derivative, result.derivative_error):
        assert np.mean(abs(value - truth) < 2 * error + 1e-3 * abs(truth)) > 0.9
    if sampling == "true":
        assert np.median(result.derivative_error[0]) < 0.1 * truths[0]
