"""Labels of surfaces, base and coating, as materials with emissivity, its sigma, and sources.

The label `steel` with the coating `paint` is the material `steel+paint`; without a coating it is
`steel`. What a base, a coating and a reflection is says labels.toml, and labels.csv has the samples
behind each emissivity. A band of a label for which no source gives a sample has no entry.

With n samples of emissivity x_i and the mean m,

    emissivity = m,   sigma^2 = (1 + 1/n) (sum (x_i - m)^2 + s^2) / n,   s = r m (1 - m),

which is what one more surface with this label deviates from the mean. r is the pooled standard
deviation of x_i / (m (1 - m)) within all labels that are metals, or within all that are not, in the
same band. With one sample, sigma is sqrt(2) s. The samples are what the libraries hold, not a
random choice.
"""

import csv
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, check_known, unknown

SAMPLES = Path(__file__).with_suffix(".csv")
FILE = Path(__file__).with_suffix(".toml")
SOLAR = "0.3-2.5"  # the band of sunlight in heat balances [um]
BANDS = (SOLAR, "1-2.5", "SWIR", "MWIR", "LWIR", "8-14")
NONE, COATINGS = "none", ("none", "paint", "clearcoat", "paint_clearcoat")
MOST_NAMED = 3  # samples of a source that an entry names


@cache
def meanings() -> dict:
    """What labels.toml says."""
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


def bases() -> list[str]:
    """The bases of the published list."""
    return [base for group in meanings()["bases"].values() for base in group]


def name_of(base: str, coating: str = NONE) -> str:
    """The name of the material that a label stands for, such as "steel+paint".

    Raises InputError if base or coating is unknown, or if no source gives such a surface.
    """
    check_known("coating", COATINGS, coating)
    if base not in bases():
        raise unknown("base", base, bases())
    name = base if coating == NONE else f"{base}+{coating}"
    if name not in tables():
        has = [known for known in tables() if known.partition("+")[0] == base]
        instead = f"; there is {', '.join(has)}" if has else ""
        raise InputError(
            f"label '{name}': no source gives its emissivity{instead}; name a material of your own"
        )
    return name


def reflects(name: str) -> str:
    """How a label reflects: "metal", "smooth", "gloss" or "diffuse"."""
    base, _, coating = name.partition("+")
    return next((k for k, names in meanings()["reflects"].items() if (coating or base) in names),
        "diffuse")  # fmt: skip


@cache
def tables() -> dict[str, dict[str, dict]]:
    """Entries by name and band: emissivity, sigma, samples (their number), source."""
    groups, found = meanings()["groups"], defaultdict(lambda: defaultdict(list))
    with SAMPLES.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            end = "" if row["coating"] == NONE else f"+{row['coating']}"
            for base in (b for word in row["bases"].split() for b in groups.get(word, [word])):
                for band in BANDS:
                    if row[band]:
                        sample = float(row[band]), row["source"], row["sample"]
                        found[base + end][band].append(sample)
    squares, freedom = defaultdict(float), defaultdict(int)
    for name, of_name in found.items():
        for band, samples in of_name.items():
            values = np.array([value for value, *_ in samples])
            kind = reflects(name) == "metal", band
            squares[kind] += float(np.sum(((values - values.mean()) / slope(values)) ** 2))
            freedom[kind] += len(values) - 1
    return {
        name: {
            band: entry_of(of_name[band], squares[kind] / freedom[kind])
            for band in BANDS
            if band in of_name and freedom[kind := (reflects(name) == "metal", band)]
        }
        for name, of_name in sorted(found.items())
    }


def slope(values: np.ndarray) -> float:
    """m (1 - m) of the mean m of emissivities, by which the spread within labels scales."""
    return float(values.mean() * (1 - values.mean()))


def entry_of(samples: list[tuple[float, str, str]], pooled: float) -> dict:
    """The entry of some samples (emissivity, source, name). pooled: r^2, see above."""
    values, by_source = np.array([value for value, *_ in samples]), defaultdict(list)
    for _, source, sample in samples:
        by_source[source].append(sample)
    n, squares = len(values), np.sum((values - values.mean()) ** 2)
    sources = [
        f"{meanings()['sources'][source]}: {', '.join(of_source[:MOST_NAMED])}"
        + f" and {len(of_source) - MOST_NAMED} more" * (len(of_source) > MOST_NAMED)
        for source, of_source in by_source.items()
    ]
    spread = f"spread of {n} samples" if n > 1 else "pooled spread, from one sample"
    return {
        "emissivity": float(values.mean()),
        "sigma": float(np.sqrt((1 + 1 / n) * (squares + pooled * slope(values) ** 2) / n)),
        "samples": n,
        "source": f"sigma: {spread}. {'; '.join(sources)}",
    }


def rows(bands=BANDS) -> list[list[str]]:
    """Name, reflection, and emissivity +- sigma in each of some bands, of each label."""
    return [
        [name, reflects(name)]
        + [f"{e['emissivity']:.3f} +- {e['sigma']:.3f}" if (e := of_name.get(band)) else "-"
            for band in bands]
        for name, of_name in tables().items()
    ]  # fmt: skip


def keys_of(name: str, entry: dict) -> dict:
    """The keys of a material with this entry, as those of a file of materials.

    The emissivity of a sample is that along the normal. The parameter `epsilon` of the
    Sandford-Robertson model is its mean over the hemisphere, G(b) times as large.
    """
    shape, emissivity = meanings()["shapes"].get(reflects(name)), entry["emissivity"]
    if shape is None or 1 - emissivity > shape.get("most", 1):
        keys = {"model": "grey", "emissivity": emissivity, "sigma": {"emissivity": entry["sigma"]}}
        return keys | {"source": f"{entry['source']}; reflection: taken as diffuse"}
    from mi_lcair.physics.reflection.sandford_robertson import bound_of_sum

    G = float(bound_of_sum(shape["b"]))
    return {
        "epsilon": G * emissivity,
        "rho_d": G * (1 - emissivity) * shape["diffuse"],
        "b": shape["b"],
        "e": shape["e"],
        "sigma": {"epsilon": G * entry["sigma"]},
        "source": f"{entry['source']}; {shape['source']}",
    }
