"""A box of five groups through a day: truths that are drawn, and frames and readings of them."""

import re
from functools import cache
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from mi_lcair.toml_table import text_of

EXAMPLES = scenes.FOLDER / "examples"
CORNERS = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
AROUND = {"azimuth_deg": 240, "elevation_deg": 35}
# Unknowns: mean and standard deviation beforehand
PRIORS = {
    "lid.h": (1.0, 0.3),
    "lid.absorptance": (0.85, 0.08),
    "lid.thickness_mm": (4.0, 1.5),
    "south.absorptance": (0.6, 0.1),
    "south.conductivity": (0.8, 0.3),
    "south.back_K": (293.0, 3.0),
    "sides.absorptance": (0.6, 0.1),
    "sides.h": (1.0, 0.3),
    "heater.internal_W_m2": (60.0, 30.0),
    "heater.heat_capacity": (800.0, 250.0),
    "terrain.absorptance": (0.75, 0.08),
    "terrain.inertia": (1540.0, 400.0),
}
WALL = {"thickness_mm": 80, "conductivity": 0.8, "density": 1700, "heat_capacity": 900}
GROUPS = {
    "lid": {"thickness_mm": 4, "conductivity": 50, "density": 7800, "heat_capacity": 500},
    "south": WALL | {"back_K": 293, "back_h": 8},
    "sides": WALL,
    "heater": {
        "internal_W_m2": 60, "thickness_mm": 15, "conductivity": 20, "density": 2500,
        "heat_capacity": 800,
    },
    "terrain": {
        "thickness_mm": 1000, "conductivity": 1.2, "density": 1800, "heat_capacity": 1100,
    },
}  # fmt: skip
ABSORPTANCE = {"lid": 0.85, "south": 0.6, "sides": 0.6, "heater": 0.7, "terrain": 0.75}
SIGMA = {"air_K": 0.3, "sky_K": 3.0, "sun_W_m2": "2 %"}
NETD_MK, GAIN, OFFSET_K, DRIFT_K = 60.0, 0.03, 1.0, 0.5
BANDS = {"band": "LWIR", "resolution": 96}


def block(lines: list[str], size: float, centre, height: float, below: float, names: dict) -> None:
    """Add a box to the lines of an OBJ file. names: of its top, its first side and the others."""
    first = sum(line.startswith("v ") for line in lines) + 1
    for z in (below, below + height):
        lines += [f"v {centre[0] + size * x} {centre[1] + size * y} {z}" for x, y in CORNERS]
    top, side, others = names
    lines += [f"o {side}", "f {} {} {} {}".format(*(first + k for k in (0, 1, 5, 4)))]
    lines.append(f"o {others}")
    for a, b in ((1, 2), (2, 3), (3, 0)):
        lines.append("f {} {} {} {}".format(*(first + k for k in (a, b, b + 4, a + 4))))
    lines.append("f {} {} {} {}".format(*(first + k for k in (3, 2, 1, 0))))
    lines += [f"o {top}", "f {} {} {} {}".format(*(first + k for k in (4, 5, 6, 7)))]


@cache
def folder(path: Path) -> Path:
    """A folder with the scene of the box, written once."""
    path.mkdir(parents=True, exist_ok=True)
    wall = "ir_range_wall"
    lines: list[str] = []
    names = [f"f*gloss_black*300*group={n}" for n in ("lid", "south", "sides")]
    names[1:] = [f"f*{wall}*300*group={n}" for n in ("south", "sides")]
    block(lines, 0.5, (0, 0), 1.0, 0.0, names)
    block(lines, 0.25, (-1.2, -0.9), 0.4, 0.0, [f"f*{wall}*300*group=heater"] * 3)
    first = sum(line.startswith("v ") for line in lines) + 1
    lines += [f"v {1.6 * x} {1.6 * y} -0.01" for x, y in CORNERS]
    lines += [f"o t*{wall}*290*plate", f"f {first} {first + 1} {first + 2} {first + 3}"]
    (path / "box.obj").write_text("\n".join(lines) + "\n")
    models3d.export(models3d.read(path / "box.obj"), path / "box")
    return path


