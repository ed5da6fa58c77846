"""Inversion of synthetic measurements: recovery, honest errors, and what cannot be separated."""

import json
from dataclasses import replace
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.knowing.inversion.answers import chi_square
from mi_lcair.knowing.inversion.data.loader import Loader
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from mi_lcair.knowing.inversion.invert import fitted, spread
from mi_lcair.knowing.inversion.least_squares.solve import solve
from mi_lcair.knowing.inversion.unknowns import InverseProblem, unknowns
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.parameters.values import apply_solution
from tests.derivatives.waist import VIEWS, smooth_temperatures
from tests.derivatives.waist import write_scene as write_waist
from tests.knowing.inversion.blocks import block, kelvin, unknown
from tests.knowing.inversion.corner import EXACT, KELVIN, NETD_MK, clean, reflectances
from tests.knowing.inversion.corner import problem as corner_problem
from tests.knowing.inversion.corner import write_scene as write_corner
from tests.knowing.inversion.plate import UNKNOWNS, datum, write_scene

mi.set_variant("llvm_ad_mono")

STRIPES = (293.1, 294.2, 299.1, 304.2)


def test_spread_of_a_material():
    """Of four parameters two were estimated; the others have no error and no correlation."""
    covariance = np.array([[4.0, 9, 0.6], [9, 99, 9], [0.6, 9, 0.25]])
    found = spread("paint", ("a", "b", "c"), {"paint.c": 0, "paint.a": 2, "other.b": 1}, covariance)
    assert found["standard_error"] == {"a": 0.5, "b": 0.0, "c": 2.0}
    np.testing.assert_allclose(found["correlation"], [[1, 0, 0.6], [0, 1, 0], [0.6, 0, 1]])


class Measured:
    """A measured image of 2 x 2 pixels, of which three count."""

    label, aspects, quantity, background, is_image = "a", (), "radiance", 0.5, True
    entry = SimpleNamespace(state="hot")
    scene = SimpleNamespace(name="room", parameters={"T": "3"}, band=SimpleNamespace(name="LWIR"))
    where = SimpleNamespace(parameters={"lid.temperature": None})
    measured = np.array([3.0, 4.0, 5.0])

    def numbers(self, unknowns):
        return [0, 1, 2]

    def bad_pixels(self, block):
        return [(0, k) for k in np.flatnonzero(block.weight == 0)]

    def settings(self, unknowns, x):
        return {"lid.temperature": x[0]}

    def image(self, values):
        return np.append(values, np.nan).reshape(2, 2)


