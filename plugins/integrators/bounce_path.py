r"""Integrator `bounce_path`: path tracing from the observer up to a given number of reflections.

It can record the radiance separately for each number of reflections.
"""

from contextlib import contextmanager
from dataclasses import replace

import drjit as dr
import mitsuba as mi
from mitsuba.python.ad.integrators.common import RBIntegrator

from mi_lcair.declared import check_rules, rule
from mi_lcair.errors import InputError, errors_of
from mi_lcair.physics.spectra.bins import Binning
from mi_lcair.plugins.bsdfs.reflection_bsdf import SpectralBSDF, has_spectrum
from mi_lcair.plugins.columns.tables import explored_by_gradients, places_of, surface_numbers
from mi_lcair.plugins.derivatives import deriving, leaves, nodes
from mi_lcair.plugins.emission.draw_table import PREFERRED
from mi_lcair.plugins.emission.triangles import refresh_geometry
from mi_lcair.plugins.emitters.thermal import derive_together
from mi_lcair.plugins.paths.path_tracer import PathTracer
from mi_lcair.plugins.paths.scene_state import SceneState
from mi_lcair.plugins.properties import HOTTEST, Property, read
from mi_lcair.tasks import exclusive, tracing

AUTO = "auto"  # emitter_sampling: decided by a measurement
LEAST_SHARE = 0.125  # least probability of the floor and of the lobe of an explored surface
MOST_KEPT = 8  # tracers of a scene that are kept, each with other settings


