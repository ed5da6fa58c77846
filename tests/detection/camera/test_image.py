"""Images of scenarios, against closed forms and against `contrast`."""

import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.api.intensities import signature
from mi_lcair.api.scenarios import contrast, image
from mi_lcair.detection.camera.electronics import electron_band, electrons, signal_of
from mi_lcair.detection.camera.exposure import exposure_of
from mi_lcair.detection.camera.image import remarks
from mi_lcair.detection.camera.image_result import measured as measured_rows
from mi_lcair.detection.camera.optics import OVERSAMPLING
from mi_lcair.detection.setting import setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import (
    LIGHT_SPEED,
    PLANCK,
    brightness_temperature,
    in_band_radiance,
    spectral_radiance,
)
from mi_lcair.physics.sun import sunlight
from mi_lcair.rendering.measure import measure
from tests.detection.camera.plate_scenario import plate
from tests.detection.disc_scenario import AREA, disc, write_disc

CAMERA = {
    "focal_length_mm": 100.0,
    "f_number": 4.0,
    "pitch_um": 15.0,
    "width": 64,
    "height": 48,
    "integration_time_ms": 0.5,
    "well_Me": 5.0,
    "quantum_efficiency": 0.75,
    "read_noise_e": 500.0,
}

SUN = """<emitter type="sun">
    <float name="azimuth_deg" value="0"/> <float name="elevation_deg" value="0"/>
    <string name="band" value="$band"/>
</emitter>"""

EXAMPLES = Path(scenes.__file__).parent / "examples"
TITANIUM = """<bsdf type="material">
    <string name="material" value="titanium"/> <string name="band" value="$band"/>
    <string name="materials" value="smooth.toml"/>
</bsdf>"""


@pytest.fixture
def scenario(tmp_path):
    """Function that gives the disc's scenario with a camera and some changes."""
    write_disc(tmp_path)

    def made(camera=None, **changes):
        entries = {f"camera__{name}": value for name, value in (CAMERA | (camera or {})).items()}
        return disc(tmp_path, **entries, **changes)

    return made


def test_disc_in_vacuum(scenario):
    """Far from its edge the disc has its temperature, less what diffraction takes away."""
    result = image(scenario(), frames=3, seed=4)
    assert result.counts.shape == (3, 48, 64)
    assert np.array_equal(result.counts, image(scenario(), frames=3, seed=4).counts)
    own = electron_band(band("MWIR"), result.scenario.camera)
    inside, outside = (float(electrons(own, T)) for T in (400.0, 294.0))
    total = (result.channels["electrons.Y"].astype(float) - outside).sum()
    pixel = (15e-6 / 0.1 * 1000) ** 2
    assert total == pytest.approx((inside - outside) * AREA / pixel, rel=0.01)
    assert result.channels["mean_temperature.Y"][24, 32] == pytest.approx(400, abs=1.5)
    assert result.measures.pixels == pytest.approx(AREA / pixel, rel=0.003)
    assert result.measures.netd_measured == pytest.approx(result.measures.netd, rel=0.03)
    # The frames scatter as the camera's noise says, where the rendering does not change
    recorded = [result.temperature(k) for k in range(3)]
    scatter = np.sqrt(np.var(recorded, axis=0, ddof=1).mean())
    noise = np.sqrt(np.mean(result.channels["noise_K.Y"] ** 2))
    assert scatter == pytest.approx(noise, rel=0.05)
    assert np.allclose(recorded[0], result.channels["temperature.Y"], atol=1e-3)


def test_electrons_through_the_air(scenario):
    """The disc's electrons are the integral of its photons through the air at its range."""
    result = image(scenario(atmosphere__table="midlat_summer", background__temperature=280))
    row = next(row for row in result.ranges if row.range_m == 1000)
    path = atmosphere("midlat_summer").path(1000.0)
    x = np.linspace(3.0, 5.0, 20001)
    transmittance, radiance = path.at(x)
    arriving = transmittance * spectral_radiance(x, 400.0) + radiance - spectral_radiance(x, 280.0)
    photons = np.trapezoid(arriving * x * 1e-6 / (PLANCK * LIGHT_SPEED), x)
    pixel = photons * np.pi / 64 * (15e-6) ** 2 * 0.5e-3 * 0.75
    expected = pixel * AREA / (15e-6 / 0.1 * 1000) ** 2
    assert row.electrons == pytest.approx(expected, rel=3e-3)
    background = electrons(result.band, 280.0)
    total = (result.channels["electrons.Y"].astype(float) - background).sum()
    assert total == pytest.approx(expected, rel=0.01)


