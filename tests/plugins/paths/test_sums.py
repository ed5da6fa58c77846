"""closure = tail: how far it is off, against the error that it states."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.leaks import cube
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.sums import COUNTS, Tail, add_tail, continued, extrapolation_error
from mi_lcair.rendering.scene import changed, load

T = mi.ScalarTransform4f


def cylinder(depth, emissivity, reflections=200, rings=300):
    """Radiance of the bottom of an isothermal cylindrical cavity by number of reflections, in units
    of the blackbody's: radiosity on rings of its wall. depth: in radii.

    View factors between rings follow from that between two equal coaxial discs at a distance h, in
    radii: 1 + h^2 / 2 - h sqrt(1 + h^2 / 4).
    """
    disc = lambda h: 1 + h * h / 2 - np.abs(h) * np.sqrt(1 + h * h / 4)
    edge = np.linspace(0, depth, rings + 1)
    low, high = edge[:-1], edge[1:]
    area = 2 * np.pi * (high - low)
    seen = np.zeros((rings + 1, rings + 1))  # view factors; 0 is the bottom
    seen[0, 1:] = disc(low) - disc(high)
    seen[1:, 0] = np.pi * seen[0, 1:] / area
    a, b, c, d = low[:, None], high[:, None], low, high
    exchange = np.pi * np.abs(disc(b - d) - disc(a - d) - disc(b - c) + disc(a - c))
    np.fill_diagonal(exchange, area - 2 * np.pi * (1 - disc(high - low)))
    seen[1:, 1:] = exchange / area[:, None]
    radiance, counts = np.full(rings + 1, emissivity), []
    for _ in range(reflections + 1):
        counts.append(radiance[0])
        radiance = (1 - emissivity) * seen @ radiance
    return np.array(counts)


def test_extrapolation_error_of_cavities():
    """Exact counts of cavities 1 to 16 radii deep: further off than stated in no more than 5 % of
    the cases, never by half, and not stated far too large.
    """
    shares = []
    for depth in (1, 2, 4, 8, 16):
        for emissivity in (0.2, 0.5, 0.8):
            counts = cylinder(depth, emissivity)
            for last in range(2, 9):
                value = counts[: last + 1].sum() + continued(*counts[last - 1 : last + 1])
                stated = extrapolation_error(counts[max(0, last + 1 - COUNTS) : last + 1])
                shares.append(abs(value - counts.sum()) / stated)
    assert np.mean(np.array(shares) > 1) <= 0.05 and max(shares) < 1.5
    assert np.median(shares) > 0.05


@pytest.fixture
def deep_cavity(tmp_path):
    """A cylinder eight radii deep of emissivity 0.5 at 800 K, open at the top, whose bottom fills
    the window.
    """
    grey = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf>'
    hot = """<emitter type="thermal">
        <string name="band" value="LWIR"/><float name="temperature" value="800"/></emitter>"""
    path = tmp_path / "cavity.xml"
    path.write_text(f"""<scene version="3.0.0">
        <integrator type="bounce_path"/>
        <sensor type="orthographic">
            <transform name="to_world">
                <scale value="0.7"/> <lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/>
            </transform>
            <film type="hdrfilm">
                <integer name="width" value="16"/><integer name="height" value="16"/>
                <string name="pixel_format" value="luminance"/><rfilter type="box"/></film>
        </sensor>
        <shape type="cylinder">
            <point name="p0" x="0" y="0" z="0"/> <point name="p1" x="0" y="0" z="8"/>
            <boolean name="flip_normals" value="true"/> {grey} {hot} </shape>
        <shape type="disk"> {grey} {hot} </shape>
    </scene>""")
    return load(path)


@pytest.mark.slow
def test_deep_cavity(deep_cavity):
    """The whole way, from paths: off by 0.00024, of which the ratio of the two counts before said
    0.00004.
    """
    scene, unit = deep_cavity, float(in_band_radiance(deep_cavity.band, 800.0))
    with changed(scene, closure="tail", max_bounces=4):
        image = mi_lcair.render(scene, spp=2**14, seed=1)
    with changed(scene, max_bounces=24):  # the same paths, followed further
        whole = mi_lcair.render(scene, spp=2**14, seed=1)
    exact = cylinder(8, 0.5).sum()
    noise = whole.rms_error / 16
    assert whole.mean / unit == pytest.approx(exact, abs=4 * noise + 2e-4)
    off = abs(image.mean - whole.mean) / unit
    assert off < image.closure_error / unit
    assert 2e-4 < image.closure_error / unit < 3e-3


@pytest.mark.slow
def test_wing_root():
    """Bare aluminium between cylinder and wing, which an observer sees by several reflections."""
    scene = mi_lcair.load("cylinder_ir_range", finish="bare_aluminum", band="LWIR", resolution=32)
    with changed(scene, max_bounces=24):
        whole = mi_lcair.render(scene, spp=256, seed=1)
    for bounces in (2, 3):
        with changed(scene, closure="tail", max_bounces=bounces):
            image = mi_lcair.render(scene, spp=256, seed=1)
        assert abs(image.mean - whole.mean) < image.closure_error < 0.02 * whole.mean


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [3, 6, 10])
def test_furnace(bounces):
    scene = mi_lcair.load("furnace", resolution=16)
    limit = float(in_band_radiance(scene.band, 300.0))
    with changed(scene, closure="tail", max_bounces=bounces):
        image = mi_lcair.render(scene, spp=1024, seed=1)
    noise = image.rms_error * image.mean / 16
    assert abs(image.mean - limit) < image.closure_error + 3 * noise
    assert image.closure_error < 0.05 * limit


def test_noise_of_the_ratio_is_part_of_the_error():
    """Two counts of known scatter: the tail's own scatter over many passes is what it states."""
    random = np.random.default_rng(0)
    means, stated, paths = [], [], 1000
    for _ in range(200):
        last = [mi.Float(random.exponential(0.5**k, paths)) for k in range(COUNTS)]
        # what each path's tail would be at the true ratio, 1, is the scatter of the image itself
        tail, found = add_tail(last, mi.Float(np.ones(paths)))
        means.append(tail.numpy().mean() - last[-1].numpy().mean())
        stated.append(found.variance / paths**2)
    assert np.std(means) == pytest.approx(np.sqrt(np.mean(stated)), rel=0.15)


