"""Ways to integrate a BRDF over the hemisphere (thesis 3.3), one a file; `METHODS` lists them all."""
from . import (
    half_vector,
    normal_importance,
    rejection,
    sobol,
    stratified_monte_carlo,
    stratified_quadrature,
    uniform_quadrature,
)
from .method import Method
from .problem import Problem, problem

METHODS: tuple[Method, ...] = tuple(module.method for module in (
    uniform_quadrature, normal_importance, stratified_monte_carlo, stratified_quadrature, rejection, half_vector, sobol))
