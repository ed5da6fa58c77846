"""Files in the layouts of other programs, written from a known BRDF, which the points must have.

The BRDF is a function of direction vectors, so that each layout's angles are derived anew here.
"""

import math

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.fitting.scatterometer.reading import read
from mi_lcair.physics.bands import band

INCIDENCES = (15.0, 40.0, 60.0)
BSDF = "scan.bsdf"  # name of a file


def direction(theta_deg, phi_deg):
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def brdf(source, observer):
    """A lobe about the mirror direction above a floor, from unit vectors."""
    mirror = source * [-1, -1, 1]
    return 0.05 + 3 * max(mirror @ observer, 0) ** 60 + 0.02 * observer[2]


def assert_brdf(measured, angles=INCIDENCES):
    """Every point has the BRDF; theta_r is positive on the specular side."""
    for theta_i, theta_r, value in zip(measured.theta_i, measured.theta_r, measured.brdf):
        source, observer = direction(np.degrees(theta_i), 0), direction(np.degrees(theta_r), 180)
        assert value == pytest.approx(brdf(source, observer), rel=1e-9)
    found = np.unique(np.round(np.degrees(measured.theta_i), 9))
    assert angles is None or list(found) == list(angles)
    return np.degrees(measured.theta_r)


def optics_header(**lists):
    lines = ["# IS-SA", "Source  Measured", "Symmetry  PlaneSymmetrical"]
    lines += ["SpectralContent  Monochrome", "ScatterType  BRDF"]
    for name, angles in lists.items():
        lines += [f"{name} {len(angles)}", "\t".join(map(str, angles))]
    return lines


AZIMUTHS, RADIALS = (0, 45, 90, 135, 180), (0, 5, 10, 20, 30, 50, 70)


def zemax(incidences=INCIDENCES):
    """Angles about the specular direction; azimuth 0 points from there to the normal."""
    lines = optics_header(SampleRotation=[0], AngleOfIncidence=incidences,
        ScatterAzimuth=AZIMUTHS, ScatterRadial=RADIALS)  # fmt: skip
    lines += ["", "Monochrome", "DataBegin"]
    for incidence in incidences:
        lines.append("TIS 0.2")
        source, specular = direction(incidence, 0), direction(incidence, 180)
        to_normal = np.array([0, 0, 1]) - specular[2] * specular
        to_normal /= np.linalg.norm(to_normal)
        aside = np.cross(specular, to_normal)
        for azimuth in np.radians(AZIMUTHS):
            values = []
            for radial in np.radians(RADIALS):
                across = np.cos(azimuth) * to_normal + np.sin(azimuth) * aside
                observer = np.cos(radial) * specular + np.sin(radial) * across
                values.append(brdf(source, observer) if observer[2] > 0 else 0.0)
            lines.append("\t".join(f"{value:.14E}" for value in values))
    return "\n".join([*lines, "DataEnd", ""])


def lighttools(wavelength=10600.0, back=True):
    """Angles about the normal; the source is at azimuth 90."""
    azimuths, radials = (90, 135, 180, 225, 270), (0, 10, 15, 40, 60, 80)
    lines = optics_header(ScatterAzimuth=azimuths, ScatterRadial=radials) + ["DataBegin"]
    for incidence in INCIDENCES:
        for side in ("Front", "Back")[: 1 + back]:
            lines += [f"AOI {incidence:g}", "POI 0", f"Side {side}", f"Wavelength {wavelength}"]
            lines += ["ScatterType BRDF", "TIS 0.3"]
            for azimuth in azimuths:
                values = [
                    brdf(direction(incidence, 90), direction(r, azimuth)) * (1 + (side == "Back"))
                    for r in radials
                ]
                lines.append(" ".join(map(repr, map(float, values))))
    return "\n".join([*lines, "DataEnd"])


def test_zemax(file):
    measured = read(file(zemax(), BSDF), band="10.6")
    theta_r = assert_brdf(measured)
    assert theta_r.min() == pytest.approx(-55) and theta_r.max() == pytest.approx(85)
    assert measured.dropped == {"off the plane of incidence": 3 * 3 * 6, "at 90 degrees": 2}
    assert measured.sigma is None and measured.reading["repeated"] == 0
    assert measured.reading["format"] == "Zemax BSDF"
    assert measured.reading["theta_r_positive"] == "specular (by azimuth)"


def test_lighttools(file):
    measured = read(file(lighttools(), BSDF))
    theta_r = assert_brdf(measured)
    assert theta_r.min() == pytest.approx(-80) and theta_r.max() == pytest.approx(80)
    assert measured.reading["format"] == "LightTools BSDF"
    lower, upper = measured.band_um  # of a laser
    assert (lower + upper) / 2 == pytest.approx(10.6, rel=1e-6) and upper - lower < 0.03


