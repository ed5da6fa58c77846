"""What a twin's data say of each unknown, and which combinations they do not determine."""

from collections.abc import Iterator

import numpy as np
from scipy import linalg

from mi_lcair.declared import listed
from mi_lcair.knowing.twin.data import Frames
from mi_lcair.knowing.twin.estimate import LITTLE, TwinEstimate
from mi_lcair.knowing.twin.model import Twin, TwinCourse
from mi_lcair.knowing.twin.problem import SeriesTable
from mi_lcair.physics.estimation.verdicts import SIGNIFICANCE, Verdict

KNOWN_BEFORE = "not determined: known beforehand as well"
MISSED = "something in this series"
# Information of the data on a combination, over that which is known beforehand, below which the
# data do not tell it
UNTOLD = 0.5
MEMBER = 0.1  # size of an unknown's part in a combination from which it is named
EVEN = 0.1  # relative difference of parts that count as equal
SCALED = "a common factor of all heat flows and heat capacities changes no temperature"
WORTH = 2.0  # factor by which a proposal must narrow a combination
PULSE_W_m2, PULSE_H = 200.0, 4  # heat that is released in a proposal, and over which hours
BANDS = {"MWIR", "LWIR"}  # in which further frames are proposed
NIGHT_H = (0, 3, 6, 9, 12, 15, 18, 21)  # hours at which further frames are proposed


def verdicts(twin: Twin, found: TwinEstimate) -> list[str]:
    """What the data say of each unknown."""
    result = []
    for k, (unknown, ends) in enumerate(zip(twin.unknowns, found.ends)):
        error, x = np.sqrt(found.covariance[k, k]), found.state.z[k]
        at_bound = x in unknown.limits
        verdict = Verdict.DETERMINED if error < LITTLE * unknown.sigma else None
        span = "{:.4g}..{:.4g}".format(*map(unknown.at, ends))
        if found.p_value < SIGNIFICANCE:
            verdict = Verdict.MISSED
        elif not found.converged:
            verdict = Verdict.UNFINISHED
        elif at_bound:
            verdict = Verdict.AT_BOUND
        words = verdict and verdict.sentence(span=span, bound=f"{unknown.at(x):.4g}", what=MISSED)
        result.append(words or KNOWN_BEFORE)
    return result


def relative_sizes(twin: Twin, x: np.ndarray) -> np.ndarray:
    """Change of x for a relative change of each unknown, (K,).

    NaN for temperatures, and for values that are known less well than their size.
    """
    sizes = [abs(u.at(step)) if u.is_linear else 1.0 for u, step in zip(twin.unknowns, x)]
    small = [u.is_linear and (u.sigma > v or "K" in u.key) for u, v in zip(twin.unknowns, sizes)]
    return np.where(small, np.nan, sizes)


def information(twin: Twin, covariance: np.ndarray) -> np.ndarray:
    """Information of the data on the unknowns (K, K), in standard deviations known beforehand."""
    K = len(twin.unknowns)
    sigma = np.array([u.sigma for u in twin.unknowns])
    of = np.linalg.inv(covariance[:K, :K]) * np.outer(sigma, sigma) - np.eye(K)
    return (of + of.T) / 2


def combinations(twin: Twin, found: TwinEstimate) -> np.ndarray:
    """Combinations that the data do not determine, in standard deviations, (c, K).

    They are the eigenvectors of little information, rotated so that each has as few unknowns as
    can be: a basis in reduced echelon form, with the largest parts as pivots.
    """
    sizes, vectors = np.linalg.eigh(information(twin, found.covariance))
    basis = vectors[:, sizes < UNTOLD].T
    free = np.ones(len(sizes), dtype=bool)
    for row in range(len(basis)):
        part = abs(basis[row:]) * free
        lead, column = np.unravel_index(part.argmax(), part.shape)
        basis[[row, row + lead]] = basis[[row + lead, row]]
        basis[row] /= basis[row, column]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, column], basis[row])
        free[column] = False
    return basis


def members(combination: np.ndarray) -> np.ndarray:
    """Numbers of the unknowns that a combination changes."""
    return np.flatnonzero(abs(combination) > MEMBER * abs(combination).max())


