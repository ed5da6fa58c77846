"""Scatterometer files: accepted layouts, open questions, and damaged input.

All layouts give the same points. No input crashes the reader.
"""

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mi_lcair.errors import InputError
from mi_lcair.fitting.scatterometer.reading import pool, read, read_directional

# theta_i, theta_r [degrees] and BRDF of a surface that is brighter on the specular side. Every
# layout must give these points.
POINTS = [
    (i, r, 0.05 + (2.5 if r == i else 0.5 if r > 0 else 0.0) + 0.001 * r)
    for i in (20, 40)
    for r in (-40, -20, 20, 40)
]


def rows(template, sign=1, separator="\n"):
    """One line for each point, from a format string.

    Its names are i, r (angles in degrees), ir, rr (in radians), f (BRDF) and fc (BRDF times
    cos theta_r).
    """
    return separator.join(
        template.format(
            i=i,
            r=sign * r,
            ir=math.radians(i),
            rr=math.radians(sign * r),
            f=f,
            fc=f * math.cos(math.radians(r)),
            az=math.pi if r > 0 else 0.0,
            a=abs(math.radians(r)),
        )
        for i, r, f in POINTS
    )


PREAMBLE = "Goniometer 3, detector A\nlamp: 1473 K\n"
TABLE = "theta_i_deg,theta_r_deg,brdf_per_sr\n" + rows("{i},{r},{f}")


def test_lines_before_the_table_need_a_mark(file):
    """The first of them is not taken for the names of the columns, which stand in line 3."""
    with pytest.raises(InputError) as raised:
        read(file(PREAMBLE + TABLE))
    assert str(raised.value).endswith(
        "scan.csv, line 1: 'Goniometer 3, detector A' comes before the names of the columns in "
        "line 3; put # in front of each line before these"
    )
    marked = "".join(f"# {line}\n" for line in PREAMBLE.splitlines())
    assert_points(read(file(marked + TABLE)))


def test_a_band_that_is_given_overrules_the_file(file):
    path = file("# band_um: 3 5\n" + TABLE)
    assert read(path).band_um == (3, 5)
    assert read(path, band="8-12").band_um == (8, 12)
    assert read(path, band="MWIR").band_um == (3, 5)


def assert_points(measured, points=POINTS):
    i, r, f = np.array(points, dtype=float).T
    np.testing.assert_allclose(measured.theta_i, np.radians(i), rtol=1e-12)
    np.testing.assert_allclose(measured.theta_r, np.radians(r), rtol=1e-12)
    np.testing.assert_allclose(measured.brdf, f, rtol=1e-12)
    assert measured.brdf.dtype == measured.theta_i.dtype == measured.theta_r.dtype == np.float64


def refused(path, **options):
    with pytest.raises(InputError) as error:
        read(path, **options)
    message = str(error.value)
    assert "\n" not in message and str(path) in message
    return message.removeprefix(str(path))


# ------------------------------------------------------------------- layouts

