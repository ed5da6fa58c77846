"""Write the page docs/validation/ir_range.md on the cylinder in its infrared range (thesis 4.2).

    python -m docs.studies.ir_range [PAGE]

It writes PAGE (default docs/validation/ir_range.md), and its pictures into a folder of the same
name beside it. The text is ir_range.template.md, whose {fields} are filled in. Every number on the
page is computed here. The script takes a few minutes.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.lobe import width_deg
from docs.studies.page import write_page
from mi_lcair.drawing import drawing
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.materials import material
from mi_lcair.rendering.facets import FacetTable, pixel_rays

BOUNCES, RESOLUTION, SPP, FACET_SPP = 10, 192, 128, 512
CASES = [
    ("bare_aluminum", "LWIR"),
    ("bare_aluminum", "MWIR"),
    ("gloss_black", "LWIR"),
    ("gloss_black", "MWIR"),
]
LEFT = 0.005  # missing share of the radiance below which a sum over bounces counts as converged
UNIT = r"W m$^{-2}$ sr$^{-1}$"


@dataclass(frozen=True)
class Case:
    """Renders of one finish in one band.

    mirror, brdf: radiance of each number of reflections with that lobe, (bounces + 1, H, W)
    [W m^-2 sr^-1]. target: mask of the pixels on the model, (H, W). met: mask of those among them
    whose mirror ray, from the middle of the pixel, hits the model again.
    """

    finish: str
    band: str
    mirror: np.ndarray
    brdf: np.ndarray
    target: np.ndarray
    met: np.ndarray

    def mean(self, lobe: str, bounces: int, where) -> float:
        """Return the mean radiance over the pixels `where`, with at most `bounces` reflections."""
        return float(getattr(self, lobe)[: bounces + 1].sum(axis=0)[where].mean())

    def missed(self, lobe: str, bounces: int, where, reflected=False) -> float:
        """Return the share of the converged radiance of `brdf` that is missing with a bounce limit.

        reflected: whether the share is that of the reflected part alone.
        """
        emitted = self.mean("brdf", 0, where) if reflected else 0.0
        return 1 - (self.mean(lobe, bounces, where) - emitted) / (
            self.mean("brdf", BOUNCES, where) - emitted
        )


def case(finish: str, band: str) -> Case:
    """Render one finish in one band with both lobes."""
    stacks = {}
    for lobe in ("mirror", "brdf"):
        scene = load(finish, band, lobe, RESOLUTION)
        channels = mi_lcair.render(scene, spp=SPP, seed=1, parts=True).channels
        stacks[lobe] = np.array(
            [channels[f"bounce{k:02d}.Y"] for k in range(BOUNCES + 1)], dtype=float
        )
    return Case(finish, band, stacks["mirror"], stacks["brdf"], *first_and_second(scene))


def load(finish, band, lobe, resolution):
    """Load the scene and set the lobe of the finish; the walls stay diffuse."""
    scene = mi_lcair.load(
        "cylinder_ir_range",
        finish=finish,
        band=band,
        max_bounces=BOUNCES,
        resolution=resolution,
    )
    scene.set_lobe(lobe, finish)
    return scene


def first_and_second(scene) -> tuple[np.ndarray, np.ndarray]:
    """Return two masks of pixels, (H, W).

    In the first the middle of the pixel is on the model. In the second its mirror ray also hits the
    model again.
    """
    table = FacetTable(scene)
    of_model = np.append(table.type == "model", False)
    ray, shape = pixel_rays(scene.sensor(0))

    def on_model(ray):
        si = scene.mi.ray_intersect(ray)
        facet = np.minimum(
            table.number(si.shape, si.prim_index, si.is_valid()).numpy(), table.count
        )
        return si, of_model[facet].reshape(shape)

    si, first = on_model(ray)
    _, second = on_model(si.spawn_ray(si.to_world(mi.reflect(si.wi))))
    return first, first & second


def save_images(path, case: Case) -> None:
    """Draw five images side by side with a common colour scale.

    They show one and two mirror bounces, one and two integrated bounces, and the converged
    radiance.
    """
    panels = [
        ("one mirror bounce", case.mirror, 1),
        ("two mirror bounces", case.mirror, 2),
        ("one integrated bounce", case.brdf, 1),
        ("two integrated bounces", case.brdf, 2),
        (f"{BOUNCES} integrated bounces", case.brdf, BOUNCES),
    ]
    images = [(title, stack[: bounces + 1].sum(axis=0)) for title, stack, bounces in panels]
    low, high = min(image.min() for _, image in images), np.percentile(images[-1][1], 99.8)
    with drawing(path, (15, 3.6), layout="constrained") as figure:
        axes = figure.subplots(1, len(images), sharey=True)
        for panel, (title, image) in zip(axes, images):
            picture = panel.imshow(image, vmin=low, vmax=high, cmap="inferno")
            panel.set_title(title, fontsize=10)
            panel.set_xlabel("column (pixel)", fontsize=8)
            panel.tick_params(labelsize=8)
        axes[0].set_ylabel("row (pixel)", fontsize=8)
        figure.colorbar(picture, ax=axes, extend="max", pad=0.01).set_label(
            f"radiance ({UNIT})", fontsize=9
        )
        figure.suptitle(f"{case.finish.replace('_', ' ')}, {band_of(case.band).label}", fontsize=11)


def wing_root(lobe: str) -> tuple[int, np.ndarray, float]:
    """Return results for a facet at the wing root, bare aluminium in LWIR.

    Among the facets of which more than 90 % is visible, it is the one with the largest share of
    radiance from two or more reflections.

    Returns
    -------
    tuple
        Number of the facet, its radiance with up to 0, 1, ... reflections, and the standard error
        of the last of these [W m^-2 sr^-1].
    """
    columns = mi_lcair.signature(
        load("bare_aluminum", "LWIR", "brdf", 256), spp=FACET_SPP, seed=2, facets=True
    ).facets.table
    late = (
        sum(columns[f"bounce{k:02d}_W_m2_sr"] for k in range(2, BOUNCES + 1))
        / columns["radiance_W_m2_sr"]
    )
    facet = int(np.nanargmax(np.where((columns["visible_fraction"] > 0.9), late, 0)))
    if lobe != "brdf":
        columns = mi_lcair.signature(
            load("bare_aluminum", "LWIR", lobe, 256), spp=FACET_SPP, seed=2, facets=True
        ).facets.table
    by_bounce = [columns["emitted_W_m2_sr"][facet]] + [
        columns[f"bounce{k:02d}_W_m2_sr"][facet] for k in range(1, BOUNCES + 1)
    ]
    relative = columns["standard_error_W_sr"][facet] / columns["intensity_W_sr"][facet]
    return facet, np.cumsum(by_bounce), float(relative * np.sum(by_bounce))


def save_convergence(path, facet: int, brdf: np.ndarray, mirror: np.ndarray) -> None:
    """Draw the radiance of the wing-root facet against the number of reflections."""
    with drawing(path, (11, 4), layout="constrained") as figure:
        left, right = figure.subplots(1, 2)
        n = np.arange(BOUNCES + 1)
        for name, values in (("integrated over the lobe", brdf), ("mirror", mirror)):
            left.plot(n, values, marker="o", label=name)
            rest = 1 - values / values[-1]
            right.semilogy(n[rest > 1e-7], rest[rest > 1e-7], marker="o", label=name)
        left.set_ylabel(f"radiance ({UNIT})")
        right.set_ylabel(f"share still missing, against N = {BOUNCES}")
        right.axhline(LEFT, color="0.5", linewidth=1, linestyle="--", label=f"{LEFT:.1%}")
        for panel in (left, right):
            panel.set_xlabel("reflections N")
            panel.set_xticks(n)
            panel.legend(frameon=False)
        figure.suptitle(
            f"facet {facet} at the wing root, bare aluminium, {band_of('LWIR').label}", fontsize=11
        )


def converged(values: np.ndarray) -> int:
    """Return the smallest number of reflections after which less than LEFT is missing."""
    return int(np.argmax(values / values[-1] > 1 - LEFT))


def fields(
    cases: dict, facet: int, brdf: np.ndarray, mirror: np.ndarray, error: float
) -> dict[str, str]:
    """Return every number on the page as text, name -> text."""
    percent = lambda value: f"{100 * value:.1f} %"
    bare = material("bare_aluminum", band_of("LWIR")).parameters
    text = {
        "facet": str(facet),
        "spp": str(SPP),
        "resolution": str(RESOLUTION),
        "bounces": str(BOUNCES),
        "converged": str(converged(brdf)),
        "converged_mirror": str(converged(mirror)),
        "facet_error": f"{error:.2g}",
        "lobe_width": f"{width_deg(bare['e']):.2g}",
        "floor": f"{100 * bare['rho_d']:g} %",
        "facet_rows": "\n".join(
            f"| {k} | {a:.3f} | {percent(1 - a / brdf[-1])} "
            f"| {b:.3f} | {percent(1 - b / mirror[-1])} |"
            for k, (a, b) in enumerate(zip(brdf, mirror))
        ),
    }
    for T in (260, 300):
        text[f"blackbody_{T}"] = f"{in_band_radiance(band_of('MWIR'), T):.3f}"
    rows = []
    for (finish, band), case in cases.items():
        key = f"{finish}_{band}"
        beside = case.target & ~case.met
        emitted, total = (case.mean("brdf", bounces, case.target) for bounces in (0, BOUNCES))
        text |= {
            f"{key}_missed": percent(case.missed("mirror", 1, case.met)),
            f"{key}_missed_reflected": percent(case.missed("mirror", 1, case.met, reflected=True)),
            f"{key}_missed_second": percent(case.missed("mirror", 2, case.met)),
            f"{key}_missed_integrated": percent(case.missed("brdf", 1, case.met)),
            f"{key}_missed_integrated_second": percent(case.missed("brdf", 2, case.met)),
            f"{key}_missed_target": percent(case.missed("mirror", 1, case.target)),
            f"{key}_missed_target_second": percent(case.missed("mirror", 2, case.target)),
            f"{key}_missed_elsewhere": percent(case.missed("mirror", 1, beside)),
            f"{key}_met": percent(case.met.sum() / case.target.sum()),
            f"{key}_emitted": f"{emitted:.3f}",
            f"{key}_reflected": f"{total - emitted:.3f}",
            f"{key}_emitted_share": percent(emitted / total),
            f"{key}_third": percent(
                case.mirror[3:].sum(axis=0)[case.target].mean()
                / case.mean("mirror", BOUNCES, case.target)
            ),
            f"{key}_contrast_one": percent(
                case.mean("mirror", 1, case.met) / case.mean("mirror", 1, beside) - 1
            ),
            f"{key}_contrast_two": percent(
                case.mean("mirror", 2, case.met) / case.mean("mirror", 2, beside) - 1
            ),
        }
        worst = np.abs(1 - case.mirror[:2].sum(axis=0) / case.brdf.sum(axis=0))[case.target]
        text[f"{key}_within"] = percent(np.mean(worst < 0.1))
        rows.append(
            f"| {finish.replace('_', ' ')} | {band} | "
            + " | ".join(
                percent(case.missed(lobe, n, where))
                for where in (case.target, case.met)
                for lobe, n in (("mirror", 1), ("mirror", 2), ("brdf", 1), ("brdf", 2))
            )
            + " |"
        )
    return text | {"rows": "\n".join(rows)}


def main(page: Path) -> None:
    """Write the page and its pictures."""
    folder = page.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    steps = tqdm(total=len(CASES) + 2, disable=None, leave=False)
    cases = {}
    for key in CASES:
        cases[key] = case(*key)
        save_images(folder / f"{key[0]}_{key[1]}.png", cases[key])
        steps.update()
    facet, brdf, error = wing_root("brdf")
    steps.update()
    _, mirror, _ = wing_root("mirror")
    steps.close()
    save_convergence(folder / "wing_root.png", facet, brdf, mirror)
    write_page(page, "ir_range", **fields(cases, facet, brdf, mirror, error))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/ir_range.md"))