def test_electrons_of_titanium(tmp_path, monkeypatch):
    """Emissivity by wavelength, from Fresnel's equations, times the photons at each wavelength.

    The means of all wavelengths are in memory once, and no other array of this size.
    """
    sizes, peaks = [], []

    def measured(*arguments):
        total = measure(*arguments)
        sizes.append(sum(sums.nbytes for sums in total.sums.values()))
        tracemalloc.start()
        return total

    def exposed(*arguments, **options):
        result = exposure_of(*arguments, **options)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        return result

    monkeypatch.setattr("mi_lcair.detection.camera.exposure.measure", measured)
    monkeypatch.setattr("mi_lcair.detection.camera.image.exposure_of", exposed)
    changes = {"background__temperature": 30, "target__parameters": {}, "render__spp": 16}
    made = plate(tmp_path, 2.0, 2.0, **changes)
    text = (tmp_path / "disc.xml").read_text().replace('value="400"', 'value="800"')
    (tmp_path / "smooth.toml").write_text(
        "[titanium.spectral]\nalpha = 1e-3\ngamma = 4\nrho_d = 0\n"
        f'nk = "{EXAMPLES / "titanium.csv"}"\n'
    )
    counts = {}
    for name, bsdf in (("blackbody", ""), ("titanium", TITANIUM)):
        start, end = text.index("<bsdf"), text.index("</bsdf>") + len("</bsdf>")
        (tmp_path / "disc.xml").write_text(text[:start] + (bsdf or text[start:end]) + text[end:])
        result = image(made, frames=1, truth=name == "titanium")
        counts[name] = result.channels["electrons.Y"].astype(float).sum()
    x = np.linspace(3.0, 5.0, 20001)
    rows = np.genfromtxt(EXAMPLES / "titanium.csv", delimiter=",", skip_header=3)
    n, k = (np.interp(x, rows[:, 0], rows[:, column]) for column in (1, 2))
    emissivity = 4 * n / ((n + 1) ** 2 + k**2)  # along the normal
    photons = x * spectral_radiance(x, 800.0)
    expected = np.trapezoid(emissivity * photons, x) / np.trapezoid(photons, x)
    assert counts["titanium"] / counts["blackbody"] == pytest.approx(expected, rel=1e-5)
    power = spectral_radiance(x, 800.0)
    expected = np.trapezoid(emissivity * power, x) / np.trapezoid(power, x)
    truth = result.truth.channels["emissivity.Y"]
    assert truth[truth > 0] == pytest.approx(expected, rel=1e-4)
    assert peaks[1] < 2 * sizes[1]


def test_same_contrast_as_a_detector(scenario):
    """The radiance over the window, times the solid angle, is the irradiance of `contrast`."""
    changes = {"atmosphere__table": "midlat_summer", "background__temperature": 280}
    found = image(scenario(**changes))
    angle = (15e-6 / 0.1 / OVERSAMPLING) ** 2
    total = contrast(scenario(**changes)).rows[-1].total
    assert found.exposure.radiance.sum() * angle == pytest.approx(total.value, rel=3e-3)


def test_tolerance(scenario):
    result = image(scenario(render__tolerance=0.002))
    assert result.exposure.reached and result.exposure.rms_error <= 0.002


@pytest.mark.parametrize(
    "render, remedy",
    [
        ({"render__spp": 18}, "raise spp of"),
        ({"render__tolerance": 0.5}, "lower the tolerance of"),
        ({"render__tolerance": 1e-9, "render__max_spp": 18}, "raise max_spp of"),
    ],
)
def test_remedy_of_a_noisy_rendering(scenario, render, remedy):
    """An entry is named that the scenario may have: spp and tolerance exclude each other."""
    result = image(scenario({"pitch_um": 60.0}, **render))
    (line,) = (line for line in result.remarks if "larger than the camera's noise" in line)
    marked = result.channels["speckle.Y"] > 0
    assert remedy in line and f"{100 * marked.mean():.2g} % of the pixels" in line
    assert np.array_equal(marked, result.channels["stderr_K.Y"] > result.channels["noise_K.Y"])