@pytest.mark.parametrize("header", [
    "theta_r_deg,15,40,60", "scat_deg,inc 15,inc 40,inc 60", "theta_s (deg);AOI=15;AOI=40;AOI=60",
    "scat,15 deg,40 deg,60 deg",
])  # fmt: skip
def test_a_column_for_each_incidence(file, header):
    mark = ";" if ";" in header else ","
    lines = ["# band_um: 3 5", header]
    for r in (-60, -40, -15, 0, 15, 40, 60):
        values = [brdf(direction(i, 0), direction(r, 180)) for i in INCIDENCES]
        lines.append(mark.join(map(repr, [r, *map(float, values)])))
    lines[-1] = lines[-1].rpartition(mark)[0] + mark  # not measured
    measured = read(file("\n".join(lines), "wide.csv"))
    assert_brdf(measured)
    assert measured.band_um == (3, 5) and measured.dropped == {"without a value": 1}
    assert measured.reading["format"].endswith("a column for each incidence")
    lines[3] = lines[3].replace("0.0", "zero")
    with pytest.raises(InputError, match="wide.csv, line 4: .*is not a number"):
        read(file("\n".join(lines), "wide.csv"))


@pytest.mark.parametrize("specular", [0, 180])
@pytest.mark.parametrize("names", ["inc,scat,azimuth,brf", "incidence,view,relative_azimuth,BRF",
    "inc_deg,scat_deg,phi_deg,brf"])  # fmt: skip
def test_relative_azimuth_and_plain_names(file, specular, names):
    """Degrees follow from angles of more than 90; the specular side from its peaks."""
    lines = [names]
    for i in INCIDENCES:
        for r in (15, 40, 60, 75):
            for azimuth in (0, 90, 180):
                observer = direction(r, azimuth + 180 - specular)
                value = math.pi * brdf(direction(i, 0), observer)
                lines.append(f"{i},{r},{azimuth},{float(value)!r}")
    measured = read(file("\n".join(lines), "plain.csv"))
    assert_brdf(measured)
    assert measured.reading["quantity"] == "brf"
    assert measured.dropped == {"off the plane of incidence": 12}


def merl():
    """A table over half and difference angles, of which only the plane of incidence is filled."""
    table = np.full((3, 90, 90, 180), -1.0)
    for h in range(90):
        for d in range(90):
            half, difference = 90 * ((h + 0.5) / 90) ** 2, d + 0.5
            source = direction(difference + half, 0)
            observer = direction(difference - half, 180)
            if source[2] > 0 and observer[2] > 0:
                values = np.array([1.0, 1 / 1.15, 1 / 1.66]) * 1500 * brdf(source, observer)
                table[:, h, d, 0] = values
    return np.array([90, 90, 180], "<i4").tobytes() + table.astype("<f8").tobytes()


def test_merl(file):
    content = merl()
    measured = read(file(content, "blue.binary"), band="0.5-0.6")
    theta_r = assert_brdf(measured, None)
    assert theta_r.min() < -60 and theta_r.max() > 60 and len(theta_r) > 500
    with pytest.raises(
        InputError, match="blue.binary: begins as a MERL file, but has not 34992012"
    ):
        read(file(content[:-8], "blue.binary"))


def test_what_is_not_read_is_named(file):
    text = "theta_i_deg,theta_r_deg,brdf,site,note\n15,15,3,A,x\n15,40,1,A,y\n"
    measured = read(file(text, "scan.csv"))
    assert measured.reading["not_read"] == ["site", "note"]


@pytest.mark.parametrize("stated", ["10.6", "10.59-10.61"])
def test_a_laser_is_a_narrow_band(file, stated):
    path = file("theta_i_deg,theta_r_deg,brdf\n15,15,3\n15,40,1\n", "scan.csv")
    lower, upper = read(path, band=stated).band_um
    assert lower < 10.6 < upper and upper - lower < 0.03
    assert band(f"{lower:.12g}-{upper:.12g}").lower_um == lower
    path = file("# band_um: 10.6\ntheta_i_deg,theta_r_deg,brdf\n15,15,3\n15,40,1\n", "scan.csv")
    lower, upper = read(path).band_um
    assert lower < 10.6 < upper and upper - lower < 0.03


BAD = {
    "RGL": (b"tensor_file\x00\x01", "an RGL measurement .tensor_file., which is not read"),
    "colours": (zemax().replace("  Monochrome", "  XYZ"), "has colours"),
    "transmission": (zemax().replace("BRDF", "BTDF"), "no BRDF of the front side"),
    "cut short": (zemax()[:900], "ends after line 22, before DataEnd"),
    "a word": (zemax().replace("E-02", "E-high", 1), "is not a number"),
    "a block too few": (zemax()[: zemax().rindex("TIS")] + "DataEnd", "2 blocks of data for 3"),
    "no azimuths": (zemax().replace("ScatterAzimuth", "Azimuth"), "line 1|ScatterAzimuth"),
    "another plane": (lighttools().replace("POI 0", "POI 30"), "POI = 30; only 0 is read"),
    "two wavelengths": (lighttools().replace("10600.0", "3390.0", 1), "'band_um' differs"),
    "no incidence": (lighttools().replace("AOI 15", "AO 15", 1), "no AOI"),
    "an incidence in words": (lighttools().replace("AOI 15", "AOI x", 1), "'x' is not a number"),
    "back alone": (lighttools(back=False).replace("Front", "Back"), "no BRDF of the front side"),
}


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(file, name):
    content, words = BAD[name]
    path = file(content, BSDF)
    with pytest.raises(InputError, match=words) as error:
        read(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_table_with_a_brdf_is_not_wide(file):
    path = file("theta_r_deg,brdf,theta_i_20\n15,1,20\n", "a.csv")
    with pytest.raises(InputError, match="no column theta_i_deg"):
        read(path)
