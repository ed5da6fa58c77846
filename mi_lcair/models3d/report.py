"""Figures that describe a facet model and its errors."""

import numpy as np

from mi_lcair.models3d import checks
from mi_lcair.models3d.coincident import overlaps
from mi_lcair.models3d.label import TYPES
from mi_lcair.models3d.model import Model

COLD = 200.0  # lower temperatures, K, are remarked because they are rare on a surface
OVERLAPS = (("back_to_back", "back to back"), ("one_on_the_other", "one on the other"))


def report(model: Model) -> dict:
    """Figures of a model; facets are those of `read`.

    Counts of facets: facets, degenerate (no area), duplicate (the corners of an earlier one,
    whichever way it faces), inward (model facets that face the wrong way), non_planar (farther from
    their mean plane than 1e-4 of their size). Others: triangles; volume, signed, and volume_by_type
    [m^3] (openings count as closed, exact copies once); open_edges, where a facet has no neighbour;
    area_by_material [m^2]; non_planar_mm, the greatest distance of a corner from its facet's mean
    plane; bounding_box [m]; temperature_min and temperature_max [K]; back_to_back and
    one_on_the_other: how many pairs of facets overlap in one plane, facing opposite ways or the
    same way, and the first pair's numbers (None without one) and names. inward_names: what the
    facets that face inward are called.
    """
    areas = np.bincount(model.triangle_facet, checks.triangle_areas(model), model.count)
    duplicate, copy = checks.repeated(model)
    edges = checks.Edges(model, ~copy)
    volumes = np.where(copy, 0, checks.signed_volumes(model, edges))
    facets = {TYPES[kind]: model.facets_of(kind) for kind in TYPES}
    material = np.array([label.material for label in model.labels])[model.label]
    inward = checks.inward(model, volumes, facets["model"] & ~copy)
    sheets = overlaps(model.vertices[model.triangles])
    return {
        "facets": model.count,
        "triangles": len(model.triangles),
        "volume": volumes.sum(),
        "volume_by_type": {
            kind: volumes[mask].sum() for kind, mask in facets.items() if mask.any()
        },
        "open_edges": edges.open(),
        "area_by_material": {
            str(name): areas[material == name].sum() for name in np.unique(material)
        },
        "inward": np.count_nonzero(inward),
        "inward_names": model.called(inward),
        "degenerate": np.count_nonzero(checks.degenerate(model)),
        "duplicate": np.count_nonzero(duplicate),
        "non_planar": np.count_nonzero(checks.non_planar(model)),
        "non_planar_mm": 1e3 * model.off_plane.max(),
        "bounding_box": model.box,
        "temperature_min": model.temperature.min(),
        "temperature_max": model.temperature.max(),
        "back_to_back": _facet_pairs(model, sheets.back_to_back),
        "one_on_the_other": _facet_pairs(model, sheets.same_side),
    }


def _facet_pairs(model, triangles):
    """How many pairs of facets pairs of triangles (P, 2) belong to, and the first."""
    facets = np.sort(model.triangle_facet[triangles], axis=1)
    facets = np.unique(facets[facets[:, 0] != facets[:, 1]], axis=0)
    first = facets[0].tolist() if len(facets) else None
    names = [model.called([facet]) for facet in first or ()]
    return {"count": len(facets), "first": first, "names": names}


def remarkable(figures: dict, materials):
    """Yield remarks on the figures that a user should know, one line each."""
    from mi_lcair.physics.materials import emits_nothing

    for material in figures["area_by_material"]:
        if emits_nothing(material, materials):
            yield (
                f"material {material} reflects all that arrives and emits nothing: its facets are "
                "black but for what they reflect; name a material that absorbs, such as blackbody, "
                "where they are to radiate by their temperature"
            )
    if figures["temperature_min"] < COLD:
        yield f"the lowest temperature is {figures['temperature_min']:g} K"
    if count := figures["inward"]:
        called = f" ({names})" if (names := figures["inward_names"]) else ""
        yield (
            f"{count} model facet{'s face' if count > 1 else ' faces'} inward{called}; the back of "
            "a facet neither emits nor reflects: turn their normals outward"
        )
    for key, how in OVERLAPS:
        if count := figures[key]["count"]:
            a, b = (
                f"{facet} ({name})" if name else f"{facet}"
                for facet, name in zip(figures[key]["first"], figures[key]["names"])
            )
            more = f" ({count - 1} more pairs)" if count > 1 else ""
            yield (
                f"facets {a} and {b} lie {how} in one plane{more}; which of them is seen is left "
                "to rounding"
            )
