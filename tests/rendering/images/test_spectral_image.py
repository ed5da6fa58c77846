"""Spectral images against own quadratures, and their files."""

import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import spectral_radiance, spectral_temperature
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.rendering.images.render import pixel_charts as charts
from mi_lcair.rendering.images.render import pixel_spectrum
from mi_lcair.rendering.images.spectral import even_wavelengths
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.plugins.bins.test_by_bin import SPECTRA, X, integrator, plate, surface, thermal, write
from tests.plugins.small_scenes import blackbody, camera, scene


def hat_means(values, x, nodes):
    """Means of a spectrum, weighted with the triangles around the nodes."""
    step = nodes[1] - nodes[0]
    hats = np.maximum(1 - abs(x[:, None] - nodes) / step, 0)
    return np.trapezoid(values[:, None] * hats, x, axis=0) / np.trapezoid(hats, x, axis=0)


@pytest.mark.parametrize("bins", [5, 24])
def test_emission_and_reflection_by_wavelength(tmp_path, bins):
    """A plate in a closed room of blackbodies: epsilon L(T) + (1 - epsilon) L(T_0)."""
    file = write(tmp_path)
    room = {
        "type": "sphere",
        "radius": 30.0,
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
        "emitter": thermal(350.0),
    }
    image = mi_lcair.render(plate(file, "g", 500.0, bounces=1, room=room), spp=64, bins=bins)
    x = np.linspace(3, 5, 20001)
    emissivity = np.interp(x, X, SPECTRA["g"][0])
    expected = emissivity * spectral_radiance(x, 500.0)
    expected += (1 - emissivity) * spectral_radiance(x, 350.0)
    nodes = np.linspace(3, 5, bins)
    assert image.wavelengths_um == pytest.approx(nodes)
    assert image.cube.shape == (bins, 1, 1)
    close = 0.1 if bins == 5 else 2e-3  # 5 hats do not resolve the spectrum
    error = np.abs(image.cube[:, 0, 0] - hat_means(expected, x, nodes)).max()
    assert error < close * expected.max()
    assert image.channels["Y"][0, 0] == pytest.approx(np.trapezoid(expected, x), rel=close)


def test_every_pixel_has_its_own_bins(tmp_path):
    """A plate of one temperature has one spectrum in all pixels, and none beside it."""
    shapes = {
        "plate": {
            "type": "rectangle",
            "bsdf": surface(write(tmp_path), "g"),
            "emitter": thermal(400.0),
        }
    }
    loaded = mi_lcair.load(scene(integrator(0), camera(4, 4.0), **shapes))
    image = mi_lcair.render(loaded, spp=16, bins=6)
    Y = image.channels["Y"]
    assert (Y[1:3, 1:3] > 0).all() and (Y == 0).sum() == 12
    spectrum = image.cube[:, 1, 1] / Y[1, 1]
    assert image.cube == pytest.approx(spectrum[:, None, None] * Y, rel=1e-5)


@pytest.mark.parametrize("of", ["cube", "spectrum"])
def test_sums_that_do_not_fit_into_one_launch(tmp_path, monkeypatch, of):
    """Pixels, whose sums by wavelength take much memory, are then traced a few at a time."""

    def values():
        loaded = plate(write(tmp_path), "g", 500.0)
        if of == "cube":
            return mi_lcair.render(loaded, spp=16, bins=9).cube
        measurands = Measurands(Channels("model"), by_spectrum=True)
        windows = Windows(loaded.sensor(0), columns=4, rows=4)
        sums = measure(loaded, windows, Sampling(spp=64), measurands).sums
        return np.array([sums[name] for name in sums if name.startswith("source.")])

    whole = values()
    monkeypatch.setattr("mi_lcair.plugins.paths.path_tracer.MOST_SUMS", 400)
    np.testing.assert_allclose(values(), whole, rtol=1e-6)
    assert whole.any()


