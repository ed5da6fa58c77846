"""View factors between the groups of an OBJ of quadrilaterals, in mi_lcair."""

import subprocess
import tempfile
from functools import cache

import mi_lcair


@cache
def scene_of(path):
    folder = tempfile.mkdtemp()
    command = ["mi-lcair", "import", path, "-o", folder, "--overwrite"]
    subprocess.run(command, check=True, capture_output=True)
    return mi_lcair.load(folder)


def run(case, effort, seed):
    result = mi_lcair.exchange(scene_of(case), paths=effort, seed=seed)
    area, groups = result.facets.membership @ result.facets.area, result.facets.groups
    between, error = result.between_groups()
    return {
        f"{a} {b}": (between[i, j] / area[i], error[i, j] / area[i])
        for i, a in enumerate(groups)
        for j, b in enumerate(groups)
    }
