"""A trend: intensity of a scene's model against the aspect from which it is seen, batch by batch of
views.
"""

import json
import os
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.many_views import render_views, views_per_batch
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import View, check_resolution
from mi_lcair.signatures.trend_file import TrendFile

MOST_PASSES = 16  # of the fewest samples, that one batch may fill at once: memory
OWN_COLUMNS = (
    "azimuth_deg",
    "elevation_deg",
    "intensity_W_sr",
    "standard_error_W_sr",
    "projected_area_m2",
    "spp",
    "reached",
    "invalid",
)


@dataclass(frozen=True)
class Sweep:
    """Which views of a scene, and how they are rendered: all that another process must know.

    scene, parameters: as `load` takes them, fingerprint: of the scene that came of it; views in
    their order; resolution: pixels along each side; spp: samples per pixel, None for as many as
    `tolerance` asks for, up to max_spp; batch: views rendered together. The numbers of a view
    depend on all of these, and not on where or when its batch is rendered.
    """

    scene: str
    parameters: dict[str, str]
    fingerprint: str
    views: tuple[View, ...]
    resolution: int
    spp: int | None
    tolerance: float
    max_spp: int | None
    seed: int
    batch: int
    variant: str

    def batches(self) -> list[tuple[int, tuple[View, ...]]]:
        """Numbered batches of nearly equal size."""
        count = -(-len(self.views) // self.batch)
        bounds = np.linspace(0, len(self.views), count + 1).round().astype(int)
        return [
            (number, self.views[low:high])
            for number, (low, high) in enumerate(zip(bounds, bounds[1:]))
        ]

    def header(self, band: str) -> dict[str, str]:
        """What a file must say about its rows, beside the views themselves."""
        samples = (
            f"spp {self.spp}"
            if self.spp
            else f"tolerance {self.tolerance:g}, max_spp {self.max_spp or 'default'}"
        )
        views = sha256(repr(self.views).encode()).hexdigest()[:16]
        return {
            "scene": self.scene,
            "parameters": json.dumps(self.parameters, sort_keys=True),
            "fingerprint": self.fingerprint,
            "band": band,
            "resolution": str(self.resolution),
            "samples": samples,
            "seed": str(self.seed),
            "views": f"{len(self.views)} ({views})",
            "batch": str(self.batch),
            "mi_lcair": mi_lcair.__version__,
        }


@dataclass(frozen=True)
class Trend:
    """Rows by view, as columns: azimuth_deg, elevation_deg, intensity_W_sr of the model with its
    standard error, its projected area, samples per pixel, whether the tolerance was reached (1 or
    0; 1 for a fixed number), NaN or infinite samples of its batch, which count as 0, and the
    intensity's parts group.LABEL_W_sr and bounce.N_W_sr [W/sr].
    """

    columns: dict[str, np.ndarray]
    band: str

    @property
    def missed(self) -> int:
        """How many views did not reach the tolerance."""
        return int(np.sum(self.columns["reached"] == 0))

    def at_elevation(self, elevation_deg: float) -> "Trend":
        chosen = self.columns["elevation_deg"] == elevation_deg
        return Trend({name: values[chosen] for name, values in self.columns.items()}, self.band)

    def parts(self, kind: str) -> dict[str, np.ndarray]:
        """The columns "group" or "bounce", by what follows the dot."""
        return {
            name.partition(".")[2].removesuffix("_W_sr"): values
            for name, values in self.columns.items()
            if name.startswith(f"{kind}.")
        }


def trend(
    scene: Scene,
    azimuths_deg,
    elevations_deg=(0.0,),
    resolution: int = 64,
    spp: int | None = None,
    tolerance: float | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    batch: int | None = None,
    path=None,
    resume: bool = False,
    dask: str | None = None,
    progress=None,
) -> Trend:
    """Intensity of the model toward every azimuth at every elevation of the observer.

    spp, tolerance (0.01) and max_spp: of each view's intensity, as `render_views`. batch: views
    rendered together (as many as fit a pass). path: a CSV, whole after each batch; resume: keep the
    views that it holds. dask: address of a scheduler whose workers render the batches (they load
    the scene from the same path); same numbers. progress: called with (views done, all).
    """
    if spp and (tolerance or max_spp):
        raise InputError(
            "spp sets a fixed number of samples; tolerance and max_spp find one, and do not go with it"
        )
    views = tuple(
        View(float(azimuth), float(elevation))
        for elevation in elevations_deg
        for azimuth in azimuths_deg
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
        spp,
        tolerance or 0.01,
        max_spp,
        seed,
        min(batch or views_per_batch(resolution), len(views)),
        mi.variant(),
    )
    file = TrendFile(path, sweep.header(scene.band.label), sweep.batches())
    if resume:
        file.resume()
    missing = [
        (number, views) for number, views in sweep.batches() if not file.holds(views)
    ]  # whole: its views share their fate
    for rows in results(scene, sweep, missing, dask):
        file.add(rows)
        if progress:
            progress(len(file.rows), len(views))
    return Trend(file.columns(), scene.band.label)


def whole_path(value: str) -> str:
    """A parameter that names a file from here, as other processes find it."""
    return str(Path(value).resolve()) if os.path.isfile(value) else value


def results(scene: Scene, sweep: Sweep, batches, dask: str | None):
    """Yields the rows of each batch as it is done."""
    if dask:
        from mi_lcair.signatures.cluster import rendered

        yield from rendered(sweep, batches, dask)
    else:
        for number, views in batches:
            yield render_batch(scene, sweep, number, views)


def render_batch(scene: Scene, sweep: Sweep, number: int, views) -> dict[View, dict[str, float]]:
    """The rows of one batch of views; its number seeds the random numbers."""
    seed = np.random.SeedSequence(sweep.seed, spawn_key=(number,))
    found = render_views(
        scene, list(views), sweep.resolution, sweep.spp, sweep.tolerance, sweep.max_spp, seed
    )
    intensity, error = found.parts["target"]
    reached = np.ones(len(views)) if sweep.spp else found.excess(sweep.tolerance) <= 1
    shown = {
        f"{name}_W_sr": found.parts[name][0]
        for name in found.parts
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
                found.parts["hit"][0],
                np.full(len(views), found.spp),
                reached,
                np.full(len(views), found.invalid),
            ),
        )
    )
    return {
        view: {name: float(values[k]) for name, values in (own | shown).items()}
        for k, view in enumerate(views)
    }