def in_words(twin: Twin, x: np.ndarray, combination: np.ndarray) -> str:
    """A combination as a sentence. x: the estimate (K,)."""
    chosen = members(combination)
    names = [twin.unknowns[k].name for k in chosen]
    if len(chosen) == 1:
        return f"{names[0]}: these data do not depend on it"
    steps = combination * [u.sigma for u in twin.unknowns]
    parts = (steps / relative_sizes(twin, x))[chosen]
    is_relative, steps = np.isfinite(parts), steps[chosen]
    scale = 0.1 / max(abs(parts[is_relative])) if is_relative.any() else 1.0
    parts, steps = (values * scale * np.sign(steps[0]) for values in (parts, steps))
    if (abs(parts - 0.1) < 0.1 * EVEN).all():
        why = f": {SCALED}" if len(chosen) > 2 else ""
        return f"{listed(names)} can be scaled together{why}"
    up = [n for n, step in zip(names, steps) if step > 0]
    down = [n for n, step in zip(names, steps) if step < 0]
    sizes = ", ".join(
        f"{n} {100 * p:+.2g} %" if np.isfinite(p) else f"{n} {step:+.2g}"
        for n, p, step in zip(names, parts, steps)
    )
    if not down:
        return f"{listed(up)} can grow together ({sizes})"
    verb = "are" if len(up) > 1 else "is"
    return f"more {listed(up)} {verb} compensated by less {listed(down)} ({sizes})"


def alike(twin: Twin, found: TwinEstimate) -> list[str]:
    """What the data cannot tell apart, one sentence for each combination."""
    x = found.state.z[: len(twin.unknowns)]
    return [in_words(twin, x, each) for each in combinations(twin, found)]


# What would tell them: information of measurements that were not made
# --------------------------------------------------------------------


def advice(twin: Twin, found: TwinEstimate) -> list[str]:
    """For each combination, the proposal that narrows it most, in words."""
    untold, lines = combinations(twin, found), []
    if not len(untold):
        return lines
    K = len(twin.unknowns)
    sigma = np.array([u.sigma for u in twin.unknowns])
    now = np.linalg.inv(found.covariance)
    gains = []
    for words, more in proposals(twin, found):
        after = np.linalg.inv(now + more)[:K, :K]
        gains.append((words, after))
    for combination in untold:
        v = combination * sigma
        before = spread(found.covariance[:K, :K], v)
        chosen = members(combination)
        what = listed([twin.unknowns[k].name for k in chosen])
        most = chosen[abs(combination[chosen]).argmax()]
        ranked = sorted((spread(after, v) / before, words) for words, after in gains)
        if ranked and ranked[0][0] < 1 / WORTH:
            factor, words = ranked[0]
            lines.append(f"{words} would reduce the error of {what} to {100 * factor:.2g} %")
        else:
            name = twin.unknowns[most].name
            lines.append(f"no frame, thermometer or heat determines {what}; measure {name} itself")
    return lines


def spread(covariance: np.ndarray, direction: np.ndarray) -> float:
    """Standard deviation of what is left along a direction, whatever its length."""
    return float(1 / np.sqrt(direction @ np.linalg.solve(covariance, direction)))