def test_samples_as_the_noise_needs(scenario):
    """99.9 % of the frame have a smaller error of the rendering than noise, and few more paths."""
    result = image(scenario({"pitch_um": 60.0}, render__to_noise=True))
    assert result.exposure.reached and result.channels["speckle.Y"].mean() <= 2e-3
    even = image(scenario({"pitch_um": 60.0}, render__spp=result.exposure.spp))
    assert even.channels["speckle.Y"].mean() > 1.5 * result.channels["speckle.Y"].mean()


def test_error_of_the_rendering(scenario):
    """The stated standard error holds for independent renders."""
    pictures = [image(scenario(render__spp=36, render__seed=seed)).channels for seed in range(4)]
    edge = pictures[0]["stderr_K.Y"] > 0.05
    spread = np.var([one["mean_temperature.Y"][edge] for one in pictures], axis=0, ddof=1)
    stated = np.mean([one["stderr_K.Y"][edge] ** 2 for one in pictures], axis=0)
    assert 0.5 < np.sqrt(spread.mean() / stated.mean()) < 1.5


def test_saturation_is_a_remark(scenario):
    result = image(scenario({"integration_time_ms": 2.0}))
    share = np.mean(result.channels["electrons.Y"] >= 5e6)
    assert result.measures.saturated == pytest.approx(share)
    assert any(
        f"saturated in {100 * float(f'{share:.2g}'):g} % of the pixels" in line
        for line in result.remarks
    )


def test_dark_current_saturates(scenario):
    """The electrons that the remark states include those of the dark current."""
    result = image(scenario({"dark_current_e_s": 2e10}, render__spp=4))
    assert any("100 % of the pixels, which collect up to 1" in line for line in result.remarks)


@pytest.mark.parametrize(
    "camera, changes, text",
    [
        ({}, {"observer__range_m": 1.0}, "is inside the target: range 1 m"),
        ({"right_deg": 5.0}, {}, "no part of the target is in the frame of 0.55 x 0.413 degrees"),
        ({"integration_time_ms": 40.0, "nuc": True}, {}, "saturates the well of 5 Me"),
        ({"jitter_urad": 1e5}, {}, "jitter_urad = 100000 spreads the light of a point over"),
        ({"defocus_um": 1e5}, {}, "defocus_um = 100000 spreads the light of a point over"),
        ({"nuc": True}, {"background__temperature": 3}, "nuc looks at blackbodies of 90 and 110 K"),
    ],
)
def test_unusable(scenario, camera, changes, text):
    with pytest.raises(InputError, match=text):
        image(scenario(camera, **changes))


def test_target_at_the_end_of_the_table(scenario):
    """Parts of the model beyond the last range are taken to be at it."""
    air = {"atmosphere__table": "midlat_summer", "observer__range_m": 5000}
    found = image(scenario(observer__azimuth_deg=70, **air))
    assert found.exposure.share.any()


def test_target_smaller_than_a_pixel(scenario):
    """The window is divided into finer parts, so that the paths meet the model."""
    found = image(scenario(observer__range_m=200_000))
    row = next(row for row in found.ranges if row.range_m == 200_000)
    assert found.measures.pixels == pytest.approx(AREA / 30.0**2, rel=0.01)
    background = electrons(found.band, 294.0)
    expected = (electrons(found.band, 400.0) - background) * AREA / 30.0**2
    total = (found.channels["electrons.Y"].astype(float) - background).sum()
    assert total == pytest.approx(expected, rel=0.02)
    assert row.electrons == pytest.approx(expected, rel=0.01)
    assert found.exposure.rms_error < 0.01
    assert row.snr == pytest.approx(found.measures.snr, rel=0.01)
    assert row.peak_snr == pytest.approx(found.measures.peak_snr, rel=0.01)


