"""How well are slant paths interpolated? The page docs/validation/slant.md; every number on it is
computed here.

    python -m docs.studies.slant [PAGE]

Each inner elevation and each inner range of the bundled tables is left out, and predicted by the
others; so is each inner range of the tables of horizontal paths. Takes half a minute.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from docs.studies.page import write_page
from mi_lcair.physics.atmosphere import Atmosphere, atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.slant.air import PREFIX, SlantAir, slant_air, slant_names
from mi_lcair.physics.slant.geometry import height_along

BANDS = ("MWIR", "LWIR")
WIDTH_UM = 0.5  # width of the narrow bands, um
QUANTITIES = ("transmittance", "up", "down")


@dataclass(frozen=True)
class Row:
    """Largest relative errors of the in-band values where a row of the table was left out.

    what: the row. errors: by (quantity, band).
    """

    what: str
    errors: dict[tuple[str, str], float]


def largest_errors(air: SlantAir, fewer: SlantAir, elevations, ranges) -> dict:
    """Largest relative errors of `fewer` against the table `air`, by (quantity, band)."""
    errors = dict.fromkeys([(name, window) for name in QUANTITIES for window in BANDS], 0.0)
    for elevation in elevations:
        lines = {"up": fewer.along(elevation, True), "down": fewer.along(elevation, False)}
        for length in ranges:
            paths = {name: line.path(length) for name, line in lines.items()}
            values = {name: path.radiance for name, path in paths.items()}
            values["transmittance"] = paths["up"].transmittance
            entry = air.elevations_deg == elevation, air.ranges_m == length
            for name, window in errors:
                weights = band(window).row_weights(air.wavelengths_um)
                expected = getattr(air, name)[entry][0] @ weights
                error = abs(values[name] @ weights / expected - 1)
                errors[name, window] = max(errors[name, window], float(error))
    return errors


def kept(air: SlantAir, elevations: np.ndarray, ranges: np.ndarray) -> SlantAir:
    """The part of a table at some of its elevations and ranges, as arrays of booleans."""
    return replace(
        air,
        elevations_deg=air.elevations_deg[elevations],
        ranges_m=air.ranges_m[ranges],
        **{name: getattr(air, name)[elevations][:, ranges] for name in QUANTITIES},
    )


def without_elevation(air: SlantAir, elevation_deg: float) -> Row:
    """The errors of leaving out an elevation of a table."""
    fewer = kept(air, air.elevations_deg != elevation_deg, air.ranges_m > 0)
    return Row(
        f"elevation {elevation_deg:g} degrees",
        largest_errors(air, fewer, [elevation_deg], air.ranges_m),
    )


def without_range(air: SlantAir, range_m: float) -> Row:
    """The errors of leaving out a range of a table."""
    fewer = kept(air, air.elevations_deg > 0, air.ranges_m != range_m)
    return Row(
        f"range {range_m / 1000:g} km", largest_errors(air, fewer, air.elevations_deg, [range_m])
    )


def deviation(air: SlantAir) -> str:
    """Root mean square of the depths' ratio to the model, where the air is not opaque."""
    ratios, known = air._ratios[0], air.transmittance > 1e-3
    return f"{np.sqrt(np.mean(ratios[known] ** 2)):.1%}"


def horizontal_errors(air: Atmosphere, limits: str) -> tuple[float, float]:
    """Largest relative errors of the in-band transmittance and path radiance in a band.

    Each inner range of a table of horizontal paths is left out, and predicted by the others.
    """
    weights = band(limits).row_weights(air.wavelengths_um)
    errors = []
    for n, length in list(enumerate(air.ranges_m))[1:-1]:
        kept = air.ranges_m != length
        fewer = Atmosphere(
            air.name,
            air.ranges_m[kept],
            air.wavelengths_um,
            air.transmittance[kept],
            air.path_radiance[kept],
        )
        path = fewer.path(length)
        errors.append(
            (
                abs(path.transmittance @ weights / (air.transmittance[n] @ weights) - 1),
                abs(path.radiance @ weights / (air.path_radiance[n] @ weights) - 1),
            )
        )
    return tuple(np.max(errors, axis=0))


