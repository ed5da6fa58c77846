"""How right are temperatures from a heat balance? The page docs/validation/heat.md; every number on
it is computed here, and the time of a day of the airliner is printed.

    python -m docs.studies.heat [PAGE]

Takes about five minutes.
"""

import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np
from scipy.stats import binom, t

import mi_lcair
from docs.studies.page import write_page
from mi_lcair import models3d, scenes
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.rendering.facets import FacetTable

EXAMPLES = scenes.FOLDER / "examples"
SUN_W_M2, ELEVATION_DEG, EPSILON, ABSORPTANCE = 1361.0, 10.0, 0.95, 0.88
SIGMA_H, NOISE = 0.3, 0.5  # of h, relative; of a pixel [W m^-2 sr^-1]
SOIL = f"""[soil.total]
model = "grey"
emissivity = {EPSILON}
[soil."0.3-2.5"]
model = "grey"
emissivity = {ABSORPTANCE}
[soil.LWIR]
model = "grey"
emissivity = {EPSILON}
"""


def crater(
    folder: Path, ratio: float, rings: int = 30, sectors: int = 72, rays: int = 8192
) -> dict:
    """Mean temperature of the shadow in a spherical crater, and Ingersoll's.

    ratio: depth to diameter. Light that the bowl reflects and heat that it emits reach all of it
    evenly [Ingersoll, Svitek and Murray 1992, Icarus 100, 40].
    """
    depth, radius = 2 * ratio, (1 + 4 * ratio**2) / (4 * ratio)  # of a bowl of radius 1
    polar = np.linspace(0, np.arcsin(1 / radius), rings + 1)[1:]
    around = 2 * np.pi * np.arange(sectors) / sectors
    points = [(0.0, 0.0, -depth)]
    for angle in polar:
        r, z = radius * np.sin(angle), radius * (1 - np.cos(angle)) - depth
        points += [(r * np.cos(phi), r * np.sin(phi), z) for phi in around]
    faces = [(1, 2 + k, 2 + (k + 1) % sectors) for k in range(sectors)]
    for ring in range(rings - 1):
        a, b = 2 + ring * sectors, 2 + (ring + 1) * sectors
        faces += [
            (a + k, b + k, b + (k + 1) % sectors, a + (k + 1) % sectors) for k in range(sectors)
        ]
    lines = [f"v {x} {y} {z}" for x, y, z in points] + ["o f*soil*300*bowl"]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    (folder / "soil.toml").write_text(SOIL)
    (folder / "bowl.obj").write_text("\n".join(lines) + "\n")
    model = models3d.read(folder / "bowl.obj", materials=folder / "soil.toml")
    place = folder / f"bowl{ratio:g}"
    models3d.export(model, place, materials=folder / "soil.toml")
    weather = {"air_K": 100.0, "h_W_m2_K": 0.0, "sky_K": 0.0, "ground_K": 0.0}
    weather |= {"sun_W_m2": SUN_W_M2, "sun_elevation_deg": ELEVATION_DEG, "sun_azimuth_deg": 0.0}
    target = {"scene": str(place / "scene.xml")}
    heat = mi_lcair.heat({"target": target, "weather": weather, "run": {"rays": rays}})
    # The ray toward the sun from a point of the bowl leaves it below its rim
    sun = np.array([np.cos(np.radians(ELEVATION_DEG)), 0, np.sin(np.radians(ELEVATION_DEG))])
    centre = FacetTable(mi_lcair.load(target["scene"])).centre[heat.facets.number]
    path = -centre[:, 2] / sun[2]
    out = np.linalg.norm((centre + path[:, None] * sun)[:, :2], axis=1)
    shadow = out > 1.2
    f, A, flux = depth / (2 * radius), 1 - ABSORPTANCE, SUN_W_M2 * sun[2]
    reflected = A * f * (1 - f) / (1 - A * f) * flux
    emitted = f * (1 - A) / (1 - A * f) * flux
    exact = ((ABSORPTANCE * reflected / EPSILON + emitted) / STEFAN_BOLTZMANN) ** 0.25
    area = heat.facets.area[shadow]
    mean = float(heat.kelvin[0, shadow] @ area / area.sum())
    return {"ratio": ratio, "facets": int(shadow.sum()), "mean": mean, "exact": float(exact)}


def box_tree(folder: Path, **weather) -> dict:
    """The tables of the box's heat.toml, in a steady state if weather is given."""
    tree = tomllib.loads((EXAMPLES / "heat.toml").read_text())
    tree["target"]["scene"] = str(folder / "box" / "scene.xml")
    tree["weather"]["file"] = str(EXAMPLES / "day.csv")
    tree.pop("signature")
    if weather:
        tree["weather"] = {"air_K": 293.0, "sky_K": 265.0, "ground_K": 285.0, "sun_W_m2": 800.0}
        tree["weather"] |= {"diffuse_W_m2": 90.0, "sun_elevation_deg": 50.0}
        tree["weather"] |= {"sun_azimuth_deg": 250.0, **weather}
    return tree


