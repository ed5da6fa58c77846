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


OUTSIDE = '[surroundings]\nsky = "clear"\nground = "288,0.95"\n'
DAY = '"40,30"'


def constant(folder, name, scenario, **entries):
    """Row of a disc with an emissivity of 0.5, by wavelength or grey, between sky and ground."""
    folder = folder / name
    folder.mkdir()
    write_disc(folder)
    rows = "".join(f"{x},0.5\n" for x in (2, 6, 13))
    (folder / "paint.csv").write_text("wavelength_um,emissivity\n" + rows)
    (folder / "own.toml").write_text('[paint.spectral]\nemissivity = "paint.csv"\n')
    surface = '<bsdf type="material"> <string name="materials" value="own.toml"/>'
    xml = XML.replace('<bsdf type="sandford_robertson">', surface).replace("blackbody", name)
    xml = xml.replace("TEMPERATURE", '<float name="temperature" value="300"/>')
    (folder / "disc.xml").write_text(xml)
    text = (folder / "disc.toml").read_text()
    (folder / "disc.toml").write_text(text[: text.index("[background]")] + scenario)
    return contrast(disc(folder, **entries))


@pytest.mark.slow
@pytest.mark.parametrize(
    "height_m, elevation_deg, sun", [(300.0, 40, None), (3158.0, -25, None), (300.0, 0, DAY)]
)
def test_a_constant_spectrum_is_grey(tmp_path, height_m, elevation_deg, sun):
    """Also for what the surface reflects: sky, sun and ground have crossed air before the path."""
    outside = OUTSIDE + (f"sun = {sun}\n" if sun else "")
    more = '[sensor]\nband = "MWIR"\n[render]\nspp = 2\n'
    rows = [
        constant(
            tmp_path,
            name,
            outside + more,
            atmosphere__table="us_standard",
            observer__range_m=3100.0,
            observer__elevation_deg=elevation_deg,
            target__height_m=height_m,
        )
        for name in ("0.5", "paint")
    ]
    grey, spectral = (made.rows[-1] for made in rows)
    assert spectral.target.value == pytest.approx(grey.target.value, rel=3e-4)
    assert not any("absorbers" in remark for made in rows for remark in made.remarks)
