"""Path tracer of one scene: traces launches of paths and sums what recorders note."""

import gc
import os
import warnings
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import partial
from math import hypot

import drjit as dr
import mitsuba as mi
from mitsuba.python.ad.integrators.common import RBIntegrator

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.spectra.bins import Binning
from mi_lcair.plugins import derivatives
from mi_lcair.plugins.bins.by_bin import ByBin
from mi_lcair.plugins.bins.sums import MOST_SUMS, BinSums, ByBinOfPath, SourceSums, SpectralSums
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import ReflectionBSDF, has_spectral_materials
from mi_lcair.plugins.columns.control import control_of
from mi_lcair.plugins.columns.tables import differentiated
from mi_lcair.plugins.derivatives import is_aligned, nodes
from mi_lcair.plugins.emission.draw_table import PREFERENCE, PREFERRED, UnmetSources
from mi_lcair.plugins.emission.emissivity import Emissivities
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.emission.hot_parts import darker
from mi_lcair.plugins.emission.panels import Openings
from mi_lcair.plugins.paths.kept_hits import KeptHits
from mi_lcair.plugins.paths.launch import (
    Aim,
    FacetStarts,
    Launch,
    ParallelRays,
    Paths,
    rounding_error,
)
from mi_lcair.plugins.paths.scene_state import EMISSION, GEOMETRY, Form, SceneState
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.paths.sums import BlockSums, Sums, Tail, block_size
from mi_lcair.plugins.paths.walk import PACKET, Replay, Walk
from mi_lcair.plugins.recorders.channels import Channels, LastCounts, cell_of
from mi_lcair.plugins.recorders.radiance import SIZES, ByBounce, FirstHit, UnmetSource
from mi_lcair.plugins.recorders.recorder import Recorders

# The recording of launches, whose Python code then runs once
# -----------------------------------------------------------
# Dr.Jit's `freeze` records which kernels a function launches, and launches them again for other
# arrays. An array that it was not given is an error, but a Python number goes into the recording
# unseen. Recordings therefore belong to a `Form`, in which all numbers are. What differs between
# launches is an array, or a number or a text among the arguments. The tables of a changed scene are
# other arrays: its tracer takes the recordings over if the form is the same.

OFF = "MI_LCAIR_NO_RECORDING"  # environment variable; not empty: nothing is recorded
MOST_RECORDINGS = 16  # of one tracer; the one used least recently is dropped


