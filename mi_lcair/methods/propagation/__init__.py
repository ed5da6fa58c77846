"""Ways to compute what a scene sends toward the observer: those of the thesis (3.5), and path tracing."""
from .mirror import MULTIPLE, SINGLE
from .path_tracing import AMBIENT, EMITTER_SAMPLING, PATHS, TAIL
from .quadrature import HEMISPHERE, PEAK, STRATIFIED
from .radiosity import RADIOSITY

METHODS = (SINGLE, MULTIPLE, HEMISPHERE, STRATIFIED, PEAK, RADIOSITY, PATHS, EMITTER_SAMPLING, AMBIENT, TAIL)
