"""The loop of `measure`, on windows whose means and errors are known without tracing."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.plugins.paths.launch import Aim, FacetStarts
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering import measure as aiming
from mi_lcair.rendering import measure as module
from mi_lcair.rendering import measure as pilots
from mi_lcair.rendering.measurands import ExcessFunction, IntensityInterval, Measurands
from mi_lcair.rendering.measure import cheapest, cost, measure, needed_paths, open_settings
from mi_lcair.rendering.pixels import PixelError
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import View
from mi_lcair.rendering.window import PASS_SAMPLES, Windows
from tests.plugins.small_scenes import camera
from tests.rendering.made_totals import sums_of, totals
from tests.signatures.rendered_views import render_views

ANY_SENSOR = SimpleNamespace(class_name=lambda: "PerspectiveCamera")


class Tracer:
    """Window w has the mean 1 + w and an error of noise[w] / points, as a lattice has at best."""

    max_bounces, systematic_error, closure, bins = 1, 0.0, "none", ""
    emitters = SimpleNamespace(unbounded=(), labels=())

    def __init__(self, noise=(0.0,), invalid=0.0):
        self.noise, self.invalid, self.launches = np.array(noise), invalid, []

    def unmet_sources(self, sensor, aim=None):
        return None

    def most_rows(self, channels):
        return PASS_SAMPLES

    def trace(self, sensor, launch, channels, facets, rays):
        self.launches.append(launch)
        run, end = launch.window_numbers, launch.first_point + launch.points
        # Sums, because the scatter of a sum of lattice points stays the same for any number of them
        before, after = (number * self.means(run, number) for number in (launch.first_point, end))
        sums = sums_of((after - before) / launch.points, launch.points)
        sums.valid *= 1 - self.invalid
        return sums

    def means(self, run, points):
        scatter = np.linspace(-1, 1, 8) * self.noise[run][:, None] / max(points, 1)
        return 1 + run[:, None] + scatter

    @property
    def traced(self):
        """Points of each randomisation of each window."""
        points = np.zeros(len(self.noise), dtype=int)
        for launch in self.launches:
            points[launch.window_numbers] += launch.points
        return points.tolist()


def run(tracer, sampling, criterion=None, windows=None, aim=None):
    prepared = lambda *kinds: nullcontext(tracer)
    integrator = SimpleNamespace(
        emitter_sampling=False,
        opening_sampling=False,
        max_bounces=1,
        truncation=0.0,
        closure="none",
    )
    objects = SimpleNamespace(integrator=lambda: integrator)
    scene = SimpleNamespace(name="box", prepared=prepared, mi=objects)
    windows = windows or Windows(ANY_SENSOR, columns=len(tracer.noise), pixels=64)
    return measure(scene, windows, sampling, Measurands.of(None), criterion, aim)


def half_width(total):
    """Ratio of the half width of each window's interval to its mean, in per cent."""
    return 100 * total.half_width() / total.mean()


def test_a_fixed_number_of_paths():
    """100 paths in 8 randomisations are 13 points each."""
    tracer, work = Tracer(), []
    total = run(tracer, Sampling(paths=100, progress=lambda *done: work.append(done)))
    assert tracer.traced == [13] and total.traced == [104] and total.mean() == [1]
    assert total.reached is None and work == [(104, 104)]


@pytest.mark.parametrize("by_randomisation, kept", [(True, 24), (False, 3)])
def test_memory_and_progress(monkeypatch, by_randomisation, kept):
    """Numbers are kept by window and randomisation, and work is counted in paths of all parts."""
    asked, work = [], []
    monkeypatch.setattr(module, "check_memory", lambda count, *_: asked.append(count))
    windows = Windows(ANY_SENSOR, 3, parts=2, by_randomisation=by_randomisation)
    sampling = Sampling(spp=64, progress=lambda *done: work.append(done))
    run(Tracer([0.0] * 3), sampling, windows=windows)
    assert asked == [kept] and work == [(64, 64)]  # 4 points, 8 randomisations, 2 parts


