"""The walk: follows paths from the observer, from surface to surface.

It knows what emits and what reflects, and tells recorders of the events of each path. It does not
know what they note.
"""

from dataclasses import dataclass, replace
from functools import partial

import drjit as dr
import mitsuba as mi
from mitsuba.python.ad.integrators.common import mis_weight

from mi_lcair.plugins.bins.by_bin import ByBin
from mi_lcair.plugins.bsdfs.plume import is_passed
from mi_lcair.plugins.derivatives import value_along
from mi_lcair.plugins.emission.emitter_table import MOST_PASSED, DrawnDirection, EmitterTable
from mi_lcair.plugins.emission.hot_parts import SeenParts
from mi_lcair.plugins.emission.panels import Openings
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.paths.kept_hits import KeptHits
from mi_lcair.plugins.paths.launch import DIRECT, OTHER_THAN_DIRECT, WHOLE
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.recorders.recorder import Emission, Recorders, Reflection

# Undrawn directions are NaN, and NaN * 0 is NaN. This valid direction replaces them.
UPWARD = (0, 0, 1)
# Largest weight of a reflection that counts as 0 where derivatives are explored. What it would add
# to a radiance is below the rounding error of Float32.
LARGEST_LATENT = 1e-7

# Reflections for each one that draws where emitting walls surround the scene. Reflected rays meet
# emitters there, and drawn directions take time and mostly add noise.
EVERY = 8
PACKET = 16  # largest number of paths that a processor's vectors hold

# Throughput below which a path goes on by Russian roulette
FAINT = 1e-4


@dataclass
class PathState:
    """What the loop carries along each path.

    ray: the ray that is on its way. pi: its hit, of which only the primitive and the distance are
    known. throughput: that of the path up to the ray's start. bounce: number of reflections before.
    pdf: density of the ray's direction [1/sr]. is_delta: whether the direction came from a delta
    lobe or from the sensor. Such a direction has no density, and cannot be drawn toward an emitter.
    passed: surfaces passed since the last reflection. receiver: where the last reflection was; None
    if that does not matter.
    latent: throughput of a latent path, of which `throughput` is 0: that with a weight of 1 where
    the surface reflects nothing. 0 for other paths; None where nothing is explored. by_bin:
    throughputs of the bins of wavelength, see `ByBin`; None in a scene without spectral materials.
    factors: those of the last emission by bin.
    """

    o: mi.Point3f
    d: mi.Vector3f
    pi: mi.PreliminaryIntersection3f
    throughput: mi.Spectrum
    bounce: mi.UInt32
    pdf: mi.Float
    is_delta: mi.Bool
    passed: mi.UInt32
    receiver: Receiver | None
    latent: mi.Spectrum | None
    by_bin: dr.Local | None = None
    factors: dr.Local | None = None

    @property
    def ray(self) -> mi.Ray3f:
        return mi.Ray3f(self.o, self.d)


@dataclass(frozen=True)
class Hit:
    """The hit of a path's ray: the interaction, its surface, its emitter, and who follows it.

    emitter: that of the surface, or the environment where the ray escapes. active: the paths that
    got here. reflects: those that reflect here. passes: those that go straight on.
    """

    si: mi.SurfaceInteraction3f
    bsdf: mi.BSDFPtr
    emitter: mi.EmitterPtr
    active: mi.Bool
    reflects: mi.Bool
    passes: mi.Bool

    @property
    def goes_on(self) -> mi.Bool:
        return self.reflects | self.passes


@dataclass(frozen=True)
class Replay:
    """What a replay of paths needs of the pass that it repeats.

    mode: dr.ADMode.Forward or Backward. gradient: that of the objective with respect to the
    radiance of each path, mi.Spectrum; None where the mode is Forward. state: what the primal pass
    returned.
    """

    mode: dr.ADMode
    gradient: mi.Spectrum | None
    state: tuple


