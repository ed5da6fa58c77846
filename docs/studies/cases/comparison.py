"""What a case returns, and scenes and tables that cases share."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair import models3d
from mi_lcair.files import replacing

DATA = Path(__file__).with_name("data")


@dataclass(frozen=True)
class Comparison:
    """Computed and reference values of a case, with the half widths of stated 95 % intervals.

    title: in the table. unit: of the values. computed, reference: (n,). half_width: (n,), of the
    computed values, or of their difference from the reference; NaN where none is stated. reach: the
    largest rms that the case may have. note: a sentence below the table.
    """

    title: str
    unit: str
    computed: np.ndarray
    reference: np.ndarray
    half_width: np.ndarray | float = np.nan
    reach: float = np.inf
    note: str = ""

    @property
    def residual(self) -> np.ndarray:
        return np.asarray(self.computed, float) - np.asarray(self.reference, float)

    @property
    def inside(self) -> float:
        """Share of the values inside their interval; NaN if none is stated."""
        half = np.broadcast_to(self.half_width, self.residual.shape)
        return float(np.mean(abs(self.residual) <= half)) if np.isfinite(half).all() else np.nan

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def bias(self) -> float:
        return float(np.mean(self.residual))

    @property
    def width(self) -> float:
        """Mean width of the intervals."""
        return float(2 * np.mean(self.half_width))

    @property
    def row(self) -> str:
        """The case's row of the page."""
        share = "" if np.isnan(self.inside) else f"{self.inside:.1%}"
        width = "" if np.isnan(self.inside) else f"{self.width:.3g}"
        cells = share, f"{self.rms:.2g}", f"{self.bias:+.2g}", width, self.unit
        size = len(self.residual)
        return f"| {self.title} | {size} | {' | '.join(cells)} |"


def columns(name: str) -> dict[str, np.ndarray]:
    """The columns of a file of data, texts or numbers; lines with # are comments."""
    lines = [
        line for line in (DATA / name).read_text(encoding="utf-8").splitlines() if line[0] != "#"
    ]
    rows = list(csv.DictReader(lines))
    result = {}
    for key in rows[0]:
        values = [row[key] for row in rows]
        try:
            result[key] = np.array([float(value) if value else np.nan for value in values])
        except ValueError:
            result[key] = np.array(values)
    return result


def write_rows(path: Path, values: dict[str, np.ndarray]) -> None:
    """Write a CSV of columns."""
    lines = [
        ",".join(values),
        *(",".join(f"{x:.10g}" for x in row) for row in zip(*values.values())),
    ]
    with replacing(path) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")


def plane(folder: Path) -> str:
    """The scene of a level square, the group `ground`, below the open sky."""
    grey = "".join(
        f'[ground."{band}"]\nmodel = "grey"\nemissivity = 0.95\n'
        for band in ("total", "0.3-2.5", "LWIR")
    )
    (folder / "ground.toml").write_text(grey)
    square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\no f*ground*280*group=ground\nf 1 2 3 4\n"
    (folder / "ground.obj").write_text(square)
    of = {"materials": folder / "ground.toml"}
    models3d.export(models3d.read(folder / "ground.obj", **of), folder / "ground", **of)
    return str(folder / "ground" / "scene.xml")
