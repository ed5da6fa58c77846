"""Imported models between sky and ground against hand integrals, from the file to the intensity."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair import models3d
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.surroundings import Words
from tests.matrix import some_of
from tests.plugins.emitters.test_sky import reflected_by

EMISSIVITY, KELVIN = 0.6, 300.0
OBJ = "v 0 0 0\nv {x} 0 {z}\nv {x} 1 {z}\nv 0 1 0\no plate\nf 1 2 3 4\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", some_of(["MWIR", "LWIR"], 2))
def test_grey_plate(tmp_path, name):
    """A plate of 1 m^2, tilted by 30 degrees, seen from above its face."""
    tilt = np.radians(30)
    (tmp_path / "plate.obj").write_text(OBJ.format(x=np.cos(tilt), z=np.sin(tilt)))
    model = models3d.read(tmp_path / "plate.obj", material=str(EMISSIVITY), temperature=KELVIN)
    models3d.export(model, tmp_path / "plate", around=Words(sky="clear", ground="288"))
    view = {"azimuth_deg": 180, "elevation_deg": 60, "band": name}
    found = mi_lcair.signature(mi_lcair.load(tmp_path / "plate", **view), tolerance=5e-4)
    ground = in_band_radiance(band(name), 288.0)
    expected = EMISSIVITY * in_band_radiance(band(name), KELVIN)
    expected += (1 - EMISSIVITY) * reflected_by(name, 30, ground)
    assert found.target.intensity == pytest.approx(expected, rel=2e-3)


def test_sky_facets_and_a_sky(tmp_path):
    text = OBJ.format(x=1, z=0).replace("plate", "s*blackbody*250*")
    (tmp_path / "sky.obj").write_text(text)
    model = models3d.read(tmp_path / "sky.obj")
    with pytest.raises(InputError, match="already has sky facets"):
        models3d.export(model, tmp_path / "out", around=Words(sky="clear"))
    assert not (tmp_path / "out").exists()
    models3d.export(model, tmp_path / "out", around=Words(ground="288"))
