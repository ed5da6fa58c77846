"""Methods that compute the intensity of a scene toward the observer.

They are those of the thesis (3.5), path tracing with lattice points and with independent points,
and Mitsuba's own integrator. `METHODS` lists them all.
"""

from benchmarks.methods.propagation.mirror import MULTIPLE, SINGLE
from benchmarks.methods.propagation.path_tracing import (
    AMBIENT,
    INDEPENDENT,
    INDEPENDENT_EMITTERS,
    LATTICE,
    LATTICE_EMITTERS,
    TAIL,
)
from benchmarks.methods.propagation.quadrature import HEMISPHERE, PEAK, STRATIFIED
from benchmarks.methods.propagation.radiance_maps import RADIANCE_MAPS
from benchmarks.methods.propagation.radiosity import RADIOSITY
from benchmarks.methods.propagation.stock import STOCK

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
