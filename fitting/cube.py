"""Values and derivatives at points of a model's unit cube, in which the searches run."""

import drjit as dr
import numpy as np
from drjit.llvm.ad import Float64


def parameters_at(model, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters of a reflection model, and their derivatives with respect to the coordinates.

    u: coordinates (m, n). Returns parameters (m, n) and derivatives (m, n parameters, n
    coordinates).
    """
    # Each parameter is computed in a graph of its own. If a parameter depended on another one in
    # the same graph, the other one would be an interior node, and Dr.Jit would clear its tangent.
    values, slopes = with_tangents(
        lambda *u: tuple(model.from_cube(u)[k] for k in range(len(u))), np.atleast_2d(u)
    )
    return model.exact_bounds(values), slopes


def with_tangents(
    function, u: np.ndarray, repeat=lambda coordinate: coordinate
) -> tuple[np.ndarray, np.ndarray]:
    """Values of a function of n coordinates and its derivatives, by forward differentiation.

    Parameters
    ----------
    function
        Function of n Dr.Jit arrays (l lanes). It returns one Dr.Jit array (l lanes) or k of them.
    u
        Coordinates, (m, n).
    repeat
        Function that spreads one coordinate (m lanes) over the l lanes.

    Returns
    -------
    tuple
        Values, (l,) or (l, k), and derivatives with respect to each coordinate, (l, n) or (l, k,
        n).
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
