"""Checks of a facet model: gaps, facets that face inward, facets that exist twice."""

import numpy as np
import scipy

from mi_lcair.coincident import TOLERANCE, overlaps, unique_rows
from mi_lcair.errors import option
from mi_lcair.models3d.model import Model
from mi_lcair.models3d.modellers.naming import TYPES

# Distance of a corner from the facet's mean plane, as a fraction of the facet's size, beyond which
# the facet counts as not planar.
NON_PLANAR = 1e-4


def triangle_areas(model: Model) -> np.ndarray:
    """Area (T,) of each triangle [m^2]."""
    a, b, c = _corners(model)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def signed_volumes(model: Model, edges: "Edges") -> np.ndarray:
    """Signed volume (F,) between each facet and the middle of the model [m^3].

    It is positive if the facet faces away from the middle. The volumes of a closed surface that
    faces outward add up to the volume inside. Openings count as closed: each open edge forms a
    triangle with the middle of the opening's rim, and the facet at that edge also gets the volume
    between the triangle and the middle of the model.
    """
    a, b, c = _corners(model)
    volumes = np.bincount(
        model.triangle_facet, np.einsum("tk,tk->t", a, np.cross(b, c)) / 6, model.count
    )
    start, end, facet = edges.rims()
    if len(start):
        rim, number = np.unique(np.concatenate([start, end]), return_inverse=True)
        start, end = number.reshape(2, -1)
        links = scipy.sparse.coo_array(
            (np.ones(len(start), bool), (start, end)), shape=(len(rim), len(rim))
        )
        openings, opening = scipy.sparse.csgraph.connected_components(links, directed=False)
        points = model.vertices[rim] - model.box.mean(axis=0)
        middle = (
            np.stack([np.bincount(opening, axis) for axis in points.T], axis=-1)
            / np.bincount(opening)[:, None]
        )
        lids = (
            np.einsum("ek,ek->e", points[end], np.cross(points[start], middle[opening[start]])) / 6
        )
        volumes += np.bincount(facet, lids, model.count)
    return volumes


def degenerate(model: Model) -> np.ndarray:
    """Mask (F,) of the facets without area: their corners coincide or lie on a line."""
    return np.bincount(model.triangle_facet, minlength=model.count) == 0


def non_planar(model: Model) -> np.ndarray:
    """Mask (F,) of the facets that are not planar.

    Their corners deviate from the mean plane by more than NON_PLANAR of the facet's size, and by
    more than the distance by which welding moves corners.
    """
    suspects = model.off_plane > TOLERANCE * np.ptp(model.box, axis=0).max()
    if suspects.any():
        points = model.vertices[model.corners]
        spans = np.maximum.reduceat(points, model.first[:-1]) - np.minimum.reduceat(
            points, model.first[:-1]
        )
        suspects &= model.off_plane > NON_PLANAR * np.linalg.norm(spans, axis=1)
    return suspects


