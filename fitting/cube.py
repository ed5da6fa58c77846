"""Values and derivatives at points of a model's unit cube, on which every search runs."""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64


def parameters_at(model, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (m, n) of a reflection model at coordinates u (m, n), and their derivatives
    (m, n parameters, n coordinates).
    """
    # Each comes from a graph of its own. In a shared graph a parameter of which another is made
    # would be an interior node, and lose its tangent there.
    values, slopes = with_tangents(
        lambda *u: tuple(model.from_cube(u)[k] for k in range(len(u))), np.atleast_2d(u)
    )
    return model.exact_bounds(values), slopes


def with_tangents(
    function, u: np.ndarray, repeat=lambda coordinate: coordinate
) -> tuple[np.ndarray, np.ndarray]:
    """`function` of n coordinates and its derivatives with respect to each, in forward mode.

    u: (m, n). repeat: spreads one coordinate (m lanes) over the lanes that function works on.
    function returns one Dr.Jit array of l lanes, or k of them. Returns ((l,) or (l, k)) values and
    ((l, n) or (l, k, n)) derivatives.
    """
    lanes = [dr.detach(repeat(Float64(np.ascontiguousarray(column)))) for column in u.T]
    dr.enable_grad(lanes)
    outputs = function(*lanes)
    single = not isinstance(outputs, tuple)
    outputs = (outputs,) if single else outputs
    tangents = []
    for lane in lanes:
        dr.set_grad(lane, 1)
        # Not ClearInput: an output may be the coordinate itself.
        dr.forward_from(lane, flags=dr.ADFlag.ClearInterior)
        tangents.append([dr.grad(output) for output in outputs])
        dr.clear_grad((lane, outputs))
    outputs = [dr.detach(output) for output in outputs]
    dr.eval(outputs, tangents)
    values = np.stack([output.numpy() for output in outputs], axis=-1)
    slopes = np.stack([np.stack([t.numpy() for t in row], axis=-1) for row in tangents], axis=-1)
    return (values[..., 0], slopes[..., 0, :]) if single else (values, slopes)
