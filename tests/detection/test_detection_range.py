"""Tests of detection ranges: closed forms in vacuum and in grey air, and special cases."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mi_lcair.detection.detection_range import detection_range, largest_ranges
from mi_lcair.detection.irradiance import Backdrop, Irradiance, LineOfSources, RenderError
from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate
from mi_lcair.physics.atmosphere import AtmosphereTable, atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.imager import Detector
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.views import View
from mi_lcair.signatures.effective_areas import EffectiveAreas
from mi_lcair.signatures.view_areas import ViewAreas

LWIR, HOT, AIR, SKY, AREA, ERROR = band("LWIR"), 330.0, 270.0, 290.0, 10.0, 0.1  # K; m^2
DEPTH = 1e-3  # optical depth per metre of the air
L = {T: float(in_band_radiance(LWIR, T)) for T in (HOT, AIR, SKY)}
BACKDROP = Backdrop("sky", lambda x: spectral_radiance(x, SKY), np.empty(0))


def target(air):
    """A blackbody whose only error is that of its area."""
    one = np.full((2, 2, 2), ERROR**2)
    areas = EffectiveAreas(
        band=LWIR,
        sources=[Source("self", "330 K", L[HOT], HOT)],
        amounts=np.full((2, 2), AREA),
        error=np.full((2, 1), ERROR),
        covariance=one,
        nodes_um=np.empty(0),
    )
    return Irradiance(areas, RenderError(), LWIR, air, BACKDROP)


def grey_air(last_m=10_000.0):
    """Air with the same optical depth per metre at all wavelengths, at AIR kelvin."""
    x, ranges = np.linspace(7.9, 12.1, 1001), np.array([100.0, last_m])
    transmittance = np.exp(-DEPTH * ranges)[:, None] * np.ones(len(x))
    return AtmosphereTable(
        "grey", ranges, x, transmittance, (1 - transmittance) * spectral_radiance(x, AIR)
    )


def contrast(r):
    """Contrast of the target through grey_air, W m^-2.

    It is positive at short range. Beyond, it is negative, because the air is colder than the sky.
    """
    tau = np.exp(-DEPTH * r)
    return (tau * L[HOT] + (1 - tau) * L[AIR] - L[SKY]) * AREA / r**2


@pytest.mark.parametrize("nei, optics", [(1e-7, 1.0), (1e-9, 0.5)])
def test_vacuum(nei, optics):
    air = atmosphere("vacuum")
    result = detection_range(target(air), Detector(LWIR, optics, nei=nei, snr=7), air, 2.0)
    expected = np.sqrt(optics * (L[HOT] - L[SKY]) * AREA / (7 * nei))
    assert (
        result.intervals_m == [(2.0, pytest.approx(expected, rel=1e-6))]
        and result.largest_m == result.intervals_m[0][1]
    )
    assert (
        result.standard_error_m == pytest.approx(expected * ERROR / AREA / 2, rel=1e-6)
        and not result.at_least
    )


def test_several():
    """The target is detected as hot and, farther away, as cold; in between its contrast is 0."""
    zero = brentq(contrast, 100, 5000)
    largest = np.abs(contrast(np.linspace(zero, 9000, 10_000))).max()
    nei = 0.3 * largest / 10
    edge = lambda sign, a, b: brentq(lambda r: sign * contrast(r) - 10 * nei, a, b)  # noqa: E731
    turn = (
        zero + (9000 - zero) * np.argmax(np.abs(contrast(np.linspace(zero, 9000, 10_000)))) / 9999
    )
    air = grey_air()
    result = detection_range(target(air), Detector(LWIR, nei=nei), air, 5.0)
    assert [
        pytest.approx(interval, rel=1e-4)
        for interval in ((5.0, edge(1, 100, zero)), (edge(-1, zero, turn), edge(-1, turn, 9999)))
    ] == result.intervals_m
    end, step = result.largest_m, 1e-3
    slope = (contrast(end + step) - contrast(end - step)) / 2 / step
    assert (
        result.standard_error_m
        == pytest.approx(abs(contrast(end)) * ERROR / AREA / abs(slope), rel=1e-3)
        and not result.at_least
    )


def test_a_gap_narrower_than_a_step():
    """The search finds the gap around the range at which the signal changes its sign.

    The edges of the gap are 0.01 % of the range apart.
    """
    zero = brentq(contrast, 100, 5000)
    slope = (contrast(zero + 1e-3) - contrast(zero - 1e-3)) / 2e-3
    nei = abs(slope) * 5e-5 * zero / 10
    air = grey_air()
    (_, first), (second, _), *_ = detection_range(
        target(air), Detector(LWIR, nei=nei), air, 5.0
    ).intervals_m
    assert first < zero < second and second - first == pytest.approx(1e-4 * zero, rel=0.02)


def test_none():
    for air in (atmosphere("vacuum"), grey_air()):
        result = detection_range(target(air), Detector(LWIR, nei=1e3), air, 5.0)
        assert (
            result.intervals_m == []
            and result.largest_m is result.standard_error_m is None
            and not result.at_least
        )


def test_the_table_ends_first():
    air = grey_air(300.0)
    result = detection_range(target(air), Detector(LWIR, nei=1e-12), air, 5.0)
    assert (
        result.intervals_m == [(5.0, 300.0)] and result.at_least and result.standard_error_m is None
    )
    assert result.as_dict() == {
        "kind": "detection_range",
        "largest_m": 300.0,
        "intervals_m": [[5.0, 300.0]],
        "standard_error_m": None,
        "at_least": True,
    }


def test_refused():
    air = grey_air(300.0)
    with pytest.raises(InputError, match="needs nei"):
        detection_range(target(air), Detector(LWIR), air, 5.0)
    with pytest.raises(
        InputError, match="its last range, 300 m, lies within the target's radius of 400 m"
    ):
        detection_range(target(air), Detector(LWIR, nei=1), air, 400.0)


class Signal:
    """In place of `Irradiance`: a contrast that is a function of range, with an error of 0.01."""

    def __init__(self, function):
        self.function = function

    def at(self, path):
        return {"total": Estimate(self.function(path.range_m), 0.01)}


def test_signals_of_both_signs():
    """3 - r / km reaches 1 at 2 km and -1 at 4 km. With a level of 2 km it ends at 1 km."""
    detector = Detector(LWIR, nei=0.1, snr=10)
    falling = Signal(lambda r: 3 - r / 1000)
    result = detection_range(falling, detector, grey_air(), 10.0)
    (first, second) = result.intervals_m
    assert first == pytest.approx((10, 2000), rel=1e-9)
    assert second == pytest.approx((4000, 10_000), rel=1e-9)
    assert result.at_least and result.standard_error_m is None and result.largest_m == 10_000
    shorter = detection_range(falling, detector, grey_air(3500.0), 10.0)
    assert shorter.intervals_m == [pytest.approx((10, 2000), rel=1e-9)]
    # The error of the signal over its slope, 1e-3 per metre
    assert shorter.standard_error_m == pytest.approx(10, rel=1e-4) and not shorter.at_least
    optics = Detector(LWIR, optics_transmittance=0.5, nei=0.1, snr=10)
    assert detection_range(falling, optics, grey_air(3500.0), 10.0).largest_m == pytest.approx(1000)


def test_from_a_range_on():
    """r / km - 2 reaches -1 at 1 km and 1 at 3 km."""
    rising = Signal(lambda r: r / 1000 - 2)
    detector = Detector(LWIR, nei=0.1, snr=10)
    result = detection_range(rising, detector, grey_air(), 10.0)
    assert np.ravel(result.intervals_m) == pytest.approx([10, 1000, 3000, 10_000], rel=1e-9)
    assert result.summary().startswith("detected at 10-1000 m, 3000-10000 m; at least")
    assert result.columns()["start_m"].tolist() == pytest.approx([10, 3000])


def views(areas_m2):
    """Blackbodies of some areas, known to 1 %, whose radiation has an error of 2 % beside that."""
    count, amounts = len(areas_m2), np.repeat(np.reshape(areas_m2, (-1, 1)), 2, axis=1)
    return ViewAreas(
        band=LWIR,
        sources=[Source("self", "330 K", L[HOT], HOT)],
        nodes_um=np.empty(0),
        views=(View(0.0, 0.0),) * count,
        amounts=amounts,
        deviations=np.array([0.006, -0.008])[:, None] * amounts[:, None, :],
        relative=np.full(count, 0.02),
        missed=np.zeros(count),
        paths=np.ones(count, dtype=int),
        reached=np.ones(count, dtype=bool),
    )


def test_largest_ranges_of_many_views():
    """Seen to the table's end, as colder than the sky, as hotter only, and never.

    The slope and the error at the end of a range are those of `contrast`.
    """
    areas, air, detector = views([1e5, 5.0, 0.1, 1e-9]), grey_air(), Detector(LWIR, 0.5, nei=1e-7)
    line = LineOfSources(areas, LWIR, air, BACKDROP)
    largest, errors = largest_ranges(line, areas, detector, air, 5.0)
    assert largest[[0, 3]].tolist() == [10_000, 0] and np.isnan(errors[[0, 3]]).all()
    level = 10 * 1e-7 / 0.5
    for k, sign, ends in ((1, -1, (2000, 9999)), (2, 1, (5, 1300))):
        signal = lambda r, k=k: contrast(r) * areas.amounts[k, 0] / AREA  # noqa: E731
        end = brentq(lambda r: sign * signal(r) - level, *ends)
        assert largest[k] == pytest.approx(end, rel=2e-4)
        target = np.exp(-DEPTH * end) * L[HOT] * areas.amounts[k, 0] / end**2
        slope = (signal(end + 0.01) - signal(end - 0.01)) / 0.02
        error = np.hypot(0.01 * level, 0.02 * target) / abs(slope)
        assert errors[k] == pytest.approx(error, rel=5e-3)
    with pytest.raises(InputError, match="lies within the target's radius"):
        largest_ranges(line, areas, detector, air, 10_000.0)


def test_largest_ranges_in_vacuum():
    """Area (B(T) - B(sky)) = level range^2; half of the relative error of the signal."""
    areas, air = views([10.0, 1e-9]), atmosphere("vacuum")
    line, detector = LineOfSources(areas, LWIR, air, BACKDROP), Detector(LWIR, 0.5, nei=1e-7)
    largest, errors = largest_ranges(line, areas, detector, air, 5.0)
    end = np.sqrt(10 * (L[HOT] - L[SKY]) / (10 * 1e-7 / 0.5))
    of_target = 0.02 * L[HOT] / (L[HOT] - L[SKY])
    assert largest == pytest.approx([end, 0], rel=1e-6)
    assert errors[0] == pytest.approx(end * np.hypot(0.01, of_target) / 2, rel=1e-6)
    assert np.isnan(errors[1])