@dataclass(frozen=True)
class Scattering:
    """What is sampled at a hit.

    numbers: the random numbers. bs, weight: the sampled direction, and BSDF times cosine divided by
    its density. drawn: the first direction drawn toward an emitter; None if none are drawn.
    brought: the radiance that all of them bring to the sensor, with derivatives [W m^-2 sr^-1].
    latent: the same along a latent path, without derivatives. becomes_latent: whether the path
    becomes a latent one. Both are None where nothing is explored. seen: the hot parts toward which
    the direction may be drawn; None where rays are not guided.
    """

    numbers: tuple
    bs: mi.BSDFSample3f
    weight: mi.Spectrum
    drawn: DrawnDirection | None
    brought: mi.Spectrum
    latent: mi.Spectrum | None
    becomes_latent: mi.Bool | None
    seen: SeenParts | None = None

    @property
    def is_delta(self) -> mi.Bool:
        return mi.has_flag(self.bs.sampled_type, mi.BSDFFlags.Delta)


class Walk:
    """Follows paths through a scene.

    emitters: the scene's emitters. max_bounces: number of reflections after which paths end, or
    after which each path ends. shares_hits: whether emitters that a ray can hit are also drawn.
    ambient_radiance: radiance of any surface after one more reflection [W m^-2 sr^-1]; None: the
    path ends before. explored: for the pointer to a BSDF, a positive number if it is explored; None
    if none is, see `columns/tables.py`. by_bin: tables of spectral materials; None if the scene has
    none. openings: those through which no path leaves by chance; None where paths do.
    """

    def __init__(
        self, scene, emitters, max_bounces, emitter_sampling, ambient_radiance, explored=None
    ):
        self.scene: mi.Scene = scene
        self.emitters: EmitterTable = emitters
        self.max_bounces: int | mi.UInt32 = max_bounces
        self.shares_hits: bool = emitter_sampling and emitters.draws
        self.ambient_radiance: mi.Float | None = ambient_radiance
        self.explored: mi.UInt32 | None = explored
        self.by_bin: ByBin | None = None
        self.openings: Openings | None = None
        self.control = None  # control variate of a replay, see `Control`
        self.packets: mi.UInt32 | None = None  # those that paths belong to, see `draws_at`
        self.draws_last = False  # whether the last reflection has drawn rays alone
        self.kept: KeptHits | None = None  # hits that a replay does not trace again

    @property
    def may_be_guided(self) -> bool:
        """Whether reflected rays may be guided: where nothing else changes their density."""
        return not self.emitters.draws and self.explored is None and self.openings is None

    @dr.syntax
    def walk(self, sampler, first, active, recorders: Recorders, part=WHOLE, replay=None, hot=None):
        """Trace paths from the observer.

        Parameters
        ----------
        sampler : mi.Sampler
        first : tuple of mi.Ray3f and mi.PreliminaryIntersection3f
            The first ray of each path, and what it hits.
        active : mi.Bool
        recorders : Recorders
        part : str
            WHOLE, or a part of the radiance, see `Launch`. A replay gives the derivative of all.
        replay : Replay or None
            None: the radiance. Otherwise its derivative. The same paths are traced again and the
            radiance of the primal pass is used up step by step (path replay).
        hot : HotParts or None
            Parts toward which rays are guided, without a replay, see `may_be_guided`.

        Returns
        -------
        (result, state) : tuple
            `result` is the radiance or its derivative (Forward), mi.Spectrum. `state`
            is for a replay: the radiance, and that along latent paths [W m^-2 sr^-1].
        valid : mi.Bool
            Whether the first ray hits a surface.
        recorders : Recorders
        """
        primal, mode = replay is None, None if replay is None else replay.mode
        # An opaque number, so that one kernel serves every number of reflections
        most = 0 if part == DIRECT else self.max_bounces
        most = most if isinstance(most, mi.UInt32) else dr.opaque(mi.UInt32, most)
        # Radiance: accumulated in the primal pass; in a replay, the part not yet accounted for
        L, latent = self.nothing() if primal else replay.state
        δL = mi.Spectrum(0) if mode == dr.ADMode.Forward else None
        is_controlled = not primal and self.control is not None
        cell = self.control.cells(dr.width(first)) if is_controlled else None
        active = mi.Bool(active)
        path = self.begin(*first)
        valid = path.pi.is_valid()
        counts = None
        if part == OTHER_THAN_DIRECT:
            counts = ~(valid & self.emitters.is_model(path.pi.shape.emitter()))
        active = recorders.begin(path.pi, path.ray, active)

        while dr.hint(active, label="bounce_path", exclude=[most, hot, replay]):
            hit, lost = self.hit(path, most, active)
            recorders.meet(hit.bsdf, hit.si.wi)
            if dr.hint(self.emitters.passes, mode="scalar"):
                escapes = hit.active & ~hit.si.is_valid() & (path.bounce == 0)
                escapes &= dr.reinterpret_array(mi.UInt32, hit.emitter) == 0
                recorders.escape(escapes, path.throughput[0])
            Le, of_latent = self.emitted(primal, path, hit, most, recorders, counts)
            # A replay subtracts what the primal pass added, so that after the subtractions L is the
            # radiance from later vertices
            L = accounted(L, Le, primal)
            latent = accounted(latent, of_latent, primal)
            L = dr.select(lost, dr.nan, L)

            scattering = self.scatter(primal, path, hit, most, sampler, recorders, hot)
            L = accounted(L, scattering.brought, primal)
            latent = accounted(latent, scattering.latent, primal)
            if dr.hint(self.explored is None, mode="scalar"):
                scattering = replace(scattering, weight=roulette(path, hit.si, scattering))
            self.report(path, hit, scattering, most, recorders)
            # A path without throughput contributes nothing further
            active = hit.goes_on & (dr.max(scattering.weight) != 0)
            if dr.hint(self.draws_last, mode="scalar"):
                active &= path.bounce + 1 < most
            if dr.hint(self.explored is not None, mode="scalar"):
                # Nor does a latent path that a second surface does not reflect
                is_real = dr.max(path.throughput) != 0
                active &= is_real | (dr.max(scattering.weight) > LARGEST_LATENT)
                active |= scattering.becomes_latent
            if dr.hint(not primal, mode="scalar"):
                c = None
                if dr.hint(is_controlled, mode="scalar"):
                    c = self.control.incoming(hit.bsdf, path.bounce, cell)
                reflected = replayed(path, hit, scattering, (L, latent), c, active)
                δL = propagated(replay, [Le, scattering.brought, reflected], δL)

            self.turn(path, hit, scattering, active)
            if dr.hint(part == OTHER_THAN_DIRECT, mode="scalar"):
                counts |= path.bounce > 0
        return (mi.Spectrum(L) if δL is None else δL, (L, latent)), valid, recorders

    def nothing(self) -> tuple:
        """The radiance and that along latent paths, of which nothing is known yet.

        The relative derivative of a small reflectance is large. It needs more digits than Float32
        has.
        """
        if self.explored is None:
            return mi.Spectrum(0), None
        return dr.float64_array_t(mi.Spectrum)(0), mi.Spectrum(0)

    def begin(self, ray, pi) -> PathState:
        """Paths whose first ray is traced. The inputs are copied, since the loop changes them."""
        pi = mi.PreliminaryIntersection3f(pi)
        # Dr.Jit 1.5 reads a path's own array wrongly if its index is a number that began as one for
        # all paths, and becomes different between them
        bounce = mi.UInt32(0)
        if self.emitters.passes:
            bounce = dr.zeros(mi.UInt32, dr.width(ray))
            dr.make_opaque(bounce)
        return PathState(
            o=mi.Point3f(ray.o),
            d=mi.Vector3f(ray.d),
            pi=pi,
            throughput=mi.Spectrum(1),
            bounce=bounce,
            pdf=mi.Float(0),
            is_delta=mi.Bool(True),
            passed=mi.UInt32(0),
            receiver=dr.zeros(Receiver) if self.shares_hits else None,
            latent=None if self.explored is None else mi.Spectrum(0),
            by_bin=None if self.by_bin is None else self.by_bin.ones(),
            factors=None if self.by_bin is None else self.by_bin.ones(),
        )

    def hit(self, path: PathState, most, active) -> tuple[Hit, mi.Bool]:
        """The hits of the paths' rays, and the paths that have passed too many surfaces.

        The full interaction is computed here, so that the loop carries few variables.
        """
        si = path.pi.compute_surface_interaction(path.ray, mi.RayFlags.All, active)
        bsdf = si.bsdf(path.ray)
        # The ray beyond the last reflection only receives the ambient radiance
        limit = most if self.ambient_radiance is None else most + 1
        reflects = active & si.is_valid() & (path.bounce < limit)
        passes, lost = mi.Bool(False), mi.Bool(False)
        if self.emitters.passes:
            # The ambient radiance comes from any surface that the ray hits
            is_through = is_passed(bsdf.flags())
            passes = active & si.is_valid() & is_through & (path.bounce <= most)
            lost = passes & (path.passed >= MOST_PASSED)
            passes &= path.passed < MOST_PASSED
            reflects &= ~is_through
        return Hit(si, bsdf, si.emitter(self.scene, active), active, reflects, passes), lost

    def emitted(self, primal: bool, path: PathState, hit: Hit, most, recorders, counts):
        """Radiance that the rays have met, differentiable in temperature and emissivity.

        Also that along latent paths, without derivatives; None where nothing is explored. counts:
        the paths of which it counts; None for all.
        """
        si, emitters, beyond = hit.si, self.emitters, path.bounce > most
        # The emitter may have been drawn at the vertex before. Both estimates share its radiance.
        share = mi.Float(1)
        if self.shares_hits:
            reachable = hit.active & ~path.is_delta & self.draws_at(path.bounce - 1)
            distance = si.t
            if emitters.passes:
                distance = dr.norm(si.p - path.receiver.p)
            pdf = emitters.pdf(self.scene, path.receiver, distance, si, hit.emitter, reachable)
            share = dr.select(reachable, mis_weight(path.pdf, pdf), 1)
        counts = mi.Bool(True) if counts is None else counts
        share = dr.select(counts, share, 0)
        # The throughput and the share are constants
        with dr.resume_grad(when=not primal):
            emitted = hit.emitter.eval(si, hit.active)
            if self.ambient_radiance is not None:
                emitted = dr.select(beyond, self.ambient_radiance, emitted)
                share = dr.select(beyond, dr.select(si.is_valid(), mi.Float(1), 0), share)
            Le = path.throughput * share * emitted
        latent = None if path.latent is None else path.latent * share * dr.detach(emitted)
        parts, by_bin = emitters.parts(hit.emitter, si.prim_index, path.d, hit.active), None
        if self.by_bin is not None:
            emits = self.by_bin.emits(hit.emitter, hit.bsdf, si.wi, hit.active & ~beyond)
            numbers = self.by_bin.numbers(hit.emitter, parts, beyond)
            by_bin = self.by_bin.radiance(path, emitted, parts, numbers, emits)
            by_bin = by_bin.times(path.throughput[0] * share)
            Le = mi.Spectrum(by_bin.radiance)
        weight = dr.select(beyond, 0, path.throughput[0] * share)
        emission = Emission(Le[0], path.bounce, beyond, hit.emitter, parts, weight, si)
        recorders.emission(replace(emission, latent=first(latent), by_bin=by_bin))
        # The sun is no surface. It is seen where the ray escapes, and through the sky.
        if emitters.sun is not None:
            sees = hit.active & counts & ~beyond & emitters.shows_sun(si, hit.emitter)
            with dr.resume_grad(when=not primal):
                of_sun, pdf = emitters.sun_along(path.d, sees)
                share = dr.select(path.is_delta, 1, mis_weight(path.pdf, pdf))
                latent_sun = None
                if latent is not None:
                    latent_sun = path.latent * share * dr.detach(of_sun)
                    latent = latent + latent_sun
                sun, whole = emitters.sun_pointer, [(si.prim_index, mi.Float(1))]
                if self.by_bin is not None:
                    numbers = self.by_bin.numbers(sun, whole)
                    by_bin = self.by_bin.radiance(path, of_sun, whole, numbers)
                    by_bin = by_bin.times(path.throughput[0] * share)
                of_sun *= path.throughput * share
                of_sun = of_sun if by_bin is None else mi.Spectrum(by_bin.radiance)
                Le += of_sun
            emission = Emission(of_sun[0], path.bounce, beyond, sun, whole, mi.Float(0), None)
            recorders.emission(replace(emission, latent=first(latent_sun), by_bin=by_bin))
        return Le, latent

    def scatter(self, primal: bool, path: PathState, hit: Hit, most, sampler, recorders, hot):
        """Sample a direction at each hit, and what a direction drawn toward an emitter brings."""
        ctx, si, bsdf = mi.BSDFContext(), hit.si, hit.bsdf
        if not self.emitters.draws:
            numbers = sampler.next_1d(), sampler.next_2d()
            seen = None
            if hot is None:
                bs, weight = bsdf.sample(ctx, si, *numbers, hit.goes_on)
            else:
                seen = hot.seen(si, bsdf, hit.reflects & (path.bounce < most))
                bs, weight = seen.sample(ctx, si, bsdf, *numbers, hit.goes_on)
            bs, weight, becomes_latent = self.reflected(path, hit, sampler, bs, weight)
            nothing = mi.Spectrum(0)
            return Scattering(numbers, bs, weight, None, nothing, None, becomes_latent, seen)
        # A delta lobe does not reflect light from a drawn direction. Beyond the last reflection
        # there is no emission, which the ambient radiance replaces.
        is_smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        draws = hit.goes_on & is_smooth & (path.bounce < most) & self.draws_at(path.bounce)
        # Two 2D samples, for the emitter and for the point on it: the 23 bits of a Float32 number
        # are too few for both
        drawn = []
        for number, table in enumerate(self.emitters.tables):
            samples = sampler.next_2d(), sampler.next_2d()
            draw = partial(self.emitters.draw, table, si, *samples, draws)
            if self.kept is None or not self.kept.keeps_drawn or table.others is not None:
                drawn.append(draw())
            else:
                of_ray = path.bounce * len(self.emitters.tables) + number
                drawn.append(self.kept.drawn(draw, of_ray, draws))
        numbers = sampler.next_1d(), sampler.next_2d()
        first_to, *later = (si.to_local(direction.ds.d) for direction in drawn)
        with dr.resume_grad(when=not primal):
            # One call is faster than one for the drawn and one for the next direction
            f, pdf, bs, weight = bsdf.eval_pdf_sample(ctx, si, first_to, *numbers, hit.goes_on)
            bs, weight = dr.detach((bs, weight))  # only `f` has derivatives
            values = [(first_to, f, pdf)]
            values += [(to, *bsdf.eval_pdf(ctx, si, to, hit.goes_on)) for to in later]
        brought, latent = mi.Spectrum(0), None if path.latent is None else mi.Spectrum(0)
        with_hit = recorders.needs_drawn_hit or self.by_bin is not None
        for number, (direction, value) in enumerate(zip(drawn, values)):
            # No ray where nothing is reflected, or emitted. A replay traces it even so, because a
            # radiance of 0 may have a derivative.
            traced = draws & ((dr.max(dr.detach(value[1])) != 0) | self.is_explored(hit))
            if primal and self.kept is None:
                traced &= direction.may_radiate
            nearest = partial(self.nearest, path, hit, 1 + number)
            table = self.emitters.tables[number]
            with dr.resume_grad(when=not primal):
                direct = self.emitters.trace(table, nearest, si, direction, traced, with_hit)
                part = self.bring(primal, path, hit, most, direct, value, recorders)
                brought = brought + part[0]
            latent = None if latent is None else latent + part[1]
        bs, weight, becomes_latent = self.reflected(path, hit, sampler, bs, weight)
        return Scattering(numbers, bs, weight, drawn[0], brought, latent, becomes_latent)

    def reflected(self, path: PathState, hit: Hit, sampler, bs, weight) -> tuple:
        """The sampled direction in which the path goes on, its weight, and what becomes latent."""
        factor = mi.Float(1)
        if self.openings is not None:
            bs, weight, factor = self.openings.reflect(
                self.scene, self.emitters, hit, sampler, bs, weight
            )
        if self.by_bin is not None:
            self.by_bin.reflect(path.by_bin, hit, bs, weight)
        return bs, weight * factor, self.becomes_latent(path, hit, bs, weight)

    def bring(self, primal: bool, path, hit: Hit, most, direct, value, recorders):
        """Radiance that a drawn direction brings, and that along latent paths, or None.

        direct: the `EmitterSample` of the direction. value: the direction in the surface's frame,
        BSDF times cosine, and the density of a reflection.
        """
        si, drawn, (to, f, pdf) = hit.si, direct.drawn, value
        with dr.resume_grad(when=not primal):
            # A point source or a parallel beam cannot be hit by a reflected ray, so its whole
            # radiance belongs to the drawn direction
            is_whole = drawn.ds.delta | (self.draws_last & (path.bounce + 1 >= most))
            share = dr.select(is_whole, 1, mis_weight(drawn.compared, pdf)) / drawn.ds.pdf
            radiance = direct.radiance(si)
            parts = self.emitters.parts(
                direct.emitter, direct.hit.prim_index, drawn.ds.d, direct.counts
            )
            brought, by_bin = path.throughput * f * radiance * share, None
            if self.by_bin is not None:
                by_bin = self.by_bin.drawn(path, hit, direct, value, radiance, parts)
                by_bin = by_bin.times(dr.select(direct.counts, path.throughput[0] * share, 0))
                brought = mi.Spectrum(by_bin.radiance)
            brought = dr.select(direct.counts, brought, 0)
        before = path.throughput * dr.detach(dr.select(direct.counts, radiance * share, 0))
        latent = None
        if path.latent is not None:
            latent = path.latent * dr.detach(f * radiance * share)
            latent = dr.select(direct.counts, latent, 0)
        weight_of_source = path.throughput[0] * f[0] * share
        if direct.transmittance is not None:
            weight_of_source *= direct.transmittance
        recorders.emission(
            Emission(
                radiance=brought[0],
                bounce=path.bounce + 1,
                beyond=mi.Bool(False),  # none is drawn at the last reflection
                emitter=direct.emitter,
                parts=parts,
                weight=dr.select(direct.counts, weight_of_source, 0),
                hit=direct.hit,
                drawn_to=dr.select(direct.counts, to, UPWARD),
                before=before[0],
                latent=first(latent),
                by_bin=by_bin,
                toward=direct.met,
            )
        )
        return brought, latent

    def draws_at(self, reflection) -> mi.Bool:
        """Whether paths draw toward emitters at a reflection.

        A mean of unbiased estimates is unbiased. Paths of one packet draw together, so that the
        processor skips the draws of the others.
        """
        if self.packets is None:
            return mi.Bool(True)
        return (self.packets + reflection) % EVERY == 0

    def is_explored(self, hit: Hit) -> mi.Bool:
        if self.explored is None:
            return mi.Bool(False)
        return dr.gather(mi.UInt32, self.explored, dr.reinterpret_array(mi.UInt32, hit.bsdf)) > 0

    def becomes_latent(self, path: PathState, hit: Hit, bs, weight) -> mi.Bool | None:
        """Whether paths become latent, because an explored surface would end them."""
        if self.explored is None:
            return None
        is_nothing = (bs.pdf > 0) & (dr.max(weight) <= LARGEST_LATENT)
        is_real = dr.max(path.throughput) != 0
        return hit.goes_on & self.is_explored(hit) & is_nothing & is_real

    def report(self, path: PathState, hit: Hit, scattering: Scattering, most, recorders):
        """Tell the recorders of the sampled directions."""
        receives = hit.reflects & (path.bounce < most)
        recorders.reflect(
            Reflection(
                bsdf=hit.bsdf,
                bounce=path.bounce,
                throughput=path.throughput[0],
                weight=scattering.weight[0],
                to=scattering.bs.wo,
                pdf=scattering.bs.pdf,
                is_delta=scattering.is_delta,
                drawn=scattering.drawn,
                active=hit.goes_on,
                receives=receives,
                becomes_latent=scattering.becomes_latent,
                mirrored=self.mirrored(hit, receives) if recorders.needs_mirrored else None,
                seen=scattering.seen,
            )
        )

    def mirrored(self, hit: Hit, active) -> mi.Float:
        """Radiance that is emitted toward each hit along the mirror direction [W m^-2 sr^-1]."""
        ray = self.emitters.spawn_ray(hit.si, hit.si.to_world(mi.reflect(hit.si.wi)))
        pi = nearest_hit(self.scene, self.emitters.sheets, ray, active=active)
        si = pi.compute_surface_interaction(ray, active=active)
        return dr.select(active, si.emitter(self.scene, active).eval(si, active)[0], 0)

    def turn(self, path: PathState, hit: Hit, scattering: Scattering, active) -> None:
        """Go on along the sampled direction, or straight on through a surface."""
        si, bs, passes = hit.si, scattering.bs, hit.passes
        if path.latent is not None:
            becomes_latent = scattering.becomes_latent
            before = path.latent * scattering.weight
            path.latent = dr.select(becomes_latent, path.throughput, before)
            path.throughput = dr.select(becomes_latent, 0, path.throughput)
        path.throughput *= scattering.weight
        to = dr.select(passes, path.d, si.to_world(bs.wo))
        path.pdf = dr.select(passes, path.pdf, bs.pdf)
        path.is_delta = dr.select(passes, path.is_delta, scattering.is_delta)
        path.passed = dr.select(passes, path.passed + 1, 0)
        if path.receiver is not None:
            receiver = self.emitters.receiver(si)
            path.receiver = dr.select(passes, path.receiver, receiver)
        # The offset from the surface is smaller than Mitsuba's in a small scene
        ray = self.emitters.spawn_ray(si, to)
        path.o, path.d = ray.o, ray.d
        path.pi = self.nearest(path, hit, 0, ray, active)
        path.bounce += dr.select(passes, mi.UInt32(0), 1)

    def nearest(self, path: PathState, hit: Hit, kind: int, ray, active):
        """What a ray from a vertex hits first, see `KeptHits`."""
        scene, sheets = self.scene, self.emitters.sheets
        if self.kept is None:
            return nearest_hit(scene, sheets, ray, active=active)
        slot = path.bounce * self.kept.kinds + kind
        return self.kept.nearest(scene, sheets, ray, slot, hit.active, active)


