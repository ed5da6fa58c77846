"""How well does clear air agree with LOWTRAN7? The page docs/validation/air.md; every number on it
is computed here.

    python -m docs.studies.air [PAGE]

LOWTRAN7's own in-band values, at geometries that are in no table of the product, are those of
tests/physics/air/lowtran7.csv. Takes half a minute.
"""

import csv
import sys
import time
from pathlib import Path

import numpy as np

from docs.studies.page import write_page
from mi_lcair.physics.air.atmosphere import AirLight
from mi_lcair.physics.air.clear_air import SunDirection, clear_air
from mi_lcair.physics.air.levels import Weather, bands, model_names
from mi_lcair.physics.bands import band

LOWTRAN7 = Path(__file__).parents[2] / "tests/physics/air/lowtran7.csv"
IN_WEATHER = LOWTRAN7.with_name("lowtran7_weather.csv")
X = bands().wavelengths_um
BANDS = "MWIR", "LWIR"
KINDS = {
    "sky": "night sky, radiance",
    "sky_transmittance": "the same, transmittance to space",
    "day_sky": "day sky in MWIR, total",
    "sun": "direct sun",
    "transmittance": "path between two heights, transmittance",
    "path_up": "path radiance, seen from below",
    "path_down": "path radiance, seen from above",
}
KINDS_IN_WEATHER = {
    "sky": "night sky, radiance",
    "sky_transmittance": "the same, transmittance to space",
    "day_sky": "day sky in MWIR, total",
    "reflected_sun": "sunlight that the ground reflects, seen from .5 to 8 km",
}
RANGES_KM = 0.5, 2.0, 5.0, 10.0


def spectrum(kind: str, name: str, a: float, b: float, c: float, d: float) -> np.ndarray:
    """Spectrum of a case; its geometry is that of the table's header."""
    air = clear_air(name)
    if kind == "sky":
        return air.sky(1000 * a, b).radiance
    if kind == "sky_transmittance":
        return bands().transmittance(air.ray(1000 * a, b).amounts[-1])
    if kind == "sun":
        return air.sun(1000 * a, b).radiance
    if kind == "day_sky":
        return air.sky(1000 * a, c, SunDirection(b, d)).radiance
    along = air.ray(1000 * a, c, 1000 * d)
    if kind == "transmittance":
        return bands().transmittance(along.amounts[-1])
    if kind == "path_down":
        end, turned = 1000 * along.heights_km[-1], -along.elevations_deg[-1]
        along = air.ray(end, turned, 1000 * d)
    return air.emitted(along).radiance


def rows_of(file: Path) -> list[dict[str, str]]:
    """The rows of a table without its comments."""
    lines = file.read_text().splitlines()
    return list(csv.DictReader(line for line in lines if line[0] != "#"))


def in_weather(row: dict[str, str]) -> float:
    """In-band value of a case in other weather; its columns are those of the table's header."""
    names = "temperature", "humidity", "pressure", "visibility", "co2"
    air = clear_air(row["air"], Weather(**{name: float(row[name]) for name in names if row[name]}))
    rule, height_m, elevation = band(row["band"]), 1000 * float(row["height"]), row["elevation"]
    along = air.ray(height_m, float(elevation))
    if row["kind"] == "sky":
        return rule.integral(X, air.emitted(along).radiance)
    if row["kind"] == "sky_transmittance":
        through = bands().transmittance(along.amounts[-1])
        return rule.integral(X, through) / rule.integral(X, np.ones_like(X))
    sun = float(row["sun"])
    if row["kind"] == "day_sky":
        light = air.emitted(along, SunDirection(sun, float(row["azimuth"])))
        return rule.integral(X, light.radiance)
    seen = air.sun(0.0, sun).through(along.amounts[-1]) / np.pi  # white ground
    return np.sin(np.radians(sun)) * rule.integral(X, seen)


def weather_errors() -> dict[tuple[str, str], np.ndarray]:
    """Relative errors of in-band values in other weather, by kind and air."""
    found = {}
    for row in rows_of(IN_WEATHER):
        error = in_weather(row) / float(row["value"]) - 1
        found.setdefault((row["kind"], row["air"]), []).append(error)
    return {key: np.array(values) for key, values in found.items()}


def errors() -> dict[tuple[str, str], np.ndarray]:
    """Relative errors of in-band values, by kind and air."""
    found = {}
    for row in rows_of(LOWTRAN7):
        kind, name, rule = row["kind"], row["air"], band(row["band"])
        if kind not in KINDS:
            continue
        value = rule.integral(X, spectrum(kind, name, *(float(row[key]) for key in "abcd")))
        if "transmittance" in kind:
            value /= rule.integral(X, np.ones_like(X))
        found.setdefault((kind, name), []).append(value / float(row["value"]) - 1)
    return {key: np.array(values) for key, values in found.items()}


def product_over_sum(light: AirLight, name: str) -> list[str]:
    """In-band product of transmittances over summed amounts, less 1, of the RANGES_KM, per cent."""
    cells = []
    for rule in map(band, BANDS):
        for length in RANGES_KM:
            amounts = clear_air(name).ray(50.0, 0.0, 1000 * length).amounts[-1]
            product = rule.integral(X, light.radiance * bands().transmittance(amounts))
            cells.append(f"{100 * (product / rule.integral(X, light.through(amounts)) - 1):+.0f}")
    return cells


def milliseconds() -> float:
    """Time of a processor for a sky of 12 rings, the sun, and a path by day."""
    air, durations = clear_air("us_standard"), []
    for _ in range(5):
        start = time.process_time()
        for elevation in np.linspace(3, 87, 12):
            air.sky(50.0, elevation)
        air.sun(50.0, 45.0)
        air.emitted(air.ray(50.0, 10.0, 5000.0), SunDirection(45.0, 60.0))
        durations.append(time.process_time() - start)
    return 1000 * min(durations)


def main(page: Path) -> None:
    """Write the page."""
    cell = lambda values: f"{100 * abs(values).max():.2f} ({100 * np.median(abs(values)):.3f})"
    rows, weather = (
        "\n".join(
            f"| {words} | {sum(len(found[kind, name]) for name in model_names())} | "
            + " | ".join(cell(found[kind, name]) for name in model_names())
            + " |"
            for kind, words in kinds.items()
        )
        for found, kinds in ((errors(), KINDS), (weather_errors(), KINDS_IN_WEATHER))
    )
    lights = {
        "sun at 45 degrees": lambda air: air.sun(50.0, 45.0),
        "night sky at 45 degrees": lambda air: air.sky(50.0, 45.0),
    }
    products = "\n".join(
        f"| {words} | {name} | {' | '.join(product_over_sum(light(clear_air(name)), name))} |"
        for words, light in lights.items()
        for name in model_names()
    )
    write_page(
        page,
        "air",
        airs=" | ".join(model_names()),
        rows=rows,
        weather=weather,
        products=products,
        milliseconds=f"{milliseconds():.0f}",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/air.md"))
