"""The spectral intensity of a signature as a CSV and as a plot."""

import numpy as np

import mi_lcair
from mi_lcair.drawing import drawing
from mi_lcair.files import replacing
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas

UNIT = "W_sr_um"


def curves(areas: EffectiveAreas, wavelengths_um) -> dict[str, np.ndarray]:
    """Spectral intensity [W sr^-1 um^-1] of target and scene, and of each of their groups, by name."""
    spectra = areas.spectrum(wavelengths_um)
    groups = [source.group for source in areas.sources] + ["blackbodies"] * (
        spectra.shape[1] - len(areas.sources)
    )
    found = {part: spectra[p].sum(axis=0) for p, part in enumerate(PARTS)}
    for p, part in enumerate(PARTS):
        for group in dict.fromkeys(groups):
            found[f"{part}.{group}"] = spectra[p][[name == group for name in groups]].sum(axis=0)
    return found


def write(path, areas: EffectiveAreas, scene: str) -> None:
    """A CSV with a row for each wavelength: response of the band, spectral intensity of target and
    scene and their groups.

    The trapezoid rule over the rows, times the response, gives the in-band intensity to 1e-5.
    """
    wavelengths = areas.wavelengths_um()
    found = curves(areas, wavelengths)
    with replacing(path) as partial, open(partial, "w") as file:
        file.write(
            f"# spectral intensity of {scene}, band {areas.band.label}, before any atmosphere; mi_lcair {mi_lcair.__version__}\n"
        )
        file.write(
            ",".join(["wavelength_um", "response", *(f"{name}_{UNIT}" for name in found)]) + "\n"
        )
        np.savetxt(
            file,
            np.column_stack([wavelengths, areas.band.response_at(wavelengths), *found.values()]),
            fmt=["%.6f", "%.6g", *["%.9g"] * len(found)],
            delimiter=",",
        )


def save_plot(path, areas: EffectiveAreas, scene: str) -> None:
    """A PNG of the spectral intensity of target and scene, with the groups of each."""
    wavelengths = areas.wavelengths_um()
    found = curves(areas, wavelengths)
    with drawing(path, (11, 4.5), layout="constrained") as figure:
        for panel, part in zip(figure.subplots(1, 2), PARTS):
            panel.plot(wavelengths, found[part], color="black", linewidth=1.5, label="total")
            for name, values in found.items():
                if name.startswith(f"{part}.") and values.any():
                    panel.plot(wavelengths, values, linewidth=1, label=name.partition(".")[2])
            panel.set_title(
                f"{part}: {np.trapezoid(found[part] * areas.band.response_at(wavelengths), wavelengths):.5g} W/sr in band",
                fontsize=10,
            )
            panel.set_xlabel("wavelength (µm)")
            panel.set_ylabel(r"spectral intensity (W sr$^{-1}$ µm$^{-1}$)")
            panel.set_xlim(areas.band.lower_um, areas.band.upper_um)
            panel.set_ylim(0, 1.25 * max(found[part].max(), 1e-30))  # room for the legend
            panel.legend(fontsize=8, frameon=False, ncols=3, loc="upper center")
        figure.suptitle(f"{scene}, {areas.band.label}, by what emitted it", fontsize=11)
