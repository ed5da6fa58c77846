"""Energy audit: the flux that a scene emits, absorbs and lets escape, by material.

The audit follows photons forward from the emitters. By Kirchhoff's law a surface absorbs its
emissivity in the direction from which the flux arrives. It reflects the integral of its BRDF over
the outgoing directions, DHR. The renderer traces the opposite way, from the observer, and takes
1 - HDR as the emissivity. The audit is therefore a test of the materials: emissivity + DHR = 1
holds in each direction only for reciprocal BRDFs. An emissivity from another source may create
energy.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.reflection_bsdf import reflection_layers
from mi_lcair.progress import Progress
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.views import corners
from mi_lcair.results import Result

BATCHES = 8  # independent batches of photons; their scatter gives the standard errors
MAX_REFLECTIONS = 1000  # flux that still travels after so many is reported as unfinished
SURVIVAL = 0.05  # smallest probability of following a photon further
SIGNIFICANT = 1e-3  # an imbalance is reported if it exceeds this share of the flux
NAMED = 5  # largest number of facets that a remark names


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


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Fluxes of a scene, with their standard errors.

    Attributes
    ----------
    scene_name, band : str
        Names of the scene and of its band.
    total : dict
        {name: (value, standard error)}, W, with the names emitted, absorbed, escaped, behind,
        created, unfinished and balance. The balance is emitted + created less the other fluxes. It
        is 0 except for its error. `emitted` includes the sunlight through a disc that covers
        everything but the sky.
    materials : dict
        {material: {name: (value, standard error)}}, W, with the names of `Flux`.
    shares : dict
        The same fluxes as shares: those of "scene" of the emitted flux, those of a material of the
        flux that arrives there.
    remarks : list of str
        One line for each imbalance, with the facets that cause most of it.
    photons : int
        Number of photons that were followed.
    """

    scene_name: str
    band: str
    total: dict[str, tuple[float, float]]
    materials: dict[str, dict[str, tuple[float, float]]]
    shares: dict[str, dict[str, tuple[float, float]]]
    remarks: list[str]
    photons: int

    kind: ClassVar[str] = "audit"
    drawn_by: ClassVar[str] = "mi_lcair.reports.pictures.audit:figure"

    def summary(self) -> str:
        """One line with the emitted flux and the balance."""
        flux, error = self.total["emitted"]
        share, share_error = self.shares["scene"]["balance"]
        return (
            f"audit of {self.scene_name}, {self.band}: {flux:.5g} +- {error:.2g} W emitted, "
            f"balance {100 * share:.2g} +- {100 * share_error:.1g} % of it (standard errors), "
            f"{len(self.remarks) or 'no'} remarks"
        )

    def entries(self) -> dict:
        """Entries for JSON: fluxes with the names value_W and standard_error_W, and shares."""

        def plain(fluxes, value_name, error_name):
            return {
                name: {value_name: value, error_name: error}
                for name, (value, error) in fluxes.items()
            }

        fluxes = lambda of: plain(of, "value_W", "standard_error_W")
        return {
            "scene_name": self.scene_name,
            "band": self.band,
            "total": fluxes(self.total),
            "photons": self.photons,
            "remarks": self.remarks,
            "materials": {name: fluxes(flux) for name, flux in self.materials.items()},
            "shares": {
                name: plain(shares, "value", "standard_error")
                for name, shares in self.shares.items()
            },
        }

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


