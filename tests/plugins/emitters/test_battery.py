"""What every emitter promises, tried on each: render, channels, spectrum, parameters, derivatives,
audit, effective areas, bound of the radiance, save and load.

A new emitter joins with an entry in EXAMPLES.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.emission.draw_table import can_be_hit, radiance_bound
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.rendering.parameters.values import set_values
from tests.plugins.small_scenes import GREY, camera

EXAMPLES = {  # what a scene says, for every plugin of the kind; group is "tried"
    "a temperature": {"type": "thermal", "temperature": 400.0},
    "a temperature and an emissivity": {"type": "thermal", "temperature": 400.0, "emissivity": 0.6},
    "a radiance": {"type": "thermal", "radiance": 5.0},
    "a spectrum": {"type": "thermal", "spectrum": "midlat_summer_clear", "elevation_deg": 30.0},
    "sun": {"type": "sun", "azimuth_deg": 0.0, "elevation_deg": 45.0, "air": "midlat_summer"},
    "sky": {"type": "sky", "ground_temperature": 290.0, "ground_emissivity": 0.9},
    "sky by day": {"type": "sky", "sun_elevation_deg": 40.0, "atmosphere": "midlat_summer"},
    "sky of one temperature": {"type": "sky", "sky": "250", "ground_temperature": 290.0},
    "overcast": {"type": "sky", "sky": "overcast", "ground_temperature": 290.0, "height_m": 900.0},
    "ground": {"type": "sky", "sky": "none", "ground_temperature": 290.0, "ground_group": "tried"},
}
SPP = 1024
PLACE = mi.ScalarTransform4f().translate([1.7, 0, 0.7]).rotate([0, 1, 0], -45).scale(0.7)


@pytest.fixture(params=EXAMPLES)
def scene(request):
    """A grey plate at 300 K, seen from above, and the emitter: on a panel that leans over the plate
    or at infinity.
    """
    tried = {**EXAMPLES[request.param], "band": "MWIR", "group": "tried"}
    floor = {"type": "thermal", "band": "MWIR", "temperature": 300.0, "group": "floor"}
    if issubclass(PLUGINS[tried["type"]].type, DistantEmitter):
        parts = {"tried": tried}
    else:
        parts = {"panel": {"type": "rectangle", "to_world": PLACE, "bsdf": GREY, "tried": tried}}
    return mi_lcair.load(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "bounce_path", "max_bounces": 2},
                "sensor": camera(size=8, height=4.0, target=(0.5, 0, 0), origin=(0.5, 0, 20)),
                "floor": {"type": "rectangle", "bsdf": GREY, "emitter": floor},
                **parts,
            },
            optimize=False,
        )
    )


def emitter_of(scene):
    return next(emitter for emitter in scene.mi.emitters() if emitter.group == "tried")


def name_of(parameter):
    return f"{parameter.group or 'tried'}.{parameter.name}"


def test_every_plugin_has_an_example():
    names = {name for name, plugin in PLUGINS.items() if plugin.kind == "emitter"}
    assert {example["type"] for example in EXAMPLES.values()} == names


def test_render_and_channels(scene):
    """The groups add up to the radiance, with and without emitter sampling."""
    means = []
    for sampling in (False, True):
        scene.mi.integrator().emitter_sampling = sampling
        image = mi_lcair.render(scene, spp=SPP, parts=True)
        of_groups = sum(
            image.channels[f"group.{label}.Y"]
            for label in ("tried", "floor", "ground", "other")
            if f"group.{label}.Y" in image.channels
        )
        np.testing.assert_allclose(of_groups, image.channels["Y"], rtol=1e-4, atol=1e-7)
        part = image.channels["group.tried.Y"].mean()
        assert part > 0
        means.append((image.mean, image.mean_error))
    (a, error_a), (b, error_b) = means
    assert abs(a - b) < 5 * np.hypot(error_a, error_b) + 2e-3 * a


def test_spectrum(scene):
    """Its sources have the in-band radiance that their spectra have, and that it emits."""
    emitter = emitter_of(scene)
    if not emitter.has_spectrum:
        with pytest.raises(InputError, match="group tried.*spectrum"):
            emitter.spectra()
        return
    sources = emitter.spectra()
    assert [source.group for source in sources] == emitter.groups
    for source, radiance in zip(sources, emitter.facet_radiance()):
        assert source.in_band == pytest.approx(radiance, rel=1e-5)
        if source.spectrum is not None:
            assert source.spectrum.in_band_radiance(scene.band) == pytest.approx(source.in_band)


def test_parameters(scene):
    """Each is named with the declared unit and bounds; a radiance is linear in what scales it."""
    emitter, described = emitter_of(scene), mi_lcair.parameters(scene)
    before = mi_lcair.render(scene, spp=64, parts=True).channels["group.tried.Y"].mean()
    assert emitter.parameters()
    for own in emitter.parameters():
        name = name_of(own)
        entry = described[name]
        assert (entry.kind, entry.unit, entry.lower, entry.upper) == (
            own.kind,
            own.unit,
            0,
            own.upper,
        )
        if own.kind != "temperature" and name != "ground.emissivity":
            set_values(scene, {name: 0.5 * entry.value})
            after = mi_lcair.render(scene, spp=64, parts=True).channels["group.tried.Y"].mean()
            assert after == pytest.approx(0.5 * before, rel=1e-4)
            set_values(scene, {name: entry.value})


@pytest.mark.slow
def test_derivatives(scene):
    """Each derivative is the difference of two renders of the same paths."""
    for own in emitter_of(scene).parameters():
        name, value = name_of(own), mi_lcair.parameters(scene)[name_of(own)].value
        result = mi_lcair.sensitivities(scene, [name], part="scene", paths=2**15)
        ends, values = (0.99 * value, min(1.01 * value, own.upper)), []
        for end in ends:
            set_values(scene, {name: end})
            values.append(mi_lcair.sensitivities(scene, [name], part="scene", paths=2**15).value)
        set_values(scene, {name: value})
        difference = np.ravel(values[1] - values[0])[0] / (ends[1] - ends[0])
        assert np.ravel(result.derivative)[0] == pytest.approx(difference, rel=5e-3)


def test_bound_of_radiance(scene):
    """No direction has a larger radiance, and the bound is not far above the largest."""
    emitter = emitter_of(scene)
    if not can_be_hit(emitter):
        return
    (bound,) = radiance_bound(emitter)
    si = dr.zeros(mi.SurfaceInteraction3f, 2**16)
    u = mi.Point2f(np.random.default_rng(0).random((2, 2**16)))
    with scene.prepared():
        if emitter.get_shape() is None:
            si.wi = -mi.warp.square_to_uniform_sphere(u)
        else:
            si.wi, si.shape = (
                mi.warp.square_to_uniform_hemisphere(u),
                mi.ShapePtr(emitter.get_shape()),
            )
        for around in (0.99, 0.9999, 1):  # cosines of cones, because an aureole is small
            radiance = emitter.eval(si)[0].numpy()
            largest, brightest = radiance.max(), si.wi.numpy()[:, radiance.argmax()]
            cone = mi.warp.square_to_uniform_cone(u, around)
            si.wi = mi.Frame3f(mi.Vector3f(brightest.tolist())).to_world(cone)
    assert 0.6 * bound < largest <= bound * (1 + 1e-6)


@pytest.mark.slow
def test_audit(scene):
    """What is emitted is absorbed or escapes; or the emitter is named as one without photons."""
    try:
        audit = mi_lcair.audit(scene, paths=2**14)
    except InputError as error:
        assert "can be followed" in str(error)
        return
    balance, error = audit.total["balance"]
    assert abs(balance) < 5 * error + 1e-6 * audit.total["emitted"][0]


@pytest.mark.slow
def test_effective_areas(scene):
    """The areas times the radiances of the sources give the intensity."""
    if not emitter_of(scene).has_spectrum:
        return
    result = mi_lcair.signature(scene, spp=2**15, by_spectrum=True)
    areas = result.effective_areas
    in_band = np.array([source.in_band for source in areas.sources])
    assert areas.area[1] @ in_band == pytest.approx(result.scene.intensity, rel=1e-4)


def test_save_and_load(scene, tmp_path):
    """An image keeps the emitter's channel, and two loads of the same scene agree."""
    image = mi_lcair.render(scene, spp=64, parts=True)
    image.save(tmp_path / "image.exr")
    channels, header = read_exr(tmp_path / "image.exr")
    np.testing.assert_array_equal(channels["group.tried.Y"], image.channels["group.tried.Y"])
    assert is_thermal(emitter_of(scene)) and "tried" in scene.groups
