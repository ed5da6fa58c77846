"""Spectral intensity of a signature, as curves and as a CSV."""

import numpy as np

import mi_lcair
from mi_lcair.errors import escaped
from mi_lcair.files import replacing
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas

UNIT = "W_sr_um"


def curves(areas: EffectiveAreas, wavelengths_um) -> dict[str, np.ndarray]:
    """Spectral intensity of target and scene, and of each of their groups.

    Returns {name: values}, W sr^-1 um^-1, with the names "target", "scene", "target.GROUP" and
    "scene.GROUP", and one value for each of `wavelengths_um`.
    """
    spectra = areas.spectrum(wavelengths_um)
    groups = [source.group for source in areas.sources] + ["blackbodies"] * (
        spectra.shape[1] - len(areas.sources)
    )
    intensities = {part: spectra[p].sum(axis=0) for p, part in enumerate(PARTS)}
    for p, part in enumerate(PARTS):
        for group in dict.fromkeys(groups):
            of_group = [name == group for name in groups]
            intensities[f"{part}.{group}"] = spectra[p][of_group].sum(axis=0)
    return intensities


def write(path, areas: EffectiveAreas, scene: str) -> None:
    """Write the spectral intensity as a CSV with a row for each wavelength.

    The columns are the response of the band and the spectral intensities of target, scene and their
    groups, W sr^-1 um^-1. The trapezoid rule over the rows, times the response, gives the in-band
    intensity to 1e-5.

    Parameters
    ----------
    path : path-like
        File to write.
    areas : EffectiveAreas
        Effective areas of the signature.
    scene : str
        Name of the scene, for the file's comment.
    """
    wavelengths = areas.wavelengths_um()
    intensities = curves(areas, wavelengths)
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(
            f"# spectral intensity of {escaped(scene)}, band {escaped(areas.band.label)}, before "
            f"any atmosphere; mi_lcair {mi_lcair.__version__}\n"
        )
        file.write(
            ",".join(["wavelength_um", "response", *(f"{name}_{UNIT}" for name in intensities)])
            + "\n"
        )
        np.savetxt(
            file,
            np.column_stack(
                [wavelengths, areas.band.response_at(wavelengths), *intensities.values()]
            ),
            fmt=["%.6f", "%.6g", *["%.9g"] * len(intensities)],
            delimiter=",",
        )
