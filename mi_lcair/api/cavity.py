"""`cavity`, the effective emissivity of a cavity."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.cavities.cavity import measured
from mi_lcair.cavities.cavity_result import Cavity
from mi_lcair.cavities.description import Description
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.startup.threads import exclusively

TOLERANCE = 2e-4  # half of the 95 % interval, where the renderer traces the cavity
MOST_PATHS = 2**27  # after which the paths end without the tolerance


@exclusively
def cavity(
    description: str | PathLike[str] | Mapping,
    *,
    tolerance: float = TOLERANCE,
    seed: int = 0,
    progress: Progress | None = None,
) -> Cavity:
    """Effective emissivity of a cavity by wavelength, with its uncertainty.

    Diffuse walls of a cylinder, a cone, a cylinder with a cone and a sphere are divided into rings,
    whose radiosity is solved (thesis 3.5.2). All other walls are traced by the renderer.

    Parameters
    ----------
    description : str, path-like or dict
        TOML file with the tables [shape], [wall], [view] and [sigma], or these tables; see
        `mi_lcair.cavities.description`.
    tolerance : float
        Half of the 95 % interval of the effective emissivity, where the renderer traces it. Rings
        have an error below 2e-5, which is stated.
    seed : int
        The same seed gives the same result.
    progress : callable or None
        Called with (paths done, expected).

    Returns
    -------
    Cavity

    Raises
    ------
    InputError
        If the description cannot be used.
    """
    sampling = Sampling(tolerance=tolerance, max_spp=MOST_PATHS, seed=seed, progress=progress)
    return measured(Description.read(description), sampling)