def test_background_without_a_photon(scenario):
    """The noise of a pixel before cold space is finite in kelvin."""
    found = image(scenario(background__temperature=3))
    assert found.channels["mean_temperature.Y"].min() < 210
    assert all(np.isfinite(values).all() for values in found.channels.values())
    assert found.measures.temperature == 100 and found.measures.netd > 1


def test_memory_of_many_frames(scenario, monkeypatch):
    monkeypatch.setattr("mi_lcair.rendering.measurands.available_memory", lambda: 2**20)
    with pytest.raises(InputError, match="9000 frames of 64 x 48 pixels needs 0.1 GiB"):
        image(scenario(), frames=9000)


def test_without_a_camera(tmp_path):
    write_disc(tmp_path)
    with pytest.raises(InputError, match=r"has no table \[camera\]"):
        image(disc(tmp_path))
    with pytest.raises(InputError, match="frames = 0; must lie in 1..10000"):
        image(disc(tmp_path), frames=0)


def test_sunlight_keeps_its_spectrum(tmp_path):
    """A white disc in sunlight: its electrons are the sun's photons.

    A blackbody at the apparent temperature has longer wavelengths, and would give 19 % more.
    """
    write_disc(tmp_path)
    file = tmp_path / "disc.xml"
    text = file.read_text().replace('value="blackbody"', 'value="diffuse"')
    file.write_text(text.replace("</scene>", f"{SUN}</scene>"))
    entries = {f"camera__{name}": value for name, value in CAMERA.items()}
    found = image(disc(tmp_path, background__temperature=100, **entries))
    light = sunlight()
    x = np.linspace(3.0, 5.0, 2001)
    irradiance = np.interp(x, light.wavelengths_um, light.radiance)
    photons = np.trapezoid(irradiance * x, x) * 1e-6 / (PLANCK * LIGHT_SPEED) / np.pi
    pixel = photons * np.pi / 64 * (15e-6) ** 2 * 0.5e-3 * 0.75
    row = next(row for row in found.ranges if row.range_m == 1000)
    assert row.electrons == pytest.approx(pixel * row.pixels, rel=3e-3)
    thermal = electrons(
        found.band,
        float(brightness_temperature(band("MWIR"), light.in_band_radiance(band("MWIR")) / np.pi)),
    )
    assert thermal / pixel == pytest.approx(1.19, abs=0.01)


@pytest.mark.parametrize("width", [0.6, 16.0])
def test_a_plate_across_the_border_of_the_frame(tmp_path, width):
    """It looks as in a larger frame, at 300 K on 280 K: to 5 mK where the rendering is certain.

    The narrow plate ends 30 pixels beside the frame, the wide one 1000 pixels.
    """
    # The plate's left end is 10 columns inside the frame's right border
    aside = 22 + width / 2 / (1.5e-4 * 100)
    entries = {
        "camera__right_deg": -float(np.degrees(np.arctan(aside * 1.5e-4))),
        "observer__range_m": 100,
        "render__spp": 36,
    }
    images = [
        image(plate(tmp_path, width, 0.4, **entries | {"camera__width": columns}))
        for columns in (64, 1664)
    ]
    small, large = (found.channels["mean_temperature.Y"] for found in images)
    certain = images[0].channels["stderr_K.Y"] < 1e-3
    assert certain[:, -8:].sum() > 8 * 20
    assert abs(small - large[:, 800:864])[certain].max() < 5e-3
    assert any("a part of the target is outside the frame" in line for line in images[0].remarks)


def test_a_dark_target_has_an_error(tmp_path):
    """The back of a plate emits nothing, but hides the background on an area that is estimated."""
    view = {"observer__azimuth_deg": 150, "observer__elevation_deg": 20, "render__spp": 8}
    result = image(plate(tmp_path, 1.1, 0.7, **view))
    exposed = result.exposure
    area = 1.1 * 0.7 * np.cos(np.radians(30)) * np.cos(np.radians(20))
    truth = -result.measures.background * area / result.view.pixel_m**2
    error = np.sqrt(np.sum(exposed.error**2)) / OVERSAMPLING**2
    difference = exposed.contrast.sum() / OVERSAMPLING**2 - truth
    assert abs(difference) < 3 * error
    assert error < 0.1 * abs(truth)


