"""The page on real measurements.

Its computations are tested, and all its fields are filled. The fits are invented.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from docs.studies import real_data, real_data_tables
from mi_lcair.fitting import read
from mi_lcair.fitting.data import COMPARED
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.results import PARAMETERS, emissivity, fit_of, measurements

REAL = Path(__file__).parents[3] / "shared" / "data" / "mwir_brdf"


def surface(data=None, **parts):
    data = data or measurements()
    fits = {
        "alone": fit_with_candidates(data),
        "joint": fit_with_candidates(data, emissivity=emissivity()),
        "by_loss": {loss: (fit_of(data),) * 3 for loss in ("log", "cube_root", "linear")},
    }
    return real_data.Surface("A surface", data, emissivity(), **{**fits, **parts})


def fit_with_candidates(data, **options):
    fit = fit_of(data, **options)
    fit.candidates = [
        {
            "model": fit.model,
            "form": form,
            "restriction": restriction,
            "rms_dex": rms if restriction is None else 9,
            "parameters": fit.parameters,
        }
        for form, rms in zip(MODELS[fit.model].forms, (0.1, 0.2))
        for restriction in ("b = 0", None)
    ]
    return fit


def test_reflectance_of_a_round_lobe():
    """A lobe f cos(theta_i) = A exp(-(delta / w)^2) has the reflectance of its integral.

    The scan extends further on one side of the mirror direction than on the other.
    """
    A, w = 3.0, np.radians(18)
    theta_i = np.arange(1, 88)
    data = measurements(theta_i=theta_i, theta_r=(20, 40))
    data.brdf = A * np.exp(-(((data.theta_r - data.theta_i) / w) ** 2)) / np.cos(data.theta_i)
    assert surface(data).isotropic_reflectance == pytest.approx(
        quad(
            lambda delta: 2 * np.pi * A * np.exp(-((delta / w) ** 2)) * np.sin(delta),
            0,
            np.radians(67),
        )[0],
        rel=1e-3,
    )


def test_mirror_excess_is_measured_over_fitted():
    """It is the geometric mean over the scans in the range, at theta_i = theta_r."""
    data = measurements(theta_i=(20, 30, 80), theta_r=(20, 30, 80))
    one = surface(data)
    mirror = np.isclose(data.theta_i, data.theta_r)
    data.brdf = real_data.predicted(one.joint, data.theta_i, data.theta_r)
    data.brdf[mirror] *= [2, 8, 5]
    data.brdf[~mirror] *= 100
    assert one.median_excess == pytest.approx(100)
    assert one.mirror_excess(15, 70) == pytest.approx(4) and one.mirror_excess(
        80, 80
    ) == pytest.approx(5)


def test_emissivity_errors_cover_the_angles_that_are_asked_for():
    """The emissivity is measured at 15 and 60 degrees. The error up to 50 degrees uses only 15."""
    one = surface()
    errors = one.emissivity_error(one.joint, 80), one.emissivity_error(one.joint, 50)
    one.emissivity.value[1] += 0.3
    assert (
        one.emissivity_error(one.joint, 50) == errors[1]
        and one.emissivity_error(one.joint, 80) != errors[0]
    )
    assert one.forms["normalized"]["error"] == one.emissivity_error(one.joint)
    assert (one.forms["thesis"]["rms_dex"], one.forms["normalized"]["rms_dex"]) == (0.1, 0.2)


def test_halves_share_out_the_scans():
    data = measurements(theta_i=range(1, 80, 2), theta_r=(15, 20, 30))
    half = real_data.part(data, np.unique(data.theta_r)[0::2])
    assert np.degrees(np.unique(half.theta_r)).tolist() == pytest.approx([15, 30])
    assert len(half.theta_i) == len(half.brdf) == 80


def test_spread_of_e():
    small, large = fit_of(measurements()), fit_of(measurements())
    large.parameters = PARAMETERS | {"e": 0.4}
    assert surface(by_loss={"log": (None, small, large)}).spread_of_e("log") == pytest.approx(4)


def test_values_end_where_their_errors_begin():
    fit = fit_of(measurements())
    fit.standard_error = {"epsilon": 0.04, "rho_d": 0.002, "b": 0.4, "e": 3.0}
    fit.verdict |= {"rho_d": "weakly determined: interval 0..1"}
    assert real_data_tables.parameters(fit) == [
        "0.30 ± 0.04 ⁿ",
        "0.333 ± 0.002 ʷ",
        "0.1 ± 0.4 ᵇ",
        "0 ± 3",
    ]


@pytest.mark.slow
def test_the_page_is_filled_and_has_its_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(real_data, "fit", fit_with_candidates)
    monkeypatch.setattr(real_data, "save_plot", lambda path, fits: path.write_text(fits[0][0].name))
    for name in real_data.TITLES:
        rows = "".join(
            f"{i},{r},{0.1 + 2.0 ** -abs(i - r)}\n"
            for r in (15, 20, 30, 80)
            for i in range(1, 88, 3)
        )
        (tmp_path / f"{name}.csv").write_text(
            "# band_um: 3 5\ntheta_i_deg,theta_r_deg,brdf\n"
            + rows
            + "80,80,1\n20,20,1\n15,15,1\n30,30,1\n"
        )
        (tmp_path / f"{name}_emissivity.csv").write_text(
            "theta_deg,emissivity,emissivity_std\n15,0.5,0.1\n70,0.4,0.1\n80,0.3,0.1\n85,0.2,0.1\n"
        )
    real_data.main(tmp_path, tmp_path / "docs" / "page.md")
    page = (tmp_path / "docs" / "page.md").read_text(encoding="utf-8")
    assert "{" not in page and "nan" not in page
    for name, title in real_data.TITLES.items():
        assert f"![{title}](page/{name}.png)" in page
        assert (tmp_path / "docs" / "page" / f"{name}.png").read_text() == title
        # alone and joint for each model, the choice, forms, losses and limits
        assert page.count(f"| {title} | ") == 2 * len(COMPARED) + 4


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason="needs the measured files beside the checkout")
@pytest.mark.parametrize("loss", ["log", "cube_root", "linear"])
def test_half_of_a_real_surface_is_fitted_without_a_warning(loss):
    """The fit passes points where the predicted decrease of the misfit is 0 within rounding."""
    measured = read(REAL / "aluminium_sandblasted.csv")
    half = real_data.part(measured, np.unique(measured.theta_r)[0::2])
    assert real_data.fit(half, form="thesis", loss=loss, starts=64).converged
