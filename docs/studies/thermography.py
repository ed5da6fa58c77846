"""Compare temperatures of radiometric files with the makers' formula and with FLIR's software.

    python -m docs.studies.thermography FOLDER [DRAWS]

FOLDER is a checkout of github.com/gtatters/ThermimageCalibration: a photograph of a FLIR SC660, and
what ThermaCAM Researcher computed of it. The script writes docs/validation/thermography.md. With
1024 draws it takes a minute.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import qmc, truncnorm

import mi_lcair
from docs.studies.page import write_page
from tests.laboratory.test_thermography import NAMES, OWN, SETTINGS
from tests.rendering.images.flir_files import air_transmittance, counts_of, fff, kelvin_of

PAGE = Path("docs/validation/thermography.md")
# Exports of FLIR's software, and the conditions that were set there
EXPORTS = {
    "IguanaActualTemperatureE0.96Temps20Thermcam": {"emissivity": 0.96},
    "Iguana_E0.9": {"emissivity": 0.9},
    "Iguana_RT40": {"emissivity": 0.96, "reflected": 313.15, "air_temperature": 313.15},
    "Iguana_T0.7": {"emissivity": 0.96, "window": 0.7, "window_temperature": 293.15},
}
TRUTH = np.linspace(310.0, 420.0, 30)
SIGMA = dict(zip(NAMES, (0.03, 5.0, 0.1, 4.0, 4.0, 0.02, 3.0)))
MIDDLES = [
    (0.3, 30.0, 0.5, 290.0, 290.0, 0.9, 295.0),
    (0.8, 30.0, 0.5, 290.0, 290.0, 0.9, 295.0),
    (0.95, 100.0, 0.5, 285.0, 295.0, 0.9, 295.0),
]


def exported(folder: Path) -> str:
    """Rows of differences from the exports of FLIR's software."""
    images, rows = folder / "IguanaImageData", []
    for name, given in EXPORTS.items():
        celsius = np.loadtxt(images / f"{name}.csv", delimiter=",")
        photo, halves = images / "IguanaImage.jpg", air_transmittance(0.5, 0.5, 293.15) ** 2
        halves = {"transmittance": halves if "reflected" not in given else (
            air_transmittance(0.5, 0.5, 313.15) ** 2
        )}  # fmt: skip
        own, other = (
            mi_lcair.temperature(photo, **given, **more).kelvin - 273.15 - celsius
            for more in ({}, halves)
        )
        words = ", ".join(f"{key} {value:g}" for key, value in given.items())
        rows.append(f"| {words} | {own.mean():+.4f} | {abs(own).max():.3f} | {other.mean():+.3f} |")
    return "\n".join(rows)


def by_formula(folder: Path) -> str:
    """Rows of differences from the makers' formula, of files with known conditions."""
    path, rows = folder / "photo.fff", []
    for setting in SETTINGS:
        stated = dict(zip(NAMES, setting))
        counts = np.round([counts_of(T, stated) for T in TRUTH])
        path.write_bytes(fff([counts], **stated))
        formula = np.array([kelvin_of(n, stated) for n in counts])
        result = mi_lcair.temperature(path)
        window = {"window": stated["window"], "window_temperature": stated["window_K"]}
        off = result.kelvin[0] - formula
        planck = mi_lcair.temperature(
            path, "7.5-13", transmittance=result.transmittance, **window
        ).kelvin[0]
        cells = " | ".join(f"{value:g}" for value in setting)
        rows.append(
            f"| {cells} | {off.mean():+.1e} | {abs(off).max():.1e} "
            f"| {(planck - formula).mean():+.3f} |"
        )
    return "\n".join(rows)


def cut(mean: float, sigma: float, share: float, name: str) -> float:
    """Quantile of a normal distribution, which is cut off at 1 for two quantities."""
    end = (1 - mean) / sigma if name in ("emissivity", "window") else np.inf
    return float(truncnorm.ppf(share, -np.inf, end, mean, sigma))


def coverage(folder: Path, draws: int) -> str:
    """Rows of shares of intervals that hold the truth, of spots and of their differences."""
    path, truth, rows = folder / "photo.fff", (330.0, 312.0), []
    for middle in MIDDLES:
        stated, held = dict(zip(NAMES, middle)), []
        given = {OWN[name]: (stated[name], SIGMA[name]) for name in NAMES}
        for point in qmc.Sobol(len(NAMES), seed=3).random(draws):
            real = {name: cut(stated[name], SIGMA[name], u, name) for name, u in zip(NAMES, point)}
            path.write_bytes(fff([[round(counts_of(T, real)) for T in truth]]))
            result = mi_lcair.temperature(path, spots=["0,0", "1,0"], **given)
            tables = result.regions, result.differences
            low, high = (np.append(tables[0][e][:2], tables[1][e]) for e in ("from_K", "to_K"))
            held.append((low <= (*truth, 18.0)) & ((*truth, 18.0) <= high))
        shares = " | ".join(f"{100 * share:.1f} %" for share in np.mean(held, axis=0))
        rows.append(f"| {' | '.join(f'{value:g}' for value in middle)} | {shares} |")
    return "\n".join(rows)


def air() -> str:
    """Rows of transmittances by the camera's coefficients, and of computed air in two bands."""
    rows = []
    for metres in (1, 3, 10, 30, 100, 300):
        given = {"distance": metres, "humidity": 0.5, "air_temperature": 293.15}
        computed = [
            mi_lcair.temperature(330.0, band, emissivity=1, **given).transmittance
            for band in ("7.5-13", "7.5-14")
        ]
        values = (air_transmittance(metres, 0.5, 293.15), *computed)
        rows.append(f"| {metres} | {' | '.join(f'{value:.4f}' for value in values)} |")
    return "\n".join(rows)


def main(checkout: str, draws: int = 1024) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_page(
            PAGE,
            "thermography",
            exported=exported(Path(checkout)),
            formula=by_formula(folder),
            air=air(),
            coverage=coverage(folder, draws),
            draws=draws,
            sigma=", ".join(f"{OWN[name].replace('_', ' ')} {s:g}" for name, s in SIGMA.items()),
        )


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
