"""Derivatives of an intensity with respect to many parameters, from one render."""

from collections.abc import Mapping

import numpy as np

from mi_lcair.rendering.window_means import window_means
from mi_lcair.sensitivity.columns import MOST_COLUMNS, columns_of, tables_of
from mi_lcair.sensitivity.common_numbers import CommonNumbers
from mi_lcair.sensitivity.sensitivities import Sensitivities

SPLITS = {"target": "target", "scene": "image"}  # channels that hold each part of the radiance
# Paths that decide whether a control variate helps, as a fraction of all paths, and at least
PILOT_SHARE, PILOT_PATHS = 16, 2**14


def sensitivities(
    scene,
    names,
    *,
    sensor: int = 0,
    part: str = "target",
    weights: Mapping | None = None,
    spp: int | None = None,
    paths: int | None = None,
    tolerance: float | None = None,
    seed: int = 0,
    progress=None,
) -> Sensitivities:
    """Intensity and its derivatives with respect to parameters, all from the same paths.

    Derivatives with respect to temperatures, radiances and emissivities of emitters are exact
    consequences of the linearity of radiance in its sources. Those with respect to parameters of
    materials are estimated from the scores of the paths, with a control variate where a pilot finds
    less noise with it (see `plugins.paths.columns`).

    Parameters
    ----------
    scene : Scene
        Scene with an orthographic sensor.
    names : sequence of str
        Names of parameters, see `mi_lcair.sensitivity.parameters`.
    sensor, spp, tolerance, seed, progress
        As for `signature`; the tolerance is that of the intensity.
    part : str
        "target" (the model's facets) or "scene".
    weights : mapping or None
        Factor of each source's intensity in the sum, by (group, name of the spectrum) as in
        `Source`. None: the sum over all sources without factors.
    paths : int or None
        Number of paths in place of `spp`.

    Returns
    -------
    Sensitivities

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `signature`.
    """
    numbers = CommonNumbers(
        scene, sensor, spp, paths, tolerance, seed, weights is not None, progress
    )
    columns, split = columns_of(scene, names), SPLITS[part]
    if tolerance is not None:
        numbers.render(part=part)
    with scene.prepared(numbers.by_spectrum) as tracer:
        camera = numbers.camera
        numbers.take_aim(tracer)

        def means(tables, paths, seed):
            return window_means(
                scene,
                tracer,
                camera,
                paths=paths,
                seed=seed,
                split=split,
                progress=progress,
                aim=numbers.aim,
                tables=tables,
            )

        # One render for each MOST_COLUMNS parameters; its rows are value and deviations
        found, method, ordered = [], {}, list(columns)
        for start in range(0, max(len(ordered), 1), MOST_COLUMNS):
            some = ordered[start : start + MOST_COLUMNS]
            tables = tables_of(
                scene, tracer, camera, {name: columns[name] for name in some}, weights, seed
            )
            pilot_paths = min(max(PILOT_PATHS, numbers.paths // PILOT_SHARE), numbers.paths)
            pilot = means(tables, pilot_paths, seed + 1) if tables.materials else None
            total = means(tables, numbers.paths, seed)
            if not found:
                first = total
                found.append(row(total, ["weighted"]))
            for k, name in enumerate(some):
                channels = [f"column.{k}"]
                method[name] = "linear"
                if k < tables.materials:
                    controlled = [f"column.{k}", f"control.{k}"]
                    method[name] = "score"
                    if scatter(pilot, controlled) < scatter(pilot, channels):
                        channels, method[name] = controlled, "control variate"
                found.append(row(total, channels))
    order = [0, *(1 + ordered.index(name) for name in names)]
    rows = numbers.area * np.array(found)[order]
    prefix = "target." if part == "target" else ""
    bounces = [f"{prefix}bounce.{k}" for k in range(scene.mi.integrator().max_bounces + 1)]
    return Sensitivities(
        names=tuple(names),
        value=float(rows[0, 0]),
        derivative=rows[1:, 0],
        deviations=rows[:, 1:],
        method=tuple(method[name] for name in names),
        bounces=np.array([first.mean(n)[0] for n in bounces if n in first.sums]) * numbers.area,
        paths=int(first.traced[0]),
    )


def row(total, channels) -> np.ndarray:
    """Mean of the sum of some channels and its deviations, (1 + randomisations,)."""
    mean = sum(total.mean(name)[0] for name in channels)
    return np.append(mean, sum(total.deviations(name)[0] for name in channels))


def scatter(total, channels) -> float:
    """Squared standard error of the sum of some channels."""
    return float(np.sum(row(total, channels)[1:] ** 2))
