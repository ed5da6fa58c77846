"""Table and picture of a facet's radiance against samples (thesis Fig 3.21)."""

from pathlib import Path

from mi_lcair.benchmark.facet_radiance import FacetRadiance
from mi_lcair.drawing import drawing, plain
from mi_lcair.formats import csv


def write(folder: Path, result: FacetRadiance) -> None:
    """Write facet.csv and facet.png to a folder."""
    names = ("even", "stratified")
    columns = {f"{name}_W_m2_sr": getattr(result, name) for name in names}
    csv.write(folder / "facet.csv", {"samples_per_dimension": result.samples} | columns)
    with drawing(folder / "facet.png", (7, 4), dpi=120, layout="constrained") as figure:
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