def test_a_datum_after_the_solution():
    """Predictions less the background, and residuals in standard deviations."""
    one = block([[2.0, 2, 2], [4, 4, 4]], np.zeros((2, 3, 3)), Measured.measured, 0.5)
    facets = [kelvin(f"f[{k}]", name="f", kind="facet", facet=k) for k in (4, 7)]
    x = np.array([320.0, 290.0, 295.0])
    found = fitted(Measured(), one, [kelvin("lid.temperature"), *facets, unknown("other")], x)
    assert found.facets == {"f": {4: 290.0, 7: 295.0}} and found.kinds == {
        "lid.temperature": "temperature"
    }
    np.testing.assert_array_equal(found.predicted, [[2.5, 2.5], [2.5, np.nan]])
    np.testing.assert_array_equal(found.measured, [[2.5, 3.5], [4.5, np.nan]])
    np.testing.assert_array_equal(found.residual, [[0, 2], [4, np.nan]])
    assert found.points == 3 and found.is_image and (found.band, found.state) == ("LWIR", "hot")
    left_out = replace(one, weight=np.array([4.0, 0.0, 4.0]))
    without_one = fitted(Measured(), left_out, [kelvin(), *facets, unknown()], x)
    np.testing.assert_array_equal(without_one.residual, [[0, np.nan], [4, np.nan]])
    assert without_one.points == 2 and without_one.bad_pixels == [(0, 1)]
    rms = found.as_dict()["residual_rms_sigmas"]
    np.testing.assert_allclose(rms, np.sqrt((0 + 4 + 16) / 3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    write_scene(folder)
    return folder


def within(answer, truth, errors=4):
    assert abs(answer.value - truth) < errors * answer.standard_error, (answer, truth)


@pytest.mark.slow
def test_one_band_cannot_separate_temperature_and_reflectance(folder):
    found = mi_lcair.invert({"data": [datum(folder, "one", 1)], "unknowns": UNKNOWNS})
    for answer in found.answers:
        assert answer.verdict.startswith("not determined by these data"), answer
    assert found.correlation[0, 1] == pytest.approx(1, abs=5e-4)
    (direction,) = found.directions
    assert "`plate.temperature` and `paint.reflectance` trade at" in direction.words
    assert "one band cannot separate them" in direction.words
    # (1 - R) B'(T) dT = (B(T) - B(S)) dR at the solution
    T, R = (answer.value for answer in found.answers)
    hot, warmer, sky = (in_band_radiance(band("LWIR"), kelvin) for kelvin in (T, T + 0.1, 290.0))
    assert direction.slope == pytest.approx((hot - sky) * 0.1 / (warmer - hot) / (1 - R), rel=0.01)
    best = found.advice[0]
    assert "sky" in best.measure and "20 K hotter" in best.measure
    assert best.errors["plate.temperature"] < 0.02
    assert any("MWIR" in one.measure for one in found.advice)


@pytest.mark.slow
def test_two_states_of_the_plate_do_not_help(folder):
    data = [
        datum(folder, "cold", 1, "cold"),
        datum(folder, "hot", 2, "hot", T=330.0, start={"T": 325.0}),
    ]
    found = mi_lcair.invert({"data": data, "unknowns": UNKNOWNS}, advise=False)
    assert [answer.label for answer in found.answers] == [
        "plate.temperature [cold]",
        "plate.temperature [hot]",
        "paint.reflectance",
    ]
    assert all(answer.verdict.startswith("not determined") for answer in found.answers)


@pytest.mark.slow
def test_two_bands_with_a_reflectance_each_do_not_help_and_a_grey_one_does(folder):
    data = [datum(folder, "lwir", 1), datum(folder, "mwir", 2, band="MWIR")]
    found = mi_lcair.invert({"data": data, "unknowns": UNKNOWNS}, advise=False)
    assert found["paint.reflectance [MWIR]"].verdict.startswith("not determined")
    assert found["plate.temperature"].verdict.startswith("not determined")
    grey = UNKNOWNS | {"paint.reflectance": {"per": []}}
    found = mi_lcair.invert({"data": data, "unknowns": grey})
    assert [answer.verdict for answer in found.answers] == ["determined"] * 2
    assert found["plate.temperature"].standard_error < 0.05 and not found.advice
    within(found["plate.temperature"], 310)
    within(found["paint.reflectance"], 0.3)
    assert 1e-3 < found.p_value < 0.999


@pytest.mark.slow
def test_two_states_of_the_surroundings_separate_them(folder):
    data = [datum(folder, "a", 1, "a"), datum(folder, "b", 2, "b", S=310.0)]
    given = {"plate.temperature": {"per": []}, "paint.reflectance": {}}
    found = mi_lcair.invert({"data": data, "unknowns": given}, advise=False)
    within(found["plate.temperature"], 310)
    within(found["paint.reflectance"], 0.3)
    assert found["plate.temperature"].standard_error < 0.01


def test_an_estimate_that_has_not_converged_is_not_determined(folder):
    data = [datum(folder, "a", 1, "a"), datum(folder, "b", 2, "b", S=310.0)]
    given = {"plate.temperature": {"per": []}, "paint.reflectance": {}}
    one = {"data": data, "unknowns": given, "render": {"iterations": 1}}
    found = mi_lcair.invert(one, advise=False)
    assert not found.converged and any("has not converged" in line for line in found.remarks)
    (step,) = found.trace
    assert step.renders == 1 and step.step_sigmas > 0.2 and step.paths == 2 * 16 * 16 * 16
    assert found.as_dict()["trace"][0]["is_kept"]
    assert all(answer.verdict.startswith("not converged") for answer in found.answers)


def test_a_wrong_scene_is_seen_in_the_residuals(folder):
    """The plate alone is not of one temperature: half of the image is 0.5 K hotter."""
    entry = datum(folder, "half", 1)
    image = np.load(entry["image"])
    image[:8] += 0.5 * 0.1
    np.save(entry["image"], image)
    found = mi_lcair.invert({"data": [entry], "unknowns": {"plate.temperature": {}}})
    assert found.p_value < 1e-3
    assert any("something is missing in the scene" in line for line in found.remarks)


def test_gain_and_offset(folder):
    """A camera with a wrong gain and offset sees the plate at two known temperatures."""
    entries = [datum(folder, "g1", 1, "x"), datum(folder, "g2", 2, "y", T=340.0)]
    for entry, hot_K in zip(entries, (310.0, 340.0)):
        np.save(entry["image"], 1.05 * np.load(entry["image"]) + 0.4)
        entry["parameters"] |= {"R": 0.3, "T": hot_K}
        entry |= {"gain": True, "offset": True, "offset_prior": [0.4, 0.001]}
    known = {
        f"plate.temperature [{state}]": {"prior": [T, 0.05]} for state, T in zip("xy", (310, 340))
    }
    found = mi_lcair.invert({"data": entries, "unknowns": known}, advise=False)
    for name in ("g1", "g2"):
        gain = found[f"gain [{name}]"]
        within(gain, 1.05)
        assert gain.standard_error < 2e-3 and not gain.is_sought
        within(found[f"offset [{name}]"], 0.4)


@pytest.fixture(scope="module")
def cylinder():
    """Parameters of the cylinder, its band, and its image of 24 x 24 pixels without noise."""
    parameters = {"finish": "gloss_black", "resolution": 24, "max_bounces": 1}
    scene = mi_lcair.load("cylinder_ir_range", **parameters)
    image = mi_lcair.render(scene, spp=2048, seed=99).channels["Y"].astype(float)
    return parameters, scene.band, image


def stripes_problem(path, parameters, seed):
    return InverseProblem.of(
        {
            "data": [
                {
                    "scene": "cylinder_ir_range",
                    "parameters": parameters,
                    "image": str(path),
                    "quantity": "radiance",
                    "netd_mK": 50,
                    **EXACT,
                }
            ],
            "unknowns": {f"self@{kelvin}.temperature": {"start": 300.0} for kelvin in STRIPES},
            "render": {"spp": 64, "seed": seed},
        }
    )


@pytest.mark.slow
def test_errors_are_true(cylinder, tmp_path):
    """Renders of four seeds, each with six draws of the camera's noise: z has a scatter of 1."""
    parameters, band, image = cylinder
    sigma, z = noise_of_netd(band, image, 50), []
    for seed in range(4):
        np.save(tmp_path / "c.npy", image)
        problem = stripes_problem(tmp_path / "c.npy", parameters, seed)
        data = Loader().datum(problem.data[0], 0, set())
        sought = unknowns(problem.unknowns, {}, [data.where], 1)
        first = np.array([one.start for one in sought])
        block = data.block(sought, first, problem.render)
        weight = [data.weighing(sought, np.array(STRIPES), problem.render)]
        for draw in range(6):
            noise = np.random.default_rng((seed, draw)).standard_normal(image.shape)
            noisy = replace(block, measured=(image + sigma * noise)[data.counts])
            state = solve(sought, lambda x: [noisy], lambda x: weight, True, 1)  # noqa: B023
            z.append((state.x - STRIPES) / np.sqrt(np.diag(state.covariance)))
            assert 1e-5 < chi_square(state.blocks, state.x, len(sought))["p_value"] < 1 - 1e-5
    z = np.array(z)
    cover = np.mean(np.abs(z) < 1.96)
    assert 0.88 <= cover <= 1.0, cover
    assert np.all(np.abs(z.mean(axis=0)) < 1.3) and 0.6 < z.std() < 1.4


def test_one_render_serves_all_steps(cylinder, tmp_path):
    """Radiance is linear in blackbody radiances, so no step needs a new render."""
    parameters, _, image = cylinder
    np.save(tmp_path / "c.npy", image + 0.01)
    found = mi_lcair.invert(stripes_problem(tmp_path / "c.npy", parameters, 0), advise=False)
    assert found.renders == 1 and found.converged


@pytest.mark.parametrize("start", [200.0, 1500.0])
def test_strips_that_reflect_each_other_from_far_first_guesses(tmp_path, start):
    path = write_corner(tmp_path)
    found = mi_lcair.invert(corner_problem(tmp_path, path, clean(path), start, 0), advise=False)
    assert found.converged and found.p_value > 1e-3
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth)


def test_pixels_without_radiance_have_the_camera_s_noise(tmp_path):
    """Space around the corner: a camera's noise is the same there as beside warm surfaces."""
    path = write_corner(tmp_path)
    image = clean(path, half=0.9)
    assert np.mean(image == 0) > 0.2
    given = corner_problem(tmp_path, path, image, 300.0, 1)
    given["data"][0]["parameters"] = {"half": 0.9}
    found = mi_lcair.invert(given, advise=False)
    assert found.p_value > 1e-3 and found.chi_square < 1.5 * found.degrees_of_freedom
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth)


