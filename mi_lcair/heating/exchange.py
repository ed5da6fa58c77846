"""Exchange of heat between the facets of a scene, from paths that begin on the facets."""

from collections.abc import Mapping
from time import perf_counter

import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.errors import InputError
from mi_lcair.heating import surfaces
from mi_lcair.heating.conductors import Conductors, Facets, Traced, standard_error
from mi_lcair.heating.exchange_result import Asymmetry, Exchange
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.scene import Scene

RAYS = 1024  # paths of each side of a facet
MOST_LOST = 1e-3  # share of a group's radiation that may end on backs and passive surfaces


def combined(means: surfaces.Means, facets: Facets, rays: int) -> Traced:
    """Conductors from the areas [m^2] by which facets absorb what others emit.

    Paths of facet i estimate GR_ij with a variance that is proportional to its area A_i, (n,). The
    two directions of each pair are therefore combined with weights 1 / A, which do not depend on
    the outcome:

        GR_ij = (A_j G_ij + A_i G_ji) / (A_i + A_j)
    """
    replicates, area = [], facets.radiating_area
    for G, ends in zip(means.between, means.ends):
        i, j = (G := sparse.coo_array(G)).coords
        half = sparse.csr_array((G.data * area[j] / (area[i] + area[j]), (i, j)), shape=G.shape)
        replicates.append(
            Conductors(half + half.T, ends[:, : surfaces.RINGS], ends[:, surfaces.RINGS])
        )
    return Traced(tuple(replicates), facets.area * facets.emissivity / rays)


def asymmetry_of(means: surfaces.Means, facets: Facets, rays: int) -> Asymmetry:
    """How much the two directions differ. rays: number of paths of each side of a facet."""
    M = facets.membership
    one_way = np.array([(M @ G @ M.T).toarray() for G in means.between])
    difference = one_way - np.swapaxes(one_way, 1, 2)
    # The scatter cannot see pairs that no path connected, so one path's weight is added
    one_path = (M * facets.area).max(axis=1).toarray() / rays
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
    emissivities: Mapping[str, float] = {},
) -> Exchange:
    """The exchange of heat between the facets of a scene; see `mi_lcair.exchange`.

    toward_sun: unit vector, (3,); None without sunlight. emissivities: those of groups, in place of
    their materials.
    """
    began = perf_counter()
    paths = surfaces.FacetPaths(scene, surfaces.Surfaces.of(scene, surfaces.TOTAL, emissivities))
    facets = facets_of(paths)
    points = surfaces.points_of(rays)
    means = paths.means(points, seed).sums(paths.areas)
    astray = {name: means.end(name) / facets.emitting_area for name in surfaces.ENDS[1:]}
    check_lost(facets, astray["lost"], paths.shapes[int(means.lost.argmax())], scene.name)
    asymmetry = asymmetry_of(means, facets, points * surfaces.RANDOMISATIONS)
    remarks = [*paths.surfaces.remarks, *remarks_on_asymmetry(asymmetry, facets)]
    truncated = facets.share_of_groups(astray["truncated"])
    if truncated.max() > MOST_LOST:
        remarks.append(
            f"group {facets.groups[int(truncated.argmax())]}: {truncated.max():.1%} of its "
            f"radiation is left after {surfaces.MOST_REFLECTIONS} reflections and is lost"
        )
    sun = None
    if toward_sun is not None:
        sun = surfaces.solar_areas(scene, toward_sun[None], rays, rays, seed)
        remarks += sun.remarks
    in_facets = np.isin(paths.table.triangle_facet, facets.number)
    return Exchange(
        scene_name=scene.name,
        facets=facets,
        traced=combined(means, facets, points * surfaces.RANDOMISATIONS),
        temperature=paths.table.temperature[facets.number],
        sky_K=sky_K,
        ground_K=ground_K,
        astray=astray,
        asymmetry=asymmetry,
        sun=sun,
        triangles=paths.table.triangles[in_facets],
        triangle_facet=paths.table.triangle_facet[in_facets],
        rays=points * surfaces.RANDOMISATIONS,
        seed=seed,
        seconds=perf_counter() - began,
        remarks=tuple(dict.fromkeys(remarks)),
    )


def facets_of(paths: surfaces.FacetPaths) -> Facets:
    """The facets on which paths begin."""
    table, number = paths.table, paths.number
    groups, group = np.unique(table.group[number].astype(str), return_inverse=True)
    return Facets(
        number=number,
        area=table.area[number],
        sides=paths.of_facets(lambda surface: len(surface.sides)),
        groups=tuple(groups.tolist()),
        group=group,
        material=table.material[number].astype(str),
        emissivity=paths.of_facets(
            lambda surface: surfaces.hemispherical_emissivity(surface).mean()
        ),
    )


def check_lost(facets: Facets, lost: np.ndarray, shape: mi.Shape, name: str) -> None:
    """Raise InputError if too much of a group's radiation ends where nothing takes part.

    lost: shares of the facets, (n,). shape: where most is lost. name: of the scene.
    """
    share = facets.share_of_groups(lost)
    worst = int(share.argmax())
    if share[worst] <= MOST_LOST:
        return
    why = (
        "its BSDF is one-sided and rays hit it from behind; make it `twosided` or close the mesh"
        if is_thermal(shape.emitter())
        else 'it does not emit; give it <emitter type="thermal">'
    )
    raise InputError(
        f"{name}: {share[worst]:.2%} of the radiation of group {facets.groups[worst]} ends on "
        f"surfaces that do not take part in the exchange, most on shape '{shape.id()}': {why}"
    )


def remarks_on_asymmetry(asymmetry: Asymmetry, facets: Facets) -> list[str]:
    """Remarks on conductors between groups whose two directions differ."""
    return [
        f"the exchange between {facets.groups[a]} and {facets.groups[b]} differs by "
        f"{asymmetry.relative[a, b]:.1%} between the two directions (z = "
        f"{asymmetry.z[a, b]:.1f}), because a reflection model is not reciprocal; their mean is "
        "used, and its error includes half of the difference"
        for a, b in np.argwhere(asymmetry.is_certain)
    ]
