"""Trend: intensity of a scene's model as a function of the aspect, rendered in batches of views."""

import json
import os
import socket
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import set_all
from mi_lcair.rendering.views import View, check_resolution
from mi_lcair.sensitivity.parameters import load_with_values
from mi_lcair.signatures.cluster import computed
from mi_lcair.signatures.many_views import render_views, views_per_batch
from mi_lcair.signatures.trend_file import TrendFile
from mi_lcair.signatures.trend_result import Trend
from mi_lcair.startup.threads import exclusively

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
    settings : dict
        Settings of the scene's integrator.
    """

    scene: str
    parameters: dict[str, str]
    fingerprint: str
    views: tuple[View, ...]
    resolution: int
    sampling: Sampling
    batch: int
    variant: str
    settings: dict[str, object] = field(default_factory=dict)

    @staticmethod
    def of(
        scene: Scene,
        views: tuple[View, ...],
        resolution: int,
        sampling: Sampling,
        batch: int | None = None,
        settings: dict[str, object] | None = None,
    ) -> "Sweep":
        """The sweep of a loaded scene; without `batch`, as many views in one as fit into a pass.

        Raises InputError if a view is given twice, for no views, and for numbers out of bounds.
        """
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
        return Sweep(
            scene=scene.source,
            parameters={name: whole_path(value) for name, value in scene.parameters.items()},
            fingerprint=scene.fingerprint,
            views=views,
            resolution=resolution,
            sampling=sampling,
            batch=min(batch or views_per_batch(resolution), len(views)),
            variant=mi.variant(),
            settings=settings or {},
        )

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


def render_trend(
    scene: Scene, sweep: Sweep, file: TrendFile, dask: str | None, progress: Progress | None
) -> Trend:
    """Render the views of a sweep that a file does not hold yet.

    Parameters
    ----------
    scene : Scene
    sweep : Sweep
    file : TrendFile
        It is written after each batch.
    dask : str or None
        Address of a Dask scheduler whose workers render the batches.
    progress : callable or None
        Called with (views done, all views).

    Raises InputError if the scheduler cannot be used.
    """
    if dask and scene.path is None:
        raise InputError(
            f"{scene.name}: workers load a scene from its file, and this one was loaded by "
            "Mitsuba; leave dask out, or give the file"
        )
    # A batch is skipped only if all of its views are done.
    missing = [(number, views) for number, views in sweep.batches() if not file.holds(views)]
    for rows in results(scene, sweep, missing, dask):
        file.add(rows)
        if progress:
            progress(len(file.rows), len(sweep.views))
    return Trend(scene.name, file.columns(), scene.band.label, sweep.sampling.tolerance)


def whole_path(value: str) -> str:
    """The absolute path of a parameter that names a file; any other parameter as it is."""
    return str(Path(value).resolve()) if os.path.isfile(value) else value


def results(scene: Scene, sweep: Sweep, batches, dask: str | None):
    """Yield the rows of each batch as soon as it is rendered, here or on a Dask cluster."""
    if dask:
        jobs = [partial(render_on_worker, sweep, number, views) for number, views in batches]
        for _, rows in computed(jobs, sweep.variant, dask):
            yield rows
    else:
        for number, views in batches:
            yield render_batch(scene, sweep, number, views)


@exclusively
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


def render_on_worker(sweep: Sweep, number: int, views) -> dict[View, dict[str, float]]:
    """Render one batch on a worker, and return its rows."""
    settings = tuple(sweep.settings.items())
    scene = loaded(sweep.scene, tuple(sweep.parameters.items()), sweep.fingerprint, settings)
    return render_batch(scene, sweep, number, views)


@lru_cache(maxsize=1)
def loaded(source: str, parameters: tuple, fingerprint: str, settings: tuple = ()):
    """The scene with settings of its integrator, which a worker loads once.

    Raises InputError if the files on this worker give a scene with another fingerprint.
    """
    scene = load_with_values(source, dict(parameters))
    set_all(scene.mi.integrator(), dict(settings))
    if scene.fingerprint != fingerprint:
        raise InputError(
            f"scene '{source}' is another one on the Dask worker at {socket.gethostname()}; the "
            "worker's files or its version of mi_lcair differ"
        )
    return scene
