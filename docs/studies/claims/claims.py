"""What the commands claim about a case, and whether it holds."""

import multiprocessing
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import mi_lcair
from docs.studies.claims import further_claims
from docs.studies.claims.case import Case
from docs.studies.claims.scenario_claims import (
    blurred,
    camera,
    cavity,
    contrast,
    directions,
    flight,
    sweep,
)
from docs.studies.claims.scene_file import PIXELS
from docs.studies.claims.witness import MOST_PATHS, Claim, Witness, student
from mi_lcair.errors import InputError

SHARE = 0.02  # of the whole, above which a channel's error counts as a claim
WINDOW_FREEDOM = 7  # degrees of freedom of an intensity's error: its randomisations less one
# That of a pixel averages over 5 x 5 pixels of 4 randomisations each, and fewer at the film's edge
PIXEL_FREEDOM = 3 * 5 * 5
PART = 1e-3  # relative error of a small part of a large scene without a remark
WITH_WORKERS = 0.1  # share of the scenes whose budget is drawn on workers too, which takes long
DOUBTS = ("single precision", "left to rounding")  # in remarks that withdraw all claims


def part(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """That a part of a large scene is right within PART, or within 3 times the size in a remark."""
    result = mi_lcair.signature(scene, spp=4096, seed=int(rng.integers(1000)))
    truth = case.mean * case.area
    remark = next((remark for remark in scene.remarks if DOUBTS[0] in remark), "")
    if not remark:
        yield witness.claim("small part", result.intensity, truth, PART * truth)
    elif stated := re.search(r"about ([0-9.]+)%", remark):
        allowed = 3 * float(stated[1]) / 100 * truth
        yield witness.claim("small part's remark", result.intensity, truth, allowed)


def signature(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Interval, channels and facets of an intensity from a number of paths."""
    spp = int(2 ** rng.integers(6, 11))
    facets = case.facets is not None
    result = mi_lcair.signature(scene, spp=spp, seed=int(rng.integers(1000)), facets=facets)
    area, whole = case.area, case.mean * case.area
    target = result.target
    yield witness.claim("interval, target", target.intensity, whole, target.half_width)
    if case.fills_window:
        shown = result.scene
        yield witness.claim("interval, scene", shown.intensity, whole, shown.half_width)
    factor = student(WINDOW_FREEDOM)
    for exact, value, error in zip(case.by_bounce * area, target.by_bounce, target.by_bounce_error):
        if exact > SHARE * whole:
            yield witness.claim("channel, by bounce", value, exact, factor * error)
    for kind, exact_of in (("group", case.by_group), ("seen", case.by_seen)):
        values, errors = getattr(target, f"by_{kind}"), getattr(target, f"by_{kind}_error")
        for name, exact in exact_of.items():
            if exact * area > SHARE * whole:
                claim = f"channel, by {kind}", values[name], exact * area, factor * errors[name]
                yield witness.claim(*claim)
    if facets:
        exact = case.facets(case.radiances(), case.materials)
        table = result.facets.table
        for truth, value, error in zip(
            exact, table["intensity_W_sr"], table["standard_error_W_sr"], strict=True
        ):
            if truth > SHARE * whole:
                yield witness.claim("facet", value, truth, factor * error)


def to_tolerance(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """A tolerance that is reached, and the interval at which the paths ended."""
    tolerance = float(rng.choice([0.03, 0.01, 0.003]))
    result = mi_lcair.signature(
        scene, tolerance=tolerance, max_spp=witness.most_spp, seed=int(rng.integers(1000))
    )
    truth = case.mean * case.area
    if result.main_part == "scene":
        return  # no path has met the target
    yield witness.claim("interval, stopped", result.intensity, truth, result.half_width)
    if result.reached:
        yield witness.claim("tolerance", result.intensity, truth, tolerance * truth)


def reflections(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """A tolerance that also chooses the number of reflections; a refused one claims nothing."""
    tolerance = float(rng.choice([0.1, 0.03, 0.01]))
    result = mi_lcair.signature(
        scene,
        tolerance=tolerance,
        max_spp=witness.most_spp,
        seed=int(rng.integers(1000)),
        max_bounces="auto",
    )
    truth = case.with_all_reflections * case.area
    if result.reached and result.main_part == "target":
        yield witness.claim("tolerance, reflections", result.intensity, truth, tolerance * truth)


def image_of_pixels(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Errors of pixels and of the mean of an image, by any of the scene's sensors."""
    spp, sensor = int(2 ** rng.integers(4, 9)), int(rng.integers(case.file.sensors))
    result = mi_lcair.render(scene, spp=spp, seed=int(rng.integers(1000)), sensor=sensor)
    exact = case.pixels.sum(axis=0)
    normal = student(3 * PIXELS**2)
    yield witness.claim("image's mean", result.mean, case.mean, normal * result.mean_error)
    if exact.size > 1:
        factor = student(PIXEL_FREEDOM)
        values, errors = result.channels["Y"], result.channels["stderr.Y"]
        name = "pixel, perspective" if sensor else "pixel"
        for value, truth, error in zip(values.ravel(), exact.ravel(), errors.ravel()):
            yield witness.claim(name, value, truth, factor * error)


def image_to_tolerance(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The mean and the pixels of an image whose rms error over the pixels is below a tolerance."""
    tolerance, sensor = float(rng.choice([0.3, 0.1, 0.03])), int(rng.integers(case.file.sensors))
    sampling = {"tolerance": tolerance, "max_spp": 4096, "seed": int(rng.integers(1000))}
    result = mi_lcair.render(scene, **sampling, sensor=sensor)
    if not result.reached:
        return
    yield witness.claim("tolerance, image", result.mean, case.mean, tolerance * case.mean)
    exact = case.pixels.sum(axis=0)
    if exact.size > 1:
        rms = np.sqrt(np.mean((result.channels["Y"] - exact) ** 2))
        # The squares of independent errors of this size add up to less in 95 of 100 images
        factor = np.sqrt(chi2.ppf(0.95, exact.size) / exact.size)
        allowed = factor * tolerance * case.mean
        yield witness.claim("rms of an image", rms, 0.0, allowed, case.mean)


def effective_areas(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Errors of the effective areas of sources that matter."""
    spp, seed = int(2 ** rng.integers(6, 11)), int(rng.integers(1000))
    areas = mi_lcair.signature(scene, spp=spp, seed=seed, by_spectrum=True).effective_areas
    factor, values = student(WINDOW_FREEDOM), case.radiances()
    for source, area, error in zip(areas.sources, areas.area[0], areas.error[0]):
        if source.group not in case.temperatures:
            continue
        unit = {name: float(name == source.group) for name in values}
        exact = case.response(unit, case.materials).mean(axis=(1, 2)).sum() * case.area
        if exact * values[source.group] > SHARE * case.mean * case.area:
            yield witness.claim("effective area", area, exact, factor * error)


def trend(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Views of a trend: their intervals, and the tolerances that they reach."""
    tolerance = float(rng.choice([0.03, 0.01]))
    azimuths, elevations = rng.uniform(0, 360, 4), rng.uniform(5, 85, 2)
    if rng.random() < 0.3:
        azimuths = np.array([0.0, 45.0, 90.0, 180.0])
    result = mi_lcair.trend(
        scene,
        azimuths,
        elevations,
        resolution=PIXELS,
        tolerance=tolerance,
        max_spp=witness.most_spp // 4,
        seed=int(rng.integers(1000)),
    )
    table = result.table
    largest = table["intensity_W_sr"].max()
    for k, direction in enumerate(directions(table["azimuth_deg"], table["elevation_deg"])):
        truth, _ = case.view(direction, case.radiances(), case.materials)
        value, half_width = table["intensity_W_sr"][k], table["half_width_W_sr"][k]
        yield witness.claim("interval, view", value, truth, half_width)
        if table["reached"][k]:
            allowed = tolerance * max(truth, 1e-3 * largest)
            yield witness.claim("tolerance, view", value, truth, allowed)


def parameters_that_matter(case: Case) -> dict[str, np.ndarray]:
    """Derivatives by pixel of SHARE of the radiance and more per unit of log."""
    sizes = {f"{name}.temperature": T for name, T in case.temperatures.items()} | case.materials
    return {
        name: exact
        for name, exact in case.derivatives().items()
        if name in sizes and abs(exact.mean() * sizes[name]) > SHARE * case.mean
    }


def kind_of_derivative(name: str) -> str:
    return "derivative, " + ("source" if name.endswith(".temperature") else "material")


def sensitivities(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Errors of derivatives of an intensity."""
    exact = parameters_that_matter(case)
    spp = int(2 ** rng.integers(6, 11))
    result = mi_lcair.sensitivities(scene, list(exact), spp=spp, seed=int(rng.integers(1000)))
    factor = student(WINDOW_FREEDOM)
    for (name, truth), value, error in zip(exact.items(), result.derivative, result.error[1:]):
        truth = truth.mean() * case.area
        yield witness.claim(kind_of_derivative(name), value, truth, factor * error)


def derivative_images(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Errors of the pixels of derivatives."""
    exact = parameters_that_matter(case)
    spp, factor = int(2 ** rng.integers(4, 9)), student(PIXEL_FREEDOM)
    seed = int(rng.integers(1000))
    result = mi_lcair.derivative_images(scene, list(exact), spp=spp, seed=seed)
    for (name, truth), *images in zip(exact.items(), result.derivative, result.derivative_error):
        for truth_of_pixel, value, error in zip(truth.ravel(), *map(np.ravel, images)):
            claim = kind_of_derivative(name) + ", pixel"
            yield witness.claim(claim, value, truth_of_pixel, factor * error)


def uncertain(case: Case) -> dict:
    """Uncertainties of the temperatures that matter."""
    by_group = case.by_group
    groups = [name for name in case.temperatures if by_group.get(name, 0) > SHARE * case.mean]
    return {"sigma": {f"{name}.temperature": "0.1 %" for name in groups}}


def budget(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The row of a budget that holds the noise of the rendering."""
    spp = int(2 ** rng.integers(6, 11))
    result = mi_lcair.budget(scene, uncertain(case), spp=spp, seed=int(rng.integers(1000)))
    noise = [row.contribution for row in result.rows if row.quantity == "noise of the rendering"]
    truth = case.mean * case.area
    yield witness.claim("budget's noise", result.value, truth, student(WINDOW_FREEDOM) * noise[0])


def on_workers(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The draws of a budget on two workers: number of results that differ from one process's."""
    how = {"spp": 64, "seed": int(rng.integers(1000)), "draws": 16}
    results = []
    for count in (None, 2):
        with mi_lcair.workers(count):
            drawn = mi_lcair.budget(scene, uncertain(case), **how)
        results.append(drawn.monte_carlo.results)
    yield witness.claim("workers, to the bit", np.count_nonzero(np.not_equal(*results)), 0, 0)


def further(case: Case) -> list:
    """Commands of which one more is run for the case."""
    commands = [sensitivities, budget] + ([effective_areas] if case.band != "total" else [])
    if np.isfinite(case.with_all_reflections):
        commands.append(reflections)
    if case.fills_window:
        commands += [image_of_pixels, image_to_tolerance]
        if case.pixels[0].size > 1:
            commands.append(derivative_images)
    if case.view is not None:
        commands += [trend, trend, sweep]
        if case.band != "total":
            commands += [contrast, contrast, camera, camera]
    if case.kind == "cavity":
        commands.append(cavity)
    return commands


def commands_for(case: Case, rng, rng_of_last, only) -> list:
    """The commands that are run for a case: those named in `only`, if any, or three to five."""
    options, others = further(case), further_claims.suited(case)
    last = [flight, blurred] if case.view is not None and case.band != "total" else []
    if only:
        known = dict.fromkeys([signature, to_tolerance, *options, *others, *last, on_workers])
        return [command for command in known if command.__name__ in only]
    commands = [signature, to_tolerance, options[rng.integers(len(options))]]
    if others:
        commands.append(others[rng.integers(len(others))])
    if rng_of_last.random() < WITH_WORKERS and not multiprocessing.current_process().daemon:
        commands.append(on_workers)  # processes of a pool start no others
    elif last:
        commands.append(last[rng_of_last.integers(len(last))])
    return commands


def claims(
    case: Case,
    seed: int,
    number: int,
    only=(),
    repeats: int = 1,
    most_paths: int = MOST_PATHS,
) -> list[Claim]:
    """All claims that the commands make about a case.

    only: names of the commands that are run. repeats: how often each of them is run, with other
    random numbers. most_paths: largest number of paths through a window, to a tolerance.
    """
    rng = np.random.default_rng([seed, number, 1])
    commands = commands_for(case, rng, np.random.default_rng([seed, number, 2]), only)
    if case.kind.startswith("part") and not only:
        commands = [part]
    setting = {"true": "on", "false": "off"}.get(case.sampling, "auto")
    witness = Witness(case, seed, number, setting, most_paths)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        path = case.file.write(Path(folder), case.band, case.bounces, case.sampling)
        try:
            scene = mi_lcair.load(path)
        except InputError:
            return found  # a refusal claims nothing
        if any(doubt in remark for remark in scene.remarks for doubt in DOUBTS):
            commands = [command for command in commands if command is part]
        for command in commands * repeats:
            try:
                found += command(case, scene, witness, rng)
            except InputError:
                continue  # nor does this refusal
            except Exception as error:
                found.append(witness.fault(error))
    return found