def test_a_saturated_frame_detects_nothing(tmp_path):
    """Nothing is left of a target where the well is full, and of a hot one what the well holds."""
    scenario = plate(tmp_path, 2.0, 2.0, camera__integration_time_ms=50, render__spp=16)
    full = image(scenario)
    assert full.measures.saturated == 1 and full.measures.netd is None
    assert full.measures.snr == full.measures.peak_snr == 0
    assert full.detected_to_m is None and not any(row.detected for row in full.ranges)
    assert "NETD none, as the background saturates" in full.summary()
    full.plot(tmp_path / "full.png")
    assert (tmp_path / "full.png").exists()
    hot = {"target__parameters": {"temperature": 1500}, "render__spp": 16}
    clipped = image(plate(tmp_path, 2.0, 2.0, **hot))
    camera, measures = clipped.scenario.camera, clipped.measures
    room = camera.well - camera.dark - measures.background
    (row,) = (row for row in clipped.ranges if row.range_m == clipped.scenario.observer.range_m)
    assert measures.peak_snr == pytest.approx(room / measures.noise, rel=1e-6)
    assert row.peak_snr == pytest.approx(measures.peak_snr, rel=1e-6)
    assert row.snr == pytest.approx(measures.snr, rel=0.01)


def test_hot_spots_over_range(tmp_path):
    """A hot and a cold half: the table from 3 km has the ratios of frames at 1, 3 and 10 km.

    Both halves together are hardly brighter than the background, so that an even target of the
    same electrons would have a ratio of less than a fifth of this at 1 km.
    """
    changes = {"target__parameters": {}, "camera__integration_time_ms": 0.5}
    made = plate(tmp_path, 2.0, 1.0, render__spp=64, **changes)
    text = (tmp_path / "disc.xml").read_text()
    shape = text[text.index("<shape") : text.index("</shape>") + len("</shape>")]
    half = shape.replace('y="1.0"', 'y="0.5"')
    halves = [
        half.replace("</transform>", f'<translate y="{side}"/> </transform>').replace(
            "$temperature", kelvin
        )
        for side, kelvin in ((0.5, "291"), (-0.5, "264"))
    ]
    (tmp_path / "disc.xml").write_text(text.replace(shape, "".join(halves)))
    near, middle, far = (
        image(replace(made, observer=replace(made.observer, range_m=range_m)))
        for range_m in (1000.0, 3000.0, 10_000.0)
    )
    (row,) = (row for row in near.ranges if row.range_m == 1000)
    assert near.measures.snr > 5 * abs(row.electrons) / near.measures.noise / np.sqrt(row.pixels)
    for found in (near, middle, far):
        (row,) = (row for row in middle.ranges if row.range_m == found.scenario.observer.range_m)
        assert row.snr == pytest.approx(found.measures.snr, rel=0.03)


@pytest.mark.parametrize("width, height", [(3.0, 3.0), (0.5, 0.5), (0.2, 20.0)])
def test_ratios_over_range_are_those_of_frames(tmp_path, width, height):
    """At 1 and 5 km, from the render at 5 km, and with the matched filter in 100 frames."""
    changes = {
        "target__parameters": {"temperature": 281},
        "camera__width": 192,
        "camera__height": 192,
        "camera__integration_time_ms": 0.5,
    }
    far = image(plate(tmp_path, width, height, observer__range_m=5000, **changes), frames=100)
    near = image(plate(tmp_path, width, height, observer__range_m=1000, **changes))
    for found, range_m in ((near, 1000), (far, 5000)):
        row = next(row for row in far.ranges if row.range_m == range_m)
        assert row.snr == pytest.approx(found.measures.snr, rel=0.01)
        assert row.peak_snr == pytest.approx(found.measures.peak_snr, rel=0.05)
    template = far.channels["electrons.Y"].astype(float) - far.measures.background
    recorded = signal_of(far.scenario.camera, far.counts.astype(float)) - far.measures.background
    outputs = np.sum(recorded * template, axis=(1, 2)) / np.sqrt(np.sum(template**2))
    noise = recorded[:, template < 1e-3 * template.max()].std()
    # The mean of 100 outputs, each with the noise of a pixel, is known to 0.1 noises
    assert outputs.mean() / noise == pytest.approx(row.snr, rel=0.01, abs=0.3)


