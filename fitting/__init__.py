"""Fits of reflection models to scatterometer measurements.

`read` reads the files. `fit` fits a model and states how well the data determine its parameters.
"""

import importlib

# Public names and their modules. A module is imported when its name is first used, because
# importing Dr.Jit is slow.
_HOME = {"fit": "estimation", "read": "scatterometer.reading"}
__all__ = [*_HOME]


def __getattr__(name):
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
