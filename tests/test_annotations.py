"""Type hints: complete for the public functions and their results, and seen by type checkers."""

import ast
import dataclasses
import inspect
import subprocess
import sys
import typing
from pathlib import Path

import pandas
import pytest
import xarray
from matplotlib.figure import Figure

import mi_lcair
from mi_lcair.physics.reflection.interface import ReflectionModel
from mi_lcair.plugins.paths.launch import Aim
from mi_lcair.rendering.views import View

ROOT = Path(__file__).resolve().parents[1]
# Names that modules import for type checkers only
LATER = {
    "Aim": Aim,
    "ReflectionModel": ReflectionModel,
    "Figure": Figure,
    "View": View,
    "pandas": pandas,
    "xarray": xarray,
}

# Modules whose classes users do not handle, unless they write a plugin or a model of their own
INNER = (".plugins.", ".physics.reflection.", ".physics.surroundings.surroundings")


def public_classes(annotation, module, found) -> dict:
    """The classes of mi_lcair that an annotation names, with those of their fields, by name."""
    if isinstance(annotation, str):
        annotation = eval(annotation, vars(sys.modules[module]) | LATER)
    is_word = typing.get_origin(annotation) is typing.Literal
    for part in () if is_word else typing.get_args(annotation):
        public_classes(part, module, found)
    is_ours = inspect.isclass(annotation) and annotation.__module__.startswith("mi_lcair.")
    inner = any(room in annotation.__module__ for room in INNER) if is_ours else True
    if not inner and annotation not in found.values():
        found[f"{annotation.__module__}.{annotation.__name__}"] = annotation
        if dataclasses.is_dataclass(annotation):
            for field in dataclasses.fields(annotation):
                public_classes(field.type, annotation.__module__, found)
        for function in methods(annotation).values():
            returned = inspect.signature(function).return_annotation
            public_classes(returned, function.__module__, found)
    return found


def methods(cls) -> dict:
    """The public methods and properties of a class, as functions by name."""
    own = {}
    for base in reversed([base for base in cls.__mro__ if base.__module__.startswith("mi_lcair.")]):
        own |= vars(base)
    own = {name: getattr(value, "fget", None) or value for name, value in own.items()}
    own = {name: getattr(value, "__func__", value) for name, value in own.items()}
    return {
        name: value
        for name, value in own.items()
        if inspect.isfunction(value) and not name.startswith("_")
    }


def bare(name, function) -> list[str]:
    """The parameters, and the return, of a function that have no annotation."""
    signature = inspect.signature(function)
    parameters = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
    missing = [f"{name}({p.name})" for p in parameters if p.annotation is p.empty]
    return missing + [f"{name} ->"] * (signature.return_annotation is signature.empty)


def test_annotations_are_complete():
    public = {name: getattr(mi_lcair, name) for name in mi_lcair.__all__ if name[0] != "_"}
    functions = {name: value for name, value in public.items() if inspect.isfunction(value)}
    assert len(functions) >= 14
    classes = {}
    for cls in set(public.values()) - set(functions.values()):
        public_classes(cls, "mi_lcair", classes)
    for function in functions.values():
        returned = inspect.signature(function).return_annotation
        public_classes(returned, function.__module__, classes)
    assert {"Signature", "Trend", "Budget", "Scene"} <= {
        name.rpartition(".")[2] for name in classes
    }
    for name, cls in classes.items():
        functions |= {f"{name}.{method}": value for method, value in methods(cls).items()}
    assert [line for name, function in functions.items() for line in bare(name, function)] == []


def test_the_stub_is_the_registry_of_public_names():
    """Each line of `__init__.pyi` names what it says, and no line is overlooked."""
    tree = ast.parse((ROOT / "mi_lcair" / "__init__.pyi").read_text(encoding="utf-8"))
    shown = {
        alias.asname: (node.module, alias.name)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert shown == {name: (home, name) for name, home in mi_lcair._HOME.items()}
    assert set(mi_lcair.__all__) == {"__version__", *shown}
    assert all(getattr(mi_lcair, name) is not None for name in shown)
    assert (ROOT / "mi_lcair" / "py.typed").exists()


@pytest.mark.slow
def test_a_users_script_under_mypy(tmp_path):
    """In a process of its own: mypy's trees stay, and slow each later collection of garbage."""
    script = tmp_path / "script.py"
    script.write_text(
        "import mi_lcair\n"
        'scene = mi_lcair.load("cavity", opening=8)\n'
        'image = mi_lcair.render(scene.mi, tolerance="1%", max_bounces="auto")\n'
        'watts: float = mi_lcair.signature("cavity").target.intensity\n'
        "reveal_type(image)\n"
        'mi_lcair.render("cavity", spp="many")\n'
        "mi_lcair.rendre\n"
    )
    options = ["--follow-imports=silent", "--no-error-summary"]
    out = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(script)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    ).stdout
    lines = [line.partition(".py:")[2] for line in out.splitlines()]
    assert [line.partition(":")[0] for line in lines] == ["5", "6", "7"], out
    assert 'Revealed type is "mi_lcair.rendering.images.render.Render"' in lines[0]
    assert 'Module has no attribute "rendre"' in lines[2]