def test_turbulence_follows_the_range(tmp_path):
    """The row of another range is blurred by its own turbulence, as the image from there."""
    changes = {
        "atmosphere__table": "midlat_summer",
        "atmosphere__cn2": 3e-14,
        "camera__focal_length_mm": 300.0,
        "camera__integration_time_ms": 0.3,
    }
    far, near = (
        image(plate(tmp_path, 1.0, 0.5, observer__range_m=range_m, **changes))
        for range_m in (5000, 1000)
    )
    row = next(row for row in far.ranges if row.range_m == 1000)
    assert row.snr == pytest.approx(near.measures.snr, rel=0.01)
    mtf = [found.mtf()["part.turbulence"][-1] for found in (far, near)]
    assert mtf[0] == pytest.approx(mtf[1] ** 5, rel=0.05) and mtf[0] < 0.3
    still = image(plate(tmp_path, 1.0, 0.5, **changes | {"atmosphere__cn2": 0.0}))
    assert still.mtf()["part.turbulence"] == pytest.approx(1, rel=1e-12)
    assert near.measures.snr < 0.99 * still.measures.snr


@pytest.mark.parametrize(
    "changes, text",
    [
        ({"atmosphere__cn2": 1e-14}, "cn2 is turbulence of air; leave it out in vacuum"),
        (
            {"atmosphere__cn2": -1e-14},
            r"\[atmosphere\]: cn2 = -1e-14 m\^\(-2/3\); must lie in 0..1e-09",
        ),
        ({"atmosphere__wave": "round"}, "unknown wave 'round'; known: plane, spherical"),
        (
            {"atmosphere__table": "us_standard", "atmosphere__cn2": 1e-9},
            r"\[atmosphere\]: cn2 = 1e-09 spreads the light of a point over",
        ),
    ],
)
def test_unusable_turbulence(scenario, changes, text):
    with pytest.raises(InputError, match=text):
        image(scenario(**changes))


@pytest.mark.parametrize("nuc", [False, True])
def test_warm_optics(scenario, nuc):
    """As warm as the background, with a transmittance of 0.8: shot noise rises by sqrt(1 / 0.8).

    The temperatures of the image stay.
    """
    warm = {"optics_temperature": 294.0, "read_noise_e": 0.0, "bits": 16, "nuc": nuc}
    shared = {"sensor__optics_transmittance": 0.8}
    cold, hot = (
        image(scenario({"bits": 16, "read_noise_e": 0.0, "nuc": nuc} | camera, **shared))
        for camera in ({}, warm)
    )
    assert hot.measures.netd / cold.measures.netd == pytest.approx(np.sqrt(1 / 0.8), rel=2e-3)
    assert hot.measures.netd_measured / cold.measures.netd_measured == pytest.approx(
        np.sqrt(1 / 0.8), rel=0.02
    )
    # The glow is 0.2 / 0.8 of the background, which has the same temperature
    background = cold.measures.background
    assert hot.measures.glow == pytest.approx(background / 4, rel=1e-6)
    assert hot.measures.background == pytest.approx(background * 1.25, rel=1e-6)
    added = hot.channels["electrons.Y"] - cold.channels["electrons.Y"]
    assert added == pytest.approx(background / 4, rel=1e-4)
    means = [found.channels["mean_temperature.Y"] for found in (hot, cold)]
    assert means[0] == pytest.approx(means[1], abs=2e-3)
    error = (hot.channels["temperature.Y"] - means[0])[:, :10]
    assert abs(error.mean()) < 5 * hot.measures.netd / np.sqrt(error.size)
    assert error.std() == pytest.approx(hot.measures.netd, rel=0.15)


