"""Energy audit: the flux that a scene emits, absorbs and lets escape, by material.

The audit follows photons forward from the emitters. By Kirchhoff's law a surface absorbs its
emissivity in the direction from which the flux arrives. It reflects the integral of its BRDF over
the outgoing directions, DHR. The renderer traces the opposite way, from the observer, and takes
1 - HDR as the emissivity. The audit is therefore a test of the materials: emissivity + DHR = 1
holds in each direction only for reciprocal BRDFs. An emissivity from another source may create
energy.
"""

from dataclasses import fields

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.energy.audit_result import Audit, FluxAndError
from mi_lcair.energy.photons import BATCHES, MAX_REFLECTIONS, Flux, PhotonTracer, Tally, follow
from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.reflection_bsdf import reflection_layers
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.progress import Progress
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene

SIGNIFICANT = 1e-3  # an imbalance is reported if it exceeds this share of the flux
NAMED = 5  # largest number of facets that a remark names


def audit_flux(scene: Scene, photons: int, seed: int, progress: Progress | None) -> Audit:
    """Follow photons from the emitters of a loaded scene until they are absorbed or escape.

    Parameters
    ----------
    scene : Scene
    photons : int
        Photons from each emitter.
    seed : int
    progress : callable or None
        Called with (emitters done, all emitters).

    Raises InputError for a scene whose flux cannot be followed.
    """
    table = FacetTable(scene)
    emitters = list(scene.mi.emitters())
    if not all(map(is_thermal, emitters)):
        raise InputError(
            f"{scene.name}: only the flux of thermal emitters, sun and sky can be followed; the "
            "scene has others"
        )
    photons = -(-photons // BATCHES) * BATCHES
    tally = Tally.of(table.count)
    with scene.prepared(), dr.suspend_grad():
        tracer = PhotonTracer(scene, table)
        for number, emitter in enumerate(emitters):
            follow(tracer, emitter, photons, seed * len(emitters) + number, tally)
            if progress:
                progress(number + 1, len(emitters))
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
        band=scene.band.name,
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
