"""Parts of an exposure, calculated by hand; its values are in `test_image`."""

import ctypes
import math
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair import image
from mi_lcair.detection.camera.exposure import (
    ModelError,
    changed_channels,
    detector_mean,
    exposure_of,
    interpolated,
    model_squares,
    part_areas,
    placed,
    weighted,
)
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.rendering.images.spectral import Arrival
from mi_lcair.rendering.measure import measure
from tests.detection.camera.plate_scenario import plate
from tests.detection.camera.test_view import PERSPECTIVE, front

MWIR = band("MWIR")
SOURCES = [SimpleNamespace(in_band=900.0), SimpleNamespace(in_band=0.4)]


def totals(hit, target, error, missed=0.0):
    """In place of `Totals`: means and standard errors of parts."""
    means = {"target.hit": np.array(hit), "target": np.array(target)}
    return SimpleNamespace(
        mean=means.get,
        standard_error=lambda: np.array(error),
        missed_error=lambda: np.full(len(hit), missed),
        paths=np.ones(len(hit)),
        emitters=SimpleNamespace(sources=SimpleNamespace(list=SOURCES)),
        sums={"target.source.0": np.ones(len(hit)), "target.source.1": np.zeros(len(hit))},
    )


def rms_error(total, in_pixel):
    return np.sqrt(model_squares(total, in_pixel, total.standard_error() ** 2).mean())


def test_rms_error():
    """Of parts that the model fills, over the root of the parts in a pixel, by their mean."""
    total = totals([0, 0.5, 1, 1, 1], [0, 2, 4, 4, 6], [99, 0.3, 0.4, 0.5, 0.2])
    variance = (0.09 + 0.16 + 0.25 + 0.04) / 4
    assert rms_error(total, 1) == pytest.approx(np.sqrt(variance) / 4, rel=1e-12)
    assert rms_error(total, 3) == pytest.approx(np.sqrt(variance / 3) / 4, rel=1e-12)
    # A model of four parts does not average over nine
    assert rms_error(total, 9) == pytest.approx(np.sqrt(variance / 4) / 4, rel=1e-12)
    assert ModelError(0.01, 1).excess(total) == pytest.approx(np.sqrt(variance) / 0.04, rel=1e-12)
    assert rms_error(totals([0, 0], [0, 0], [1, 1]), 1) == 0
    assert rms_error(totals([1, 1], [0, 0], [1, 1]), 1) == 0


def test_a_source_that_no_path_met_is_in_one_part():
    """Of four parts on the model, with a mean of 4, one has an error of .3, or 2.5 times .4."""
    for in_pixel, parts, missed in ((1, 1, 0.3), (3, 3, 0.3), (9, 4, 9.0)):
        total = totals([0, 0.5, 1, 1, 1], [0, 2, 4, 4, 6], [99, 0, 0, 0, 0], missed)
        ratio = min(missed, 2.5 * 0.4 / 1.959964) / 4 / np.sqrt(4 * parts)
        assert ModelError(0.01, in_pixel).excess(total) == pytest.approx(ratio / 0.01, rel=1e-6)


@pytest.mark.parametrize("brightest, of_group", [({}, 0.0), ({"other": 0.4}, 0.4)])
def test_a_group_of_unknown_spectrum_that_no_path_met_has_its_bound(brightest, of_group):
    """0 if it has no emitter."""
    total = totals([1, 1], [4, 4], [0, 0], missed=9.0)
    total.emitters.sources.list = [SOURCES[0], SimpleNamespace(in_band=None, group="other")]
    total.emitters.brightest_of = brightest
    ratio = 2.5 * of_group / 1.959964 / 4 / np.sqrt(2)
    assert ModelError(0.01, 1).excess(total) == pytest.approx(ratio / 0.01, rel=1e-6)


def test_a_model_with_a_part_that_does_not_emit(tmp_path):
    """The part reflects the plate, and its own group adds nothing."""
    scenario = plate(tmp_path, 1.0, 1.0, render__spp=4)
    file = tmp_path / "disc.xml"
    ball = '<shape type="sphere"> <point name="center" value="0, 2, 0"/>'
    ball += ' <bsdf type="diffuse"/> </shape>'
    file.write_text(file.read_text().replace("</scene>", f"{ball}</scene>"))
    layers = image(scenario, truth=True).truth.channels
    assert not layers["reflected.other.Y"].any()
    assert layers["mask.Y"].sum() * 0.15**2 == pytest.approx(1 + np.pi, rel=0.01)


def test_sums_do_not_depend_on_the_number_of_threads():
    """Workers have fewer threads than a process alone, and BLAS adds in another order then."""
    (library,) = Path(np.__file__).parents[1].glob("numpy.libs/libscipy_openblas64_*")
    threads = ctypes.CDLL(str(library)).scipy_openblas_set_num_threads64_
    pairs = np.random.default_rng(0).random((10, 2, 50_000))
    try:
        sums = [(threads(count), [weighted(*pair) for pair in pairs])[1] for count in (1, 2)]
    finally:
        threads(os.cpu_count())
    assert sums[0] == sums[1]
    assert sums[0] == pytest.approx([math.fsum(np.prod(pair, axis=0)) for pair in pairs], rel=1e-13)