ASTM = """LAB_NAME "A laboratory"
SAMPLE_NAME "plate 7"
BAND_UM 3 5
SOURCE_HALF_ANGLE_DEG 0.9
NUM_POINTS {n}
VARS {vars}
{rows}
"""
LAYOUTS = {
    "the project's own": "theta_i_deg,theta_r_deg,brdf_per_sr\n" + rows("{i},{r},{f!r}"),
    "blanks, blank lines, CRLF, BOM": "\ufeff# a comment\r\n"
    "theta_i_deg, theta_r_deg , brdf_per_sr\r\n\r\n"
    + rows(" {i} ,{r},  {f!r} ", separator="\r\n\r\n"),
    "another order, other names": "BRDF (1/sr),Theta_r [deg],site,Theta_i [deg]\n"
    + rows("{f!r},{r},A,{i}"),
    "radians": "theta_i_rad,theta_r_rad,brdf\n" + rows("{ir!r},{rr!r},{f!r}"),
    "lines that end in CR": "theta_i_deg,theta_r_deg,brdf\r"
    + rows("{i},{r},{f!r}", separator="\r"),
    "tabs": "theta_i_deg\ttheta_r_deg\tbrdf\n" + rows("{i}\t{r}\t{f!r}"),
    "semicolons": "theta_i_deg;theta_r_deg;brdf;\n" + rows("{i};{r};{f!r};") + "\n;;;\n",
    "a decimal comma": "theta_i_deg;theta_r_deg;brdf\n" + rows("{i};{r};{f!r}").replace(".", ","),
    "quotes": "theta_i_deg,theta_r_deg,brdf\n" + rows('"{i}","{r}","{f!r}"'),
    "BRDF x cos by name": "theta_i_deg,theta_r_deg,ccBRDF\n" + rows("{i},{r},{fc!r}"),
    "BRDF x cos by header": "# quantity: brdf_cos\ntheta_i_deg,theta_r_deg,brdf\n"
    + rows("{i},{r},{fc!r}"),
    "positive on the source's side, stated": "# theta_r_positive: source\n"
    "theta_i_deg,theta_r_deg,brdf\n" + rows("{i},{r},{f!r}", -1),
    "another name, positive where the peaks are": "theta_i_deg,theta_s_deg,brdf\n"
    + rows("{i},{r},{f!r}"),
    "another name, negative where the peaks are": "theta_i_deg,theta_s_deg,brdf\n"
    + rows("{i},{r},{f!r}", -1),
    "the source at negative angles": "theta_i_deg,theta_r_deg,brdf\n" + rows("-{i},{r},{f!r}"),
    "azimuths, in a CSV": "theta_i_deg,theta_s_rad,phi_i_rad,phi_s_rad,brdf\n"
    + rows("{i},{a!r},0,{az!r},{f!r}"),
    "ASTM": ASTM.format(
        n=len(POINTS),
        vars="theta_i,phi_i,theta_s,phi_s,BSDF",
        rows=rows("{ir!r},0,{a!r},{az!r},{f!r}"),
    ),
    "ASTM with azimuths from the source": ASTM.format(
        n=len(POINTS),
        vars="theta_i,theta_s,phi_s,Integrated 3-5",
        rows=rows("{ir!r},{a!r},{az!r},{f!r}"),
    ),
    "ASTM with a signed theta_s": ASTM.format(
        n=len(POINTS),
        vars="theta_i,phi_i,theta_s,phi_s,BSDF",
        rows=rows("{ir!r},0,{rr!r},0,{f!r}", -1),
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_points(file, layout):
    measured = read(file(LAYOUTS[layout]))
    assert_points(measured)
    assert (
        measured.sigma is None
        and measured.dropped == {}
        and measured.reading["points"] == len(POINTS)
    )


def test_options_overrule_names_and_header(file):
    assert_points(
        read(file("theta_i_deg,theta_r_deg,brdf\n" + rows("{i},{r},{fc!r}")), quantity="brdf_cos")
    )
    assert_points(
        read(
            file("# quantity: brdf_cos\ntheta_i_deg,theta_r_deg,brdf\n" + rows("{i},{r},{f!r}")),
            quantity="brdf",
        )
    )
    text = "# theta_r_positive: specular\ntheta_i_deg,theta_r_deg,brdf\n" + rows(
        "{i},{r},{f!r}", -1
    )
    assert_points(read(file(text), theta_r_positive="source"))
    both = "theta_i_deg,theta_r_deg,brdf_cos,brdf\n" + rows("{i},{r},{fc!r},{f!r}")
    assert_points(read(file(both)))
    assert_points(read(file(both), quantity="brdf_cos"))


def test_header_keys(file):
    text = (
        "# A plate\n# sample: plate 7\n# band_um: 3 5.5\n"
        "# Source_half_angle_deg : 0.9\n# calibration: 5 %\n# quite: another\n"
        + LAYOUTS["the project's own"]
    )
    measured = read(file(text))
    assert (measured.name, measured.band_um) == ("plate 7", (3.0, 5.5))
    assert measured.calibration == 0.05
    assert measured.source_half_angle == pytest.approx(math.radians(0.9), rel=1e-12)
    assert measured.source == [
        {"file": "scan.csv", "sha256": hashlib.sha256(text.encode()).hexdigest()}
    ]
    measured = read(file(LAYOUTS["ASTM"]))
    assert (measured.name, measured.band_um) == ("plate 7", (3.0, 5.0))
    assert measured.source_half_angle == pytest.approx(math.radians(0.9), rel=1e-12)
    measured = read(file(LAYOUTS["the project's own"]))
    assert (measured.name, measured.band_um, measured.source_half_angle) == ("scan", None, 0.0)
    assert measured.calibration is None


@pytest.mark.parametrize("option", ["quantity", "theta_r_positive"])
def test_options_have_few_words(file, option):
    with pytest.raises(InputError, match=f"unknown {option} 'left'; known: "):
        read(file(LAYOUTS["tabs"]), **{option: "left"})


def test_latin_1(file):
    assert_points(read(file(("# in µm\n" + LAYOUTS["the project's own"]).encode("latin-1"))))


def test_rows_off_the_plane_and_at_the_horizon_are_dropped_and_counted(file):
    text = (
        "theta_i_deg,theta_r_deg,phi_deg,brdf\n"
        + rows("{i},{r},0,{f!r}")
        + "\n20,20,30,9\n20,40,-90,9\n20,90,0,9\n20,90,5,9\n20,20,0,\n20,40,0,nan\n"
    )
    measured = read(file(text))
    assert_points(measured)
    left_out = {"without a value": 2, "off the plane of incidence": 3, "at 90 degrees": 1}
    assert measured.dropped == left_out


def test_azimuth_180_is_the_other_half_plane(file):
    """An observer at theta_r = 40, phi = 180 is read as theta_r = -40."""
    text = "theta_i_deg,theta_r_deg,phi_deg,brdf\n" + "\n".join(
        f"{i},{abs(r)},{0 if r > 0 else 180},{f!r}" for i, r, f in POINTS
    )
    assert_points(read(file(text)))


REAL = Path(__file__).parents[4] / "shared" / "data" / "mwir_brdf"


@pytest.mark.skipif(not REAL.is_dir(), reason="needs the measured files beside the checkout")
@pytest.mark.parametrize("name", ["aluminium", "copper", "paint_smooth"])
def test_real_files(name):
    """The files have 10 positions of the camera and 87 of the source.

    At 60 degrees these surfaces are brightest in the mirror direction.
    """
    measured, emissivity = (
        read(REAL / f"{name}.csv"),
        read_directional(REAL / f"{name}_emissivity.csv", "emissivity"),
    )
    assert (len(measured.brdf), measured.band_um, measured.source_half_angle) == (
        870,
        (2.0, 5.7),
        0,
    )
    scan = np.isclose(np.degrees(measured.theta_r), 60)
    assert np.degrees(measured.theta_i[scan][measured.brdf[scan].argmax()]) == pytest.approx(60)
    assert len(emissivity.theta) == 10 and (emissivity.std > 0.02).all()


# ------------------------------------------------------------------- repeated scans


@pytest.mark.parametrize("stated, expected", [(0.05, 1.0), (0.01, 5.0)])
def test_scatter_of_repeats_is_compared_with_sigma(file, stated, expected):
    rng = np.random.default_rng(2)
    values = 1 + 0.05 * rng.standard_normal((12, 81))
    rows = [f"20,{r},{v:.9g},{stated}" for scan in values for r, v in zip(range(-40, 41), scan)]
    measured = read(file("theta_i_deg,theta_r_deg,brdf,sigma\n" + "\n".join(rows)))
    assert measured.reading["scatter_sigmas"] == pytest.approx(expected, rel=0.06)
    assert measured.reading["repeated"] == 11 * 81


def test_repeated_scans_are_pooled_and_their_scatter_becomes_sigma(file):
    """Six scans with 5 % multiplicative noise give sigma = 5 % / sqrt(6) for every mean."""
    rng = np.random.default_rng(1)
    angles = [(20, r) for r in range(-40, 41)]
    truth = {r: math.exp(-abs(r - 20) / 4) for _, r in angles}
    lines = [
        f"{i},{r},{truth[r] * (1 + 0.05 * rng.standard_normal())!r}"
        for _ in range(6)
        for i, r in angles
    ]
    measured = read(file("theta_i_deg,theta_r_deg,brdf\n" + "\n".join(lines)))
    assert len(measured.brdf) == 81 and measured.reading["rows"] == 486
    assert measured.reading["repeated"] == 405
    np.testing.assert_allclose(np.degrees(measured.theta_r), range(-40, 41), atol=1e-9)
    true = np.array([truth[r] for _, r in angles])
    ratio = measured.sigma / (true * 0.05 / math.sqrt(6))
    assert abs(ratio - 1).max() < 0.6 and abs(np.sqrt(np.mean(ratio**2)) - 1) < 0.15
    # On average, sigma is the deviation of the mean from the true value.
    assert 0.7 < np.sqrt(np.mean(((measured.brdf - true) / measured.sigma) ** 2)) < 1.3


def test_two_scans_do_not_claim_certainty():
    """Two values that agree by chance have a sigma well above 0.

    A point that was measured once has a finite sigma.
    """
    theta_i, theta_r = np.radians([20.0] * 7), np.radians([10.0, 20, 30, 10, 20, 30, 40])
    _, _, brdf, sigma = pool(theta_i, theta_r, np.array([1.0, 5, 2, 1.0, 5.5, 2.2, 3]))
    np.testing.assert_allclose(brdf, [1.0, 5.25, 2.1, 3])
    assert (sigma / brdf).min() > 0.02 and (sigma / brdf).argmax() == 3 and (sigma / brdf)[3] < 0.1


def test_identical_repeats_say_nothing_of_the_noise():
    assert pool(*np.radians([[20.0, 20], [30, 30]]), np.array([1.0, 1]))[3] is None


def test_a_stated_sigma_is_kept_and_averaged(file):
    head = "theta_i_deg,theta_r_deg,brdf,sigma\n"
    np.testing.assert_allclose(read(file(head + "20,20,2,0.3\n20,30,1,0.1\n")).sigma, [0.3, 0.1])
    np.testing.assert_allclose(read(file(head + "20,20,2,0.3\n20,20,4,0.4\n")).sigma, [0.25])
    cos = read(file("theta_i_deg,theta_r_deg,brdf_cos,sigma\n20,60,2,0.3\n"))
    np.testing.assert_allclose((cos.brdf, cos.sigma), [[4], [0.6]])


# ------------------------------------------------------------------- open questions and bad input

OWN = "theta_i_deg,theta_r_deg,brdf\n"
QUESTIONS = {
    "foreign sign, no peaks": (
        "theta_i_deg,theta_s_deg,brdf\n"
        + "\n".join(f"30,{r},{500 + 2 * r}" for r in (-40, -20, 20, 40)),
        "on which side is theta_r positive?",
    ),
    "foreign sign, peaks on both sides": (
        "theta_i_deg,theta_s_deg,brdf\n"
        + "\n".join(
            f"{i},{r},{9 if r == i * s else 1}"
            for i, s in ((20, 1), (40, -1))
            for r in (-40, -20, 20, 40)
        ),
        "on which side",
    ),
    "foreign sign, a peak where the other side was not measured": (
        "theta_i_deg,theta_s_deg,brdf\n30,-20,1\n30,20,1\n30,30,9\n",
        "on which side",
    ),
    "foreign sign, one side": (
        "theta_i_deg,theta_s_deg,brdf\n30,-40,1\n30,-30,5\n",
        "on which side",
    ),
    "the project's name, peaks on the other side": (
        OWN + rows("{i},{r},{f!r}", -1),
        "but the peaks lie at -theta_i",
    ),
    "azimuths against peaks": (
        "theta_i_deg,theta_s_rad,phi_i_rad,phi_s_rad,brdf\n"
        + rows("{i},{a!r},3.14159265,{az!r},{f!r}"),
        "the azimuths say specular",
    ),
    "azimuths all alike": (
        "theta_i_deg,theta_s_deg,phi_i_deg,phi_s_deg,brdf\n30,30,0,0,5\n30,40,0,0,1\n",
        "all azimuths are alike",
    ),
    "azimuths all alike, the project's names": (
        "theta_i_deg,theta_r_deg,phi_i_deg,phi_r_deg,brdf\n30,30,0,0,5\n30,40,0,0,1\n",
        "all azimuths are alike",
    ),
    "phi 180 alone": (
        "theta_i_deg,theta_r_deg,phi_deg,brdf\n30,30,180,5\n30,40,180,1\n",
        "on which side",
    ),
    "negative source, one side": (OWN + "-30,30,5\n-30,40,1\n", "on which side"),
    "no unit": ("theta_i,theta_r,brdf\n0.1,0.2,1\n", "is column 'theta_i' in degrees or radians?"),
    "two columns for one thing": (
        "theta_i_deg,theta_r_deg,theta_s_deg,brdf\n1,2,3,4\n",
        "'theta_r_deg' and 'theta_s_deg' both read as theta_r",
    ),
    "a column twice": (
        "theta_i_deg,theta_r_deg,brdf,brdf\n1,2,3,4\n",
        "column 'brdf' appears twice",
    ),
    "two decimal marks": (
        "theta_i_deg;theta_r_deg;brdf\n20;30;0.5\n20;40;0,5\n",
        "line 2 has a point, line 3 a comma",
    ),
    "a key twice": (
        "# band_um: 3 5\n# band_um: 8 12\n" + OWN + "20,30,1\n",
        ", line 2: 'band_um' differs from line 1",
    ),
    "a key nearly right": (
        "# source_half_angle: 0.9\n" + OWN + "20,30,1\n",
        ", line 1: unknown key 'source_half_angle'; is source_half_angle_deg meant?",
    ),
}
BAD = {
    "empty": ("", "the file is empty"),
    "blank": (" \n\n", "the file is empty"),
    "not text": (b"\x89PNG\r\n\x1a\n\x00\x00", "not a text file"),
    "comments alone": ("# band_um: 3 5\n", "nothing but comments"),
    "no header": ("20,30,1\n20,40,1\n", ", line 1: no header line"),
    "no header, but a word": ("20,30,1,good\n20,40,1,good\n", ", line 1: no header line"),
    "no rows": (OWN, "no rows of data"),
    "missing column": (
        "theta_i_deg,reflectance,brdf\n1,2,3\n",
        "no column theta_r_deg; found: 'theta_i_deg', 'reflectance', 'brdf'",
    ),
    "missing value": (
        "theta_i_deg,theta_r_deg,reflectance\n1,2,3\n",
        "no column brdf_per_sr; found: 'theta_i_deg', 'theta_r_deg', 'reflectance'",
    ),
    "two wavelengths": (
        "Wavelength [nm],theta_i_deg,theta_r_deg,brdf\n4000,20,30,1\n10600,20,30,2\n",
        "column 'Wavelength [nm]' has 2 values (10600, 4000); give each wavelength a file",
    ),
    "missing columns": (
        "a,b\n1,2\n",
        "no column theta_i_deg and no theta_r_deg and no brdf_per_sr; found: 'a', 'b'",
    ),
    "word": (
        OWN + "# two\n20,30,1\n20,40,high\n",
        ", line 4: 'high' in column 'brdf' is not a number",
    ),
    "nan": (OWN + "20,30,nan\n", ": no row has a BRDF"),
    "infinite": (OWN + "20,30,1e999\n", ", line 2: '1e999' in column 'brdf' is not a number"),
    "blank cell": (OWN + "20,,1\n", ", line 2: theta_r_deg = nan lies outside -90..90 degrees"),
    "thousands": (
        "theta_i_deg;theta_r_deg;brdf\n20;30;1.234,5\n",
        ", line 2: '1.234,5' in column 'brdf' is not a number",
    ),
    "short row": (OWN + "20,30,1\n20,40\n", ", line 3: 2 cells where the header names 3"),
    "decimal comma between commas": (
        OWN + "20,5,30,1,2\n",
        "a decimal comma needs semicolons or tabs",
    ),
    "angle too large": (
        OWN + "20,30,1\n20,90.5,1\n",
        ", line 3: theta_r_deg = 90.5 lies outside -90..90 degrees",
    ),
    "angle too small": (
        OWN + "-91,30,1\n",
        ", line 2: theta_i_deg = -91 lies outside -90..90 degrees",
    ),
    "degrees that say radians": (
        "theta_i_rad,theta_r_rad,brdf\n20,30,1\n",
        ", line 2: theta_i_rad = 20 lies outside -1.5708..1.5708 rad",
    ),
    "off the plane": (
        "theta_i_deg,theta_r_deg,phi_deg,brdf\n20,30,45,1\n20,30,90,1\n",
        "all 2 rows lie off the plane",
    ),
    "sigma 0": (
        "theta_i_deg,theta_r_deg,brdf,sigma\n20,30,1,1\n20,40,1,0\n",
        ", line 3: sigma = ",
    ),
    "band": (
        "# band_um: MWIR\n" + OWN + "20,30,1\n",
        ", line 1: band_um is 'MWIR'; expected two wavelengths",
    ),
    "band reversed": ("# band_um: 5 3\n" + OWN + "20,30,1\n", "expected two wavelengths"),
    "aperture": (
        "# source_half_angle_deg: wide\n" + OWN + "20,30,1\n",
        ", line 1: source_half_angle_deg is 'wide'",
    ),
    "calibration": (
        "# calibration: 5\n" + OWN + "20,30,1\n",
        ", line 1: calibration: '5' is not a fraction",
    ),
    "side": (
        "# theta_r_positive: left\n" + OWN + "20,30,1\n",
        ", line 1: unknown theta_r_positive 'left'; known: s",
    ),
    "quantity": ("# quantity: f\n" + OWN + "20,30,1\n", "known: brf, brdf, brdf_cos"),
    "brdf asked of brdf_cos": (
        "# quantity: brdf\ntheta_i_deg,theta_r_deg,brdf_cos\n20,30,1\n",
        "no column brdf_per_sr",
    ),
    "NUM_POINTS": (
        ASTM.format(n=3, vars="theta_i,theta_s,BSDF", rows="0.1,0.2,1"),
        ", line 5: NUM_POINTS is '3', but 1 rows follow",
    ),
    "ASTM in degrees": (
        ASTM.format(n=1, vars="theta_i,theta_s,BSDF", rows="20,30,1"),
        ", line 7: theta_i = 20 lies outside",
    ),
    "ASTM, several values": (
        ASTM.format(n=1, vars="theta_i,theta_s,R,G,B", rows="0.1,0.2,1,1,1"),
        "no column brdf_per_sr; found",
    ),
    "ASTM, VARS twice the same": (
        ASTM.format(n=1, vars="theta_i,theta_i,B", rows="0.1,0.2,1"),
        "names 'theta_i' twice",
    ),
}


@pytest.mark.parametrize("name", QUESTIONS | BAD)
def test_refused_in_one_line(file, name):
    text, reason = (QUESTIONS | BAD)[name]
    assert reason in refused(file(text))


@pytest.mark.parametrize(
    "name",
    [
        "foreign sign, no peaks",
        "foreign sign, peaks on both sides",
        "foreign sign, one side",
        "azimuths all alike",
        "phi 180 alone",
        "negative source, one side",
        "the project's name, peaks on the other side",
    ],
)
def test_a_statement_settles_the_side(file, name):
    """The file can state the side that the error message asks for.

    The two possible statements give mirror images of each other.
    """
    path = file(QUESTIONS[name][0])
    specular, source = (
        read(path, theta_r_positive="specular"),
        read(path, theta_r_positive="source"),
    )
    np.testing.assert_array_equal(specular.theta_r, -source.theta_r)
    assert (specular.theta_i > 0).all() and specular.reading[
        "theta_r_positive"
    ] == "specular (stated)"


def test_missing_file_and_folder(tmp_path):
    assert "No such file" in refused(tmp_path / "none.csv")
    assert "directory" in refused(tmp_path)


# ------------------------------------------------------------------- emissivity and DHR


def test_directional_tables(file):
    text = "# x\ntheta_deg,emissivity,emissivity_std\n60,0.7,0.02\n15,0.9,0.01\n"
    data = read_directional(file(text), "emissivity")
    assert data.source == [
        {"file": "scan.csv", "sha256": hashlib.sha256(text.encode()).hexdigest()}
    ]
    np.testing.assert_allclose(np.degrees(data.theta), [15, 60])
    np.testing.assert_array_equal((data.value, data.std), [[0.9, 0.7], [0.01, 0.02]])
    data = read_directional(file("theta_deg,dhr\n15,0.1\n"), "dhr")
    assert (data.quantity, data.value.tolist(), data.std) == ("dhr", [0.1], None)


@pytest.mark.parametrize(
    "text, reason",
    [
        (
            "theta_deg,emissivity\n15,1.2\n",
            "line 2: emissivity = 1.2; must lie in 0..1",
        ),
        ("theta_deg,emissivity\n15,-0.1\n", "line 2: emissivity = -0.1; must lie in 0..1"),
        ("theta_deg,emissivity\n95,0.1\n", "line 2: theta_deg = 95; must lie in 0..90"),
        ("theta_deg,dhr\n15,0.1\n", "must name theta_deg and emissivity; found: theta_deg, dhr"),
        (
            "theta_deg,emissivity,emissivity_std\n15,0.1\n",
            "line 2: 2 cells where the header names 3",
        ),
        (
            "theta_deg,emissivity,emissivity_std\n15,0.1,0\n",
            "line 2: emissivity_std = 0; must lie in 1e-06..1",
        ),
        ("theta_deg,emissivity\n15,0.1\n15,0.2\n", "line 3: theta_deg 15 appears twice"),
        ("", "found: nothing"),
        (b"\xff\xfe\x00", "not a text file"),
    ],
)
def test_bad_directional_tables(file, text, reason):
    path = file(text)
    with pytest.raises(InputError) as error:
        read_directional(path, "emissivity")
    assert reason in str(error.value) and "\n" not in str(error.value)


# ------------------------------------------------------------------- any bytes

NUMBERS = st.one_of(
    st.integers(-100, 100).map(str),
    st.floats().map(str),
    st.sampled_from(["", "0,5", "-", "1e400", "x", '"', "\u0663"]),
)
NAMES = st.sampled_from(
    [
        "theta_i_deg",
        "theta_r_deg",
        "theta_s",
        "theta_r_rad",
        "brdf",
        "brdf_cos",
        "sigma",
        "phi_deg",
        "phi_s",
        "phi_i",
        "",
        "x",
    ]
)
HEADERS = st.sampled_from(
    [
        "",
        "# band_um: 3 5\n",
        "#:\n",
        "# quantity: brdf_cos\n",
        "# theta_r_positive: source\n",
        "NUM_POINTS 2\nVARS ",
        "VARS",
    ]
)


@st.composite
def nearly_right(draw):
    """Text with the layout of a measurement file and arbitrary cells."""
    separator = draw(st.sampled_from([",", ";", "\t", " "]))
    cells = st.lists(NUMBERS, max_size=6).map(separator.join)
    header = draw(
        st.one_of(st.just(["theta_i_deg", "theta_r_deg", "brdf"]), st.lists(NAMES, max_size=6))
    )
    return (
        draw(HEADERS) + separator.join(header) + "\n" + "\n".join(draw(st.lists(cells, max_size=6)))
    ).encode("utf-8", "replace")


@pytest.mark.slow
@settings(max_examples=250, deadline=None)
@given(st.one_of(st.binary(max_size=200), nearly_right()))
def test_any_bytes_give_data_or_one_line(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(data)
    try:
        measured = read(path)
    except InputError as error:
        assert "\n" not in str(error) and str(path) in str(error)
    else:
        for array in (measured.theta_i, measured.theta_r, measured.brdf):
            assert len(array) and np.isfinite(array).all()
        assert measured.sigma is None or (np.isfinite(measured.sigma) & (measured.sigma > 0)).all()
    try:
        read_directional(path, "emissivity")
    except InputError as error:
        assert "\n" not in str(error)
