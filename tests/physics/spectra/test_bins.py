"""Hat functions of a band: fits, shares and the projected error, against own quadratures."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.physics import reflection
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.spectra.bins import (
    Binning,
    Bins,
    binning_error,
    bins_for,
    emissivities,
    filter_of,
    reflectances,
)
from mi_lcair.physics.spectra.parameters import SpectralParameters
from mi_lcair.rendering.measurands import Measurands

MWIR = band("MWIR")
X = np.linspace(2.9, 5.1, 23)


def grey(values):
    model = reflection.model("grey")
    return SpectralParameters(model, "standard", {}, X, {"emissivity": values}, "")


def painted(epsilon, rho_d, b=0.3, e=0.1):
    rows = {"epsilon": epsilon, "rho_d": rho_d}
    model = reflection.model("sandford_robertson")
    return SpectralParameters(model, "thesis", {"b": b, "e": e}, X, rows, "")


def metal(n, k, rho_d=0.2):
    common = {"alpha": 0.1, "gamma": 2.0, "rho_d": rho_d}
    model = reflection.model("microfacet")
    return SpectralParameters(model, "standard", common, X, {"n": n, "k": k}, "")


@pytest.mark.parametrize("count", [5, 16])
def test_hats_are_a_partition_with_even_nodes(count):
    bins = Bins(MWIR, count)
    assert np.allclose(bins.hats(bins.grid_um).sum(axis=1), 1)
    assert np.allclose(bins.hats(bins.nodes_um), np.eye(count))
    assert (bins.nodes_um[0], bins.nodes_um[-1]) == (3, 5)


def test_coefficients_are_a_least_squares_fit():
    bins = Bins(MWIR, 8)
    linear = 0.2 + 0.1 * bins.grid_um
    assert np.allclose(bins.coefficients(linear), 0.2 + 0.1 * bins.nodes_um, atol=1e-12)
    wave = 0.5 + 0.3 * np.sin(4 * bins.grid_um)
    residual = bins.hats(bins.grid_um) @ bins.coefficients(wave) - wave
    # The residual of the fit is orthogonal to every hat
    products = np.trapezoid(residual[:, None] * bins.hats(bins.grid_um), bins.grid_um, axis=0)
    assert abs(products).max() < 1e-10
    assert abs(wave[bins.grid_um == 3] - 0.5 - 0.3 * np.sin(12)) < 1e-12
    step = np.where(bins.grid_um > 4, 1.0, 0.0)
    fitted = bins.coefficients(step)
    assert fitted.min() == 0 and fitted.max() == 1  # clipped


def test_shares_are_those_of_the_in_band_radiance():
    bins = Bins(MWIR, 6)
    fine = np.linspace(3, 5, 400_001)
    shares = bins.shares(spectral_radiance(bins.grid_um, np.array([[300.0], [900.0]])))
    assert np.allclose(shares.sum(axis=1), 1)
    for row, T in zip(shares, (300.0, 900.0)):
        S = spectral_radiance(fine, T)
        hats = np.maximum(1 - abs(fine[:, None] - bins.nodes_um) / 0.4, 0)
        exact = np.trapezoid(S[:, None] * hats, fine, axis=0) / np.trapezoid(S, fine)
        assert np.allclose(row, exact, rtol=1e-5)
    assert not bins.shares(np.zeros(len(bins.grid_um))).any()
    assert np.allclose(bins.shares(np.full(len(bins.grid_um), 1e-20)).sum(), 1)


def test_shares_are_weighted_with_the_response():
    narrow = band("3.5-4.5")
    response = SimpleNamespace(
        lower_um=3.0, upper_um=5.0, response_at=lambda x: np.where(abs(x - 4) < 0.5, 2.0, 0.0)
    )
    wide, inside = Bins(response, 5), Bins(narrow, 3)  # nodes at 3.5, 4 and 4.5 in both
    S = [spectral_radiance(bins.grid_um, 500.0) for bins in (wide, inside)]
    assert wide.shares(S[0])[2] == pytest.approx(inside.shares(S[1])[1], rel=1e-3)


@pytest.mark.parametrize("count", [4, 16])
def test_binning_error_of_two_materials(count):
    """Emission, and emission reflected once, of grey materials in closed form."""
    a, b = 0.5 + 0.4 * np.sin(3 * X), 0.6 + 0.3 * np.cos(5 * X)
    bins = Bins(MWIR, count)
    S = spectral_radiance(bins.grid_um, np.array([[400.0]]))
    got = binning_error(bins, [grey(a), grey(b)], S)
    x, weight = bins.grid_um, S[0] / np.trapezoid(S[0], bins.grid_um)
    errors, hats = [], bins.hats(x)
    for own in (a, b):
        own = np.interp(x, X, own)
        emitted = np.trapezoid(weight * own, x)
        fitted = bins.coefficients(own)
        errors.append(abs(np.trapezoid(weight * (hats @ fitted), x) - emitted) / emitted)
        for other in (a, b):
            other = np.interp(x, X, other)
            of_bins = hats @ (fitted * (1 - bins.coefficients(other)))
            twice = np.trapezoid(weight * (of_bins - own * (1 - other)), x)
            errors.append(abs(twice) / emitted)
    assert got == pytest.approx(max(errors), rel=1e-2)


def test_binning_error_of_a_closed_room():
    """The error of a step that cancels in emission and one reflection grows with their number."""
    bins, reflections, x = Bins(MWIR, 64), 20, np.array([2.9, 4.62, 4.6201, 5.1])
    rows = {"emissivity": np.array([0.7, 0.7, 0.1, 0.1])}
    step = SpectralParameters(reflection.model("grey"), "standard", {}, x, rows, "")
    S = spectral_radiance(bins.grid_um, np.array([[400.0]]))
    exact = np.interp(bins.grid_um, x, rows["emissivity"])
    room = 1 - (1 - exact) ** (reflections + 1)
    of_bins = bins.hats(bins.grid_um) @ (1 - (1 - bins.coefficients(exact)) ** (reflections + 1))
    missed = 1 - np.trapezoid(S[0] * of_bins) / np.trapezoid(S[0] * room)
    assert missed > 0.01 > 100 * binning_error(bins, [step], S)
    assert binning_error(bins, [step], S, reflections) == pytest.approx(missed, rel=2e-2)


def test_reflectances_and_emissivities_of_the_models():
    x = np.array([3.0, 4.0, 5.0])
    ones = np.ones(len(X))
    paint = painted(0.4 * ones, 0.2 * ones)
    G = (1 - 0.09 + 0.09 * np.log(0.09)) / (1 - 0.09) ** 2  # Eq 2.18 for b = 0.3
    numbers = reflectances(paint, x)
    assert np.allclose(numbers, [0.6 / G, 0.2 / G])
    g = 1 / (1 + 0.09 * np.tan(np.radians([0, 45, 60, 75])) ** 2)
    assert np.allclose(emissivities(paint, numbers), 0.4 / G * g)
    numbers = reflectances(metal(3 * ones, 0 * ones), x)
    assert np.allclose(numbers[:, 0], 0.25)
    assert np.allclose(emissivities(metal(3 * ones, 0 * ones), numbers)[:, 0], 0.75 * (1 - 0.15))
    assert np.allclose(emissivities(grey(0.7 * ones), reflectances(grey(0.7 * ones), x)), 0.7)


def test_the_first_count_that_suffices_is_taken():
    def sources(x):
        return spectral_radiance(x, np.array([[400.0], [300.0]]))

    smooth, sharp = grey(0.5 + 0.02 * X), grey(0.5 + 0.4 * np.sin(9 * X))
    bins, error = bins_for(MWIR, [smooth], sources)
    assert bins.count == 16 and error < 2e-4
    bins, error = bins_for(MWIR, [sharp], sources)
    assert bins.count == 64 and error > 2e-4
    assert error < binning_error(Bins(MWIR, 32), [sharp], sources(Bins(MWIR, 2).grid_um))
    assert bins_for(MWIR, [sharp], sources, (9,))[0].count == 9


def test_a_tolerance_decides_on_the_bins():
    def sources(x):
        return spectral_radiance(x, np.array([[400.0]]))

    wavy, counts = grey(0.5 + 0.4 * np.sin(4 * X)), []
    for tolerance in (None, 0.1, 0.02, 0.005):
        binning = Measurands.of(None).binning(tolerance)
        bins, error = bins_for(MWIR, [wavy], sources, binning=binning)
        counts.append(bins.count)
        assert error <= binning.allowed or bins.count == 64
    assert counts == [64, 16, 32, 64]
    by_spectrum = Measurands.of(None, by_spectrum=True)
    # A spectrum of the result is as fine as without a tolerance
    assert by_spectrum.binning(0.1).allowed == 2e-4
    assert by_spectrum.binning(1e-4).allowed == pytest.approx(1e-5)


def test_bins_for_what_passes_the_air():
    """Lines of the air where the fit of the reflectance is too low count in its error."""
    wavy, bins = grey(0.5 + 0.4 * np.sin(4 * X)), Bins(MWIR, 16)
    residual = bins.hats(bins.grid_um) @ bins.coefficients(
        reflectances(wavy, bins.grid_um)[:, 0]
    ) - (0.5 - 0.4 * np.interp(bins.grid_um, X, np.sin(4 * X)))
    rows = np.linspace(3, 5, 4001)
    comb = np.where(residual > 0, 1.0, 0.0)
    detector = SimpleNamespace(response_at=lambda x: np.where(x < 4.9, 3.0, 0.0))
    air = filter_of(MWIR, detector, rows, comb)
    assert np.allclose(air, np.where(bins.grid_um < 4.9, 3 * comb, 0))
    assert set(filter_of(MWIR, detector, [], [])) == {0.0, 3.0}

    def sources(x):
        return spectral_radiance(x, np.array([[400.0]]))

    _, error = bins_for(MWIR, [wavy], sources, (16,), Binning(filters=(air,)))
    S = sources(bins.grid_um)[0] * air
    emissivity = np.interp(bins.grid_um, X, 0.5 + 0.4 * np.sin(4 * X))
    of_emission = (S @ residual) / (S @ emissivity)
    assert error >= 0.99 * of_emission
    assert error > 1.1 * bins_for(MWIR, [wavy], sources, (16,))[1]
    assert error == pytest.approx(binning_error(bins, [wavy], S[None]))
