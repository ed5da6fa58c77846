"""Spectral entries of a materials file, and their averages against own quadratures."""

import json

import drjit as dr
import numpy as np
import pytest
from drjit.llvm.ad import Float64
from scipy.constants import c, h, k

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.spectra.parameters import (
    CHANGES,
    NODES,
    Change,
    fresnel_reflectance,
    spectral_parameters,
)

MWIR = band("MWIR")


def planck(wavelengths_um, temperature):
    x = wavelengths_um * 1e-6
    return x**-5 / np.expm1(h * c / (x * k * temperature))


def fresnel(n, k, cos):
    """Unpolarised reflectance by Fresnel's equations with complex numbers."""
    m = n + 1j * k
    q = np.sqrt(m**2 - 1 + cos**2)
    r_s, r_p = (cos - q) / (cos + q), (m**2 * cos - q) / (m**2 * cos + q)
    return (abs(r_s) ** 2 + abs(r_p) ** 2) / 2


def write(folder, entry, **files):
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    path = folder / "own.toml"
    path.write_text(f"[own.spectral]\n{entry}\n")
    return path


def csv(header, *columns):
    return header + "\n" + "\n".join(",".join(f"{x:.15g}" for x in row) for row in zip(*columns))


NK = 'model = "microfacet"\nalpha = 0.1\ngamma = 2\nrho_d = 0\nnk = "nk.csv"'
SR = 'b = 0.16\ne = 0.05\nspectrum = "sr.csv"'
GREY = 'emissivity = "grey.csv"'


@pytest.mark.parametrize("temperature", [250.0, 800.0])
@pytest.mark.parametrize("seed", range(3))
def test_average_of_an_index_is_that_of_the_reflectance(tmp_path, seed, temperature):
    rng = np.random.default_rng(seed)
    x = np.linspace(2.9, 5.1, 24)
    n, extinction = 2 + 1.5 * rng.random() * (x - 3), 5 + 3 * rng.random() * (x - 3)
    path = write(tmp_path, NK, nk=csv("wavelength_um,n,k", x, n, extinction))
    entry = material("own", MWIR, path).averaged(MWIR, temperature)
    fine = np.linspace(3, 5, 20001)
    weight = planck(fine, temperature)
    for cos in (1.0, 0.5, 0.1):
        F = fresnel(np.interp(fine, x, n), np.interp(fine, x, extinction), cos)
        mean = np.trapezoid(weight * F, fine) / np.trapezoid(weight, fine)
        got = fresnel(entry.parameters["n"], entry.parameters["k"], cos)
        assert got == pytest.approx(mean, abs=2e-3)
    assert entry.parameters["alpha"] == 0.1


@pytest.mark.parametrize("text,names", [(SR, ("epsilon", "rho_d")), (GREY, ("emissivity",))])
def test_averages_of_linear_parameters(tmp_path, text, names):
    x = np.array([2.5, 3.5, 4.2, 6.0])
    columns = [np.array([0.6, 0.7, 0.5, 0.8]), np.array([0.1, 0.2, 0.15, 0.1])][: len(names)]
    header = "wavelength_um," + ",".join(names)
    path = write(tmp_path, text, sr=csv(header, x, *columns), grey=csv(header, x, *columns))
    entry = material("own", MWIR, path).averaged(MWIR, 400.0)
    fine = np.linspace(3, 5, 20001)
    weight = planck(fine, 400.0)
    for name, values in zip(names, columns):
        mean = np.trapezoid(weight * np.interp(fine, x, values), fine)
        mean /= np.trapezoid(weight, fine)
        assert entry.parameters[name] == pytest.approx(mean, rel=1e-6)
    given = material("own", MWIR, path).spectrum.at(np.array([3.0]))
    assert given[names[0]] == pytest.approx((columns[0][0] + columns[0][1]) / 2)


def fit_of(folder, b, e, epsilon, rho_d):
    parameters = {"epsilon": epsilon, "rho_d": rho_d, "b": b, "e": e}
    fit = {"kind": "fit", "form": "thesis", "band": "MWIR", "parameters": parameters}
    (folder / "paint.json").write_text(json.dumps(fit))


