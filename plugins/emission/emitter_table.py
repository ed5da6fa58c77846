"""The emitters of a scene: their labels, and sampling of directions toward them."""

from collections.abc import Set
from copy import copy
from dataclasses import dataclass, field, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.plume import is_passed, spectral_plumes
from mi_lcair.plugins.derivatives import children
from mi_lcair.plugins.emission import triangles
from mi_lcair.plugins.emission.draw_table import DrawTable, FieldOfView, can_be_hit, radiance_bound
from mi_lcair.plugins.emission.sources import Groups, Sources, at_pointer
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, groups_of, is_thermal, one_sun
from mi_lcair.plugins.paths.launch import Offsets, by_camera
from mi_lcair.plugins.paths.sheets import Sheets

# Directions drawn toward emitters, what rays along them hit, and radiance by bin
# -------------------------------------------------------------------------------


@dataclass
class DrawnDirection:
    """A direction drawn toward an emitter; whether the emitter can be seen along it is not known.

    ds: the direction, with the density `ds.pdf` [1/sr] for the point where the ray starts.
    compared: the density that multiple importance sampling compares with that of the reflection; a
    function of the direction, which `ds.pdf` nearly equals [1/sr]. index: number of the drawn
    panel, or, beyond those, of another emitter. other: the drawn emitter where it is not a panel of
    a mesh; None if the table has only panels. may_radiate: False where the drawn emitter is known
    to send nothing along the direction. bound: upper bound of the radiance of the drawn panel or
    emitter, hidden or not [W m^-2 sr^-1].
    """

    ds: mi.DirectionSample3f
    compared: mi.Float
    index: mi.UInt32
    other: mi.EmitterPtr | None
    may_radiate: mi.Bool
    bound: mi.Float


@dataclass
class EmitterSample:
    """The first hit along a drawn direction.

    drawn: the direction. hit: the first hit of the ray, where that is the drawn panel. emitter: the
    emitter that sends radiance along the ray. counts: whether the first hit is the drawn point, so
    that the sample counts. of_panel: whether it counts and the point is on a panel of a mesh.
    transmittance: that of the surfaces which the ray passes; None in a scene without such
    surfaces. passed: how often it passes each of the table's `spectral_plumes`. met: what the ray
    hits, the drawn point or not.
    """

    drawn: DrawnDirection
    hit: mi.SurfaceInteraction3f
    emitter: mi.EmitterPtr
    counts: mi.Bool
    of_panel: mi.Bool
    transmittance: mi.Float | None = None
    passed: list[mi.UInt32] = field(default_factory=list)
    met: mi.PreliminaryIntersection3f | None = None

    def radiance(self, si):
        """Radiance from the emitter toward `si`, with derivatives [W m^-2 sr^-1]."""
        drawn, of_panel = self.drawn, self.of_panel
        radiance = self.emitter.eval(self.hit, of_panel)
        if drawn.other is not None:
            radiance += drawn.other.eval_direction(si, drawn.ds, self.counts & ~of_panel)
        return radiance if self.transmittance is None else radiance * self.transmittance


@dataclass(frozen=True)
class BinnedRadiance:
    """Radiance of an emitter as the bins of a path see it, before the throughput of the walk.

    radiance: in-band radiance [W m^-2 sr^-1]. base: radiance of which each bin has the share of the
    source, times its factor. sources: number of the source of each part of the emitter, and its
    share of `base`. factors: of the bins.
    """

    radiance: mi.Float
    base: mi.Float
    sources: list[tuple[mi.UInt32, mi.Float]]
    factors: dr.Local

    def times(self, factor: mi.Float) -> "BinnedRadiance":
        """The radiance times a factor."""
        return replace(self, radiance=self.radiance * factor, base=self.base * factor)


