"""Intensities whose sources cannot be told apart."""

import mitsuba as mi
import pytest

import mi_lcair
from tests.uncertainty.plate_scene import (
    TEMPERATURE,
    plate_scene,
    row,
)

mi.set_variant("llvm_ad_mono")


def test_a_scene_whose_sources_have_no_spectra(tmp_path):
    """In the band `total` everything is rendered: dI/dT = 4 I / T."""
    found = mi_lcair.budget(
        plate_scene(tmp_path, band="total"), {"sigma": {"plate.temperature": 3}}
    )
    contribution = row(found, "plate.temperature").contribution
    assert contribution == pytest.approx(4 * found.value / TEMPERATURE * 3, rel=1e-3)
    (check,) = found.checks
    assert check.holds and check.plus == pytest.approx(contribution, rel=0.05)
