"""Compute the radiance of one facet with ever more samples of its hemisphere (thesis 3.3.4).

    python -m benchmarks.facet_radiance [--quick] [-o FOLDER]

It is a facet at the wing root of cylinder_ir_range (thesis Fig 3.21). Printed and written are
radiances in W m^-2 sr^-1 by an even grid and by one that is fine about the mirror direction.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from benchmarks import command
from benchmarks.methods.propagation.hemisphere_grid import Hemisphere
from benchmarks.methods.propagation.problem import emitted
from benchmarks.methods.propagation.quadrature import reflected, stratified, summed
from mi_lcair import formats
from mi_lcair.drawing import drawing, plain
from mi_lcair.errors import InputError
from mi_lcair.progress import Progress, stepper
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.window import window

SCENE, FACET = "cylinder_ir_range", 482  # a facet at the wing root, see validation/ir_range.md
FINEST = 4**11  # cells of the grid that gives the reference
HIT = 1e-4  # largest distance of the hit from the facet's centre, as a share of the scene's size


@dataclass(frozen=True)
class FacetRadiance:
    """Radiance of a facet's centre toward the sensor, with one reflection, W m^-2 sr^-1.

    samples: per dimension, the square root of the number of cells over two. even, stratified: by
    the two grids. reference: by the stratified grid with FINEST cells.
    """

    scene_name: str
    facet: int
    samples: np.ndarray
    even: np.ndarray
    stratified: np.ndarray
    reference: float


def facet_radiance(
    samples: list[int],
    progress: Progress | None = None,
    scene: str = SCENE,
    facet: int = FACET,
    **parameters: object,
) -> FacetRadiance:
    """Radiance of a facet for some numbers of samples per dimension.

    Raises InputError if the sensor does not see the middle of the facet.
    """
    loaded = load(scene, **parameters)
    table, step = FacetTable(loaded), stepper(progress, 2 * len(samples) + 1)
    corner, _, _, direction = window(loaded.sensor(0))
    size = np.ptp(table.triangles.reshape(-1, 3), axis=0).max()
    centre = table.centre[facet]
    with loaded.prepared() as tracer, dr.suspend_grad():
        start = centre - (centre - corner) @ direction * direction  # on the sensor
        ray = mi.Ray3f(*(mi.Point3f(np.float32(place)) for place in (start, direction)))
        si = loaded.mi.ray_intersect(ray)
        if not np.linalg.norm(np.array(si.p).ravel() - centre) < HIT * size:
            raise InputError(f"{loaded.name}: the sensor does not see the middle of facet {facet}")
        emission = summed(emitted(si, loaded.mi))

        def radiance(grid):
            step()
            return emission + reflected(loaded.mi, tracer.emitters, grid, si, mi.Float(1), 1)[0]

        return FacetRadiance(
            scene_name=loaded.name,
            facet=facet,
            samples=np.array(samples),
            even=np.array([radiance(Hemisphere(n)) for n in samples]),
            stratified=np.array([radiance(stratified(2 * n**2)) for n in samples]),
            reference=radiance(stratified(FINEST)),
        )


def write(folder: Path, result: FacetRadiance) -> None:
    """Write facet_radiance.csv and facet_radiance.png to a folder."""
    names = ("even", "stratified")
    columns = {f"{name}_W_m2_sr": getattr(result, name) for name in names}
    formats.write_csv(
        folder / "facet_radiance.csv", {"samples_per_dimension": result.samples} | columns
    )
    with drawing(folder / "facet_radiance.png", (7, 4), dpi=120, layout="constrained") as figure:
        axes = figure.subplots()
        for name, label in zip(
            names, ("even grid", "grid that is fine about the mirror direction")
        ):
            axes.plot(result.samples, getattr(result, name), ".-", label=label)
        axes.axhline(result.reference, color="0.5", linewidth=1, label="finest grid")
        axes.set(
            xlabel="samples per dimension",
            ylabel="radiance, one reflection (W m⁻² sr⁻¹)",
            title=plain(f"{result.scene_name}, facet {result.facet}"),
        )
        axes.legend()


def measured(quick: bool, progress: Progress) -> FacetRadiance:
    """The radiance by grids of 20 to 400 samples per dimension."""
    return facet_radiance(list(range(20, 401, 60 if quick else 10)), progress)


def printed(result: FacetRadiance) -> tuple:
    """JSON, table and note of a result."""
    rows = zip(result.samples, result.even, result.stratified)
    note = f"finest grid: {result.reference:.5g}"
    return asdict(result), command.cells(["samples", "even", "stratified"], rows), note


def main(arguments: list[str] | None = None) -> None:
    """Measure, write the files and print a table."""
    command.run("facet_radiance", __doc__, measured, write, printed, arguments)


if __name__ == "__main__":
    main()