# Largest number of surfaces in a row that a ray passes. A path that needs more is not a number, so
# that it is counted and reported as an invalid sample.
MOST_PASSED = 32
# Of surfaces that reflect more than a diffuse surface, or transmit
NOT_DIFFUSE = ~int(mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)
MOST_HIDDEN = 64  # pairs of a field of view and a shape of which a table keeps what is outside


class EmitterTable:
    """The emitters of a scene, their labels, and the sampling densities of them.

    At each reflection `draw` draws from each of the `tables`. If `sampling` is True, all emitters
    are in them, the sun in the last one, otherwise only those that a reflected ray cannot hit.

    groups, labels: the `Groups` of the scene, and their labels. band: the band of the thermal
    emitters. sources: the `Sources` by which emission is recorded. draws: whether there are
    emitters to draw. brightest: upper bound of the radiance of all emitters that a ray can hit
    [W m^-2 sr^-1]. brightest_of: the same by group. unbounded: descriptions of the emitters without
    a known bound. sun: the emitter `sun`; None if the scene has none. passes: whether the scene has
    surfaces that rays pass, see `is_passed`. sheets: those of the scene; None if it has none.
    """

    UNRECORDED = ("bounds", "brightest", "brightest_of", "unbounded", "_in_view", "_hidden")

    def __init__(self, scene, sampling: bool, by_spectrum: bool = False, preference: float = 1.0):
        emitters = self.emitters = list(scene.emitters())
        self.sampling, self.by_spectrum, self.preference = sampling, by_spectrum, preference
        self.groups = Groups(scene, emitters)
        self.labels = self.groups.labels
        self.sun = one_sun(emitters)
        self.sun_id = (
            None if self.sun is None else mi.UInt32(triangles.pointer_id(mi.EmitterPtr(self.sun)))
        )
        self.band = one_band(emitters)
        # The emitter whose parts depend on the direction; None if the scene has none
        self.divided = next((e for e in emitters if is_thermal(e) and e.is_divided), None)
        self.divided_id = None
        if self.divided is not None:
            self.divided_id = mi.UInt32(triangles.pointer_id(mi.EmitterPtr(self.divided)))
        self._hidden, self.bounds, self.sources, self.tables = {}, {}, None, []
        self.set_radiances()
        flags = {int(bsdf.flags()) for bsdf in {shape.bsdf() for shape in scene.shapes()}}
        self.passes = any(map(is_passed, flags))
        # Drawn rays count how often they pass each plume that depends on wavelength
        pointers = map(mi.BSDFPtr, spectral_plumes(scene))
        self.spectral_plumes = [mi.UInt32(triangles.pointer_id(pointer)) for pointer in pointers]
        # No emitter is drawn at a surface that rays pass
        self.transmits = any(
            of_bsdf & int(mi.BSDFFlags.Transmission) and not is_passed(of_bsdf) for of_bsdf in flags
        )
        self.is_diffuse = not any(of_bsdf & NOT_DIFFUSE for of_bsdf in flags)
        self.offsets, self.sheets = Offsets(scene), Sheets.of(scene)
        dr.make_opaque(self.sun_id, self.divided_id, self.spectral_plumes)

    def with_radiances(self, changed: set) -> "EmitterTable":
        """The table of the same scene with other radiances of what emits.

        changed: the emitters, shapes and textures whose arrays have changed. None of these is
        geometry.
        """
        table = copy(self)
        table.set_radiances(changed)
        return table

    def set_radiances(self, changed: Set = frozenset()) -> None:
        """Set all that depends on the radiances of the emitters."""
        emitters, sampling = self.emitters, self.sampling
        if self.sources is None or self.by_spectrum:
            self.sources = Sources(emitters, self.labels, self.band, self.by_spectrum)
        # To read those of all emitters takes longer than all else here
        known = {
            e: bound
            for e, bound in self.bounds.items()
            if changed.isdisjoint((e, e.get_shape(), *children(e)))
        }
        hit = filter(can_be_hit, emitters)
        bounds = self.bounds = {e: known[e] if e in known else radiance_bound(e) for e in hit}
        self.unbounded = [describe(emitter) for emitter, bound in bounds.items() if bound is None]
        largest = [float(bound.max()) for bound in bounds.values() if bound is not None]
        self.brightest = max(largest, default=0.0)
        self.brightest_of = brightest_of_groups(bounds)
        self.opaque_brightest = dr.opaque(mi.Float, self.brightest)
        self._in_view = {}  # results of `brightest_in_view`

        drawn = [e for e in emitters if sampling or not can_be_hit(e)]
        # The sun has a drawn direction of its own, where it would take its place among others
        of_sun = [e for e in drawn if sampling and e is self.sun]
        rest = [e for e in drawn if e not in of_sun]
        before = self.tables[0] if self.tables else None
        tables = [
            DrawTable(rest, bounds, self.brightest, self.preference, before),
            DrawTable(of_sun, bounds, self.brightest),
        ]
        self.tables = [table for table in tables if not table.is_empty]
        self.draws = bool(self.tables)

    @property
    def surround(self) -> bool:
        """Whether only panels that surround the scene emit."""
        return self.draws and all(table.surrounds for table in self.tables)

    @property
    def suffice(self) -> bool:
        """Whether directions drawn toward emitters find all that they send to diffuse surfaces."""
        return self.draws and self.is_diffuse and all(table.suffices for table in self.tables)

    def spawn_ray(self, si, d):
        return mi.Ray3f(self.offsets.leave(si, d), d)

    def brightest_in_view(self, sensor, with_model: bool = True) -> float:
        """Upper bound of the radiance of all emitters in the field of view [W m^-2 sr^-1].

        White diffuse surfaces in the sun count as well. All triangles are compared with a field of
        view once.
        """
        field = field_of(sensor)
        key = field.normals.tobytes(), field.offsets.tobytes(), with_model
        if key not in self._in_view:
            self._in_view[key] = self.brightest_in(field, with_model)
        return self._in_view[key]

    def brightest_in(self, field: FieldOfView, with_model: bool) -> float:
        """As `brightest_in_view`, for a field of view."""
        brightest = 0.0
        if self.sun is not None:
            brightest = float(dr.detach(self.sun.scale)[0]) / np.pi
        for emitter, bound in self.bounds.items():
            shape = emitter.get_shape()
            is_model = shape and facet_type_of(shape.emitter()) == "model"
            if bound is None or bound.max() <= brightest or (is_model and not with_model):
                continue
            hidden = self.hidden(field, shape) if shape else np.zeros(1, bool)
            bounds = np.broadcast_to(bound, hidden.shape) if len(bound) == 1 else bound
            brightest = max(brightest, float(bounds[~hidden].max(initial=0.0)))
        return brightest

    def hidden(self, field: FieldOfView, shape) -> np.ndarray:
        """Which parts of a shape are outside of a field of view, see `hulls`."""
        key = field.normals.tobytes(), field.offsets.tobytes(), shape
        if key not in self._hidden:
            if len(self._hidden) >= MOST_HIDDEN:
                self._hidden.clear()
            self._hidden[key] = field.excludes(hulls(shape))
        return self._hidden[key]

    def label(self, emitter, d):
        """Index into `labels` of an emitter that is met along `d`; that of `other` for none."""
        number = at_pointer(self.groups.number, emitter)
        if self.divided is None:
            return number
        ground = self.labels.index(self.divided.groups[-1])
        below = self.is_divided(emitter) & self.divided.is_ground(d)
        return dr.select(below, mi.UInt32(ground), number)

    def is_divided(self, emitter):
        """Whether emitter pointers are the emitter whose parts depend on the direction."""
        return emitter == dr.reinterpret_array(mi.EmitterPtr, self.divided_id)

    def parts(self, emitter, prim_index, d, active) -> list:
        """Numbers of the parts of an emitter that emit along `d`, and their shares of the radiance.

        A part is the index of the triangle, or that of the sky's or ground's part.
        """
        if self.divided is None:
            return [(prim_index, mi.Float(1))]
        here, parts = active & self.is_divided(emitter), []
        for k, (number, share) in enumerate(self.divided.parts_along(d, here)):
            share = dr.select(here, share, float(k == 0))
            parts.append((dr.select(here, number, prim_index), share))
        return parts

    def is_model(self, emitter):
        """Whether a shape with this emitter belongs to the model, not to the background.

        A null pointer, for a shape without an emitter, belongs to the model.
        """
        return at_pointer(self.groups.is_background, emitter) == 0

    @property
    def sun_pointer(self):
        return dr.reinterpret_array(mi.EmitterPtr, self.sun_id)

    def shows_sun(self, hit, emitter):
        """Whether a ray may reach the sun: it escapes, or its hit with this emitter is sky."""
        return ~hit.is_valid() | (at_pointer(self.groups.is_sky, emitter) != 0)

    def sun_along(self, d, active):
        """Radiance of the sun along a ray, and the density with which `draw` draws the ray.

        Parameters
        ----------
        d : mi.Vector3f
            Direction of the ray.
        active : mi.Bool
            Rays that may reach the sun, see `shows_sun`.

        Returns
        -------
        (radiance, density) : tuple of mi.Spectrum and mi.Float
            [W m^-2 sr^-1], 0 outside the disc; [1/sr].
        """
        return self.sun.along(d, active), self.tables[
            -1
        ].probability_of_other / self.sun.solid_angle

    @dr.syntax
    def draw(self, table: DrawTable, si, sample1, sample2, active):
        """Draw a direction toward an emitter.

        The direction is taken from the start of the ray, and the density is per solid angle at that
        start. A direction taken from si.p would miss an emitter as near as the offset of the start.

        Parameters
        ----------
        table : DrawTable
            One of the `tables`.
        si : mi.SurfaceInteraction3f
            The hit from which to draw.
        sample1, sample2 : mi.Point2f
            Uniform samples. The first one picks the panel or other emitter, the second one the
            point on it.
        active : mi.Bool

        Returns
        -------
        DrawnDirection
        """
        ds, number = dr.zeros(mi.DirectionSample3f), triangles.random_integer(sample1)
        index, compared, other, may_radiate = mi.UInt32(0), mi.Float(0), None, mi.Bool(True)
        if dr.hint(table.panel_choice is None, mode="scalar"):
            index = table.choice.pick(number, active)
        else:
            receiver = self.receiver(si)
            if active:  # skips much where no path of a packet draws
                index, seen, probability = table.pick(number, receiver, active)
                ds.d, ds.dist, ds.pdf = seen.draw(sample2)
                ds.p, ds.n = receiver.p + ds.dist * ds.d, mi.Normal3f(seen.n)
                ds.pdf *= probability
                compared = probability * seen.along(ds.d, ds.dist)
        from_panels = active & (index < table.panel_count)
        from_others = active & ~from_panels
        density, bound = dr.gather(mi.Vector2f, table.density_and_bound, index, active)
        if dr.hint(table.others is not None, mode="scalar"):
            number = index - table.panel_count
            other = dr.gather(mi.UInt32, table.others, number, from_others)
            other = dr.reinterpret_array(mi.EmitterPtr, other)
            # The start depends on the side of the surface. Reflection stays on the observer's side.
            # Where light may pass through a surface, a first sample from si.p gives the side.
            toward = si.to_world(si.wi)
            if dr.hint(self.transmits, mode="scalar"):
                toward = other.sample_direction(si, sample2, from_others)[0].d
            start = dr.zeros(mi.Interaction3f)
            start.p, start.time = self.offsets.leave(si, toward), si.time
            ds_other, value = other.sample_direction(start, sample2, from_others)
            may_radiate = from_panels | (dr.max(value) != 0)
            # Irradiance on a perpendicular surface, from a point light or a parallel beam
            of_beam = value[0] * ds_other.pdf
            bound = dr.select(from_others & ds_other.delta, of_beam, bound)
            ds_other.pdf *= density
            compared = dr.select(from_panels, compared, ds_other.pdf)
            ds = dr.select(from_panels, ds, ds_other)
        compared = compared * table.preference
        return DrawnDirection(ds, compared, index, other, may_radiate, bound)

    def trace(
        self, table: DrawTable, nearest, si, drawn: DrawnDirection, active, with_hit: bool = False
    ):
        """Trace a drawn direction to its first hit, through the surfaces that rays pass.

        A sample counts only if the first hit is the drawn point. Otherwise, where emitters overlap
        or hide each other, the radiance of one would be used with the density of another.

        Parameters
        ----------
        table : DrawTable
            That of the direction.
        nearest : callable
            Gives what a ray hits first, for the ray and whether it is traced.
        si : mi.SurfaceInteraction3f
            The hit from which the direction was drawn.
        drawn : DrawnDirection
        active : mi.Bool
        with_hit : bool
            Also compute the hit of surfaces that are not panels of meshes.

        Returns
        -------
        EmitterSample
        """
        ds = drawn.ds
        active = active & (ds.pdf > 0)
        of_panels = active & (drawn.index < table.panel_count)
        ray = self.spawn_ray(si, ds.d)
        pi = nearest(ray, active)
        transmittance, distance, passed = None, ds.dist, []
        if self.passes:
            with dr.suspend_grad():
                ray, pi, transmittance, passed = self.pass_through(
                    table, nearest, ray, pi, drawn, active
                )
                distance = dr.norm(ds.p - ray.o)
        met, emitter = active & pi.is_valid(), pi.shape.emitter()
        on_panel, on_other = self.meets(table, ray, pi, drawn, met, of_panels)
        hit = pi.compute_surface_interaction(ray, mi.RayFlags.All, on_panel)
        counts = mi.Bool(on_panel)  # a copy, because |= changes an array in place
        if table.others is not None:
            counts |= on_other
            if not table.all_surfaces:
                nothing_before = ~met | (pi.t > distance * (1 - 1e-4))
                on_surface = mi.has_flag(drawn.other.flags(), mi.EmitterFlags.Surface)
                if self.sun is not None:
                    of_sun = drawn.other == self.sun_pointer
                    nothing_before |= of_sun & self.shows_sun(pi, pi.shape.emitter())
                counts |= active & ~of_panels & ~on_surface & nothing_before
            emitter = dr.select(of_panels, emitter, drawn.other)
            if with_hit:
                hit = pi.compute_surface_interaction(ray, mi.RayFlags.All, met & counts)
        if self.passes:
            counts |= dr.isnan(transmittance)
        return EmitterSample(drawn, hit, emitter, counts, on_panel, transmittance, passed, pi)

    def meets(self, table: DrawTable, ray, pi, drawn: DrawnDirection, met, of_panels):
        """Whether hits are the drawn points: on a panel of a mesh, or on another shape.

        met: the hits to be compared. of_panels: whether a panel was drawn; both mi.Bool.
        """
        on_panel, on_other = mi.Bool(False), mi.Bool(False)
        if table.panel_choice is not None:
            panel, known = table.panel_choice.panels.find(pi.shape, pi.prim_index, met & of_panels)
            on_panel = known & (panel == drawn.index)
        if table.others is not None:
            # A line hits a sphere, cylinder, disk or rectangle at most twice, from different sides.
            # Shape and side therefore identify the point. A comparison of distances would need a
            # tolerance, and no tolerance is right near the shape and at grazing incidence.
            ds = drawn.ds
            on_other = met & ~of_panels & (pi.shape.emitter() == drawn.other)
            # The geometric normal of a mirrored rectangle is opposite to the normal of its samples
            of_hit = pi.compute_surface_interaction(ray, mi.RayFlags.ShadingFrame, on_other)
            on_other &= dr.dot(of_hit.sh_frame.n, ds.d) * dr.dot(ds.n, ds.d) > 0
        return on_panel, on_other

    @dr.syntax
    def pass_through(self, table: DrawTable, nearest, ray, pi, drawn: DrawnDirection, active):
        """Follow rays toward drawn points through the surfaces that rays pass.

        A ray ends at its drawn point, at a surface that it does not pass, or at none.

        Parameters
        ----------
        nearest : callable
            As for `trace`.
        ray : mi.Ray3f
        pi : mi.PreliminaryIntersection3f
            Its first hit.
        drawn : DrawnDirection
        active : mi.Bool

        Returns
        -------
        (ray, pi, transmittance, times) : tuple
            The last part of the ray, its hit, the transmittance of the surfaces before, and how
            often it passes each of the `spectral_plumes`. The transmittance is not a number for a
            ray that passes more than MOST_PASSED.
        """
        passed, transmittance = mi.UInt32(0), mi.Float(1)
        times = [mi.UInt32(0) for _ in self.spectral_plumes]
        active = self.continues(table, ray, pi, drawn, active)
        while dr.hint(active, label="pass_through"):
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            bsdf = si.bsdf(ray)
            times = self.counted(times, bsdf)
            weight = bsdf.eval_null_transmission(si, active)[0]
            transmittance *= dr.select(passed < MOST_PASSED, weight, dr.nan)
            passed += 1
            # Aimed at the drawn point again, because the start moves sideways by the offset
            start = self.offsets.leave(si, ray.d)
            ray = mi.Ray3f(start, dr.normalize(drawn.ds.p - start))
            pi = nearest(ray, active)
            active &= (transmittance > 0) & self.continues(table, ray, pi, drawn, active)
        return ray, pi, transmittance, times

    def counted(self, times: list, bsdf) -> list:
        """How often rays have passed each of the `spectral_plumes`, after they pass a BSDF."""
        pointer = dr.reinterpret_array(mi.UInt32, bsdf)
        return [
            number + dr.select(pointer == plume, mi.UInt32(1), 0)
            for number, plume in zip(times, self.spectral_plumes)
        ]

    def continues(self, table: DrawTable, ray, pi, drawn: DrawnDirection, active):
        """Whether rays pass the surface that they hit; not at or behind the drawn point."""
        met = active & pi.is_valid()
        of_panels = met & (drawn.index < table.panel_count)
        on_panel, on_other = self.meets(table, ray, pi, drawn, met, of_panels)
        met &= is_passed(pi.shape.bsdf().flags()) & ~on_panel & ~on_other
        if not table.all_surfaces:
            on_surface = mi.has_flag(drawn.other.flags(), mi.EmitterFlags.Surface)
            before = pi.t <= dr.norm(drawn.ds.p - ray.o) * (1 - 1e-4)
            met &= of_panels | on_surface | before
        return met

    def by_chance(self, drawn, pdf, delta):
        """Upper bound of the radiance that a path gains from one source that no path has hit.

        A source of radiance L adds at most L mis(pdf, drawn) if the reflected ray hits it, and at
        most L mis(drawn, pdf) pdf / drawn if it is drawn. With the power heuristic,
        r = pdf / drawn, and s = r divided by the table's preference, the sum is
        L (s^2 + r) / (1 + s^2). On a diffuse surface r is small, and the sum is about the radiance
        that the surface would reflect if the source were not hidden. In a narrow lobe r is large,
        and the sum is L. Emitter sampling does not help at a mirror,
        where the bound is the radiance of the brightest emitter.

        Parameters
        ----------
        drawn : DrawnDirection
            The drawn emitter; it represents all emitters. Its `bound` is its radiance, or its
            irradiance if it is a point light or a parallel beam.
        pdf : mi.Float
            Density of the reflected direction [1/sr].
        delta : mi.Bool
            Whether a delta lobe reflected the direction, which then has no density.

        Returns
        -------
        mi.Float
            Bound for a throughput of 1 after the reflection [W m^-2 sr^-1].
        """
        r = dr.minimum(pdf / drawn.ds.pdf, 1e6)
        s2 = dr.square(r / self.tables[0].preference)
        share = dr.select(drawn.ds.delta, r, (s2 + r) / (s2 + 1))
        return dr.select(delta, self.opaque_brightest, drawn.bound * share)

    def receiver(self, si) -> Receiver:
        """The point from which directions are drawn at the hit `si`."""
        observer = si.to_world(si.wi)
        normal = mi.Normal3f(dr.mulsign(mi.Vector3f(si.n), dr.dot(si.n, observer)))
        return Receiver(self.offsets.leave(si, observer), normal)

    @dr.syntax
    def pdf(self, scene, receiver: Receiver, distance, si, emitter, active):
        """Density that `draw` compares for the direction of the ray that hit `si` [1/sr].

        Parameters
        ----------
        scene : mi.Scene
        receiver : Receiver
            Where the ray was reflected.
        distance : mi.Float
            Distance from there to the hit [m].
        si : mi.SurfaceInteraction3f
            Its first hit.
        emitter : mi.EmitterPtr
            The emitter at the hit.
        active : mi.Bool

        Returns
        -------
        mi.Float
            Density per solid angle at the receiver times the table's preference; 0 if `draw` does
            not draw `emitter`.
        """
        table = self.tables[0]
        density, known, choice = mi.Float(0), mi.Bool(False), table.panel_choice
        if dr.hint(choice is not None, mode="scalar"):
            panel, known = choice.panels.find(si.shape, si.prim_index, active & si.is_valid())
            if known:
                seen, probability = choice.probability(panel, receiver, known)
                density = table.share * probability * seen.along(si.to_world(-si.wi), distance)
        if dr.hint(table.others is not None, mode="scalar"):
            before = dr.zeros(mi.Interaction3f)
            before.p = receiver.p
            ds = mi.DirectionSample3f(scene, si, before)
            other = emitter.pdf_direction(before, ds, active & ~known)
            density = dr.select(known, density, other * table.probability_of_other)
        return density * table.preference