def test_passes_of_many_paths():
    """A pass has at most 2^20 paths; each goes on where the last one ended."""
    tracer = Tracer()
    run(tracer, Sampling(paths=3 * PASS_SAMPLES))
    points = PASS_SAMPLES // 8
    assert [launch.first_point for launch in tracer.launches] == [0, points, 2 * points]
    assert [launch.points for launch in tracer.launches] == 3 * [points]


def test_paths_are_doubled_until_the_criterion_is_met():
    """512 points at first; half of the interval is .58 / points of the mean times the noise."""
    per_point = 2.364624 * np.linspace(-1, 1, 8).std(ddof=1) / np.sqrt(8)
    for noise in (1.0, 6.0, 30.0, 200.0):
        tracer = Tracer([noise])
        total = run(tracer, Sampling(tolerance=0.001), IntensityInterval(0.001, channel=None))
        needed = 512
        while per_point * noise / needed > 0.001:
            needed *= 2
        assert tracer.traced == [needed] and total.reached
        assert total.excess[0] == pytest.approx(per_point * noise / needed / 0.001)


def test_only_the_windows_that_need_more():
    tracer = Tracer([1.0, 1000.0, 1.0])
    relative = ExcessFunction(lambda total: half_width(total))
    total = run(tracer, Sampling(tolerance=0.01), relative)
    first, most, last = tracer.traced
    assert first == last < most and total.reached
    assert total.excess.shape == (3,) and np.all(total.excess <= 1)


def test_a_small_error_by_luck_is_not_believed():
    """The error of a lattice falls at most as 1 / points: a thousandth of it is an accident."""
    excess = iter([4.0, 1e-3, 1e-3, 1e-3])
    tracer = Tracer()
    total = run(tracer, Sampling(tolerance=0.1), ExcessFunction(lambda total: next(excess)))
    # 4 at 512 points, so that 2048 would be needed at least; two doublings at once
    assert tracer.traced == [2048] and total.reached


def test_it_ends_at_the_largest_number_of_samples():
    tracer = Tracer([1e6])
    criterion = IntensityInterval(0.001, channel=None)
    windows = Windows(ANY_SENSOR)
    total = run(tracer, Sampling(tolerance=0.001, max_spp=1000), criterion, windows)
    assert tracer.traced == [125] and not total.reached and total.excess[0] > 1


def test_pixels_end_together():
    """The error of an image is one number, and all of its pixels get the same samples."""
    sensor = SimpleNamespace(
        class_name=lambda: "PerspectiveCamera",
        film=lambda: SimpleNamespace(crop_size=lambda: (3, 1)),
    )
    tracer = Tracer([0.0, 30.0, 0.0])
    total = run(tracer, Sampling(tolerance=0.01), PixelError(0.01), Windows.of_image(sensor, 8))
    assert len(set(tracer.traced)) == 1 and total.reached
    assert total.rms_error() <= 0.01


def test_a_criterion_chooses_the_number_of_paths():
    with pytest.raises(InputError, match="spp sets a fixed number of samples"):
        run(Tracer(), Sampling(spp=4), PixelError(0.1))


def test_invalid_samples_end_it():
    with pytest.raises(InputError, match="box: .* samples are NaN or infinite"):
        run(Tracer(invalid=2e-3), Sampling(paths=8000))
    assert run(Tracer(invalid=5e-4), Sampling(paths=8000)).invalid == 4


@pytest.mark.parametrize("noise, aimed", [(20.0, True), (1.0, False)])
def test_a_noisy_window_is_begun_again_and_aimed(monkeypatch, noise, aimed):
    """Where the first error is more than 8 times as large as allowed; the first paths are left."""
    aim, seeds = Aim.anywhere(), []
    monkeypatch.setattr(
        "mi_lcair.rendering.measure.best_aim",
        lambda scene, tracer, windows, sampling, *_: (seeds.append(sampling.seed), aim)[1],
    )
    windows, tracer = Windows(mi.load_dict(camera()), pixels=64), Tracer([noise])
    sampling = Sampling(tolerance=0.001, seed=5)
    total = run(tracer, sampling, IntensityInterval(0.001, channel=None), windows)
    assert total.reached and seeds == ([5] if aimed else [])
    starts = [launch.first_point for launch in tracer.launches]
    assert starts.count(0) == (2 if aimed else 1)
    assert total.traced[0] == 8 * (tracer.traced[0] - (512 if aimed else 0))


