"""The spectral intensity of a signature, as curves and as a CSV."""

import numpy as np

import mi_lcair
from mi_lcair.errors import escaped
from mi_lcair.files import replacing
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas

UNIT = "W_sr_um"


def curves(areas: EffectiveAreas, wavelengths_um) -> dict[str, np.ndarray]:
    """Spectral intensity [W sr^-1 um^-1] of target, scene and their groups, by name."""
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
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(
            f"# spectral intensity of {escaped(scene)}, band {escaped(areas.band.label)}, "
            f"before any atmosphere; mi_lcair {mi_lcair.__version__}\n"
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