def test_areas_of_parts():
    """(0.5 m / 6)^2 for parallel rays; in perspective (distance along the axis x 0.01 / 6)^2."""
    view = front()
    on = np.zeros(np.prod(view.size), dtype=bool)
    on[[3, 400]] = True
    np.testing.assert_allclose(part_areas(view, on, np.array([40.0, 60.0])), (0.5 / 6) ** 2)
    view = front(PERSPECTIVE)
    on = np.zeros(np.prod(view.size), dtype=bool)
    on[[0, 20 * view.size[0] + 70]] = True
    x = (view.first[0] + np.array([0, 70]) + 0.5) / 6 - 32
    y = (view.first[1] + np.array([0, 20]) + 0.5) / 6 - 24
    along = np.array([49.0, 51.0]) / np.sqrt(1 + (0.01 * x) ** 2 + (0.01 * y) ** 2)
    areas = part_areas(view, on, np.array([49.0, 51.0]))
    np.testing.assert_allclose(areas, (along * 0.01 / 6) ** 2, rtol=1e-12)


def test_values_at_their_places():
    on = np.array([False, True, False, False, True, True])
    assert placed([1.0, 2.0, 3.0], on, (2, 3)).tolist() == [[0, 1, 0], [0, 2, 3]]


def test_many_ranges_are_interpolated():
    """129 ranges in equal ratios, or fewer in ratios of at most 1.005; few are computed as such."""
    asked = []

    def arrival_from(ranges):
        asked.append(ranges)
        return Arrival({"a": 1.0}, {"a": np.exp(-ranges / 1000)}, 1e-3 * ranges)

    few = np.linspace(1000, 1100, 21)
    assert interpolated(arrival_from, few).arrives["a"] == pytest.approx(np.exp(-few / 1000))
    many = np.random.default_rng(0).uniform(1000, 1100, 500)
    arrival = interpolated(arrival_from, many)
    assert asked[0] is few and len(asked[1]) == 2 + 20
    assert asked[1][[0, -1]] == pytest.approx([many.min(), many.max()])
    assert np.ptp(np.diff(np.log(asked[1]))) < 1e-12 and asked[1][1] / asked[1][0] < 1.005
    assert arrival.arrives["a"] == pytest.approx(np.exp(-many / 1000), rel=5e-6)
    assert arrival.path == pytest.approx(1e-3 * many, rel=1e-9) and arrival.in_band == {"a": 1.0}
    interpolated(arrival_from, np.linspace(100, 1000, 130))
    assert len(asked[2]) == 129
    interpolated(arrival_from, np.full(9, 700.0))
    assert len(asked[3]) == 2


def test_background_at_a_detector():
    """By the band's rule for a smooth spectrum, exactly for one on straight lines."""
    smooth = Backdrop("blackbody", lambda x: spectral_radiance(x, 300.0), np.empty(0))
    assert detector_mean(smooth, MWIR) == pytest.approx(in_band_radiance(MWIR, 300.0), rel=1e-12)
    rows = np.round(np.arange(2.9, 5.11, 0.1), 1)
    tent = Backdrop("tent", lambda x: 1 - abs(np.asarray(x) - 4), rows)
    assert detector_mean(tent, MWIR) == pytest.approx(1, rel=1e-12)
    with pytest.raises(InputError, match="background tent: does not cover band LWIR"):
        detector_mean(tent, band("LWIR"))


@pytest.mark.slow
def test_paths_are_traced_once_for_other_temperatures_air_and_detectors(tmp_path, monkeypatch):
    """The paths of one scene give the electrons that separate images of other cases have."""
    calls = []
    monkeypatch.setattr(
        "mi_lcair.detection.camera.exposure.measure",
        lambda *arguments: calls.append(1) or measure(*arguments),
    )
    first, second = (
        plate(tmp_path, 2.0, 2.0, target__parameters={"temperature": kelvin}, **changes)
        for kelvin, changes in (
            (300, {}),
            (340, {"background__temperature": 260, "atmosphere__table": "us_standard"}),
        )
    )
    second = replace(second, camera=replace(second.camera, integration_time_ms=0.02))
    (paths, _), shot = Shot.of(first, 0).traced(truth=True), Shot.of(second, 0)
    with shot.setting.view.prepared(by_spectrum=True) as tracer:
        paths = paths.at_temperatures(tracer.emitters.sources)
    exposed = exposure_of(paths, *shot.arguments)
    _, channels, _ = shot.developed(exposed, 1)
    assert len(calls) == 1
    alone = image(second, truth=True)
    for name in ("apparent.Y", "electrons.Y", "mean_temperature.Y", "counts.Y"):
        np.testing.assert_allclose(channels[name], alone.channels[name], rtol=3e-6)
    truth = shot.truth(exposed, {}).channels
    assert truth.keys() == alone.truth.channels.keys() and truth["true_temperature.Y"].max() == 340
    for name, values in truth.items():
        if not name.startswith("stderr."):
            np.testing.assert_allclose(values, alone.truth.channels[name], rtol=3e-6, atol=1e-5)


@pytest.mark.parametrize("by_source", [True, False])
def test_parts_at_other_temperatures(by_source):
    """Twice the light of one of two sources of a group, which is a third of what is emitted."""
    channels = {"target": 10.0, "target.group.a": 9.0, "target.group.b": 1.0}
    channels |= {"target.source.0": 6.0, "target.source.1": 3.0, "target.source.2": 1.0}
    channels |= {"target.upto.0.group.a": 6.0, "target.upto.0.group.b": 0.0}
    if by_source:
        channels |= {f"target.upto.0.source.{k}": value for k, value in enumerate((4.0, 2.0, 0.0))}
    hot = changed_channels(
        {name: np.array([value]) for name, value in channels.items()}, {1: ("a", 1.0)}
    )
    assert (hot["target"], hot["target.group.a"], hot["target.group.b"]) == (13, 12, 1)
    assert hot["target.upto.0.group.a"] == pytest.approx(8) and hot["target.upto.0.group.b"] == 0
