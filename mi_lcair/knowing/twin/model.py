"""The prediction of a twin: temperatures over the day, and what its data show of them.

All that is estimated is one vector z: changes x of the unknowns; changes of the other inputs and of
the random numbers of the exchange, in standard deviations; errors of the instruments, in the same;
and the error of the balance itself for each group, in kelvin at nodes of the day.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from mi_lcair.declared import texts
from mi_lcair.errors import InputError, errors_of
from mi_lcair.heating.temperatures.description import GroupTable, HeatDescription, default_sigmas
from mi_lcair.heating.temperatures.network import Network
from mi_lcair.heating.temperatures.solve import course, network_of, sunlight
from mi_lcair.knowing.twin.data import DataBlock, Frames, Readings, Times
from mi_lcair.knowing.twin.problem import CameraFrames, TwinProblem
from mi_lcair.knowing.twin.unknowns import (
    STEP,
    changed,
    check_apart,
    of_others,
    sought,
)
from mi_lcair.rendering.parameters import values
from mi_lcair.rendering.scene import Scene

# Time over which the error of the model is alike, in hours of the weather's rows. It is an eighth
# of a day, also of a long one: what the terms leave out follows the course of sun and air
LASTS_H = 3.0
DENSE = 300  # facets up to which matrices by facet are dense
# Distance from a periodic day, far below what a thermometer, or many pixels, resolve [K]
DRIFT_K, DRIFT_OF_FRAMES_K = 1e-3, 3e-5
NODE_H = 1.0  # distance of the nodes of that error


@dataclass(frozen=True)
class TracedScenes:
    """What follows from tracing the scenes: the network and the cameras' effective areas."""

    network: Network
    cameras: list[Frames]


@dataclass(frozen=True)
class TwinCourse:
    """Temperatures (m, n) at some z without errors of the model, and their changes (c, m, n).

    lighter: effect of unknowns that are traced on the frames at fixed temperatures, by the number
    of the unknown: cameras above and below, and the change of x between them.
    """

    traced: TracedScenes
    network: Network
    kelvin: np.ndarray
    changes: np.ndarray
    lighter: dict[int, tuple[list[Frames], list[Frames], float]]


