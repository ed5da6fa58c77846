"""The house of CONTRIBUTING.md: floors, rooms, and which of them may import which.

Imports inside functions count, and so does the use of a public name, `mi_lcair.NAME`. Imports for
type checkers do not count.
"""

import ast
from collections import Counter
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import mi_lcair

ROOT = Path(__file__).resolve().parents[1]
# Floor of each room. Rooms of one floor import only from rooms that stand before them here.
FLOORS = {
    "mi_lcair": 1,
    "mi_lcair.physics": 2,
    "mi_lcair.scenes": 2,
    "mi_lcair.plugins": 3,
    "mi_lcair.fitting": 3,
    "mi_lcair.models3d": 3,
    "mi_lcair.rendering": 4,
    "mi_lcair.scenes.build": 4,  # builds the bundled models with models3d
    "mi_lcair.scenes.build_meshes": 4,
    "mi_lcair.derivatives": 5,
    "mi_lcair.signatures": 6,
    "mi_lcair.heating": 6,
    "mi_lcair.laboratory": 6,
    "mi_lcair.detection": 7,
    "mi_lcair.knowing": 8,
    "mi_lcair.show": 9,
    "mi_lcair.api": 10,
    "mi_lcair.cli": 11,
}
ORDER = list(FLOORS)
MOST_LINES = 600  # code lines of a module, without docstrings and comments
MOST_MODULES = 320


def room(module: str) -> str:
    """The room of a module: the longest name in FLOORS that fits."""
    return max((name for name in FLOORS if f"{module}.".startswith(f"{name}.")), key=len)


@pytest.fixture(autouse=True, scope="module")
def no_trees_stay():
    """They would slow each later collection of garbage."""
    yield
    modules.cache_clear()


@cache
def modules() -> dict:
    """The syntax tree of every module of the package, by name."""
    trees = {}
    for folder in ("mi_lcair", "plugins", "fitting", "scenes"):
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(parts if folder == "mi_lcair" else ("mi_lcair", *parts))
            trees[name.removesuffix(".__init__")] = ast.parse(path.read_text(encoding="utf-8"))
    return trees


def executed(tree, in_functions: bool):
    """The nodes of a syntax tree, without blocks for type checkers."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            continue
        if in_functions or not isinstance(node, (ast.FunctionDef, ast.Lambda)):
            waiting += ast.iter_child_nodes(node)


def imported(tree, in_functions: bool = True) -> set[str]:
    """Names of the modules of this package that a module imports or uses by a public name."""
    names = set()
    for node in executed(tree, in_functions):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{ast.unparse(node)} is a relative import"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                home = mi_lcair._HOME.get(alias.name) if node.module == "mi_lcair" else None
                names.add(home or (whole if whole in modules() else node.module))
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "mi_lcair":
            names.add(mi_lcair._HOME.get(node.attr, "mi_lcair"))
    return {name for name in names if f"{name}.".startswith("mi_lcair.")}


def arrows() -> list[tuple[str, str]]:
    """(module, module that it imports) for modules of different rooms."""
    return [
        (name, other)
        for name, tree in modules().items()
        if name not in ("mi_lcair", "mi_lcair.__main__")
        for other in imported(tree)
        if room(other) != room(name)
    ]


def test_arrows_go_down():
    """No module uses anything of a higher floor, and rooms of one floor form no circle."""
    upward = [
        f"{name} -> {other}"
        for name, other in arrows()
        if ORDER.index(room(other)) > ORDER.index(room(name))
    ]
    assert upward == []
    assert all(FLOORS[low] <= FLOORS[high] for low, high in pairwise(ORDER))


def test_no_circles():
    """Modules can be put in an order in which each imports only earlier ones."""
    waiting = {
        name: imported(tree, in_functions=False) & modules().keys() - {name, "mi_lcair"}
        for name, tree in modules().items()
    }
    while ready := {name for name, needed in waiting.items() if not needed & waiting.keys()}:
        for name in ready:
            del waiting[name]
    assert waiting == {}


def test_public_functions_are_faces():
    """A public function stands in a module of `api`. `fit` needs no scene."""
    functions = {name: home for name, home in mi_lcair._HOME.items() if name[0].islower()}
    assert functions.pop("fit") == "mi_lcair.fitting.estimation"
    assert {home.rpartition(".")[0] for home in functions.values()} == {"mi_lcair.api"}
    modules_of_api = {home.rpartition(".")[2] for home in functions.values()}
    assert not modules_of_api & functions.keys(), "importing the module would hide the function"


@pytest.mark.parametrize("word", ["scene_of", "scenario_of"])
def test_names_are_resolved_above_the_work(word):
    users = {
        room(name)
        for name, tree in modules().items()
        if any(isinstance(node, ast.Name) and node.id == word for node in ast.walk(tree))
    }
    assert users == {"mi_lcair.api"}


def test_objects_are_made_in_the_thread_that_loads():
    """Otherwise loading can hang, see `mi_lcair.tasks`."""
    for path in sorted(ROOT.glob("mi_lcair/**/*.py")):
        for call in (node for node in ast.walk(ast.parse(path.read_text())) if is_load(node)):
            assert "parallel" in {word.arg for word in call.keywords}, f"{path}:{call.lineno}"


def is_load(node) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "mi.load_dict"


def code_lines(name: str) -> int:
    """Lines of a module without blank lines, comments and docstrings."""
    tree = modules()[name]
    documented = {
        line
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node)
        for line in range(node.body[0].lineno, node.body[0].end_lineno + 1)
    }
    text = (ROOT / file_of(name)).read_text(encoding="utf-8").splitlines()
    return sum(
        bool(line.strip()) and not line.strip().startswith("#") and number not in documented
        for number, line in enumerate(text, 1)
    )


def file_of(name: str) -> Path:
    """The file of a module."""
    path = ROOT.joinpath(*name.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def test_modules_can_be_read():
    assert len(modules()) <= MOST_MODULES
    assert {name: n for name in modules() if (n := code_lines(name)) > MOST_LINES} == {}


def test_a_class_name_stands_once():
    classes = Counter(
        node.name
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    )
    assert len(classes) > 300 and [name for name, n in classes.items() if n > 1] == []


def test_a_folder_is_no_public_function():
    """Importing the folder would hide the function."""
    assert not mi_lcair._HOME.keys() & {path.name for path in (ROOT / "mi_lcair").iterdir()}
