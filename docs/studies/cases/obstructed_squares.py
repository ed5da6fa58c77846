"""Two squares with and without a sheet between them; closed forms of their view factors.

The sheet has two sides, or is a pair of one-sided squares in one plane, back to back, which must
give the same.
"""

import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison, columns
from docs.studies.cases.l_room import factors
from mi_lcair import models3d

RAYS = 2**16
SQUARES = {  # side, height, and whether it faces up
    "low": (1.0, 0.0, True),
    "high": (1.0, 1.0, False),
    "sheet_up": (0.5, 0.5, True),
    "sheet_down": (0.5, 0.5, False),
}


def scene_of(folder: Path, names) -> str:
    """The scene of some of the squares."""
    lines, count = [], 0
    for name in names:
        side, z, is_up = SQUARES[name]
        lines += [f"v {x} {y} {z}" for x, y in ((0, 0), (side, 0), (side, side), (0, side))]
        order = (1, 2, 3, 4) if is_up else (4, 3, 2, 1)
        lines += [f"o f*blackbody*300*group={name}"]
        lines += ["f " + " ".join(str(count + k) for k in order)]
        count += 4
    (folder / "squares.obj").write_text("\n".join(lines) + "\n")
    models3d.export(models3d.read(folder / "squares.obj"), folder / "squares")
    return str(folder / "squares" / "scene.xml")


def compare() -> Comparison:
    """The exact pairs without a sheet, and with the pair of squares."""
    data = columns("obstructed_squares.csv")
    cases = {"none": ["low", "high"], "pair": list(SQUARES)}
    computed, half, reference = [], [], []
    for case, names in cases.items():
        mine = data["case"] == case
        groups = list(zip(data["from"][mine], data["to"][mine]))
        keep = [
            k for k, pair in enumerate(groups) if set(pair) <= set(names) and pair[0] != pair[1]
        ]
        with tempfile.TemporaryDirectory() as folder:
            scene = mi_lcair.load(scene_of(Path(folder), names))
            values, widths = factors(
                mi_lcair.exchange(scene, paths=RAYS), [groups[k] for k in keep]
            )
        computed.append(values)
        half.append(widths + 1e-9)
        reference.append(data["F"][mine][keep])
    arrays = map(np.concatenate, (computed, reference, half))
    return Comparison("Obstructed squares, view factors", "1", *arrays, reach=1e-3)
