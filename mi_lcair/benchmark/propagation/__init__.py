"""Methods that compute the intensity of a scene toward the observer.

They are those of the thesis (3.5) and path tracing. `METHODS` lists them all.
"""

from mi_lcair.benchmark.propagation.mirror import MULTIPLE, SINGLE
from mi_lcair.benchmark.propagation.path_tracing import AMBIENT, EMITTER_SAMPLING, PATHS, TAIL
from mi_lcair.benchmark.propagation.quadrature import HEMISPHERE, PEAK, STRATIFIED
from mi_lcair.benchmark.propagation.radiosity import RADIOSITY

METHODS = (
    SINGLE,
    MULTIPLE,
    HEMISPHERE,
    STRATIFIED,
    PEAK,
    RADIOSITY,
    PATHS,
    EMITTER_SAMPLING,
    AMBIENT,
    TAIL,
)
