"""How paths are drawn, where the scene leaves it open."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering import pilots
from mi_lcair.rendering.measurands import IntensityInterval, Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.pilots import cheapest, cost, needed_paths, open_settings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.rendering.made_totals import totals


def loaded(name, **parameters):
    return mi_lcair.load(name, resolution=8, **parameters)


def test_rays_of_a_path():
    assert cost(3.0) == 3 and cost(3.0, 2) == 7 and cost(0.5, 2) == 0.5


@pytest.mark.parametrize(
    ("name", "tolerance", "draws"), [("two_plates", 0.01, "true"), ("furnace", 2e-5, "false")]
)
def test_the_choice_is_the_cheaper_one(name, tolerance, draws):
    """A plate that only reflects another, and a room whose paths all have nearly one radiance: the
    result is that of the cheaper setting, number for number.
    """
    by_pilot, by_hand = (
        mi_lcair.signature(loaded(name, emitter_sampling=text), tolerance=tolerance, seed=3)
        for text in ("auto", draws)
    )
    assert by_pilot.target.intensity == by_hand.target.intensity
    assert by_pilot.paths == by_hand.paths


@pytest.mark.parametrize("split", [None, "image", "target", "model"])
def test_the_pilot_counts_rays_in_every_split(split):
    """Also where nothing else is recorded, and where only paths to the model are followed."""
    scene = loaded("cavity", emitter_sampling="auto")
    windows, whole = Windows.whole(scene.sensor(0)), IntensityInterval(1e-4, None)
    counting = replace(Measurands.of(split), channels=Channels(split, counts_segments=True))
    total = measure(scene, windows, Sampling(paths=2**12), counting)
    assert total.mean("segments")[0] > 1
    arguments = windows, Sampling(), Measurands.of(split), whole
    assert cheapest(scene, ["emitter_sampling"], *arguments) == {"emitter_sampling": False}


def test_where_little_is_needed_no_pilot_decides(monkeypatch):
    monkeypatch.setattr("mi_lcair.rendering.measure.cheapest", pytest.fail)
    mi_lcair.signature(loaded("furnace", emitter_sampling="auto"), tolerance=0.01)


def test_paths_go_on_where_drawing_does_not_pay(monkeypatch):
    """The first paths are traced once."""
    first_points, launches = [], Windows.launches

    def noted(windows, active, done, *arguments):
        first_points.append(done)
        return launches(windows, active, done, *arguments)

    monkeypatch.setattr(Windows, "launches", noted)
    monkeypatch.setattr("mi_lcair.rendering.measure.cheapest", lambda *arguments: {})
    monkeypatch.setattr("mi_lcair.rendering.measure.WORTH_AIMING", np.inf)
    mi_lcair.signature(loaded("furnace", emitter_sampling="auto"), tolerance=2e-5)
    assert len(first_points) > 1 and first_points.count(0) == 1


def test_needed_paths():
    """Scatter falls as the root of the number of paths, and the bound of unmet sources as 1 / n."""
    means = 1 + 0.1 * np.array([[-1.0, 1, -1, 1, -1, 1, -1, 1]])
    of_scatter, of_bound = totals(means), totals(np.ones((1, 8)), unmet=UnmetSources(3.0))
    paths = 8 * 64
    assert needed_paths(of_scatter, 10.0) == pytest.approx(100 * paths)
    assert needed_paths(of_bound, 10.0) == pytest.approx(10 * paths)
    both = totals(means, unmet=UnmetSources(3.0))
    needed = needed_paths(both, 10.0) / paths
    random, missed = (t.half_width()[0] / both.half_width()[0] for t in (of_scatter, of_bound))
    assert 100 * (random**2 / needed + missed**2 / needed**2) == pytest.approx(1)
    assert needed_paths(both, np.inf) > 1e50


def test_who_is_asked():
    """Not a scene that says it, a fixed number of paths, or derivatives."""
    target, criterion = Measurands.of("target"), IntensityInterval(0.01)
    scene = loaded("cavity", emitter_sampling="auto")
    both = ["emitter_sampling", "opening_sampling"]
    assert open_settings(scene, target, criterion) == both
    assert open_settings(scene, target, None) == []
    reduced = Measurands(target.channels, reduced=lambda sums: sums)
    assert open_settings(scene, reduced, criterion) == []
    for text in ("true", "false"):
        scene = loaded("cavity", emitter_sampling=text)
        assert open_settings(scene, target, criterion) == ["opening_sampling"]


@pytest.mark.parametrize(("opening", "avoided"), [(8, True), (80, False)])
def test_small_openings_are_avoided(opening, avoided):
    """A path leaves the small one at one reflection in 32, the large one at one in 4."""
    scene = loaded("cavity", opening=opening)
    windows = Windows.whole(scene.sensor(0))
    arguments = Sampling(seed=1), Measurands.of("target"), IntensityInterval(1e-3)
    best = cheapest(scene, ["emitter_sampling", "opening_sampling"], windows, *arguments)
    assert best == {"emitter_sampling": False, "opening_sampling": avoided}


def test_a_source_that_no_path_has_met_counts(tmp_path):
    """Without drawn directions no path of the pilot hits the lamp, and the scatter is small. The
    bound for what no path has met decides.
    """
    (tmp_path / "lamp.xml").write_text(
        """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="1"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <scale x="0.5" y="0.5"/> <lookat origin="0, 0, 0.5" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm"> <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
            <integer name="width" value="8"/> <integer name="height" value="8"/> </film>
    </sensor>
    <shape type="rectangle">
        <bsdf type="diffuse"> <spectrum name="reflectance" value="0.5"/> </bsdf>
        <emitter type="thermal"> <string name="band" value="MWIR"/>
            <float name="temperature" value="300"/> </emitter>
    </shape>
    <shape type="sphere">
        <point name="center" value="0, 0, 1"/> <float name="radius" value="0.001"/>
        <bsdf type="diffuse"> <spectrum name="reflectance" value="0"/> </bsdf>
        <emitter type="thermal"> <string name="band" value="MWIR"/>
            <float name="temperature" value="3000"/> </emitter>
    </shape>
