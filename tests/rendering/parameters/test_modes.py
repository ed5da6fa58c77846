"""Patterns of facet temperatures as parameters: their values, derivatives and uses."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import changed, parameters_of

KELVIN = np.array([302.0, 299.0, 300.0, 301.0, 300.0, 332.0, 294.0])
PATTERNS = {"h": [-1.0, 0, 0, -0.5, -0.3, -6.6, 0.9], "sky_K": [0.2, 0.2, 0.1, 0, 0, 1.9, 2.2]}
VIEW = {"azimuth_deg": 30, "elevation_deg": 40}
VALUES = {"heat.h": 1.5, "heat.sky_K": -0.5}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The box of the examples and a file of modes."""
    path = tmp_path_factory.mktemp("modes")
    model = models3d.read(scenes.FOLDER / "examples" / "box.obj")
    models3d.export(model, path)
    head = "facet,kelvin,error_K,by_h_K,by_sky_K_K\n"
    cells = zip(KELVIN, *PATTERNS.values())
    lines = [f"{k},{kelvin},1,{h},{sky}\n" for k, (kelvin, h, sky) in enumerate(cells)]
    (path / "heat.csv").write_text(head + "".join(lines))
    return path


@pytest.fixture(scope="module")
def box(folder):
    return mi_lcair.load(folder / "scene.xml", modes=folder / "heat.csv", resolution=16, **VIEW)


def temperatures(scene):
    return facet_matrix(scene, spp=16).temperature


def test_values_add_their_patterns(box):
    assert {n: p.value for n, p in parameters_of(box).items() if p.kind == "mode"} == {
        "heat.h": 0.0,
        "heat.sky_K": 0.0,
    }
    np.testing.assert_allclose(temperatures(box), KELVIN, atol=1e-4)
    with changed(box, VALUES):
        expected = KELVIN + 1.5 * np.array(PATTERNS["h"]) - 0.5 * np.array(PATTERNS["sky_K"])
        np.testing.assert_allclose(temperatures(box), expected, atol=1e-4)
        now = {n: p.value for n, p in parameters_of(box).items() if p.kind == "mode"}
        assert now == pytest.approx(VALUES, abs=1e-3)
    np.testing.assert_array_equal(temperatures(box), KELVIN.astype(np.float32))


def test_budgets_count_all_modes(box):
    """By themselves, as each is an error of one standard deviation."""
    stated = {"sigma": dict.fromkeys(("heat.h", "heat.sky_K"), 1.0)}
    alone, told = (mi_lcair.budget(box, *u, spp=16) for u in ([], [stated]))
    assert alone.estimate == told.estimate


def test_derivative_is_that_of_all_temperatures(box):
    """The sum over the facets of effective area, slope of the radiance and pattern."""
    of_paths = mi_lcair.sensitivities(box, ["heat.h"], spp=64)
    traced = facet_matrix(box, spp=64, model_only=True)
    shift = 0.01 * np.array(PATTERNS["h"])
    ends = [in_band_radiance(traced.band, KELVIN + sign * shift) for sign in (1, -1)]
    weights = np.array([matrix.sum(axis=0) for matrix in traced.matrices]).mean(axis=0)
    window = of_paths.value / (weights @ in_band_radiance(traced.band, KELVIN))
    expected = window * weights @ (ends[0] - ends[1]) / 0.02
    assert of_paths.derivative[0] == pytest.approx(expected, rel=0.02)


def test_an_image_gives_the_amplitude_back(box, folder):
    """`invert` finds it within its interval."""
    with changed(box, {"heat.h": 0.7}):
        mi_lcair.render(box, spp=64, seed=5).save(folder / "image.exr")
    data = {
        "scene": str(folder / "scene.xml"),
        "image": str(folder / "image.exr"),
        "netd_mK": 50,
        "parameters": {"modes": str(folder / "heat.csv"), "resolution": 16} | VIEW,
    }
    problem = {"data": [data], "unknowns": {"heat.h": {}}, "render": {"spp": 64}}
    (answer,) = mi_lcair.invert(problem).as_dict()["unknowns"]
    assert answer["verdict"] == "determined"
    assert abs(answer["value"] - 0.7) < 3 * answer["standard_error"]


def test_refused(folder):
    for text, message in (
        ("facet,kelvin\n0,300\n", "no column by_NAME_K"),
        ("facet,kelvin,by_h_K\n90,300,1\n", "none of its facets"),
        ("facet,kelvin,by_h_K\n0,-300,1\n", "kelvin = -300"),
    ):
        (folder / "bad.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            mi_lcair.load(folder / "scene.xml", modes=folder / "bad.csv")
