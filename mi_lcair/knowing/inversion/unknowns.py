"""Unknowns of a problem: which parameter of which data each of them is, bounds and priors."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mi_lcair.declared import Described, Rule, rule
from mi_lcair.errors import InputError, check_known, errors_of, unknown
from mi_lcair.files import parse_toml, read_text
from mi_lcair.knowing.inversion.data.readings import Candidate, Measurement
from mi_lcair.knowing.inversion.tables import Goal, RenderSettings, UnknownEntry
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.rendering.motions.motion import ANGLES, OBSERVER
from mi_lcair.rendering.motions.table import MOTIONS, Declared, motions_of
from mi_lcair.rendering.parameters.entries import AT, Parameter
from mi_lcair.toml_table import check_tables, filled, table_of, tables_of

# An inverse problem: measurements, unknowns, and what is known beforehand, read from a TOML file
# -----------------------------------------------------------------------------------------------
# Its tables are dataclasses: those of [[data]] are in `data.datum`, the others in `tables`.

TABLES = ("data", "unknowns", "nuisance", "candidates", "goal", "render", MOTIONS)
LABELLED = re.compile(r"\s*(?P<name>[^\[\]]*[^\[\]\s])\s*(\[(?P<of>[^\[\]]+)\])?\s*")


def twice(problem: "InverseProblem") -> str | None:
    """What has a name that something else has, too."""
    if both := problem.unknowns.keys() & problem.nuisance.keys():
        return f"'{min(both)}' is in [unknowns] and in [nuisance]; keep one"
    names = [row.name for row in (*problem.data, *problem.candidates)]
    same = next((name for name in names if names.count(name) > 1), None)
    return same and f"two data or candidates have the name '{same}'; rename one"


PROBLEM = (
    rule(lambda t: not (t.data and t.goal), "has both [[data]] and [goal]; give one of them"),
    rule(lambda t: t.data or t.goal, "no [[data]]: add a measurement, or a [goal]"),
    rule(lambda t: t.unknowns, "no [unknowns]: name at least one parameter of the scene"),
    Rule(twice),
)


@dataclass(frozen=True)
class InverseProblem(Described, rules=PROBLEM):
    """An inverse problem.

    name: that of its file. data, unknowns, nuisance, candidates, goal, render: its tables. The
    nuisance parameters are uncertain but not sought. motions: those that all scenes get, by name.
    """

    name: str
    data: tuple[Measurement, ...]
    unknowns: dict[str, UnknownEntry]
    nuisance: dict[str, UnknownEntry] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    goal: Goal | None = None
    render: RenderSettings = field(default_factory=RenderSettings)
    motions: dict[str, Declared] = field(default_factory=dict)

    @staticmethod
    def read(source) -> "InverseProblem":
        """Read a problem from a TOML file, with paths relative to its folder.

        Raises InputError if the file cannot be used.
        """
        what = f"problem '{source}'"
        tree = parse_toml(read_text(source, what), what)
        return InverseProblem.of(tree, Path(source).parent, str(source))

    @staticmethod
    def of(tree: dict, folder=".", name: str = "problem") -> "InverseProblem":
        """The problem that a tree of tables, as in the file, describes.

        folder: folder to which paths are relative. Raises InputError if an entry cannot be used.
        """
        folder = Path(folder)
        with errors_of(f"problem '{name}'"):
            check_tables(TABLES, tree)
            data = rows(tree, "data", Measurement, folder)
            candidates = rows(tree, "candidates", Candidate, folder)
            goal = tree.get("goal")
            goal = None if goal is None else filled(Goal, goal, "[goal]", folder)
            return InverseProblem(
                name=name,
                data=data,
                unknowns=entries(tree, "unknowns"),
                nuisance=entries(tree, "nuisance"),
                candidates=candidates,
                goal=goal,
                render=filled(RenderSettings, tree.get("render", {}), "[render]"),
                motions=motions_of(tree.get(MOTIONS, {}), folder),
            )


def rows(tree: dict, table: str, kind, folder: Path) -> tuple:
    """The entries of an array of tables as dataclasses, each with a name."""
    result = []
    for number, value in enumerate(tables_of(tree, table), 1):
        default = {"name": f"{'data' if table == 'data' else 'candidate'} {number}"}
        result.append(filled(kind, default | value, f"[[{table}]] {number}", folder))
    return tuple(result)


def entries(tree: dict, table: str) -> dict[str, UnknownEntry]:
    """The entries of [unknowns] or [nuisance] by name."""
    result = {}
    for name, value in table_of(tree, table).items():
        where = f"[{table}] '{name}'"
        if not isinstance(value, dict):
            raise InputError(f"{where} = {value!r}; must be a table, such as {{start = 300}}")
        if value and all(isinstance(inner, dict) for inner in value.values()):
            raise InputError(
                f"{where}: write the whole name in quotes, such as "
                f'"{name}.{next(iter(value))}" = {{}}'
            )
        if not LABELLED.fullmatch(name):
            raise InputError(f'{where}: must be a name, such as "lid.temperature" or "... [hot]"')
        result[name] = filled(UnknownEntry, value, where)
    return result


def parts(name: str) -> tuple[str, tuple[str, ...]]:
    """Name and bracketed labels of an unknown, such as "lid.epsilon [LWIR]"."""
    match = LABELLED.fullmatch(name)
    of = tuple(word.strip() for word in (match["of"] or "").split(",") if word.strip())
    return match["name"], of


# By default a temperature has one value for each state, the same in all bands, a reflection has one
# value for each band, the same in all states, and the change of a spectrum has one value.
VALUES_PER = {
    "temperature": ("state",),
    "facet": ("state",),
    "mode": ("state",),
    "material": ("band",),
    "spectrum": (),
    "emissivity": ("band",),
    "radiance": ("band", "state"),
    "motion": ("data",),
    "scenario": ("state",),
}
FACETS = ".facets"  # end of the name of all facet temperatures of a group
SPECTRUM = ".spectrum"  # end of the name of the changes of a material's spectrum at all its nodes
FAR = 3  # standard deviations of a prior, beyond which it has no values
SPAN_K = 100.0  # width of the interval in which a temperature is taken to be known beforehand, K
SPAN_OFFSET = 100.0  # the same for an unknown offset, W m^-2 sr^-1
# Half widths of 95 % intervals up to which an unknown is determined, absolute and relative.
PRECISION = {
    "temperature": (1.0, 0.0),
    "facet": (1.0, 0.0),
    "mode": (0.5, 0.0),
    "radiance": (0.0, 0.05),
    "emissivity": (0.02, 0.0),
    "material": (0.02, 0.25),
    "spectrum": (0.02, 0.05),
    "gain": (0.0, 0.05),
    "offset": (np.inf, 0.0),
}
# The same of motions by their unit, and the width of the interval that is known beforehand
OF_MOTIONS = {"deg": (0.1, 10.0), "pixel": (0.1, 10.0), "m": (0.01, 1.0), "1": (0.02, 0.5)}
OF_SIZE = 0.01  # the half width of control points, as a fraction of the range of their values
# Half widths of 95 % intervals of the weather, by unit, up to which it is determined
OF_WEATHER = {"K": 1.0, "1": 0.05, "hPa": 10.0, "km": 2.0, "ppmv": 20.0}
# Kinds of unknowns that are no parameters of a scene: how an image differs from the radiance
INSTRUMENT = ("gain", "offset")
# Where the observer of a scenario is: entries of its table [observer], which are no unknowns
PLACE = {f"{OBSERVER}.{name}": name for name in (*ANGLES, "range_m")}


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
        "temperature", "facet", "mode", "radiance", "emissivity", "material", "spectrum", "motion",
        "scenario" (of weather), "gain" or "offset".
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
    centre : tuple of float, optional
        Centre of the facet, or control point, metres; wavelength of a spectrum's node, micrometres.
    correlation_m : float, optional
        Distance over which facets of the group, or nodes, are alike, in the unit of `centre`.
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
    centre: tuple[float, ...] | None = None
    correlation_m: float | None = None

    @property
    def span(self) -> float:
        if self.kind in ("temperature", "facet"):
            return min(SPAN_K, self.upper - self.lower)
        if self.kind == "offset":
            return SPAN_OFFSET
        if self.kind in ("radiance", "gain"):
            return min(2 * max(abs(self.start), 1e-30), self.upper - self.lower)
        if self.kind == "motion":
            known = OF_MOTIONS[self.unit][1] if self.centre is None else np.inf
            if self.centre and self.prior:
                known = 4 * self.prior[1]  # its 95 % interval
            return min(known, self.upper - self.lower)
        return self.upper - self.lower

    def is_determined(self, value: float, half_width: float) -> bool:
        """Whether half of a 95 % interval is small enough to call the unknown determined.

        A parameter of a reflection model has the limits that it has in a fit.
        """
        if self.kind == "motion" and self.centre:
            return half_width <= OF_SIZE * (self.upper - self.lower)
        if self.kind == "motion":
            return half_width <= OF_MOTIONS[self.unit][0]
        if self.kind == "scenario":
            return half_width <= OF_WEATHER[self.unit]
        absolute, relative = PRECISION[self.kind]
        if self.kind == "material":
            known = {of.name: of for m in MODELS.values() for of in m.parameters}
            if of := known.get(self.name.rpartition(".")[2]):
                absolute, relative = of.absolute_precision, of.precision
        return half_width <= max(absolute, relative * abs(value))


@dataclass(frozen=True)
class Where:
    """Name, band and state of a datum, and the parameters of its scene, which may be unknown.

    facets: temperatures of the facets by group, as {facet: K}. centres: centres of all facets of
    the scene, (facets, 3) [m]; None if no facet is unknown.
    """

    name: str
    band: str
    state: str
    parameters: dict[str, Parameter]
    facets: dict[str, dict[int, float]]
    centres: np.ndarray | None = None

    @property
    def labels(self) -> dict[str, str]:
        return {"band": self.band, "state": self.state, "data": self.name}


def unknowns(
    sought: dict[str, UnknownEntry],
    nuisance: dict[str, UnknownEntry],
    data: Iterable[Where],
    measured: int,
) -> list[Unknown]:
    """The unknowns of a problem.

    Parameters
    ----------
    sought, nuisance : dict of str to UnknownEntry
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
            affected = [
                k
                for k, where in enumerate(data)
                if is_in(name, where) and set(of) <= set(where.labels.values())
            ]
            if not of:
                affected = [k for k in affected if (name, k) not in owner]
            if not any(k < measured for k in affected):
                raise InputError(
                    f"'{text}' is an unknown without data"
                    + ("; other entries name it for all data" if not of else "")
                )
            for k in affected:
                if (name, k) in owner:
                    raise InputError(
                        f"'{owner[name, k]}' and '{text}' are the same parameter of "
                        f"'{data[k].name}'; keep one"
                    )
                owner[name, k] = text
            result += instances(name, of, table[text], data, affected, is_sought)
    named = [(u.name, u.facet, k) for u in result for k in u.data]
    if len(named) > len(set(named)):
        twice = next(one for one in named if named.count(one) > 1)
        raise InputError(f"'{twice[0]}' is in several entries; keep one")
    order = {parts(text)[0]: k for k, text in enumerate([*sought, *nuisance])}
    return sorted(result, key=lambda listed: (not listed.is_sought, order[base_name(listed)]))