@pytest.mark.parametrize("seed", range(4))
def test_DHR_there_and_back(tmp_path, seed):
    rng = np.random.default_rng(seed)
    b, e, epsilon, theta = *rng.uniform(0.05, 0.4, 3), rng.uniform(0, 50)
    fit_of(tmp_path, b, e, epsilon, rng.uniform(0, 0.3))
    x, DHR = np.linspace(2.5, 5.5, 7), rng.uniform(0.25, 0.6, 7)
    entry = f'shape = "paint.json"\ndhr = "dhr.csv"\ndhr_theta_deg = {theta}'
    path = write(tmp_path, entry, dhr=csv("wavelength_um,reflectance", x, DHR))
    own = material("own", MWIR, path)
    assert own.spectrum.remarks == ()
    # The share of the diffuse floor in what is reflected is that of the fit
    fit = json.loads((tmp_path / "paint.json").read_text())["parameters"]
    G = float(sr.G(Float64(b))[0])
    rows = own.spectrum.rows
    assert rows["rho_d"] / (G - rows["epsilon"]) == pytest.approx(
        fit["rho_d"] / (G - fit["epsilon"])
    )
    for place, values in enumerate(zip(*own.spectrum.at(x).values())):
        S = own.model.surface(*map(Float64, values), form="thesis")
        assert own.model.DHR(S, Float64(np.radians(theta)))[0] == pytest.approx(
            DHR[place], rel=1e-9
        )


def test_DHR_that_a_shape_cannot_have_is_clipped_and_said(tmp_path):
    fit_of(tmp_path, 0.2, 0.05, 0.5, 0.2)
    path = write(
        tmp_path,
        'shape = "paint.json"\ndhr = "dhr.csv"',
        dhr=csv("wavelength_um,reflectance", [2, 4, 6], [0.9999, 0.5, 0.3]),
    )
    spectrum = material("own", MWIR, path).spectrum
    assert spectrum.rows["epsilon"][0] == 0
    assert "33% of its wavelengths" in spectrum.remarks[0]
    size = float(spectrum.remarks[0].rpartition("up to ")[2])
    assert 0 < size < 0.1  # DHR 0.9999 needs an epsilon a little below 0


@pytest.mark.parametrize("n,k", [(0.4, 1.2), (1.5, 0.0), (3.0, 8.0)])
def test_facets_reflect_by_fresnel(tmp_path, n, k):
    path = write(tmp_path, NK, nk=csv("wavelength_um,n,k", [2.0, 6.0], [n, n], [k, k]))
    cos = np.array([0.05, 0.5, 0.9, 1.0])
    spectrum = material("own", MWIR, path).spectrum
    got = spectrum.facet_reflectance(np.array([3.0, 4.0]), cos)
    assert got == pytest.approx(np.tile(fresnel(n, k, cos), (2, 1)), rel=1e-9)


def test_radiation_too_cold_for_the_band_averages_evenly(tmp_path):
    path = write(tmp_path, GREY, grey=csv("wavelength_um,emissivity", [2, 6], [0.2, 1.0]))
    entry = material("own", MWIR, path)
    for averaged in (entry, entry.averaged(MWIR, 1.0)):
        assert averaged.parameters["emissivity"] == pytest.approx(0.6)


@pytest.mark.parametrize("emissivity", [0.0, 1.0])
def test_averages_of_ends(tmp_path, emissivity):
    """A blackbody at all wavelengths has an emissivity of 1, and not of rounding above it."""
    x = np.arange(2.5, 5.6, 0.1)
    table = csv("wavelength_um,emissivity", x, np.full(len(x), emissivity))
    path = write(tmp_path, GREY, grey=table)
    for temperature in (None, 300.0, 401.7):
        mean = material("own", MWIR, path).spectrum
        assert mean.averaged(*mean.weights(MWIR, temperature)) == (emissivity,)


def test_shape_that_absorbs_all_has_no_floor(tmp_path):
    G = float(sr.G(Float64(0.2))[0])
    fit_of(tmp_path, 0.2, 0.05, G, 0.0)
    text = csv("wavelength_um,reflectance", [2, 6], [0.4, 0.4])
    path = write(tmp_path, 'shape = "paint.json"\ndhr = "dhr.csv"', dhr=text)
    assert not material("own", MWIR, path).spectrum.rows["rho_d"].any()


def test_digest_changes_with_everything(tmp_path):
    digests = set()
    for e, value in ((0.05, 0.5), (0.06, 0.5), (0.05, 0.51)):
        text = csv("wavelength_um,epsilon,rho_d", [2, 6], [value, value], [0.1, 0.1])
        path = write(tmp_path, SR.replace("0.05", str(e)), sr=text)
        digests.add(material("own", MWIR, path).spectrum.digest)
    assert len(digests) == 3


