"""The floors of CONTRIBUTING.md: modules import from their own floor or a lower one."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FLOORS = {  # the longest name that fits counts
    "mi_lcair.cli": 7,
    "mi_lcair.api": 6,
    "mi_lcair.reports": 5,
    "mi_lcair.signatures": 4,
    "mi_lcair.camera": 5,
    "mi_lcair.detection": 4,
    "mi_lcair.planning": 4,
    "mi_lcair.uncertainty": 5,
    "mi_lcair.inversion": 5,
    "mi_lcair.sensitivity": 4,
    "mi_lcair.benchmark": 4,
    "mi_lcair.rendering": 3,
    "mi_lcair.plugins": 2,
    "mi_lcair.fitting": 2,
    "mi_lcair.models3d": 2,
    "mi_lcair.scenes": 1,
    "mi_lcair.scenes.build": 3,  # builds the bundled models with models3d
    "mi_lcair.scenes.build_meshes": 3,
    "mi_lcair.physics": 1,
    "mi_lcair.formats": 1,
    "mi_lcair": 0,
}
MOST_FILES = 15
# Folders with one file for each picture, or each kind of result, may have more
EXEMPT = ("mi_lcair/reports/pictures", "mi_lcair/reports/sections")


def floor(module: str) -> int:
    return FLOORS[max((name for name in FLOORS if f"{module}.".startswith(f"{name}.")), key=len)]


@cache
def modules() -> list:
    """(name of the module, its syntax tree) of every module of the package."""
    found = []
    for folder in ("mi_lcair", "plugins", "fitting", "scenes"):
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(parts if folder == "mi_lcair" else ("mi_lcair", *parts))
            tree = ast.parse(path.read_text(encoding="utf-8"))
            found.append((name.removesuffix(".__init__"), tree))
    return found


NAMES = {name for name, _ in modules()}


def imports(tree):
    """The modules that a module imports when it is itself imported, and the level of each."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield (whole if whole in NAMES else node.module or ""), node.level
        elif isinstance(node, ast.Import):
            yield from ((alias.name, 0) for alias in node.names)


def test_arrows_go_down():
    wrong = [
        f"{name} imports {imported}"
        for name, tree in modules()
        if name not in ("mi_lcair", "mi_lcair.__main__")
        for imported, level in imports(tree)
        if level or (imported.startswith("mi_lcair.") and floor(imported) > floor(name))
    ]
    assert wrong == []


def test_no_circles():
    """Modules can be put in an order in which each imports only earlier ones."""
    waiting = {
        name: {imported for imported, _ in imports(tree)} & NAMES - {name}
        for name, tree in modules()
    }
    while ready := {name for name, needed in waiting.items() if not needed & waiting.keys()}:
        for name in ready:
            del waiting[name]
    assert waiting == {}


def test_folders_are_small():
    counts = {}
    for folder in ("mi_lcair", "plugins", "fitting", "scenes"):
        for path in (ROOT / folder).rglob("*.py"):
            counts[path.parent] = counts.get(path.parent, 0) + 1
    exempt = {ROOT / folder for folder in EXEMPT}
    large = {folder for folder, count in counts.items() if count > MOST_FILES}
    assert large - exempt == set()
