"""An inverse problem: measurements, unknowns, and what is known beforehand, read from a TOML file.

Its tables are the dataclasses of `measurement` and `tables`.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from mi_lcair.declared import Rule, Table, rule
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.files import parse_toml, read_text
from mi_lcair.inversion.data.measurement import Candidate, Measurement
from mi_lcair.inversion.tables import Goal, RenderSettings, UnknownEntry
from mi_lcair.rendering.motions.table import MOTIONS, Declared, motions_of
from mi_lcair.toml_table import filled, table_of, tables_of

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
    rule(lambda t: not (t.data and t.goal), "has [[data]] beside [goal]; give one of them"),
    rule(lambda t: t.data or t.goal, "no [[data]]: add a measurement, or a [goal]"),
    rule(lambda t: t.unknowns, "no [unknowns]: name at least one parameter of the scene"),
    Rule(twice),
)


@dataclass(frozen=True)
class InverseProblem(Table, rules=PROBLEM):
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
            check_known("table", TABLES, *tree)
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