def roulette(path: PathState, si, scattering: Scattering) -> mi.Spectrum:
    """The weights of the directions after Russian roulette between paths of little throughput.

    A path whose throughput would fall below FAINT goes on with the throughput FAINT or ends. The
    means stay as they are. The random number is a hash of the hit and the direction, so that a
    replay ends the same paths, and the lattice keeps its dimensions.
    """
    throughput = path.throughput[0] * scattering.weight[0]
    p, d = (dr.reinterpret_array(mi.Vector3u, place) for place in (si.p, scattering.bs.wo))
    position = mi.sample_tea_32(p.x ^ d.z, p.y ^ (p.z << 16))[0]
    number = mi.sample_tea_float32(position, d.x ^ (d.y << 16))
    is_faint = (throughput > 0) & (throughput < FAINT)
    weight = dr.select(number * FAINT < throughput, FAINT / path.throughput[0], 0)
    return dr.select(is_faint, weight, scattering.weight)


def accounted(total, part, primal: bool):
    """A radiance that the primal pass adds up, and of which a replay takes away part by part."""
    if part is None:
        return total
    return total + part if primal else total - part


def first(radiance: mi.Spectrum | None) -> mi.Float | None:
    """The one number of a radiance."""
    return None if radiance is None else radiance[0]


def replayed(path: PathState, hit: Hit, scattering: Scattering, later, c, active) -> mi.Spectrum:
    """The radiance from later vertices, with derivatives with respect to the parameters here.

    later: that radiance, times the throughput, and that along the latent path that begins here.
    They depend on the parameters at this vertex through the BSDF value `f` alone, since the sampled
    direction and its density are constants. The relative derivative of the radiance is therefore
    that of `f`. The latent path has the weight 1 in place of f / pdf.

    c: mean incoming radiance, or 0, for the control variate; None without one, see `Control`.
    """
    L, latent = later
    with dr.resume_grad():
        ctx, bs = mi.BSDFContext(), scattering.bs
        f = value_along(hit.bsdf, ctx, hit.si, *scattering.numbers, bs, active)
        if latent is None:
            reflected = L * dr.relative_grad(f)
        else:
            becomes_latent = scattering.becomes_latent
            is_real = active & (dr.max(path.throughput) != 0) & ~becomes_latent
            reflected = mi.Spectrum(dr.select(is_real, L, 0)) * dr.relative_grad(f)
            pdf = dr.select(becomes_latent, bs.pdf, 1)
            reflected += dr.select(becomes_latent, latent * f / pdf, 0)
        if c is not None:
            HDR = hit.bsdf.eval_diffuse_reflectance(hit.si, hit.goes_on)
            weight = dr.select(bs.pdf > 0, f / dr.select(bs.pdf > 0, bs.pdf, 1), 0)
            controlled = hit.reflects & (c > 0) & (hit.si.wi.z > 0)
            reflected += dr.select(controlled, path.throughput * c * (HDR - weight), 0)
        return reflected


def propagated(replay: Replay, radiances, δL) -> mi.Spectrum | None:
    """The derivative of each path's radiance with these parts of it added to `δL`.

    In reverse mode, the gradient of the objective is passed on to the parameters.
    """
    with dr.resume_grad():
        Lo = sum(radiances)
        if replay.mode == dr.ADMode.Backward:
            return dr.backward_from(replay.gradient * Lo)
        return δL + dr.forward_to(Lo)