field_of = by_camera(FieldOfView)


def brightest_of_groups(bounds: dict) -> dict[str, float]:
    """Largest radiance of each group from the bounds of its emitters [W m^-2 sr^-1]."""
    largest = {}
    for emitter, bound in bounds.items():
        for group in groups_of(emitter):
            radiance = np.inf if bound is None else float(bound.max())
            largest[group] = max(largest.get(group, 0.0), radiance)
    return largest


def one_band(emitters):
    """The band in which all thermal emitters of a scene emit; None if none names one."""
    bands = {e.band.name: e.band for e in emitters if is_thermal(e) and e.band is not None}
    if len(bands) > 1:
        raise InputError(
            f"the scene mixes bands: {', '.join(sorted(bands))}; "
            "all thermal emitters must name the same"
        )
    return next(iter(bands.values()), None)


def hulls(shape) -> np.ndarray:
    """Corners of a mesh's triangles, or of another shape's bounding box, (sets, points, 3) [m]."""
    if triangles.is_faceted(shape):
        return np.stack(triangles.triangle_corners(shape), axis=1).astype(np.float64)
    box = shape.bbox()
    return np.array([[np.ravel(box.corner(k)) for k in range(8)]], dtype=np.float64)


def describe(emitter) -> str:
    """Description of an emitter for messages: its kind and the shape that it belongs to."""
    kind = emitter.class_name() if type(emitter) is mi.Emitter else type(emitter).__name__
    shape = emitter.get_shape()
    return kind + (f" of shape '{shape.id()}'" if shape and shape.id() else "")