def test_a_given_aim_is_kept():
    windows, tracer, aim = (
        Windows(mi.load_dict(camera()), pixels=64),
        Tracer([100.0]),
        Aim.anywhere(),
    )
    total = run(
        tracer, Sampling(tolerance=0.001), IntensityInterval(0.001, channel=None), windows, aim
    )
    assert total.aim is aim and all(launch.aim is aim for launch in tracer.launches)


def test_views_are_aimed_one_by_one():
    """A bright spot in one view and none in the other: each view has a density of its own."""
    importance, model = np.zeros((2, 64, 64)), np.zeros((2, 64, 64), bool)
    model[0, 10:20, 30:40] = model[1, 40:60, 5:50] = True
    importance[0, 12, 33] = importance[1, 41, 6] = 1
    sample = mi.Point2f(np.random.default_rng(1).random((2, 200_000)))
    for window, anywhere in ((0, 0.1), (1, 0.1), (0, 0.0), (1, 0.0)):
        aim = Aim.at(importance, model, 0.3, anywhere)
        position, weight = aim.tables.place(sample, mi.UInt32(window))
        x, y, weight = (np.array(values) for values in (position.x, position.y, weight))
        inside = model[window, (y * 64).astype(int), (x * 64).astype(int)]
        assert np.mean(weight) == pytest.approx(1 if anywhere else model[window].mean(), rel=0.02)
        assert np.sum(weight * inside) / len(x) == pytest.approx(model[window].mean(), rel=0.02)
        share = 1 - anywhere * (1 - model[window].mean())
        assert np.mean(inside) == pytest.approx(share, abs=0.01 if anywhere else 0)
        assert weight[inside].max() == pytest.approx(aim.largest_on_model[window], rel=5e-3)
        assert weight.max() == pytest.approx(aim.largest_weight[window], rel=5e-3)


def test_a_pilot_in_parts_gives_the_same_aim(monkeypatch):
    scene = mi_lcair.load("two_plates", resolution=1)
    arguments = scene.sensor(0), 3, Measurands.of("target")
    with scene.prepared() as tracer:
        whole = aiming.aim_at_model(scene, tracer, *arguments)
        monkeypatch.setattr(aiming, "MOST_PATHS", 50_000)
        parts = aiming.aim_at_model(scene, tracer, *arguments)
    np.testing.assert_array_equal(whole.tables.rows.numpy(), parts.tables.rows.numpy())
    np.testing.assert_array_equal(whole.tables.columns.numpy(), parts.tables.columns.numpy())


def test_aimed_views_are_those_of_a_signature():
    """Two views with a tolerance that aims their paths: the intensities of signatures."""
    scene = mi_lcair.load("a340_landing", max_bounces=1)
    views = [View(150.0, -5.0), View(180.0, 10.0)]
    many = render_views(scene, views, 64, Sampling(tolerance=0.1))
    anywhere = render_views(scene, views, 64, Sampling(spp=32))
    for k in range(2):
        assert many.paths[k] < 32 * 64**2
        half_width = np.hypot(many.half_width[k], anywhere.half_width[k])
        assert abs(many.parts["target"][0][k] - anywhere.parts["target"][0][k]) < half_width
        assert many.parts["hit"][0][k] == pytest.approx(anywhere.parts["hit"][0][k], rel=0.05)


def test_points_of_the_next_estimate():
    """Many windows go on by quarters of a doubling, one by doublings."""
    one, many = Windows(None), Windows(None, columns=216)
    assert [one.next_points(64, excess) for excess in (1.1, 1.9, 2.5, 100.0)] == [
        128,
        128,
        128,
        512,
    ]
    assert [many.next_points(64, excess) for excess in (1.1, 1.3, 1.9, 2.5)] == [80, 96, 128, 128]
    assert [many.next_points(96, excess) for excess in (1.01, 1.3)] == [112, 128]
    assert [many.points_of_pass(active) for active in (216, 16)] == [512, 8192]


# How paths are drawn, where the scene leaves it open
# ---------------------------------------------------


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