def repeated(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Masks (F,) of the facets that have the same corners as an earlier facet.

    The first mask contains all of them, the second one only those that face the same way.
    """
    same_corners, same_facet = np.zeros(model.count, bool), np.zeros(model.count, bool)
    sizes = np.diff(model.first)
    for size in np.unique(sizes):
        facets = np.flatnonzero(sizes == size)
        polygons = model.corners[model.first[facets, None] + np.arange(size)]
        from_lowest = (np.argmin(polygons, axis=1)[:, None] + np.arange(size)) % size
        for mask, rows in (
            (same_corners, np.sort(polygons, axis=1)),
            (same_facet, np.take_along_axis(polygons, from_lowest, axis=1)),
        ):
            mask[facets] = True
            mask[facets[unique_rows(rows)[0]]] = False
    return same_corners, same_facet


class Edges:
    """The edges of some facets. A side belongs to one facet; sides of several share an edge.

    start, end: corners of each side, (H,). edge: number of the side's edge, (H,). facet: the facet
    of the side, (H,). forward: whether the side runs from the smaller to the larger corner number,
    (H,). uses: number of sides on each edge, (E,).
    """

    def __init__(self, model: Model, facets: np.ndarray):
        owner = np.repeat(np.arange(model.count), np.diff(model.first))
        following = np.arange(1, len(model.corners) + 1)
        following[model.first[1:] - 1] = model.first[:-1]
        start, end = model.corners, model.corners[following]
        listed = facets[owner] & (start != end)
        self.start, self.end, self.facet = start[listed], end[listed], owner[listed]
        self.forward = self.start < self.end
        key = np.minimum(self.start, self.end) * len(model.vertices) + np.maximum(
            self.start, self.end
        )
        _, self.edge, self.uses = np.unique(key, return_inverse=True, return_counts=True)

    def rims(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Start, end and facet of the sides at which a facet has no neighbour."""
        open_side = self.uses[self.edge] == 1
        return self.start[open_side], self.end[open_side], self.facet[open_side]

    def open(self) -> int:
        """Number of edges where a facet has no neighbour."""
        return int(np.count_nonzero(self.uses == 1))

    def neighbours(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of facets a and b that share an edge with no other facet, and whether they agree.

        Facets that face the same way run along their common edge in opposite directions.
        """
        sides = np.argsort(self.edge, kind="stable")
        first, second = sides[self.uses[self.edge[sides]] == 2].reshape(-1, 2).T
        return self.facet[first], self.facet[second], self.forward[first] != self.forward[second]


def inward_facets(model: Model, volumes: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Mask (F,) of the facets that face the wrong way.

    Facets that share an edge with one other facet belong to one surface. In a closed surface the
    facets that face inward are wrong. An open surface has no inside. There, the minority whose
    direction disagrees with the other facets is wrong. A Moebius strip has no wrong facets.

    Parameters
    ----------
    model : Model
    volumes : numpy.ndarray
        Signed volume of each facet, (F,) [m^3].
    facets : numpy.ndarray
        Mask (F,) of the facets to check.
    """
    edges = Edges(model, facets)
    a, b, agree = edges.neighbours()
    # Each facet f has a node f for "as it is" and a node f + F for "turned over". For facets that
    # agree, equal nodes are linked; for facets that disagree, "as it is" and "turned over" are.
    # A surface then has two components, which differ by turning all of its facets over.
    count = model.count
    other = np.where(agree, b, b + count)
    links = (np.concatenate([a, a + count]), np.concatenate([other, (other + count) % (2 * count)]))
    nodes = scipy.sparse.coo_array((np.ones(2 * len(a), bool), links), shape=(2 * count, 2 * count))
    number, component = scipy.sparse.csgraph.connected_components(nodes, directed=False)
    as_is, turned = component[:count], component[count:]
    surface = np.minimum(as_is, turned)
    side = np.where(as_is < turned, 1, -1)

    closed = np.ones(number, bool)
    unpaired = np.flatnonzero(edges.uses[edges.edge] != 2)
    surface_of_side = surface[edges.facet[unpaired]]
    _, edge_of_surface = unique_rows(np.stack([edges.edge[unpaired], surface_of_side], axis=1))
    closed[surface_of_side[np.bincount(edge_of_surface)[edge_of_surface] % 2 == 1]] = False
    volume = np.bincount(surface, side * volumes * facets, number)
    majority = np.bincount(surface, side * facets, number)
    right = np.where(closed, np.sign(volume), np.where(majority == 0, 1, np.sign(majority)))
    return side == -right[surface]


def _corners(model):
    """Corners (3, T, 3) of the triangles relative to the middle of the model [m]."""
    return np.moveaxis(model.vertices[model.triangles] - model.box.mean(axis=0), 1, 0)


# Figures that describe a facet model and its errors
# --------------------------------------------------

LONG_M = 500.0  # length of a model from which its unit is doubted
COLD = 200.0  # lower temperatures, K, are remarked because they are rare on a surface


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
    areas = np.bincount(model.triangle_facet, triangle_areas(model), model.count)
    duplicate, copy = repeated(model)
    edges = Edges(model, ~copy)
    volumes = np.where(copy, 0, signed_volumes(model, edges))
    facets = {TYPES[kind]: model.facets_of(kind) for kind in TYPES}
    material = np.array([label.material for label in model.labels])[model.label]
    inward = inward_facets(model, volumes, facets["model"] & ~copy)
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
        "degenerate": np.count_nonzero(degenerate(model)),
        "duplicate": np.count_nonzero(duplicate),
        "non_planar": np.count_nonzero(non_planar(model)),
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
                f"material {material} reflects all radiation and emits nothing: its facets show "
                "only reflections; use a material that absorbs, such as blackbody, for facets "
                "that should emit"
            )
    if (longest := np.ptp(figures["bounding_box"], axis=0).max()) > LONG_M:
        yield (
            f"the model is {longest:.4g} m long; a file in millimetres needs "
            f"{option('scale', 0.001)}"
        )
    if figures["temperature_min"] < COLD:
        yield f"the lowest temperature is {figures['temperature_min']:g} K"
    if count := figures["inward"]:
        called = f" ({names})" if (names := figures["inward_names"]) else ""
        yield (
            f"{count} model facet{'s face' if count > 1 else ' faces'} inward{called}; the back of "
            "a facet neither emits nor reflects: turn their normals outward"
        )
    pairs = figures["one_on_the_other"]
    if count := pairs["count"]:
        a, b = (
            f"{facet} ({name})" if name else f"{facet}"
            for facet, name in zip(pairs["first"], pairs["names"])
        )
        more = f" ({count - 1} more pairs)" if count > 1 else ""
        yield (
            f"facets {a} and {b} overlap in one plane{more}; which of them is seen is left to "
            "rounding"
        )
