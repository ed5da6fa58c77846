"""Exchange of heat between the facets of a scene, from paths that begin on the facets."""

from time import perf_counter

import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import Conductors, Facets, Traced, standard_error, weighted
from mi_lcair.heating.exchange_result import Asymmetry, Exchange
from mi_lcair.heating.paths import ENDS, RANDOMISATIONS, RINGS, FacetPaths, Means, points_of
from mi_lcair.heating.sunlight import Sunlight
from mi_lcair.heating.surfaces import TOTAL, Surfaces, hemispherical_emissivity
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.scene import Scene

RAYS = 1024  # paths of each facet
MOST_LOST = 1e-3  # share of a group's radiation that may end on backs and passive surfaces
ASYMMETRY, SIGNIFICANT = 0.01, 4.0  # relative difference of two directions and its z for a remark


def combined(means: Means, area: np.ndarray) -> Traced:
    """Conductors from the means of paths of facets with these areas of their sides [m^2], (n,).

    Paths of facet i estimate GR_ij with a variance that is proportional to A_i. The two directions
    of each pair are therefore combined with weights 1 / A, which do not depend on the outcome:

        GR_ij = (g_ij + g_ji) A_i A_j / (A_i + A_j)
    """
    replicates = []
    for g, ends in zip(means.between, means.ends):
        both = sparse.coo_array(g + g.T)
        i, j = both.coords
        values = both.data * area[i] * area[j] / (area[i] + area[j])
        apart = i != j
        between = (values[apart], (i[apart], j[apart]))
        replicates.append(
            Conductors(
                sparse.csr_array(between, shape=both.shape),
                area[:, None] * ends[:, :RINGS],
                area * ends[:, RINGS + ENDS.index("ground")],
                area * g.diagonal(),
            )
        )
    return Traced(
        weighted(replicates, np.full(len(replicates), 1 / len(replicates))), tuple(replicates)
    )


def asymmetry_of(means: Means, facets: Facets, rays: int) -> Asymmetry:
    """How much the two directions differ. rays: number of paths of each facet."""
    M, A = facets.membership, facets.radiating_area
    one_way = np.array([(M @ (g * A[:, None]) @ M.T).toarray() for g in means.between])
    difference = one_way - np.swapaxes(one_way, 1, 2)
    # A large facet may have met a small one with no path, of which the scatter knows nothing
    one_path = np.array([A[facets.group == k].max() for k in range(len(facets.groups))]) / rays
    unmet = np.hypot(one_path[:, None], one_path)
    mean, error = difference.mean(axis=0), np.hypot(standard_error(difference), unmet)
    both = one_way.mean(axis=0)
    both = (both + both.T) / 2
    relative = np.divide(mean, both, out=np.zeros_like(mean), where=both > 0)
    return Asymmetry(relative, mean / error)


def exchange(
    scene: Scene,
    rays: int = RAYS,
    seed: int = 0,
    *,
    sky_K: float | None = None,
    ground_K: float | None = None,
    toward_sun: np.ndarray | None = None,
) -> Exchange:
    """The exchange of heat between the facets of a scene; see `mi_lcair.exchange`.

    toward_sun: unit vector, (3,); None without sunlight.
    """
    began = perf_counter()
    surfaces = Surfaces.of(scene, TOTAL)
    paths = FacetPaths(scene, surfaces)
    facets = facets_of(paths)
    points = points_of(rays)
    means = paths.means(points, seed)
    emissivity = np.maximum(facets.emissivity, np.finfo(float).tiny)

    def share(*names):
        return sum(means.end(name).mean(axis=0) for name in names) / emissivity

    lost = share("backs", "passive")
    check_lost(facets, lost, means.lost, paths)
    asymmetry = asymmetry_of(means, facets, points * RANDOMISATIONS)
    remarks = [*surfaces.remarks, *remarks_on_asymmetry(asymmetry, facets)]
    sun = absorptance = None
    if toward_sun is not None:
        sunlight = Sunlight(scene, rays, seed)
        sun, absorptance = sunlight.areas(toward_sun[None], rays), sunlight.absorptance
        remarks += sunlight.remarks
    in_facets = np.isin(paths.table.triangle_facet, facets.number)
    return Exchange(
        scene_name=scene.name,
        facets=facets,
        traced=combined(means, facets.radiating_area),
        temperature=paths.table.temperature[facets.number],
        sky_K=sky_K,
        ground_K=ground_K,
        buried=share("buried"),
        truncated=share("truncated"),
        lost=lost,
        asymmetry=asymmetry,
        sun=sun,
        absorptance=absorptance,
        triangles=paths.table.triangles[in_facets],
        triangle_facet=paths.table.triangle_facet[in_facets],
        rays=points * RANDOMISATIONS,
        seed=seed,
        seconds=perf_counter() - began,
        remarks=tuple(remarks),
    )


def facets_of(paths: FacetPaths) -> Facets:
    """The facets on which paths begin. Raises InputError if there are none."""
    table, number = paths.table, paths.number
    if not len(number):
        raise InputError(f"{paths.scene.name}: no surface emits, so that no heat is exchanged")
    groups, group = np.unique(table.group[number].astype(str), return_inverse=True)
    surfaces = paths.surfaces.different
    emissivity = np.array([hemispherical_emissivity(surface) for surface in surfaces])
    of_facet = np.array(paths.surfaces.of_shape)[table.shape_index[number]]
    return Facets(
        number=number,
        area=table.area[number],
        sides=paths.sides,
        centre=table.centre[number],
        normal=table.normal[number],
        groups=tuple(groups.tolist()),
        group=group,
        material=table.material[number].astype(str),
        emissivity=emissivity[of_facet],
        is_diffuse=np.array([surface.is_diffuse for surface in surfaces])[of_facet],
    )


def check_lost(facets: Facets, lost, of_shapes, paths: FacetPaths) -> None:
    """Raise InputError if too much of a group's radiation ends where nothing takes part."""
    sent = facets.radiating_area * facets.emissivity
    M = facets.membership
    share = (M @ (lost * sent)) / np.maximum(M @ sent, np.finfo(float).tiny)
    worst = int(share.argmax())
    if share[worst] <= MOST_LOST:
        return
    shape = paths.shapes[int(of_shapes.argmax())]
    why = (
        "its BSDF is one-sided and is met from behind; make it `twosided` or close the mesh"
        if is_thermal(shape.emitter())
        else 'it does not emit; give it <emitter type="thermal">'
    )
    raise InputError(
        f"{paths.scene.name}: {share[worst]:.2%} of the radiation of group "
        f"{facets.groups[worst]} ends on surfaces that take no part in the exchange, most on shape "
        f"'{shape.id()}': {why}"
    )


def remarks_on_asymmetry(asymmetry: Asymmetry, facets: Facets) -> list[str]:
    """Remarks on conductors between groups whose two directions differ."""
    differs = (asymmetry.relative > ASYMMETRY) & (asymmetry.z > SIGNIFICANT)
    return [
        f"the exchange between {facets.groups[a]} and {facets.groups[b]} differs by "
        f"{asymmetry.relative[a, b]:.1%} between the two directions (z = {asymmetry.z[a, b]:.1f}), "
        "because a reflection model is not reciprocal; their mean is used"
        for a, b in np.argwhere(differs)
    ]