class Recordings:
    """Recordings of `PathTracer.block_sums` for tracers of one form.

    reason: why launches are traced and not recorded; None if they are recorded.
    """

    def __init__(self, state: SceneState, tables: tuple, changed: dict[str, set], before=None):
        """state: that of the tracer's scene. tables: all else that a recording has, in memory of
        Dr.Jit's. changed: see `SceneState.follow`. before: recordings of the scene in the state
        before, which may serve this tracer, too; None without any.
        """
        self.plugins, self.reason = state.plugins, None
        if os.environ.get(OFF):
            self.reason = f"{OFF} is set"
        elif not state.is_recordable:
            self.reason = "the scene has objects that are not known to be recordable"
        elif state.has_gradients:
            self.reason = "parameters have gradients"
        self.frozen = dr.freeze(run, limit=MOST_RECORDINGS, warn_after=2**31 - 1)
        self.forms = None
        if self.reason is None:
            self.forms = state.forms, Form(tables)
            if changed[GEOMETRY]:  # the acceleration structure is another one
                before = None
            self.follow(state, set().union(*changed.values()), before)

    def follow(self, state: SceneState, changed: set, before: "Recordings | None") -> None:
        """Take earlier recordings over, if they serve for the present arrays.

        Dr.Jit 1.5 does not see whether an array is aligned as that of the recording was. If it is
        not, the kernels read it wrongly. changed: the objects whose arrays are others.
        """
        follows = before is not None and before.forms == self.forms
        some = changed if follows else state.values.keys() - {None}
        now = {node for node in some if not all(map(is_aligned, state.arrays(node)))}
        unaligned = before.unaligned - changed if follows else set()
        if follows and changed.isdisjoint(before.unaligned | now):
            self.frozen = before.frozen
        self.unaligned = unaligned | now

    @property
    def count(self) -> int:
        """Number of recordings made so far."""
        return self.frozen.n_recordings

    def __call__(self, tracer, *arguments):
        """Result of `tracer.block_sums(*arguments)`, from a recording if there is one.

        arguments: PyTrees of Dr.Jit arrays, and numbers and texts. There is a recording for each
        set of numbers and texts. The widths of arrays may differ from call to call.
        """
        if self.reason:
            return tracer.block_sums(*arguments)
        try:
            return self.run_frozen(tracer, arguments)
        except RuntimeError:
            # The plugin that cannot be recorded may belong to a scene that is already deleted
            gc.collect()
        try:
            return self.run_frozen(tracer, arguments)
        except RuntimeError as error:
            self.reason = (
                "the recording failed, perhaps because of a plugin of another scene that is not "
                f"yet deleted: {error.__cause__ or error}"
            )
        warnings.warn(
            f"kernel launches are not recorded, so that small renders are slower: {self.reason}",
            stacklevel=2,
        )
        return tracer.block_sums(*arguments)

    def run_frozen(self, tracer, arguments):
        """Result of `tracer.block_sums(*arguments)` from a recording, which is made if needed.

        Raises RuntimeError if it cannot be made. All recordings are dropped in that case.
        """
        attributes = tuple(vars(plugin) for plugin in self.plugins)
        paths = tracer.paths
        derived = tracer.emitters, tracer.ambient_radiance, paths.explored, paths.openings
        arrays = derivatives.flatten((attributes, derived))
        call = Unseen((tracer, self.plugins, attributes))
        try:
            hidden = [{} for _ in self.plugins]
            with without_collection(), attributes_replaced(self.plugins, hidden):
                return self.frozen(call, tracer.scene, registries(), arrays, *arguments)
        except RuntimeError:
            self.frozen.clear()
            raise
        finally:
            call.content = None  # the recording keeps `call`, and must not keep the scene


def registries() -> list:
    """A pointer to each of the kinds of objects whose methods a path calls.

    Dr.Jit records a call of a method for every object of the kind that is alive, also in other
    scenes. `freeze` looks for the arrays of all these objects if its arguments contain a pointer of
    the kind. A scene contains pointers to shapes and emitters, but none to BSDFs. Without one, it
    would not find the arrays of a BSDF that belongs to no shape.
    """
    return [dr.zeros(kind) for kind in (mi.ShapePtr, mi.EmitterPtr, mi.BSDFPtr)]


class Unseen:
    """Holds an object so that `freeze` neither looks into it nor compares it."""

    def __init__(self, content):
        self.content = content

    def __eq__(self, other):
        return isinstance(other, Unseen)

    def __hash__(self):
        return 0


def run(call, scene, pointers, arrays, *arguments):
    """The function that is recorded. `freeze` compares all arguments but `call`."""
    tracer, plugins, attributes = call.content
    tables = tracer.recorded.forms[1].unrecorded
    recorded = tuple(
        {name: value for name, value in vars(table).items() if name not in table.UNRECORDED}
        for table in tables
    )
    with attributes_replaced((*plugins, *tables), (*attributes, *recorded)):
        return tracer.block_sums(*arguments)


