"""`image`, what the camera of a scenario records."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.api.scenario import scenario_of
from mi_lcair.camera.image import record_image
from mi_lcair.camera.image_result import Image
from mi_lcair.declared import Bounds, fraction
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import errors_of
from mi_lcair.progress import Progress
from mi_lcair.startup.threads import exclusively

MOST_FRAMES = 10_000


@exclusively
def image(
    scenario: Scenario | str | PathLike[str],
    frames: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
) -> Image:
    """The image of a scenario's target as its camera records it.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [camera], or the file or bundled name that `Scenario.read` takes. Its
        spp, max_spp and tolerance of [render] are those of a pixel. Of several numbers of
        reflections, the largest is used.
    frames : int
        Number of frames. They have independent noise, and one render.
    seed : int
        Seed of the camera's noise and fixed pattern. The same seed gives the same frames.
    progress : callable, optional
        Called with (paths through a pixel done, expected).
    parameters : mapping of str to object, optional
        Entries of a scenario that is named, by dotted key such as {"sensor.band": "LWIR"}.
    spp, tolerance, max_spp
        Entries of [render] of a scenario that is named: paths through a pixel, or the allowed rms
        standard error over the pixels on the target, such as 0.01 or "1%", and the most paths.

    Returns
    -------
    Image

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    scenario = scenario_of(
        scenario, parameters, spp=spp, tolerance=fraction(tolerance), max_spp=max_spp
    )
    Bounds(lower=1, upper=MOST_FRAMES).check(frames, "frames")
    Bounds(lower=0, upper=2**32 - 1).check(seed, "seed")
    with errors_of(f"scenario '{scenario.name}'"):
        return record_image(scenario, frames, seed, progress)