def test_light_falls_toward_the_corner(scenario):
    """Electrons fall as cos^4 and by vignetting; temperatures stay, and their noise grows."""
    wide = {"focal_length_mm": 1.0, "cos4": True, "vignetting": 0.2}
    wide |= {"read_noise_e": 0.0, "bits": 16}
    found = image(scenario(wide, observer__range_m=30))
    even = image(scenario(wide | {"cos4": False, "vignetting": 0.0}, observer__range_m=30))
    ratio = found.channels["electrons.Y"] / even.channels["electrons.Y"]
    illumination = found.scenario.camera.illumination
    assert ratio == pytest.approx(illumination, rel=1e-5) and illumination.min() < 0.5
    means = [one.channels["mean_temperature.Y"] for one in (found, even)]
    assert means[0] == pytest.approx(means[1], abs=1e-3)
    noises = [one.channels["noise_K.Y"][0, 0] for one in (found, even)]
    assert noises[0] / noises[1] == pytest.approx(illumination[0, 0] ** -0.5, rel=0.03)
    error = (found.channels["temperature.Y"] - means[0])[:8, :8]
    assert abs(error.mean()) < 5 * noises[0] / 8
    assert found.measures.peak_snr == pytest.approx(even.measures.peak_snr, rel=0.02)


def test_a_response_weighs_the_radiance(scenario, tmp_path):
    """`apparent.Y` and the scene are in the detector's band, as the contrast's intensity is."""
    (tmp_path / "half.csv").write_text("wavelength_um,response\n3,0\n3.5,0.5\n4.5,1\n5,0\n")
    changes = {"target__parameters": {"temperature": 300}}
    weighed = scenario(sensor__response=str(tmp_path / "half.csv"), **changes)
    found = image(weighed)
    detector = band(str(tmp_path / "half.csv"))
    outside, inside = (float(in_band_radiance(detector, T)) for T in (294.0, 300.0))
    assert found.channels["apparent.Y"][0, 0] == pytest.approx(outside, rel=1e-3)
    assert found.exposure.radiance.max() == pytest.approx(inside - outside, rel=1e-3)
    setting = setting_of(weighed)
    part = signature(setting.view, spp=64).target
    intensity = contrast(weighed).rows[-1].intensity
    assert part.intensity == pytest.approx(intensity.value, rel=1e-3)
    assert part.intensity == pytest.approx(inside * AREA, rel=5e-3)


@pytest.mark.parametrize(
    "projection, roll", [("perspective", 0.0), ("perspective", 30.0), ("orthographic", 0.0)]
)
def test_truth_of_a_frame(tmp_path, projection, roll):
    """Mask, depth and radiances of a plate: from its plane, Planck's law and the air's tables.

    The camera is 20 m away, its axis points to the right of the plate, and its pixels are wide.
    """
    camera = {"projection": projection, "roll_deg": roll, "right_deg": 3.0, "focal_length_mm": 5.0}
    more = {"atmosphere__table": "midlat_summer", "render__spp": 16, "observer__range_m": 20}
    more |= {f"camera__{name}": value for name, value in camera.items()}
    scenario = plate(tmp_path, 2.0, 1.45, **more)
    result = image(scenario, truth=True)
    layers = {name: values.astype(float) for name, values in result.truth.channels.items()}
    on, whole = layers["IndexOB.X"] == 1, layers["mask.Y"] == 1
    assert on[whole].all() and not on[layers["mask.Y"] == 0].any() and whole.sum() > 500
    assert abs(on.sum() - layers["mask.Y"].sum()) < 0.02 * on.sum()
    (row, column), pixel, s = np.indices(on.shape) + 0.5, 3e-3, np.tan(np.radians(3.0))
    cos, sin = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    x, y = pixel * (column - 32), pixel * (24 - row)
    level, above, h = cos * x + sin * y, cos * y - sin * x, np.hypot(1, s)
    if projection == "perspective":
        # The plate is the plane x = 0, and the ray (-1, s, 0) / h + level (s, 1, 0) / h + above z
        depth = 20 * h / (1 - s * level)
        places = np.stack([depth * (s + level) / h, depth * above])
        np.testing.assert_allclose(layers["Depth.Z"][on], depth[on], rtol=1e-6)
        distance = depth * np.sqrt(1 + x**2 + y**2)
    else:
        # All rays are parallel to the axis, from (20, 20 level / h, 20 above) + 20 s level / h x
        depth = (20 + 20 * s * level / h) * h
        places = np.stack([20 * level / h + depth * s / h, 20 * above])
        np.testing.assert_allclose(layers["Depth.Z"][on], depth[on], rtol=1e-6)
        distance = np.sqrt(depth**2 + (20 * level) ** 2 + (20 * above) ** 2)
    np.testing.assert_allclose(layers["range.Y"][on], distance[on], rtol=1e-6)
    np.testing.assert_array_equal(on, np.all(abs(places) < [[[1.0]], [[0.725]]], axis=0))
    np.testing.assert_allclose(layers["Normal.X"][on], 1, atol=1e-6)
    L, x = in_band_radiance(band("MWIR"), 300.0), np.linspace(3, 5, 20001)
    np.testing.assert_allclose(layers["emitted.Y"][whole], L, rtol=1e-5)
    np.testing.assert_array_equal(layers["target.Y"], layers["emitted.Y"])
    for place in map(tuple, np.argwhere(whole)[[0, 200, -1]]):
        transmittance, path = atmosphere("midlat_summer").path(distance[place]).at(x)
        mean = np.trapezoid(transmittance * spectral_radiance(x, 300.0), x) / L
        assert layers["transmittance.Y"][place] == pytest.approx(mean, rel=1e-3)
        assert layers["path.Y"][place] == pytest.approx(np.trapezoid(path, x), rel=3e-3)
    behind = in_band_radiance(band("MWIR"), 280.0)
    np.testing.assert_allclose(layers["background.Y"], (1 - layers["mask.Y"]) * behind, atol=1e-6)
    np.testing.assert_allclose(
        layers["transmittance.Y"] * layers["target.Y"] + layers["path.Y"] + layers["background.Y"],
        layers["apparent.Y"],
        rtol=1e-6,
    )
    # What the optics blur has the same sum
    blurred = result.channels["apparent.Y"].astype(float) - behind
    assert blurred.sum() == pytest.approx((layers["apparent.Y"] - behind).sum(), rel=0.02)
    plain = image(scenario)
    assert plain.truth is None and plain.header == result.header
    for name, values in plain.channels.items():
        np.testing.assert_allclose(values, result.channels[name], rtol=3e-7, err_msg=name)


