"""Reflected sunlight and skylight through the air: summed amounts, and remarks where none are."""

import csv

import numpy as np
import pytest

from mi_lcair.api.contrast import contrast
from mi_lcair.detection.remarks import multiplied_light
from mi_lcair.detection.setting import setting_of
from mi_lcair.physics.air.bands import TABLES
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.bands import band
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.plugins.emission.source import Source
from tests.detection.disc_scenario import disc, write_disc

SUN = """<emitter type="sun"> <string name="band" value="MWIR"/>
    <float name="azimuth_deg" value="30"/> <float name="elevation_deg" value="45"/>
    <string name="air" value="{air}"/> </emitter></scene>"""


def lit(folder, air="us_standard"):
    """A white diffuse disc at 0 K, but for its temperature of 1 K, in the sun."""
    write_disc(folder)
    text = (folder / "disc.xml").read_text().replace("</scene>", SUN.format(air=air))
    text = text.replace(
        '<string name="material" value="blackbody"/> <string name="band" value="$band"/>',
        '<float name="epsilon" value="0"/> <float name="rho_d" value="1"/>'
        '<float name="b" value="0"/> <float name="e" value="1"/>',
    )
    (folder / "disc.xml").write_text(text)
    return folder


def amounts_of_levels(heights, lengths):
    """Amounts along straight pieces at some heights, apart from the product [density km]."""
    lines = [
        line
        for line in (TABLES / "band_levels_us_standard.csv").read_text().splitlines()
        if line[0] != "#"
    ]
    rows = [list(map(float, row)) for row in csv.reader(lines[1:])]
    names, table = lines[0].split(","), np.array(rows)
    amounts = {}
    for k, name in enumerate(names[6:], 6):
        density = np.exp(np.interp(heights, table[:, 0], np.log(np.maximum(table[:, k], 1e-99))))
        amounts[name] = float(density @ lengths)
    return amounts


def transmittance(amounts):
    """Wavelengths and transmittance from the rows of the tables, apart from the product."""
    lines = [
        line for line in (TABLES / "band_terms.csv").read_text().splitlines() if line[0] != "#"
    ]
    depths = {}
    for row in csv.DictReader(lines):
        amount = float(row["coefficient"]) * amounts[row["column"]]
        wavelength = float(row["wavelength_um"])
        depths[wavelength] = depths.get(wavelength, 0) + amount ** float(row["exponent"])
    return np.array(list(depths)), np.exp(-np.array(list(depths.values())))


@pytest.mark.slow
@pytest.mark.parametrize("range_m", [500.0, 2000.0, 10_000.0])
def test_reflected_sun_has_the_amounts_of_both_paths(tmp_path, range_m):
    """The share of the reflected sun that arrives, within 1.5 % of an own sum of amounts.

    The product of both transmittances is 10 to 15 % too dark.
    """
    folder = lit(tmp_path)
    given = {"observer__elevation_deg": 0, "observer__range_m": range_m, "sensor__band": "MWIR"}
    row = contrast(
        disc(folder, **given, atmosphere__table="us_standard", target__parameters__temperature=1)
    ).rows[0]
    share = row.target.value * range_m**2 / row.intensity.value
    edges = 0.05 + 99.9 * np.linspace(0, 1, 4001) ** 2
    heights, lengths = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / np.sin(np.radians(45))
    to_sun = amounts_of_levels(heights, lengths)
    near = amounts_of_levels(np.array([0.0501]), np.array([range_m / 1000]))
    x, before = transmittance(to_sun)
    _, after = transmittance({name: to_sun[name] + near[name] for name in to_sun})
    _, alone = transmittance(near)
    sun = np.interp(x, *np.loadtxt(TABLES / "band_sun.csv", delimiter=",", skiprows=7).T)
    rule = band("MWIR")
    expected, product = (
        rule.integral(x, sun * values) / rule.integral(x, sun * before)
        for values in (after, before * alone)
    )
    assert share == pytest.approx(expected, rel=0.015)
    assert product < 0.92 * expected


def test_a_table_multiplies_with_a_remark(tmp_path):
    """A user's table does not state its absorbers. The size is that of clear air."""
    folder = lit(tmp_path)
    rows = [f"{R},{x},{0.9**R},0.1" for R in (1, 5) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    (folder / "air.csv").write_text("\n".join([header, *rows]))
    table = str(folder / "air.csv")
    setting = setting_of(disc(folder, atmosphere__table=table, observer__range_m=5000))
    light = clear_air("us_standard").sun(50.0, 45.0)
    sources = [Source("sun", light.name, 1.0, spectrum=light), Source("hot", "400 K", 1.0, 400.0)]
    (remark,) = multiplied_light(setting, sources)
    assert "light of sun (us_standard 45 deg) has crossed air" in remark
    assert "15% too dark" in remark
    x = light.wavelengths_um
    cloudy = [Source("sky", "stratus", 1.0, spectrum=Spectrum("stratus", x, 1 + 0 * x))]
    assert (
        "61% too bright"
        in multiplied_light(
            setting_of(disc(folder, atmosphere__table="us_standard", observer__range_m=5000)),
            cloudy,
        )[0]
    )


@pytest.mark.parametrize(
    "table, air",
    [("us_standard", "us_standard"), ("us_standard", "none"), ("vacuum", "us_standard")],
)
def test_known_light_has_no_remark(tmp_path, table, air):
    setting = setting_of(disc(lit(tmp_path, air), atmosphere__table=table))
    sources = [source for emitter in setting.view.mi.emitters() for source in emitter.spectra()]
    assert any(source.spectrum is not None for source in sources)
    assert multiplied_light(setting, sources) == []
