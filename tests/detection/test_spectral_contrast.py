"""Contrasts of a target whose material depends on wavelength, against own quadratures."""

import numpy as np
import pytest

from mi_lcair.api.scenarios import contrast
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import bands
from tests.detection.disc_scenario import AREA, XML, disc, write_disc
from tests.detection.test_contrast import planck

X = np.linspace(7.5, 12.5, 101)
EMISSIVITY = 0.85 + 0.1 * np.sin(3 * X)  # of a paint with structure in the windows of the air


@pytest.fixture
def folder(tmp_path):
    write_disc(tmp_path)
    rows = "".join(f"{x:.12g},{y:.12g}\n" for x, y in zip(X, EMISSIVITY))
    (tmp_path / "paint.csv").write_text("wavelength_um,emissivity\n" + rows)
    (tmp_path / "own.toml").write_text('[paint.spectral]\nemissivity = "paint.csv"\n')
    surface = '<bsdf type="material"> <string name="materials" value="own.toml"/>'
    xml = (
        XML.replace("MWIR", "LWIR")
        .replace('<bsdf type="sandford_robertson">', surface)
        .replace("blackbody", "paint")
    )
    (tmp_path / "disc.xml").write_text(
        xml.replace("TEMPERATURE", '<float name="temperature" value="$temperature"/>')
    )
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("temperature,range_m", [(310, 2000.0), (297, 500.0)])
def test_disc_through_air(folder, temperature, range_m):
    xml = (folder / "disc.xml").read_text()
    (folder / "disc.xml").write_text(xml.replace('value="400"', f'value="{temperature}"'))
    scenario = disc(
        folder,
        sensor__band="LWIR",
        atmosphere__table="midlat_summer",
        observer__range_m=range_m,
    )
    got = contrast(scenario).rows[0]
    air = clear_air("midlat_summer")
    along = air.ray(50.0, 0.0, range_m)
    x = np.linspace(8, 12, 400_001)
    rows = bands().wavelengths_um
    transmittance = np.interp(x, rows, bands().transmittance(along.amounts[-1]))
    path = np.interp(x, rows, air.emitted(along).radiance)
    emitted = np.interp(x, X, EMISSIVITY) * planck(x, temperature)
    total = np.trapezoid(transmittance * emitted + path - planck(x, 294), x) * AREA / range_m**2
    target = np.trapezoid(transmittance * emitted, x) * AREA / range_m**2
    assert got.target.value == pytest.approx(target, rel=3e-4)
    assert got.total.value == pytest.approx(total, abs=3e-4 * target)
