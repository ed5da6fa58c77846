"""The reflection models, one in each file, and their common interface (`interface`).

A model is registered by its name in `NAMES`. The file NAME.py in this folder holds the model as
`MODEL`. Long models are split into files NAME_*.py. The Mitsuba plugin of the model is
plugins/bsdfs/NAME.py.
"""

import importlib
from typing import TYPE_CHECKING

from mi_lcair.errors import check_known

if TYPE_CHECKING:
    from mi_lcair.physics.reflection.interface import ReflectionModel

# The first model is used where a material or a fit names no model.
NAMES = (
    "sandford_robertson",
    "microfacet",
    "grey",
)


def model(name: str) -> "ReflectionModel":
    """The reflection model of that name; InputError for a name that is not registered."""
    check_known("reflection model", NAMES, name)
    return importlib.import_module(f"{__name__}.{name}").MODEL
