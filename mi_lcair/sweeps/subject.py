"""What is traced in a sweep: a scene as one combination of conditions makes it."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import sha256

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import target_scene
from mi_lcair.detection.weather import AirOfLight
from mi_lcair.rendering.parameters.values import check_same, load_with_values
from mi_lcair.rendering.reflections.number import bounce_settings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import set_all
from mi_lcair.rendering.views import View, terrain_remark
from mi_lcair.rendering.window import PASS_SAMPLES
from mi_lcair.signatures.trend import TrendRows
from mi_lcair.signatures.view_areas import ViewAreas, measure_view_areas
from mi_lcair.startup.threads import exclusively

VIEWS_AT_ONCE = 256  # views of a batch
Views = ViewAreas | TrendRows  # what is kept of some views


@dataclass(frozen=True)
class Subject:
    """A scene with its parameters, or the scene of a scenario with its settings.

    key: text that tells this subject from others of the sweep. scenario: None for a scene. The
    scenario's range, air and background do not count. given: the scene, if it is loaded.
    """

    key: str
    scene: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    scenario: Scenario | None = field(default=None, compare=False)
    given: Scene | None = field(default=None, compare=False)

    def load(self) -> Scene:
        """The loaded scene, of which nothing else may change but the air of its light."""
        return self.given or loaded(self, mi.variant())


@lru_cache(maxsize=2)
@exclusively
def loaded(subject: Subject, variant: str) -> Scene:
    """The scene of a subject; the last ones are kept."""
    scenario = subject.scenario
    if scenario is None:
        return load_with_values(subject.scene, dict(subject.parameters))
    scene = target_scene(scenario, scenario.sensor.detector())
    render, observer = scenario.render, scenario.observer
    if render.lobe is not None:
        scene.set_lobe(render.lobe)
    sampling = Sampling(tolerance=render.tolerance, seed=render.seed)
    views = [observer.view]
    integrator = scene.mi.integrator()
    set_all(integrator, bounce_settings(scene, render.most_bounces, False, sampling, views))
    integrator.check()
    return scene


@dataclass(frozen=True)
class Batch:
    """Views of a subject that are traced together: all that a worker must know.

    Attributes
    ----------
    subject : Subject
    fingerprint : str
        Fingerprint of the loaded scene.
    light : AirOfLight or None
        Air of the light of the scene, if it depends on it.
    views : tuple of View
    resolution : int
    sampling : Sampling
    variant : str
        Variant of Mitsuba.
    measure : callable
        `measure_view_areas`, or another function of the same arguments.
    """

    subject: Subject
    fingerprint: str
    light: AirOfLight | None
    views: tuple[View, ...]
    resolution: int
    sampling: Sampling
    variant: str
    measure: Callable = measure_view_areas

    @staticmethod
    def of_views(
        subject: Subject,
        light: AirOfLight | None,
        views: Sequence[View],
        resolution: int,
        sampling: Sampling,
        measure: Callable = measure_view_areas,
    ) -> list["Batch"]:
        """Batches of nearly equal size."""
        most = max(1, min(VIEWS_AT_ONCE, PASS_SAMPLES // resolution**2))
        bounds = np.linspace(0, len(views), -(-len(views) // most) + 1).round().astype(int)
        scene, variant = subject.load(), mi.variant()
        fingerprint = scene.fingerprint
        if subject.scenario is None:  # whose observer is at its range, and not beyond the terrain
            for low, high in zip(bounds, bounds[1:]):
                for remark in terrain_remark(scene, views[low:high]):
                    warnings.warn(remark, stacklevel=2)
        return [
            Batch(
                subject=subject,
                fingerprint=fingerprint,
                light=light,
                views=tuple(views[low:high]),
                resolution=resolution,
                sampling=sampling,
                variant=variant,
                measure=measure,
            )
            for low, high in zip(bounds, bounds[1:])
        ]

    @property
    def key(self) -> str:
        """32 hexadecimal digits that stand for everything on which the results depend."""
        sampling = replace(self.sampling, progress=None)
        made = (self.fingerprint, self.light, self.views, self.resolution, sampling)
        text = repr((*made, self.variant, mi_lcair.__version__, self.measure.__name__))
        return sha256(text.encode()).hexdigest()[:32]

    @exclusively
    def run(self) -> Views:
        """Trace the views. Raises InputError if the files here give another scene."""
        scene = self.subject.load()
        if scene.fingerprint != self.fingerprint:  # perhaps of a file that has changed since
            loaded.cache_clear()
            scene = self.subject.load()
        check_same(scene, self.fingerprint)
        if self.light is not None:
            self.light.shine_on(scene)
        # The same views have the same random numbers in all subjects, whose differences are then
        # more precise than their values
        views = int(sha256(repr(self.views).encode()).hexdigest()[:16], 16)
        seed = np.random.SeedSequence([self.sampling.seed, views]).generate_state(1)
        sampling = replace(self.sampling, seed=int(seed[0]))
        return self.measure(scene, list(self.views), self.resolution, sampling)
