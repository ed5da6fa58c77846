"""Maps of an uncertainty budget: derivatives of each pixel, and its standard uncertainty."""

import json
from dataclasses import replace

import numpy as np

from mi_lcair.rendering.images.render import render_image
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.sensitivity.derivative_images import DerivativeImages
from mi_lcair.sensitivity.images import differentiate_image
from mi_lcair.uncertainty.inputs import Inputs


def budget_image(
    scene: Scene, inputs: Inputs, sampling: Sampling
) -> tuple[dict[str, np.ndarray], dict]:
    """Channels and header of an image with the derivatives of every pixel.

    Parameters
    ----------
    scene : Scene
    inputs : Inputs
        The uncertain quantities, such as `Budget.inputs` of the same scene.
    sampling : Sampling
        Without a tolerance.

    Returns
    -------
    channels : dict
        Those of `render`, a channel d.NAME.Y for each quantity (W m^-2 sr^-1 per unit of the
        quantity), and sigma.Y, the standard uncertainty of the radiance from all quantities.
    header : dict
        That of `render`, with the names and the covariance of the quantities.
    """
    image = render_image(scene, replace(sampling, progress=None))
    of_radiance = differentiate_image(scene, inputs.names, sampling)
    derivatives = {
        f"d.{name}.Y": column.astype(np.float32)
        for name, column in zip(inputs.names, of_radiance.derivative)
    }
    sigma = np.sqrt(variance(of_radiance, inputs.covariance)).astype(np.float32)
    stated = {
        "uncertain": json.dumps(inputs.names),
        "covariance": json.dumps(inputs.covariance.tolist()),
    }
    return image.channels | derivatives | {"sigma.Y": sigma}, image.header | stated


def variance(images: DerivativeImages, covariance: np.ndarray) -> np.ndarray:
    """Variance of the radiance of each pixel, (height, width).

    The square of a noisy derivative would be too large on average. Products of independent
    randomisations are right on average, and only they are used if there are several.
    """

    def quadratic(d):
        return np.einsum("khw,kl,lhw->hw", d, covariance, d, optimize=True)

    count = len(images.derivatives)
    squares = count**2 * quadratic(images.derivative)
    if count == 1:
        return squares
    same = sum(quadratic(column.astype(float)) for column in images.derivatives)
    return np.maximum(squares - same, 0) / (count * (count - 1))
