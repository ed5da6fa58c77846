"""Launches of an image on workers."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import Windows
from mi_lcair.startup.tasks import in_order
from mi_lcair.startup.threads import exclusively


def on_workers(
    scene: Scene,
    windows: Windows,
    measurands: Measurands,
    tolerance: float | None,
    launches: list[Launch],
) -> Iterator[Sums]:
    """Yield the sums of each launch of an image from a sensor of the scene.

    tolerance: that of the sampling, which decides on bins of wavelength.
    """
    number = scene.mi.sensors().index(windows.sensor)
    sent = pickle.dumps((scene, number, measurands, tolerance, windows.by_randomisation))
    yield from in_order([partial(trace_sent, sent, launch) for launch in launches])


def may_be_sent(scene: Scene, windows: Windows, measurands: Measurands) -> bool:
    """Whether workers can trace the launches of an image: from a sensor of the scene."""
    is_plain = not (measurands.facets or measurands.explored or measurands.reduced)
    is_known = windows.sensor in scene.mi.sensors()
    has_own_air = bool(scene.mi.integrator().filters)
    return is_plain and is_known and measurands.channels.tables is None and not has_own_air


@lru_cache(maxsize=1)
def received(sent: bytes) -> tuple:
    """What `on_workers` sends, which a worker unpacks once."""
    return pickle.loads(sent)


@exclusively
def trace_sent(sent: bytes, launch: Launch) -> Sums:
    """The sums of a launch on a worker."""
    scene, number, measurands, tolerance, by_randomisation = received(sent)
    binning = measurands.binning(tolerance)
    with scene.prepared(measurands.by_spectrum, measurands.explored, binning) as tracer:
        sums = measurands.trace(tracer, scene.sensors[number], launch)
    if by_randomisation:
        return sums
    channels = {name: values.sum(axis=1, keepdims=True) for name, values in sums.channels.items()}
    return replace(sums, channels=channels)  # as `Totals` would, so that less is sent