def test_a_wrong_model_determines_nothing(tmp_path):
    """A flipped image: chi-square is large, and each verdict says so, as that of a fit does."""
    path = write_corner(tmp_path)
    given = corner_problem(tmp_path, path, np.flip(clean(path), axis=1), 300.0, 2, spp=128)
    found = mi_lcair.invert(given, advise=False)
    assert not found.data[0].bad_pixels
    assert found.p_value < 1e-3 and "check its geometry and materials" in found.remarks[-1]
    for answer in found.answers:
        assert answer.verdict.startswith("not determined by these data: the model misses"), answer


def test_bad_pixels_that_nobody_stated(tmp_path):
    """1 % of the pixels are dead, hot or saturated: they are listed, and the values are right."""
    path, random = write_corner(tmp_path), np.random.default_rng(4)
    given = corner_problem(tmp_path, path, clean(path), 300.0, 5, spp=128)
    image = np.load(given["data"][0]["image"])
    bad = random.choice(image.size, 3, replace=False)
    image.flat[bad] = 0.0, 70.0, 1e4
    np.save(given["data"][0]["image"], image)
    found = mi_lcair.invert(given, advise=False)
    places = [[int(pixel) // 16, int(pixel) % 16] for pixel in sorted(bad)]
    assert found.as_dict()["data"][0]["bad_pixels"] == places
    assert "3 pixels are left out as dead, hot or saturated" in found.remarks[-1]
    assert found.p_value > 1e-3 and np.isnan(found.data[0].residual).sum() == 3
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth)


CORNERS = np.add.outer(np.linspace(-1, 1, 16) ** 2, np.linspace(-1, 1, 16) ** 2) / 2
FAULTS = {
    "vignetting": 1 - 0.04 * CORNERS,
    "gradient": np.linspace(0.99, 1.01, 16),
    "gain": np.array(1.01),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_camera_that_nobody_states(tmp_path, fault):
    """The errors cover it, and a verdict says on which assumption it rests."""
    path = write_corner(tmp_path)
    given = corner_problem(tmp_path, path, clean(path) * FAULTS[fault], 300.0, 7, spp=128)
    del given["data"][0]["camera_sigma"], given["data"][0]["model_sigma"]
    found = mi_lcair.invert(given, advise=False)
    for answer, truth in zip(found.answers, KELVIN):
        assert answer.verdict.startswith("determined if the camera's gain and ")
        within(answer, truth, 3)
    assert found.remarks[0].startswith("assumed to be right within 1 %: the camera's gain (")
    is_named = any("shows an error of the vignetting of -" in line for line in found.remarks)
    assert is_named == (fault == "vignetting")


def test_faults_that_two_images_have_in_common(tmp_path):
    """A second image of one camera does not tell more about its gain than the first one does."""
    path = write_corner(tmp_path)
    given = corner_problem(tmp_path, path, clean(path), 300.0, 7, spp=128)
    given["data"][0] |= {"camera_sigma": "2%"}
    one = mi_lcair.invert(given, advise=False)
    given["data"].append(dict(given["data"][0]))
    two = mi_lcair.invert(given, advise=False)
    for of_one, of_two in zip(one.answers, two.answers):
        ratio = of_two.standard_error / of_one.standard_error
        assert 0.9 < ratio < 1.01  # without what they have in common 0.7


def test_bad_pixels_that_lie_together(tmp_path):
    """A warm spot that the scene does not have: its pixels are left out, and nothing is claimed."""
    path = write_corner(tmp_path)
    image = clean(path)
    image[2:5, 3:6] *= 1.5
    found = mi_lcair.invert(corner_problem(tmp_path, path, image, 300.0, 8, spp=128), advise=False)
    assert len(found.data[0].bad_pixels) == 9 and found.p_value > 1e-3
    assert "the pixels that are left out lie side by side, unlike dead pixels" in found.remarks[-1]
    what = "the model misses pixels of data 1 that were left out and lie side by side"
    assert {a.verdict for a in found.answers} == {f"not determined by these data: {what}"}


def test_saturation_that_nobody_states(tmp_path):
    path = write_corner(tmp_path)
    given = corner_problem(tmp_path, path, clean(path), 300.0, 9, spp=128)
    image = np.load(given["data"][0]["image"])
    np.save(given["data"][0]["image"], np.minimum(image, np.quantile(image, 0.9)))
    found = mi_lcair.invert(given, advise=False)
    assert (
        "26 pixels have the same largest value and are left out as saturated" in found.remarks[-1]
    )
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth)


def test_noise_that_is_stated_too_high(tmp_path):
    path = write_corner(tmp_path)
    given = corner_problem(tmp_path, path, clean(path), 300.0, 3, spp=256)
    given["data"][0]["netd_mK"] = 5 * NETD_MK
    found = mi_lcair.invert(given, advise=False)
    assert found.p_value > 0.999 and "the given noise is too large" in found.remarks[-1]
    given["render"]["scale_errors"] = True
    scaled = mi_lcair.invert(given, advise=False)
    factor = np.sqrt(found.chi_square / found.degrees_of_freedom)
    assert factor < 0.6 and f"the errors assume {factor:.3g} times" in scaled.remarks[0]
    assert not any("overstated" in line for line in scaled.remarks)
    for answer, before, truth in zip(scaled.answers, found.answers, KELVIN):
        within(answer, truth)
        assert 0.2 * before.standard_error < answer.standard_error < before.standard_error


def test_noise_that_rows_and_columns_share(tmp_path):
    """Stripes of the image: stated, they widen the errors, and chi-square is as it should be."""
    path, random = write_corner(tmp_path), np.random.default_rng(12)
    given = corner_problem(tmp_path, path, clean(path), 300.0, 6, spp=256)
    image = np.load(given["data"][0]["image"])
    sigma = noise_of_netd(mi_lcair.load(path).band, image, NETD_MK).mean()
    image += sigma * (3 * random.normal(size=(16, 1)) + 2 * random.normal(size=16))
    np.save(given["data"][0]["image"], image)
    unstated = mi_lcair.invert(given, advise=False)
    assert unstated.p_value < 1e-3
    given["data"][0] |= {"row_noise": 3.0, "column_noise": 2.0}
    found = mi_lcair.invert(given, advise=False)
    assert found.p_value > 1e-3 and found.converged and not found.data[0].bad_pixels
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth)


