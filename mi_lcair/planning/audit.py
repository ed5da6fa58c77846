"""Where the energy goes: flux emitted, absorbed and escaped, followed forward from what emits,
material by material.

What a surface absorbs is by Kirchhoff's law its emissivity in the direction from which the flux
arrives; what it reflects is the integral of its BRDF over the directions in which it leaves, DHR.
The renderer goes the other way, from the observer, with 1 - HDR for emission. That the two accounts
meet is therefore a test of materials: emissivity + DHR = 1 holds in each direction only for
reciprocal BRDFs; emissivities of another origin may create energy.
"""

from dataclasses import dataclass, fields

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.reflection_bsdf import reflection_layers
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.scene import Scene

BATCHES = 8  # their scatter tells the standard errors
MAX_REFLECTIONS = 1000  # what then still travels is reported as unfinished
SURVIVAL = 0.05  # least probability to follow a photon further
SIGNIFICANT = 1e-3  # share of a flux from which an imbalance is named
NAMED = 5  # facets named at most


@dataclass
class Flux:
    """Fluxes of one material, or of all, W, one value per batch; BATCHES times a batch's mean is
    the sum over all photons.

    incident = absorbed + reflected - created; behind: what reaches the back of a one-sided surface,
    which neither reflects nor emits; scaled: what arrives at angles where the BRDF is scaled down
    to HDR = 1.
    """

    emitted: np.ndarray
    incident: np.ndarray
    absorbed: np.ndarray
    reflected: np.ndarray
    behind: np.ndarray
    scaled: np.ndarray

    @property
    def created(self) -> np.ndarray:
        return self.absorbed + self.reflected + self.behind - self.incident


@dataclass(frozen=True)
class Audit:
    """Fluxes [W] as {name: (value, standard error)}: of the scene (emitted, absorbed, escaped,
    behind, created, unfinished and the balance, emitted + created less all others, 0 but for its
    error), and of each material. shares: the same over what is emitted (by "scene") or over what
    reaches the material. remarks: what is wrong, with the facets responsible, one line each.
    """

    scene: str
    band: str
    total: dict[str, tuple[float, float]]
    materials: dict[str, dict[str, tuple[float, float]]]
    shares: dict[str, dict[str, tuple[float, float]]]
    remarks: list[str]
    photons: int

    def as_dict(self) -> dict:
        def plain(flux, unit="W"):
            return {
                name: {unit: value, "standard_error": error}
                for name, (value, error) in flux.items()
            }

        return {
            "scene": self.scene,
            "band": self.band,
            "total": plain(self.total),
            "photons": self.photons,
            "remarks": self.remarks,
            "materials": {name: plain(flux) for name, flux in self.materials.items()},
            "shares": {name: plain(shares, "share") for name, shares in self.shares.items()},
        }


