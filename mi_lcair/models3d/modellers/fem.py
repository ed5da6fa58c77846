"""Temperatures of facets from a mesh of another program, such as a FEM model."""

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.files import check_file

SUFFIXES = (".vtu", ".vtk", ".med", ".inp", ".msh", ".xdmf", ".e")  # that meshio reads
WORDS = ("temp", "kelvin", "nt11")  # in the names of temperatures; NT11 is that of Abaqus


def temperatures_of_mesh(
    path: Path, polygons: list[np.ndarray]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Temperatures of facets from the cells or the nodes of a mesh [K], (F,).

    A facet has the temperature of the nearest cell, or the mean over its corners of the nearest
    nodes.

    Parameters
    ----------
    path : Path
        File that meshio reads, in metres, with one temperature of each cell or node.
    polygons : list of ndarray
        Corners of each facet [m], (corners, 3).

    Returns
    -------
    kelvin : ndarray
    remarks : tuple of str
        A line if a facet is farther from the mesh than it is large.

    Raises
    ------
    InputError
        If the file cannot be read, or has no temperatures or several.
    """
    meshio = optional("meshio", f"temperatures {path}")
    check_file(path)
    try:
        mesh = meshio.read(path)
    except (SystemExit, Exception) as error:  # meshio ends the program for some files
        raise InputError(f"temperatures {path}: cannot be read: {error}") from None
    cells = {name: np.concatenate([*map(np.ravel, of)]) for name, of in mesh.cell_data.items()}
    nodes = {name: np.ravel(values) for name, values in mesh.point_data.items()}
    named = [
        (values, is_node)
        for is_node, data in ((False, cells), (True, nodes))
        for name, values in data.items()
        if any(word in name.lower() for word in WORDS)
    ]
    if len(named) != 1:
        names = ", ".join([*cells, *nodes]) or "none"
        raise InputError(
            f"temperatures {path}: needs one field of cells or nodes whose name has "
            f"{' or '.join(WORDS)}; its fields are {names}"
        )
    ((values, of_nodes),) = named
    points = mesh.points @ np.eye(mesh.points.shape[1], 3)
    if of_nodes:
        places, count = np.concatenate(polygons), [len(polygon) for polygon in polygons]
    else:
        points = np.concatenate([points[block.data].mean(axis=1) for block in mesh.cells])
        places, count = np.array([polygon.mean(axis=0) for polygon in polygons]), 1
    apart, nearest = cKDTree(points).query(places)
    facet = np.repeat(np.arange(len(polygons)), count)
    kelvin = np.bincount(facet, values[nearest]) / np.bincount(facet)
    size = np.array([np.ptp(polygon, axis=0).max() for polygon in polygons])
    worst = int(np.argmax(apart - size[facet]))
    if apart[worst] <= size[facet[worst]]:
        return kelvin, ()
    return kelvin, (
        f"{path}: facet {facet[worst]} takes the temperature of a place {apart[worst]:.3g} m away, "
        "farther than its size; check the units and the axes of the mesh",
    )
