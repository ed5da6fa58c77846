"""Spectral bands: a set of wavelengths and quadrature weights, by name, by limits or from a
detector's response.
"""

import os.path
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown

LIMITS_UM = {"SWIR": (1.0, 3.0), "MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0)}
SHORTEST_UM, LONGEST_UM = 0.1, 1000.0
CSV_HEADER = "wavelength_um,response"
GAP_UM = 0.1  # rows of a table further apart than this leave out what lies between them
MOST_PARTS = 4  # of a table with gaps that a message lists


@dataclass(frozen=True, eq=False)
class Band:
    """A quadrature rule over wavelength: the in-band value of L(wavelength) is sum(weights_um *
    L(wavelengths_um)).

    The weights (um) hold the detector's response, 1 for a band without one. `total` covers every
    wavelength and has empty arrays: only closed forms apply to it. response: its rows (wavelength
    um, value), (2, n); none: 1 throughout.
    """

    name: str
    wavelengths_um: np.ndarray
    weights_um: np.ndarray
    lower_um: float
    upper_um: float
    response: np.ndarray | None = None

    @property
    def is_total(self) -> bool:
        return self.wavelengths_um.size == 0

    def response_at(self, wavelengths_um) -> np.ndarray:
        """The detector's response at these wavelengths (um), 0 outside the band."""
        wavelengths_um = np.asarray(wavelengths_um, dtype=float)
        inside = (self.lower_um <= wavelengths_um) & (wavelengths_um <= self.upper_um)
        return inside * (
            1.0 if self.response is None else np.interp(wavelengths_um, *self.response)
        )

    def row_weights(self, wavelengths_um) -> np.ndarray:
        """The weight (um) of each row of a tabulated spectrum in its in-band value: straight lines
        between rows, times the response, exactly.

        wavelengths_um: rising (n,). The table must cover the band; `total` has no limits to cover.
        """
        breaks = [
            self.lower_um,
            self.upper_um,
            *([] if self.response is None else self.response[0]),
        ]
        inside = (self.lower_um < wavelengths_um) & (wavelengths_um < self.upper_um)
        nodes = np.unique(np.concatenate([breaks, wavelengths_um[inside]]))
        step, count = np.diff(nodes) / 6, len(wavelengths_um)
        weights = np.zeros(count)
        # between two nodes the product of two lines is a parabola: Simpson's rule is exact
        for x, share_of_step in (
            (nodes[:-1], step),
            ((nodes[:-1] + nodes[1:]) / 2, 4 * step),
            (nodes[1:], step),
        ):
            index = np.clip(np.searchsorted(wavelengths_um, x, side="right"), 1, count - 1)
            right = (x - wavelengths_um[index - 1]) / (
                wavelengths_um[index] - wavelengths_um[index - 1]
            )
            weight = share_of_step * self.response_at(x)
            weights += np.bincount(index, weight * right, count) + np.bincount(
                index - 1, weight * (1 - right), count
            )
        return weights

    def integral(self, wavelengths_um, values) -> np.ndarray:
        """In-band value of a tabulated spectrum (see row_weights); values: (..., n)."""
        return values @ self.row_weights(wavelengths_um)

    def check_covered(self, wavelengths_um, what: str) -> None:
        """Raises InputError, which begins with `what`, where a table with these rising rows (um)
        does not cover the band.
        """
        x = wavelengths_um
        first, last = (
            np.searchsorted(x, self.lower_um, side="right") - 1,
            np.searchsorted(x, self.upper_um),
        )
        if first >= 0 and last < len(x) and np.diff(x[first : last + 1]).max() <= GAP_UM:
            return
        parts = np.split(x, np.flatnonzero(np.diff(x) > GAP_UM) + 1)
        covered = ", ".join(f"{part[0]:.6g}-{part[-1]:.6g}" for part in parts[:MOST_PARTS]) + (
            ", ..." if len(parts) > MOST_PARTS else ""
        )
        raise InputError(
            f"{what}: does not cover band {self.label}; it has {covered} um"
            + (f", and gaps wider than {GAP_UM:g} um between" if len(parts) > 1 else "")
        )

    @property
    def label(self) -> str:
        """The band as a title names it, with its limits: "MWIR 3-5 um"."""
        if self.is_total:
            return self.name
        limits = _limits(self.lower_um, self.upper_um)
        return f"{limits} um" if self.name == limits else f"{self.name} {limits} um"


def band(spec: str | Path | Band) -> Band:
    """The band that `spec` describes.

    spec: "MWIR", "LWIR", "SWIR" or "total" in any case, limits "3.5-4.2" in um, the path of a CSV
    file with the header `wavelength_um,response` (straight lines between its rows, nothing
    outside), or a Band, which is returned. Raises InputError for anything else, and for a file that
    holds no response.
    """
    if isinstance(spec, Band):
        return spec
    text = str(spec).strip()
    if text.lower() == "total":
        return _band("total", [], [], 0.0, np.inf)
    for name, (lower, upper) in LIMITS_UM.items():
        if text.lower() == name.lower():
            return _band(name, *_gauss(lower, upper), lower, upper)
    number = r"([+-]?\d*\.?\d+(?:e[+-]?\d+)?|[+-]?\d+\.)"
    if limits := re.fullmatch(rf"{number}\s*-\s*{number}", text, re.IGNORECASE):
        return _from_limits(text, float(limits[1]), float(limits[2]))
    if isinstance(spec, Path) or text.lower().endswith(".csv") or os.path.isfile(text):
        return _from_response(Path(text))
    raise unknown(
        "band", text, [*LIMITS_UM, "total", "limits in um such as 3.5-4.2", "a .csv file"]
    )


def _limits(lower, upper):
    return f"{lower:g}-{upper:g}"


def _band(name, nodes, weights, lower, upper, response=None):
    arrays = np.array(nodes, dtype=float), np.array(weights, dtype=float)
    for array in arrays:
        array.setflags(write=False)
    return Band(name, *arrays, lower, upper, response)


def _from_limits(text, lower, upper):
    if not SHORTEST_UM <= lower < upper <= LONGEST_UM:
        raise InputError(
            f"band '{text}': the limits must rise, within {SHORTEST_UM:g} to {LONGEST_UM:g} um"
        )
    return _band(_limits(lower, upper), *_gauss(lower, upper), lower, upper)


# Quadrature

_legendre = cache(np.polynomial.legendre.leggauss)
PANEL_RATIO = 3.0  # the widest panel, as upper / lower limit


def _gauss(lower, upper):
    """Gauss-Legendre nodes and weights (um) that integrate Planck's law over lower to upper (um) at
    any temperature.
    """
    edges = np.geomspace(
        lower, upper, 1 + max(1, int(np.ceil(np.log(upper / lower) / np.log(PANEL_RATIO) - 1e-9)))
    )
    edges[[0, -1]] = lower, upper
    nodes, weights = [], []
    for a, b in zip(edges[:-1], edges[1:]):
        x, w = _legendre(_node_count(a, b))
        nodes.append(a + (b - a) * (x + 1) / 2)
        weights.append(w * (b - a) / 2)
    return np.concatenate(nodes), np.concatenate(weights)


def _node_count(lower, upper):
    """How many Gauss nodes a panel needs: Planck's law falls off within it by up to e^(2 s), s from
    Float64's smallest number, and a layer of relative width 1/s at the end takes a number of nodes
    that grows as sqrt(s).
    """
    s = 350 * (1 - lower / upper)
    return 4 + int(np.ceil(4 * np.sqrt(s)))


def _gauss_of_measure(nodes, weights, count):
    """The Gauss rule of `count` nodes for a sum over many nodes: equal for all polynomials of
    degree below 2 count.

    Lanczos's recurrence for the Jacobi matrix, then its eigenvectors (Golub and Welsch 1969).
    """
    total = weights.sum()
    basis = np.empty((count + 1, len(nodes)))
    basis[0] = np.sqrt(weights / total)
    diagonal, beside = np.empty(count), np.empty(count)
    for k in range(count):
        new = nodes * basis[k]
        diagonal[k] = new @ basis[k]
        for _ in range(2):  # once loses orthogonality to rounding
            new -= (basis[: k + 1] @ new) @ basis[: k + 1]
        beside[k] = np.linalg.norm(new)
        basis[k + 1] = new / beside[k]
    rule, vectors = np.linalg.eigh(
        np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
    )
    return rule, total * vectors[0] ** 2


# A detector's response


def _from_response(path):
    wavelengths, response = _read_response(path)
    used = np.flatnonzero(
        response
    )  # the support: up to the neighbours of the first and the last value above 0
    first, last = max(used[0] - 1, 0), min(used[-1] + 2, len(response))
    wavelengths, response = wavelengths[first:last], response[first:last]

    nodes, weights = [], []
    for a, b in zip(wavelengths[:-1], wavelengths[1:]):
        x, w = _gauss(a, b)
        w = w * np.interp(x, wavelengths, response)
        nodes.append(x[w > 0])
        weights.append(w[w > 0])
    nodes, weights = np.concatenate(nodes), np.concatenate(weights)
    return _band(
        path.stem,
        *_thinned(nodes, weights),
        float(wavelengths[0]),
        float(wavelengths[-1]),
        np.array([wavelengths, response]),
    )


def _thinned(nodes, weights):
    """As few nodes as a smooth band of the same width has: a response of 1000 rows costs no more
    than MWIR.
    """
    panel = np.floor(np.log(nodes / nodes[0]) / np.log(PANEL_RATIO))
    rules = []
    for p in np.unique(panel):
        x, w = nodes[panel == p], weights[panel == p]
        count = _node_count(x[0], x[-1])
        rules.append(_gauss_of_measure(x, w, count) if count < len(x) else (x, w))
    return (np.concatenate(part) for part in zip(*rules))


def _read_response(path):
    """Wavelengths (um, rising) and responses of a CSV file; lines that start with # and empty lines
    are skipped.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(f"band file {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"band file {path}: not a text file") from None
    lines = [
        (n, line.strip())
        for n, line in enumerate(lines, 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines or lines[0][1].replace(" ", "") != CSV_HEADER:
        found = f"line {lines[0][0]} is '{lines[0][1][:60]}'" if lines else "it is empty"
        raise InputError(f"band file {path}: {found}; the header must be '{CSV_HEADER}'")

    rows = []
    for n, line in lines[1:]:
        try:
            wavelength, response = (float(field) for field in line.split(","))
        except ValueError:
            raise InputError(
                f"band file {path}, line {n}: '{line[:60]}'; must be two numbers"
            ) from None
        if not SHORTEST_UM <= wavelength <= LONGEST_UM:
            raise InputError(
                f"band file {path}, line {n}: wavelength {wavelength:g}; "
                f"must be within {SHORTEST_UM:g} to {LONGEST_UM:g} um"
            )
        if not 0 <= response < np.inf:
            raise InputError(
                f"band file {path}, line {n}: response {response:g}; must be 0 or more"
            )
        if rows and wavelength <= rows[-1][0]:
            raise InputError(
                f"band file {path}, line {n}: wavelength {wavelength:g} after {rows[-1][0]:g}; must rise"
            )
        rows.append((wavelength, response))
    if len(rows) < 2 or not any(response for _, response in rows):
        raise InputError(f"band file {path}: needs two rows or more and a response above 0")
    return np.array(rows).T
