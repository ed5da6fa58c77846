"""Photons that are followed from the emitters of a scene, for its energy audit."""

from dataclasses import dataclass, fields
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.facets.tracer import FacetTracer, Surface
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import corners

BATCHES = 8  # independent batches of photons; their scatter gives the standard errors
MAX_REFLECTIONS = 1000  # flux that still travels after so many is reported as unfinished
SHOWN = 8  # reflections whose flux is told apart
SURVIVAL = 0.05  # smallest probability of following a photon further


@dataclass
class Flux:
    """Fluxes, W, as arrays of shape (BATCHES, facets).

    Each entry is the sum over the photons of one batch. A photon carries its share of the flux of
    all batches, so that the sum over the batches is the flux.

    Attributes
    ----------
    emitted, incident, absorbed, reflected : ndarray
        Flux that leaves by emission, arrives, is absorbed and is reflected. What passes a surface
        of BSDF `plume` counts as reflected there.
    behind : ndarray
        Flux that reaches the back of a one-sided surface, which neither reflects nor emits.
    scaled : ndarray
        Part of `incident` that arrives at angles where the BRDF is scaled down to HDR = 1.
    """

    emitted: np.ndarray
    incident: np.ndarray
    absorbed: np.ndarray
    reflected: np.ndarray
    behind: np.ndarray
    scaled: np.ndarray

    @property
    def created(self) -> np.ndarray:
        """Flux beyond what arrives; negative where flux is lost."""
        return self.absorbed + self.reflected + self.behind - self.incident


def scaling_cosines(scene: Scene, table: FacetTable) -> np.ndarray:
    """Cosine of incidence below which the BRDF of each facet is scaled down, shape (facets,).

    It is 0 for a facet whose BRDF is never scaled.
    """
    angles = {}
    for surface in scene.surfaces():
        angle = surface.first_saturated_angle_deg()
        angles[surface.material] = 0.0 if angle is None else float(np.cos(np.radians(angle)))
    return np.array([angles.get(material, 0.0) for material in table.material])


@dataclass
class Tally:
    """What becomes of the photons, as fluxes, W.

    by_facet: fluxes by batch and facet. ends: flux by batch, (BATCHES,), that has "escaped", is
    "unfinished" or comes "from_afar": from the sun or the sky. by_reflection: flux by number of
    the reflection and batch that leaves after it, (SHOWN, BATCHES).
    """

    by_facet: Flux
    ends: dict[str, np.ndarray]
    by_reflection: np.ndarray

    @staticmethod
    def of(facets: int) -> "Tally":
        """A tally of a scene with this number of facets, without any flux."""
        ends = {name: np.zeros(BATCHES) for name in ("escaped", "unfinished", "from_afar")}
        by_facet = Flux(*np.zeros((len(fields(Flux)), BATCHES, facets)))
        return Tally(by_facet, ends, np.zeros((SHOWN, BATCHES)))

    def add(self, flux: str, batch, facet, values) -> None:
        """Add values, W, to a flux of some batches and facets."""
        array = getattr(self.by_facet, flux)
        cells = batch * array.shape[1] + facet
        array += np.bincount(cells, values, array.size).reshape(array.shape)

    def end(self, how: str, batch, values) -> None:
        """Add values, W, to the flux of some batches that has ended in this way."""
        self.ends[how] += np.bincount(batch, values, BATCHES)


class PhotonTracer(FacetTracer):
    """Traces photons through a scene.

    By Kirchhoff's law a surface absorbs its emissivity toward the origin of the flux. A surface
    without an emitter absorbs what its BSDF does not reflect. grazing: cosines below which the
    BRDFs of facets are scaled down, see `scaling_cosines`.

    Raises InputError for a shape without an emitter whose absorption is not known.
    """

    def __init__(self, scene: Scene, table: FacetTable):
        surfaces, of_shape = {}, []
        for index, shape in enumerate(scene.mi.shapes()):
            bsdf, emitter = shape.bsdf(), shape.emitter()
            given = None if emitter is None else emitter.given_emissivity
            value = None if given is None else float(given[0])
            key = pointer_id(mi.BSDFPtr(bsdf)), emitter is None, value
            if key not in surfaces:
                emissivity = emitter.emissivity if emitter else passive_emissivity(index, shape)
                surfaces[key] = Surface(bsdf, emissivity, mi.TransportMode.Importance)
            of_shape.append(list(surfaces).index(key))
        super().__init__(scene, table, list(surfaces.values()), of_shape)
        self.grazing = scaling_cosines(scene, table)


