"""Unknowns of a problem: which parameter of which data each of them is, bounds and priors."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.inversion.problem import parts
from mi_lcair.inversion.tables import Entry
from mi_lcair.sensitivity.parameters import Parameter

# What has a value of its own by default: a surface's temperature is that of its state in every
# band, and a material's reflection that of its band in every state.
PER = {
    "temperature": ("state",),
    "facet": ("state",),
    "material": ("band",),
    "emissivity": ("band",),
    "radiance": ("band", "state"),
}
FACETS = ".facets"  # end of the name of all facet temperatures of a group
SPAN_K = 100.0  # width of the interval in which a temperature is taken to be known beforehand, K
SPAN_OFFSET = 100.0  # the same for an unknown offset, W m^-2 sr^-1
# Half widths of 95 % intervals up to which an unknown is determined, absolute and relative.
PRECISION = {
    "temperature": (1.0, 0.0),
    "facet": (1.0, 0.0),
    "radiance": (0.0, 0.05),
    "emissivity": (0.02, 0.0),
    "material": (0.02, 0.25),
    "gain": (0.0, 0.05),
    "offset": (np.inf, 0.0),
}


@dataclass(frozen=True)
class Unknown:
    """One number that is estimated.

    Attributes
    ----------
    label : str
        Its name in results, such as "lid.temperature [hot]".
    name : str
        Name of the scene's parameter.
    kind : str
        "temperature", "facet", "radiance", "emissivity", "material", "gain" or "offset".
    unit : str
        Unit of the value.
    start, lower, upper : float
        First guess and bounds.
    prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    data : tuple of int
        Numbers of the data, and of the candidates behind them, that it affects.
    is_sought : bool
        False for a nuisance parameter.
    facet : int, optional
        Number of the facet.
    span : float
        Width of the interval in which the value lies, from what is known without data.
    """

    label: str
    name: str
    kind: str
    unit: str
    start: float
    lower: float
    upper: float
    prior: tuple[float, float] | None
    data: tuple[int, ...]
    is_sought: bool = True
    facet: int | None = None

    @property
    def span(self) -> float:
        if self.kind in ("temperature", "facet"):
            return min(SPAN_K, self.upper - self.lower)
        if self.kind == "offset":
            return SPAN_OFFSET
        if self.kind in ("radiance", "gain"):
            return min(2 * max(abs(self.start), 1e-30), self.upper - self.lower)
        return self.upper - self.lower

    def is_determined(self, value: float, half_width: float) -> bool:
        """Whether half of a 95 % interval is small enough to call the unknown determined."""
        absolute, relative = PRECISION[self.kind]
        return half_width <= max(absolute, relative * abs(value))


@dataclass(frozen=True)
class Where:
    """What an unknown needs to know of a datum: its name, band, state and the scene's parameters.

    facets: temperatures of the facets by group, as {facet: K}.
    """

    name: str
    band: str
    state: str
    parameters: dict[str, Parameter]
    facets: dict[str, dict[int, float]]

    @property
    def labels(self) -> dict[str, str]:
        return {"band": self.band, "state": self.state, "data": self.name}


def unknowns(
    sought: dict[str, Entry], nuisance: dict[str, Entry], data: Iterable[Where], measured: int
) -> list[Unknown]:
    """The unknowns of a problem.

    Parameters
    ----------
    sought, nuisance : dict of str to Entry
        The tables [unknowns] and [nuisance].
    data : iterable of Where
        Measurements, and the candidates behind them.
    measured : int
        Number of measurements.

    Returns
    -------
    list of Unknown
        Those of [unknowns] first.

    Raises
    ------
    InputError
        For an unknown name, an unknown without data, and two that are the same parameter.
    """
    data = list(data)
    result, owner = [], {}
    for table, is_sought in ((sought, True), (nuisance, False)):
        # Entries with labels in brackets come first: those without take what is left.
        for text in sorted(table, key=lambda text: not parts(text)[1]):
            name, of = parts(text)
            check_name(name, of, data[:measured])
            found = [
                k
                for k, where in enumerate(data)
                if is_in(name, where) and set(of) <= set(where.labels.values())
            ]
            if not of:
                found = [k for k in found if (name, k) not in owner]
            if not any(k < measured for k in found):
                raise InputError(
                    f"'{text}' is an unknown without data"
                    + ("; other entries name it for all data" if not of else "")
                )
            for k in found:
                if (name, k) in owner:
                    raise InputError(
                        f"'{owner[name, k]}' and '{text}' are the same parameter of "
                        f"'{data[k].name}'; keep one"
                    )
                owner[name, k] = text
            result += instances(name, of, table[text], data, found, is_sought)
    order = {parts(text)[0]: k for k, text in enumerate([*sought, *nuisance])}
    return sorted(result, key=lambda one: (not one.is_sought, order[base_name(one)]))


def base_name(one: Unknown) -> str:
    return f"{one.name}{FACETS}" if one.kind == "facet" else one.name


def is_in(name: str, where: Where) -> bool:
    if name.endswith(FACETS):
        return name.removesuffix(FACETS) in where.facets
    return name in where.parameters


def check_name(name: str, of, data: list[Where]) -> None:
    """Raise InputError, with the nearest names, for a name that no datum knows."""
    if not any(is_in(name, where) for where in data):
        known = {known for where in data for known in where.parameters}
        known |= {f"{group}{FACETS}" for where in data for group in where.facets}
        raise unknown("parameter of the data's scenes", name, known)
    labels = {label for where in data for label in where.labels.values() if label}
    for label in of:
        if label not in labels:
            raise unknown("band, state or data", label, labels)


def instances(name, of, entry: Entry, data: list[Where], found: list[int], is_sought: bool):
    """The unknowns of one entry: one for each band, state or datum that has its own."""
    facets = name.endswith(FACETS)
    group = name.removesuffix(FACETS)
    parameters = [None if facets else data[k].parameters[name] for k in found]
    kind = "facet" if facets else parameters[0].kind
    per = PER[kind] if entry.per is None else entry.per
    by_label = {}
    for k, parameter in zip(found, parameters):
        key = tuple(data[k].labels[word] for word in per if data[k].labels[word])
        by_label.setdefault(key, []).append((k, parameter))
    for key, members in by_label.items():
        numbers = tuple(k for k, _ in members)
        words = key if len(by_label) > 1 else of
        suffix = f" [{', '.join(words)}]" if words else ""
        if facets:
            for facet, kelvin in data[numbers[0]].facets[group].items():
                label = f"{name}[{facet}]{suffix}"
                yield one_of(
                    label,
                    group,
                    "facet",
                    "K",
                    kelvin,
                    0.0,
                    np.inf,
                    entry,
                    numbers,
                    is_sought,
                    facet,
                )
            continue
        first = members[0][1]
        lower = max(parameter.lower for _, parameter in members)
        upper = min(parameter.upper for _, parameter in members)
        yield one_of(
            name + suffix,
            name,
            kind,
            first.unit,
            first.value,
            lower,
            upper,
            entry,
            numbers,
            is_sought,
        )


def one_of(label, name, kind, unit, value, lower, upper, entry, numbers, is_sought, facet=None):
    """The Unknown of one label; raises InputError for a start outside the bounds."""
    lower = lower if entry.lower is None else max(entry.lower, lower)
    upper = upper if entry.upper is None else min(entry.upper, upper)
    start = value if entry.start is None else entry.start
    if not lower < upper:
        raise InputError(f"'{label}': no value lies in its bounds {lower:g}..{upper:g}")
    if entry.start is None and entry.prior is not None:
        start = entry.prior[0]
    if entry.start is None and not lower <= start <= upper:
        start = min(max(start, lower), upper)
    if not lower <= start <= upper:
        raise InputError(f"'{label}': start = {start:g} is outside its bounds {lower:g}..{upper:g}")
    return Unknown(
        label,
        name,
        kind,
        unit,
        float(start),
        float(lower),
        float(upper),
        entry.prior,
        numbers,
        is_sought,
        facet,
    )


def instruments(data) -> list[Unknown]:
    """The unknown gains and offsets of measurements."""
    result = []
    for number, place in enumerate(data):
        for kind, start, lower in (("gain", 1.0, 0.0), ("offset", 0.0, -np.inf)):
            if getattr(place, kind):
                label, prior = f"{kind} [{place.name}]", getattr(place, f"{kind}_prior")
                unit = "1" if kind == "gain" else "W m^-2 sr^-1"
                value = start if prior is None else prior[0]
                result.append(
                    Unknown(label, label, kind, unit, value, lower, np.inf, prior, (number,), False)
                )
    return result
