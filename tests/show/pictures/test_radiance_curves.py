"""Curves of blackbodies, air and skies, as `show` draws them."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.show.pictures import radiance_curves


def lines(figure):
    """The curves of each panel, without its guides, as (x, y)."""
    return [
        [line.get_xydata() for line in panel.lines if not line.get_label().startswith("_")]
        for panel in figure.axes
    ]


def test_blackbodies_follow_planck():
    """Maxima by Wien's displacement law, and values by Planck's law with CODATA's constants."""
    (curves,) = lines(radiance_curves.blackbodies([260, 500.0], "2-14"))
    for curve, kelvin in zip(curves, (260, 500)):
        x, y = curve.T
        assert x[np.argmax(y)] == pytest.approx(2897.771955 / kelvin, abs=0.03)
        planck = 1.191042972e8 / x**5 / np.expm1(14387.76877 / (x * kelvin))
        np.testing.assert_allclose(y, planck, rtol=1e-6)


def test_air_and_sky():
    transmittance, path = lines(radiance_curves.air("us_standard", "LWIR"))
    near, far = (curve[:, 1] for curve in transmittance)
    assert (far < near).all() and (near < 1).all()
    assert (path[1][:, 1] > path[0][:, 1]).all()
    spectra, (by_elevation,) = lines(radiance_curves.sky("us_standard_clear", "MWIR"))
    assert (np.diff(by_elevation[:, 1]) < 0).all()
    zenith = spectra[-1]
    assert np.trapezoid(zenith[:, 1], zenith[:, 0]) == pytest.approx(by_elevation[-1, 1], rel=0.02)


@pytest.mark.parametrize(
    "name, band, message",
    [("vacuum", "MWIR", "no curves"), ("us_standard", "4-6", "cover"), ("x", "total", "total")],
)
def test_what_has_no_curves(name, band, message):
    with pytest.raises(InputError, match=message):
        radiance_curves.air(name, band)


def test_show(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = CliRunner().invoke(main, ["show", "260K,300K", "--band", "2-14"])
    assert answer.exit_code == 0 and Path("260K_300K_2-14.png").is_file()
    answer = CliRunner().invoke(main, ["show", "0K"])
    assert answer.exit_code == 2 and "0 K" in answer.stderr