def test_the_error_of_an_extrapolation_by_hand():
    """Continuations of 10, 4, 1, 0.4 are 8/3, 1/3 and 4/15, so that the estimate changes by -4/3,
    which counts 0.4 times one count later, and by 1/3. What is to come is 2/3 of the larger one.
    """
    assert extrapolation_error([10, 4, 1, 0.4]) == pytest.approx(0.4 * 4 / 3 * 2 / 3, rel=1e-5)
    assert extrapolation_error([4, 1, 0.4]) == pytest.approx(1 / 3 * 2 / 3, rel=1e-5)
    # An earlier change counts at most as 10 times the last one
    assert extrapolation_error([4000, 3990, 1, 0.4]) == pytest.approx(
        10 * abs(0.4 + 4 / 15 - 1 / 3990 / (1 - 1 / 3990)) * 2 / 3, rel=1e-5
    )
    counts = np.array([[99, 90, 4, 1, 0.4], [0, 0, 0, 0, 0]])
    error = Tail(counts, variance=9.0, paths=10).error(2)  # after two reflections: three counts
    assert error == pytest.approx((2 / 9 + 3) / 10, rel=1e-5)


def test_tails_of_model_and_background():
    """Each has its own ratio, and paths that are not finite count nothing.

    The variance is that of c r / (1 - r) by the law of propagation, for r = c / b of the sums.
    """
    before, last = np.array([4.0, 6, 8, np.nan, 2]), np.array([1.0, 3, 2, np.inf, 0])
    paths = [mi.Float(np.zeros(5))] * (COUNTS - 2) + [mi.Float(before), mi.Float(last)]
    tail, found = add_tail(paths, mi.Float([1, 1, 0, 0, 1]))
    np.testing.assert_allclose(found.counts[:, -2:], [[12, 4], [8, 2]])
    r = np.array([1 / 3, 1 / 4])
    model = np.array([1, 3, 0]) * 0.5
    np.testing.assert_allclose(tail.numpy(), [model[0], model[1], 2 / 3, 0, 0], rtol=1e-6)
    scatter = np.array([np.sum((np.array([1, 3, 0]) - r[0] * np.array([4, 6, 2])) ** 2), 0.0])
    slope = r / (1 - r) ** 2  # of the tail's sum in the last count, at a constant tail of each path
    assert found.variance == pytest.approx(np.sum(scatter * slope**2)) and found.paths == 5
    dark, none = add_tail([mi.Float(np.zeros(5))] * COUNTS, mi.Float(np.ones(5)))
    assert not dark.numpy().any() and none.variance == 0


def test_counts_that_do_not_fall():
    """No tail can be told: none is added, and the error says what there might be."""
    counts = np.array([[1.0, 1, 1, 1, 1], [0, 0, 0, 0, 0]])
    assert continued(1.0, 1.0) == 0.0
    assert Tail(counts=counts, variance=0.0, paths=1).error(4) == pytest.approx(1000)


def test_a_room_of_high_reflectance(tmp_path):
    """Every path is alike, so that nothing scatters: what is off is Float32's rounding, which the
    tail multiplies by 1 / (1 - 0.99); it is stated.
    """
    scene = cube(tmp_path, reflectance=0.99, max_bounces=4, closure="tail")
    result = mi_lcair.render(scene, spp=64)
    off = abs(result.mean / float(in_band_radiance(scene.band, 300)) - 1)
    assert off < 1e-4
    assert off * result.mean < 2 * result.closure_error < 1e-3 * result.mean
