"""Thermal-infrared radiance on Mitsuba 3: load a scene, render it, integrate it.

`import mi_lcair` is fast. It installs an import hook. The hook chooses an LLVM that Dr.Jit can use
before `drjit` is imported, and registers the plugins when `mitsuba` is imported. Where these were
imported before mi_lcair, both are done afterwards, see `mi_lcair.llvm.prepare_loaded`.
"""

import importlib
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the names of `_HOME`, for type checkers and editors
    from mi_lcair.api.report import report as report
    from mi_lcair.camera.image import image as image
    from mi_lcair.detection.contrast import contrast as contrast
    from mi_lcair.errors import InputError as InputError
    from mi_lcair.fitting.estimation import fit as fit
    from mi_lcair.inversion.invert import invert as invert
    from mi_lcair.planning.audit import audit as audit
    from mi_lcair.planning.plan import plan as plan
    from mi_lcair.rendering.images.render import render as render
    from mi_lcair.rendering.scene import Scene as Scene
    from mi_lcair.rendering.scene import load as load
    from mi_lcair.sensitivity.images import derivative_images as derivative_images
    from mi_lcair.sensitivity.parameters import parameters as parameters
    from mi_lcair.sensitivity.window import sensitivities as sensitivities
    from mi_lcair.signatures.signature import signature as signature
    from mi_lcair.signatures.trend import trend as trend
    from mi_lcair.uncertainty.budget import budget as budget

__version__ = "0.2.0"

# Module of each public name; it is imported at the first use of the name.
_HOME = {
    "InputError": "errors",
    "Scene": "rendering.scene",
    "load": "rendering.scene",
    "render": "rendering.images.render",
    "fit": "fitting.estimation",
    "signature": "signatures.signature",
    "trend": "signatures.trend",
    "plan": "planning.plan",
    "audit": "planning.audit",
    "contrast": "detection.contrast",
    "image": "camera.image",
    "parameters": "sensitivity.parameters",
    "sensitivities": "sensitivity.window",
    "derivative_images": "sensitivity.images",
    "budget": "uncertainty.budget",
    "invert": "inversion.invert",
    "report": "api.report",
}
__all__ = ["__version__", *_HOME]

if not TYPE_CHECKING:  # type checkers would take it for any misspelt name

    def __getattr__(name):
        if name in _HOME:
            return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
        # With the name and the module, Python suggests the nearest name
        raise AttributeError(
            f"module '{__name__}' has no attribute '{name}'", name=name, obj=sys.modules[__name__]
        )


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})


def _prepare_mitsuba():
    """Prepare the imported Mitsuba: plugins, functions that take scenes, messages to logging."""
    importlib.import_module(".plugins", __name__)
    importlib.import_module(".rendering.loading.mitsuba_functions", __name__).take_loaded_scenes()
    importlib.import_module(".renderer_log", __name__).pass_on()


class _OnImport:
    """Import hook that prepares Dr.Jit before its import and Mitsuba after its import.

    Before drjit's code runs, the hook chooses an LLVM and the kernel cache. After mitsuba's code
    has run, the hook registers the plugins. A scene that is loaded with `mi.load_file` therefore
    finds the plugins. Parts that need no renderer, such as the command line's help and the
    radiometry, do not load Mitsuba or LLVM.
    """

    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name == "drjit":
            importlib.import_module(".llvm", __name__).prepare()
            importlib.import_module(".kernel_cache", __name__).prepare()
        if name != "mitsuba":
            return None
        others = (
            finder.find_spec(name, path, target) for finder in sys.meta_path if finder is not cls
        )
        spec = next(filter(None, others), None)
        if spec is not None:
            run_mitsuba = spec.loader.exec_module

            def exec_module(module):
                run_mitsuba(module)
                _prepare_mitsuba()

            spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, _OnImport)
if "drjit" in sys.modules:
    importlib.import_module(".llvm", __name__).prepare_loaded()
if "mitsuba" in sys.modules:
    _prepare_mitsuba()