def follow(tracer: PhotonTracer, source, photons: int, seed: int, tally: Tally) -> None:
    """Follow photons from one emitter of a scene, and add their fluxes to the tally.

    photons: their number, a multiple of BATCHES. seed: seed of the random numbers.
    """
    sampler = mi.load_dict({"type": "independent"}, parallel=False)
    draw = np.random.SeedSequence([seed, 1])

    def reseed(width):
        """Give the sampler a new seed and a new number of photons."""
        sampler.seed(int(draw.spawn(1)[0].generate_state(1)[0]), width)

    reseed(photons)
    batch = np.arange(photons) % BATCHES
    ray, flux = emitted(tracer, source, photons, sampler, batch, tally)
    batch, active = mi.UInt32(batch), flux > 0
    throughput = mi.Float(1)
    for number in range(MAX_REFLECTIONS):
        # Drop the photons that have ended, so that the kernels shrink with each reflection.
        kept = dr.compress(active)
        if not len(kept):
            return
        ray, flux, throughput, batch = (
            dr.gather(type(value), value, kept) for value in (ray, flux, throughput, batch)
        )
        si, facet = tracer.meet(ray)
        hit, lane = si.is_valid(), batch.numpy()
        reseed(len(kept))
        # Split the arriving flux into what is absorbed, reflected, and lost behind a surface.
        u, v = sampler.next_1d(), sampler.next_2d()
        _, absorbed, to, reflected = tracer.respond(si, hit, u, v)
        absorbed, reflected = (dr.select(hit, share, 0) for share in (absorbed, reflected))
        behind = hit & (absorbed == 0) & (reflected == 0) & (si.wi.z < 0)

        # Record it by batch and facet. A photon that hits nothing has escaped.
        on, facet, arriving = hit.numpy(), facet.numpy(), flux.numpy().astype(float)
        tally.end("escaped", lane[~on], arriving[~on])
        facet, lane, arriving = facet[on], lane[on], arriving[on]
        for name, share in (
            ("incident", 1.0),
            ("absorbed", absorbed.numpy()[on]),
            ("reflected", reflected.numpy()[on]),
            ("behind", behind.numpy()[on]),
            ("scaled", dr.abs(si.wi.z).numpy()[on] < tracer.grazing[facet]),
        ):
            tally.add(name, lane, facet, arriving * share)
        if number < SHOWN:
            leaving = arriving * reflected.numpy()[on]
            tally.by_reflection[number] += np.bincount(lane, leaving, BATCHES)

        # Russian roulette: weak photons end, and the survivors carry their flux.
        throughput *= reflected
        survival = dr.clip(throughput, SURVIVAL, 1)
        active = hit & (reflected > 0) & (sampler.next_1d() < survival)
        flux, throughput = flux * reflected / survival, throughput / survival
        ray = tracer.leave(si, si.to_world(to))
    tally.end("unfinished", batch.numpy(), dr.select(active, flux, 0).numpy())


def emitted(tracer: PhotonTracer, source, photons: int, sampler, batch, tally: Tally) -> tuple:
    """Rays of photons that leave an emitter, and their fluxes [W], which are added to the tally."""
    if source.get_shape() is None:
        ray, flux = from_afar(tracer, source, photons, sampler)
        tally.end("from_afar", batch, flux.numpy())
        return ray, flux
    # Start at a random point on a random side of the emitter, in a cosine-weighted direction. The
    # density of the directions is cos / (2 pi), and the flux of a photon is 2 pi L / density.
    si, density = source.sample_surface(sampler.next_2d(), mi.Bool(True))
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    si.wi.z = dr.mulsign(si.wi.z, sampler.next_1d() - 0.5)
    flux = source.eval(si)[0] * dr.two_pi / (density * photons)
    facet = tracer.table.number(mi.ShapePtr(source.get_shape()), si.prim_index).numpy()
    tally.add("emitted", batch, facet, flux.numpy())
    return tracer.leave(si, si.to_world(si.wi)), flux


def from_afar(tracer, source, photons, sampler) -> tuple:
    """Rays of photons from the sun or the sky, and their fluxes [W].

    In each direction they pass through a disc that covers everything but the sky, and begin where
    they have passed the sky. Their sum is the mean irradiance on such a disc, times its area.

    tracer: finds the sky. source: the emitter. sampler: gives random numbers.
    """
    points = [
        corners(shape) for shape in tracer.scene.shapes() if facet_type_of(shape.emitter()) != "sky"
    ]
    if not points:
        raise InputError(f"{tracer.name}: has nothing but sky that light from afar could fall on")
    points = np.concatenate(points)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    # A margin for directions from the edge of the sun's disc, which are tilted
    tilt = source.sin_radius / np.sqrt(1 - source.sin_radius**2)
    radius = float(np.linalg.norm(points - middle, axis=1).max() * (1 + 2 * tilt))
    ds, value = source.sample_direction(dr.zeros(mi.Interaction3f), sampler.next_2d())
    place = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * radius
    across = mi.Frame3f(ds.d).to_world(mi.Vector3f(place.x, place.y, 0))
    flux = dr.full(mi.Float, np.pi * radius**2 / photons, photons) * value[0]
    ray = mi.Ray3f(mi.Point3f(middle) + radius * ds.d + across, -ds.d)
    is_sky = mi.Bool(tracer.table.type == "sky")
    for _ in tracer.ids:
        si, facet = tracer.meet(ray)
        in_sky = dr.gather(mi.Bool, is_sky, facet, si.is_valid())
        if not dr.any(in_sky):
            break
        ray.o = dr.select(in_sky, tracer.leave(si, ray.d).o, ray.o)
    return ray, flux


def passive_emissivity(index: int, shape):
    """Emissivity of a shape without an emitter: the share that its BSDF does not reflect.

    `index` is the number of the shape in the scene. Raises InputError if it is not known.
    """
    try:
        return partial(emissivity_of(shape.bsdf()).eval, shape.bsdf())
    except InputError as error:
        raise InputError(
            f"shape {shape.id() or index} has no emitter, and what it absorbs is not known "
            f"({error}); give it another BSDF"
        ) from None
