"""Contrasts of plumes that let a background through, against their closed form."""

import re

import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.detection.camera.plate_scenario import CAMERA

RADIUS, RANGE, TRANSMITTANCE, BEHIND_K = 0.5, 1000.0, 0.8, 280.0
SCENE = """<scene version="3.0.0"> <integrator type="bounce_path"/>
<sensor type="orthographic"> <film type="hdrfilm"> <integer name="width" value="8"/>
<integer name="height" value="8"/> <string name="pixel_format" value="luminance"/> </film> </sensor>
<shape type="sphere"> <float name="radius" value="{radius}"/>
<bsdf type="plume"> <float name="transmittance" value="{transmittance}"/> </bsdf>
<emitter type="thermal"> <string name="band" value="LWIR"/>
<float name="temperature" value="{kelvin}"/> </emitter> </shape> </scene>"""
SCENARIO = f"""[target]
scene = "plume.xml"
[observer]
range_m = {RANGE}
azimuth_deg = 30
elevation_deg = 20
[atmosphere]
table = "vacuum"
[background]
temperature = {BEHIND_K}
[sensor]
band = "LWIR"
[render]
spp = 64
resolution = 16
"""
CAMERA_TABLE = "[camera]\n" + "".join(f"{key} = {value}\n" for key, value in CAMERA.items())


def write(folder, kelvin):
    text = SCENE.format(radius=RADIUS, transmittance=TRANSMITTANCE, kelvin=kelvin)
    (folder / "plume.xml").write_text(text)
    (folder / "plume.toml").write_text(SCENARIO)
    return folder / "plume.toml"


def irradiance(kelvin):
    """Of a disc of the plume's size, W m^-2."""
    return float(in_band_radiance(band("LWIR"), kelvin)) * np.pi * (RADIUS / RANGE) ** 2


@pytest.mark.parametrize("kelvin", [BEHIND_K, 320.0])
def test_a_plume_hides_what_it_does_not_let_through(tmp_path, kelvin):
    """Each ray crosses it twice. A plume as warm as its background cannot be seen."""
    row = mi_lcair.contrast(write(tmp_path, kelvin)).rows[-1]
    absorbed = 1 - TRANSMITTANCE**2
    assert row.background.value == pytest.approx(absorbed * irradiance(BEHIND_K), rel=0.01)
    expected = absorbed * (irradiance(kelvin) - irradiance(BEHIND_K))
    assert row.total.value == pytest.approx(expected, rel=0.01, abs=1e-6 * row.target.value)


def test_its_transmittance_changes_what_it_hides(tmp_path):
    """The derivative of the closed form in the transmittance, in budget and inversion."""
    path = write(tmp_path, 320.0)
    budget = mi_lcair.budget(path, {"sigma": {"plume.transmittance": 0.01}})
    (row,) = [row for row in budget.rows if row.quantity == "plume.transmittance"]
    expected = -2 * TRANSMITTANCE * (irradiance(320.0) - irradiance(BEHIND_K))
    assert row.sensitivity == pytest.approx(expected, rel=0.01)
    data = {"scene": str(path), "contrast": -expected / 4, "sigma": 1e-9}
    unknowns = {"plume.transmittance": {"start": 0.8}}
    solution = mi_lcair.invert({"data": [data], "unknowns": unknowns})
    absorbed = 1 - solution["plume.transmittance"].value ** 2
    assert absorbed * (irradiance(320.0) - irradiance(BEHIND_K)) == pytest.approx(
        data["contrast"], rel=0.01
    )


def test_a_plume_by_wavelength_tells_how_far_its_background_is_off(tmp_path):
    """It lets all pass below 10 um and a fifth above, at each of two crossings."""
    path = write(tmp_path, BEHIND_K)
    (tmp_path / "gas.csv").write_text("wavelength_um,transmittance\n7,1\n10,1\n10.001,.2\n15,.2\n")
    scene = tmp_path / "plume.xml"
    stated = '<float name="transmittance" value="0.8"/>'
    by_wavelength = '<string name="spectrum" value="gas.csv"/> <string name="band" value="LWIR"/>'
    scene.write_text(scene.read_text().replace(stated, by_wavelength))
    result = mi_lcair.contrast(path)
    short = float(
        in_band_radiance(band("8-10"), BEHIND_K) / in_band_radiance(band("LWIR"), BEHIND_K)
    )
    hidden = (1 - short) * (1 - 0.2**2)
    error = abs(result.rows[-1].background.value / irradiance(BEHIND_K) - hidden)
    (remark,) = [text for text in result.remarks if "a plume by wavelength" in text]
    stated = float(remark.split("an error of ")[1].split(" %")[0]) / 100
    assert stated == pytest.approx(error, rel=0.1)
    row = result.rows[-1]
    assert row.half_width >= row.approximated
    assert row.approximated == pytest.approx(error * irradiance(BEHIND_K), rel=0.1)
    sweep = {"base": {"scenario": str(path)}, "conditions": {"range_m": [RANGE, 2 * RANGE]}}
    with pytest.warns(UserWarning, match=re.escape(remark)):
        mi_lcair.sweep(sweep)
    path.write_text(path.read_text() + CAMERA_TABLE)
    assert remark in mi_lcair.image(path).remarks
