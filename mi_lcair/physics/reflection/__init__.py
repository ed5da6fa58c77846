"""The reflection models, one in each file, and their common interface (`interface`).

A model is registered by its name in `NAMES`. The file NAME.py in this folder holds the model as
`MODEL`. Long models are split into files NAME_*.py. The Mitsuba plugin of the model is
plugins/NAME_bsdf.py.
"""

import importlib

from mi_lcair.errors import unknown
from mi_lcair.physics.reflection.interface import ReflectionModel

# The first model is used where a material or a fit names no model.
NAMES = (
    "sandford_robertson",
    "microfacet",
)
MODELS = {name: importlib.import_module(f"{__name__}.{name}").MODEL for name in NAMES}
DEFAULT = MODELS[NAMES[0]]


def model(name: str) -> ReflectionModel:
    """The reflection model `name`. Raises InputError for a name that is not registered."""
    if name not in MODELS:
        raise unknown("reflection model", name, MODELS)
    return MODELS[name]
