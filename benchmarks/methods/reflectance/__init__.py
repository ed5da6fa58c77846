"""Methods that integrate a BRDF over the hemisphere (thesis 3.3).

Each method is one file. `METHODS` lists them all.
"""

from importlib import import_module

from benchmarks.methods.reflectance.method import ReflectanceMethod
from benchmarks.methods.reflectance.problem import ReflectanceProblem, problem

NAMES = (
    *("uniform_quadrature", "normal_importance", "stratified_monte_carlo"),
    *("stratified_quadrature", "rejection", "half_vector", "sobol", "lattice"),
)
METHODS: tuple[ReflectanceMethod, ...] = tuple(
    import_module(f"{__name__}.{name}").method for name in NAMES
)
