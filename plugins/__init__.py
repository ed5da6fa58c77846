"""Mitsuba plugins, registered with Mitsuba when this package is imported, and made when used.

Mitsuba's base classes belong to the variant that is set while a class statement runs. Modules that
use Mitsuba are therefore loaded again for each further variant. Functions that other modules have
imported find the classes of the current variant, because a module's names are replaced in place.
"""

import importlib
import sys
from dataclasses import dataclass
from graphlib import TopologicalSorter
from types import FunctionType, ModuleType

import mitsuba as mi

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import NAMES
from mi_lcair.startup import VARIANTS


@dataclass(frozen=True)
class Plugin:
    """A plugin: its kind (bsdf, emitter, integrator or sampler) and its name in scene files.

    Plugin `bounce_path` of the kind integrator is the class `BouncePath` in
    integrators/bounce_path.py, which is imported when it is first used.
    """

    kind: str
    name: str

    @property
    def module(self) -> str:
        return f"{__name__}.{self.kind}s.{self.name}"

    @property
    def type(self) -> type:
        """The plugin's class in the current variant."""
        return vars(importlib.import_module(self.module))[self.name.title().replace("_", "")]

    def made(self, properties):
        """The plugin with the properties of a scene; raises InputError without Dr.Jit's arrays."""
        if "_ad_" not in mi.variant():
            raise InputError(
                f"plugin '{self.name}' needs Dr.Jit's arrays, which variant {mi.variant()} lacks; "
                "set llvm_ad_mono, or any that begins with llvm_ for the sampler in a scene of "
                "Mitsuba's plugins"
            )
        return self.type(properties)


PLUGINS = {
    name: Plugin(kind, name)
    for kind, names in {
        "bsdf": ("material", "plume", *NAMES),
        "emitter": ("sky", "sun", "thermal"),
        "integrator": ("bounce_path",),
        "sampler": ("lattice",),
    }.items()
    for name in names
}

_names: dict[str, dict[str, dict]] = {}  # names of each module, by variant


def register() -> None:
    """Register the plugins for the current variant and for every variant that is set later.

    Sets the variant llvm_ad_mono if none is set.
    """
    if mi.variant() is None:
        mi.set_variant(VARIANTS[0])
    mi.detail.add_variant_callback(define)
    define(None, mi.variant())


def define(old: str | None, new: str) -> None:
    """Load the plugins' modules under the variant `new`; a callback of Mitsuba.

    A variant that was set before gets its first classes again, which its loaded scenes and other
    modules hold. Variants without derivatives refuse the plugins.
    """
    if old in _names:
        _names[old] = names_of_modules()  # with those that were imported since
    for plugin in PLUGINS.values():
        vars(mi)[f"register_{plugin.kind}"](plugin.name, plugin.made)
    if "_ad_" not in new:
        return
    names_before = _names.get(new, {})
    for name, names in names_before.items():
        vars(sys.modules[name]).update(names)
    if _names:
        for name in bound_to_variant():
            if name not in names_before:
                importlib.reload(sys.modules[name])
    _names[new] = names_of_modules()


def names_of_modules() -> dict[str, dict]:
    """Names of each module that is bound to the current variant."""
    return {name: dict(vars(sys.modules[name])) for name in bound_to_variant()}


def bound_to_variant() -> list[str]:
    """Modules of this package that use Mitsuba, each after those from which it imports."""
    plugins = {plugin.module for plugin in PLUGINS.values()}
    modules = {
        name: vars(module)
        for name, module in sys.modules.items()
        if name.startswith(f"{__name__}.") and (vars(module).get("mi") is mi or name in plugins)
    }
    uses = {
        name: {
            v.__name__ if isinstance(v, ModuleType) else v.__module__
            for v in names.values()
            if isinstance(v, (type, FunctionType, ModuleType))
        }
        for name, names in modules.items()
    }
    return list(TopologicalSorter({n: uses[n] & modules.keys() - {n} for n in uses}).static_order())


register()
