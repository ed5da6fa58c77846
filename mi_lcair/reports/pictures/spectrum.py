"""Plot of the spectral intensity of a signature."""

import numpy as np

from mi_lcair.drawing import new_figure, plain
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas


def figure(areas: EffectiveAreas):
    """Figure of the spectral intensity of target and scene, and of their groups."""
    return figure_of(areas.columns(), f"{areas.scene_name}, {areas.band.label}")


def figure_of(columns: dict[str, np.ndarray], title: str):
    """Figure of the table of a spectrum, whose columns are those of `EffectiveAreas.columns`."""
    wavelengths, response = columns["wavelength_um"], columns.get("response", 1.0)
    intensities = {
        name.removesuffix("_W_sr_um"): values
        for name, values in columns.items()
        if name.endswith("_W_sr_um")
    }
    figure = new_figure((11, 4.5), layout="constrained")
    parts = [part for part in PARTS if part in intensities]
    for panel, part in zip(figure.subplots(1, len(parts), squeeze=False)[0], parts):
        panel.plot(wavelengths, intensities[part], color="black", linewidth=1.5, label="total")
        for name, values in intensities.items():
            if name.startswith(f"{part}.") and values.any():
                panel.plot(wavelengths, values, linewidth=1, label=plain(name.partition(".")[2]))
        in_band = np.trapezoid(intensities[part] * response, wavelengths)
        panel.set_title(f"{part}: {in_band:.5g} W/sr in band", fontsize=10)
        panel.set_xlabel("wavelength (µm)")
        panel.set_ylabel(r"spectral intensity (W sr$^{-1}$ µm$^{-1}$)")
        panel.set_xlim(wavelengths.min(), wavelengths.max())
        # A quarter more than the largest value leaves room for the legend.
        panel.set_ylim(0, 1.25 * max(intensities[part].max(), 1e-30))
        panel.legend(fontsize=8, frameon=False, ncols=3, loc="upper center")
    figure.suptitle(plain(f"{title}, by what emitted it"), fontsize=11)
    return figure
