"""Spectral bands, given by name, by limits or by a detector's response.

A band is a set of wavelengths with quadrature weights.
"""

import os.path
import re
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.errors import InputError, unknown
from mi_lcair.files import revision
from mi_lcair.physics.spectral_table import LONGEST_UM, SHORTEST_UM, spectral_table
from mi_lcair.table import LARGEST

LIMITS_UM = {"SWIR": (1.0, 3.0), "MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0)}
# Smallest accepted response of a detector at its best wavelength, in the unit of the file.
SMALLEST_RESPONSE = 1e-12
# A table has a gap where neighbouring rows are further apart than GAP_UM. The margin in WIDEST_UM
# accepts steps of exactly 0.1 um, which differ from it by the rounding of decimal fractions.
GAP_UM = 0.1
WIDEST_UM = GAP_UM * (1 + 1e-9)
MOST_PARTS = 4  # parts of a table with gaps that an error message lists


@dataclass(frozen=True, eq=False)
class Band:
    """A quadrature rule over wavelength.

    The in-band value of a spectrum L is sum(weights_um * L(wavelengths_um)).

    Attributes
    ----------
    name
        Name of the band, such as "MWIR" or "3.5-4.2".
    wavelengths_um
        Nodes of the rule [um], (n,). Empty for the band `total`, which covers every wavelength;
        only closed forms apply to it.
    weights_um
        Weights of the rule [um], (n,), including the detector's response.
    lower_um, upper_um
        Limits of the band [um].
    response
        Rows of the detector's response, wavelength [um] and value, (2, n); None if it is 1.
    """

    name: str
    wavelengths_um: np.ndarray
    weights_um: np.ndarray
    lower_um: float
    upper_um: float
    response: np.ndarray | None = None

    @property
    def is_total(self) -> bool:
        """Whether this is the band `total`, which covers every wavelength."""
        return self.wavelengths_um.size == 0

    def response_at(self, wavelengths_um: ArrayLike) -> np.ndarray:
        """The detector's response at these wavelengths [um]; 0 outside the band."""
        wavelengths_um = np.asarray(wavelengths_um, dtype=float)
        inside = (self.lower_um <= wavelengths_um) & (wavelengths_um <= self.upper_um)
        return inside * (
            1.0 if self.response is None else np.interp(wavelengths_um, *self.response)
        )

    def rows(self, *tables: np.ndarray) -> np.ndarray:
        """Rising wavelengths [um] between which the response and spectra are straight lines.

        They are the limits of the band, and the rows of its response and of the spectra within it.
        tables: wavelengths of the rows of each spectrum [um].
        """
        of_response = [] if self.response is None else self.response[0]
        rows = np.concatenate([*tables, of_response])
        inside = rows[(self.lower_um < rows) & (rows < self.upper_um)]
        return np.unique(np.concatenate([[self.lower_um, self.upper_um], inside]))

    def row_weights(self, wavelengths_um: ArrayLike) -> np.ndarray:
        """Weight [um] of each row of a tabulated spectrum in its in-band value, (n,).

        The weights integrate the spectrum, on straight lines between its rows, times the response
        exactly.

        wavelengths_um: rising wavelengths of the rows [um], (n,). They must cover the band, which
        must not be `total`.
        """
        nodes = self.rows(wavelengths_um)
        step, count = np.diff(nodes) / 6, len(wavelengths_um)
        weights = np.zeros(count)
        # Between two nodes spectrum and response are straight lines. Their product is a parabola,
        # which Simpson's rule integrates exactly.
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

    def integral(self, wavelengths_um: ArrayLike, values: np.ndarray) -> np.ndarray:
        """In-band value (...) of tabulated spectra, values (..., n); see `row_weights`."""
        return values @ self.row_weights(wavelengths_um)

    def holds(self, other: "Band") -> bool:
        """Whether this band has limits, and another one lies within them."""
        is_held = self.lower_um <= other.lower_um and other.upper_um <= self.upper_um
        return is_held and not self.is_total

    def check_limits(self, what: str) -> None:
        """Raise InputError for the band `total`, which has no wavelengths.

        The message begins with `what`, which needs them.
        """
        if self.is_total:
            raise InputError(
                f"{what}: band total has no wavelengths; choose a band with limits, such as MWIR"
            )

    def check_covered(self, wavelengths_um: ArrayLike, what: str) -> None:
        """Raise InputError if a table with these rising wavelengths [um] does not cover the band.

        No table covers the band `total`. The message begins with `what`, the name of the table.
        """
        x = wavelengths_um
        first = np.searchsorted(x, self.lower_um, side="right") - 1
        last = np.searchsorted(x, self.upper_um)
        if first >= 0 and last < len(x) and np.diff(x[first : last + 1]).max() <= WIDEST_UM:
            return
        parts = np.split(x, np.flatnonzero(np.diff(x) > WIDEST_UM) + 1)
        covered = ", ".join(f"{part[0]:.6g}-{part[-1]:.6g}" for part in parts[:MOST_PARTS]) + (
            ", ..." if len(parts) > MOST_PARTS else ""
        )
        raise InputError(
            f"{what}: does not cover band {self.label}; it has {covered} um"
            + (f", and gaps wider than {GAP_UM:g} um between" if len(parts) > 1 else "")
        )

    @property
    def header(self) -> dict[str, str]:
        """The band in the header of an image: its name and its limits."""
        return {"band": self.name, "wavelengths_um": f"{self.lower_um:g} {self.upper_um:g}"}

    @property
    def label(self) -> str:
        """The band as a title names it, with its limits: "MWIR 3-5 um"."""
        if self.is_total:
            return self.name
        limits = _limits(self.lower_um, self.upper_um)
        return f"{limits} um" if self.name == limits else f"{self.name} {limits} um"


def band(spec: str | Path | Band) -> Band:
    """The band that `spec` describes.

    spec is one of
    - "MWIR", "LWIR", "SWIR" or "total", in upper or lower case;
    - limits in um, such as "3.5-4.2";
    - the path of a CSV file with the header `wavelength_um,response`: the response is linear
    between
      its rows and 0 outside them;
    - a `Band`, which is returned as it is.

    Raises InputError for anything else, and for a file that holds no response.
    """
    if isinstance(spec, Band):
        return spec
    text = str(spec).strip()
    if text.lower() == "total":
        return _band("total", [], [], 0.0, np.inf)
    for name, (lower, upper) in LIMITS_UM.items():
        if text.lower() == name.lower():
            return _from_limits(name, lower, upper)
    number = r"([+-]?\d*\.?\d+(?:e[+-]?\d+)?|[+-]?\d+\.)"
    if limits := re.fullmatch(rf"{number}\s*-\s*{number}", text, re.IGNORECASE):
        lower, upper = float(limits[1]), float(limits[2])
        if not SHORTEST_UM <= lower < upper <= LONGEST_UM:
            raise InputError(
                f"band '{text}': the limits must rise, within {SHORTEST_UM:g} to {LONGEST_UM:g} um"
            )
        return _from_limits(_limits(lower, upper), lower, upper)
    if isinstance(spec, Path) or text.lower().endswith(".csv") or os.path.exists(text):
        return _from_response(Path(text), revision(text))
    raise unknown(
        "band", text, [*LIMITS_UM, "total", "limits in um such as 3.5-4.2", "a .csv file"]
    )


def known_band(name: str) -> Band | None:
    """The Band of a name; None for one that was read from a file."""
    try:
        return band(name)
    except InputError:
        return None


def _limits(lower, upper):
    return f"{lower:g}-{upper:g}"


def _band(name, nodes, weights, lower, upper, response=None):
    arrays = np.array(nodes, dtype=float), np.array(weights, dtype=float)
    for array in (*arrays, *([] if response is None else [response])):
        array.setflags(write=False)
    return Band(name, *arrays, lower, upper, response)


# A scene names its band in each emitter, so that bands are made once.
@lru_cache(maxsize=64)
def _from_limits(name, lower, upper):
    return _band(name, *_gauss(lower, upper), lower, upper)


# Quadrature

_legendre = cache(np.polynomial.legendre.leggauss)
MOST_AT_ONCE = 4096  # nodes of a response that are thinned together, to bound the memory
PANEL_RATIO = 3.0  # upper / lower limit of the widest panel of a quadrature


def _gauss(lower, upper):
    """Gauss-Legendre nodes and weights [um] from `lower` to `upper` [um].

    They integrate Planck's law at any temperature.
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


def _gauss_between(wavelengths):
    """Nodes and weights of `_gauss` between each two neighbours of rising wavelengths [um]."""
    lower, upper = wavelengths[:-1], wavelengths[1:]
    wide = upper > PANEL_RATIO * lower
    rules = [_gauss(a, b) for a, b in zip(lower[wide], upper[wide])]
    counts = _node_count(lower, upper)
    for count in np.unique(counts[~wide]):  # all intervals with the same number of nodes at once
        alike = ~wide & (counts == count)
        a, width = lower[alike, None], (upper - lower)[alike, None]
        x, w = _legendre(int(count))
        rules.append(((a + width * (x + 1) / 2).ravel(), (width * w / 2).ravel()))
    nodes, weights = (np.concatenate(part) for part in zip(*rules))
    order = np.argsort(nodes)
    return nodes[order], weights[order]


def _node_count(lower, upper):
    """Number of Gauss nodes that a panel needs.

    Within a panel Planck's law falls by a factor of up to e^(2 s), where Float64's smallest number
    bounds s. A layer of relative width 1/s at the panel's end needs a number of nodes that grows as
    sqrt(s).
    """
    s = 350 * (1 - lower / upper)
    return 4 + np.ceil(4 * np.sqrt(s)).astype(int)


def _gauss_of_measure(nodes, weights, count):
    """The Gauss rule with `count` nodes that replaces a weighted sum over many nodes.

    Rule and sum are equal for all polynomials of degree below 2 count. Lanczos's recurrence gives
    the Jacobi matrix, whose eigenvectors give the rule (Golub and Welsch 1969).
    """
    total = weights.sum()
    basis = np.empty((count + 1, len(nodes)))
    basis[0] = np.sqrt(weights / total)
    diagonal, beside = np.empty(count), np.empty(count)
    for k in range(count):
        new = nodes * basis[k]
        diagonal[k] = new @ basis[k]
        for _ in range(2):  # a single pass would lose orthogonality to rounding
            new -= (basis[: k + 1] @ new) @ basis[: k + 1]
        beside[k] = np.linalg.norm(new)
        basis[k + 1] = new / beside[k]
    rule, vectors = np.linalg.eigh(
        np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
    )
    return rule, total * vectors[0] ** 2


# A detector's response


@lru_cache(maxsize=8)
def _from_response(path, revision):
    """The band of a response file; the revision makes an edited file be read again."""
    wavelengths, response = _read_response(path)
    # The response is above 0 up to the neighbours of its first and last value above 0.
    used = np.flatnonzero(response)
    first, last = max(used[0] - 1, 0), min(used[-1] + 2, len(response))
    wavelengths, response = wavelengths[first:last], response[first:last]

    nodes, weights = _gauss_between(wavelengths)
    weights = weights * np.interp(nodes, wavelengths, response)
    nodes, weights = nodes[weights > 0], weights[weights > 0]
    limits, table = map(float, wavelengths[[0, -1]]), np.array([wavelengths, response])
    return _band(path.stem, *_thinned(nodes, weights), *limits, table)


def _thinned(nodes, weights):
    """A rule with as few nodes as a smooth band of the same width has.

    A response of 1000 rows then costs no more than the band MWIR.
    """
    panel = np.floor(np.log(nodes / nodes[0]) / np.log(PANEL_RATIO))
    rules = [_thinned_panel(nodes[panel == p], weights[panel == p]) for p in np.unique(panel)]
    return (np.concatenate(part) for part in zip(*rules))


def _thinned_panel(x, w):
    """The Gauss rule that replaces the nodes x and weights w of one panel.

    Many nodes are thinned in pieces first. The rule of a piece is exact for polynomials, so that
    the rule made from all pieces is the same as that made from all nodes.
    """
    if len(x) > MOST_AT_ONCE:
        pieces = range(0, len(x), MOST_AT_ONCE)
        rules = [_thinned_panel(*(part[k : k + MOST_AT_ONCE] for part in (x, w))) for k in pieces]
        x, w = (np.concatenate(part) for part in zip(*rules))
        return _thinned_panel(x, w)
    count = _node_count(x[0], x[-1])
    return _gauss_of_measure(x, w, count) if count < len(x) else (x, w)


def _read_response(path):
    """Rising wavelengths [um] and responses of a CSV file `wavelength_um,response`."""
    table = spectral_table(path, "band file", (("response", LARGEST),))
    if not table.columns[0].max() >= SMALLEST_RESPONSE:
        raise InputError(f"band file {path}: needs a response above 0")
    return table.wavelengths_um, table.columns[0]


# Spectra of sources other than blackbodies
# -----------------------------------------

BUNDLED = Path(__file__).with_name("lowtran7")


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectral radiance over wavelength, linear between the rows.

    wavelengths_um: rising wavelengths [um], (n,). radiance: [W m^-2 sr^-1 um^-1], (n,). bin_of: the
    spectrum of which it is a part, so that air transmits as much of both; None for no part.
    """

    name: str
    wavelengths_um: np.ndarray
    radiance: np.ndarray
    bin_of: ClassVar["Spectrum | None"] = None

    def at(self, wavelengths_um: ArrayLike) -> np.ndarray:
        """Spectral radiance [W m^-2 sr^-1 um^-1] at these wavelengths [um]."""
        return np.interp(wavelengths_um, self.wavelengths_um, self.radiance)

    def scaled(self, factor: float) -> "Spectrum":
        """The spectrum times a factor."""
        return replace(self, radiance=self.radiance * factor)

    def in_band_radiance(self, band: Band) -> float:
        """In-band radiance [W m^-2 sr^-1], weighted by the band's response.

        Raises InputError if the table does not cover the band.
        """
        band.check_covered(self.wavelengths_um, f"spectrum '{self.name}'")
        return float(band.integral(self.wavelengths_um, self.radiance))
