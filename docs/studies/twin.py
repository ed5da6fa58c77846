"""Measure how often the intervals of a twin hold the truth, and its forecasts.

    python -m docs.studies.twin [CASE[=DRAWS] ... | page]

The cases are in `CASES`. What is measured is added to docs/validation/twin/measured.json, from
which docs/validation/twin.md is written. A draw of `coverage` takes about half a minute.
"""

import json
import sys
import tempfile
import time
import tomllib
import warnings
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.files import replacing
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from tests.knowing.twin import box_day

PAGE = Path("docs/validation/twin.md")
MEASURED = Path("docs/validation/twin/measured.json")


def coverage(folder: Path, draw: int) -> dict:
    """The box of five groups with twelve unknowns, and a camera of unknown gain and offsets."""
    problem, truth, _ = box_day.draw(folder, draw)
    began = time.process_time()
    found = mi_lcair.invert(problem, advise=False)
    return judged(found, truth) | {"processor_s": time.process_time() - began}


ASPECT = {"azimuth_deg": 200, "elevation_deg": 20}
AREA_M2 = 1.8  # of the ground that the box hides


def forecast(folder: Path, draw: int) -> dict:
    """Twelve frames, and the contrast of the box to the ground over another day.

    On that day weather and balance have errors of their own. The other aspect shows other groups.
    """
    problem, truth, _ = box_day.draw(folder, draw, range(2, 25, 2))
    found = mi_lcair.invert(problem, advise=False)
    found.save(folder / "twin.toml")
    twin = tomllib.loads((folder / "twin.toml").read_text())
    other = overcast(folder)
    target = {"scene": str(folder / "box" / "scene.xml"), "parameters": ASPECT}
    same = {"target": target, "signature": {"spp": 64}}
    twin |= same | {"weather": {"file": str(other), "ground_K": 288}}
    random = np.random.default_rng((draw, 3))
    happens = box_day.heat_of(folder, truth, weather=box_day.other_weather(folder, random, other))
    happens |= same | {"sigma": {"model_K": 0}}
    happens["run"] = happens["run"] | {"seed": 3000 + draw}
    stated, changes = contrast(mi_lcair.heat(twin))
    real, _ = contrast(mi_lcair.heat(happens))
    of_balance = [change for name, change in changes.items() if name.endswith("model_K")]
    hours = 0.5 * np.arange(1, 1 + len(stated))
    errors = box_day.model_errors(hours, len(of_balance), random, kelvin=1.0).T
    real = real + np.sum(of_balance * errors, axis=0)
    distance = (stated - real) / np.linalg.norm(list(changes.values()), axis=0)
    return {
        "inside": (abs(distance) < 1.96).tolist(),
        "distance": distance.round(3).tolist(),
        "p_value": found.p_value,
    }