</scene>"""
    )
    scene = mi_lcair.load(tmp_path / "lamp.xml")
    windows = Windows.whole(scene.sensor(0))
    arguments = Sampling(seed=1), Measurands.of("target"), IntensityInterval(0.01)
    settings = ["emitter_sampling", "opening_sampling"]
    best = cheapest(scene, settings, windows, *arguments)
    assert best == {"emitter_sampling": True, "opening_sampling": False}


@pytest.mark.parametrize(
    "needed, every",
    [
        ({None: 900, 1: 599, 8: 850}, 1),  # a path and a ray cost 1.5, or 1.0625
        ({None: 900, 1: 599, 8: 845}, 8),
        ({None: 900, 1: 601, 8: 848}, None),
    ],
)
def test_rays_to_facets_that_cost_least(monkeypatch, needed, every):
    """Numbers of paths that pilots find to be needed without rays to facets, and with them."""
    starts = FacetStarts(None, *(np.ones(1) for _ in range(3)))

    def pilot(scene, windows, sampling, measurands, criterion, aim):
        return needed[aim.direct and aim.direct.every], None

    monkeypatch.setattr(pilots, "pilot", pilot)
    monkeypatch.setattr(pilots, "model_shapes", lambda scene: ["model"])
    monkeypatch.setattr(pilots, "aim_over_model", lambda *arguments: Aim.anywhere())
    monkeypatch.setattr(pilots, "starts_on_facets", lambda *arguments: starts)
    monkeypatch.setattr(pilots, "pilot_paths", lambda sensor: 1000)
    tracer = SimpleNamespace(closure="none", emitters=SimpleNamespace(brightest=1.0))
    windows = SimpleNamespace(sensor=None, may_follow_facets=True)
    aim = pilots.best_aim(None, tracer, windows, None, Measurands.of("target"), None)
    assert (aim.direct and aim.direct.every) == every