def test_scene_of_constant_materials(tmp_path):
    shapes = {
        "plate": {
            "type": "rectangle",
            "bsdf": {"type": "grey", "emissivity": 0.7},
            "emitter": thermal(400.0, "LWIR"),
        }
    }
    loaded = mi_lcair.load(scene(integrator(2), camera(4, 8.0), **shapes))
    image, plain = (mi_lcair.render(loaded, spp=16, bins=bins) for bins in (9, 0))
    assert image.channels["Y"] == pytest.approx(plain.channels["Y"], rel=1e-6)
    assert plain.wavelengths_um.size == 0 and plain.cube.shape == (0, 4, 4)
    x, share = np.linspace(8, 12, 20001), plain.channels["Y"] / blackbody(400.0, "LWIR")
    expected = hat_means(spectral_radiance(x, 400.0), x, np.linspace(8, 12, 9))
    assert image.cube == pytest.approx(expected[:, None, None] * share, rel=2e-5, abs=1e-9)


def test_files(tmp_path, monkeypatch):
    loaded = plate(write(tmp_path), "g", 500.0)
    image = mi_lcair.render(loaded, spp=16, bins=7)
    image.save(tmp_path / "cube.hdr")
    header = dict(
        line.split(" = ") for line in (tmp_path / "cube.hdr").read_text().splitlines()[1:]
    )
    shape = [int(header[name]) for name in ("bands", "lines", "samples")]
    cube = np.fromfile(tmp_path / "cube.img", "<f4").reshape(shape)
    assert np.array_equal(cube, image.cube)
    wavelengths = [float(x) for x in header["wavelength"].strip("{}").split(",")]
    assert wavelengths == pytest.approx(image.wavelengths_um)
    assert [float(x) for x in header["fwhm"].strip("{}").split(",")] == pytest.approx([2 / 6] * 7)
    image.save(tmp_path / "cube.exr")
    channels, attributes = read_exr(tmp_path / "cube.exr")
    assert channels["S0.3000,000000nm"] == pytest.approx(cube[0])
    assert channels["S0.3333,333333nm"] == pytest.approx(cube[1])
    assert attributes["spectralLayoutVersion"] == "1.0"
    assert "um^-1" in attributes["emissiveUnits"]
    assert ".hdr" not in mi_lcair.render(loaded, spp=4).suffixes()


def test_netcdf_with_brightness_temperatures(tmp_path):
    """A netCDF file has the cube, and the temperature at which Planck's law gives it."""
    xarray = pytest.importorskip("xarray")
    image = mi_lcair.render(plate(write(tmp_path), "g", 500.0), spp=16, bins=7)
    image.save(tmp_path / "cube.nc")
    with xarray.open_dataset(tmp_path / "cube.nc", engine="scipy") as file:
        assert file["spectral_radiance_W_m2_sr_um"].dims == ("wavelength_um", "row", "column")
        x, kelvin = file["wavelength_um"].values, file["brightness_temperature_K"].values[:, 0, 0]
        assert file["spectral_radiance_W_m2_sr_um"].values == pytest.approx(image.cube)
    assert spectral_radiance(x, kelvin) == pytest.approx(image.cube[:, 0, 0], rel=1e-6)
    assert spectral_temperature(4.0, 0.0) == 0


def test_wavelengths_set_the_band(tmp_path):
    assert even_wavelengths("8:12:0.1") == ("8-12", 41)
    assert even_wavelengths("8:12:0.075") == ("8-11.975", 54)
    for text in ("8:12", "12:8:0.1", "8:12:0", "8:12:x", "8:12:0.001", "0:4:1", "8:12:nan"):
        with pytest.raises(InputError, match="START:STOP:STEP"):
            even_wavelengths(text)
    output = str(tmp_path / "cube.hdr")
    common = ["render", "two_plates", "--spp", "4", "-o", output, "--wavelengths", "8:12:1"]
    assert CliRunner().invoke(main, common).exit_code == 0
    assert "wavelength = {8, 9, 10, 11, 12}" in (tmp_path / "cube.hdr").read_text()
    result = CliRunner().invoke(main, [*common, "--bins", "4"])
    assert result.exit_code == 2 and "leave out --bins" in result.output