def contrast(heat) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Intensity over that of black ground as warm as the terrain (m,), and its contributions."""
    terrain, lwir = heat.facets.groups.index("terrain"), band("LWIR")
    kelvin = heat.of_groups(heat.kelvin)[:, terrain]
    slope = AREA_M2 * in_band_slope(lwir, kelvin)
    changes = {row.quantity: row.contribution for row in heat.intensity.contributions}
    for row in heat.estimate.contributions:
        of_ground = slope * heat.of_groups(row.contribution)[:, terrain]
        changes[row.quantity] = changes.get(row.quantity, 0.0) - of_ground
    return heat.intensity.value - AREA_M2 * in_band_radiance(lwir, kelvin), changes


def overcast(folder: Path) -> Path:
    """A day with half the sun, a warmer sky and more wind."""
    head, *rows = (box_day.EXAMPLES / "day.csv").read_text().splitlines()[1:]
    table = dict(zip(head.split(","), np.array([row.split(",") for row in rows], float).T))
    table["sun_W_m2"], table["sky_K"] = 0.5 * table["sun_W_m2"], table["sky_K"] + 10
    table["wind_m_s"] = table["wind_m_s"] + 2
    lines = [",".join(f"{v:.6g}" for v in row) for row in zip(*table.values())]
    (folder / "overcast.csv").write_text("\n".join([head, *lines]) + "\n")
    return folder / "overcast.csv"


FAULTS = ("layer", "wind", "heater")


def wrong(folder: Path, draw: int) -> dict:
    """Models that miss a layer of the lid, half of the wind, or heat that is reflected.

    The verdict is right if the model is withdrawn, or if the values hold.
    """
    fault = FAULTS[draw % len(FAULTS)]
    truth = {"lid.thickness_mm": 12.0} if fault == "layer" else {}
    truth |= {"heater.internal_W_m2": 250.0} if fault == "heater" else {}
    names = ("lid.absorptance", "terrain.inertia", "south.absorptance")
    random = np.random.default_rng((draw, 4))
    truth |= box_day.drawn(random, {n: box_day.PRIORS[n] for n in names})
    problem, truth, _ = box_day.draw(folder, draw, range(2, 25, 2), truth=truth, fault=fault)
    problem["unknowns"] = {name: problem["unknowns"][name] for name in names}
    found = mi_lcair.invert(problem, advise=False)
    return judged(found, truth) | {"fault": fault, "withdrawn": found.p_value < 1e-3}


def judged(found, truth: dict) -> dict:
    """Which intervals hold, which verdicts are wrong, and the distances in standard errors."""
    values = np.array([truth[name] for name in found.names])
    error = np.maximum(found.upper - found.lower, 1e-300) / 3.92
    distance = (found.value - values) / error
    sure = [verdict.startswith("determined") for verdict in found.verdicts]
    return {
        "inside": ((found.lower <= values) & (values <= found.upper)).tolist(),
        "determined": sure,
        "false": [bool(s and abs(d) > 3) for s, d in zip(sure, distance)],
        "distance": distance.round(3).tolist(),
        "p_value": found.p_value,
        "names": found.names,
    }


def untold(folder: Path, draw: int) -> dict:
    """Readings of groups, and combinations of unknowns that they cannot tell."""
    problem, expected = box_day.untold(folder, draw)
    found = mi_lcair.invert(problem, advise=False)
    named = box_day.named(found.alike, found.names)
    return {"right": sorted(map(sorted, named)) == sorted(map(sorted, expected))}


CASES = {
    "coverage": (coverage, 200),
    "forecast": (forecast, 100),
    "untold": (untold, 50),
    "wrong": (wrong, 60),
}


def fields(content: dict) -> dict:
    """What the page says, from what was measured."""
    draws = content["coverage"]
    inside = np.array([draw["inside"] for draw in draws])
    sure = np.array([draw["determined"] for draw in draws])
    false = np.array([draw["false"] for draw in draws])
    ahead = np.array([draw["inside"] for draw in content["forecast"]])
    faults = content["wrong"]
    right = [draw["withdrawn"] or all(draw["inside"]) for draw in faults]
    by_fault = ", ".join(
        f"{fault} {sum(r for r, d in zip(right, faults) if d['fault'] == fault)} of "
        f"{sum(d['fault'] == fault for d in faults)}"
        for fault in FAULTS
    )
    rows = [
        f"| `{name}` | {share:.0%} |" for name, share in zip(draws[0]["names"], inside.mean(axis=0))
    ]
    return {
        "draws": len(draws),
        "inside": f"{inside.mean():.1%}",
        "count": inside.size,
        "sure": int(sure.sum()),
        "false": int(false.sum()),
        "seconds": f"{np.median([draw['processor_s'] for draw in draws]):.0f}",
        "rows": "\n".join(rows),
        "area": AREA_M2,
        "ahead": len(ahead),
        "ahead_inside": f"{ahead.mean():.1%}",
        "ahead_count": ahead.size,
        "told": sum(draw["right"] for draw in content["untold"]),
        "problems": len(content["untold"]),
        "right": sum(right),
        "faults": len(faults),
        "by_fault": by_fault,
    }


def main() -> None:
    """Measure the cases that are named, or all."""
    words = [word for word in sys.argv[1:] if word != "page"]
    wanted = [text.partition("=") for text in words]
    if not sys.argv[1:]:
        wanted = [(name, "", "") for name in CASES]
    for name, _, count in wanted:
        case, usual = CASES[name]
        content = json.loads(MEASURED.read_text()) if MEASURED.exists() else {}
        done = content.get(name, [])
        for draw in range(len(done), int(count or usual)):
            with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                done.append(case(Path(folder), draw))
            print(name, draw, json.dumps(done[-1])[:300], flush=True)
            MEASURED.parent.mkdir(parents=True, exist_ok=True)
            with replacing(MEASURED) as partial:
                partial.write_text(json.dumps(content | {name: done}, indent=None))
    content = json.loads(MEASURED.read_text())
    if content.keys() >= CASES.keys():
        write_page(PAGE, "twin", **fields(content))


if __name__ == "__main__":
    main()
