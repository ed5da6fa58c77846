"""Derivatives recorded along paths, against closed forms and against differences."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import chi2

import mi_lcair
from docs.studies.differences import differences, image_differences
from mi_lcair.api.estimates import sensitivities
from mi_lcair.api.images import derivative_images
from mi_lcair.derivatives.window import recordings
from mi_lcair.errors import InputError
from mi_lcair.physics import reflection
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.parameters.values import changed

mi.set_variant("llvm_ad_mono")

EMITTER = """<emitter type="thermal"> <string name="band" value="LWIR"/>
    <float name="temperature" value="{T}"/> <string name="group" value="{group}"/>
    <string name="facet_type" value="{kind}"/> {more} </emitter>"""
# Broad lobes: with narrow ones the differences are too noisy to be a check
LAYER = """<bsdf type="sandford_robertson" id="{id}"> <float name="epsilon" value="0.3"/>
    <float name="rho_d" value="0.2"/> <float name="b" value="0.3"/> <float name="e" value="0.3"/>
    <string name="lobe" value="{lobe}"/> <string name="emissivity" value="{emissivity}"/> </bsdf>"""
GLASS = """<bsdf type="microfacet" id="rough"> <float name="alpha" value="0.4"/>
    <float name="gamma" value="2"/> <float name="n" value="1.6"/> <float name="k" value="0.5"/>
    <float name="rho_d" value="0.1"/> </bsdf>"""
SCENE = """<scene version="3.0.0">
    <default name="emitter_sampling" value="false"/>
    <integrator type="bounce_path"> <integer name="max_bounces" value="3"/>
        <boolean name="emitter_sampling" value="$emitter_sampling"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale x="2" y="2"/>
        <lookat origin="1, -3, 4" target="0, 0, 0" up="0, 1, 0"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="16"/> <integer name="height" value="16"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
        <sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler>
    </sensor>
    <shape type="rectangle"> <transform name="to_world"> <scale value="1.2"/> </transform>
        {floor} {of_floor} </shape>
    <shape type="rectangle"> <transform name="to_world"> <rotate x="1" angle="90"/>
        <translate y="1.2" z="1"/> </transform>
        <bsdf type="twosided"> <bsdf type="diffuse" id="grey">
        <spectrum name="reflectance" value="0.4"/> </bsdf> </bsdf> {of_wall} </shape>
    <shape type="sphere"> <float name="radius" value="0.3"/>
        <point name="center" x="0" y="0" z="0.6"/>
        <bsdf type="diffuse" id="black"> <spectrum name="reflectance" value="0.1"/> </bsdf>
        {of_ball} </shape>
    <shape type="sphere"> <float name="radius" value="20"/> <boolean name="flip_normals"
        value="true"/> <bsdf type="diffuse" id="sky"> <spectrum name="reflectance" value="0"/>
        </bsdf> {of_sky} </shape>