def test_an_error_of_the_model_that_is_stated(tmp_path):
    """Reflectances that are wrong by 0.04: a remark proposes model_sigma, and errors cover them."""
    path = write_corner(tmp_path)
    wrong = reflectances(0.3 + 0.04 * np.array([1, -1, 0.5, -0.5, -1, 1]))
    image = clean(path, **wrong)
    given = corner_problem(tmp_path, path, image, 300.0, 4, spp=128)
    found = mi_lcair.invert(given, advise=False)
    z = [(answer.value - T) / answer.standard_error for answer, T in zip(found.answers, KELVIN)]
    assert np.max(np.abs(z)) > 10 and not any(answer.is_determined for answer in found.answers)
    assert 'give model_sigma, at least "' in found.remarks[-1]
    given["data"][0]["model_sigma"] = "4 %"
    found = mi_lcair.invert(given, advise=False)
    assert found.p_value > 1e-3
    for answer, truth in zip(found.answers, KELVIN):
        within(answer, truth, 3)


@pytest.mark.slow
def test_facet_temperatures(tmp_path):
    """36 facets of a waisted body from its views; the file sets them in another loaded scene."""
    truth = smooth_temperatures(6, 6)
    path = write_waist(tmp_path, truth, 6, 6, size=12)
    scene = mi_lcair.load(path)
    data = []
    for view in range(len(VIEWS)):
        image = mi_lcair.render(scene, spp=1024, sensor=view, seed=50 + view)
        image = image.channels["Y"].astype(float)
        sigma = noise_of_netd(scene.band, image, 50)
        image += sigma * np.random.default_rng(view).standard_normal(image.shape)
        np.save(tmp_path / f"v{view}.npy", image)
        data.append(
            {
                "scene": str(path),
                "sensor": view,
                "image": str(tmp_path / f"v{view}.npy"),
                "quantity": "radiance",
                "netd_mK": 50,
                **EXACT,
            }
        )
    unknown = {"body.facets": {"start": 300.0}}
    found = mi_lcair.invert({"data": data, "unknowns": unknown, "render": {"spp": 128}})
    assert found.renders == 1 and len(found.answers) == truth.size
    value = np.array([answer.value for answer in found.answers])
    z = (value - truth.ravel()) / [answer.standard_error for answer in found.answers]
    assert np.mean(np.abs(z) < 1.96) > 0.8 and np.abs(z).max() < 5
    assert np.sqrt(np.mean((value - truth.ravel()) ** 2)) < 0.5
    # The solution's file gives the facets of another loaded scene their temperatures
    found.save(tmp_path / "solution.json")
    other = mi_lcair.load(write_waist(tmp_path, 280 + 0 * truth, 6, 6, size=12))
    apply_solution(other, tmp_path / "solution.json")
    facets = [answer.facet for answer in found.answers]
    np.testing.assert_allclose(FacetTable(other).temperature[facets], value, rtol=1e-6)
    assert json.loads((tmp_path / "solution.json").read_text())["kind"] == "mi_lcair solution"


