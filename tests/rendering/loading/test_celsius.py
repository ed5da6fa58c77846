"""Temperatures that are probably meant in degrees Celsius are remarked."""

import pytest

import mi_lcair


@pytest.mark.parametrize(
    "kelvin, is_remarked", [(3.0, False), (27.0, True), (60.0, True), (61.0, False), (300.0, False)]
)
def test_a_low_temperature_is_remarked(kelvin, is_remarked):
    """27 for 300.15 K gives a black image in every band, which nothing else explains."""
    scene = mi_lcair.load("furnace", temperature=str(kelvin))
    remarks = [remark for remark in scene.remarks if "Celsius" in remark]
    assert bool(remarks) is is_remarked
    if is_remarked:
        assert f"{kelvin:g} K" in remarks[0] and f"{kelvin + 273.15:g}" in remarks[0]