def base_name(listed: Unknown) -> str:
    owner, _, last = listed.name.rpartition(".")
    if listed.kind in ("spectrum", "motion") and listed.centre:
        return f"{owner}{SPECTRUM}" if listed.kind == "spectrum" else owner
    return f"{listed.name}{FACETS}" if listed.kind == "facet" else listed.name


def nodes_of(name: str, where: Where) -> dict[str, tuple[float, ...]]:
    """The parameters, with their places, that one name stands for.

    They change the spectrum of a material at its nodes, or move the control points of a surface.
    """
    if not name.endswith(SPECTRUM):
        points = {known: of.place for known, of in where.parameters.items() if of.place}
        return {known: place for known, place in points.items() if known.rpartition(".")[0] == name}
    first = f"{name.removesuffix(SPECTRUM)}.{AT}"
    nodes = [known for known in where.parameters if known.startswith(first)]
    return {known: (float(known.removeprefix(first).removesuffix("nm")) / 1000,) for known in nodes}


def is_in(name: str, where: Where) -> bool:
    if name.endswith(FACETS):
        return name.removesuffix(FACETS) in where.facets
    return name in where.parameters or bool(nodes_of(name, where))


def check_name(name: str, of, data: list[Where]) -> None:
    """Raise InputError, with the nearest names, for a name that no datum knows."""
    if not any(is_in(name, where) for where in data):
        if name in PLACE:
            raise InputError(
                f"{name} is no unknown of these data: of a scenario, give {PLACE[name]} in "
                f'[observer], or parameters = {{"{name}" = VALUE}} with the measurement; its '
                f"camera's unknowns are {OBSERVER}.x_px, {OBSERVER}.y_px and {OBSERVER}.roll_deg"
            )
        known = {known for where in data for known in where.parameters}
        known |= {f"{n.rpartition('.')[0]}{SPECTRUM}" for n in known if f".{AT}" in n}
        known |= {
            n.rpartition(".")[0] for where in data for n, of in where.parameters.items() if of.place
        }
        known |= {f"{group}{FACETS}" for where in data for group in where.facets}
        raise unknown("parameter of the data's scenes", name, known)
    labels = {label for where in data for label in where.labels.values() if label}
    check_known("band, state or data", labels, *of)


