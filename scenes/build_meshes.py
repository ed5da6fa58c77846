"""Build the meshes of the bundled scenes.

`python -m mi_lcair.scenes.build_meshes` writes meshes/*.ply. Lengths are in m. Corners run
anticlockwise as seen from the side that emits and reflects; the face normal points to that side.
Each triangle carries the number of its facet. The files depend only on this script.
"""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent / "meshes"

CAVITY_RADIUS = 0.5  # m, thesis 3.2.3.1
ROWS = COLUMNS = 20  # numbers of facets of the sphere from pole to pole and around its axis

# Facets removed -> (rows, columns) of the block that they form. The block is centred on the equator
# (thesis Table B.1).
OPENINGS = {
    2: (2, 1),
    4: (2, 2),
    8: (4, 2),
    16: (4, 4),
    24: (6, 4),
    36: (6, 6),
    60: (10, 6),
    80: (10, 8),
}


def rectangle(corner, along, across):
    """Return the vertices (4, 3) and the single facet of a rectangle.

    corner: one corner. along, across: the edges that start there, as vectors. The normal points
    along the cross product of `along` and `across`.
    """
    corner, along, across = (np.array(vector, float) for vector in (corner, along, across))
    return np.array([corner, corner + along, corner + along + across, corner + across]), [
        (0, 1, 2, 3)
    ]


def box(size, inward=False):
    """Return the vertices (8, 3) and the six facets of a closed box about the origin.

    size: (3,) lengths of the edges. inward: whether the normals point inward.
    """
    vertices = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * np.array(size, float)
    facets = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, facing(facets, inward)


def sphere(radius, opening=(0, 0), inward=False):
    """Return vertices and facets of a sphere of ROWS x COLUMNS facets.

    Meridians and parallels divide the sphere. The poles are on the z axis. Facets are plane
    trapezia, those at the poles triangles. `opening` (rows, columns) is a block of facets that is
    left out. Its middle lies on the +x axis. For this the first meridian is the edge of the block,
    half a block before +x.
    """
    open_rows, open_columns = opening
    colatitudes = np.pi * np.arange(1, ROWS) / ROWS
    longitudes = 2 * np.pi * (np.arange(COLUMNS) - open_columns / 2) / COLUMNS
    rings = [
        (
            np.sin(colatitude) * np.cos(longitude),
            np.sin(colatitude) * np.sin(longitude),
            np.cos(colatitude),
        )
        for colatitude in colatitudes
        for longitude in longitudes
    ]
    vertices = radius * np.array([(0, 0, 1), *rings, (0, 0, -1)])
    top_pole, bottom_pole = 0, len(vertices) - 1

    def ring(row, column):
        return 1 + (row - 1) * COLUMNS + column % COLUMNS

    facets = []
    for row in range(ROWS):
        for column in range(COLUMNS):
            if abs(row + 0.5 - ROWS / 2) < open_rows / 2 and column < open_columns:
                continue
            if row == 0:
                facets.append((top_pole, ring(1, column), ring(1, column + 1)))
            elif row == ROWS - 1:
                facets.append((ring(row, column), bottom_pole, ring(row, column + 1)))
            else:
                facets.append(
                    (
                        ring(row, column),
                        ring(row + 1, column),
                        ring(row + 1, column + 1),
                        ring(row, column + 1),
                    )
                )
    return vertices, facing(facets, inward)


def facing(facets, inward):
    """Return facets with outward normals as they are, or reversed if `inward`."""
    return [facet[::-1] for facet in facets] if inward else facets


def triangles(facets):
    """Return the triangles (n, 3) of the facets, and the number of the facet of each, (n,).

    Each facet becomes a fan of triangles about its first corner.
    """
    fans = [
        ((facet[0], facet[k], facet[k + 1]), number)
        for number, facet in enumerate(facets)
        for k in range(1, len(facet) - 1)
    ]
    corners, numbers = zip(*fans)
    return np.array(corners), np.array(numbers)


def meshes():
    """Return all bundled meshes: file name -> (vertices in m, facets)."""
    return {
        # The reflector's short edge and the emitter's foot share x = 0; they face +z and +x.
        "two_plates_reflector.ply": rectangle((0, -0.05, 0), (0.2, 0, 0), (0, 0.1, 0)),
        "two_plates_emitter.ply": rectangle((0, -0.05, 0), (0, 0.1, 0), (0, 0, 0.2)),
        # The floor's long edge and the wall's foot share y = 0; they face +z and +y.
        "open_box_floor.ply": rectangle((-0.1, 0, 0), (0.2, 0, 0), (0, 0.1, 0)),
        "open_box_wall.ply": rectangle((-0.1, 0, 0), (0, 0, 0.1), (0.2, 0, 0)),
        **{
            f"cavity_{facets}.ply": sphere(CAVITY_RADIUS, block, inward=True)
            for facets, block in OPENINGS.items()
        },
        "furnace_room.ply": box((2, 2, 2), inward=True),
        "furnace_slab.ply": box((0.7, 0.04, 0.7)),
        "furnace_sphere.ply": sphere(0.2),
    }


def ply(vertices, facets) -> bytes:
    """Return the binary PLY file of a mesh, without vertices that no facet uses.

    Mitsuba reads the face property facet_0 as the mesh attribute `face_facet`. It must be a float.
    """
    corners, numbers = triangles(facets)
    used, corners = np.unique(corners, return_inverse=True)
    # The last bits of sine and cosine differ between processors. Rounding to 1 nm removes them.
    # Adding 0.0 turns -0 into 0.
    points = (np.round(vertices[used], 9) + 0.0).astype("<f4")
    faces = np.empty(len(numbers), dtype=[("count", "u1"), ("corners", "<i4", 3), ("facet", "<f4")])
    faces["count"] = 3
    faces["corners"] = corners.reshape(-1, 3)
    faces["facet"] = numbers
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment mi_lcair scenes/build_meshes.py, metres\n"
        f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
        "property float facet_0\nend_header\n"
    )
    return header.encode() + points.tobytes() + faces.tobytes()


def main():
    FOLDER.mkdir(exist_ok=True)
    for name, (vertices, facets) in meshes().items():
        (FOLDER / name).write_bytes(ply(vertices, facets))


if __name__ == "__main__":
    main()