def test_an_average_is_compared_with_the_farther_temperature(tmp_path):
    path = write(tmp_path, GREY, grey=csv("wavelength_um,emissivity", [2, 6], [0.2, 1.0]))
    spectrum = material("own", MWIR, path).spectrum
    for temperature, other in ((300.0, 800), (450.0, 800), (600.0, 300), (1200.0, 300)):
        assert f"for {other} K it would" in spectrum.remark_on_average(MWIR, temperature)


def test_constant_outside_the_rows(tmp_path):
    """Asked for, the first and the last row hold beyond them, and a remark says how far."""
    (tmp_path / "grey.csv").write_text("wavelength_um,emissivity\n3.5,0.4\n4.5,0.8\n")
    entry = {"emissivity": "grey.csv"}
    with pytest.raises(InputError, match="3.5-4.5 um and does not cover"):
        spectral_parameters("own", entry, tmp_path).check_covers(MWIR, "own")
    spectrum = spectral_parameters("own", entry | {"outside": "constant"}, tmp_path)
    spectrum.check_covers(MWIR, "own")
    assert spectrum.at(np.array([3.0, 4.0, 5.0]))["emissivity"] == pytest.approx([0.4, 0.6, 0.8])
    assert "3.5-4.5 um" in spectrum.remarks_in(MWIR)[-1] and "50%" in spectrum.remarks_in(MWIR)[-1]
    assert spectrum.remarks_in(band("3.6-4.4")) == spectrum.remarks
    with pytest.raises(InputError, match="outside = 'linear'; must be"):
        spectral_parameters("own", entry | {"outside": "linear"}, tmp_path)


BAD = {
    "epsilon at 6 um = 1.02; must lie in 0..1": (
        SR.replace("sr.csv", "grey.csv"),
        csv("wavelength_um,epsilon,rho_d", [2, 6], [0.5, 1.02], [0.1, 0]),
    ),
    "dhr_theta_deg = 90": (
        'shape = "paint.json"\ndhr = "grey.csv"\ndhr_theta_deg = 90',
        csv("wavelength_um,reflectance", [2, 6], [0.5, 0.5]),
    ),
    "does not cover band MWIR 3-5 um": (
        GREY,
        csv("wavelength_um,emissivity", [3.1, 5], [0.5, 0.6]),
    ),
    "give one of nk, spectrum, dhr, emissivity; found none": ("b = 0.1", ""),
    "lacks b": ('e = 0.1\nspectrum = "grey.csv"', ""),
    "unknown key 'bb'": (GREY + "\nbb = 1", ""),
    "alpha = 'x'; must be a finite number": (NK.replace("0.1", '"x"'), ""),
    "a spectrum by `nk` is microfacet": (NK.replace('"microfacet"', '"grey"'), ""),
    "at 3 um: sandford_robertson: epsilon + rho_d": (
        SR.replace("sr.csv", "grey.csv"),
        csv("wavelength_um,epsilon,rho_d", [2, 3, 6], [0.5, 0.9, 0.5], [0.1, 0.4, 0.1]),
    ),
    "`dhr` needs `shape`": ('dhr = "grey.csv"', ""),
    "write emissivity = 'grey.csv', which takes a reflectance too": ('dhr = "grey.csv"', ""),
}


@pytest.mark.parametrize("says", BAD)
def test_bad_entries_are_one_line(tmp_path, says):
    entry, text = BAD[says]
    path = write(tmp_path, entry, grey=text)
    fit_of(tmp_path, 0.2, 0.05, 0.5, 0.2)
    with pytest.raises(InputError) as error:
        material("own", MWIR, path)
    assert says in str(error.value) and "own" in str(error.value)


@pytest.mark.parametrize("column", ["reflectance", "dhr"])
def test_the_emissivity_may_be_given_as_a_reflectance(tmp_path, column):
    text = csv(f"wavelength_um,{column}", [2, 6], [0.5, 0.1])  # 0.4 to 0.2 in 3-5 um
    entry = material("own", MWIR, write(tmp_path, GREY, grey=text))
    assert entry.parameters["emissivity"] == pytest.approx(0.7, rel=1e-12)


