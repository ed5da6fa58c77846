"""Methods that compute the intensity of a scene toward the observer.

They are those of the thesis (3.5), path tracing with lattice points and with independent points,
and Mitsuba's own integrator. `METHODS` lists them all.
"""

from mi_lcair.benchmark.propagation.mirror import MULTIPLE, SINGLE
from mi_lcair.benchmark.propagation.path_tracing import (
    AMBIENT,
    INDEPENDENT,
    INDEPENDENT_EMITTERS,
    LATTICE,
    LATTICE_EMITTERS,
    TAIL,
)
from mi_lcair.benchmark.propagation.quadrature import HEMISPHERE, PEAK, STRATIFIED
from mi_lcair.benchmark.propagation.radiance_maps import RADIANCE_MAPS
from mi_lcair.benchmark.propagation.radiosity import RADIOSITY
from mi_lcair.benchmark.propagation.stock import STOCK

# Groups of methods; the page compares the fastest of each.
GROUPS = {
    "lattice": (LATTICE, LATTICE_EMITTERS),
    "independent": (INDEPENDENT, INDEPENDENT_EMITTERS),
    "stock": (STOCK,),
    "thesis": (SINGLE, MULTIPLE, HEMISPHERE, STRATIFIED, PEAK),
    "radiosity": (RADIOSITY, RADIANCE_MAPS),
    "closure": (AMBIENT, TAIL),
}
METHODS = tuple(method for group in GROUPS.values() for method in group)
