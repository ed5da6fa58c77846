"""The facets of a loaded scene as a model, for pictures and files of its geometry."""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.models3d.label import Label
from mi_lcair.models3d.model import Model
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene

TYPES = {"model": "f", "sky": "s", "terrain": "t"}  # letters of labels


def model_of(scene: Scene) -> Model:
    """The facets of a scene's meshes as a `Model`, in the scene's axes.

    Shapes that are not meshes have no facets. Raises InputError if the scene has no mesh.
    """
    table = FacetTable(scene)
    if not len(table.triangles):
        raise InputError(f"{scene.name}: has no mesh that could be drawn")
    vertices, corners = np.unique(table.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    numbers, facet = np.unique(table.triangle_facet, return_inverse=True)
    kinds = [(TYPES[table.type[k]], str(table.material[k]), str(table.group[k])) for k in numbers]
    order = np.argsort(facet, kind="stable")
    labels = list(dict.fromkeys(kinds))
    place = {kind: number for number, kind in enumerate(labels)}
    return Model(
        vertices=vertices,
        corners=corners.reshape(-1, 3)[order].ravel(),
        first=3 * np.searchsorted(facet[order], np.arange(len(numbers) + 1)),
        labels=[Label(kind, material, None, group) for kind, material, group in labels],
        label=np.array([place[kind] for kind in kinds]),
        temperature=table.temperature[numbers],
        triangles=corners.reshape(-1, 3),
        triangle_facet=facet,
        off_plane=np.zeros(len(numbers)),
    )
