"""Bands: meaning of specifications, error of the quadrature, and refused specifications."""

import os
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band, band

C2 = 14387.768775039337  # um K, hc/k of CODATA 2018


def planck_shape(m, wavelength, temperature, upper):
    """Planck's law, scaled to be near 1 at the wavelength `upper`, as mpmath's quad requires.

    m: the module whose functions are used, NumPy or mpmath.
    """
    exponent = C2 / temperature
    return (
        (wavelength / upper) ** -5
        * m.exp(exponent / upper - exponent / wavelength)
        / -m.expm1(-exponent / wavelength)
    )


def by_rule(rule, temperature):
    """The rule's sum over `planck_shape`."""
    return rule.weights_um @ planck_shape(np, rule.wavelengths_um, temperature, rule.upper_um)


def csv(folder, wavelengths, response, name="detector.csv"):
    path = folder / name
    rows = "".join(f"{w!r},{r!r}\n" for w, r in zip(map(float, wavelengths), map(float, response)))
    path.write_text("wavelength_um,response\n" + rows)
    return path


@pytest.mark.parametrize(
    "spec, name, limits, label",
    [
        ("MWIR", "MWIR", (3, 5), "MWIR 3-5 um"),
        ("lwir", "LWIR", (8, 12), "LWIR 8-12 um"),
        (" Swir ", "SWIR", (1, 3), "SWIR 1-3 um"),
        ("3.5-4.2", "3.5-4.2", (3.5, 4.2), "3.5-4.2 um"),
        ("1e0 - 3.", "1-3", (1, 3), "1-3 um"),
        ("Total", "total", (0, np.inf), "total"),
    ],
)
def test_a_specification_gives_name_limits_and_label(spec, name, limits, label):
    computed = band(spec)
    assert (computed.name, (computed.lower_um, computed.upper_um), computed.label) == (
        name,
        limits,
        label,
    )


def test_a_band_passes_through_and_total_has_no_spectrum():
    mwir, total = band("MWIR"), band("total")
    assert isinstance(mwir, Band) and band(mwir) is mwir and not mwir.is_total
    assert total.is_total and total.wavelengths_um.size == total.weights_um.size == 0


