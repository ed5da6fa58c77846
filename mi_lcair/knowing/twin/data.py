"""What was measured of a twin, and what its temperatures predict: readings and frames.

Every datum makes blocks: residuals of one time, their weights, and their derivatives with respect
to temperatures' columns and to errors of its own, whose standard deviation is 1.
"""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import ndimage, sparse

from mi_lcair.declared import Bounds
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.heating.conductors import Facets
from mi_lcair.heating.temperatures.description import KELVIN
from mi_lcair.knowing.inversion.data.readings import (
    NETD_K,
    Measurement,
    measured_radiance,
    noise_of_netd,
)
from mi_lcair.knowing.twin.problem import CameraFrames, SeriesTable
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from mi_lcair.physics.estimation.verdicts import inner_deviation
from mi_lcair.rendering.parameters.values import changed, parameters_of
from mi_lcair.rendering.scene import Scene
from mi_lcair.table import read_table

OTHER_K = 10.0  # change of a surrounding temperature from which its effective area follows
BAD = 5.0  # standard deviations from which a pixel is left out as dead or hot
FEWEST = 4  # pixels of a cell


@dataclass(frozen=True)
class DataBlock:
    """Measured less predicted values of one time.

    residual, weight: (N,), inverse variances. facets: (N, n), derivatives with respect to the
    temperatures. own: (N, q), with respect to the errors of the datum. part: (N,), to which mean
    each value belongs in the test of the fit.
    """

    residual: np.ndarray
    weight: np.ndarray
    facets: sparse.csr_array
    own: np.ndarray
    part: np.ndarray


@dataclass(frozen=True)
class FrameCells:
    """Means over the pixels of a frame that show one facet.

    mean: (cells, pixels). weight: inverse variances, (cells,). group: that is shown, (cells,).
    coarse: variance of the pixels over that which is stated, at least 1, (cells,).
    """

    mean: sparse.csr_array
    weight: np.ndarray
    group: np.ndarray
    coarse: np.ndarray


@dataclass(frozen=True)
class Times:
    """Even hours, with straight lines between them.

    day: 24 for a day that is repeated, None for a series.
    """

    hours: np.ndarray
    day: float | None

    def check(self, where: str, hours: np.ndarray) -> None:
        """Raise InputError for hours outside the weather, and for one that is there twice."""
        if self.day and not (min(hours) >= 0 and max(hours) <= self.day):
            raise InputError(
                f"{where}: hours {min(hours):g} to {max(hours):g} are not those of one "
                "day, 0 to 24; give start_K of [run] for a series of days"
            )
        given, counts = np.unique(hours, return_counts=True)
        if (counts > 1).any():
            raise InputError(f"{where}: hour {given[counts.argmax()]:g} stands in two rows")
        first, last = 2 * self.hours[0] - self.hours[1], self.hours[-1]
        if not self.day and not (first - 1e-9 <= min(hours) and max(hours) <= last + 1e-9):
            raise InputError(
                f"{where}: hours {min(hours):g} to {max(hours):g} leave those of the "
                f"weather, {first:g} to {last:g}"
            )

    def ends(self, hour: float) -> list[tuple[int, float]]:
        """Numbers of the hours on either side of one, with their weights."""
        m, step = len(self.hours), self.hours[1] - self.hours[0]
        place = (hour - self.hours[0]) / step
        place = place % m if self.day else np.clip(place, 0, m - 1)
        first = int(place)
        return [(first, 1 - (place - first)), ((first + 1) % m, place - first)]

    def at(self, hour: float, values: np.ndarray) -> np.ndarray:
        """Values (..., m, n) at an hour, (..., n)."""
        return sum(weight * values[..., k, :] for k, weight in self.ends(hour))


class Readings:
    """Measured temperatures of groups or facets.

    hours: (N,). columns: their names. kelvin: (N, columns).
    """

    def __init__(self, table: SeriesTable, facets: Facets, times: Times):
        path, self.name = table.measured, "contact"
        where = f"measured {path}"
        read = read_table(path, ("hour",), "measured")
        numbers = read.numbers(read.columns)
        self.hours = numbers.pop("hour")
        times.check(where, self.hours)
        if not numbers:
            raise InputError(f"{where}: has no column of temperatures; give one named as a group")
        weights = []
        for name, values in numbers.items():
            row = np.zeros(len(facets.area))
            if name.startswith("facet_") and name[6:].isdigit():
                row[facets.number == int(name[6:])] = 1.0
            else:
                check_known(f"group of {where}", facets.groups, name)
                row = (facets.group == facets.groups.index(name)) * facets.area
            if not row.any():
                raise InputError(f"{where}: there is no {name}")
            read.check_range(name, values, Bounds(**KELVIN))
            weights.append(row / row.sum())
        self.columns = tuple(numbers)
        self.weights = sparse.csr_array(np.array(weights))
        self.kelvin = np.array([*numbers.values()]).T
        self.sigma, self.common = table.sigma_K, table.common_K
        self.own = ["error that all readings share [K]"] * (self.common > 0)
        self.own_sigma = [self.common] * len(self.own)

    def block(self, k: int, kelvin: np.ndarray, own: np.ndarray) -> DataBlock:
        """The block of a reading for temperatures (n,) and errors (q,)."""
        count = len(self.columns)
        columns = np.full((count, len(self.own)), self.common)
        return DataBlock(
            residual=self.kelvin[k] - self.weights @ kelvin - columns @ own,
            weight=np.full(count, self.sigma**-2.0),
            facets=self.weights,
            own=columns,
            part=np.arange(count),
        )