class BouncePath(RBIntegrator):
    r"""Bounce-limited path tracer for thermal radiance, with derivatives by path replay.

    =================== ======= ====================================================================
    max_bounces         integer reflections after which a path ends, 0..10000;
                                0 = emission only                                               (4)
    emitter_sampling    boolean at each reflection, also trace a ray to a sampled point on the
                                emitters (multiple importance sampling); the sun, and lights
                                that no path can hit (point, spot), are always sampled. auto:
                                only if a test run reaches a tolerance sooner with it        (auto)
                                preferred: yes, with a larger weight than reflected rays that
                                hit an emitter by chance. Sampled directions follow an emitter
                                that moves, so that differences for motions have less noise
    opening_sampling    boolean if a reflected path would leave a hollow mesh through an opening
                                and find no radiance there, sample its direction again. auto: as
                                for emitter_sampling                                         (auto)
    closure             string  estimate of the radiance beyond max_bounces reflections      (none)
                                none: it is left out; ambient: one more reflection, after which
                                the surface that the ray hits radiates as a blackbody at
                                ambient_temperature (a ray that escapes adds nothing);
                                tail: geometric continuation of the radiances after the last
                                two numbers of reflections, for the model and its background
                                separately
    ambient_temperature float   kelvin, for closure = ambient
    truncation          float   relative standard error of the radiance beyond max_bounces; all
                                errors include it                                             (0.0)
    bins                integer bins of a band for materials by wavelength, 2..512; 0: the smallest
                                of 16, 32 and 64 with an error below a tenth of the
                                tolerance, or below .02 % without one                           (0)
    =================== ======= ====================================================================

    .. code-block:: xml

        <integrator type="bounce_path"> <integer name="max_bounces" value="3"/> </integrator>

    Emitter sampling can increase the variance much more than it can reduce it. It increases the
    variance in the furnace. There all paths have nearly the same radiance without emitter sampling,
    because emissivity and reflectance of a surface add up to 1. It reduces the error if few
    emitters are visible, as in two_plates and open_box. If a tolerance is given, `auto` compares
    both in a test run. With a fixed number of paths, and for derivatives and facets, `auto` is
    false.

    `mi.render` saves rays if emitters are drawn. Where emitting meshes surround the scene, it draws
    at every eighth reflection. Where at most two rectangles or triangles emit and all surfaces are
    diffuse, the last reflection has no other ray than the drawn one.

    Derivatives (forward and reverse, `mi.render(scene, params)`) are available with respect to the
    parameters of BSDFs and emitters and to facet temperatures, but not to the geometry. Memory does
    not grow with the number of bounces. `PathTracer.trace` also returns the radiance by number of
    reflections, by emitting group and by the group that is hit first, all from the same paths.
    """

    PROPERTIES = (
        Property("max_bounces", "integer", 4, lower=0, upper=10_000),
        Property("emitter_sampling", "boolean", AUTO, choices=(AUTO, PREFERRED)),
        Property("opening_sampling", "boolean", AUTO, choices=(AUTO,)),
        Property("closure", "string", "none", choices=("none", "ambient", "tail")),
        Property("ambient_temperature", "float", upper=HOTTEST, is_positive=True, unit="K"),
        Property("truncation", "float", 0.0, lower=0, upper=1),
        Property("bins", "integer", 0, lower=0, upper=512),
    )
    RULES = (
        rule(
            lambda t: (t.closure == "ambient") == (t.ambient_temperature is not None),
            "closure = ambient and ambient_temperature need each other",
        ),
        rule(lambda t: t.bins != 1, "bins = 1; must be 0, or 2 to 512"),
        rule(
            lambda t: t.closure != "tail" or t.max_bounces >= 2,
            "closure = tail continues the last two bounce counts; "
            "max_bounces = {t.max_bounces} must be >= 2",
        ),
    )

    def __init__(self, props):
        super().__init__(props)
        self.filters = ()  # air and response between the scene and a result, see `Binning`
        for name, value in read(props, "bounce_path", self.PROPERTIES).items():
            setattr(self, name, value)
        self.check()

    def check(self) -> None:
        """Check the settings, which a caller may change at any time.

        Raises InputError for a setting out of bounds and for settings that contradict each other.
        """
        for entry in self.PROPERTIES:
            value = getattr(self, entry.name)
            if value is not None:
                entry.checked(value, "bounce_path")
        with errors_of("bounce_path"):
            check_rules(self, self.RULES)

    def to_string(self):
        return (
            f"BouncePath[max_bounces = {self.max_bounces}, "
            f"emitter_sampling = {self.emitter_sampling}, closure = {self.closure}]"
        )

    @contextmanager
    def prepared(
        self,
        scene,
        by_spectrum: bool = False,
        kept: dict | None = None,
        explored=(),
        binning: Binning = Binning(),
    ):
        """Context manager that gives a `PathTracer` for the scene.

        Inside the context, all data that plugins derive from the scene's parameters are up to date,
        and the scene must not change. Other threads wait until this one leaves it.

        Parameters
        ----------
        scene : mi.Scene
        by_spectrum : bool
            Record emission separately for each spectrum of a group, not only for each group.
        kept : dict or None
            The tracers of this scene that were made before. One of them is given again if nothing
            has changed since. Otherwise a new one takes its place, with its recordings and those of
            its tables that stay the same.
        explored : set of mi.BSDF or None
            BSDFs that are explored, see `exploring`. None: those whose gradients need it.
        binning : Binning
            Decides on the bins of wavelength of a scene with spectral materials; its filters are
            those of the integrator.
        """
        self.check()
        with exclusive:
            objects = nodes(scene)
            plugins = deriving(objects)
            with dr.resume_grad():
                derive_together(plugins)
                for plugin in plugins:
                    plugin.refresh()
            if explored is None:
                explored = explored_by_gradients(objects)
            binning = replace(binning, filters=self.filters)
            if not any(map(has_spectrum, objects)):
                binning = Binning()  # so that the tracer is the same one as before
            settings = by_spectrum, frozenset(explored), binning
            kept = {} if kept is None else kept
            with tracing(plugins), exploring(objects, explored):
                yield self.tracer(scene, objects, settings, kept)

    def tracer(self, scene, objects, of_tracer: tuple, kept: dict):
        """A tracer for the present state of a scene and its objects: a kept one, or a new one.

        One is kept for each of the last MOST_KEPT settings of the integrator. of_tracer: whether
        emission is recorded by spectrum, the BSDFs that are explored, and the `Binning`.
        """
        settings = [getattr(self, entry.name) for entry in self.PROPERTIES]
        settings = [False if value == AUTO else value for value in settings]
        state, key = SceneState(objects, scene, *settings), (*of_tracer, *settings)
        before = kept.get(key)
        if before is not None and before.state == state:
            return before
        refresh_geometry(scene)
        by_spectrum, explored, binning = of_tracer
        numbers = None  # of the surfaces that are explored
        if explored:
            bsdfs = [node for node in objects if isinstance(node, mi.BSDF)]
            numbers = surface_numbers(places_of(bsdfs), explored)
        tracer = PathTracer(self, scene, by_spectrum, state, numbers, binning, before)
        if not state.has_gradients:
            kept.pop(key, None)
            kept[key] = tracer
            if len(kept) > MOST_KEPT:
                kept.pop(next(iter(kept)))
        return tracer

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        with self.prepared(scene) as tracer:
            return tracer.render(scene, sensor, seed, spp, develop, evaluate)

    def render_forward(self, scene, params, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        mode = dr.ADMode.Forward
        with self.prepared(scene, explored=None) as tracer, leaves(tracer.plugins, mode):
            tracer.check_differentiable()
            return tracer.render_forward(scene, params, sensor, seed, spp)

    def render_backward(self, scene, params, grad_in, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        mode = dr.ADMode.Backward
        with self.prepared(scene, explored=None) as tracer, leaves(tracer.plugins, mode):
            tracer.check_differentiable()
            tracer.render_backward(scene, params, grad_in, sensor, seed, spp)

    def check_differentiable(self) -> None:
        if self.closure == "tail":
            raise InputError("bounce_path: closure = tail has no derivatives; use none or ambient")


@contextmanager
def exploring(objects, explored):
    """Context manager in which paths explore some BSDFs of a scene, and no others."""
    plugins = [node for node in objects if isinstance(node, SpectralBSDF)]
    before = [plugin.least_share for plugin in plugins]
    try:
        for plugin in plugins:
            plugin.explore(LEAST_SHARE if plugin in explored else 0.0)
        yield
    finally:
        for plugin, share in zip(plugins, before):
            plugin.explore(share)
