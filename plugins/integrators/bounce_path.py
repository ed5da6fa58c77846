r"""Integrator `bounce_path`: path tracing from the observer up to a given number of reflections.

It can record the radiance separately for each number of reflections.
"""

from contextlib import contextmanager
from math import hypot

import drjit as dr
import mitsuba as mi
from mitsuba.python.ad.integrators.common import RBIntegrator, mis_weight

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.plume import is_passed, is_plume
from mi_lcair.plugins.derivatives import (
    attached,
    derivations,
    deriving_plugins,
    flatten,
    leaves,
    own_memory,
    tracing,
    value_along,
)
from mi_lcair.plugins.emission.emissivity import Table
from mi_lcair.plugins.emission.emitter_table import MOST_PASSED, EmitterTable
from mi_lcair.plugins.paths.channels import SIZES, Channels
from mi_lcair.plugins.paths.columns import CELLS, Columns, ColumnTables
from mi_lcair.plugins.paths.launch import Launch, Paths
from mi_lcair.plugins.paths.rays import ParallelRays
from mi_lcair.plugins.paths.recording import Recorded
from mi_lcair.plugins.paths.rounding import rounding_error
from mi_lcair.plugins.paths.sums import BlockSums, Sums, block_size
from mi_lcair.plugins.paths.tail import Tail
from mi_lcair.plugins.properties import HOTTEST, Property, read
from mi_lcair.plugins.scene_state import SceneState

MOST_KEPT = 8  # tracers of a scene that are kept, each with other settings


