"""Quantities of an invented scene, and the report of a fit of its paint."""

from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from mi_lcair.rendering.parameters.entries import Parameter

KNOWN = {
    name: Parameter(name, kind, value, "1", -1e9, 1e9)
    for name, kind, value in (
        ("self.temperature", "temperature", 300.0),
        ("walls.temperature", "temperature", 260.0),
        ("sky.radiance", "radiance", 20.0),
        ("paint.a", "material", 0.25),
        ("paint.b", "material", 0.5),
        ("other.a", "material", 0.0),
    )
}
REPORT = {
    "model": "some",
    "parameters": {"a": 0.25, "b": 0.5},
    "standard_error": {"a": 0.02, "b": 0.01},
    "correlation": [[1, -0.5], [-0.5, 1]],
}


def inputs(tree) -> Inputs:
    return Inputs.of(Uncertainties.read(tree), KNOWN, "the scene")
