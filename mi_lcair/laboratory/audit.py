"""Energy audit: the flux that a scene emits, absorbs and lets escape, by material.

The audit follows photons forward from the emitters. By Kirchhoff's law a surface absorbs its
emissivity in the direction from which the flux arrives. It reflects the integral of its BRDF over
the outgoing directions, DHR. The renderer traces the opposite way, from the observer, and takes
1 - HDR as the emissivity. The audit is therefore a test of the materials: emissivity + DHR = 1
holds in each direction only for reciprocal BRDFs. An emissivity from another source may create
energy.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.reflection_bsdf import reflection_layers
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, is_thermal
from mi_lcair.rendering.facets import FacetTable, FacetTracer, Radiator
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import corners
from mi_lcair.results import Result, entry
from mi_lcair.sections import Lines, Remarks, Table

# The fluxes that `audit` returns
# -------------------------------

SCENE = ("absorbed", "escaped", "behind", "created", "unfinished", "balance")
MATERIAL = ("absorbed", "reflected", "behind", "created", "scaled")


class FluxAndError(NamedTuple):
    """A flux [W], or its share of another one, with its standard error."""

    value: float
    standard_error: float

    @property
    def percent(self) -> str:
        return f"{100 * self.value:.3f} +- {100 * self.standard_error:.1g}"


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Fluxes of a scene, with their standard errors.

    Attributes
    ----------
    scene_name, band : str
        Names of the scene and of its band.
    total : dict
        {name: FluxAndError}, W, with the names emitted, absorbed, escaped, behind, created,
        unfinished and balance. The balance is emitted + created minus the other fluxes. It is 0
        except for its error. `emitted` includes the sunlight through a disc that covers everything
        except the sky.
    materials : dict
        {material: {name: FluxAndError}}, W, with the names of `Flux`.
    shares : dict
        The same fluxes as shares. Under "scene" they are shares of the flux that the scene emits,
        under a material shares of the flux that arrives at the material.
    by_reflection : list of FluxAndError
        Share of the emitted flux that leaves surfaces after its first, second,
        ... reflection.
    remarks : list of str
        Warnings about the scene, such as that nothing surrounds its model, and one line for each
        imbalance with the facets that cause most of it.
    photons : int
        Number of photons that were followed.
    facets : dict of str to ndarray, shape (facets,)
        Irradiance and radiant exitance (thesis Table 2.1) of each facet with their standard errors,
        W m^-2. Not in the JSON.
    """

    scene_name: str
    band: str
    total: dict[str, FluxAndError] = entry("total_W")
    materials: dict[str, dict[str, FluxAndError]] = entry("materials_W")
    shares: dict[str, dict[str, FluxAndError]]
    remarks: list[str]
    photons: int
    by_reflection: list[FluxAndError] = field(default_factory=list)
    facets: dict[str, np.ndarray] = entry(default_factory=dict)

    kind = "audit"
    heading = "Energy audit"

    def summary(self) -> str:
        """One line with the emitted flux and the balance."""
        flux, error = self.total["emitted"]
        share, share_error = self.shares["scene"]["balance"]
        return (
            f"audit of {self.scene_name}, {self.band}: {flux:.5g} +- {error:.2g} W emitted, "
            f"balance {100 * share:.2g} +- {100 * share_error:.1g} % of it (standard errors), "
            f"{len(self.remarks) or 'no'} warnings"
        )

    def facts(self) -> Iterator[Any]:
        """Energy of the scene: what is emitted, absorbed and escapes, by material."""
        yield (
            "The flux is followed from the emitters until it is absorbed or escapes. Shares of "
            "the scene are fractions of the emitted flux."
        )
        flux, error = self.total["emitted"]
        yield "band", self.band
        yield "photons", self.photons
        yield "emitted", f"{flux:.6g} W +- {error:.2g}"
        for key in SCENE:
            yield f"{key} %", self.shares["scene"][key].percent
        yield Table(
            [
                "material",
                ("emitted", "W"),
                ("incident", "W"),
                *(f"{key} % of incident" for key in MATERIAL),
            ],
            [
                [
                    name,
                    flux["emitted"].value,
                    flux["incident"].value,
                    *(self.shares[name][key].percent for key in MATERIAL),
                ]
                for name, flux in self.materials.items()
            ],
        )
        yield ("The share of the emitted flux that leaves surfaces after each reflection.")
        rows = [[n, 100 * a, 100 * b] for n, (a, b) in enumerate(self.by_reflection, start=1)]
        yield Table(["reflection", "% of emitted", "standard error, %"], rows)
        nothing = ["no warnings: energy is conserved within the errors above"]
        yield Lines("", self.remarks or nothing)
        yield Remarks([])  # they are among the facts

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each flux of the scene and of each material: in watts, and as a share.

        A share of "scene" is that of the emitted flux, a share of a material that of the flux that
        arrives there. The column `of` tells them apart.
        """
        rows = [
            (of, name, *flux, *self.shares[of][name])
            for of, fluxes in {"scene": self.total, **self.materials}.items()
            for name, flux in fluxes.items()
        ]
        of, names, *numbers = zip(*rows)
        names_of = ("flux_W", "standard_error_W", "share", "share_standard_error")
        return {"of": np.array(of), "name": np.array(names)} | {
            name: np.array(values, dtype=float) for name, values in zip(names_of, numbers)
        }


# Photons that are followed from the emitters of a scene, for its energy audit
# ----------------------------------------------------------------------------

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
                surfaces[key] = Radiator(bsdf, emissivity, mi.TransportMode.Importance)
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
            f"shape {shape.id() or index} has no emitter, and its absorption is not known "
            f"({error}); give it another BSDF"
        ) from None


SIGNIFICANT = 1e-3  # an imbalance is reported if it exceeds this share of the flux
NAMED = 5  # largest number of facets that a remark names


def audit_flux(scene: Scene, sampling: Sampling) -> Audit:
    """Follow photons from the emitters of a loaded scene until they are absorbed or escape.

    sampling: its paths are those from each emitter, and its progress is called with (emitters done,
    all emitters). Raises InputError for a scene whose flux cannot be followed.
    """
    table = FacetTable(scene)
    emitters = list(scene.mi.emitters())
    if not all(map(is_thermal, emitters)):
        raise InputError(
            f"{scene.name}: only the flux of thermal emitters, sun and sky can be followed; the "
            "scene has others"
        )
    photons = -(-sampling.paths // BATCHES) * BATCHES
    tally = Tally.of(table.count)
    with scene.prepared(), dr.suspend_grad():
        tracer = PhotonTracer(scene, table)
        for number, emitter in enumerate(emitters):
            follow(tracer, emitter, photons, sampling.seed * len(emitters) + number, tally)
            if sampling.progress:
                sampling.progress(number + 1, len(emitters))
    return account(scene, table, tally, photons * len(emitters))


def account(scene: Scene, table: FacetTable, tally: Tally, photons: int) -> Audit:
    """The Audit of what became of the photons."""
    by_facet = tally.by_facet

    def figure(batches):
        """Sum and standard error of the values of the batches."""
        batches = np.asarray(batches) * BATCHES
        return FluxAndError(float(batches.mean()), float(batches.std(ddof=1) / np.sqrt(BATCHES)))

    def share(part, whole):
        """Ratio and standard error of two sums over the batches."""
        ratio = part.sum() / whole.sum() if whole.any() else 0.0
        error = (part - ratio * whole).std(ddof=1) / np.sqrt(BATCHES) / max(whole.mean(), 1e-300)
        return FluxAndError(float(ratio), float(error))

    names = [field.name for field in fields(Flux)] + ["created"]
    of_scene = ("emitted", "absorbed", "behind", "created")
    total = {name: getattr(by_facet, name).sum(axis=1) for name in of_scene} | tally.ends
    total["emitted"] = total["emitted"] + total.pop("from_afar")
    total["balance"] = total["emitted"] + total["created"]
    for name in ("absorbed", "behind", "escaped", "unfinished"):
        total["balance"] = total["balance"] - total[name]
    kind = kinds(scene, table)
    fluxes = {"scene": total} | {
        name: {flux: getattr(by_facet, flux)[:, kind == name].sum(axis=1) for flux in names}
        for name in dict.fromkeys(kind)
    }
    shares = {
        of: {
            name: share(batches, flux["emitted" if flux is total else "incident"])
            for name, batches in flux.items()
        }
        for of, flux in fluxes.items()
    }
    materials = {
        of: {name: figure(batches) for name, batches in flux.items()} for of, flux in fluxes.items()
    }
    total_by_batch, total = total, materials.pop("scene")
    return Audit(
        scene_name=scene.name,
        band=scene.band.label,
        total=total,
        materials=materials,
        shares=shares,
        by_reflection=[share(part, total_by_batch["emitted"]) for part in tally.by_reflection],
        remarks=[*scene.notes, *remarks(kind, by_facet, total, materials)],
        photons=photons,
        facets=of_facets(table, by_facet),
    )


def of_facets(table: FacetTable, by_facet: Flux) -> dict[str, np.ndarray]:
    """Columns for each facet: what arrives on its front side and what leaves it, W m^-2.

    Irradiance E and radiant exitance M are fluxes divided by the area (thesis Table 2.1).
    """
    columns = {
        "facet": np.arange(table.count),
        "group": table.group.astype(str),
        "material": table.material.astype(str),
        "area_m2": table.area,
    }
    leaving = by_facet.emitted + by_facet.reflected
    parts = {"emitted": by_facet.emitted, "exitance": leaving, "irradiance": by_facet.incident}
    for name, flux in parts.items():
        density = flux * BATCHES / np.where(table.area > 0, table.area, np.nan)
        columns[f"{name}_W_m2"] = density.mean(axis=0)
        columns[f"{name}_standard_error_W_m2"] = density.std(axis=0, ddof=1) / np.sqrt(BATCHES)
    return columns


def kinds(scene: Scene, table: FacetTable) -> np.ndarray:
    """Name of the material of each facet, shape (facets,).

    Different materials may have the same name, or none. The id of the first shape that has the
    material is then appended to the name.
    """
    shapes, kind, variants = list(scene.mi.shapes()), table.material.copy(), {}
    for index, shape in enumerate(shapes):
        facets = table.shape_index == index
        if facets.any():
            name, bsdf = table.material[facets][0], shape.bsdf()
            surface = next(iter(reflection_layers(bsdf)), None)
            reflection = surface.reflection if surface else pointer_id(mi.BSDFPtr(bsdf))
            emitter = shape.emitter()
            given = emitter.given_emissivity if is_thermal(emitter) else None
            # Shapes with the same reflection and emissivity share a material.
            of_name = variants.setdefault(name, {})
            of_name.setdefault(
                (reflection, None if given is None else float(given[0])),
                (shape.id() or f"shape {index}", []),
            )[1].append(facets)
    for name, of_name in variants.items():
        for shape_id, masks in of_name.values():
            for facets in masks:
                kind[facets] = name if len(of_name) == 1 else f"{name} ({shape_id})"
    return kind


def remarks(kind: np.ndarray, by_facet: Flux, total: dict, materials: dict) -> list[str]:
    """Remarks on significant imbalances, with the facets that contribute most, one line each."""

    def worst(values):
        """The numbers of the facets with the largest values, as text."""
        order = np.argsort(-values)[:NAMED]
        return ", ".join(str(facet) for facet in order if values[facet] > 0)

    lines, emitted = [], total["emitted"][0]
    for material, flux in materials.items():
        (created, error), incident = flux["created"], flux["incident"][0]
        of_material = kind == material
        if abs(created) > max(4 * error, SIGNIFICANT * incident):
            verb = "creates" if created > 0 else "loses"
            share = np.sign(created) * by_facet.created.sum(axis=0) * of_material
            lines.append(
                f"material {material} {verb} {abs(created) / incident:.2%} of the incident flux: "
                "its emissivity and its reflectance do not add up to 1; most at facets "
                f"{worst(share)}"
            )
        if flux["scaled"][0] > SIGNIFICANT * incident > 0:
            lines.append(
                f"material {material} has its BRDF scaled down at grazing angles; "
                f"{flux['scaled'][0] / incident:.2%} of its incident flux arrives there; most at "
                f"facets {worst(by_facet.scaled.sum(axis=0) * of_material)}"
            )
    if total["behind"][0] > SIGNIFICANT * emitted:
        lines.append(
            f"{total['behind'][0] / emitted:.2%} of the emitted flux ends at the back of "
            f"one-sided surfaces; most at facets {worst(by_facet.behind.sum(axis=0))}"
        )
    if total["unfinished"][0] > SIGNIFICANT * emitted:
        lines.append(
            f"{total['unfinished'][0] / emitted:.2%} of the emitted flux still travels after "
            f"{MAX_REFLECTIONS} reflections"
        )
    return lines
