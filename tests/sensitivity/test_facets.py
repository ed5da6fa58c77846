"""The matrix of facets gives the image at any temperatures of the facets."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.window import PIXEL_RANDOMISATIONS
from mi_lcair.sensitivity import facets
from mi_lcair.sensitivity.facets import facet_matrix
from tests.sensitivity.waist import smooth_temperatures, write_scene

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
    return mi_lcair.render(scene, spp=16, seed=3, split=None, **settings).channels["Y"]


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
    with pytest.raises(InputError, match="spp = 0 must be positive"):
        facet_matrix(load(), spp=0)
    tail = load(extra='<string name="closure" value="tail"/>')
    with pytest.raises(InputError, match="closure = tail is not linear"):
        matrix_of(tail)
