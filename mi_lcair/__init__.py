"""Thermal-infrared radiance on Mitsuba 3: load a scene, render it, integrate it.

`import mi_lcair` is fast. It installs an import hook. The hook chooses an LLVM that Dr.Jit can use
before `drjit` is imported, and registers the plugins when `mitsuba` is imported. Where these were
imported before mi_lcair, both are done afterwards, see `mi_lcair.startup.prepare_loaded`.
"""

import importlib
import re
import sys
from pathlib import Path

__version__ = "1.0.0"

# The module of each public name. The stub `__init__.pyi`, which type checkers and editors read, is
# the registry; a module is imported at the first use of its name.
_HOME = {
    name: home
    for home, name in re.findall(
        r"^from (\S+) import \w+ as (\w+)$", Path(f"{__file__}i").read_text("utf-8"), re.MULTILINE
    )
}
__all__ = ["__version__", *_HOME]


def __getattr__(name):
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    # With the name and the module, Python suggests the nearest name
    raise AttributeError(
        f"module '{__name__}' has no attribute '{name}'", name=name, obj=sys.modules[__name__]
    )


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})


def _prepare_mitsuba():
    """Prepare the imported Mitsuba: plugins, functions that take scenes, log, threads."""
    importlib.import_module(".plugins", __name__)
    startup = importlib.import_module(".startup", __name__)
    startup.take_loaded_scenes()
    startup.log_to_python()
    startup.avoid_one_thread()


class _OnImport:
    """Import hook that prepares Dr.Jit before its import and Mitsuba after its import.

    Before drjit's code runs, the hook chooses an LLVM and the kernel cache. After mitsuba's code
    has run, the hook registers the plugins, whose code needs a variant with derivatives. A scene
    that is loaded with `mi.load_file` therefore finds the plugins. Parts that need no renderer,
    such as the command line's help and the radiometry, do not load Mitsuba or LLVM.
    """

    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name == "drjit":
            startup = importlib.import_module(".startup", __name__)
            startup.prepare_llvm()
            startup.prepare_kernel_cache()
        if name.startswith(f"{__name__}.plugins.") and "mitsuba" in sys.modules:
            importlib.import_module(".startup", __name__).check_variant(lambda v: "_ad_" in v)
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
    importlib.import_module(".startup", __name__).prepare_loaded()
if "mitsuba" in sys.modules:
    _prepare_mitsuba()