def test_a_spectrum_serves_before_an_entry_for_the_band(tmp_path):
    text = csv("wavelength_um,emissivity", [2, 6], [0.5, 0.5])
    path = write(tmp_path, GREY, grey=text)
    path.write_text(path.read_text() + '[own.LWIR]\nmodel = "grey"\nemissivity = 0.25\n')
    assert material("own", MWIR, path).spectrum is not None
    assert material("own", band("LWIR"), path).parameters == {"emissivity": 0.25}
    with pytest.raises(InputError, match="MWIR|total|1-3"):
        material("own", band("SWIR"), path)


def mean_emissivity(temperature):
    fine = np.linspace(3, 5, 20001)
    weight = planck(fine, temperature)
    return np.trapezoid(weight * (0.2 + 0.2 * (fine - 2)), fine) / np.trapezoid(weight, fine)


def test_a_scene_takes_the_average_and_says_its_size(tmp_path):
    path = write(tmp_path, GREY, grey=csv("wavelength_um,emissivity", [2, 6], [0.2, 1.0]))
    scene = """<scene version="3.0.0"> <integrator type="bounce_path"/>
      <sensor type="orthographic"> <film type="hdrfilm"> <integer name="width" value="1"/>
      <integer name="height" value="1"/> <rfilter type="box"/> </film> </sensor>
      <shape type="rectangle"> <bsdf type="material"> <string name="material" value="own"/>
      <string name="materials" value="FILE"/> <string name="band" value="MWIR"/> AVERAGE </bsdf>
      <emitter type="thermal"> <string name="band" value="MWIR"/>
      <float name="temperature" value="500"/> </emitter> </shape> </scene>"""
    file = tmp_path / "scene.xml"
    average = '<float name="average_K" value="800"/>'
    file.write_text(scene.replace("FILE", str(path)).replace("AVERAGE", average))
    (surface,) = mi_lcair.load(file).surfaces()
    assert surface.values[0] == pytest.approx(mean_emissivity(800.0), rel=1e-6)
    (note,) = [note for note in mi_lcair.load(file).notes if "averaged" in note]
    assert all(f"{1 - mean_emissivity(T):.4g}" in note for T in (300.0, 800.0))


# Changes of a spectrum: what they add, and the range in which nothing is clipped
# -------------------------------------------------------------------------------

X, MOST = np.linspace(3, 5, 61), 0.95


@pytest.fixture(params=range(3))
def random(request):
    return np.random.default_rng(request.param)


def test_what_is_added(random):
    """The offset and the slope about the middle; the nodes hold what they say."""
    absorbed, nodes = random.uniform(0.3, 0.7, (len(X), 2)), random.normal(0, 0.02, NODES)
    scale, offset, slope = 1.1, 0.03, -0.02
    change = Change((3, 5), scale, offset, slope, tuple(nodes))
    added = change.of(X, absorbed, 1.0) - scale * absorbed
    assert np.ptp(added, axis=1) == pytest.approx(0)
    at_nodes = np.interp(change.nodes_um, X, added[:, 0])
    line = offset + slope * (change.nodes_um - 4)
    # A node lies between two of the wavelengths, where the spline is not straight
    assert at_nodes - line == pytest.approx(nodes, abs=1e-3)
    assert np.array_equal(change.of(X, 9 + absorbed, MOST), np.full_like(absorbed, MOST))
    assert Change((3, 5)).of(X, absorbed, 1.0) is absorbed


@pytest.mark.parametrize("name", [*CHANGES, "2"])
def test_clipping_begins_at_the_bounds(random, name):
    absorbed = random.uniform(0.3, 0.7, (len(X), 4))
    nodes = tuple(random.normal(0, 0.01, NODES))
    change = Change((3, 5), 1.05, 0.02, 0.01, nodes)
    low, high = change.bounds(name, X, absorbed, MOST)
    assert low < high
    for end in (low, high):
        values = change.replaced(name, end).unclipped(X, absorbed)
        assert values.min() > -1e-9 and values.max() < MOST + 1e-9
        assert min(abs(values).min(), abs(values - MOST).min()) < 1e-9


def test_memory_of_numpy_is_not_read_in_packets():
    """The last packet would reach beyond the array, where the process may have no memory.

    NumPy's large arrays begin 16 bytes after a page, so that such a kernel reads unaligned ones.
    """
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        many = fresnel_reflectance(np.full((3001, 1), 1.5), 0.0, np.linspace(0, 1, 65))
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert kernels and not any("_p3, align 1," in k["ir"].getvalue() for k in kernels)
    assert many.shape == (3001, 65) and many[:, -1] == pytest.approx(0.04)