def horizontal_rows() -> list[str]:
    """Rows of the table of errors of horizontal paths; the last one has the worst narrow band."""
    tables = [atmosphere(name.removeprefix(PREFIX)) for name in slant_names()]
    rows = []
    for window in BANDS:
        for air in tables:
            errors = horizontal_errors(air, window)
            rows.append((f"{air.name} | {band(window).label}", *errors))
    narrow = [
        horizontal_errors(air, f"{lower:g}-{lower + WIDTH_UM:g}")
        for air in tables
        for window in BANDS
        for lower in np.arange(band(window).lower_um, band(window).upper_um, WIDTH_UM)
    ]
    rows.append((f"both | any {WIDTH_UM:g} um of these", *np.max(narrow, axis=0)))
    return [
        f"| {what} | {100 * transmittance:.2f} | {100 * radiance:.2f} |"
        for what, transmittance, radiance in rows
    ]


def of_horizontal_air(air: SlantAir) -> float:
    """Largest relative error of the in-band transmittance, inner ranges left out, if the optical
    depth is a power of range between neighbouring entries, as in horizontal air.
    """
    errors = []
    for elevation, transmittance, radiance in zip(air.elevations_deg, air.transmittance, air.up):
        for n, length in list(enumerate(air.ranges_m))[1:-1]:
            kept = air.ranges_m != length
            fewer = Atmosphere(
                f"{elevation:g} degrees",
                air.ranges_m[kept],
                air.wavelengths_um,
                transmittance[kept],
                radiance[kept],
            )
            for window in BANDS:
                weights = band(window).row_weights(air.wavelengths_um)
                predicted = fewer.path(length).transmittance @ weights
                errors.append(abs(predicted / (transmittance[n] @ weights) - 1))
    return max(errors)


def higher_up(air: SlantAir, horizontal: Atmosphere, window: str) -> tuple[float, float, float]:
    """Mean transmittance of a path of 5 km that begins 10 km along the lowest elevation.

    It is returned as predicted, as extrapolated, and as the quotient of the paths of 15 km and of
    10 km. The extrapolation is linear in the path's mean height, from the horizontal path and from
    the table's path of 5 km.
    """
    of, elevation = band(window), air.elevations_deg[0]
    whole = air.along(elevation, True)
    predicted = air.along(elevation, True, 10_000.0).transmittance_mean(of, 5000.0)
    flat, low = (table.transmittance_mean(of, 5000.0) for table in (horizontal, whole))
    heights = height_along(air.lower_m, elevation, np.array([2500.0, 12_500.0])) - air.lower_m
    quotient = whole.transmittance_mean(of, 15_000.0) / whole.transmittance_mean(of, 10_000.0)
    return predicted, flat + (low - flat) * heights[1] / heights[0], quotient


def main(page):
    lines, largest, deviations, plain, higher = [], {}, [], [], []
    for name in slant_names():
        air = slant_air(name)
        plain.append(of_horizontal_air(air))
        horizontal = atmosphere(name.removeprefix(PREFIX))
        for window in BANDS:
            values = (f"{value:.4f}" for value in higher_up(air, horizontal, window))
            higher.append(f"| {name} | {window} | {' | '.join(values)} |")
        deviations.append(f"{deviation(air)} ({name})")
        for row in (
            *(without_elevation(air, elevation) for elevation in air.elevations_deg[1:-1]),
            *(without_range(air, length) for length in air.ranges_m[1:-1]),
        ):
            errors = list(row.errors.values())
            lines.append(
                f"| {name} | {row.what} | {' | '.join(f'{100 * error:.2f}' for error in errors)} |"
            )
            print(lines[-1], flush=True)
            for key, error in row.errors.items():
                largest[key] = max(largest.get(key, 0.0), error)
    worst = lambda *names: f"{100 * max(largest[n, w] for n in names for w in BANDS):.2f} %"
    write_page(
        page,
        "slant",
        rows="\n".join(lines),
        higher="\n".join(higher),
        transmittance=worst("transmittance"),
        radiance=worst("up", "down"),
        plain=f"{max(plain):.0%}",
        deviations=", ".join(deviations),
        horizontal="\n".join(horizontal_rows()),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/slant.md"))
