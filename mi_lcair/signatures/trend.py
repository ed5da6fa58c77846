"""Rows of a trend: intensities of a scene's model toward many views, and their parts."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.extras import optional
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import View
from mi_lcair.signatures.many_views import totals_of_views

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class TrendRows:
    """Columns of a trend by name, (V,) each, see `Trend.table`."""

    table: dict[str, np.ndarray]

    kind = "trend_rows"

    @staticmethod
    def joined(parts: list["TrendRows"]) -> "TrendRows":
        """The rows of several sets of views of the same scene as one."""
        return TrendRows(
            {name: np.concatenate([part.table[name] for part in parts]) for name in parts[0].table}
        )

    def to_xarray(self) -> "xarray.Dataset":
        """An array over views and columns, because netCDF does not allow all names of groups."""
        values = {"value": (("view", "column"), np.stack(list(self.table.values()), axis=1))}
        xarray = optional("xarray", "a folder of views")
        return xarray.Dataset(values, {"column": list(self.table)}, {"kind": self.kind})

    @staticmethod
    def of_dataset(dataset: "xarray.Dataset") -> "TrendRows":
        """The rows of a Dataset that `to_xarray` made."""
        names = map(str, dataset["column"].values)
        return TrendRows(dict(zip(names, dataset["value"].values.T)))


def measure_rows(scene: Scene, views: list[View], resolution: int, sampling: Sampling) -> TrendRows:
    """Render some views together, see `totals_of_views`, and return their rows."""
    measurands = Measurands.of("model")
    total, areas = totals_of_views(scene, views, resolution, sampling, measurands)
    columns = {
        "azimuth_deg": [view.azimuth_deg for view in views],
        "elevation_deg": [view.elevation_deg for view in views],
        "intensity_W_sr": total.mean("target") * areas,
        "standard_error_W_sr": total.standard_error("target") * areas,
        "half_width_W_sr": total.half_width("target") * areas,
        "projected_area_m2": total.mean("hit") * areas,
        "paths": total.traced,
        "reached": total.reached_by_window,
        "invalid": np.full(len(views), total.invalid),
    }
    names = [name for name in total.sums if name.startswith(("group.", "bounce.", "closure"))]
    parts = {f"{name}_W_sr": mean for name, mean in zip(names, total.mean(names) * areas)}
    return TrendRows({name: np.array(v, dtype=float) for name, v in (columns | parts).items()})