def test_truth_of_a_target_below_a_pixel(tmp_path):
    """It is in the corner of four pixels, whose centres miss it, and its mask is still there."""
    truth = image(plate(tmp_path, 0.05, 0.04, render__spp=16), truth=True).truth
    share, pixel = truth.channels["mask.Y"].astype(float), 15e-6 / 0.1 * 1000
    assert share.sum() == pytest.approx(0.05 * 0.04 / pixel**2, rel=0.02)
    assert not truth.ids("instance").any()
    (annotation,) = truth.coco()["annotations"]
    assert annotation["bbox"] == [31, 23, 2, 2] and annotation["area"] == 4


def test_a_remark_on_all_pixels_says_100_percent(scenario):
    channels = {"speckle.Y": np.ones((2, 2), bool), "stderr_K.Y": np.full((2, 2), 14.0)}
    made = scenario(), SimpleNamespace(is_cut=False), SimpleNamespace(saturated=0.0)
    (line,) = remarks(made[0].camera, made[1], channels, made[2], None)
    assert "up to 14 K, is larger than the camera's noise in 100 % of the pixels" in line


def test_the_end_of_a_rendering_is_stated(scenario):
    """The largest number of paths is named where it ended the rendering, and what is above it."""
    for changes, words in (
        ({"render__tolerance": 1e-5, "render__max_spp": 2}, "ended by max_spp=2, rounded up for"),
        ({"render__tolerance": 0.5}, "paths through a pixel"),
    ):
        made = image(scenario(**changes))
        rendering = dict(measured_rows(made))["rendering"]
        assert rendering.endswith(words) or words + " each of its" in rendering


def test_channels_have_names_and_units(scenario):
    names = {
        name: (values.attrs["long_name"], values.attrs.get("units"))
        for name, values in image(scenario()).to_xarray().data_vars.items()
    }
    assert names["electrons.background"] == ("electrons without the target", None)
    assert names["apparent_W_m2_sr"] == ("radiance at the aperture", "W m-2 sr-1")
    assert names["noise_K"] == ("noise of the camera", "K")