class BouncePath(RBIntegrator):
    r"""Bounce-limited path tracer for thermal radiance, with derivatives by path replay.

    =================== ======= ====================================================================
    max_bounces         integer reflections after which a path ends, 0..10000;
                                0 = emission only                                               (4)
    emitter_sampling    boolean at each reflection, also trace a ray to a point drawn from the
                                emitters (multiple importance sampling); the sun, and lights
                                that no path can hit (point, spot), are always drawn        (false)
    closure             string  estimate of the radiance beyond max_bounces reflections      (none)
                                none: it is left out; ambient: one more reflection, and the
                                surface which that ray hits radiates as a blackbody at
                                ambient_temperature (a ray that escapes adds nothing);
                                tail: geometric continuation of the radiances after the last
                                two numbers of reflections, for the model and its background
                                separately
    ambient_temperature float   kelvin, for closure = ambient
    =================== ======= ====================================================================

    .. code-block:: xml

        <integrator type="bounce_path"> <integer name="max_bounces" value="3"/> </integrator>

    emitter_sampling is off by default because it can increase the variance much more than it can
    reduce it. At equal time, the variance falls by a factor of 7 in the scene two_plates, and by
    1.5 in open_box and in the widest cavity. It doubles in the cavity with the smallest opening. In
    the furnace it grows by more than a factor of 100: without emitter sampling, all paths there
    have nearly the same radiance, because emissivity and reflectance of a surface add up to 1.

    Derivatives (forward and reverse, `mi.render(scene, params)`) are available with respect to the
    parameters of BSDFs and emitters and to facet temperatures, but not to the geometry. Memory does
    not grow with the number of bounces. `PathTracer.trace` also returns the radiance by number of
    reflections, by emitting group and by the group that is hit first, all from the same paths.
    """

    PROPERTIES = (
        Property("max_bounces", "integer", 4, lower=0, upper=10_000),
        Property("emitter_sampling", "boolean", False),
        Property("closure", "string", "none", choices=("none", "ambient", "tail")),
        Property("ambient_temperature", "float", upper=HOTTEST, is_positive=True, unit="K"),
    )

    def __init__(self, props):
        super().__init__(props)
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
        if (self.closure == "ambient") != (self.ambient_temperature is not None):
            raise InputError("bounce_path: closure = ambient and ambient_temperature go together")
        if self.closure == "tail" and self.max_bounces < 2:
            raise InputError(
                "bounce_path: closure = tail continues the last two bounce counts; "
                f"max_bounces = {self.max_bounces} must be >= 2"
            )

    def to_string(self):
        return (
            f"BouncePath[max_bounces = {self.max_bounces}, "
            f"emitter_sampling = {self.emitter_sampling}, closure = {self.closure}]"
        )

    @contextmanager
    def prepared(self, scene, by_spectrum: bool = False, kept: dict | None = None):
        """Context manager that gives a `PathTracer` for the scene.

        Inside the context, all data that plugins derive from the scene's parameters are up to date,
        and the scene must not change.

        Parameters
        ----------
        scene : mi.Scene
        by_spectrum : bool
            Record emission separately for each spectrum of a group, not only for each group.
        kept : dict or None
            The tracers of this scene that were made before, with the states of the scene. One of
            them is given again if nothing has changed since, and a new one is added.
        """
        self.check()
        plugins = deriving_plugins(scene)
        with dr.resume_grad():
            for plugin in plugins:
                plugin.refresh()
        with tracing(plugins):
            yield self.tracer(scene, by_spectrum, {} if kept is None else kept)

    def tracer(self, scene, by_spectrum: bool, kept: dict):
        """A tracer for the present state of the scene: a kept one, or a new one.

        One is kept for each of the last MOST_KEPT settings of the integrator.
        """
        settings = [getattr(self, entry.name) for entry in self.PROPERTIES]
        state, key = SceneState(scene, scene, *settings), (by_spectrum, *settings)
        if key in kept and kept[key][0] == state:
            return kept[key][1]
        tracer = PathTracer(self, scene, by_spectrum, state)
        if not state.has_gradients:
            kept.pop(key, None)
            kept[key] = state, tracer
            if len(kept) > MOST_KEPT:
                kept.pop(next(iter(kept)))
        return tracer

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        with self.prepared(scene) as tracer:
            return tracer.render(scene, sensor, seed, spp, develop, evaluate)

    def render_forward(self, scene, params, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        with self.prepared(scene) as tracer, leaves(scene, dr.ADMode.Forward):
            tracer.check_differentiable()
            return tracer.render_forward(scene, params, sensor, seed, spp)

    def render_backward(self, scene, params, grad_in, sensor=0, seed=0, spp=0):
        self.check_differentiable()
        with self.prepared(scene) as tracer, leaves(scene, dr.ADMode.Backward):
            tracer.check_differentiable()
            tracer.render_backward(scene, params, grad_in, sensor, seed, spp)

    def check_differentiable(self) -> None:
        if self.closure == "tail":
            raise InputError("bounce_path: closure = tail has no derivatives; use none or ambient")


class PathTracer(RBIntegrator):
    """Integrator for one scene, with all data that a render derives from the scene.

    `BouncePath.prepared` makes it. Its attributes cannot be set afterwards.

    scene: the scene. emitters: its `EmitterTable`, with the band, the labels and the sources.
    max_bounces, emitter_sampling, closure: the settings at the time when it was made.
    ambient_radiance: radiance beyond the last reflection for closure = ambient [W m^-2 sr^-1]; None
    for another closure. systematic_error: relative error of a radiance that more samples do not
    reduce. It comes from Float32 rounding and from tabulated emissivities.

    This is a separate integrator because the render methods of RBIntegrator call `sample` with the
    scene alone. The data derived from the scene must therefore belong to the integrator.
    """

    def __init__(self, integrator: BouncePath, scene, by_spectrum: bool, state: SceneState):
        super().__init__(mi.Properties())
        emitters = EmitterTable(scene, integrator.emitter_sampling, by_spectrum)
        own_memory(flatten(emitters))
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
            recorded=Recorded(state),
            is_complete=True,
        )

    def __setattr__(self, name, value):
        if vars(self).get("is_complete"):
            raise AttributeError(f"a PathTracer does not change: {name} cannot be set")
        super().__setattr__(name, value)

    def check_differentiable(self) -> None:
        """Raise InputError for a parameter whose derivative a replay would not give."""
        for bsdf in {shape.bsdf() for shape in self.scene.shapes()}:
            if is_plume(bsdf) and attached([bsdf.transmittance]):
                bsdf.check_derivative("plume: transmittance", self.emitters.draws)

    # ---------------------------------------------------------------- Around the loop

    def sample(self, mode, scene, sampler, ray, depth, δL, state_in, active, **kwargs):
        channels = (
            Channels.empty(self.max_bounces, self.closure, None) if self.closure == "tail" else None
        )
        (L, state), valid, channels, _, _ = self.walk(
            mode, scene, sampler, ray, δL, state_in, active, channels
        )
        if channels is not None:
            L += channels.add_tail()[0]
        return L, valid, [], state

    def trace(
        self,
        sensor,
        launch: Launch,
        split: str | None = "image",
        facets=None,
        count_segments: bool = False,
        counted: int | None = None,
        rays: ParallelRays | None = None,
        tables: ColumnTables | None = None,
    ) -> Sums:
        """Trace the paths of a launch; call it inside the context `prepared`.

        Parameters
        ----------
        sensor : mi.Sensor
        launch : Launch
            Where the paths begin and which random numbers they use.
        split : str or None
            Channels recorded beside the radiance. None: no channels. "image": the channels of
            `Channels.samples`. "target": also the part of each channel that lies on the model's
            facets. "model": only that part; paths that first hit something else are not followed.
        facets : object or None
            Numbering of facets with the methods `number(shape, prim_index, active)` and
            `add(facet, L, weight, channels, launch)`. The second one receives the samples, each
            with the facet that its path hits first.
        count_segments : bool
            Also record the number of rays of each path.
        counted : int or None
            Largest number of reflections whose radiance is recorded separately, in one of SIZES;
            that of more reflections is added to the last channel. None: as many as `max_bounces`.
        rays : ParallelRays or None
            The rays of the sensor, for a caller of many launches; None makes them from the sensor.
        tables : ColumnTables or None
            Parameters in which the radiance is differentiated. Channels with the columns are then
            recorded too, see `Columns.samples`; for `split` = "target" those of the model's part.

        Returns
        -------
        Sums
            Sums over the points of each randomisation.
        """
        with dr.suspend_grad():
            paths = launch.paths_from(sensor.sampler())
            rays = ParallelRays.of(sensor) if rays is None else rays
            counted = self.max_bounces if counted is None else counted
            size = block_size(launch)
            arguments = paths, rays or sensor, split, counted, count_segments, size, tables
            if facets is not None or self.closure == "tail":
                blocks, tail = self.whole_sums(*arguments, facets, launch)
            elif rays is None:
                # A recording would not see that a sensor of another kind has changed
                blocks, tail = self.block_sums(*arguments), None
            else:
                blocks, tail = self.recorded(self, *arguments), None
            found = Sums.of(blocks, tail, launch)
            return found.without(f"bounce.{k}" for k in range(self.max_bounces + 1, SIZES[-1]))

    def block_sums(
        self, paths: Paths, rays, split, counted: int, count_segments: bool, size: int, tables
    ) -> BlockSums:
        """Sums over blocks of the paths of a launch.

        It may be recorded. It therefore uses only the tracer and its arguments, and launches
        kernels but reads no values.

        Parameters
        ----------
        paths : Paths
        rays : ParallelRays or mi.Sensor
        split, counted, count_segments, tables
            As for `trace`.
        size : int
            Paths in a block.
        """
        L, channels, chance, weight, columns = self.follow(
            paths, rays, split, counted, count_segments, tables
        )
        by_name = self.by_name(L, channels, split, columns, tables)
        return BlockSums.of(L[0], by_name, weight, chance, size)

    def whole_sums(
        self,
        paths: Paths,
        rays,
        split,
        counted: int,
        count_segments: bool,
        size: int,
        tables,
        facets,
        launch: Launch,
    ) -> tuple[BlockSums, Tail | None]:
        """As `block_sums`, also for facets and for closure = tail, which read values."""
        L, channels, chance, weight, columns = self.follow(
            paths, rays, split, counted, count_segments, tables, facets
        )
        tail = None
        if self.closure == "tail":
            # The sums in add_tail need evaluated arrays. Evaluating everything here traces the
            # paths once; otherwise each sum would trace them again.
            dr.eval(L, channels, chance)
            added, tail = channels.add_tail()
            L += added
        by_name = self.by_name(L, channels, split, columns, tables)
        if facets is not None:
            # One kernel for all later uses of these arrays
            dr.eval(L, channels, by_name, chance)
            facets.add(channels.facet, L[0], weight, channels, launch)
        return BlockSums.of(L[0], by_name, weight, chance, size), tail

    def follow(
        self, paths: Paths, rays, split, counted: int, count_segments: bool, tables, facets=None
    ) -> tuple:
        """Radiance, `Channels`, `chance` (see `walk`), weight and `Columns` of each path."""
        sampler, column, row, position, weight = paths.begin()
        ray = self.first_ray(paths, rays, sampler, column, row, position)
        channels = None
        if split or facets or self.closure == "tail":
            channels = Channels.empty(
                counted,
                self.closure,
                self.emitters.sources if split else None,
                split == "model",
                count_segments,
            )
        columns = None
        if tables is not None:
            x = mi.UInt32((mi.Float(column) + position.x) * (CELLS / mi.Float(paths.columns)))
            y = mi.UInt32((mi.Float(row) + position.y) * (CELLS / mi.Float(paths.rows)))
            columns = Columns.empty(
                tables, dr.minimum(y, CELLS - 1) * CELLS + dr.minimum(x, CELLS - 1)
            )
        primal, everywhere = dr.ADMode.Primal, mi.Bool(True)
        (L, _), _, channels, chance, columns = self.walk(
            primal,
            self.scene,
            sampler,
            ray,
            None,
            None,
            everywhere,
            channels,
            facets,
            columns,
            tables,
        )
        return L, channels, chance if self.emitters.draws else None, weight, columns

    def first_ray(self, paths: Paths, rays, sampler, column, row, position) -> mi.Ray3f:
        """First ray of each path; `rays` as for `block_sums`, the others as `Paths.begin` gives."""
        if isinstance(rays, ParallelRays):
            return rays.at(column, row, position, paths.columns, paths.rows)
        size = mi.Vector2f(paths.columns, paths.rows)
        aperture = sampler.next_2d() if rays.needs_aperture_sample() else mi.Point2f(0.5)
        film_position = (mi.Point2f(column, row) + position) / size
        return rays.sample_ray(rays.shutter_open(), 0, film_position, aperture)[0]

    def by_name(self, L, channels: Channels | None, split, columns=None, tables=None) -> dict:
        """The channels of each path by name."""
        found, of_model = {}, split == "target"
        if columns is not None:
            found = columns.samples(tables)
            # A sample that is not finite in one column does not count at all
            for value in found.values():
                L[0] = dr.select(dr.isfinite(value), L[0], dr.nan)
            if of_model:
                found = {name: value * channels.of_model for name, value in found.items()}
        if split:
            found |= channels.samples(L[0], self.emitters.labels, self.emitters.sources, of_model)
        return found

    def chance_contribution(self, sensor) -> float:
        """Upper bound of the radiance from a source that no path has hit [W m^-2 sr^-1].

        This is the part of the bound that is known before paths are traced. Without emitter
        sampling it is the radiance of the brightest emitter. With emitter sampling it is the
        radiance of the brightest emitter in the sensor's field of view, hidden or not. The part
        that comes from reflections is estimated along the paths (`Sums.chance`).
        """
        if self.emitter_sampling:
            return self.emitters.brightest_in_view(sensor)
        return self.emitters.brightest

    # ---------------------------------------------------------------- The loop

    @dr.syntax
    def walk(
        self,
        mode,
        scene,
        sampler,
        ray,
        δL,
        L,
        active,
        channels=None,
        facets=None,
        columns=None,
        tables=None,
    ):
        """Trace paths from the observer.

        Parameters
        ----------
        mode : dr.ADMode
            Primal: the radiance. Forward, Backward: its derivative. The same paths are traced again
            and the radiance `L` of the primal pass is used up step by step (path replay).
        scene, sampler, ray, active
            As in Mitsuba's integrators, one ray per path.
        δL : mi.Spectrum or None
            Backward: the gradient of the objective with respect to the radiance of each path.
        L : mi.Spectrum or None
            Radiance of each path from the primal pass [W m^-2 sr^-1]; unused in mode Primal.
        channels : Channels, FacetColumns or None
            Receives the radiance by number of reflections, source and first hit, or by facet.
        facets : object or None
            Numbering of facets, see `trace`.
        columns : Columns or None
            Receives the derivatives in the parameters of `tables`.
        tables : ColumnTables or None

        Returns
        -------
        (result, L) : tuple of mi.Spectrum
            `result` is the radiance (Primal) or its derivative (Forward), `L` the state for a
            replay.
        valid : mi.Bool
            Whether the first ray hits a surface.
        channels : Channels, FacetColumns or None
        chance : mi.Float
            Largest contribution that a source could make to the path after a reflection, if the
            path hit the source (see `EmitterTable.by_chance`) [W m^-2 sr^-1]. It is 0 where no
            emitters are drawn: the radiance of the brightest source is the bound there.
        columns : Columns or None
        """
        primal = mode == dr.ADMode.Primal
        ctx = mi.BSDFContext()
        emitters = self.emitters
        # The closure `ambient` needs one more ray, which only receives the ambient radiance. The
        # limits are opaque numbers, so that one kernel serves every number of reflections.
        most = dr.opaque(mi.UInt32, self.max_bounces)
        limit = most + 1 if self.closure == "ambient" else most

        # Copy the inputs, because the loop changes its state variables in place
        ray = mi.Ray3f(ray)
        active = mi.Bool(active)
        # Radiance: accumulated in the primal pass; in a replay, the part not yet accounted for
        L = mi.Spectrum(0 if primal else L)
        δL = mi.Spectrum(0 if δL is None else δL)
        β = mi.Spectrum(1)  # throughput of the path up to the current vertex
        bounce = mi.UInt32(0)  # number of reflections so far
        pdf_before = mi.Float(0)  # density of the last sampled direction [1/sr]
        # Whether the last direction came from a delta lobe or, at the start, from the sensor. Such
        # a direction has no density, and emitter sampling cannot produce it.
        delta_before = mi.Bool(True)
        chance = mi.Float(0)  # largest contribution of a source that the path did not hit
        # Surfaces passed since the last reflection, and the length of the rays before the last one
        passed, length = mi.UInt32(0), mi.Float(0)

        # The first ray is traced before the loop, because the channels record its hit and may stop
        # paths that do not hit the model
        pi = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
        valid = pi.is_valid()
        if dr.hint(channels is not None, mode="scalar"):
            own = mi.RayFlags.Minimal if facets is None else mi.RayFlags.ShadingFrame
            first = pi.compute_surface_interaction(ray, own, active)
            channels.meet(first, emitters, first.emitter(scene, active), facets)
            if dr.hint(channels.model_only, mode="scalar"):
                active &= channels.of_model > 0

        while dr.hint(active, label=f"bounce_path ({mode.name})"):
            # Only the triangle and the distance of the hit were computed so far. The full
            # interaction is computed here, so that the loop carries few state variables.
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            # The emitter at the hit, or the environment where the ray escapes
            emitter = si.emitter(scene, active)

            # ------------------------ Emission ------------------------

            # Weight of the emission hit by the sampled ray. Emitter sampling may have drawn the
            # same point at the vertex before, so both estimates share its radiance. Multiple
            # importance sampling needs the density with which emitters would have been drawn.
            mis = mi.Float(1)
            if dr.hint(self.emitter_sampling and emitters.draws, mode="scalar"):
                reachable = active & ~delta_before
                start, distance = ray.o, si.t
                if dr.hint(emitters.passes, mode="scalar"):
                    start, distance = ray.o - length * ray.d, si.t + length
                pdf = emitters.pdf(scene, start, distance, si, emitter, reachable)
                mis = dr.select(reachable, mis_weight(pdf_before, pdf), 1)
            # In a replay the emitted radiance carries derivatives with respect to the temperature
            # and the emissivity. β and mis are constants here.
            with dr.resume_grad(when=not primal):
                Le = β * mis * emitter.eval(si, active)
            # The ray after the last reflection receives the ambient radiance from any surface, in
            # place of what that surface emits
            if dr.hint(self.closure == "ambient", mode="scalar"):
                beyond = bounce > most
                Le = dr.select(beyond, dr.select(si.is_valid(), β * self.ambient_radiance, 0), Le)
            if dr.hint(channels is not None, mode="scalar"):
                channels.add(Le[0], bounce, emitters.sources, emitter, si.prim_index, most)

            bsdf = si.bsdf(ray)
            if dr.hint(columns is not None, mode="scalar"):
                vertices = columns.vertices(tables, bsdf, si.wi)
                own = dr.select(bounce > most, 0, β[0] * mis)
                columns.emit(tables, vertices, emitter, si.prim_index, Le[0], own)

            # The sun is no surface. It is seen where the ray escapes, and through the sky.
            if dr.hint(emitters.sun is not None, mode="scalar"):
                sees = active & (bounce <= most) & emitters.shows_sun(si, emitter)
                with dr.resume_grad(when=not primal):
                    of_sun, pdf = emitters.sun_along(ray.d, sees)
                    by_sun = dr.select(delta_before, 1, mis_weight(pdf_before, pdf))
                    of_sun *= β * by_sun
                    Le += of_sun
                if dr.hint(channels is not None, mode="scalar"):
                    channels.add(
                        of_sun[0],
                        bounce,
                        emitters.sources,
                        emitters.sun_pointer,
                        si.prim_index,
                        most,
                    )
                if dr.hint(columns is not None, mode="scalar"):
                    # The sun's radiance does not depend on a material
                    columns.emit(tables, [], emitters.sun_pointer, si.prim_index, of_sun[0], 0)

            # A replay subtracts what the primal pass added, so that after the subtractions L is the
            # radiance from later vertices
            L = L + Le if primal else L - Le

            # A path ends where its ray escapes and after the last allowed reflection
            active_next = active & si.is_valid() & (bounce < limit)
            # A surface that rays pass does not end it either. The ambient radiance comes from any
            # surface that the ray of the closure hits.
            passes = mi.Bool(False)
            if dr.hint(emitters.passes, mode="scalar"):
                passes = active & si.is_valid() & is_passed(bsdf.flags()) & (bounce <= most)
                L = dr.select(passes & (passed >= MOST_PASSED), dr.nan, L)
                passes &= passed < MOST_PASSED
                active_next = dr.select(is_passed(bsdf.flags()), passes, active_next)

            # -------------------- Emitter sampling --------------------

            Lr = mi.Spectrum(0)
            if dr.hint(emitters.draws, mode="scalar"):
                # A delta lobe does not reflect light from a drawn direction. The ray of the closure
                # `ambient` must not be accompanied by emitter sampling: it would count emission
                # that the ambient radiance replaces.
                active_em = (
                    active_next & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (bounce < most)
                )
                # Two 2D samples, for the emitter and for the point on it: the 23 bits of a Float32
                # number are too few for both
                drawn = emitters.draw(si, sampler.next_2d(), sampler.next_2d(), active_em)

            # Named samples, because the derivative of a delta lobe repeats `sample` with them
            sample1, sample2 = sampler.next_1d(), sampler.next_2d()
            if dr.hint(emitters.draws, mode="scalar"):
                with dr.resume_grad(when=not primal):
                    # One call is faster than one for the drawn and one for the next direction
                    f, pdf, bs, weight = bsdf.eval_pdf_sample(
                        ctx, si, si.to_local(drawn.ds.d), sample1, sample2, active_next
                    )
                    # Of these only `f` has derivatives
                    bs, weight = dr.detach((bs, weight))
                    # No ray where nothing is emitted or reflected. A replay traces it even so,
                    # because a value of 0 may have a derivative.
                    if dr.hint(primal, mode="scalar"):
                        active_em &= drawn.may_radiate & (dr.max(f) != 0)
                    direct = emitters.trace(scene, si, drawn, active_em, columns is not None)
                    # A point source or a parallel beam cannot be hit by a reflected ray, so its
                    # whole radiance belongs to emitter sampling
                    mis = dr.select(drawn.ds.delta, 1, mis_weight(drawn.ds.pdf, pdf))
                    Lr = dr.select(
                        direct.counts, β * f * direct.radiance(si) * (mis / drawn.ds.pdf), 0
                    )
                # This radiance is reflected once more than the emission at the current vertex
                L = L + Lr if primal else L - Lr
                if dr.hint(channels is not None, mode="scalar"):
                    channels.add(
                        Lr[0],
                        bounce + 1,
                        emitters.sources,
                        direct.emitter,
                        direct.hit.prim_index,
                        most,
                    )
                if dr.hint(columns is not None, mode="scalar"):
                    hit, by_drawn = direct.hit, β[0] * f[0] * (mis / drawn.ds.pdf)
                    if dr.hint(emitters.passes, mode="scalar"):
                        by_drawn *= direct.transmittance
                    brought = columns.emit(
                        tables,
                        columns.vertices(tables, hit.bsdf(), hit.wi),
                        direct.emitter,
                        hit.prim_index,
                        Lr[0],
                        dr.select(direct.counts, by_drawn, 0),
                    )
                    columns.draw(vertices, si.to_local(drawn.ds.d), brought)

            # ----------------------- Reflection -----------------------

            if dr.hint(not emitters.draws, mode="scalar"):
                bs, weight = bsdf.sample(ctx, si, sample1, sample2, active_next)
            delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            if dr.hint(columns is not None, mode="scalar"):
                # Also for directions of weight 0, for the mean of the control variate to be 0
                columns.reflect(tables, vertices, bsdf, bounce, β[0], weight[0], bs.wo, active_next)
            # A path without throughput contributes nothing further
            active_next &= dr.max(weight) != 0

            if dr.hint(not primal, mode="scalar"):
                with dr.resume_grad():
                    # L is now the radiance from later vertices, times the throughput. It depends on
                    # the parameters at this vertex through the BSDF value `f` alone, since the
                    # sampled direction and its density are constants. Its relative derivative is
                    # therefore that of `f`.
                    f = value_along(bsdf, ctx, si, sample1, sample2, bs, active_next)
                    Lo = Le + Lr + L * dr.relative_grad(f)
                    if dr.hint(mode == dr.ADMode.Backward, mode="scalar"):
                        # Accumulate the gradient of the objective in the scene's parameters
                        dr.backward_from(δL * Lo)
                    else:
                        # Add this vertex's part of the radiance's derivative
                        δL += dr.forward_to(Lo)

            # The weight is BSDF times cosine divided by the density of the direction
            β *= weight
            # The next vertex needs both for its multiple importance sampling weight
            to = si.to_world(bs.wo)
            if dr.hint(emitters.passes, mode="scalar"):
                # A ray that passes keeps its direction and the density of its last reflection
                to = dr.select(passes, ray.d, to)
                pdf_before = dr.select(passes, pdf_before, bs.pdf)
                delta_before = dr.select(passes, delta_before, delta)
                passed = dr.select(passes, passed + 1, 0)
                length = dr.select(passes, length + si.t, 0)
            else:
                pdf_before, delta_before = bs.pdf, delta
            # The sample variance cannot see a source that no path has hit. Record the largest
            # contribution that one such hit would make, for the error estimate. The ray of the
            # closure `ambient` is left out, since it receives no emission.
            if dr.hint(emitters.draws, mode="scalar"):
                gain = β[0] * emitters.by_chance(drawn, bs.pdf, delta)
                reaches = active_next & (bounce < most)
                if dr.hint(emitters.passes, mode="scalar"):
                    # What is behind the surface was drawn at the last reflection
                    reaches &= ~passes
                chance = dr.maximum(chance, dr.select(reaches, gain, 0))
            # The offset from the surface is smaller than Mitsuba's in a small scene, see
            # `EmitterTable.leave`
            ray = emitters.spawn_ray(si, to)
            pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active_next)
            if dr.hint(emitters.passes, mode="scalar"):
                bounce += dr.select(passes, mi.UInt32(0), 1)
                if dr.hint(channels is not None and channels.segments is not None, mode="scalar"):
                    channels.segments += dr.select(passes, mi.Float(1), 0)
            else:
                bounce += 1
            active = active_next

        if dr.hint(channels is not None and channels.segments is not None, mode="scalar"):
            # Each turn of the loop follows one ray; rays of emitter sampling are not counted
            channels.segments += mi.Float(bounce)
        return (L if primal else δL, L), valid, channels, chance, columns


mi.register_integrator("bounce_path", BouncePath)