def test_facets_that_no_pixel_sees(tmp_path):
    """From above only: facets of the lower half keep their first guess, and a remark says so."""
    truth = smooth_temperatures(6, 6)
    path = write_waist(tmp_path, truth, 6, 6, size=16)
    scene = mi_lcair.load(path)
    image = mi_lcair.render(scene, spp=512, sensor=4, seed=3).channels["Y"]
    np.save(tmp_path / "top.npy", image)
    entry = {
        "scene": str(path),
        "sensor": 4,
        "image": str(tmp_path / "top.npy"),
        "quantity": "radiance",
        "netd_mK": 50,
        **EXACT,
    }
    unknown = {"body.facets": {"start": 300.0}}
    found = mi_lcair.invert({"data": [entry], "unknowns": unknown, "render": {"spp": 64}})
    unseen = [answer for answer in found.answers if answer.standard_error > 90]
    assert 0 < len(unseen) < truth.size
    assert not any(answer.is_determined for answer in unseen)
    assert [answer.value for answer in unseen] == pytest.approx([300] * len(unseen), rel=1e-12)
    (remark,) = (line for line in found.remarks if "are seen by no pixel" in line)
    assert remark.startswith(f"{len(unseen)} facets are seen by no pixel ({unseen[0].facet}, ")
    assert sum(answer.is_determined for answer in found.answers) > truth.size / 3