def heat_of(path: Path, values: dict | None = None, **tables) -> dict:
    """The tables of a heat.toml with values of some unknowns."""
    groups = {n: g | {"absorptance": ABSORPTANCE[n]} for n, g in GROUPS.items()}
    for name, value in (values or {}).items():
        group, _, key = name.partition(".")
        if key == "inertia":
            own = groups[group]
            of = np.sqrt(own["conductivity"] * own["density"] * own["heat_capacity"])
            for each in ("conductivity", "density"):
                own[each] *= value / of
        else:
            groups[group]["h_factor" if key == "h" else key] = value
    tree = {
        "target": {"scene": str(path / "box" / "scene.xml")},
        "weather": {"file": str(tables.pop("weather", EXAMPLES / "day.csv")), "ground_K": 288},
        "groups": groups,
        "run": {"steps": 48, "rays": 16384},
        "sigma": SIGMA | {"model_K": 0.3},
    }
    return tree | tables


def write_heat(file: Path, tree: dict) -> None:
    """Write a heat.toml."""
    groups = {f"groups.{name}": table for name, table in tree["groups"].items()}
    file.write_text(text_of({k: v for k, v in tree.items() if k != "groups"} | groups))


def drawn(random, priors: dict | None = None) -> dict[str, float]:
    """Values of the unknowns, drawn from what is known beforehand."""
    result = {}
    for name, (mean, sigma) in (priors or PRIORS).items():
        step = random.standard_normal()
        is_linear = name.rpartition(".")[2] in ("absorptance", "back_K", "internal_W_m2")
        value = mean + sigma * step if is_linear else mean * np.exp(sigma / mean * step)
        result[name] = float(np.clip(value, 0.02, 0.98)) if "absorptance" in name else float(value)
    return result


def other_weather(path: Path, random, of: Path = EXAMPLES / "day.csv", fault: str = "") -> Path:
    """A day that differs from another one as SIGMA says. fault: "wind" has half of it."""
    text = [line for line in of.read_text().splitlines() if not line.startswith("#")]
    head, rows = text[0].split(","), [list(map(float, line.split(","))) for line in text[1:]]
    table = dict(zip(head, np.array(rows).T))
    table["air_K"] = table["air_K"] + SIGMA["air_K"] * random.standard_normal()
    table["sky_K"] = table["sky_K"] + SIGMA["sky_K"] * random.standard_normal()
    table["sun_W_m2"] = table["sun_W_m2"] * (1 + 0.02 * random.standard_normal())
    if fault == "wind":
        table["wind_m_s"] = 2 * table["wind_m_s"]
    lines = [",".join(head), *(",".join(f"{v:.6g}" for v in row) for row in zip(*table.values()))]
    (path / "weather.csv").write_text("\n".join(lines) + "\n")
    return path / "weather.csv"


def model_errors(hours, count: int, random, kelvin: float = 0.3) -> np.ndarray:
    """Errors of the balance (hours, count), alike over three hours, of a repeated day."""
    lag = abs(np.subtract.outer(hours, hours))
    lag = np.minimum(lag, 24 - lag)
    root = np.linalg.cholesky(np.exp(-lag / 3) + 1e-9 * np.eye(len(hours)))
    return kelvin * root @ random.standard_normal((len(hours), count))


def frames_of(path: Path, heat, hours, random, view=AROUND, errors=None, spp=128, **camera) -> dict:
    """Write frames of a heat result at some hours; returns the entry [[frames]] of a problem.

    errors: of the temperatures of groups at the hours, (hours, groups).
    """
    parameters = {**BANDS, **view, **camera}
    scene = mi_lcair.load(path / "box" / "scene.xml", **parameters)
    seen = facet_matrix(scene, spp=spp, seed=5)
    gain, offset = 1 + GAIN * random.standard_normal(), OFFSET_K * random.standard_normal()
    slope = float(in_band_slope(scene.band, 300.0))
    rows = []
    for k, hour in enumerate(hours):
        at = heat.kelvin[heat.row(hour)]
        if errors is not None:
            at = at + errors[k][heat.facets.group]
        kelvin = seen.temperature.copy()
        kelvin[np.searchsorted(seen.facets, heat.facets.number)] = at
        clean = seen.mean @ in_band_radiance(scene.band, kelvin) + seen.rest.mean(axis=0)
        drift = DRIFT_K * random.standard_normal()
        frame = gain * clean + (offset + drift) * slope
        frame = random.normal(frame, noise_of_netd(scene.band, clean, NETD_MK))
        name = f"frame_{k:02}.npy"
        np.save(path / name, frame.reshape(seen.size[::-1]).astype(np.float32))
        rows.append(f"{hour},{name}")
    (path / "frames.csv").write_text("hour,image\n" + "\n".join(rows) + "\n")
    return {
        "list": str(path / "frames.csv"), "parameters": parameters, "quantity": "radiance",
        "netd_mK": NETD_MK, "gain_sigma": f"{100 * GAIN:g} %", "offset_K": OFFSET_K,
        "drift_K": DRIFT_K, "spp": 128,
    }  # fmt: skip


