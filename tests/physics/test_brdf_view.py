"""The tables and the picture of a BRDF show the model's values and its reflectance."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.brdf_view import brdf_view
from mi_lcair.reports.pictures.brdf import scale
from tests.physics import thesis


@pytest.mark.parametrize(
    "name, band, theta_i", [("bare_aluminum", "MWIR", 30), ("gloss_black", "LWIR", 60)]
)
def test_values_are_the_models(name, band, theta_i):
    """The values agree with the thesis's equations, in the plane of incidence and outside it.

    The peak lies in the mirror direction.
    """
    view = brdf_view(name, band, theta_i)
    m = view.material
    rows = np.linspace(0, len(view.theta_r) - 1, 9).astype(int)
    columns = np.linspace(0, len(view.azimuth) - 1, 8).astype(int)
    for row in rows:
        for column in columns:
            angles = np.radians([theta_i, view.theta_r[row], 180 - view.azimuth[column]])
            expected = thesis.brdf(np, *angles, *m.values)
            assert view.brdf[row, column] == pytest.approx(expected, rel=1e-6)
    row, column = np.unravel_index(view.brdf.argmax(), view.brdf.shape)
    assert (view.theta_r[row], view.azimuth[column]) == (
        pytest.approx(theta_i, abs=0.1),
        pytest.approx(0, abs=1e-9),
    )
    assert view.cut_theta_r[view.cut.argmax()] == pytest.approx(theta_i, abs=0.1)


def test_the_grid_resolves_the_lobe():
    """The sum of f cos(theta_r) over the picture's nodes is the DHR within 1 %.

    This shows that no peak lies between the nodes.
    """
    view = brdf_view("bare_aluminum", "MWIR", 30)
    theta = np.radians(view.theta_r)
    inner = (
        np.trapezoid(view.brdf, np.radians(view.azimuth), axis=1) * np.cos(theta) * np.sin(theta)
    )
    assert np.trapezoid(inner, theta) == pytest.approx(view.dhr, rel=0.01)
    assert view.dhr + view.emissivity == pytest.approx(1, abs=0.01)


def test_ideal_surfaces():
    diffuse, black = brdf_view("diffuse", "MWIR"), brdf_view("blackbody", "3.5-4.2", 0)
    assert (
        np.allclose(diffuse.brdf, 1 / np.pi)
        and diffuse.dhr == pytest.approx(1)
        and diffuse.emissivity == pytest.approx(0, abs=1e-9)
    )
    assert not black.brdf.any() and (black.dhr, black.emissivity) == (0, 1)
    assert scale(diffuse) == pytest.approx((10**-0.5 / np.pi, 10**0.5 / np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("name, theta_i", [("gloss_black", 75), ("diffuse", 0), ("blackbody", 30)])
def test_picture(tmp_path, name, theta_i):
    """A picture is drawn without a warning, also for a constant BRDF and for one that is 0."""
    brdf_view(name, "LWIR", theta_i).plot(tmp_path / "brdf.png")
    assert (tmp_path / "brdf.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("theta_i", [-1, 90, float("nan")])
def test_angles_beyond_the_hemisphere(theta_i):
    with pytest.raises(InputError, match="must lie in 0..90"):
        brdf_view("diffuse", "MWIR", theta_i)


def test_impossible_parameters(tmp_path):
    (tmp_path / "fit.json").write_text(
        '{"parameters": {"epsilon": 0.9, "rho_d": 0.2, "b": 0, "e": 0.1}, '
        '"form": "thesis", "band": "MWIR"}'
    )
    with pytest.raises(InputError, match="epsilon \\+ rho_d = 1.1"):
        brdf_view(str(tmp_path / "fit.json"), "MWIR")