def test_facets_that_follow_those_that_a_pixel_sees(tmp_path):
    """From above: near facets are alike, so that those below have better values."""
    rings = segments = 6
    ring = np.arange(rings * segments) // segments
    truth = 304 + 2 * np.cos(np.pi * ring / rings)
    scene = mi_lcair.load(write_waist(tmp_path, truth, rings, segments, size=16))
    image = mi_lcair.render(scene, spp=512, sensor=4, seed=3).channels["Y"]
    np.save(tmp_path / "top.npy", image)
    path = write_waist(tmp_path, 300 + 0 * truth, rings, segments, size=16)
    entry = {"scene": str(path), "sensor": 4, "image": str(tmp_path / "top.npy"), "netd_mK": 50}
    entry |= EXACT
    tree = {"data": [entry | {"quantity": "radiance"}], "render": {"spp": 64}}
    known = {"prior": [300.0, 6.0]}
    errors = []
    for more in ({}, {"correlation_m": 1.0}):
        found = mi_lcair.invert(tree | {"unknowns": {"body.facets": known | more}}, advise=False)
        value = np.array([answer.value for answer in found.answers])
        sigma = np.array([answer.standard_error for answer in found.answers])
        errors.append((value - truth, sigma))
    (alone, alone_sigma), (alike, sigma) = errors
    unseen = alone_sigma > 5.9
    assert 0 < unseen.sum() < truth.size and found.converged
    near = unseen & (sigma < 4)  # just behind the edge that the image shows
    assert near.any() and np.abs(alike[near]).mean() < 0.7 * np.abs(alone[near]).mean()
    assert (sigma < 1.001 * alone_sigma).all() and np.mean(np.abs(alike / sigma) < 1.96) > 0.85
    (remark,) = (line for line in found.remarks if "are seen by no pixel" in line)
    assert "they follow their neighbours, as correlation_m says" in remark


def test_a_first_guess_below_the_sky(tmp_path):
    """The iteration meets a mirror on its way, from which the temperature has no effect."""
    write_scene(tmp_path)
    entry = datum(tmp_path, "plate", 1, start={"T": 284.54233, "R": 0.47518})
    solution = mi_lcair.invert({"data": [entry], "unknowns": UNKNOWNS}, advise=False)
    assert solution.converged and solution.p_value > 1e-3
    for answer, truth in zip(solution.answers, (310.0, 0.3)):
        assert answer.lower < truth < answer.upper
