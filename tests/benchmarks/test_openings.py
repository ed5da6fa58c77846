"""The thesis's eight cavities: its Table B.1 recomputed, and its Fig 4.1 rendered."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.methods.propagation.exact import cavity_emissivity
from benchmarks.openings import REFLECTIONS, aperture_shares, main, openings
from mi_lcair.formats import read_columns

FACETTING = 3e-4  # difference between the facetted sphere and a sphere, see scenes/cavity.xml


@pytest.mark.slow
def test_the_eight_openings():
    rows = openings(2**14)
    assert [row.facets for row in rows if row.contradicts] == [24, 36, 60, 80]
    for row in rows:
        assert abs(row.ratio - row.printed) < 8e-4
        assert abs(row.share - row.printed) < 2e-3
        assert row.exact == pytest.approx(cavity_emissivity(row.facets), rel=1e-12)
        assert abs(row.gouffe - row.exact) < 0.0025
        for k in REFLECTIONS:
            expected = cavity_emissivity(row.facets, k)
            assert abs(row.apparent[k] - expected) < 5.5 * row.error[k] + FACETTING
    # Appendix B: .75 after one reflection for the opening of 4 facets; 96 % of the limit after four
    assert f"{rows[1].apparent[1]:.2f}" == "0.75"
    assert rows[1].apparent[4] / rows[1].exact == pytest.approx(0.97, abs=0.01)


@pytest.mark.slow
def test_chart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(["--quick", "-o", "charts"])
    table = read_columns("charts/openings.csv")
    np.testing.assert_array_equal(table["facets_removed"], [2, 4, 8, 16, 24, 36, 60, 80])
    assert list(table["printed_contradicts_areas"]) == ["no"] * 4 + ["yes"] * 4
    assert Path("charts/openings.png").stat().st_size > 5000


@pytest.mark.parametrize("ratio", [0.3, 1.0, 4.0, 30.0])
def test_shares_of_the_aperture_follow_from_surfaces_of_revolution(ratio):
    """Areas of walls by quadrature of their profiles, for an aperture of radius 1 (Fig 3.33)."""
    R = (ratio**2 + 1) / (2 * ratio)  # of the sphere with this depth
    profiles = {  # radius along the depth, and whether the area of the aperture is added
        "cone": (lambda z: 1 - z / ratio, np.pi),
        "cylinder": (lambda z: np.ones_like(z), 2 * np.pi),  # with its bottom
    }
    shares = aperture_shares(ratio)
    z = np.linspace(0, ratio, 20001)
    for shape, (radius, more) in profiles.items():
        r = radius(z)
        wall = np.sum(np.pi * (r[1:] + r[:-1]) * np.hypot(np.diff(r), np.diff(z)))
        assert shares[shape] == pytest.approx(np.pi / (wall + more), rel=1e-6)
    angle = np.arccos((R - ratio) / R)  # of the wall, from the bottom to the rim
    wall = 2 * np.pi * R**2 * (1 - np.cos(angle))
    assert shares["sphere"] == pytest.approx(1 - wall / (4 * np.pi * R**2), rel=1e-9)
