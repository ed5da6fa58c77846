r"""Integrator `bounce_path`: path tracing from the observer, cut after a number of reflections and
counted by them.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from math import hypot

import drjit as dr
import mitsuba as mi
from mitsuba.python.ad.integrators.common import RBIntegrator, mis_weight

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.derivatives import derivations, deriving_plugins, leaves, tracing, value_along
from mi_lcair.plugins.emission.emissivity import Table
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.paths.channels import Channels, Pixels, pixel_statistics
from mi_lcair.plugins.paths.rounding import rounding_error
from mi_lcair.plugins.paths.tail import Tail
from mi_lcair.plugins.properties import HOTTEST, Property, read

PROPERTIES = (
    Property("max_bounces", "integer", 4, lower=0, upper=10_000),
    Property("emitter_sampling", "boolean", False),
    Property("closure", "string", "none", choices=("none", "ambient", "tail")),
    Property("ambient_temperature", "float", upper=HOTTEST, is_positive=True, unit="K"),
)


class BouncePath(RBIntegrator):
    r"""Bounce-limited path tracer for thermal radiance, with derivatives by path replay.

    =================== ======= ============================================================================
    max_bounces         integer reflections after which a path ends, 0..10000; 0 = emission only        (4)
    emitter_sampling    boolean at each reflection also look at a point drawn from what emits, with multiple
                                importance sampling; lights that no path can hit (point, spot,
                                directional) are drawn in any case                                  (false)
    closure             string  stands in for the reflections beyond max_bounces                     (none)
                                none; ambient: one more reflection, and whatever surface that ray
                                meets radiates as a blackbody at ambient_temperature, an escape adds
                                nothing; tail: geometric continuation of the last two bounce counts,
                                of the model in the image and of its background apart
    ambient_temperature float   kelvin, for closure = ambient
    =================== ======= ============================================================================

    .. code-block:: xml

        <integrator type="bounce_path"> <integer name="max_bounces" value="3"/> </integrator>

    emitter_sampling is off by default because it can lose far more than it can win. At equal time,
    variance falls 7 times in two_plates and 1.5 times in open_box and in the widest cavity; it
    doubles in the cavity with the smallest opening, and in the furnace it grows beyond a factor
    100: there a path's emission and reflection add up to nearly the same radiance whatever it
    meets, and drawing emitters apart from reflections destroys that.

    Derivatives (forward and reverse, `mi.render(scene, params)`) cover parameters of BSDFs and
    emitters and facet temperatures, not the geometry; memory does not grow with the number of
    bounces. `PathTracer.observe` gives, from the same paths, the radiance by bounce count, by
    emitting group and by the group first seen.
    """

    def __init__(self, props):
        super().__init__(props)
        for name, value in read(props, "bounce_path", PROPERTIES).items():
            setattr(self, name, value)
        self.check()

    def check(self) -> None:
        """Raise InputError for settings out of bounds or that do not go together; they may be
        changed at any time.
        """
        for entry in PROPERTIES:
            value = getattr(self, entry.name)
            if value is not None:
                entry.checked(value, "bounce_path")
        if (self.closure == "ambient") != (self.ambient_temperature is not None):
            raise InputError("bounce_path: closure = ambient and ambient_temperature go together")
        if self.closure == "tail" and self.max_bounces < 2:
            raise InputError(
                f"bounce_path: closure = tail continues the last two bounce counts; max_bounces = {self.max_bounces} must be >= 2"
            )

    def to_string(self):
        return (
            f"BouncePath[max_bounces = {self.max_bounces}, emitter_sampling = {self.emitter_sampling}, "
            f"closure = {self.closure}]"
        )

    @contextmanager
    def prepared(self, scene, by_spectrum: bool = False):
        """Within: everything derived from the scene is up to date, and its PathTracer, which this
        gives, may trace paths.

        by_spectrum: tell emission apart by the spectra of its sources, not only by their groups.
        """
        self.check()
        plugins = deriving_plugins(scene)
        with dr.resume_grad():
            for plugin in plugins:
                plugin.refresh()
        with tracing(plugins):
            yield PathTracer(self, scene, by_spectrum)

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        with self.prepared(scene) as tracer:
            return tracer.render(scene, sensor, seed, spp, develop, evaluate)

    def render_forward(self, scene, params, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        with self.prepared(scene) as tracer, leaves(scene, dr.ADMode.Forward):
            return tracer.render_forward(scene, params, sensor, seed, spp)

    def render_backward(self, scene, params, grad_in, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        with self.prepared(scene) as tracer, leaves(scene, dr.ADMode.Backward):
            tracer.render_backward(scene, params, grad_in, sensor, seed, spp)

    def check_differentiable(self) -> None:
        if self.closure == "tail":
            raise InputError("bounce_path: closure = tail has no derivatives; use none or ambient")


@dataclass(frozen=True)
class Samples:
    """One pass, a value per path, not evaluated yet: the radiance, and the channels by name (see
    `Channels.samples`); chance: the largest contribution that a source might have made to it, and
    did not (see `walk`). tail: of closure = tail, else None.
    """

    radiance: mi.Float
    channels: dict[str, mi.Float]
    chance: mi.Float
    tail: Tail | None


class PathTracer(RBIntegrator):
    """A scene ready for its paths to be traced: all that a render derives from it. It is made by
    `BouncePath.prepared` and does not change.

    scene; emitters: their table, with the band, the labels and the sources; max_bounces,
    emitter_sampling, closure: the settings when it was made; ambient_radiance: of closure =
    ambient, else None; systematic_error: relative error of a radiance that no number of samples
    lowers, of Float32's rounding and of tabulated emissivities.

    It is an integrator of its own because RBIntegrator's renders call `sample` with the scene alone
    and leave no room for what was derived from it.
    """

    def __init__(self, integrator: BouncePath, scene, by_spectrum: bool):
        super().__init__(mi.Properties())
        emitters = EmitterTable(scene, integrator.emitter_sampling, by_spectrum)
        ambient = integrator.closure == "ambient"
        tables = [part for part in derivations(scene) if isinstance(part, Table)]
        vars(self).update(
            scene=scene,
            emitters=emitters,
            max_bounces=integrator.max_bounces,
            emitter_sampling=integrator.emitter_sampling,
            closure=integrator.closure,
            ambient_radiance=mi.Float(
                in_band_radiance(emitters.band, integrator.ambient_temperature)
            )
            if ambient
            else None,
            systematic_error=hypot(
                rounding_error(integrator.max_bounces),
                max((table.relative_error for table in tables), default=0.0),
            ),
            is_complete=True,
        )

    def __setattr__(self, name, value):
        if vars(self).get("is_complete"):
            raise AttributeError(f"a PathTracer does not change: {name} cannot be set")
        super().__setattr__(name, value)

    # ---------------------------------------------------------------- Around the loop

    def sample(self, mode, scene, sampler, ray, depth, δL, state_in, active, **kwargs):
        channels = (
            Channels.empty(self.max_bounces, self.closure, None) if self.closure == "tail" else None
        )
        (L, state), valid, channels, _ = self.walk(
            mode, scene, sampler, ray, δL, state_in, active, channels
        )
        if channels is not None:
            L += channels.add_tail()[0]
        return L, valid, [], state

    def observe(
        self,
        sensor,
        seed: int,
        spp: int,
        first: int,
        pixels: int,
        split: str | None = "image",
        facets=None,
        stride: int = 1,
        count_segments: bool = False,
    ) -> Pixels:
        """Statistics of the pixels of one pass, see `sampled`."""
        found = self.sampled(
            sensor, seed, spp, first, pixels, split, facets, stride, count_segments
        )
        return pixel_statistics(found, spp, split == "target")

    def sampled(
        self,
        sensor,
        seed: int,
        spp: int,
        first: int,
        pixels: int,
        split: str | None = "image",
        facets=None,
        stride: int = 1,
        count_segments: bool = False,
    ) -> Samples:
        """One pass: `spp` paths through each of `pixels` pixels from number `first` on (row by
        row), every `stride`-th; `spp` consecutive ones per pixel.

        split: the channels recorded beside the radiance: None, "image", "target": also what of each
        lies on the model's facets, or "model": nothing but what lies there, and no other paths are
        followed. facets: a numbering with `number(shape, prim_index, active)` and `add(facet, L,
        channels, spp, first)`, which receives the samples by the facet seen first. count_segments:
        also how many rays each path followed. To be called within `prepared`.
        """
        count = pixels * spp
        sampler = sensor.sampler().clone()
        sampler.set_sample_count(spp)
        sampler.set_samples_per_wavefront(spp)
        sampler.seed(seed, count)
        width, height = sensor.film().crop_size()
        index = dr.opaque(mi.UInt32, first) + dr.arange(mi.UInt32, count) // dr.opaque(
            mi.UInt32, spp
        ) * dr.opaque(mi.UInt32, stride)
        position = mi.Point2f(index % width, index // width) + sampler.next_2d()
        with dr.suspend_grad():
            aperture = sampler.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
            ray, weight = sensor.sample_ray(
                sensor.shutter_open(), 0, position / mi.Vector2f(width, height), aperture
            )
            channels, tail = None, None
            if split or facets or self.closure == "tail":
                channels = Channels.empty(
                    self.max_bounces,
                    self.closure,
                    self.emitters.sources if split else None,
                    split == "model",
                    count_segments,
                )
            (L, _), _, channels, chance = self.walk(
                dr.ADMode.Primal,
                self.scene,
                sampler,
                ray,
                None,
                None,
                mi.Bool(True),
                channels,
                facets,
            )
            if self.closure == "tail":
                # add_tail sums, and would trace the paths for that alone
                dr.eval(L, channels, chance)
                added, tail = channels.add_tail()
                L += added
            by_name = (
                channels.samples(
                    L[0], self.emitters.labels, self.emitters.sources, split == "target"
                )
                if split
                else {}
            )
            if facets is not None:
                dr.eval(L, channels, by_name, chance)  # one kernel for all uses
                facets.add(channels.facet, L[0], channels, spp, first)
            return Samples(radiance=L[0], channels=by_name, chance=chance, tail=tail)

    def chance_contribution(self, sensor) -> float:
        """Bound of what a path gains from a source that no other path has met, as far as it is
        known before paths are traced [W m^-2 sr^-1].

        Without emitter sampling this is the radiance of the brightest emitter. With it, it is that
        of the brightest one in the sensor's field of view, since only paths find out whether it is
        hidden. What reflections may add is told by the paths themselves (`Samples.chance`).
        """
        if self.emitter_sampling:
            return self.emitters.brightest_in_view(sensor)
        return self.emitters.brightest

    # ---------------------------------------------------------------- The loop

    @dr.syntax
    def walk(self, mode, scene, sampler, ray, δL, L, active, channels=None, facets=None):
        """Follows paths from the observer.

        Returns ((radiance or its derivative, radiance), valid, channels, chance). chance: the
        largest contribution to each path that a source might have made after a reflection, had the
        path met it (see `EmitterTable.by_chance`); 0 where no emitters are drawn, since there the
        brightest source bounds it.
        """
        primal = mode == dr.ADMode.Primal
        ctx = mi.BSDFContext()
        emitters = self.emitters
        limit = self.max_bounces + (1 if self.closure == "ambient" else 0)

        ray = mi.Ray3f(ray)
        active = mi.Bool(active)
        L = mi.Spectrum(0 if primal else L)  # radiance: gathered, or what is left of it in a replay
        δL = mi.Spectrum(0 if δL is None else δL)
        β = mi.Spectrum(1)  # throughput
        bounce = mi.UInt32(0)  # reflections so far
        pdf_before = mi.Float(0)  # of the direction that led here
        delta_before = mi.Bool(True)
        chance = mi.Float(0)  # largest contribution that a source met by chance could have made
        pi = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
        valid = pi.is_valid()
        if dr.hint(channels is not None, mode="scalar"):
            first = pi.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
            channels.meet(first, emitters, first.emitter(scene, active), facets)
            if dr.hint(channels.model_only, mode="scalar"):
                active &= channels.of_model > 0

        while dr.hint(active, max_iterations=limit + 1, label=f"bounce_path ({mode.name})"):
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            emitter = si.emitter(scene, active)

            # ------------------------ Emission ------------------------

            mis = mi.Float(1)
            if dr.hint(self.emitter_sampling and emitters.draws, mode="scalar"):
                reachable = active & ~delta_before
                pdf = emitters.pdf(scene, ray.o, si, emitter, reachable)
                mis = dr.select(reachable, mis_weight(pdf_before, pdf), 1)
            with dr.resume_grad(when=not primal):
                Le = β * mis * emitter.eval(si, active)
            if dr.hint(self.closure == "ambient", mode="scalar"):
                beyond = bounce > self.max_bounces
                Le = dr.select(beyond, dr.select(si.is_valid(), β * self.ambient_radiance, 0), Le)
            L = L + Le if primal else L - Le
            if dr.hint(channels is not None, mode="scalar"):
                channels.add(
                    Le[0], bounce, emitters.sources, emitter, si.prim_index, self.max_bounces
                )

            active_next = active & si.is_valid() & (bounce < limit)
            bsdf = si.bsdf(ray)

            # -------------------- Emitter sampling --------------------

            Lr = mi.Spectrum(0)
            if dr.hint(emitters.draws, mode="scalar"):
                active_em = (
                    active_next
                    & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
                    & (bounce < self.max_bounces)
                )
                drawn = emitters.sample(scene, si, sampler.next_2d(), sampler.next_2d(), active_em)
                with dr.resume_grad(when=not primal):
                    f, pdf = bsdf.eval_pdf(ctx, si, si.to_local(drawn.ds.d), drawn.counts)
                    mis = dr.select(drawn.ds.delta, 1, mis_weight(drawn.ds.pdf, pdf))
                    Lr = dr.select(
                        drawn.counts, β * f * drawn.radiance(si) * (mis / drawn.ds.pdf), 0
                    )
                L = L + Lr if primal else L - Lr
                if dr.hint(channels is not None, mode="scalar"):
                    channels.add(
                        Lr[0],
                        bounce + 1,
                        emitters.sources,
                        drawn.emitter,
                        drawn.hit.prim_index,
                        self.max_bounces,
                    )

            # ----------------------- Reflection -----------------------

            sample1, sample2 = sampler.next_1d(), sampler.next_2d()
            bs, weight = bsdf.sample(ctx, si, sample1, sample2, active_next)
            delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            active_next &= dr.max(weight) != 0

            if dr.hint(not primal, mode="scalar"):
                with dr.resume_grad():
                    # L is what comes back along the sampled direction; its derivative enters
                    # through what the BSDF reflects along it.
                    f = value_along(bsdf, ctx, si, sample1, sample2, bs, active_next)
                    Lo = Le + Lr + L * dr.relative_grad(f)
                    if dr.hint(mode == dr.ADMode.Backward, mode="scalar"):
                        dr.backward_from(δL * Lo)
                    else:
                        δL += dr.forward_to(Lo)

            β *= weight
            pdf_before, delta_before = bs.pdf, delta
            if dr.hint(emitters.draws, mode="scalar"):
                gain = β[0] * emitters.by_chance(drawn, bs.pdf, delta)
                reaches = active_next & (bounce < self.max_bounces)
                chance = dr.maximum(chance, dr.select(reaches, gain, 0))
            ray = emitters.spawn_ray(si, si.to_world(bs.wo))
            pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active_next)
            bounce += 1
            active = active_next

        if dr.hint(channels is not None and channels.segments is not None, mode="scalar"):
            channels.segments = mi.Float(bounce)
        return (L if primal else δL, L), valid, channels, chance


mi.register_integrator("bounce_path", BouncePath)