def proposals(twin: Twin, found: TwinEstimate) -> Iterator[tuple[str, np.ndarray]]:
    """Yield further measurements in words, with their information (p, p)."""
    course = found.state.course
    for camera in course.traced.cameras:
        for hour in NIGHT_H:
            if twin.times.day or twin.times.hours[0] <= hour <= twin.times.hours[-1]:
                rows = expected(twin, course, camera, hour)
                yield f"a frame of {camera.name} at {hour} h", of_rows(*rows)
    for number, camera in enumerate(twin.cameras):
        for band in sorted(BANDS - {camera.scene.band.label}):
            other = twin.in_band(course, found.state.z, number, band)
            for hour in camera.hours if other else ():
                rows = expected(twin, other, other.traced.cameras[0], hour, camera)
                yield f"a frame of {camera.name} in {band} at {hour:g} h", of_rows(*rows)
    groups = twin.first.network.facets.groups
    hours = (
        range(24) if twin.times.day else twin.times.hours[:: max(1, len(twin.times.hours) // 24)]
    )
    for g, group in enumerate(groups):
        table = twin.first.network.tables[group]
        if table.temperature is not None or any(group in datum.columns for datum in twin.contact):
            continue
        made = [contact(twin, course, g, hour) for hour in hours]
        matrix, variance = (np.concatenate(parts) for parts in zip(*made))
        yield f"a contact thermometer on {group} through the day", of_rows(matrix, variance)
        pulse = pulsed(twin, found, group)
        if pulse is not None:
            what = f"{PULSE_W_m2:g} W/m2 of known heat in {group} for {24 // PULSE_H} h"
            yield f"the same data with {what}", pulse


def of_rows(matrix: np.ndarray, variance: np.ndarray, shared: np.ndarray | int = 0) -> np.ndarray:
    """Information (p, p) of values with derivatives (s, p) and variances (s,).

    shared: covariance of the errors that they share, (s, s).
    """
    return matrix.T @ linalg.solve(np.diag(variance) + shared, matrix, assume_a="pos")


def expected(twin: Twin, course: TwinCourse, camera: Frames, hour: float, like=None) -> tuple:
    """Derivatives (s, p), variances and shared covariance of means of groups in a further frame.

    like: frames with the errors of the instrument, if `camera` has none.
    """
    near = int(np.argmin(abs(camera.hours - hour)))
    z = np.zeros(len(twin.mean))
    kelvin, ends = twin.kelvin(course, z, hour)
    number = twin.data(course).index(camera)
    block = camera.block(near, kelvin, np.zeros(len(camera.own)))
    changes = twin.times.at(hour, course.changes)
    row = twin.with_columns(course, block, (camera, number, near, kelvin), changes, ends)
    instrument = block.own[:, :0]
    if like is not None:
        of_pixels = camera.own_columns(near, camera.radiance(near, kelvin), like.table)
        instrument = camera.cells(near, kelvin).mean @ of_pixels
    drift = camera.table.drift_K * camera.kelvin_at_netd
    own = twin.places[f"errors of {number}"]
    matrix, variance, errors = [], [], []
    for part in np.unique(block.part):
        share = np.where(block.part == part, block.weight, 0.0)
        full = row.mean(share / share.sum(), len(z))
        errors.append(share / share.sum() @ instrument)
        if drift:  # its offset is another one than that of the frame which is near
            full[own[-len(camera.hours) :]] = 0.0
        matrix.append(full)
        variance.append(1 / share.sum() + drift**2)
    errors = np.array(errors)
    return np.array(matrix), np.array(variance), errors @ errors.T


def contact(twin: Twin, course: TwinCourse, group: int, hour: float):
    """Derivatives (1, p) and the variance of a thermometer on a group at an hour."""
    facets = twin.first.network.facets
    weights = (facets.group == group) * facets.area
    weights = weights / weights.sum()
    full = np.zeros((1, len(twin.mean)))
    _, ends = twin.kelvin(course, full[0], hour)
    changes = twin.times.at(hour, course.changes)
    full[0, : len(changes)] = changes @ weights
    model = twin.places["model"].reshape(len(twin.free), -1)
    for node, share in ends:
        full[0, model[:, node]] += share * (twin.free @ weights)
    return full, np.array([SeriesTable.sigma_K**2])


def pulsed(twin: Twin, found: TwinEstimate, group: str) -> np.ndarray | None:
    """Information (p, p) of the same data, if known heat were released in a group."""
    table = found.state.course.network.tables[group]
    if any(u.group == group and u.key.startswith("internal") for u in twin.unknowns):
        return None
    hours = np.full(PULSE_H, table.internal_W_m2)
    hours[0] += PULSE_W_m2
    heated = twin.course(found.state.z, heated=(group, tuple(hours)))
    total = np.zeros((len(found.state.z),) * 2)
    for row in twin.rows(heated, found.state.z):
        np.add.at(total, np.ix_(row.entries, row.entries), row.normal()[0])
    return total