</scene>"""
FLOORS = {
    "brdf": LAYER.format(id="layer", lobe="brdf", emissivity="kirchhoff"),
    "mirror": LAYER.format(id="layer", lobe="mirror", emissivity="kirchhoff"),
    "diffuse": LAYER.format(id="layer", lobe="diffuse", emissivity="model"),
    "microfacet": GLASS,
}
NAMES = {
    "microfacet": tuple(f"rough.{name}" for name in ("alpha", "gamma", "n", "k", "rho_d")),
    **{name: tuple(f"layer.{p}" for p in ("epsilon", "rho_d", "b", "e")) for name in FLOORS},
} | {"microfacet": tuple(f"rough.{name}" for name in ("alpha", "gamma", "n", "k", "rho_d"))}
OTHERS = (
    "grey.reflectance",
    "black.reflectance",
    "floor.temperature",
    "ball.temperature",
    "wall.emissivity",
    "sky.temperature",
)


MORE = ("brdf", "false"), ("microfacet", "true"), ("diffuse", "true")


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    """A floor of some material, a grey wall of its own emissivity, a hot ball and a cold sky."""
    folder = tmp_path_factory.mktemp("columns")

    def loaded(floor, **parameters):
        path = folder / f"{floor}.xml"
        own = '<float name="emissivity" value="0.7"/>'
        emitter = lambda *values, more="": EMITTER.format(
            **dict(zip(("T", "group", "kind"), values)), more=more
        )
        path.write_text(
            SCENE.format(
                floor=FLOORS[floor],
                of_floor=emitter(300, "floor", "model"),
                of_wall=emitter(330, "wall", "model", more=own),
                of_ball=emitter(450, "ball", "model"),
                of_sky=emitter(250, "sky", "sky"),
            )
        )
        return mi_lcair.load(path, **parameters)

    return loaded


@pytest.mark.slow
@pytest.mark.parametrize(
    "floor, sampling",
    [
        ("brdf", "true"),
        ("microfacet", "false"),
        ("mirror", "false"),
        *(pytest.param(*case, marks=pytest.mark.study) for case in MORE),
    ],
)
def test_all_columns_agree_with_differences(load, floor, sampling):
    """Each derivative by itself, and all of them together by chi-square (one in 10^4 fails)."""
    scene = load(floor, emitter_sampling=sampling)
    names = NAMES[floor] + OTHERS
    steps = [2.0 if "temperature" in name else 0.004 for name in names]
    found = sensitivities(scene, names, paths=2**17, seed=1)
    expected = differences(scene, names, steps, paths=2**16, seed=2)
    # A central difference of a radiance that curves as Planck's law is wrong by 2e-5
    errors = np.hypot(found.error[1:], expected.error[1:]) + 2e-4 * np.abs(expected.derivative)
    scatter = (found.derivative - expected.derivative) / errors
    assert np.abs(scatter).max() < 6, dict(zip(names, scatter))
    # The scatter of 8 randomisations of each method has 14 degrees of freedom or so
    assert np.sum(scatter**2) < 14 / 12 * 1.5 * chi2.ppf(1 - 1e-4, len(names)), scatter
    # They can be told from 0
    assert np.sum(np.abs(found.derivative) > 5 * found.error[1:]) >= len(names) - 2


PLATE = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="1"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale x="0.5" y="0.5"/>
        <lookat origin="3, 0, 3" target="0, 0, 0" up="0, 1, 0"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="8"/> <integer name="height" value="8"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
        <sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler>
    </sensor>
    <shape type="rectangle"> <transform name="to_world"> <scale value="2"/> </transform>
        <bsdf type="sandford_robertson" id="paint"> <float name="epsilon" value="0.4"/>
        <float name="rho_d" value="0.3"/> <float name="b" value="0.4"/>
        <float name="e" value="0.05"/> </bsdf> {plate} </shape>
    <shape type="sphere"> <float name="radius" value="20"/> <boolean name="flip_normals"
        value="true"/> <bsdf type="diffuse"> <spectrum name="reflectance" value="0"/> </bsdf>
        {sky} </shape>
</scene>"""
PAINT = ("paint.epsilon", "paint.rho_d", "paint.b", "paint.e")


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A plate at 320 K that fills the window, seen at 45 degrees, under a sky of 260 K."""
    path = tmp_path_factory.mktemp("plate") / "plate.xml"
    emitter = lambda T, group, kind: EMITTER.format(T=T, group=group, kind=kind, more="")
    text = PLATE.format(plate=emitter(320, "plate", "model"), sky=emitter(260, "sky", "sky"))
    path.write_text(text)
    return mi_lcair.load(path)


def test_a_plate_in_closed_form(plate):
    """I = (1 - HDR) B(T) + HDR B(sky): the derivatives are those of HDR, here by Float64 steps."""
    model, values = reflection.model("sandford_robertson"), np.array([0.4, 0.3, 0.4, 0.05])
    Float64 = dr.llvm.ad.Float64

    def HDR(values):
        S = model.surface(*map(Float64, values), form="thesis")
        return float(model.HDR(S, Float64(np.pi / 4))[0])

    B = lambda T: float(in_band_radiance(plate.band, T))
    # The plate is larger than the window of 1 m^2, and only its middle is seen
    slopes = [(HDR(values + step) - HDR(values - step)) / 2e-5 for step in 1e-5 * np.eye(4)]
    expected = np.array(slopes) * (B(260) - B(320))
    found = sensitivities(plate, PAINT, paths=2**15)
    value = B(320) + HDR(values) * (B(260) - B(320))
    assert abs(found.value - value) < 5 * found.error[0] + 2e-5 * value
    np.testing.assert_allclose(found.derivative, expected, rtol=2e-3, atol=2e-3)
    assert set(found.method) <= {"control variate", "mirror"}
    # Incoming radiance and scores cancel: without the control variate the noise is not small
    assert abs(found.deviations[1:]).max() < 3e-3


def test_temperatures_and_weights(plate):
    """Linear columns are exact; weights multiply the sources' intensities and their columns."""
    names = ("plate.temperature", "sky.temperature", "paint.rho_d")
    whole = sensitivities(plate, names, paths=2**14)
    sources = {("plate", "320 K"): 1.0, ("sky", "260 K"): 0.0}
    own = sensitivities(plate, names, paths=2**14, weights=sources)
    other = {("plate", "320 K"): 0.0, ("sky", "260 K"): 2.0}
    others = sensitivities(plate, names, paths=2**14, weights=other)
    assert own.value + others.value / 2 == pytest.approx(whole.value, rel=1e-6)
    for k, name in enumerate(names):
        both = own.derivative[k] + others.derivative[k] / 2
        assert both == pytest.approx(whole.derivative[k], rel=1e-3, abs=1e-3), name
    slope = lambda T: float(
        (in_band_radiance(plate.band, T + 0.01) - in_band_radiance(plate.band, T - 0.01)) / 0.02
    )
    ratio = own.derivative[0] / own.value
    assert ratio == pytest.approx(slope(320) / in_band_radiance(plate.band, 320), rel=1e-5)
    assert own.derivative[1] == 0 and others.derivative[0] == 0
    assert whole.method[:2] == ("linear", "linear")
    with pytest.raises(InputError, match="source '260 K' of group sky has no weight"):
        sensitivities(plate, names, paths=2**14, weights={("plate", "320 K"): 1.0})


