"""Intensity of a scene toward an orthographic sensor, with and without the background."""

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
    """Intensity toward the sensor, W/sr, and its parts.

    All standard errors are None for one sample per pixel.

    Attributes
    ----------
    intensity, standard_error : float
        Intensity and its standard error, W/sr.
    by_bounce : list of float
        Intensity of paths with at most 0, 1, ... max_bounces reflections, W/sr. The last entry
        holds all reflections from the 64th on.
    by_group, by_group_error : dict of str to float
        Part that each group emitted, W/sr, and its standard error.
    by_seen, by_seen_error : dict of str to float
        Part of the pixels that show each group, W/sr, and its standard error.
    closure : float
        Estimate of the reflections beyond max_bounces, W/sr. It is included in `intensity`.
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
    """Intensity of a scene toward an orthographic sensor.

    Attributes that `Signature` lacks are looked up in `self.scene`.

    Attributes
    ----------
    band : str
        Name of the band.
    scene : Intensity
        Intensity of all that lies in the sensor's window.
    target : Intensity
        Intensity of the model's facets. It includes sky and terrain that they reflect, but not sky
        and terrain that the sensor sees directly.
    effective_areas : EffectiveAreas or None
        Effective area of each source, if it was asked for.
    facets : FacetResults or None
        Results of each facet, if they were asked for.
    window_area : float
        Area of the sensor's window, m^2.
    seconds : float
        Time of the render, s.
    paths : int
        Number of paths.
    invalid : int
        Number of samples that were NaN or infinite, and count as 0.
    reached : bool or None
        Whether the tolerance was reached; None without one.
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
        """The attribute of `self.scene`, such as intensity or by_bounce."""
        if name in Intensity.__dataclass_fields__:
            return getattr(self.scene, name)
        raise AttributeError(name)

    def as_dict(self) -> dict:
        """A dictionary for JSON: the scene's entries at the top level, and both parts by name."""
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
    """Render a scene and integrate its radiance over the sensor's window.

    The intensity is int L dA, W/sr.

    Parameters
    ----------
    scene : Scene
        Scene with an orthographic sensor.
    spp, tolerance, max_spp, seed, sensor, progress
        As for `render`.
    by_spectrum : bool
        Also compute the effective area of each source in the scene.
    facets : bool
        Also compute the results of each facet of the model.

    Returns
    -------
    Signature

    Raises
    ------
    InputError
        If the sensor is not orthographic, or if `by_spectrum` is asked of the band "total".
    """
    if by_spectrum and scene.band.is_total:
        raise InputError(
            f"{scene.name}: band total has no wavelengths, so that its intensity has no spectrum; "
            "choose a band with limits"
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
    """The Intensity whose parts have names with a common prefix in an image.

    Parameters
    ----------
    image : Render
        Rendered image, whose parts are mean radiances, W m^-2 sr^-1.
    prefix : str
        "" for the scene, "target." for the target.
    total, error : float
        Intensity and its standard error, W/sr.
    area : float
        Area of the sensor's window, m^2.
    """
    parts = {
        name.removeprefix(prefix): scaled(part, area)
        for name, part in image.parts.items()
        if name.startswith(prefix)
    }

    def split(kind):
        """Values and standard errors of the parts of one kind, by name."""
        of_kind = {
            name.removeprefix(kind): part for name, part in parts.items() if name.startswith(kind)
        }
        values = {name: value for name, (value, _) in of_kind.items()}
        return values, {name: error for name, (_, error) in of_kind.items()}

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
    """A part (mean, standard error) times an area; the error may be None."""
    mean, error = part
    return mean * area, None if error is None else error * area
