"""Methods that integrate a BRDF over the hemisphere (thesis 3.3).

Each method is one file. `METHODS` lists them all.
"""

from mi_lcair.benchmark.reflectance import (
    half_vector,
    lattice,
    normal_importance,
    rejection,
    sobol,
    stratified_monte_carlo,
    stratified_quadrature,
    uniform_quadrature,
)
from mi_lcair.benchmark.reflectance.method import ReflectanceMethod
from mi_lcair.benchmark.reflectance.problem import ReflectanceProblem, problem

METHODS: tuple[ReflectanceMethod, ...] = tuple(
    module.method
    for module in (
        uniform_quadrature,
        normal_importance,
        stratified_monte_carlo,
        stratified_quadrature,
        rejection,
        half_vector,
        sobol,
        lattice,
    )
)