def audit(
    scene: SceneLike,
    photons: int = 2**18,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Audit:
    """Follow photons from the emitters of a scene until they are absorbed or escape.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its emitters must all be thermal, or the sun.
    photons : int
        Photons from each emitter.
    seed : int
        Seed of the random numbers.
    progress : callable, optional
        Called with (emitters done, all emitters).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Audit

    Raises
    ------
    InputError
        If the scene has an emitter that is not thermal, or a surface without an emitter whose
        absorption is unknown.
    """
    scene = scene_of(scene, parameters)
    table = FacetTable(scene)
    emitters = list(scene.mi.emitters())
    if not all(hasattr(e, "group") and (e.get_shape() or hasattr(e, "is_sun")) for e in emitters):
        raise InputError(
            f"{scene.name}: only the flux of thermal emitters and of the sun can be followed; the "
            "scene has others"
        )
    photons = -(-photons // BATCHES) * BATCHES
    by_facet = Flux(*np.zeros((len(fields(Flux)), BATCHES, table.count)))
    ends = {name: np.zeros(BATCHES) for name in ("escaped", "unfinished", "sunlight")}
    grazing = scaling_cosines(scene, table)
    passive = [
        (shape, passive_emissivity(index, shape))
        for index, shape in enumerate(scene.mi.shapes())
        if shape.emitter() is None
    ]
    with scene.prepared() as tracer, dr.suspend_grad():
        for number, emitter in enumerate(emitters):
            follow(
                scene,
                tracer.emitters,
                emitters,
                emitter,
                passive,
                photons,
                seed * len(emitters) + number,
                table,
                grazing,
                by_facet,
                ends,
            )
            if progress:
                progress(number + 1, len(emitters))
    return account(scene, table, by_facet, ends, photons * len(emitters))


def scaling_cosines(scene: Scene, table: FacetTable) -> np.ndarray:
    """Cosine of incidence below which the BRDF of each facet is scaled down, shape (facets,).

    It is 0 for a facet whose BRDF is never scaled.
    """
    angles = {}
    for surface in scene.surfaces():
        angle = surface.first_saturated_angle_deg()
        angles[surface.material] = 0.0 if angle is None else float(np.cos(np.radians(angle)))
    return np.array([angles.get(material, 0.0) for material in table.material])


def follow(
    scene, leaving, emitters, source, passive, photons, seed, table, grazing, by_facet, ends
) -> None:
    """Follow photons from one emitter, and add their fluxes to `by_facet` and `ends`.

    Parameters
    ----------
    scene : Scene
        Scene that the photons travel in.
    leaving : EmitterTable
        Spawns rays that leave a surface.
    emitters : list of mitsuba.Emitter
        All emitters of the scene.
    source : mitsuba.Emitter
        Emitter that the photons start from.
    passive : list of (mitsuba.Shape, emissivity)
        Shapes without an emitter; see `absorptance`.
    photons : int
        Number of photons, a multiple of BATCHES.
    seed : int
        Seed of the random numbers.
    table : FacetTable
        Facets of the scene.
    grazing : ndarray, shape (facets,)
        Cosines below which BRDFs are scaled down; see `scaling_cosines`.
    by_facet : Flux
        Fluxes by batch and facet, W; changed in place.
    ends : dict of str to ndarray, shape (BATCHES,)
        Flux that has "escaped", is "unfinished" or is "sunlight", W; changed in place.
    """
    sampler = mi.load_dict({"type": "independent"})
    draw = np.random.SeedSequence([seed, 1])

    def reseed(width):
        """Give the sampler a new seed and a new number of photons."""
        sampler.seed(int(draw.spawn(1)[0].generate_state(1)[0]), width)

    def add(array, batch, facet, values):
        """Add values by batch and facet to an array (BATCHES, facets)."""
        np.add(
            array,
            np.bincount(batch * table.count + facet, values, BATCHES * table.count).reshape(
                array.shape
            ),
            out=array,
        )

    reseed(photons)
    batch = np.arange(photons) % BATCHES
    if source.get_shape() is None:
        ray, flux = sunlight(scene, leaving, source, photons, sampler)
        ends["sunlight"] += np.bincount(batch, flux.numpy(), BATCHES)
    else:
        # Start at a random point on a random side of the emitter, in a cosine-weighted direction.
        # The density of the directions is cos / (2 pi), and the flux of a photon is
        # 2 pi L / density.
        si, density = source.sample_surface(sampler.next_2d(), mi.Bool(True))
        si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        si.wi.z = dr.mulsign(si.wi.z, sampler.next_1d() - 0.5)
        flux = source.eval(si)[0] * dr.two_pi / (density * photons)
        ray = leaving.spawn_ray(si, si.to_world(si.wi))
        own = table.number(mi.ShapePtr(source.get_shape()), si.prim_index).numpy()
        add(by_facet.emitted, batch, own, flux.numpy())
    batch, active = mi.UInt32(batch), flux > 0
    throughput = mi.Float(1)
    for _ in range(MAX_REFLECTIONS):
        # Drop the photons that have ended, so that the kernels shrink with each reflection.
        kept = dr.compress(active)
        if not len(kept):
            return
        ray, flux, throughput, batch = (
            dr.gather(type(value), value, kept) for value in (ray, flux, throughput, batch)
        )
        si = scene.mi.ray_intersect(ray)
        hit, lane = si.is_valid(), batch.numpy()
        reseed(len(kept))
        # Split the arriving flux into what is absorbed, reflected, and lost behind a surface.
        absorbed = dr.select(hit, absorptance(emitters, passive, si, hit), 0)
        ctx = mi.BSDFContext(mi.TransportMode.Importance)
        bs, weight = si.bsdf().sample(ctx, si, sampler.next_1d(), sampler.next_2d(), hit)
        reflected = dr.select(hit, weight[0], 0)
        behind = hit & (absorbed == 0) & (reflected == 0) & (si.wi.z < 0)

        # Record it by batch and facet. A photon that hits nothing has escaped.
        facet = table.number(si.shape, si.prim_index, hit).numpy()
        on, arriving = hit.numpy(), flux.numpy().astype(float)
        ends["escaped"] += np.bincount(lane[~on], arriving[~on], BATCHES)
        facet, lane, arriving = facet[on], lane[on], arriving[on]
        for array, share in (
            (by_facet.incident, 1.0),
            (by_facet.absorbed, absorbed.numpy()[on]),
            (by_facet.reflected, reflected.numpy()[on]),
            (by_facet.behind, behind.numpy()[on]),
            (by_facet.scaled, dr.abs(si.wi.z).numpy()[on] < grazing[facet]),
        ):
            add(array, lane, facet, arriving * share)

        # Russian roulette: weak photons end, and the survivors carry their flux.
        throughput *= reflected
        survival = dr.clip(throughput, SURVIVAL, 1)
        active = hit & (reflected > 0) & (sampler.next_1d() < survival)
        flux, throughput = flux * reflected / survival, throughput / survival
        ray = leaving.spawn_ray(si, si.to_world(bs.wo))
    ends["unfinished"] += np.bincount(batch.numpy(), dr.select(active, flux, 0).numpy(), BATCHES)


def sunlight(scene, leaving, sun, photons, sampler) -> tuple:
    """Rays of photons from the sun, and their fluxes [W].

    They pass through a disc that covers everything but the sky as seen from the sun, and begin
    where they have passed the sky. Their sum is the irradiance times the area of the disc.

    scene, leaving, photons: as for `follow`. sun: the emitter. sampler: gives random numbers.
    """
    points = [
        corners(shape)
        for shape in scene.mi.shapes()
        if getattr(shape.emitter(), "facet_type", "model") != "sky"
    ]
    if not points:
        raise InputError(f"{scene.name}: has nothing but sky that sunlight could fall on")
    points = np.concatenate(points)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    # Directions from the edge of the sun's disc are tilted, so that the disc of photons is larger
    tilt = sun.sin_radius / np.sqrt(1 - sun.sin_radius**2)
    radius = float(np.linalg.norm(points - middle, axis=1).max() * (1 + 2 * tilt))
    ds, value = sun.sample_direction(dr.zeros(mi.Interaction3f), sampler.next_2d())
    place = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * radius
    start = mi.Point3f(middle) + radius * sun.centre + place.x * sun.right + place.y * sun.up
    flux = value[0] * dr.dot(ds.d, sun.centre) * (np.pi * radius**2 / photons)
    ray = mi.Ray3f(start, -ds.d)
    for _ in range(len(scene.mi.shapes())):
        si = scene.mi.ray_intersect(ray)
        in_sky = si.is_valid() & leaving.shows_sun(si, si.emitter(scene.mi))
        if not dr.any(in_sky):
            break
        ray.o = dr.select(in_sky, leaving.leave(si, ray.d), ray.o)
    return ray, flux


def passive_emissivity(index: int, shape):
    """Emissivity of a shape without an emitter: the share that its BSDF does not reflect.

    `index` is the number of the shape in the scene. Raises InputError if it is not known.
    """
    try:
        return emissivity_of(shape.bsdf())
    except InputError as error:
        raise InputError(
            f"shape {shape.id() or index} has no emitter, and what it absorbs is not known "
            f"({error}); give it another BSDF"
        ) from None


def absorptance(emitters, passive, si, active):
    """Share of the arriving flux that is absorbed: by Kirchhoff's law, the emissivity.

    The emissivity is that toward the origin of the flux. A surface without an emitter absorbs what
    its BSDF does not reflect.

    Parameters
    ----------
    emitters : list of mitsuba.Emitter
        All emitters of the scene.
    passive : list of (mitsuba.Shape, emissivity)
        Shapes without an emitter, and their emissivities; see `passive_emissivity`.
    si : mitsuba.SurfaceInteraction3f
        Points where the flux arrives.
    active : mitsuba.Bool
        Points that are evaluated; the others get 0.

    Returns
    -------
    mitsuba.Float
    """
    absorbed = mi.Float(0)
    for emitter in emitters:
        if emitter.get_shape() is None:
            continue
        on_shape = active & (si.shape == mi.ShapePtr(emitter.get_shape()))
        absorbed = dr.select(on_shape, emitter.emissivity(si, on_shape), absorbed)
    for shape, emissivity in passive:
        on_shape = active & (si.shape == mi.ShapePtr(shape))
        absorbed = dr.select(on_shape, emissivity.eval(shape.bsdf(), si, on_shape), absorbed)
    return absorbed


def account(scene: Scene, table: FacetTable, by_facet: Flux, ends: dict, photons: int) -> Audit:
    """The Audit of fluxes by batch and facet (`by_facet`) and of where the others end (`ends`)."""

    def figure(batches):
        """(sum, standard error) of the values of the batches."""
        batches = np.asarray(batches) * BATCHES
        return float(batches.mean()), float(batches.std(ddof=1) / np.sqrt(BATCHES))

    def share(part, whole):
        """(ratio, standard error) of two sums over the batches."""
        ratio = part.sum() / whole.sum() if whole.any() else 0.0
        return float(ratio), float(
            (part - ratio * whole).std(ddof=1) / np.sqrt(BATCHES) / max(whole.mean(), 1e-300)
        )

    names = [field.name for field in fields(Flux)] + ["created"]
    total = {
        name: getattr(by_facet, name).sum(axis=1)
        for name in ("emitted", "absorbed", "behind", "created")
    } | ends
    total["emitted"] = total["emitted"] + total.pop("sunlight")
    total["balance"] = sum(
        total[name] * sign
        for name, sign in (
            ("emitted", 1),
            ("created", 1),
            ("absorbed", -1),
            ("behind", -1),
            ("escaped", -1),
            ("unfinished", -1),
        )
    )
    kind = kinds(scene, table)
    materials = {
        name: {flux: getattr(by_facet, flux)[:, kind == name].sum(axis=1) for flux in names}
        for name in dict.fromkeys(kind)
    }
    shares = {
        "scene": {name: share(batches, total["emitted"]) for name, batches in total.items()},
        **{
            name: {key: share(batches, flux["incident"]) for key, batches in flux.items()}
            for name, flux in materials.items()
        },
    }
    total = {name: figure(batches) for name, batches in total.items()}
    materials = {
        name: {key: figure(batches) for key, batches in flux.items()}
        for name, flux in materials.items()
    }
    return Audit(
        scene_name=scene.name,
        band=scene.band.name,
        total=total,
        materials=materials,
        shares=shares,
        remarks=remarks(kind, by_facet, total, materials),
        photons=photons,
    )


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
            reflection = (
                pointer_id(mi.BSDFPtr(bsdf))
                if surface is None
                else (
                    surface.model.name,
                    *surface.values,
                    surface.form,
                    surface.emissivity,
                    surface.lobe,
                )
            )
            given = getattr(shape.emitter(), "given_emissivity", None)
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
                f"material {material} {verb} {abs(created) / incident:.2%} of what arrives: its "
                "emissivity and what it reflects do not add up to 1; most at facets "
                f"{worst(share)}"
            )
        if flux["scaled"][0] > SIGNIFICANT * incident > 0:
            lines.append(
                f"material {material} has its BRDF scaled down at grazing angles, where "
                f"{flux['scaled'][0] / incident:.2%} of its incident flux arrives; most at facets "
                f"{worst(by_facet.scaled.sum(axis=0) * of_material)}"
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