def test_bad_numbers_of_wavelengths(tmp_path):
    loaded = plate(write(tmp_path), "g", 500.0)
    for bins in (1, -3, 1000):
        with pytest.raises(InputError, match="must lie in 2..512"):
            mi_lcair.render(loaded, spp=4, bins=bins)
    with pytest.raises(InputError, match="no air"):
        mi_lcair.render(loaded, spp=4, bins=4, atmosphere="us_standard", range_m=100.0)
    result = CliRunner().invoke(main, ["render", "open_box", "-o", str(tmp_path / "x.hdr")])
    assert result.exit_code == 2 and ".exr" in result.output


@pytest.mark.parametrize("surface", ["spectral", "constant"])
def test_errors_of_bins_are_the_scatter_of_images(tmp_path, surface):
    """The standard errors of pixels against the scatter of images with other seeds."""
    lamp = {
        "type": "sphere",
        "center": [1, 0, 2],
        "radius": 0.6,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
        "emitter": thermal(900.0, group="lamp"),
    }
    bsdf = {"type": "grey", "emissivity": 0.6} if surface == "constant" else "g"
    loaded = plate(write(tmp_path), bsdf, 300.0, bounces=1, lamp=lamp)
    wanted = {"spp": 64, "bins": 9, "errors_um": (3.0, 4.1)}
    images = [mi_lcair.render(loaded, seed=seed, **wanted).channels for seed in range(40)]
    for name in ("S0.3000,000000nm", "S0.4000,000000nm"):
        scatter = np.std([image[name] for image in images], ddof=1)
        stated = np.sqrt(np.mean([image[f"stderr.{name}"] ** 2 for image in images]))
        assert 0.6 < stated / scatter < 1.6  # 40 draws, each of 3 degrees of freedom
    assert "stderr.S0.3250,000000nm" not in images[0]


def test_errors_of_no_bins(tmp_path):
    loaded = plate(write(tmp_path), "g", 500.0)
    with pytest.raises(InputError, match="number of bins"):
        mi_lcair.render(loaded, spp=4, errors_um=[4.0])
    with pytest.raises(InputError, match=r"errors_um = 6 um; must lie in 3..5"):
        mi_lcair.render(loaded, spp=4, bins=4, errors_um=[6.0])
    with pytest.raises(InputError, match="errors_um = 4 must be a sequence"):
        mi_lcair.render(loaded, spp=4, bins=4, errors_um=4)
    for bins in ("x", 2.5, True):
        with pytest.raises(InputError, match=f"^bins = {bins!r}; must be a whole number, 2 to 512"):
            mi_lcair.render(loaded, spp=4, bins=bins)


def test_the_spectrum_of_a_pixel_is_drawn(tmp_path, monkeypatch):
    image = mi_lcair.render(plate(write(tmp_path), "g", 500.0), spp=16, bins=7, errors_um=[4.0])
    image.save(tmp_path / "cube.exr")
    radiance, temperature = charts(image.channels, (0, 0))
    assert radiance.x == pytest.approx(image.wavelengths_um)
    assert radiance.curves[0].values == pytest.approx(image.cube[:, 0, 0])
    assert np.isfinite(radiance.curves[0].errors).tolist() == [k == 3 for k in range(7)]
    assert spectral_radiance(radiance.x, temperature.curves[0].values) == pytest.approx(
        image.cube[:, 0, 0], rel=1e-5
    )
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, ["show", "cube.exr", "--pixel", "0", "0"])
    assert result.exit_code == 0 and (tmp_path / "cube_spectrum.png").is_file()
    result = CliRunner().invoke(main, ["show", "cube.exr", "--pixel", "0", "1"])
    assert result.exit_code == 2 and "outside the image" in result.output
    (section,) = (section for section in image.sections() if section.title == "Image")
    assert any("row 0 and column 0" in part for part in section.parts if isinstance(part, str))
    with pytest.raises(InputError, match="no spectral radiance"):
        pixel_spectrum(mi_lcair.render("two_plates", spp=4).channels, (0, 0), "")
