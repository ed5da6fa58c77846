"""Ways to compute what a scene sends toward the observer: those of the thesis (3.5), and path
tracing.
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