@dataclass(frozen=True)
class Rows:
    """A block with its derivatives with respect to some entries of z.

    of_facets: changes of the temperatures by some entries, (n, a). own: effects on the values
    themselves, (N, b). entries: the numbers of both, (a + b,); a number may stand twice.
    facet_error: standard errors of the temperatures that this block does not share, (n,) [K].
    """

    block: DataBlock
    of_facets: np.ndarray
    own: np.ndarray
    entries: np.ndarray
    facet_error: np.ndarray

    def normal(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Information (q, q), gradient (q,) and chi-square of the entries.

        With F the derivatives by facet, W the weights and E the variances of `facet_error`, the
        covariance of the values is W^-1 + F E F^T. Its inverse is
        W - W F (E^-1 + F^T W F)^-1 F^T W.
        """
        w, F, C = self.block.weight, self.block.facets, self.of_facets
        values = np.column_stack([self.own, self.block.residual])
        is_small = F.shape[1] <= DENSE
        F = F.toarray() if is_small else F
        weighed = F.T * w
        inner = weighed @ F if is_small else sparse.csc_array(weighed @ F)
        to_facets = np.concatenate([inner @ C, weighed @ values], axis=1)  # F^T W A and F^T W r
        cross = C.T @ to_facets
        own = values.T @ (w[:, None] * values)
        whole = np.block([[cross], [cross[:, C.shape[1] :].T, own]])
        some = np.flatnonzero(self.facet_error > 0)
        if len(some):
            right, known = to_facets[some], self.facet_error[some] ** -2.0
            inner = inner[:, some][some]
            if is_small:
                solved = linalg.solve(inner + np.diag(known), right, assume_a="pos")
            else:
                solved = splu(sparse.csc_array(inner + sparse.diags_array(known))).solve(right)
            whole = whole - right.T @ solved
        return whole[:-1, :-1], whole[:-1, -1], float(whole[-1, -1])

    def mean(self, share: np.ndarray, size: int) -> np.ndarray:
        """Derivatives (size,) of a mean with weights (N,)."""
        values = [(share @ self.block.facets) @ self.of_facets, share @ self.own]
        return np.bincount(self.entries, np.concatenate(values), minlength=size)


class Twin:
    """A body, its weather, and what was measured of it.

    Attributes
    ----------
    unknowns : list of Sought
    others : dict
        Uncertainties of all other inputs.
    sizes : dict of str to int
        Number of entries of z of each kind, in their order.
    mean, precision : ndarray
        What is known of z beforehand: its mean (p,), and the inverse covariance (p, p).
    """

    def __init__(self, scene: Scene, description: HeatDescription, problem: TwinProblem):
        self.scene, self.description = scene, description
        self.kept, self.last, self.alone = {}, None, None
        network, self.remarks = network_of(scene, description)
        if len(network.weather.seconds) == 1:
            raise InputError(
                f"heat '{problem.heat.file}': a steady state; give a file of [weather]"
            )
        known = values.parameters_of(scene)
        check_apart(problem.unknowns)
        self.unknowns = [
            sought(name, given, network, known) for name, given in problem.unknowns.items()
        ]
        if (stated := self.with_absorptances()) is not self.description:
            self.description, n = stated, len(network.facets.number)
            light = n, network.weather, stated.run, stated.stated("absorptance")
            network = replace(network, sun=sunlight(scene, *light))
        self.start_K = description.run.start_K
        self.drift_K = DRIFT_OF_FRAMES_K if problem.frames else DRIFT_K
        day = 24.0 if self.start_K is None else None
        self.times = Times(network.weather.seconds / (network.weather.day_s / 24), day)
        self.cameras = [self.camera(table, network) for table in problem.frames]
        by_group = [u.name for u in self.unknowns if u.key == "emissivity" and not u.is_of_scene]
        if self.cameras and by_group:
            raise InputError(
                f"[unknowns] '{by_group[0]}': frames need the parameter of its material, such as "
                f"one of {', '.join(n for n, p in known.items() if p.kind == 'material') or '-'}"
            )
        readings = problem.heat.measured
        self.contact = [Readings(problem.heat, network.facets, self.times)] if readings else []
        self.first = TracedScenes(network, [camera.traced() for camera in self.cameras])
        sigmas = description.sigma
        if description.has_defaults:
            sigmas = default_sigmas(network.weather.sky, network.tables)
        self.others = of_others(sigmas, self.unknowns, network)
        self.known_beforehand()

    def with_absorptances(self) -> HeatDescription:
        """The description with absorptances that are sought in place of those of the scene.

        They are the same at all angles, as in the heat.toml that has the values.
        """
        groups = dict(self.description.groups)
        for u in self.unknowns:
            table = groups.get(u.group, GroupTable())
            if u.key == "absorptance" and table.absorptance is None:
                groups[u.group] = replace(table, absorptance=u.value)
        if groups == self.description.groups:
            return self.description
        return replace(self.description, groups=groups)

    def known_beforehand(self) -> None:
        """Lay out z, and set its mean and precision."""
        network, data = self.first.network, [*self.contact, *self.cameras]
        model_K = self.description.model_K
        free = [k for k, t in enumerate(network.tables.values()) if t.temperature is None]
        hours, day = self.times.hours, self.times.day
        span = day or hours[-1] - hours[0]
        count = max(2, round(span / NODE_H))
        first = 0.0 if day else hours[0]
        self.nodes = Times(first + span / (count - bool(not day)) * np.arange(count), day)
        self.sizes = {
            "unknowns": len(self.unknowns),
            "others": len(self.others),
            "exchange": len(network.traced.replicates),
            **{f"errors of {k}": len(datum.own) for k, datum in enumerate(data)},
            "model": len(free) * count if model_K else 0,
        }
        self.free = network.facets.membership.toarray()[free]
        ends = np.cumsum([0, *self.sizes.values()])
        self.places = {n: np.arange(*e) for n, e in zip(self.sizes, zip(ends, ends[1:]))}
        self.mean, self.precision = np.zeros(ends[-1]), np.eye(ends[-1])
        K = len(self.unknowns)
        self.mean[:K] = [u.expected for u in self.unknowns]
        self.precision[range(K), range(K)] = [u.sigma**-2.0 for u in self.unknowns]
        # Deviations of R randomisations from their mean, whose error has the covariance of the sum
        # of their products over R (R - 1)
        R = self.sizes["exchange"]
        self.of_scatter = 1 / np.sqrt(R * (R - 1))
        if model_K:
            lag = abs(np.subtract.outer(*2 * [self.nodes.hours]))
            lag = np.minimum(lag, day - lag) if day else lag
            inverse = np.linalg.inv(model_K**2 * np.exp(-lag / LASTS_H))
            for place in self.places["model"].reshape(len(free), count):
                self.precision[np.ix_(place, place)] = inverse

    def camera(self, table: CameraFrames, network: Network) -> Frames:
        """The frames of a table, with their scene."""
        target = self.description.target
        with errors_of(f"[[frames]] '{table.name}'"):
            source, parameters = target.scene, target.parameters
            if table.scene is not None:
                source, parameters = table.scene, {}
            options = texts("parameters", parameters | table.parameters)
            scene = values.load_with_values(source, options)
            return Frames(table, scene, network.facets, self.times)

    def traced(self, x: np.ndarray) -> TracedScenes:
        """The scenes, traced for the unknowns x that need it."""
        at = {u.name: u.at(step) for u, step in zip(self.unknowns, x) if u.is_traced}
        if not at:
            return self.first
        if (key := tuple(at.values())) not in self.kept:
            of_scene = {u.name for u in self.unknowns if u.is_of_scene}
            groups = dict(self.description.groups)
            for name in at.keys() - of_scene:
                group = name.rpartition(".")[0]
                table = groups.get(group, GroupTable())
                groups[group] = replace(table, emissivity=at[name])
            with ExitStack() as stack:
                for scene in {
                    id(s): s for s in (self.scene, *(c.scene for c in self.cameras))
                }.values():
                    known = values.parameters_of(scene)
                    own = {name: at[name] for name in at if name in of_scene and name in known}
                    stack.enter_context(values.changed(scene, own))
                network, _ = network_of(self.scene, replace(self.description, groups=groups))
                cameras = [camera.traced() for camera in self.cameras]
            self.kept = dict([*self.kept.items()][-2 * len(at) :])
            self.kept[key] = TracedScenes(network, cameras)
        return self.kept[key]

    def network(self, traced: TracedScenes, x: np.ndarray, heated: tuple | None = None) -> Network:
        """The network of traced scenes for the unknowns x.

        heated: group, and heat in it in equal parts of the day in place of its own.
        """
        network = changed(traced.network, self.unknowns, x)
        if heated is None:
            return network
        group, hours = heated
        table = replace(network.tables[group], internal_W_m2=0.0, internal_by_hour=hours)
        result = replace(network, groups=network.tables | {group: table})
        result.__dict__["light"] = network.light  # of the absorptances that are sought
        return result

    def course(
        self, z: np.ndarray, like: TwinCourse | None = None, heated: tuple | None = None
    ) -> TwinCourse:
        """The temperatures at z.

        like: course whose changes are taken as they are. heated: see `network`.
        """
        x, K = z[: len(self.unknowns)], len(self.unknowns)
        traced = self.traced(x)
        network = self.network(traced, x, heated)
        direct = [k for k, u in enumerate(self.unknowns) if not u.is_traced]
        pairs = [self.unknowns[k].column for k in direct] + [*self.others.items()]
        if like is not None:
            solved = self.alone = course(
                network, (), self.start_K, begin=self.alone, has_scatter=False, drift_K=self.drift_K
            )
            return replace(like, traced=traced, network=network, kelvin=solved.kelvin)
        columns = [network.column(*pair) for pair in pairs]
        solved = course(network, columns, self.start_K, begin=self.last, drift_K=self.drift_K)
        self.last = solved if heated is None else self.last
        changes = np.zeros((K + len(solved.changes) - len(direct), *solved.kelvin.shape))
        changes[direct] = solved.changes[: len(direct)]
        changes[K:] = solved.changes[len(direct) :]
        changes[K + len(self.others) :] *= self.of_scatter
        lighter = {}
        for k in set(range(K)) - set(direct):
            ends = []
            for side in (STEP, -STEP):
                moved = np.where(np.arange(K) == k, np.clip(x + side, *self.limits), x)
                there = self.traced(moved)
                balance = self.network(there, moved, heated)
                kelvin = course(
                    balance, (), self.start_K, has_scatter=False, drift_K=self.drift_K
                ).kelvin
                ends.append((there.cameras, kelvin, moved[k]))
            (above, warm, high), (below, cold, low) = ends
            changes[k] = (warm - cold) / (high - low)
            lighter[k] = above, below, high - low
        return TwinCourse(traced, network, solved.kelvin, changes, lighter)

    def in_band(self, course: TwinCourse, z: np.ndarray, number: int, band: str):
        """The course with one camera in another band, without errors of its own.

        Its frames are those that z predicts. None if the scene cannot be loaded in this band.
        """
        camera, x = self.cameras[number], z[: len(self.unknowns)]
        parameters = camera.scene.parameters | {"band": band}
        try:
            scene = values.load_with_values(camera.scene.source, parameters)
        except InputError:
            return None
        camera = camera.without_errors(scene)
        known = values.parameters_of(scene)

        def traced(x):
            mine = [(u, step) for u, step in zip(self.unknowns, x) if u.is_of_scene]
            at = {u.name: u.at(step) for u, step in mine if u.name in known}
            with values.changed(scene, at):
                return camera.traced()

        here, lighter = traced(x), {}
        temperatures = [self.kelvin(course, z, hour)[0] for hour in here.hours]
        here.measured = [here.radiance(k, kelvin) for k, kelvin in enumerate(temperatures)]
        for k in course.lighter:
            ends = np.clip(x[k] + np.array([STEP, -STEP]), *self.limits[:, k])
            above, below = (traced(np.where(np.arange(len(x)) == k, end, x)) for end in ends)
            lighter[k] = [above], [below], ends[0] - ends[1]
        cameras = TracedScenes(course.network, [here])
        return replace(course, traced=cameras, lighter=lighter)

    @property
    def limits(self) -> np.ndarray:
        """Bounds of x, (2, K)."""
        return np.array([u.limits for u in self.unknowns]).T

    def kelvin(self, course: TwinCourse, z: np.ndarray, hour: float) -> tuple[np.ndarray, list]:
        """Temperatures (n,) at an hour, and nodes of the model's error there with weights."""
        K = len(self.unknowns)
        count = K + len(self.others) + self.sizes["exchange"]
        rest = self.times.at(hour, course.changes[K:count])
        kelvin = self.times.at(hour, course.kelvin) + z[K:count] @ rest
        if not self.sizes["model"]:
            return kelvin, []
        ends, errors = self.nodes.ends(hour), z[self.places["model"]].reshape(len(self.free), -1)
        return kelvin + sum(w * (errors[:, n] @ self.free) for n, w in ends), ends

    def data(self, course: TwinCourse) -> list[Readings | Frames]:
        """Readings, and frames with the effective areas of a course."""
        return [*self.contact, *course.traced.cameras]

    def rows(self, course: TwinCourse, z: np.ndarray) -> Iterator[Rows]:
        """Yield the blocks of all data at z with their derivatives."""
        for number, datum in enumerate(self.data(course)):
            own = self.places[f"errors of {number}"]
            for k, hour in enumerate(datum.hours):
                kelvin, ends = self.kelvin(course, z, hour)
                block = datum.block(k, kelvin, z[own])
                changes = self.times.at(hour, course.changes)
                yield self.with_columns(course, block, (datum, number, k, kelvin), changes, ends)

    def with_columns(self, course: TwinCourse, block: DataBlock, of, changes, ends) -> Rows:
        """A block with its columns. of: its datum, number, time and temperatures."""
        datum, number, k, kelvin = of
        scatter = changes[len(changes) - self.sizes["exchange"] :]
        of_facets, entries = [changes.T], [np.arange(len(changes))]
        model = self.places["model"].reshape(len(self.free), -1)
        for node, weight in ends:
            of_facets.append(weight * self.free.T)
            entries.append(model[:, node])
        used = np.flatnonzero(block.own.any(axis=0))
        own = [block.own[:, used]]
        entries.append(self.places[f"errors of {number}"][used])
        if isinstance(datum, Frames):
            c = course.traced.cameras.index(datum)
            mean = datum.cells(k, kelvin).mean
            for unknown, (above, below, width) in course.lighter.items():
                more = above[c].radiance(k, kelvin) - below[c].radiance(k, kelvin)
                own.append((mean @ more)[:, None] / width)
                entries.append([unknown])
        return Rows(
            block,
            np.concatenate(of_facets, axis=1),
            np.concatenate(own, axis=1),
            np.concatenate(entries).astype(int),
            # Few randomisations show few patterns of their error, most of which is the same at all
            # times. It therefore counts in each block as often as there are times
            np.sqrt(len(datum.hours)) * np.linalg.norm(scatter, axis=0),
        )
