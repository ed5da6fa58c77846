"""Paths to a scene's model from many observers, traced together."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.rendering.measurands import Criterion, Measurands, check_reachable
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.views import Target, View, cameras, check_resolution
from mi_lcair.rendering.window import Windows

DEFAULT_TOLERANCE = 0.01  # half of the 95 % interval of a view's intensity, as a fraction of it
# Views fainter than this fraction of the brightest view get an absolute tolerance: that of a view
# with this fraction of the brightest intensity.
FAINT = 1e-3


@dataclass(frozen=True)
class IntensitiesOfViews(Criterion):
    """Half of the 95 % interval of each view's intensity is narrow enough.

    The allowed half width is `tolerance` times the intensity of the view, or times FAINT of the
    brightest view if that is more. For a view of intensity 0 it is `tolerance` times FAINT of the
    intensity of a window that the brightest source fills.

    areas: areas of the views' windows, (V,) [m^2].
    """

    tolerance: float
    areas: np.ndarray

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name, of_interval=True)

    def excess(self, total):
        intensity = total.mean("target") * self.areas
        half_width = total.half_width("target") * self.areas
        least = np.maximum(intensity, FAINT * intensity.max())
        brightest = total.emitters.brightest * self.areas
        allowed = self.tolerance * np.where(intensity > 0, least, FAINT * brightest)
        unknown = np.where(half_width > 0, np.inf, 0)
        return np.divide(half_width, allowed, out=unknown, where=allowed > 0)


def totals_of_views(
    scene: Scene, views: list[View], resolution: int, sampling: Sampling, measurands: Measurands
) -> tuple[Totals, np.ndarray]:
    """Sums over paths to a scene's model toward V views, and areas of their windows, (V,) [m^2].

    With closure = tail, all views have the same ratio of the geometric continuation.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        Samples per pixel count the paths of a view divided by resolution x resolution.
    sampling : Sampling
        Its tolerance is that of `IntensitiesOfViews`.
    measurands : Measurands

    Raises
    ------
    InputError
        For settings out of bounds, and for a tolerance that cannot be reached.
    """
    windows, areas = windows_of(scene, views, resolution)
    criterion = None
    if sampling.tolerance is not None:
        criterion = IntensitiesOfViews(sampling.tolerance, areas)
    return measure(scene, windows, sampling, measurands, criterion), areas


def windows_of(scene: Scene, views: list[View], resolution: int) -> tuple[Windows, np.ndarray]:
    """Windows of a scene's model toward some views, and their areas, (V,) [m^2]."""
    check_resolution(resolution)
    target = Target.of(scene)
    sensor = cameras(scene, target, views)
    areas = np.array([target.window_area(view) for view in views])
    windows = Windows(sensor, columns=len(views), pixels=resolution**2, may_follow_facets=True)
    return windows, areas
