"""Pictures of blackbodies, of air and of skies: curves over wavelength and elevation."""

import numpy as np

from mi_lcair.charts import Curve, LineChart, by_wavelength, label
from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.sky import spectrum
from mi_lcair.show.line_charts import figure_of

SPECTRAL, IN_BAND = "W m-2 sr-1 um-1", "W m-2 sr-1"
RANGES_M = (1000.0, 5000.0)  # of paths through air
ELEVATIONS_DEG = np.array([0.5, 1, 2, 3, 5, 7.5, 10, 15, 20, 30, 45, 60, 75, 90])
KELVIN = Bounds(lower=10, upper=10_000, unit="K")
SPECTRA_DEG = (0.5, 10.0, 90.0)  # elevations whose spectrum is drawn


def blackbodies(temperatures: list[float], band: str):
    """Figure of the spectral radiance of blackbodies [K] (thesis Figs 2.1 and 4.3, Eq 2.2)."""
    limits = with_limits(band)
    for kelvin in temperatures:
        KELVIN.check(kelvin, "temperature of a blackbody")
    x = np.linspace(limits.lower_um, limits.upper_um, 500)
    curves = [
        Curve(f"{kelvin:g} K", spectral_radiance(x, kelvin), SPECTRAL, number or None)
        for number, kelvin in enumerate(temperatures)
    ]
    chart = by_wavelength(limits.label, x, "spectral radiance", SPECTRAL, curves)
    return figure_of([chart], "Blackbodies")


def air(name: str, band: str):
    """Figure of transmittance and path radiance of horizontal paths (thesis Figs 2.13, 2.14)."""
    limits = with_limits(band)
    path = atmosphere(name)
    if path.is_vacuum:
        raise InputError("vacuum has no curves: it transmits all and radiates nothing")
    inside = (path.wavelengths_um >= limits.lower_um) & (path.wavelengths_um <= limits.upper_um)
    path.check_covers(limits)
    x = path.wavelengths_um[inside]
    values = path.along(np.array(RANGES_M), np.flatnonzero(inside))
    charts = []
    units = {"transmittance": "1", "path radiance": SPECTRAL}
    for (quantity, unit), of_quantity in zip(units.items(), values):
        curves = [
            Curve(f"{range_m / 1000:g} km", row, unit, number or None)
            for number, (range_m, row) in enumerate(zip(RANGES_M, of_quantity))
        ]
        charts.append(by_wavelength("", x, quantity, unit, curves))
    return figure_of(charts, f"Horizontal paths through {name.replace('_', ' ')}, {limits.label}")


def sky(name: str, band: str):
    """Figure of a sky's spectrum, and its radiance against elevation (thesis Fig 3.29)."""
    limits = with_limits(band)
    x = np.linspace(limits.lower_um, limits.upper_um, 400)
    spectra = [
        Curve(f"{angle:g}°", spectrum(name, angle).at(x), SPECTRAL, number or None)
        for number, angle in enumerate(SPECTRA_DEG)
    ]
    values = np.array([spectrum(name, angle).in_band_radiance(limits) for angle in ELEVATIONS_DEG])
    charts = [
        by_wavelength("by wavelength", x, "radiance", SPECTRAL, spectra),
        LineChart(
            "by elevation",
            ELEVATIONS_DEG,
            "elevation (°)",
            label("in-band radiance", IN_BAND),
            [Curve(limits.name, values, IN_BAND)],
            from_zero=True,
        ),
    ]
    return figure_of(charts, f"Sky {name.replace('_', ' ')}, {limits.label}")


def with_limits(band: str) -> Band:
    """The band; raises InputError for the total one, which has no wavelengths."""
    limits = band_of(band)
    limits.check_limits("curve")
    return limits
