"""Reflection models from scatterometer measurements: `read` the files, `fit` a model, and know how
well it is determined.
"""

import importlib

_HOME = {
    "fit": "estimation",
    "read": "scatterometer.reading",
}  # public name: its module, imported at the first use (Dr.Jit is not cheap)
__all__ = [*_HOME]


def __getattr__(name):
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
