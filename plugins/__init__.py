"""Mitsuba plugins: BSDFs `material`, `plume` and one per reflection model, `thermal`, `sun`,
`sky_dome`, `bounce_path`.

Mitsuba's base classes belong to the variant that is set while a class statement runs. The modules
are therefore loaded again for each further variant. Functions that other modules have imported
find the classes of the current variant, because a module's names are replaced in place.
"""

import importlib
import sys

import mitsuba as mi

from mi_lcair.physics.reflection import NAMES

DEFAULT_VARIANT = "llvm_ad_mono"
MODULES = (
    "beside_scene",
    "derivatives",
    "emission.triangles",
    "emission.emissivity",
    "uniform_table",
    "reflection_bsdf",
    *(f"{name}_bsdf" for name in NAMES),
    "plume_bsdf",
    "thermal",
    "sun",
    "sky_dome",
    "paths.rounding",
    "emission.sources",
    "emission.radiance_bound",
    "emission.field_of_view",
    "paths.tail",
    "emission.emitter_table",
    "paths.channels",
    "lattice_sampler",
    "paths.surface_slopes",
    "paths.columns",
    "paths.aim",
    "paths.launch",
    "paths.rays",
    "paths.sums",
    "paths.facet_columns",
    "bounce_path",
)

_names: dict[str, dict[str, dict]] = {}  # names of each module, by variant


def register() -> None:
    """Register the plugins for the current variant and for every variant that is set later.

    Sets the variant llvm_ad_mono if none is set.
    """
    if mi.variant() is None:
        mi.set_variant(DEFAULT_VARIANT)
    mi.detail.add_variant_callback(define)
    define(None, mi.variant())


def define(old: str | None, new: str) -> None:
    """Load the plugins' modules under the variant `new`; a callback of Mitsuba.

    A variant that was set before gets its first classes again, which its loaded scenes and other
    modules hold. Variants without derivatives get no plugins.
    """
    if "_ad_" not in new:
        return
    if new in _names:
        for name, names in _names[new].items():
            vars(sys.modules[name]).update(names)
        return
    modules = [f"{__name__}.{module}" for module in MODULES]
    for name in modules:
        if name in sys.modules:
            importlib.reload(sys.modules[name])
        else:
            importlib.import_module(name)
    _names[new] = {name: dict(vars(sys.modules[name])) for name in modules}


register()
