"""View factors between the groups of an OBJ of quadrilaterals, in pyviewfactor."""

from pathlib import Path

import numpy as np
import pyviewfactor
import pyvista


def run(case, effort, seed):
    points, names, cells, owners = [], [], [], []
    for word, *words in map(str.split, Path(case).read_text().splitlines()):
        if word == "v":
            points.append([float(number) for number in words])
        elif word == "o":
            names.append(words[0].partition("group=")[2])
        elif word == "f":
            a, b, _, d = (np.array(points[int(number) - 1]) for number in words)
            m, n = (max(1, round(effort * np.linalg.norm(end - a))) for end in (b, d))
            u, v = (b - a) / m, (d - a) / n
            lower = [a + i * u + j * v for i in range(m) for j in range(n)]
            cells += [(corner, corner + u, corner + u + v, corner + v) for corner in lower]
            owners += [names[-1]] * (m * n)
    corners = np.arange(4 * len(cells)).reshape(-1, 4)
    faces = np.insert(corners, 0, 4, axis=1).ravel()
    mesh = pyvista.PolyData(np.reshape(cells, (-1, 3)), faces)
    into = pyviewfactor.compute_viewfactor_matrix(mesh, obstacles=mesh.triangulate())
    area, groups = mesh.compute_cell_sizes()["Area"], list(dict.fromkeys(names))
    member = np.array([np.array(owners) == group for group in groups], float)
    factors = (member * area) @ into.T @ member.T / (member @ area)[:, None]
    return {
        f"{a} {b}": (factors[i, j], None)
        for i, a in enumerate(groups)
        for j, b in enumerate(groups)
    }
