"""Derivatives of an intensity with respect to many parameters, from one render."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.values import parameters_named, units
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.sensitivity.columns import (
    by_difference,
    columns_of,
    explored_by,
    recordings,
    relative_slope,
    weight_of,
)
from mi_lcair.sensitivity.common_numbers import METHOD, PARTS, CommonNumbers, renders_beside
from mi_lcair.sensitivity.motions.differences import Differences
from mi_lcair.sensitivity.sensitivities import Sensitivities

SPLITS = {"target": "target", "scene": "image"}  # channels that hold each part of the radiance


def differentiate_intensity(
    scene: Scene,
    names: Sequence[str],
    sampling: Sampling,
    part: str = "target",
    weights: Mapping | None = None,
) -> Sensitivities:
    """Intensity of a loaded scene and its derivatives, all from the same paths.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Names of parameters.
    sampling : Sampling
        Its tolerance is that of the intensity.
    part : str
        "target" or "scene".
    weights : mapping or None
        Factor of each source's intensity in the sum, by (group, name of the spectrum). None: the
        sum over all sources without factors.
    """
    by_spectrum = weights is not None
    numbers = CommonNumbers(scene, sampling, by_spectrum, part)
    if sampling.tolerance is not None:
        numbers.render()
    motions = [entry.name for entry in parameters_named(scene, names) if entry.kind == "motion"]
    differenced = by_difference(scene, names)
    along_paths = [name for name in names if name not in differenced]
    explored = explored_by(columns_of(scene, along_paths).values())
    measurands = replace(Measurands.of(SPLITS[part], by_spectrum), explored=explored)
    rows, method, first = {}, {}, None
    with scene.prepared(by_spectrum, explored) as tracer:
        numbers.take_aim()
        for batch in recordings(
            scene, tracer, numbers.camera, along_paths, measurands, weights, sampling.seed
        ):
            total = measure(
                scene,
                numbers.windows,
                numbers.sampling,
                measurands.with_columns(batch.tables),
                aim=numbers.aim,
            )
            first = first or total
            method |= batch.method
            rows |= {
                name: mean_and_deviations(total, channels)
                for name, channels in batch.channels.items()
            }
    rows_of = partial(mean_and_deviations, channels=["weighted"])
    of_part = rows_of_part(numbers, weights)
    several = replace(measurands, channels=replace(measurands.channels, split="target"))
    if first is None:
        numbers.take_aim()
        rows_of = of_part
        first = measure(scene, numbers.windows, numbers.sampling, several, aim=numbers.aim)
    value = rows_of(first)
    rest = [name for name in names if name not in motions]
    missed = unscattered(scene, first, rest, part, weights)
    errors = dict(zip(rest, missed[1:]))
    for name in rest:
        if name in differenced:
            *ends, step = renders_beside(
                scene, name, numbers.windows, numbers.repeated, several, numbers.aim
            )
            high, low = map(of_part, ends)
            rows[name], method[name] = (high - low) / step, METHOD
    differences = {name: differences_of(numbers, name, weights).at() for name in motions}
    for name, difference in differences.items():
        rows[name] = np.append(difference.derivative, difference.deviations)
        errors[name], method[name] = difference.unscattered, difference.method
    rows = numbers.area * np.array([value, *(rows[name] for name in names)])
    return Sensitivities(
        names=tuple(names),
        value=float(rows[0, 0]),
        derivative=rows[1:, 0],
        deviations=rows[:, 1:],
        unscattered=numbers.area * np.array([missed[0], *(errors[name] for name in names)]),
        method=tuple(method[name] for name in names),
        by_bounce=numbers.by_reflections(first),
        paths=int(first.traced[0]),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
        differences={name: d.scaled(numbers.area) for name, d in differences.items()},
    )


def differences_of(numbers: CommonNumbers, name: str, weights: Mapping | None = None):
    """The `Differences` of a part's mean radiance, or of its weighted sum, along a motion."""
    return Differences(
        numbers.scene,
        name,
        numbers.repeated,
        Measurands.of("target", numbers.by_spectrum),
        rows_of_part(numbers, weights),
        PARTS[numbers.part],
        numbers.aim,
    )


def rows_of_part(numbers: CommonNumbers, weights: Mapping | None):
    """Function of Totals: mean and deviations of a part's radiance, or of its weighted sum."""

    def rows(total: Totals) -> np.ndarray:
        if weights is None:
            return mean_and_deviations(total, [PARTS[numbers.part]])
        sources = enumerate(total.emitters.sources.list)
        factors = {f"{numbers.prefix}source.{k}": weight_of(weights, s) for k, s in sources}
        return sum(w * mean_and_deviations(total, [channel]) for channel, w in factors.items())

    return rows


def mean_and_deviations(total, channels) -> np.ndarray:
    """Mean of the sum of some channels and its deviations, (1 + randomisations,)."""
    mean, deviations = total.mean(channels)[:, 0], total.deviations(channels)[:, 0]
    return np.append(sum(mean), sum(deviations))


def unscattered(scene, total: Totals, names, part: str, weights: Mapping | None) -> np.ndarray:
    """Standard errors of a mean radiance and its derivatives that no deviation shows, (1 + K,)."""
    largest = max(weights.values(), default=0.0) if weights else 1.0
    missed = [errors[0] for errors in missed_errors(scene, total, names, part)]
    return largest * np.array([total.unscattered_error(PARTS[part])[0], *missed])


def missed_errors(scene, total: Totals, names, part: str = "scene") -> list[np.ndarray]:
    """Standard errors of derivatives from sources that no path has met, (windows,) each.

    The error of the radiance from such a source, times the relative derivative, is the error of the
    derivative with respect to its temperature or radiance. For the parameter of a material, the
    radiance is assumed to be proportional to the parameter.
    """
    errors = []
    for entry in parameters_named(scene, names):
        numbers, channel = entry.numbers(), PARTS[part]
        relative = 1 / (abs(entry.mean(numbers)) or 1.0)
        if entry.kind not in ("material", "spectrum", "plugin", "mode"):
            channel = f"group.{entry.name.rpartition('.')[0].partition('@')[0]}"
            channel = channel if part == "scene" else f"target.{channel}"
        if entry.kind == "mode":
            slopes = columns_of(scene, [entry.name])[entry.name].relative.values()
            relative = max(float(abs(slope).max()) for slope in slopes)
        if entry.kind == "temperature":
            relative = relative_slope(scene.band, np.concatenate(numbers)).max()
        errors.append(total.missed_error(channel) * relative)
    return errors
