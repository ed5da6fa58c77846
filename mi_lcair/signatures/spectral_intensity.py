"""Spectral intensity of a signature as a CSV."""

import numpy as np

import mi_lcair
from mi_lcair.errors import escaped
from mi_lcair.files import replacing
from mi_lcair.signatures.effective_areas import EffectiveAreas


def write(path, areas: EffectiveAreas) -> None:
    """Write the spectral intensity as a CSV with a row for each wavelength.

    The columns are those of `EffectiveAreas.columns`.
    """
    columns = areas.columns()
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(
            f"# spectral intensity of {escaped(areas.scene_name)}, band "
            f"{escaped(areas.band.label)}, before any atmosphere; mi_lcair "
            f"{mi_lcair.__version__}\n"
        )
        file.write(",".join(columns) + "\n")
        np.savetxt(
            file,
            np.column_stack(list(columns.values())),
            fmt=["%.6f", "%.6g", *["%.9g"] * (len(columns) - 2)],
            delimiter=",",
        )
