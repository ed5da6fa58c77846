"""Derivatives by finite differences of two renders with the same random numbers.

Each derivative takes two renders. It holds for every parameter, and serves to check faster methods.
"""

from collections.abc import Mapping

import numpy as np

from mi_lcair.derivatives.common_numbers import PARTS, CommonNumbers
from mi_lcair.derivatives.images import DerivativeImages, randomised_images
from mi_lcair.derivatives.window import Sensitivities, weight_of
from mi_lcair.errors import InputError
from mi_lcair.rendering.parameters.entries import NEAREST
from mi_lcair.rendering.parameters.values import changed, parameter, units
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import Totals

METHOD = "difference"


def differences(
    scene,
    names,
    steps,
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
    """Derivatives of an intensity by central differences, [I(p + step) - I(p - step)] / (2 step).

    A step that would cross a bound ends there, so that the difference is one-sided at a bound.

    Parameters
    ----------
    scene : Scene
        Scene with an orthographic sensor.
    names : sequence of str
        Names of parameters, see `mi_lcair.rendering.parameters.values`.
    steps : float or sequence of float
        Step of each parameter, in its unit.
    sensor, spp, tolerance, seed, progress
        As for `signature`.
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
        If a name is unknown, a step is not positive, or a parameter cannot change.
    """
    ends = [stepped(scene, name, step) for name, step in zip(names, spread(names, steps))]
    sampling = Sampling(
        spp=spp, paths=paths, tolerance=tolerance, seed=seed, sensor=sensor, progress=progress
    )
    numbers = CommonNumbers(scene, sampling, weights is not None, part)

    def intensity(values=None) -> tuple[Totals, np.ndarray]:
        """The sums, and the mean and the deviations of the intensity, (1 + R,)."""
        total = numbers.render(values)
        if weights is None:
            rows = [(PARTS[part], 1.0)]
        else:
            rows = [
                (f"{numbers.prefix}source.{k}", weight_of(weights, source))
                for k, source in enumerate(total.emitters.sources.list)
                if source.name is not None
            ]
        means = sum(factor * total.mean(name)[0] for name, factor in rows)
        deviations = sum(factor * total.deviations(name)[0] for name, factor in rows)
        return total, numbers.area * np.append(means, deviations)

    total, value = intensity()
    columns = [value]
    for name, (low, high) in zip(names, ends):
        found, at = zip(*(intensity_at(scene, intensity, name, x) for x in (low, high)))
        columns.append((found[1] - found[0]) / (at[1] - at[0]))
    columns = np.array(columns)
    return Sensitivities(
        names=tuple(names),
        value=float(columns[0, 0]),
        derivative=columns[1:, 0],
        deviations=columns[:, 1:],
        unscattered=np.zeros(len(columns)),
        method=(METHOD,) * len(names),
        by_bounce=numbers.by_reflections(total),
        paths=int(total.traced[0]),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def intensity_at(scene, intensity, name: str, value: float) -> tuple[np.ndarray, float]:
    """The intensity at a value of a parameter, and that value as Float32 holds it."""
    with changed(scene, {name: value}):
        return intensity()[1], parameter(scene, name).value


def image_differences(
    scene,
    names,
    steps,
    *,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = 4,
    progress=None,
) -> DerivativeImages:
    """Derivatives of an image by central differences of two images with the same random numbers.

    Parameters
    ----------
    scene : Scene
    names, steps
        As for `differences`.
    sensor, spp, seed
        As for `render`.
    randomisations : int
        Number of independent images.
    progress : callable or None
        Called with (images done, images expected).

    Returns
    -------
    DerivativeImages

    Raises
    ------
    InputError
        As for `differences`.
    """
    ends = [stepped(scene, name, step) for name, step in zip(names, spread(names, steps))]
    expected = 1 + 2 * len(names)

    def image(number: int) -> np.ndarray:
        sampling = Sampling(spp=spp, seed=seed, sensor=sensor)
        result = randomised_images(scene, sampling, randomisations)
        if progress:
            progress(number, expected)
        return result

    radiance, columns = image(1), []
    for k, (name, end) in enumerate(zip(names, ends)):
        found, at = [], []
        for side, value in enumerate(end):
            with changed(scene, {name: value}):
                found.append(image(2 + 2 * k + side))
                at.append(parameter(scene, name).value)
        columns.append((found[1] - found[0]) / (at[1] - at[0]))
    shape = (len(names), *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance.astype(np.float32),
        derivatives=np.reshape(columns, shape).swapaxes(0, 1).astype(np.float32),
        missed=np.zeros((1 + len(names), *radiance.shape[1:])),
        method=(METHOD,) * len(names),
        scene_name=scene.name,
        band=scene.band.name,
        units=units(scene, names),
    )


def spread(names, steps) -> np.ndarray:
    """A step for each name; raises InputError if one is not positive and finite."""
    steps = np.broadcast_to(np.asarray(steps, dtype=float), (len(names),))
    for name, step in zip(names, steps):
        if not 0 < step < np.inf:
            raise InputError(f"{name}: step {step:g} must be positive and finite")
    return steps


def stepped(scene, name: str, step: float) -> tuple[float, float]:
    """The values one step below and above a parameter's value, but within its bounds."""
    entry = parameter(scene, name)
    lower = entry.lower
    if entry.kind == "temperature":
        lower += NEAREST * (entry.value - lower)
    low, high = max(entry.value - step, lower), min(entry.value + step, entry.upper)
    if not low < high:
        raise InputError(
            f"{name} = {entry.value:g} cannot change: its bounds are {entry.lower:g}.."
            f"{entry.upper:g}"
        )
    return low, high
