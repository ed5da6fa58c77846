"""Intensities of a scene's model toward many observers, rendered together."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.rendering.limits import check_paths
from mi_lcair.rendering.render import DEFAULT_MAX_SPP, PASS_SAMPLES, check_reachable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.views import Target, View, cameras, check_resolution
from mi_lcair.rendering.window_means import window_means

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


def views_per_batch(resolution: int) -> int:
    """Number of views of resolution x resolution paths that one pass can render."""
    return max(1, PASS_SAMPLES // resolution**2)


def render_views(
    scene: Scene,
    views: list[View],
    resolution: int,
    spp: int | None = None,
    tolerance: float = 0.01,
    max_spp: int | None = None,
    seed: int = 0,
) -> ManyViews:
    """Render the intensities of the model toward some views.

    With closure = tail, all views have the same ratio of the geometric continuation.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        `spp` and `max_spp` count the paths of a view divided by resolution x resolution.
    spp : int or None
        Paths for each of resolution x resolution pixels. None: as many paths, up to max_spp, as
        each view needs for the tolerance.
    tolerance : float
        Largest half width of the 95 % interval of an intensity, as a fraction of the intensity. See
        `ManyViews.excess` for faint views.
    max_spp : int or None
        Largest number of paths for each pixel (65536).
    seed : int
        The same seed gives the same results.

    Returns
    -------
    ManyViews

    Raises
    ------
    InputError
        For settings out of bounds, and for a tolerance that cannot be reached.
    """
    check_resolution(resolution)
    pixels = resolution**2
    check_paths(pixels * len(views), spp=spp, max_spp=max_spp)
    target = Target.of(scene)
    area = np.array([target.window_area(view) for view in views])
    sensor = cameras(scene, target, views)
    with scene.prepared() as tracer:
        if spp is None:
            check_reachable(tolerance, tracer, scene.name, of_interval=True)
        brightest = tracer.emitters.brightest * area
        total = window_means(
            scene,
            tracer,
            sensor,
            len(views),
            paths=spp and spp * pixels,
            excess=lambda total: of_totals(total, area, brightest).excess(tolerance),
            most_paths=(max_spp or DEFAULT_MAX_SPP) * pixels,
            seed=seed,
            split="model",
        )
    return of_totals(total, area, brightest)


def of_totals(total: Totals, area: np.ndarray, brightest: np.ndarray) -> ManyViews:
    """Intensities of the views whose windows have these areas [m^2], from sums over paths."""
    names = [
        name
        for name in total.sums
        if name.startswith(("target", "bounce.", "group.", "closure", "hit"))
    ]
    return ManyViews(
        parts={
            name: np.array([total.mean(name), total.standard_error(name)]) * area for name in names
        },
        brightest=brightest,
        half_width=total.half_width("target") * area,
        paths=total.traced.astype(int),
        invalid=total.invalid,
    )