def problem(path: Path, frames: dict, names=PRIORS, **heat) -> dict:
    """The problem of some unknowns with their priors."""
    return {
        "heat": {"file": str(path / "heat.toml"), **heat},
        "frames": [frames],
        "unknowns": {name: {"prior": list(PRIORS[name])} for name in names},
    }


def draw(path: Path, number: int, hours=range(1, 25), truth=None, fault: str = "") -> tuple:
    """A problem of a drawn truth, the truth, and its temperatures.

    truth: values in place of drawn ones. fault: see `other_weather`.
    """
    folder(path)
    random, model_K = np.random.default_rng(number), 0.3
    truth = truth or drawn(random)
    weather = other_weather(path, random, fault=fault)
    tree = heat_of(path, truth, weather=weather, sigma={"model_K": 0})
    # With much less noise of its own than the estimate has
    tree["run"] = tree["run"] | {"seed": 1000 + number, "rays": 65536}
    heat = mi_lcair.heat(tree)
    errors = model_errors(np.array(hours, float), len(GROUPS), random, model_K)
    frames = frames_of(path, heat, hours, random, errors=errors, spp=1024)
    guess = heat_of(path, sigma=SIGMA | {"model_K": model_K})
    guess["run"]["seed"] = 5000 + number
    write_heat(path / "heat.toml", guess)
    return problem(path, frames), truth, heat


# Problems with combinations of unknowns that no reading can tell
# ---------------------------------------------------------------

# Each: the unknowns of a combination. Storage is that of a product, thick ground has an inertia
# only, the lid's thickness and its density are those of one thin sheet
UNTOLD = [
    ("lid.density", "lid.heat_capacity"),
    ("lid.density", "lid.thickness_mm"),
    ("terrain.conductivity", "terrain.density"),
    ("terrain.conductivity", "terrain.heat_capacity"),
    ("heater.density", "heater.heat_capacity"),
    ("sides.density", "sides.heat_capacity"),
]
TOLD = (
    "lid.absorptance",
    "lid.h",
    "heater.internal_W_m2",
    "sides.absorptance",
    "south.absorptance",
)


def untold(path: Path, number: int) -> tuple[dict, list[set[str]]]:
    """A problem of readings by day or by night, and the combinations that they cannot tell."""
    random = np.random.default_rng((7, number))
    folder(path)
    is_night = bool(random.integers(2))
    weather = EXAMPLES / "day.csv"
    if is_night:
        text = weather.read_text().splitlines()
        rows = [line.split(",") for line in text[2:]]
        dark = [[*row[:4], "0", "0", *row[6:]] for row in rows]
        weather = path / "night.csv"
        weather.write_text("\n".join([text[1], *(",".join(row) for row in dark)]) + "\n")
    tree = heat_of(path, weather=weather, sigma={"model_K": 0, "air_K": 0.01})
    write_heat(path / "heat.toml", tree)
    groups = [pair for pair in UNTOLD if random.random() < 0.5]
    chosen, used = [], set()
    for pair in groups:
        if not used & set(pair):
            chosen.append(pair)
            used |= set(pair)
    told = [name for name in TOLD if random.random() < 0.5]
    expected = [set(pair) for pair in chosen]
    if is_night:
        expected += [{name} for name in told if name.endswith("absorptance")]
    names = [name for pair in chosen for name in pair] + told
    names = names or ["lid.h"]
    heat = mi_lcair.heat(tree)
    columns = [heat.of_groups(heat.kelvin)[:, k] for k in range(len(heat.facets.groups))]
    kelvin = np.array([heat.hours, *columns]).T
    kelvin[:, 1:] += random.normal(0, 0.02, kelvin[:, 1:].shape)
    head = ",".join(["hour", *heat.facets.groups])
    np.savetxt(path / "measured.csv", kelvin, delimiter=",", header=head, comments="")
    readings = {"measured": str(path / "measured.csv"), "sigma_K": 0.02}
    heat_table = {"file": str(path / "heat.toml"), **readings}
    order = random.permutation(len(names))
    return {"heat": heat_table, "unknowns": {names[k]: {} for k in order}}, expected


def named(sentences: list[str], names: list[str]) -> list[set[str]]:
    """The unknowns that each sentence names."""
    return [{n for n in names if re.search(rf"{re.escape(n)}(?![\w])", text)} for text in sentences]
