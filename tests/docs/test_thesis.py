"""The page "From the thesis" lists everything that the thesis numbers, once."""

import re
from collections import Counter

from scipy.integrate import nquad

from tests.docs.fences import ROOT

PAGE = ROOT / "docs" / "validation" / "thesis.md"
FIGURES = {"2": 16, "3": 35, "4": 23, "A": 4, "B": 1, "C": 1}  # numbered figures by chapter
TABLES = {"2": 3, "3": 3, "4": 3, "B": 1}
# Number of subsections of each section that has some; 2.7, 3.9, 4.4 and 5.4 are summaries
SECTIONS = re.findall(
    r"(\S+):(\d+)",
    """
    2:7 2.1:2 2.3:6 2.3.1:3 2.3.2:2 2.3.3:4 2.3.4:3 2.5:4 2.6:1
    3:9 3.2:4 3.2.1:7 3.2.3:3 3.3:4 3.3.2:2 3.4:2 3.4.2:2 3.5:6 3.8:3
    4:4 4.2:5 4.3:5 5:4 A:2 B:2 C:2
    """,
)


def test_everything_is_listed_once():
    rows = re.findall(r"^\| (.+?) \| ", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    listed = [item for row in rows for item in row.split(", ") if item != "item"]
    expected = [f"Fig {c}.{k}" for c, count in FIGURES.items() for k in range(1, count + 1)]
    expected += [f"Table {c}.{k}" for c, count in TABLES.items() for k in range(1, count + 1)]
    expected += [f"{c}.{k}" for c, count in SECTIONS for k in range(1, int(count) + 1)]
    assert Counter(listed) == Counter(expected)


def test_two_plates_by_the_double_integral():
    """Eq A.1 to A.3 by quadrature: the thesis's "analytical" 21.53 W/sr is 2.5 % too low.

    The plates lie in the planes z = 0 and x = 0, with a common edge of 0.1 m, and reach 0.2 m away
    from it. The quadrature begins 1e-6 m from the edge, where the integrand is singular.
    """
    radiance = 5.670374419e-8 * 800**4 / 3.141592653589793

    def integrand(x, z, dy):
        # Pairs of places at a distance dy along the edge: 2 (0.1 - dy) of them
        return 2 * (0.1 - dy) * x * z / (x**2 + z**2 + dy**2) ** 2

    edge, options = 1e-6, {"epsrel": 1e-5, "limit": 100}
    limits = [[edge, 0.2], [edge, 0.2], [0, 0.1]]
    value, _ = nquad(integrand, limits, opts=[options] * 3)
    intensity = radiance * value / 3.141592653589793
    assert f"{intensity:.4f}" == "22.0755"
    assert f"{1 - 21.53 / intensity:.1%}" == "2.5%"
    assert abs(22.05 / intensity - 1) < 0.0012