def instances(
    name, of, entry: UnknownEntry, data: list[Where], affected: list[int], is_sought: bool
):
    """The unknowns of one entry: one for each band, state or datum that has its own."""
    if nodes := nodes_of(name, data[affected[0]]):
        key = "correlation_um" if name.endswith(SPECTRUM) else "correlation_m"
        single = replace(entry, **{key: None})
        for node, place in nodes.items():
            for of_node in instances(node, of, single, data, affected, is_sought):
                yield replace(of_node, centre=place, correlation_m=getattr(entry, key))
        return
    facets = name.endswith(FACETS)
    if entry.correlation_um:
        raise InputError(f"'{name}': correlation_um is of spectra, such as \"paint{SPECTRUM}\"")
    if entry.correlation_m and not facets:
        raise InputError(
            f"'{name}': correlation_m is of facets, such as \"wing.facets\", and of control points"
        )
    group = name.removesuffix(FACETS)
    kind = "facet" if facets else data[affected[0]].parameters[name].kind
    per = VALUES_PER[kind] if entry.per is None else entry.per
    if entry.per is None and not facets and data[affected[0]].parameters[name].place:
        per = ()  # a body has one shape in all data
    by_label = {}
    for k in affected:
        key = tuple(data[k].labels[word] for word in per if data[k].labels[word])
        by_label.setdefault(key, []).append(k)
    for key, numbers in by_label.items():
        words = key if len(by_label) > 1 else of
        suffix = f" [{', '.join(words)}]" if words else ""
        plain = Unknown(
            label=name + suffix,
            name=group,
            kind=kind,
            unit="K",
            start=0.0,
            lower=0.0,
            upper=np.inf,
            prior=None,
            data=tuple(numbers),
            is_sought=is_sought,
        )
        if facets:
            for facet, kelvin in data[numbers[0]].facets[group].items():
                label = f"{name}[{facet}]{suffix}"
                of_facet = replace(plain, label=label, facet=facet, start=kelvin)
                if entry.correlation_m:
                    centre = tuple(data[numbers[0]].centres[facet].tolist())
                    length = entry.correlation_m
                    of_facet = replace(of_facet, centre=centre, correlation_m=length)
                yield with_entry(of_facet, entry)
            continue
        parameters = [data[k].parameters[name] for k in numbers]
        yield with_entry(
            replace(
                plain,
                unit=parameters[0].unit,
                start=parameters[0].value,
                lower=max(parameter.lower for parameter in parameters),
                upper=min(parameter.upper for parameter in parameters),
            ),
            entry,
        )


