"""Thermal-infrared radiance on Mitsuba 3: load a scene, render it, integrate it.

`import mi_lcair` is cheap. It arranges that an LLVM which Dr.Jit can use is chosen before `drjit`
is imported, and that the plugins are registered as soon as `mitsuba` is. Import it before either of
them.
"""

import importlib
import os
import sys

__version__ = "0.1.0"

_HOME = {  # public name: the module that it comes from, imported at the first use
    "InputError": "errors",
    "load": "rendering.scene",
    "render": "rendering.render",
    "fit": "fitting.estimation",
    "signature": "signatures.signature",
    "trend": "signatures.trend",
    "plan": "planning.plan",
    "audit": "planning.audit",
    "contrast": "detection.contrast",
}
__all__ = ["__version__", *_HOME]

# In a checkout plugins/, fitting/ and scenes/ lie beside this folder, in a wheel inside it. The
# parent is searched only in a checkout: in site-packages a foreign top-level package of one of
# these names would pass for ours.
if not os.path.isdir(os.path.join(__path__[0], "plugins")):
    __path__.append(os.path.dirname(__path__[0]))


def __getattr__(name):
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__():
    return sorted({*globals(), *_HOME})


def _prepare_mitsuba():
    """Registers the plugins with the imported Mitsuba, and takes its messages off stdout."""
    importlib.import_module(".plugins", __name__)
    importlib.import_module(".renderer_log", __name__).pass_on()


class _OnImport:
    """Import hook: LLVM and the kernel cache are chosen before drjit's code runs, the plugins are registered after
    mitsuba's has run.

    A scene that is loaded with plain `mi.load_file` then finds the plugins, and whatever needs no
    renderer (the command line's help, the radiometry) pays for neither Mitsuba nor LLVM.
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
    importlib.import_module(".llvm", __name__).check_loaded()
if "mitsuba" in sys.modules:
    _prepare_mitsuba()