def test_images_agree_with_the_window_and_with_differences(load):
    scene, names = load("brdf"), (*NAMES["brdf"], "grey.reflectance", "ball.temperature")
    found = derivative_images(scene, names, spp=256, seed=3)
    expected = image_differences(scene, names, [0.01] * 5 + [1.0], spp=64, seed=4)
    assert found.derivatives.shape == (4, 6, 16, 16) and found.radiance.shape == (4, 16, 16)
    for k, name in enumerate(names):
        errors = [
            images.derivatives[:, k].mean(axis=(1, 2)).std(ddof=1) / 2
            for images in (found, expected)
        ]
        difference = found.derivative[k].mean() - expected.derivative[k].mean()
        # Three degrees of freedom each: 10 standard errors are one in 10^4
        assert abs(difference) < 10 * np.hypot(*errors) + 1e-3 * abs(found.derivative[k].mean()), (
            name
        )
    whole = sensitivities(scene, names, paths=2**18, part="scene", seed=5)
    for k, name in enumerate(names):
        of_image = 16 * found.derivatives[:, k].mean(axis=(1, 2))
        error = np.hypot(of_image.std(ddof=1) / 2, whole.error[1 + k])
        assert abs(of_image.mean() - whole.derivative[k]) < 8 * error, name


def test_the_control_variate_has_the_mean_0(load):
    """Also where directions below the surface are drawn, which end a path (6 standard errors)."""
    scene = load("brdf", emitter_sampling="true")
    names = (*NAMES["brdf"], "grey.reflectance", "black.reflectance")
    launch = Launch(32, 32, 1, 4, 256, windows=1024)
    with scene.prepared() as tracer:
        (recording,) = recordings(scene, tracer, scene.sensors[0], names, Measurands.of(None))
        found = tracer.trace(
            scene.sensors[0], launch, Channels(None, tables=recording.tables)
        ).channels
    for k, name in enumerate(recording.channels):
        means = found[f"control.{k}"].mean(axis=0)
        # On a diffuse surface it is 0 on every path, up to the rounding of about 100 W m^-2 sr^-1
        assert abs(means.mean()) < 6 * means.std(ddof=1) / 2 + 2e-4, name


