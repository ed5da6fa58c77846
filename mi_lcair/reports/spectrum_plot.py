"""The spectral intensity of a signature as a picture."""

import numpy as np

from mi_lcair.drawing import drawing, plain
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas
from mi_lcair.signatures.spectral_intensity import curves


def save_plot(path, areas: EffectiveAreas, scene: str) -> None:
    """A PNG of the spectral intensity of target and scene, with the groups of each."""
    wavelengths = areas.wavelengths_um()
    found = curves(areas, wavelengths)
    with drawing(path, (11, 4.5), layout="constrained") as figure:
        for panel, part in zip(figure.subplots(1, 2), PARTS):
            panel.plot(wavelengths, found[part], color="black", linewidth=1.5, label="total")
            for name, values in found.items():
                if name.startswith(f"{part}.") and values.any():
                    panel.plot(
                        wavelengths, values, linewidth=1, label=plain(name.partition(".")[2])
                    )
            panel.set_title(
                f"{part}: {np.trapezoid(found[part] * areas.band.response_at(wavelengths), wavelengths):.5g} W/sr in band",
                fontsize=10,
            )
            panel.set_xlabel("wavelength (µm)")
            panel.set_ylabel(r"spectral intensity (W sr$^{-1}$ µm$^{-1}$)")
            panel.set_xlim(areas.band.lower_um, areas.band.upper_um)
            panel.set_ylim(0, 1.25 * max(found[part].max(), 1e-30))  # room for the legend
            panel.legend(fontsize=8, frameon=False, ncols=3, loc="upper center")
        figure.suptitle(plain(f"{scene}, {areas.band.label}, by what emitted it"), fontsize=11)
