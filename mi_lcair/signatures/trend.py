"""Trend: intensity of a scene's model as a function of the aspect, rendered in batches of views."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from os import PathLike
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.views import View, check_resolution
from mi_lcair.signatures.many_views import DEFAULT_TOLERANCE, render_views, views_per_batch
from mi_lcair.signatures.trend_file import TrendFile
from mi_lcair.signatures.trend_result import Trend

# A batch may fill so many passes even with the fewest samples. This bounds the memory.
MOST_PASSES = 16
OWN_COLUMNS = (
    "azimuth_deg",
    "elevation_deg",
    "intensity_W_sr",
    "standard_error_W_sr",
    "half_width_W_sr",
    "projected_area_m2",
    "paths",
    "reached",
    "invalid",
)


@dataclass(frozen=True)
class Sweep:
    """Views of a scene and how they are rendered: all that another process must know.

    The results of a view depend on all of these, but not on where or when its batch is rendered.

    Attributes
    ----------
    scene, parameters : str, dict of str to str
        Source and parameters of the scene, as `load` takes them.
    fingerprint : str
        Fingerprint of the loaded scene.
    views : tuple of View
        Views in their order.
    resolution : int
        `spp` and `max_spp` count the paths of a view divided by resolution x resolution.
    sampling : Sampling
        Its tolerance is half of the 95 % interval of a view's intensity, as a fraction of it.
    batch : int
        Largest number of views that are rendered together.
    variant : str
        Variant of Mitsuba.
    """

    scene: str
    parameters: dict[str, str]
    fingerprint: str
    views: tuple[View, ...]
    resolution: int
    sampling: Sampling
    batch: int
    variant: str

    def batches(self) -> list[tuple[int, tuple[View, ...]]]:
        """(number, views) of batches of nearly equal size."""
        count = -(-len(self.views) // self.batch)
        bounds = np.linspace(0, len(self.views), count + 1).round().astype(int)
        return [
            (number, self.views[low:high])
            for number, (low, high) in enumerate(zip(bounds, bounds[1:]))
        ]

    def header(self, scene: Scene) -> dict[str, str]:
        """How the rows of a file are made, by key.

        The scene is named without its folder, and its files as they were given. The fingerprint
        covers their content.
        """
        samples = f"spp {self.sampling.spp} over each view"
        if self.sampling.spp is None:
            most = self.sampling.max_spp or "default"
            samples = f"95 % interval {self.sampling.tolerance:g}, max_spp {most}"
        views = sha256(repr(self.views).encode()).hexdigest()[:16]
        return {
            "scene": scene.name,
            "parameters": json.dumps(scene.parameters, sort_keys=True),
            "fingerprint": self.fingerprint,
            "band": scene.band.label,
            "resolution": str(self.resolution),
            "samples": samples,
            "seed": str(self.sampling.seed),
            "views": f"{len(self.views)} ({views})",
            "batch": str(self.batch),
            "mi_lcair": mi_lcair.__version__,
        }


def trend(
    scene: SceneLike,
    azimuths_deg: Iterable[float],
    elevations_deg: Iterable[float] = (0.0,),
    resolution: int = 64,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    batch: int | None = None,
    path: str | PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    dask: str | None = None,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Trend:
    """Intensity of a scene's model toward each azimuth and elevation of the observer.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        It needs a model.
    azimuths_deg : sequence of float
        Azimuths of the observer, degrees: 0 sees the nose, 90 the left side.
    elevations_deg : sequence of float
        Elevations of the observer above the horizontal, degrees.
    resolution : int
        `spp` and `max_spp` count the paths of a view divided by resolution x resolution. The paths
        begin anywhere in the view, not in one pixel each.
    spp : int, optional
        Samples per pixel, instead of a tolerance.
    tolerance : float or str, optional
        Half of the 95 % interval of each view's intensity, as a fraction of it, such as 0.01 or
        "1%"; 0.01 if spp is not given.
    max_spp : int, optional
        Largest number of samples per pixel for the tolerance.
    seed : int
        Seed of the random numbers.
    batch : int, optional
        Views that are rendered together; by default as many as fit into a pass.
    path : path-like, optional
        CSV file to write, see `TrendFile`. It is complete after each batch.
    resume : bool
        Keep the views that the file holds already.
    overwrite : bool
        Replace a file that exists. Without it and `resume` such a file is refused.
    dask : str, optional
        Address of a Dask scheduler whose workers render the batches. They load the scene from the
        same path. The numbers are the same.
    progress : callable, optional
        Called with (views done, all views).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Trend

    Raises
    ------
    InputError
        If the arguments do not fit together, if a view is missing or given twice, or if the file or
        the scheduler cannot be used.
    """
    scene = scene_of(scene, parameters)
    sampling = Sampling(spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed)
    if spp is None and tolerance is None:
        sampling = replace(sampling, tolerance=DEFAULT_TOLERANCE)
    if dask and scene.path is None:
        raise InputError(
            f"{scene.name}: workers load a scene from its file, and this one was loaded by "
            "Mitsuba; leave dask out, or give the file"
        )
    azimuths = angles("azimuths_deg", azimuths_deg)
    views = tuple(
        View(azimuth, elevation)
        for elevation in angles("elevations_deg", elevations_deg)
        for azimuth in azimuths
    )
    if len(set(views)) < len(views) or not views:
        raise InputError(
            "a trend needs views, each once; an azimuth or elevation is missing or given twice"
        )
    check_resolution(resolution)
    most = MOST_PASSES * views_per_batch(resolution)
    if batch is not None and not 1 <= batch <= most:
        raise InputError(
            f"batch = {batch} must lie in 1..{most} for {resolution} x {resolution} pixels"
        )
    sweep = Sweep(
        scene.source,
        {name: whole_path(value) for name, value in scene.parameters.items()},
        scene.fingerprint,
        views,
        resolution,
        sampling,
        min(batch or views_per_batch(resolution), len(views)),
        mi.variant(),
    )
    file = TrendFile(path, sweep.header(scene), sweep.batches())
    if resume:
        file.resume()
    elif not overwrite:
        file.refuse_to_overwrite()
    # A batch is skipped only if all of its views are done.
    missing = [(number, views) for number, views in sweep.batches() if not file.holds(views)]
    for rows in results(scene, sweep, missing, dask):
        file.add(rows)
        if progress:
            progress(len(file.rows), len(views))
    return Trend(scene.name, file.columns(), scene.band.label, sampling.tolerance)


def angles(name: str, values: Iterable[float]) -> list[float]:
    """Angles in degrees as numbers; raises InputError for what is no sequence of numbers."""
    try:
        if isinstance(values, str):
            raise ValueError(values)
        return [float(value) for value in values]
    except (TypeError, ValueError):
        raise InputError(
            f"{name} = {values!r} is no sequence of angles in degrees, such as range(0, 360, 10) "
            "or [0, 30]"
        ) from None


def whole_path(value: str) -> str:
    """The absolute path of a parameter that names a file; any other parameter as it is."""
    return str(Path(value).resolve()) if os.path.isfile(value) else value


def results(scene: Scene, sweep: Sweep, batches, dask: str | None):
    """Yield the rows of each batch as soon as it is rendered, here or on a Dask cluster."""
    if dask:
        from mi_lcair.signatures.cluster import rendered

        yield from rendered(sweep, batches, dask)
    else:
        for number, views in batches:
            yield render_batch(scene, sweep, number, views)


def render_batch(scene: Scene, sweep: Sweep, number: int, views) -> dict[View, dict[str, float]]:
    """Render one batch of views, and return its rows.

    Parameters
    ----------
    scene : Scene
        Scene to render.
    sweep : Sweep
        How the views are rendered.
    number : int
        Number of the batch. Together with the seed of the sweep it seeds the random numbers.
    views : sequence of View
        Views of the batch.

    Returns
    -------
    dict of View to dict of str to float
        Values by name of column, for each view.
    """
    seed = int(
        np.random.SeedSequence(sweep.sampling.seed, spawn_key=(number,)).generate_state(1)[0]
    )
    sampling = replace(sweep.sampling, seed=seed)
    result = render_views(scene, list(views), sweep.resolution, sampling)
    intensity, error = result.parts["target"]
    reached = np.ones(len(views))
    if sampling.tolerance is not None:
        reached = result.excess(sampling.tolerance) <= 1
    parts = {
        f"{name}_W_sr": result.parts[name][0]
        for name in result.parts
        if name.startswith(("group.", "bounce.", "closure"))
    }
    own = dict(
        zip(
            OWN_COLUMNS,
            (
                [view.azimuth_deg for view in views],
                [view.elevation_deg for view in views],
                intensity,
                error,
                result.half_width,
                result.parts["hit"][0],
                result.paths,
                reached,
                np.full(len(views), result.invalid),
            ),
        )
    )
    return {
        view: {name: float(values[k]) for name, values in (own | parts).items()}
        for k, view in enumerate(views)
    }
