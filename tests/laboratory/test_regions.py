"""Regions of images of temperatures: means, differences with common errors, hottest pixels."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError

GIVEN = {"emissivity": (0.9, 0.03), "reflected": (290.0, 3.0), "sigma": 1.5}
SEEN = np.linspace(295.0, 340.0, 48).reshape(6, 8)
SEEN[2, 3] = 350.0
SEEN[5, 7] = np.nan


def kelvin(seen, emissivity=0.9, reflected=290.0, offset=0.0):
    """Temperatures of an image by one call without regions."""
    given = {"emissivity": emissivity, "reflected": reflected}
    return mi_lcair.temperature(np.asarray(seen) + offset, "LWIR", **given).kelvin


def deviations():
    """Standard uncertainty of functions of all temperatures, by differences of whole images."""
    changed = [
        (kelvin(SEEN, 0.9 + 0.0015), kelvin(SEEN, 0.9 - 0.0015)),
        (kelvin(SEEN, reflected=290.15), kelvin(SEEN, reflected=289.85)),
        (kelvin(SEEN, offset=0.075), kelvin(SEEN, offset=-0.075)),
    ]
    return lambda of: np.linalg.norm([(of(high) - of(low)) * 10 for high, low in changed])


def test_means_and_differences_have_the_errors_that_they_share():
    result = mi_lcair.temperature(SEEN, "LWIR", spots=["1,0", (6, 4)], areas=["5,3,3,3"], **GIVEN)
    functions = [
        lambda a: a[0, 1], lambda a: a[4, 6], lambda a: np.nanmean(a[3:6, 5:8]),
        lambda a: a[2, 3], np.nanmean,
    ]  # fmt: skip
    table, every, deviation = result.regions, kelvin(SEEN), deviations()
    names = ["spot 1,0", "spot 6,4", "area 5,3,3,3", "hottest pixel 3,2", "image"]
    assert table["region"].tolist() == names
    np.testing.assert_allclose(table["mean_K"], [f(every) for f in functions])
    np.testing.assert_allclose(table["mean_error_K"], list(map(deviation, functions)), rtol=2e-3)
    assert table["highest_x"].tolist() == [1, 6, 6, 3, 3]
    assert table["highest_y"].tolist() == [0, 4, 5, 2, 2]
    assert table["lowest_K"][4] == np.nanmin(every) and table["highest_K"][2] == every[5, 6]
    others = [lambda a, f=f: functions[0](a) - f(a) for f in functions[1:3]]
    differences = result.differences
    assert differences["difference"].tolist() == ["spot 1,0 - spot 6,4", "spot 1,0 - area 5,3,3,3"]
    np.testing.assert_allclose(differences["mean_K"], [f(every) for f in others])
    errors = list(map(deviation, others))
    np.testing.assert_allclose(differences["mean_error_K"], errors, rtol=2e-3)
    assert max(errors) < 0.6 * np.hypot(*table["mean_error_K"][:2])  # what independent ones give
    for rows, error in ((table, table["mean_error_K"]), (differences, np.array(errors))):
        np.testing.assert_allclose(rows["to_K"] - rows["from_K"], 2 * 1.96 * error, rtol=0.1)
        middle = (rows["to_K"] + rows["from_K"]) / 2
        np.testing.assert_array_less(abs(middle - rows["mean_K"]), 0.25 * error)


def test_the_headline_is_that_of_the_first_region():
    result = mi_lcair.temperature(SEEN, "LWIR", spots=["6,4"], areas=["0,0,2,2"], **GIVEN)
    assert result.headline.value == pytest.approx(kelvin(SEEN)[4, 6])
    assert result.headline.standard_error == pytest.approx(result.sigma[4, 6])
    assert "(spot 6,4), image" in result.summary()
    assert result.interval_K == (result.regions["from_K"][0], result.regions["to_K"][0])
    assert result.as_dict()["estimate"]["value"] == result.headline.value
    without = mi_lcair.temperature(SEEN, "LWIR", **GIVEN)
    assert without.headline.value == np.nanmax(without.kelvin) and not without.differences
    assert "(hottest pixel 3,2)" in without.summary()


@pytest.mark.parametrize(
    "given, words",
    [
        ({"spots": ["8,0"]}, "spot 8,0 lies outside the image of 8 x 6 pixels.*7,5"),
        ({"areas": ["6,4,3,2"]}, "area 6,4,3,2 lies outside"),
        ({"spots": ["7,5"]}, "spot 7,5 has no temperature"),
        ({"spots": ["1"]}, "spot '1': give whole numbers x,y, such as 120,80"),
        ({"spots": ["1.5,2"]}, "spot '1.5,2': give whole"),
        ({"spots": ["-1,2"]}, "spot '-1,2': give whole"),
        ({"spots": [7]}, "spot '7': give whole"),
        ({"areas": ["1,1,0,2"]}, "area '1,1,0,2': give whole numbers x,y,width,height"),
        ({"areas": ["1,1,a,2"]}, "area '1,1,a,2': give"),
        ({"image": 300.0, "spots": ["0,0"]}, "300 K: a number has no spot 0,0"),
    ],
)
def test_bad_regions_are_one_line(given, words):
    with pytest.raises(InputError, match=words) as error:
        mi_lcair.temperature(given.pop("image", SEEN), "LWIR", **GIVEN, **given)
    assert "\n" not in str(error.value)
