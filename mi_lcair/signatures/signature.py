"""Intensity of a scene in the direction of an orthographic sensor: the model's own, and with its
background.
"""

from dataclasses import asdict, dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.render import Render, render
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window, window_area
from mi_lcair.signatures.effective_areas import EffectiveAreas, effective_areas
from mi_lcair.signatures.facet_results import FacetResults, FacetSums


@dataclass(frozen=True)
class Intensity:
    """Intensity toward the sensor with its standard error, and how it splits; W/sr.

    by_bounce: cumulative, for 0, 1, ... max_bounces reflections (from 64 on in one); by_group: by
    what emitted it; by_seen: by what the pixel shows first, each with its standard error. closure:
    what stands in for the reflections beyond. Errors are None where one sample per pixel was taken.
    """

    intensity: float
    standard_error: float | None
    by_bounce: list[float]
    by_group: dict[str, float]
    by_group_error: dict[str, float | None]
    by_seen: dict[str, float]
    by_seen_error: dict[str, float | None]
    closure: float


@dataclass(frozen=True)
class Signature:
    """What an orthographic sensor sees, as intensity.

    scene: all that lies in its window; target: what of it comes from the model's facets, its
    background (sky and terrain) reflected in them included, seen past them not. effective_areas and
    facets, where they were asked for.
    """

    band: str
    scene: Intensity
    target: Intensity
    effective_areas: EffectiveAreas | None
    facets: FacetResults | None
    window_area: float
    seconds: float
    paths: int
    invalid: int
    reached: bool | None

    def __getattr__(self, name):
        """What is asked of a signature without saying of which part is the scene's: intensity,
        by_bounce, ...
        """
        if name in Intensity.__dataclass_fields__:
            return getattr(self.scene, name)
        raise AttributeError(name)

    def as_dict(self) -> dict:
        """For JSON: the scene's intensity and splits at the top, and both parts by name."""
        entries = {
            "band": self.band,
            **asdict(self.scene),
            "target": asdict(self.target),
            "scene": asdict(self.scene),
            "window_area": self.window_area,
            "seconds": self.seconds,
            "paths": self.paths,
            "invalid": self.invalid,
            "reached": self.reached,
        }
        if self.effective_areas is not None:
            entries["effective_areas"] = self.effective_areas.as_list()
        return entries


def signature(
    scene: Scene,
    spp: int | None = None,
    tolerance: float | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    by_spectrum: bool = False,
    facets: bool = False,
    progress=None,
) -> Signature:
    """Renders the scene (as `render`) and integrates the radiance over the sensor's window:
    intensity = int L dA [W/sr].

    by_spectrum: also the effective area of each spectrum in the scene. facets: also the results of
    each facet.
    """
    if by_spectrum and scene.band.is_total:
        raise InputError(
            f"{scene.name}: band total has no wavelengths, so that its intensity has no spectrum; choose a band with limits"
        )
    area = window_area(scene.sensor(sensor), scene.name)
    sums, by_facet = FacetSums(FacetTable(scene)) if facets else None, None
    image = render(
        scene,
        spp,
        tolerance,
        max_spp,
        seed,
        sensor,
        "target",
        by_spectrum,
        sums,
        progress=progress,
    )
    if sums is not None:
        *_, direction = window(scene.sensor(sensor))
        by_facet = sums.results(area, -direction)
    scene_error = None if image.mean_error is None else image.mean_error * area
    return Signature(
        band=image.band.name,
        scene=intensity(image, "", image.mean * area, scene_error, area),
        target=intensity(image, "target.", *scaled(image.parts["target"], area), area),
        effective_areas=effective_areas(image, area) if by_spectrum else None,
        facets=by_facet,
        window_area=area,
        seconds=image.seconds,
        paths=image.paths,
        invalid=image.invalid,
        reached=image.reached,
    )


def intensity(
    image: Render, prefix: str, total: float, error: float | None, area: float
) -> Intensity:
    """The Intensity whose parts were recorded under names with this prefix."""
    parts = {
        name.removeprefix(prefix): scaled(part, area)
        for name, part in image.parts.items()
        if name.startswith(prefix)
    }

    def split(kind):
        found = {
            name.removeprefix(kind): part for name, part in parts.items() if name.startswith(kind)
        }
        return {name: value for name, (value, _) in found.items()}, {
            name: error for name, (_, error) in found.items()
        }

    by_bounce = np.cumsum(
        [value for name, (value, _) in parts.items() if name.startswith("bounce.")]
    )
    by_group, by_group_error = split("group.")
    by_seen, by_seen_error = split("seen.")
    return Intensity(
        intensity=total,
        standard_error=error,
        by_bounce=by_bounce.tolist(),
        by_group=by_group,
        by_group_error=by_group_error,
        by_seen=by_seen,
        by_seen_error=by_seen_error,
        closure=parts["closure"][0],
    )


def scaled(part: tuple[float, float | None], area: float) -> tuple[float, float | None]:
    mean, error = part
    return mean * area, None if error is None else error * area