def test_a_band_cannot_be_changed():
    mwir = band("MWIR")
    with pytest.raises(ValueError, match="read-only"):
        mwir.weights_um[0] = 0
    with pytest.raises(AttributeError):
        mwir.name = "LWIR"


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 999), st.floats(1.001, 10000))
def test_nodes_lie_within_the_limits_and_weights_add_up_to_the_width(lower, ratio):
    rule = band(f"{lower!r}-{min(lower * ratio, 1000.0)!r}")
    assert np.all(np.diff(rule.wavelengths_um) > 0) and np.all(rule.weights_um > 0)
    assert rule.lower_um <= rule.wavelengths_um[0] and rule.wavelengths_um[-1] <= rule.upper_um
    np.testing.assert_allclose(rule.weights_um.sum(), rule.upper_um - rule.lower_um, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("spec", ["SWIR", "3.99-4.01", "0.4-14", "0.1-1000"])
@pytest.mark.parametrize("temperature", [30, 6000])
def test_limits_integrate_plancks_law(spec, temperature):
    rule = band(spec)
    # The intervals are narrow enough for mpmath's quadrature.
    pieces = [mpmath.mpf(x) for x in np.geomspace(rule.lower_um, rule.upper_um, 20)]
    exact = mpmath.quad(
        lambda x: planck_shape(mpmath, x, temperature, rule.upper_um), pieces, maxdegree=5
    )
    assert abs(by_rule(rule, temperature) / exact - 1) < 1e-10


JAGGED = [2.9, 3.0, 3.35, 3.4, 4.1, 4.25, 4.3, 5.6], [0.0, 0.7, 0.65, 1.2, 0.9, 0.05, 0.9, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("temperature", [30, 300, 6000])
def test_a_response_is_straight_between_its_rows(tmp_path, temperature):
    rule = band(csv(tmp_path, *JAGGED))
    exact = 0
    for x0, x1, r0, r1 in zip(JAGGED[0], JAGGED[0][1:], JAGGED[1], JAGGED[1][1:]):
        exact += mpmath.quad(
            lambda x: (
                (r0 + (r1 - r0) * (x - x0) / (x1 - x0))
                * planck_shape(mpmath, x, temperature, rule.upper_um)
            ),
            [x0, x1],
        )
    assert abs(by_rule(rule, temperature) / exact - 1) < 1e-9
    assert rule.label == "detector 2.9-5.6 um"


def test_a_response_of_many_rows_needs_no_more_nodes_than_a_smooth_band(tmp_path):
    wavelengths = np.union1d(np.linspace(2.9, 5.6, 400), JAGGED[0])
    coarse = band(csv(tmp_path, *JAGGED))
    fine = band(csv(tmp_path, wavelengths, np.interp(wavelengths, *JAGGED), "fine.csv"))
    assert fine.wavelengths_um.size <= 66
    assert fine.wavelengths_um.min() > 2.9 and fine.wavelengths_um.max() < 5.6
    x = np.union1d(np.linspace(2.9, 5.6, 100_001), JAGGED[0])
    for power in (0, 1, 4, 9):
        exact = np.trapezoid(x**power * np.interp(x, *JAGGED), x)
        assert fine.weights_um @ fine.wavelengths_um**power == pytest.approx(exact, rel=1e-8)
    for temperature in (30, 300, 6000):
        assert abs(by_rule(fine, temperature) / by_rule(coarse, temperature) - 1) < 1e-9


@pytest.mark.slow
def test_a_response_of_20_000_rows(tmp_path):
    """Reading this file row by row would take minutes."""
    x = np.linspace(3, 5, 20_001)
    values = np.abs(np.sin(40 * x))  # a response that is not smooth
    rule = band(csv(tmp_path, x, values))
    assert len(rule.wavelengths_um) < 70
    for power in (0, 1, 4):
        exact = np.trapezoid(values * x**power, x)
        assert rule.weights_um @ rule.wavelengths_um**power == pytest.approx(exact, rel=1e-6)


def test_steps_of_exactly_a_tenth_of_a_micrometre_leave_no_gap():
    """0.1 um is the widest accepted step; rounding to Float64 may make it a little wider."""
    x = np.array([round(3 + k / 10, 1) for k in range(21)])
    assert np.diff(x).max() > 0.1
    band("MWIR").check_covered(x, "table")
    with pytest.raises(InputError, match="does not cover"):
        band("MWIR").check_covered(np.array([3, 3.1, 3.2001, *x[3:]]), "table")


ROWS = np.array([2.5, 3.05, 3.3, 3.38, 3.9, 4.2, 4.7, 5.2, 6.0])


def exact_integral(values, response, breaks):
    """Integral of two functions that are straight between breaks, by Gauss's rule of degree 3."""
    total = 0.0
    for a, b in zip(breaks, breaks[1:]):
        x = (a + b) / 2 + (b - a) / 2 * np.array([-1, 1]) / np.sqrt(3)
        total += (b - a) / 2 * np.sum(np.interp(x, ROWS, values) * response(x))
    return total


def test_tabulated_spectra_are_integrated_exactly(tmp_path):
    """Spectrum and response are straight between their own rows, and limits lie anywhere."""
    values = np.random.default_rng(3).random((2, 9))
    for rule, response in (
        (band("3.1-4.95"), np.ones_like),
        (band(csv(tmp_path, *JAGGED)), lambda x: np.interp(x, *JAGGED)),
    ):
        limits = rule.lower_um, rule.upper_um
        inner = [x for x in (*ROWS, *JAGGED[0]) if limits[0] < x < limits[1]]
        breaks = np.unique([*limits, *inner])
        expected = [exact_integral(row, response, breaks) for row in values]
        assert rule.integral(ROWS, values) == pytest.approx(expected, rel=1e-12)
    # Rows outside the band and its neighbours have no weight
    weights = band("3.1-3.35").row_weights(ROWS)
    assert np.flatnonzero(weights).tolist() == [1, 2, 3]
    assert weights.sum() == pytest.approx(0.25, rel=1e-12)


def test_the_response_between_its_rows_and_outside(tmp_path):
    rule = band(csv(tmp_path, *JAGGED))
    x = [2.89, 2.95, 3.375, 5.6, 5.61]
    assert rule.response_at(x) == pytest.approx([0, 0.35, 0.925, 0, 0])
    assert band("MWIR").response_at([2.9, 3, 5, 5.1]).tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(
    "gaps, words",
    [
        ((), "it has 3-4.5 um$"),
        ((3.5,), "it has 3-3.5, 3.8-4.5 um, and gaps wider than 0.1 um between"),
        ((3.2, 3.6, 4.0), "it has 3-3.2, 3.5-3.6, 3.9-4, 4.3-4.5 um, and gaps"),
        ((3.1, 3.4, 3.7, 4.0), "it has 3-3.1, 3.4-3.4, 3.7-3.7, 4-4, ... um, and gaps"),
    ],
)
def test_what_a_table_lacks(gaps, words):
    """Two rows are left out after each gap's beginning; four parts are named at most."""
    x = np.round(np.arange(3, 4.51, 0.1), 1)
    left_out = [start + step for start in gaps for step in (0.1, 0.2)]
    x = np.array([value for value in x if not np.isclose(value, left_out).any()])
    with pytest.raises(InputError, match=f"table: does not cover band MWIR 3-5 um; {words}"):
        band("MWIR").check_covered(x, "table")


def test_a_gap_outside_the_band_does_no_harm():
    x = np.array([1.0, 2.95, 3.0, 3.05, 3.1, 3.2, 4.0])
    band("3-3.2").check_covered(x, "table")
    band("2.96-3.15").check_covered(x, "table")
    for spec in ("2.9-3.1", "3.1-3.21"):
        with pytest.raises(InputError, match="does not cover"):
            band(spec).check_covered(x, "table")


@pytest.mark.slow
def test_a_wide_response_is_thinned_panel_by_panel(tmp_path):
    rule = band(csv(tmp_path, np.linspace(1, 20, 300), np.ones(300)))
    assert rule.wavelengths_um.size <= 3 * 66
    for temperature in (30, 300, 6000):
        assert abs(by_rule(rule, temperature) / by_rule(band("1-20"), temperature) - 1) < 1e-9


def test_an_edited_response_is_read_again(tmp_path):
    path = csv(tmp_path, [3, 3.1, 3.2], [1, 1, 1])
    first = band(path)
    assert band(path) is first
    csv(tmp_path, [3, 3.1, 3.2], [2, 2, 2])  # the same size, at another time
    os.utime(path, ns=(1, 1))
    assert band(path).weights_um.sum() == pytest.approx(2 * first.weights_um.sum(), rel=1e-12)
    csv(tmp_path, [3, 3.1, 3.2, 3.3], [2, 2, 2, 2])  # another size, at the same time
    os.utime(path, ns=(1, 1))
    assert band(path).upper_um == 3.3


def test_rows_of_zeros_at_the_ends_are_outside_the_band(tmp_path):
    rule = band(csv(tmp_path, [1, 2, 3, 4, 5, 6], [0, 0, 0, 1, 0, 0]))
    assert (rule.lower_um, rule.upper_um) == (3, 5)
    np.testing.assert_allclose(rule.weights_um.sum(), 1.0, rtol=1e-12)  # the triangle's area


def test_comments_empty_lines_spaces_and_a_byte_order_mark_are_read_over(tmp_path):
    path = tmp_path / "response.txt"
    path.write_bytes(
        b"\xef\xbb\xbf# InSb\r\nwavelength_um, response\r\n\r\n 3 , 1\r\n# middle\r\n5,1\r\n"
    )
    for spec in (path, str(path)):
        np.testing.assert_allclose(band(spec).weights_um.sum(), 2.0, rtol=1e-12)


@pytest.mark.parametrize(
    "spec, message",
    [
        ("5-3", "'5-3': the limits must rise, within 0.1 to 1000 um"),
        ("4-4", "limits must rise"),
        ("-3-5", "limits must rise, within 0.1"),
        ("0.05-5", "within 0.1 to 1000 um"),
        ("3-5000", "within 0.1 to 1000 um"),
        ("nan-5", "unknown band 'nan-5'; known: .*MWIR"),
        ("3-x", "unknown band '3-x'; known: .*limits in um such as 3.5-4.2"),
        ("MWR", "unknown band 'MWR'; known: MWIR"),
        ("", "unknown band ''"),
        ("x" * 300, "unknown band"),
        ("missing.csv", "band file missing.csv: cannot be read: No such file"),
        (Path("missing"), "band file missing: cannot be read: No such file"),
    ],
)
def test_an_unusable_specification_is_one_line(spec, message):
    with pytest.raises(InputError, match=message) as error:
        band(spec)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "the header must name wavelength_um and response; found: nothing"),
        ("3,1\n5,1\n", "line 1: no header line; name the columns, such as wavelength_um,response"),
        ("wavelength_um,response\n", "no rows of data"),
        ("wavelength_um,response\n3,1\n", "needs two rows or more"),
        ("wavelength_um,response\n3,0\n5,0\n", "a response above 0"),
        ("wavelength_um,response\n3,1\n4,a\n", "line 3: 'a' in column 'response' is not a number"),
        ("wavelength_um,response\n3,1\n4\n", "line 3: 1 cells where the header names 2"),
        ("wavelength_um,response\n\n3,1,2\n", "line 3: 3 cells where the header names 2"),
        (
            "wavelength_um,response\n3,1\n5,1\n4,1\n",
            "line 4: wavelength_um 4 after 5; must be rising",
        ),
        ("wavelength_um,response\n3,1\n3,1\n", "line 3: wavelength_um 3 after 3; must be rising"),
        ("wavelength_um,response\n3,1\n5,-0.1\n", "line 3: response = -0.1; must lie in 0..1e"),
        (
            "wavelength_um,response\n3,1\n5,inf\n",
            "line 3: 'inf' in column 'response' is not a number",
        ),
        (
            "wavelength_um,response\n3,1\n5,nan\n",
            "line 3: 'nan' in column 'response' is not a number",
        ),
        (
            "wavelength_um,response\n3000,1\n5000,1\n",
            "line 2: wavelength_um = 3000; must lie in 0.1..1000",
        ),
        ("wavelength_um,response\n-3,1\n5,1\n", "line 2: wavelength_um = -3; must lie in"),
    ],
)
def test_an_unusable_response_is_one_line_that_names_the_file_and_the_row(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        band(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)


def test_a_folder_and_a_picture_are_no_response(tmp_path):
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="picture.csv: not a text file"):
        band(tmp_path / "picture.csv")
    with pytest.raises(InputError, match="Is a directory"):
        band(tmp_path)