def test_a_control_variate_removes_the_noise_of_a_narrow_lobe():
    """In the furnace all radiance is the same: what the scores add cancels path by path."""
    scene = mi_lcair.load("furnace", resolution=8)
    found = sensitivities(scene, ["bare_aluminum.e"], paths=2**16, part="scene")
    assert found.method == ("control variate",)
    plain = differences(scene, ["bare_aluminum.e"], 1e-3, paths=2**16, part="scene")
    scatter = np.linalg.norm(found.deviations[1])
    assert scatter < plain.error[1] / 2.5


@pytest.mark.study
def test_intervals_cover_the_truth(load):
    """Of 40 runs with 8 randomisations each, Student's 95 % intervals cover 90-98 % or so."""
    scene, names = load("brdf"), (*NAMES["brdf"], "ball.temperature")
    truth = sensitivities(scene, names, paths=2**18, seed=1000)
    held = []
    for seed in range(40):
        found = sensitivities(scene, names, paths=2**12, seed=seed)
        error = np.hypot(found.error[1:], truth.error[1:])
        held.append(np.abs(found.derivative - truth.derivative) < 2.36 * error)
    # 200 intervals, of which those of one run are related: at least 88 % and at most 99.5 %
    assert 0.88 < np.mean(held) < 0.995, np.mean(held, axis=0)


def test_values_are_followed_without_new_kernels(plate):
    """A parameter that changes twice changes the columns twice, with the same kernels."""
    results, kernels = [], []
    for epsilon in (0.4, 0.2, 0.1, 0.4):
        with (
            changed(plate, {"paint.epsilon": epsilon}),
            dr.scoped_set_flag(dr.JitFlag.KernelHistory),
        ):
            dr.kernel_history_clear()
            results.append(sensitivities(plate, PAINT, paths=2**14))
            history = dr.kernel_history([dr.KernelType.JIT])
            # Smaller kernels make tables
            paths = [kernel for kernel in history if kernel["size"] >= 4096]
            kernels.append(sum(not kernel["cache_hit"] for kernel in paths))
    assert len({result.derivative[1] for result in results}) == 3
    np.testing.assert_array_equal(results[0].derivative, results[3].derivative)
    assert kernels[1:] == [0, 0, 0], kernels


def test_bad_names(plate):
    with pytest.raises(InputError, match="paint.epsilon"):
        sensitivities(plate, ["paint.epsilom"], paths=2**12)


def test_a_tolerance_below_the_rounding_of_the_interval(plate):
    """The interval has 1.96 times the systematic error, whatever the number of paths."""
    with plate.prepared() as tracer:
        systematic = tracer.systematic_error
    with pytest.raises(InputError, match="tolerance"):
        sensitivities(plate, PAINT, tolerance=1.5 * systematic)


def test_the_tail_has_no_derivatives(plate):
    integrator = plate.mi.integrator()
    integrator.closure, integrator.max_bounces = "tail", 3
    try:
        with pytest.raises(InputError, match="closure = tail has no derivatives"):
            sensitivities(plate, PAINT, paths=2**12)
    finally:
        integrator.closure, integrator.max_bounces = "none", 1
