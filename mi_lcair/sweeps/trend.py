"""A trend: a sweep over the aspect alone, with the parts of each intensity."""

import json

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import View, check_resolution
from mi_lcair.signatures.trend import measure_rows
from mi_lcair.signatures.trend_result import Trend
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.measure import results_of
from mi_lcair.sweeps.subject import Batch, Subject


def measure_trend(
    scene: Scene,
    views: tuple[View, ...],
    resolution: int,
    sampling: Sampling,
    folder: AreasFolder | None = None,
    progress: Progress | None = None,
) -> Trend:
    """Intensities of a scene's model toward some views.

    Parameters
    ----------
    scene : Scene
    views : tuple of View
        Each once.
    resolution, sampling
        As for `totals_of_views`.
    folder, progress
        As for `measure_sweep`.
    """
    if len(set(views)) < len(views) or not views:
        raise InputError(
            "a trend needs views, each once; an azimuth or elevation is missing or given twice"
        )
    check_resolution(resolution)
    subject = Subject(scene.name, given=scene)
    batches = Batch.of_views(subject, None, views, resolution, sampling, measure_rows)
    results, _ = results_of({scene.name: batches}, folder, progress)
    samples = f"spp {sampling.spp} over each view"
    if sampling.spp is None:
        most = sampling.max_spp or "default"
        samples = f"95 % interval {sampling.tolerance:g}, max_spp {most}"
    made = {
        "scene": scene.name,
        "parameters": json.dumps(scene.parameters, sort_keys=True),
        "fingerprint": batches[0].fingerprint,
        "band": scene.band.label,
        "resolution": str(resolution),
        "samples": samples,
        "seed": str(sampling.seed),
        "mi_lcair": mi_lcair.__version__,
    }
    return Trend(scene.name, results[scene.name].table, scene.band.label, sampling.tolerance, made)