def with_entry(plain: Unknown, entry: UnknownEntry) -> Unknown:
    """An unknown with the first guess, the bounds and the prior of its entry.

    Raises InputError for bounds without a value between them, for a start outside the bounds, and
    for a prior whose mean is FAR standard deviations from all values of the parameter.
    """
    label, start = plain.label, plain.start if entry.start is None else entry.start
    lower = plain.lower if entry.lower is None else max(entry.lower, plain.lower)
    upper = plain.upper if entry.upper is None else min(entry.upper, plain.upper)
    if not lower < upper:
        raise InputError(f"'{label}': no value lies in its bounds {lower:g}..{upper:g}")
    if entry.prior is not None:
        (mean, sigma), low, high = entry.prior, plain.lower, plain.upper
        if max(low - mean, mean - high) > FAR * sigma:
            prior = f"'{label}': prior = {list(entry.prior)}"
            raise InputError(f"{prior} excludes all values; they lie in {low:g}..{high:g}")
    if entry.start is None and entry.prior is not None:
        start = entry.prior[0]
    if entry.start is None and not lower <= start <= upper:
        start = min(max(start, lower), upper)
    if not lower <= start <= upper:
        raise InputError(f"'{label}': start = {start:g} is outside its bounds {lower:g}..{upper:g}")
    return replace(
        plain, start=float(start), lower=float(lower), upper=float(upper), prior=entry.prior
    )


def instruments(data) -> list[Unknown]:
    """The unknown gains and offsets of data."""
    result = []
    for datum in data:
        entry = datum.entry

        def of_image(label, kind, unit, start, lower, upper, prior):
            value = start if prior is None else prior[0]
            result.append(
                Unknown(
                    label, label, kind, unit, value, lower, upper, prior, (datum.number,), False
                )
            )

        if entry.gain:
            of_image(f"gain [{entry.name}]", "gain", "1", 1.0, 0.0, np.inf, entry.gain_prior)
        if entry.offset:
            unit = "electrons" if entry.is_of_camera else "W m^-2 sr^-1"
            prior = entry.offset_prior
            of_image(f"offset [{entry.name}]", "offset", unit, 0.0, -np.inf, np.inf, prior)
    return result