class Frames:
    """Images of one camera at some hours, and its effective areas by facet."""

    def __init__(self, table: CameraFrames, scene: Scene, facets: Facets, times: Times):
        self.table, self.scene, self.facets, self.name = table, scene, facets, table.name
        where = f"frames {table.list}"
        self.where = where
        read = read_table(table.list, ("hour", "image"), "frames")
        names = [name for name in read.columns if name not in ("hour", "image")]
        numbers = read.numbers(["hour", *names])
        self.hours = numbers.pop("hour")
        times.check(where, self.hours)
        known = {n for n, p in parameters_of(scene).items() if p.kind == "temperature"}
        check_known(f"temperature of {where}", known, *names)
        for name, values in numbers.items():
            read.check_range(name, values, Bounds(**KELVIN))
        self.surroundings, place = numbers, read.columns.index("image")
        folder = Path(table.list).parent
        images = [str(folder / cells[place]) for _, cells in read.rows]
        film = scene.sensor(table.sensor).film().crop_size()
        size = int(film[1]), int(film[0])
        of_file = ("quantity", "channel", "scale", "mask", "saturation", "netd_mK", "sigma")
        options = {name: getattr(table, name) for name in of_file}
        with errors_of(where):
            made = (Measurement(scene=scene.name, image=i, **options) for i in images)
            read_all = [measured_radiance(one, scene.band, size) for one in made]
        self.measured = [values.ravel() for values, *_ in read_all]
        self.counts = [counts.ravel() for _, _, counts, _ in read_all]
        self.size, self.fixed = size, {}
        drift = [f"{self.name}: offset at {hour:g} h [K]" for hour in self.hours]
        stated = [
            (table.gain, [f"{self.name}: gain [1]"]),
            (table.offset_K, [f"{self.name}: offset [K]"]),
            (table.pose_px, [f"{self.name}: {way} [pixel]" for way in ("right", "down")]),
            (table.drift_K, drift),
        ]
        self.own = [label for sigma, labels in stated if sigma for label in labels]
        self.own_sigma = [sigma for sigma, labels in stated if sigma for _ in labels]

    @property
    def kelvin_at_netd(self) -> float:
        """Radiance for a change of 1 K at the temperature of NETD and offsets [W m^-2 sr^-1]."""
        return float(in_band_slope(self.scene.band, NETD_K))

    def traced(self) -> "Frames":
        """The frames with the effective areas of the scene as it is now."""
        table, result = self.table, copy(self)
        options = {"sensor": table.sensor, "spp": table.spp, "seed": table.seed}
        result.of_facets, result.around = facet_matrix(self.scene, **options), {}
        before = parameters_of(self.scene)
        for name, kelvin in self.surroundings.items():
            value = before[name].value
            with changed(self.scene, {name: value + OTHER_K}):
                warmer = facet_matrix(self.scene, **options)
            L = in_band_radiance(self.scene.band, np.array([value + OTHER_K, value, *kelvin]))
            area = (warmer.rest - result.of_facets.rest).mean(axis=0) / (L[0] - L[1])
            result.around[name] = area, L[2:] - L[1]
        result.matrix, result.rest = result.parted(
            result.of_facets.mean, result.of_facets.rest.mean(axis=0)
        )
        if self.fixed.get("groups") is None:
            self.fixed["groups"] = result.groups()
        return result

    def without_errors(self, scene: Scene) -> "Frames":
        """Frames of a camera without errors of its own, of a scene that is loaded in another band.

        They have the same NETD, and show nothing yet.
        """
        result, table = copy(self), self.table
        netd = table.netd_mK or 1e3 * table.sigma / self.kelvin_at_netd
        ideal = {"gain_sigma": "0", "offset_K": 0.0, "drift_K": 0.0, "pose_px": 0.0}
        result.table = replace(table, netd_mK=netd, sigma=None, **ideal)
        result.scene, result.fixed, result.own, result.own_sigma = scene, {}, [], []
        return result

    def parted(self, matrix, rest) -> tuple[sparse.csr_array, np.ndarray]:
        """Matrix of the facets of the balance (pixels, n), and the radiance of all else."""
        traced = self.of_facets
        place = {int(facet): k for k, facet in enumerate(traced.facets)}
        column = np.array([place.get(int(number), -1) for number in self.facets.number])
        if (column < 0).all():
            raise InputError(
                f"{self.where}: the camera's scene has none of the facets of the heat balance; "
                "give it the same model"
            )
        other = np.setdiff1d(np.arange(len(traced.facets)), column)
        own = sparse.csr_array(matrix[:, np.maximum(column, 0)] * (column >= 0))
        L = in_band_radiance(traced.band, traced.temperature[other])
        return own, rest + matrix[:, other] @ L

    @cached_property
    def runs(self) -> list[tuple[sparse.csr_array, np.ndarray]]:
        """Matrix and rest of each randomisation."""
        traced = self.of_facets
        return [self.parted(*run) for run in zip(traced.matrices, traced.rest)]

    def groups(self) -> np.ndarray:
        """Group that each pixel shows most, (pixels,); -1 for none, or near an outline."""
        shares = (self.matrix @ self.facets.membership.T).toarray()
        whole = shares.sum(axis=1)
        if not whole.any():
            raise InputError(f"{self.where}: the camera sees no facet of the heat balance")
        group = np.where(whole > 0.5 * np.median(whole[whole > 0]), shares.argmax(axis=1), -1)
        image, reach = group.reshape(self.size), 2 * self.table.edge_px + 1
        ends = [f(image, size=reach) for f in (ndimage.minimum_filter, ndimage.maximum_filter)]
        return np.where((ends[0] == ends[1]).ravel(), group, -1)

    def radiance(self, k: int, kelvin: np.ndarray, of=None) -> np.ndarray:
        """Radiance of a frame for temperatures (n,), (pixels,) [W m^-2 sr^-1].

        of: matrix and rest in place of their means.
        """
        matrix, rest = of or (self.matrix, self.rest)
        values = matrix @ in_band_radiance(self.scene.band, kelvin) + rest
        return values + sum(area * L[k] for area, L in self.around.values())

    def cells(self, k: int, kelvin: np.ndarray) -> FrameCells:
        """The pixels of a frame by the facet that they show most, as at the first call.

        The noise of the render stands in predictions and in derivatives alike. A fit of single
        pixels would take its pattern for an error of the gain. An error of the render is the same
        in all frames, and therefore counts in each of them as often as there are frames.
        """
        if k not in self.fixed:
            values = self.radiance(k, kelvin)
            scatter = [self.radiance(k, kelvin, run) for run in self.runs]
            variance = np.var(scatter, axis=0, ddof=1) / len(scatter)
            noise = np.full(len(values), self.table.sigma)
            if self.table.netd_mK:
                noise = noise_of_netd(self.scene.band, values, self.table.netd_mK)
            is_good = self.counts[k] & (self.fixed["groups"] >= 0)
            facet, apart = self.facet_shown(), self.measured[k] - values
            rows, found = [], []
            for number in np.unique(facet[is_good]):
                mine = np.flatnonzero(is_good & (facet == number))
                rest = apart[mine] - np.median(apart[mine])
                mine = mine[abs(rest) <= BAD * inner_deviation(rest, 1e-300)]
                if (count := len(mine)) < FEWEST:
                    continue
                squared = np.mean(noise[mine] ** 2 + len(self.hours) * variance[mine])
                coarse = max(1.0, np.var(apart[mine], ddof=1) / squared)
                row = np.zeros(len(values))
                row[mine] = 1 / count
                rows.append(row)
                part = np.bincount(self.fixed["groups"][mine]).argmax()
                found.append((count / (coarse * squared), part, coarse))
            if not rows:
                raise InputError(
                    f"{self.where}, {self.hours[k]:g} h: no facet has {FEWEST} pixels away from "
                    "outlines; raise the resolution, or give edge_px = 0"
                )
            weight, part, coarse = map(np.array, zip(*found))
            self.fixed[k] = FrameCells(sparse.csr_array(np.array(rows)), weight, part, coarse)
        return self.fixed[k]

    def facet_shown(self) -> np.ndarray:
        """Column of the facet that each pixel shows most, (pixels,)."""
        return np.asarray(self.matrix.argmax(axis=1)).ravel()

    def block(self, k: int, kelvin: np.ndarray, own: np.ndarray) -> DataBlock:
        """The block of a frame for temperatures (n,) and errors (q,): a value for each cell."""
        values, band = self.radiance(k, kelvin), self.scene.band
        cells = self.cells(k, kelvin)
        columns = cells.mean @ self.own_columns(k, values)
        slope = sparse.diags_array(in_band_slope(band, kelvin))
        return DataBlock(
            residual=cells.mean @ (self.measured[k] - values) - columns @ own,
            weight=cells.weight,
            facets=sparse.csr_array(cells.mean @ self.matrix @ slope),
            own=columns,
            part=cells.group,
        )

    def own_columns(self, k: int, values: np.ndarray, table=None) -> np.ndarray:
        """Effect of one standard deviation of each error of the camera, (pixels, q).

        table: a description with other errors.
        """
        table, kelvin = table or self.table, self.kelvin_at_netd
        columns, ones = [], np.ones(len(values))
        if table.gain:
            columns.append(table.gain * values)
        if table.offset_K:
            columns.append(table.offset_K * kelvin * ones)
        if table.pose_px:
            down, right = np.gradient(values.reshape(self.size))
            columns += [-table.pose_px * right.ravel(), -table.pose_px * down.ravel()]
        if table.drift_K:
            is_k = np.arange(len(self.hours)) == k
            columns += [table.drift_K * kelvin * ones * one for one in is_k]
        return np.array(columns).reshape(-1, len(values)).T
