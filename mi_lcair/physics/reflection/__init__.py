"""Reflection models, one a file, and the interface that they share (`interface`).

A model is registered by its name in `NAMES`. The file NAME.py here holds it as `MODEL`; longer ones
have companions NAME_*.py. The Mitsuba plugin of that name is plugins/NAME_bsdf.py.
"""

import importlib

from mi_lcair.errors import unknown
from mi_lcair.physics.reflection.interface import ReflectionModel

NAMES = (  # the first is meant where a material or a fit names no model
    "sandford_robertson",
    "microfacet",
)
MODELS = {name: importlib.import_module(f"{__name__}.{name}").MODEL for name in NAMES}
DEFAULT = MODELS[NAMES[0]]


def model(name: str) -> ReflectionModel:
    """The reflection model of that name; InputError for a name that is not registered."""
    if name not in MODELS:
        raise unknown("reflection model", name, MODELS)
    return MODELS[name]