def audit(scene: Scene, photons: int = 2**18, seed: int = 0, progress=None) -> Audit:
    """Follows `photons` from each thermal emitter until they are absorbed or escape.

    Raises InputError for a scene with other emitters. progress: called with (emitters done, all).
    """
    table = FacetTable(scene)
    emitters = list(scene.mi.emitters())
    if not all(hasattr(emitter, "group") for emitter in emitters):
        raise InputError(
            f"{scene.name}: only the flux of thermal emitters can be followed; the scene has others"
        )
    photons = -(-photons // BATCHES) * BATCHES
    by_facet = Flux(*np.zeros((len(fields(Flux)), BATCHES, table.count)))
    ends = {"escaped": np.zeros(BATCHES), "unfinished": np.zeros(BATCHES)}
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
    """Of each facet the cosine below which its BRDF is scaled down, 0 where it never is."""
    angles = {}
    for surface in scene.surfaces():
        angle = surface.first_saturated_angle_deg()
        angles[surface.material] = 0.0 if angle is None else float(np.cos(np.radians(angle)))
    return np.array([angles.get(material, 0.0) for material in table.material])


def follow(
    scene, leaving, emitters, source, passive, photons, seed, table, grazing, by_facet, ends
) -> None:
    """Adds the fates of photons from one emitter to `by_facet` and `ends`."""
    sampler = mi.load_dict({"type": "independent"})
    draw = np.random.SeedSequence([seed, 1])

    def start(width):
        sampler.seed(int(draw.spawn(1)[0].generate_state(1)[0]), width)

    def add(array, batch, facet, values):
        np.add(
            array,
            np.bincount(batch * table.count + facet, values, BATCHES * table.count).reshape(
                array.shape
            ),
            out=array,
        )

    start(photons)
    si, density = source.sample_surface(sampler.next_2d(), mi.Bool(True))
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    si.wi.z = dr.mulsign(si.wi.z, sampler.next_1d() - 0.5)
    flux = source.eval(si)[0] * dr.two_pi / (density * photons)
    ray = leaving.spawn_ray(si, si.to_world(si.wi))
    batch = np.arange(photons) % BATCHES
    own = table.number(mi.ShapePtr(source.get_shape()), si.prim_index).numpy()
    add(by_facet.emitted, batch, own, flux.numpy())
    batch, active = mi.UInt32(batch), flux > 0
    throughput = mi.Float(1)
    for _ in range(MAX_REFLECTIONS):
        kept = dr.compress(active)
        if not len(kept):
            return
        ray, flux, throughput, batch = (
            dr.gather(type(value), value, kept) for value in (ray, flux, throughput, batch)
        )
        si = scene.mi.ray_intersect(ray)
        hit, lane = si.is_valid(), batch.numpy()
        start(len(kept))
        absorbed = dr.select(hit, absorptance(emitters, passive, si, hit), 0)
        ctx = mi.BSDFContext(mi.TransportMode.Importance)
        bs, weight = si.bsdf().sample(ctx, si, sampler.next_1d(), sampler.next_2d(), hit)
        reflected = dr.select(hit, weight[0], 0)
        behind = hit & (absorbed == 0) & (reflected == 0) & (si.wi.z < 0)

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

        throughput *= reflected
        survival = dr.clip(throughput, SURVIVAL, 1)
        active = hit & (reflected > 0) & (sampler.next_1d() < survival)
        flux, throughput = flux * reflected / survival, throughput / survival
        ray = leaving.spawn_ray(si, si.to_world(bs.wo))
    ends["unfinished"] += np.bincount(batch.numpy(), dr.select(active, flux, 0).numpy(), BATCHES)


def passive_emissivity(index: int, shape):
    """Of a shape without an emitter, number `index` of the scene: what it does not reflect."""
    try:
        return emissivity_of(shape.bsdf())
    except InputError as error:
        raise InputError(
            f"shape {shape.id() or index} has no emitter, and what it absorbs is not known ({error}); give it another BSDF"
        ) from None


def absorptance(emitters, passive, si, active):
    """Kirchhoff's: the emissivity toward where the flux comes from. A surface without an emitter,
    one of the pairs (shape, emissivity) of `passive`, absorbs what its BSDF does not reflect.
    """
    found = mi.Float(0)
    for emitter in emitters:
        mine = active & (si.shape == mi.ShapePtr(emitter.get_shape()))
        found = dr.select(mine, emitter.emissivity(si, mine), found)
    for shape, emissivity in passive:
        mine = active & (si.shape == mi.ShapePtr(shape))
        found = dr.select(mine, emissivity.eval(shape.bsdf(), si, mine), found)
    return found


def account(scene: Scene, table: FacetTable, by_facet: Flux, ends: dict, photons: int) -> Audit:
    def figure(batches):
        batches = np.asarray(batches) * BATCHES
        return float(batches.mean()), float(batches.std(ddof=1) / np.sqrt(BATCHES))

    def share(part, whole):
        """Of sums by batch: their ratio, with the error of a ratio."""
        ratio = part.sum() / whole.sum() if whole.any() else 0.0
        return float(ratio), float(
            (part - ratio * whole).std(ddof=1) / np.sqrt(BATCHES) / max(whole.mean(), 1e-300)
        )

    names = [field.name for field in fields(Flux)] + ["created"]
    total = {
        name: getattr(by_facet, name).sum(axis=1)
        for name in ("emitted", "absorbed", "behind", "created")
    } | ends
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
        scene=scene.name,
        band=scene.band.name,
        total=total,
        materials=materials,
        shares=shares,
        remarks=remarks(kind, by_facet, total, materials),
        photons=photons,
    )


def kinds(scene: Scene, table: FacetTable) -> np.ndarray:
    """Of each facet the name of its material; unlike materials of one name, or of none, are told
    apart by the first shape that has them.
    """
    shapes, kind, first = list(scene.mi.shapes()), table.material.copy(), {}
    for index, shape in enumerate(shapes):
        facets = table.shape_index == index
        if facets.any():
            name, bsdf = table.material[facets][0], shape.bsdf()
            surface = next(iter(reflection_layers(bsdf)), None)
            made = (
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
            like = first.setdefault(name, {})
            like.setdefault(
                (made, None if given is None else float(given[0])),
                (shape.id() or f"shape {index}", []),
            )[1].append(facets)
    for name, likes in first.items():
        for shape_id, masks in likes.values():
            for facets in masks:
                kind[facets] = name if len(likes) == 1 else f"{name} ({shape_id})"
    return kind


def remarks(kind: np.ndarray, by_facet: Flux, total: dict, materials: dict) -> list[str]:
    """What a user should look into, with the facets that contribute most."""

    def worst(values):
        order = np.argsort(-values)[:NAMED]
        return ", ".join(str(facet) for facet in order if values[facet] > 0)

    found, emitted = [], total["emitted"][0]
    for material, flux in materials.items():
        (created, error), incident = flux["created"], flux["incident"][0]
        mine = kind == material
        if abs(created) > max(4 * error, SIGNIFICANT * incident):
            verb = "creates" if created > 0 else "loses"
            share = np.sign(created) * by_facet.created.sum(axis=0) * mine
            found.append(
                f"material {material} {verb} {abs(created) / incident:.2%} of what arrives: its emissivity and what it reflects do "
                f"not add up to 1; most at facets {worst(share)}"
            )
        if flux["scaled"][0] > SIGNIFICANT * incident > 0:
            found.append(
                f"material {material} has its BRDF scaled down at grazing angles, where {flux['scaled'][0] / incident:.2%} of its "
                f"incident flux arrives; most at facets {worst(by_facet.scaled.sum(axis=0) * mine)}"
            )
    if total["behind"][0] > SIGNIFICANT * emitted:
        found.append(
            f"{total['behind'][0] / emitted:.2%} of the emitted flux ends at the back of one-sided surfaces; most at facets "
            f"{worst(by_facet.behind.sum(axis=0))}"
        )
    if total["unfinished"][0] > SIGNIFICANT * emitted:
        found.append(
            f"{total['unfinished'][0] / emitted:.2%} of the emitted flux still travels after {MAX_REFLECTIONS} reflections"
        )
    return found
