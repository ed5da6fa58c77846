"""Intensities of a scene's model toward many observers, rendered together."""

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
class ManyViews:
    """Intensities of a scene's model toward V views.

    parts: intensity and its standard error by name, (2, V) [W/sr]. The names are target (the whole
    model), bounce.N, closure and group.LABEL as in `Channels.samples`, and hit, which is the
    projected area of the model [m^2]. brightest: intensity of a window filled by the brightest
    source, (V,) [W/sr]. half_width: half of the 95 % interval of the target's intensity, (V,)
    [W/sr]. It includes the contribution of one path that hits a source which no other path has hit.
    paths: number of paths of each view, (V,). invalid: number of NaN or infinite samples, which are
    left out.
    """

    parts: dict[str, np.ndarray]
    brightest: np.ndarray
    half_width: np.ndarray
    paths: np.ndarray
    invalid: int

    def excess(self, tolerance: float) -> np.ndarray:
        """Ratio of the half width of each view's 95 % interval to the allowed one, (V,).

        The allowed half width is `tolerance` times the intensity of the view, or times FAINT of the
        brightest view if that is more. For a view of intensity 0 it is `tolerance` times FAINT of
        the intensity `brightest`.
        """
        intensity = self.parts["target"][0]
        allowed = tolerance * np.where(
            intensity > 0, np.maximum(intensity, FAINT * intensity.max()), FAINT * self.brightest
        )
        return np.divide(
            self.half_width,
            allowed,
            out=np.where(self.half_width > 0, np.inf, 0),
            where=allowed > 0,
        )


@dataclass(frozen=True)
class IntensitiesOfViews(Criterion):
    """The interval of each view's intensity is narrow enough, see `ManyViews.excess`.

    areas: areas of the views' windows, (V,) [m^2].
    """

    tolerance: float
    areas: np.ndarray

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name, of_interval=True)

    def excess(self, total):
        return of_totals(total, self.areas).excess(self.tolerance)


def render_views(scene: Scene, views: list[View], resolution: int, sampling: Sampling) -> ManyViews:
    """Render the intensities of the model toward some views.

    With closure = tail, all views have the same ratio of the geometric continuation.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        Samples per pixel count the paths of a view divided by resolution x resolution.
    sampling : Sampling
        Its tolerance is the half width of the 95 % interval of each view's intensity, as a
        fraction of it. See `ManyViews.excess` for faint views.

    Returns
    -------
    ManyViews

    Raises
    ------
    InputError
        For settings out of bounds, and for a tolerance that cannot be reached.
    """
    return of_totals(*totals_of_views(scene, views, resolution, sampling, Measurands.of("model")))


def totals_of_views(
    scene: Scene, views: list[View], resolution: int, sampling: Sampling, measurands: Measurands
) -> tuple[Totals, np.ndarray]:
    """Sums over paths to a scene's model, and areas of the views' windows, (V,) [m^2]."""
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


def of_totals(total: Totals, areas: np.ndarray) -> ManyViews:
    """Intensities of the views whose windows have these areas [m^2], from sums over paths."""
    names = [
        name
        for name in total.sums
        if name.startswith(("target", "bounce.", "group.", "closure", "hit"))
    ]
    return ManyViews(
        parts={
            name: np.array([total.mean(name), total.standard_error(name)]) * areas for name in names
        },
        brightest=total.emitters.brightest * areas,
        half_width=total.half_width("target") * areas,
        paths=total.traced.astype(int),
        invalid=total.invalid,
    )
