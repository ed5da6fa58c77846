"""Derivatives, budgets and inversions with scale, offset and slope of spectral materials."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.rendering.parameters.values import changed, parameters_of, set_values
from tests.knowing.inversion.plate import XML
from tests.plugins.bins.test_by_bin import (
    SPECTRA,
    X,
    integrator,
    planck,
    plate,
    surface,
    thermal,
    write,
)
from tests.plugins.small_scenes import blackbody, camera, scene

WAVELENGTHS = np.linspace(3, 5, 20001)
EMISSIVITY = np.interp(WAVELENGTHS, X, SPECTRA["g"][0])
# What a unit of each number adds to the emissivity
RATES = {"scale": EMISSIVITY, "offset": 1 + 0 * WAVELENGTHS, "slope": WAVELENGTHS - 4}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write(tmp_path_factory.mktemp("materials"))


def cavity(file, bounces=3):
    sphere = {
        "type": "sphere",
        "radius": 2.0,
        "flip_normals": True,
        "bsdf": surface(file, "g"),
        "emitter": thermal(500.0),
    }
    sensor = camera(2, 1.0, origin=(0, 0, 1))
    return mi_lcair.load(scene(integrator(bounces), sensor, sphere=sphere))


def in_band(values):
    """In-band radiance of a blackbody of 500 K whose spectrum is multiplied by values."""
    weight = planck(WAVELENGTHS, 500.0)
    mean = np.trapezoid(weight * values, WAVELENGTHS) / np.trapezoid(weight, WAVELENGTHS)
    return mean * blackbody(500, "MWIR")


@pytest.mark.slow
def test_cavity_in_closed_form(file):
    """1 - (1 - epsilon)^4 of L_bb, whose derivative is 4 (1 - epsilon)^3."""
    loaded, names = cavity(file), [f"g.{name}" for name in RATES]
    result = mi_lcair.sensitivities(loaded, [*names, "self.temperature"], spp=256)
    area = mi_lcair.signature(loaded, spp=4).window_area
    expected = [in_band(4 * (1 - EMISSIVITY) ** 3 * rate) for rate in RATES.values()]
    # The square and the cube of a hat are no hats
    assert result.derivative[:3] / area == pytest.approx(expected, rel=5e-3)
    share = 1 - (1 - EMISSIVITY) ** 4
    high, low = (np.trapezoid(planck(WAVELENGTHS, T) * share, WAVELENGTHS) for T in (501, 499))
    middle = np.trapezoid(planck(WAVELENGTHS, 500) * share, WAVELENGTHS)
    relative = result.derivative[3] / result.value
    assert relative == pytest.approx((high - low) / (2 * middle), rel=1e-3)
    assert set(result.method) == {"difference"}
    images = mi_lcair.derivative_images(loaded, names, spp=64)
    assert images.derivative.mean(axis=(1, 2)) == pytest.approx(expected, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a", "n", "m"])
def test_scale_is_that_of_the_spectrum(tmp_path, name):
    """A file with scaled columns gives the same change; of nk the derivative has limits."""
    near = {
        "near": {
            "type": "sphere",
            "center": [1, 0, 2],
            "bsdf": {"type": "grey", "emissivity": 0.9},
            "emitter": thermal(300.0),
        }
    }

    def loaded(factor, folder):
        folder.mkdir()
        columns = list(SPECTRA[name])
        columns[0] = columns[0] * factor
        file = write(folder, {name: columns})
        return plate(file, name, 450.0, bounces=2, **near)

    original = loaded(1.0, tmp_path / "original")
    with changed(original, {f"{name}.scale": 0.9}):
        result = mi_lcair.sensitivities(original, [f"{name}.scale"], spp=4096)
    ends = []
    for factor in (0.95, 0.85):
        if name == "m":  # without a file of its own: over a step that is 12 times longer
            with changed(original, {"m.scale": factor + 2 * (factor - 0.9)}):
                ends.append(mi_lcair.signature(original, spp=4096).target.intensity / 3)
        else:
            other = loaded(factor, tmp_path / f"{factor}")
            ends.append(mi_lcair.signature(other, spp=4096).target.intensity)
    assert result.derivative[0] == pytest.approx((ends[0] - ends[1]) / 0.1, rel=1e-2)


def test_bounds_and_bad_values(file):
    known = parameters_of(plate(file, "g", 400.0))
    emissivity = SPECTRA["g"][0][(X >= 3) & (X <= 5)]
    assert known["g.scale"].upper == pytest.approx(1 / emissivity.max(), rel=1e-3)
    assert known["g.offset"].lower == pytest.approx(-emissivity.min(), rel=1e-2)
    assert known["g.slope"].unit == "1/um" and known["g.slope"].value == 0
    with pytest.raises(InputError, match="g.scale = 3 is outside its bounds"):
        set_values(plate(file, "g", 400.0), {"g.scale": 3})


def test_facets_are_refused(file):
    with pytest.raises(InputError, match="average_K"):
        facet_matrix(plate(file, "g", 400.0), spp=4)


@pytest.mark.slow
def test_budget(file):
    """sigma = dI/dscale 0.1, by the emission of a plate."""
    loaded = plate(file, "g", 500.0)
    result = mi_lcair.budget(loaded, {"sigma": {"g.scale": "10%", "plate.temperature": 1}}, spp=64)
    area = mi_lcair.signature(loaded, spp=4).window_area
    (row,) = (row for row in result.rows if row.quantity == "g.scale")
    assert abs(row.contribution) == pytest.approx(0.1 * in_band(EMISSIVITY) * area, rel=1e-3)


@pytest.mark.slow
def test_inversion(file, tmp_path):
    """Scale and temperature of a plate from its image in two bands, with noise."""
    (tmp_path / "plate.xml").write_text(
        XML.replace('type="diffuse" id="paint"', 'type="material"')
        .replace(
            '<spectrum name="reflectance" value="$R"/>',
            f'<string name="material" value="g"/> <string name="band" value="$band"/>'
            f'<string name="materials" value="{file}"/>',
        )
        .replace('<default name="R" value="0.3"/>', "")
    )
    path, data = str(tmp_path / "plate.xml"), []
    truth = {"plate.temperature": 330.0, "g.scale": 0.8}
    for seed, limits in enumerate(("3-4", "4-5")):
        loaded = mi_lcair.load(path, band=limits, size=4)
        with changed(loaded, truth):
            image = mi_lcair.render(loaded, spp=64, seed=11).channels["Y"].astype(float)
        noise = np.random.default_rng(seed).standard_normal(image.shape)
        sigma = 2e-3 * float(image.mean())
        np.save(tmp_path / f"{seed}.npy", image + sigma * noise)
        data.append(
            {
                "scene": path,
                "parameters": {"band": limits, "size": 4},
                "image": str(tmp_path / f"{seed}.npy"),
                "quantity": "radiance",
                "sigma": sigma,
                "camera_sigma": "0",
                "model_sigma": "0",
            }
        )
    unknowns = {"plate.temperature": {"start": 320}, "g.scale": {}}
    solution = mi_lcair.invert({"data": data, "unknowns": unknowns, "render": {"spp": 4}})
    for answer, value in zip(solution.answers, truth.values()):
        assert abs(answer.value - value) < 4 * answer.standard_error
        assert answer.standard_error < 0.05 * value