def coverage(folder: Path, seeds: int = 40) -> tuple[int, int]:
    """How many 95 % intervals of temperatures hold the value of many paths, and how many there are.

    The intervals are those of the random numbers alone.
    """
    tree = box_tree(folder, h_W_m2_K=8.0) | {"sigma": {}}
    exact = mi_lcair.heat(tree | {"run": {"rays": 2**16}}).kelvin[0]
    held = total = 0
    for seed in range(1, seeds + 1):
        heat = mi_lcair.heat(tree | {"run": {"rays": 256, "seed": seed}})
        apart = (
            abs(heat.kelvin[0] - exact)
            <= t.ppf(0.975, 7) * heat.estimate["exchange"].contribution[0]
        )
        held, total = held + int(apart.sum()), total + len(apart)
    return held, total


def explained(folder: Path, draws: int = 30) -> tuple[int, int, float]:
    """How often an image gives the coefficient of convection within its 95 % interval.

    Truths scatter by SIGMA_H in logarithms about 8 W m^-2 K^-1. `invert` gives the amplitude of the
    mode of h at the present guess, three times.
    """
    rng, held, widths = np.random.default_rng(7), 0, []
    view = {"azimuth_deg": 30, "elevation_deg": 40, "resolution": 24}
    scene_file = str(folder / "box" / "scene.xml")

    def modes(h, name):
        tree = box_tree(folder, h_W_m2_K=float(h)) | {"sigma": {"h": f"{100 * SIGMA_H:g} %"}}
        mi_lcair.heat(tree).save(folder / name)
        return str(folder / name)

    for draw in range(draws):
        truth = 8 * np.exp(SIGMA_H * rng.standard_normal())
        scene = mi_lcair.load(scene_file, modes=modes(truth, "truth.csv"), **view)
        image = mi_lcair.render(scene, spp=256, seed=1000 + draw).channels["Y"]
        np.save(folder / "image.npy", image + NOISE * rng.standard_normal(image.shape))
        h = 8.0
        for _ in range(3):
            data = {"scene": scene_file, "image": str(folder / "image.npy"), "sigma": NOISE}
            data |= {"quantity": "radiance", "parameters": view | {"modes": modes(h, "guess.csv")}}
            problem = {
                "data": [data],
                "unknowns": {"heat.h": {}},
                "render": {"spp": 64, "seed": draw},
            }
            (answer,) = mi_lcair.invert(problem).as_dict()["unknowns"]
            ends = [h * (1 + SIGMA_H * answer[end]) for end in ("lower", "upper")]
            h *= max(1 + SIGMA_H * answer["value"], 0.4)
        held += ends[0] <= truth <= ends[1]
        widths.append((ends[1] - ends[0]) / 2 / h)
        print(f"h = {truth:.3f}: {ends[0]:.3f} to {ends[1]:.3f}", flush=True)
    return held, draws, float(np.median(widths))


def interval(held: int, total: int) -> str:
    """A share in percent with its binomial 95 % interval."""
    low, high = binom.interval(0.95, total, held / total)
    return f"{100 * held / total:.1f} % ({100 * low / total:.0f} to {100 * high / total:.0f})"


def airliner() -> dict:
    """Seconds of a day of the airliner with 96 intensities, by the clock and of the processors."""
    skin = {"thickness_mm": 2.0, "conductivity": 150.0, "density": 2700.0, "heat_capacity": 900.0}
    hot = {"hot_parts": {"temperature": 700.0}, "plume": {"temperature": 600.0}}
    tree = {
        "target": {"scene": "a340_landing"},
        "weather": {"file": str(EXAMPLES / "day.csv"), "ground_K": 288.0},
        "groups": {"self": skin, **hot},
        "sigma": {"h": "30 %", "absorptance": 0.05, "sky_K": 10.0},
        "signature": {"spp": 16},
        "run": {"steps": 96},
    }
    clock, processor = time.perf_counter(), time.process_time()
    heat = mi_lcair.heat(tree)
    return {
        "facets": len(heat.facets.number),
        "days": heat.days,
        "clock": time.perf_counter() - clock,
        "processor": time.process_time() - processor,
    }


def main(page="docs/validation/heat.md") -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        models3d.export(models3d.read(EXAMPLES / "box.obj"), folder / "box")
        craters = [crater(folder, ratio) for ratio in (0.2, 0.1)]
        rows = [
            f"| 1:{1 / c['ratio']:g} | {c['facets']} | {c['mean']:.3f} | {c['exact']:.3f} | "
            f"{c['mean'] - c['exact']:+.3f} |"
            for c in craters
        ]
        print("\n".join(rows), flush=True)
        tree = box_tree(folder)
        tree["sigma"] = {}
        coarse = mi_lcair.heat(tree).kelvin
        fine = mi_lcair.heat(tree | {"run": {"steps": 1440}}).kelvin[9::10]
        steps = float(abs(coarse - fine).max())
        print(f"default steps: {steps:.3f} K", flush=True)
        held, total = coverage(folder)
        print("coverage", interval(held, total), flush=True)
        of_h, draws, width = explained(folder)
    write_page(
        page,
        "heat",
        craters="\n".join(rows),
        steps=f"{steps:.2f}",
        coverage=interval(held, total),
        total=total,
        of_h=interval(of_h, draws),
        draws=draws,
        width=f"{100 * width:.1f}",
    )
    print("airliner", airliner(), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