@contextmanager
def without_collection():
    """Context manager in which Python's garbage collector does not run.

    Dr.Jit ends the process if the collector finds an array in memory of NumPy's while it records.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextmanager
def attributes_replaced(plugins, attributes):
    """Context manager in which the plugins have other dictionaries of attributes.

    `freeze` looks for arrays in all attributes of plugins in Python. That takes up to 7 ms for each
    call. It finds none in an empty dictionary, and gets the arrays in a list.
    """
    originals = [vars(plugin) for plugin in plugins]
    for plugin, replacement in zip(plugins, attributes):
        plugin.__dict__ = replacement
    try:
        yield
    finally:
        for plugin, original in zip(plugins, originals):
            plugin.__dict__ = original


# What a scene with spectral materials cannot do, and what works in its place
WITHOUT_DERIVATIVES = (
    "derivatives along paths do not work with materials that depend on wavelength; use "
    "`mi_lcair.sensitivities`, or give these materials `average_K`"
)


class PathTracer(RBIntegrator):
    """Integrator for one scene, with all data that a render derives from the scene.

    `BouncePath.prepared` makes it. Its attributes cannot be set afterwards.

    scene: the scene. plugins: its plugins that derive something from parameters. emitters: its
    `EmitterTable`, with the band, the labels and the sources. max_bounces, emitter_sampling,
    closure: the settings at the time when it was made. paths: the `Walk` that follows paths.
    ambient_radiance: radiance beyond the last reflection for closure = ambient [W m^-2 sr^-1]; None
    for another closure. systematic_error: relative error of a radiance that more samples do not
    reduce. It comes from Float32 rounding, from tabulated emissivities, from the bins of wavelength
    and from `truncation`. bins: the bins of wavelength in words; empty in a scene
    without spectral materials.

    This is a separate integrator because the render methods of RBIntegrator call `sample` with the
    scene alone. The data derived from the scene must therefore belong to the integrator.
    """

    def __init__(
        self,
        settings,
        scene,
        by_spectrum: bool,
        state: SceneState,
        explored,
        binning: Binning,
        before: "PathTracer | None" = None,
    ):
        """settings: the integrator `bounce_path`, with its properties. explored: see `Walk`.
        binning: decides on the bins of wavelength. before: that of an earlier state of the scene.
        """
        super().__init__(mi.Properties())
        has_bins, binning_error = has_spectral_materials(scene), 0.0
        in_detail = by_spectrum and not has_bins
        samples = settings.emitter_sampling in (True, PREFERRED)
        preference = PREFERENCE if settings.emitter_sampling == PREFERRED else 1.0
        like = None  # the tracer before, if tables that depend on the geometry alone are the same
        changed = state.follow(before and before.state)
        if before is not None and state.is_known and not (has_bins or changed[GEOMETRY]):
            like = before if state.forms == before.state.forms else None
        if like is None:
            emitters = EmitterTable(scene, samples, in_detail, preference)
        else:
            emitters = like.emitters
            if changed[EMISSION]:
                emitters = emitters.with_radiances(changed[EMISSION])
        ambient = None
        if settings.closure == "ambient":
            ambient = mi.Float(in_band_radiance(emitters.band, settings.ambient_temperature))
        most = settings.max_bounces
        paths = Walk(scene, emitters, most, samples, ambient, explored)
        if settings.opening_sampling is True and not emitters.passes and emitters.sun is None:
            paths.openings = Openings.of(scene) if like is None else like.paths.openings
        owned = derivatives.flatten(like and (like.emitters, like.paths.openings))
        owned = set(map(id, owned))
        tables = derivatives.flatten((emitters, paths.openings))
        derivatives.own_memory([array for array in tables if id(array) not in owned])
        if has_bins:
            T = None if ambient is None else settings.ambient_temperature
            count = binning.recorded or settings.bins
            of_scene = replace(binning, reflections=max(most, 1))
            by_source = by_spectrum and not binning.recorded
            paths.by_bin = ByBin(scene, emitters.band, T, count, of_scene, by_source)
            binning_error = paths.by_bin.binning_error
            if by_source:
                emitters.sources.split(paths.by_bin.sources_by_bin())
        parts = derivatives.derivations(derivatives.deriving(state.plugins))
        tabulated = [part for part in parts if isinstance(part, Emissivities | ReflectionBSDF)]
        of_tables = max((part.relative_error for part in tabulated), default=0.0)
        vars(self).update(
            scene=scene,
            state=None if state.has_gradients else state,  # it would keep their graph
            plugins=derivatives.deriving(state.plugins),
            emitters=emitters,
            max_bounces=most,
            emitter_sampling=samples,
            closure=settings.closure,
            ambient_radiance=ambient,
            paths=paths,
            systematic_error=hypot(
                rounding_error(most), of_tables, binning_error, settings.truncation
            ),
            bins=str(paths.by_bin or ""),
            records_bins=has_bins and bool(binning.recorded),
            recorded=Recordings(state, (vars(paths), ambient), changed, before and before.recorded),
            is_complete=True,
        )

    def __setattr__(self, name, value):
        if vars(self).get("is_complete"):
            raise AttributeError(f"a PathTracer does not change: {name} cannot be set")
        super().__setattr__(name, value)

    def check_differentiable(self) -> None:
        """Raise InputError for a parameter whose derivative a replay would not give."""
        if self.paths.by_bin is not None:
            raise InputError(WITHOUT_DERIVATIVES)
        for bsdf in {shape.bsdf() for shape in self.scene.shapes()}:
            if is_plume(bsdf) and derivatives.attached([bsdf.transmittance]):
                bsdf.check_derivative("plume: transmittance", self.emitters.draws)

    # ---------------------------------------------------------------- Around the walk

    def sample(self, mode, scene, sampler, ray, depth, δL, state_in, active, **kwargs):
        recorders = Recorders([])
        if self.closure == "tail":
            first_hit = FirstHit.of(scene, self.emitters)
            recorders = Recorders([first_hit, LastCounts.of(self.max_bounces)])
        replay = None if mode == dr.ADMode.Primal else Replay(mode, δL, state_in)
        paths = copy(self.paths)  # of this pass: what it draws less is not for others
        kept, pi = paths.kept, None
        if kept is not None and replay is None:
            kept.begin(dr.width(ray))
        elif kept is not None:
            pi = kept.first
        if pi is None:
            pi = nearest_hit(scene, self.emitters.sheets, ray, coherent=True, active=active)
        if self.emitters.surround:
            paths.packets = dr.arange(mi.UInt32, dr.width(ray)) // PACKET
        has_more = paths.ambient_radiance is not None or paths.explored is not None
        paths.draws_last = self.emitters.suffice and not has_more
        # Dr.Jit would trace the loop twice, to leave one constant of a sampler out of its state
        with dr.scoped_set_flag(dr.JitFlag.OptimizeLoops, False):
            (L, state), valid, recorders = paths.walk(
                sampler, (ray, pi), active, recorders, replay=replay
            )
        if kept is not None and replay is None:
            kept.end(state, pi)
        if self.closure == "tail":
            L += recorders.of(LastCounts).tail(recorders.of(FirstHit).of_model)[0]
        return L, valid, [], state

    def render_forward(self, scene, params, sensor=0, seed=0, spp=0):
        with self.controlled(sensor, seed):
            return super().render_forward(scene, params, sensor, seed, spp)

    def render_backward(self, scene, params, grad_in, sensor=0, seed=0, spp=0):
        with self.controlled(sensor, seed):
            super().render_backward(scene, params, grad_in, sensor, seed, spp)

    @contextmanager
    def controlled(self, sensor, seed):
        """Context manager in which replays have a control variate, and follow each first try.

        They read the hits of the pass before, which they need where surfaces have gradients.
        """
        sensor = self.scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        openings, self.paths.openings = self.paths.openings, None
        # Made here: an evaluation between the draws of a sampler writes its numbers to memory
        self.paths.max_bounces = dr.opaque(mi.UInt32, self.max_bounces)
        try:
            surfaces = differentiated(nodes(self.scene))
            self.paths.control = control_of(self, surfaces, sensor, int(mi.UInt32(seed)[0]))
            if surfaces and not self.emitters.passes:
                self.paths.kept = KeptHits(1 + len(self.emitters.tables), self.max_bounces)
            yield
        finally:
            self.paths.control, self.paths.kept, self.paths.openings = None, None, openings
            self.paths.max_bounces = self.max_bounces

    def trace(
        self,
        sensor,
        launch: Launch,
        channels: Channels | None = None,
        facets=None,
        rays: ParallelRays | None = None,
    ) -> Sums:
        """Trace the paths of a launch; call it inside the context `prepared`.

        Parameters
        ----------
        sensor : mi.Sensor
        launch : Launch
            Where the paths begin and which random numbers they use.
        channels : Channels or None
            What is recorded beside the radiance; None: the channels of an image.
        facets : object or None
            Numbering of facets with the methods `number(shape, prim_index, active)` and
            `add(facet, L, weight, by_bounce, launch)`. The second one receives the samples, each
            with the facet that its path hits first.
        rays : ParallelRays or None
            The rays of the sensor, for a caller of many launches; None makes them from the sensor.

        Returns
        -------
        Sums
            Sums over the points of each randomisation.
        """
        if self.paths.by_bin is not None and channels is not None and channels.tables is not None:
            raise InputError(WITHOUT_DERIVATIVES)
        if launch.aim is not None and launch.aim.direct is not None:
            of_rest, of_direct = launch.split()
            rest, direct = (
                self.trace(sensor, part, channels, facets, rays) for part in (of_rest, of_direct)
            )
            return rest.plus(direct, of_rest.points / of_direct.points)
        with dr.suspend_grad():
            paths = launch.paths_from(sensor.sampler())
            paths.hot = paths.hot if self.paths.may_be_guided else None
            rays = ParallelRays.of(sensor) if rays is None else rays
            channels = channels or Channels()
            # `freeze` does not compare a number that comes after the tables of the channels
            arguments, bins = (paths, rays or sensor, block_size(launch), channels), None
            if sums_by_bin := self.sums_by_bin(channels):
                bins = sums_by_bin(self.paths.by_bin, launch)
            if facets is not None or self.closure == "tail":
                blocks, tail = self.whole_sums(
                    paths, rays or sensor, channels, facets, launch, bins
                )
            elif rays is None or self.paths.by_bin is not None:
                # A recording would not see that a sensor of another kind has changed, and it does
                # not have the tables of the bins
                blocks, tail = self.block_sums(*arguments, bins), None
            else:
                blocks, tail = self.recorded(self, *arguments), None
            sums = Sums.of(blocks, tail, launch)
            if bins is not None:
                sums.channels.update(bins.channels(channels.split))
            return sums.without(f"bounce.{k}" for k in range(self.max_bounces + 1, SIZES[-1]))

    def sums_by_bin(self, channels: Channels) -> type[BinSums] | None:
        """What a launch sums by bin of wavelength."""
        if self.emitters.sources.by_bin and channels.split in ("target", "model"):
            return SourceSums
        return SpectralSums if self.records_bins else None

    def most_rows(self, channels: Channels) -> int:
        """Windows times randomisations of a launch whose sums by bin fit into the memory."""
        sums_by_bin = self.sums_by_bin(channels)
        return MOST_SUMS // (sums_by_bin.of_row(self.paths.by_bin) if sums_by_bin else 1)

    def block_sums(
        self, paths: Paths, rays, size: int, channels: Channels, bins: BinSums | None = None
    ) -> BlockSums:
        """Sums over blocks of `size` paths of a launch.

        It may be recorded. It therefore uses only the tracer and its arguments, and launches
        kernels but reads no values. rays: ParallelRays or a sensor.
        """
        of_cells = partial(channels.recorders, self, None, guides=paths.hot is not None)
        L, recorders, weight, _ = self.follow(paths, rays, of_cells, bins)
        return block_sums(L, channels, recorders, weight, size)

    def whole_sums(
        self, paths: Paths, rays, channels: Channels, facets, launch: Launch, bins: BinSums | None
    ) -> tuple[BlockSums, Tail | None]:
        """As `block_sums`, also for facets and for closure = tail, which read values."""
        of_cells = partial(channels.recorders, self, facets, guides=paths.hot is not None)
        L, recorders, weight, _ = self.follow(paths, rays, of_cells, bins)
        first_hit, by_bounce = recorders.of(FirstHit), recorders.of(ByBounce)
        tail = None
        if self.closure == "tail":
            # The sums of a tail need evaluated arrays. Evaluating everything here traces the paths
            # once; otherwise each sum would trace them again.
            dr.eval(L, recorders)
            added, tail = recorders.of(LastCounts).tail(first_hit.of_model)
            L += added
            if by_bounce is not None:
                by_bounce.closure = added
        if facets is not None:
            # One kernel for all later uses of these arrays
            dr.eval(L, recorders, channels.by_name(L, recorders))
            facets.add(first_hit.facet, L, weight, by_bounce, launch)
        return block_sums(L, channels, recorders, weight, block_size(launch)), tail

    def follow(self, paths: Paths, rays, recorders_of, bins: BinSums | None = None) -> tuple:
        """Radiance [W m^-2 sr^-1], recorders, weight and `FacetPoint`, or None, of each path.

        recorders_of: gives the `Recorders` for the cell of the film in which each path begins.
        bins: sums by bin, or None.
        """
        sampler, column, row, position, weight, facet = paths.begin()
        if facet is not None:
            position = rays.position(facet.p, column)
            weight = dr.select(dr.all((position >= 0) & (position < 1)), weight, 0)
        ray = self.first_ray(paths, rays, sampler, column, row, position)
        active = mi.Bool(True)
        if facet is None:
            # Without an aim, the paths of a pixel follow each other
            hit = nearest_hit(self.scene, self.emitters.sheets, ray, coherent=paths.aim is None)
        else:
            hit, active = facet.first_hit(self.scene, self.emitters.sheets, ray)
            weight = dr.select(active, weight, 0)
        recorders = recorders_of(cell_of(paths, column, row, position))
        if bins is not None:
            recorders.parts.append(ByBinOfPath.of(self.scene, self.emitters, bins, paths, weight))
        (L, _), _, recorders = self.paths.walk(
            sampler, (ray, hit), active, recorders, paths.part, hot=paths.hot
        )
        if bins is not None:
            recorders.of(ByBinOfPath).end()
        return L[0], recorders, weight, facet

    def first_ray(self, paths: Paths, rays, sampler, column, row, position) -> mi.Ray3f:
        """First ray of each path; `rays` as for `block_sums`, the others as `Paths.begin` gives."""
        if isinstance(rays, ParallelRays):
            return rays.at(column, row, position, paths.columns, paths.rows)
        size = mi.Vector2f(paths.columns, paths.rows)
        aperture = sampler.next_2d() if rays.needs_aperture_sample() else mi.Point2f(0.5)
        film_position = (mi.Point2f(column, row) + position) / size
        return rays.sample_ray(rays.shutter_open(), 0, film_position, aperture)[0]

    def unmet_sources(self, sensor, aim: Aim | FacetStarts | None = None) -> UnmetSources:
        """Bound of the radiance of sources that no path has hit.

        Those in the sensor's field of view, hidden or not, are met by chance. Without emitter
        sampling, all are after a reflection. With it, those are that are hardly ever drawn. The
        part of the others is estimated along the paths (`UnmetSource`). aim: where the paths begin.
        Those that begin on facets of the model meet these by choice.
        """
        in_view = self.emitters.brightest_in_view(sensor, aim is None or aim.direct is None)
        if self.emitter_sampling and self.emitters.draws:
            return self.emitters.tables[0].unmet(in_view, self.emitters.brightest)
        undrawn = self.emitters.brightest if self.max_bounces else 0.0
        hot = aim.hot if aim is not None and self.paths.may_be_guided else None
        return UnmetSources(in_view, undrawn, darker=None if hot is None else darker(self.emitters))


def block_sums(L, channels: Channels, recorders: Recorders, weight, size: int) -> BlockSums:
    """Sums over blocks of `size` paths of their radiance and channels."""
    columns = channels.columns(L, recorders)
    # A sample that is not finite in one column does not count at all
    for value in columns.values():
        L = dr.select(dr.isfinite(value), L, dr.nan)
    by_name = columns | channels.by_name(L, recorders)
    return BlockSums.of(L, by_name, weight, recorders.of(UnmetSource), size)
