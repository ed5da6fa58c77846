"""Write the page docs/validation/landing.md on the airliner on its approach (thesis 4.3).

    python -m docs.studies.landing [PAGE]

It writes PAGE (default docs/validation/landing.md), and its pictures into a folder of the same name
beside it. The text is landing.template.md, whose {fields} are filled in. Every number on the page
is computed here, except for those of the thesis. The script takes about 15 minutes on two cores.
"""

import shutil
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.page import write_page
from mi_lcair import models3d, scenes
from mi_lcair.detection.contrast import Contrast
from mi_lcair.detection.irradiance import Irradiance
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import drawing
from mi_lcair.estimate import Estimate
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.sky import spectrum
from mi_lcair.scenes.build.airliner import airliner
from mi_lcair.scenes.build.wavefront import wavefront

BOUNCES, SPP, IMAGE_SPP, VARIED_SPP = (1, 2, 3, 4, 10), 256, 128, 64
CASES = [(position, band) for position in (1, 2, 3) for band in ("MWIR", "LWIR")]
# (position, band, N) -> irradiance of target, background, path and total contrast in W/m^2, thesis
# Tables 4.1-4.3
THESIS = {
    **dict.fromkeys([(1, "MWIR", n) for n in (1, 2, 3, 10)], (3.03e-3, 5.64e-7, 3.23e-7, 3.03e-3)),
    (1, "LWIR", 10): (3.61e-3, 6.55e-5, 2.23e-5, 3.56e-3),
    (2, "MWIR", 10): (7.13e-3, 5.08e-6, 2.19e-6, 7.12e-3),
    (2, "LWIR", 10): (4.18e-2, 5.90e-4, 1.09e-4, 4.13e-2),
    (3, "MWIR", 10): (5.73e-4, 7.09e-7, 4.03e-7, 5.72e-4),
    (3, "LWIR", 1): (4.89e-3, 8.25e-5, 2.77e-5, 4.83e-3),
    (3, "LWIR", 2): (5.27e-3, 8.25e-5, 2.77e-5, 5.22e-3),
    (3, "LWIR", 3): (5.38e-3, 8.25e-5, 2.77e-5, 5.33e-3),
    **dict.fromkeys([(3, "LWIR", n) for n in (4, 10)], (5.43e-3, 8.25e-5, 2.77e-5, 5.38e-3)),
}
THESIS_RANGE = {1: 1119.0, 2: 509.0, 3: 1128.05}  # m; the third follows from the positions (3.8.3)
THESIS_NEI = 5e-5  # W/m^2, thesis 4.3.5
WIDENING = 1.2  # factor of the radii of the larger exhausts


def scenario(position: int, band: str, **changes) -> Scenario:
    """Read a bundled scenario and change some of its values."""
    return Scenario.read(
        f"a340_landing/position_{position}",
        **{"sensor.band": band, "render.spp": SPP, "render.max_bounces": list(BOUNCES), **changes},
    )


# Effect of the assumptions on the contrast


def from_areas(base: Contrast, change) -> float:
    """Return the total contrast after a change that needs no new render [W/m^2].

    base: result for the scenario; its last row, with all reflections, is used. change: function of
    (effective areas, air, backdrop) that returns the changed ones.
    """
    irradiance = base.rows[-1].irradiance
    areas, air, behind = change(irradiance.areas, base.air, irradiance.behind)
    return (
        Irradiance(areas, 0.0, base.detector.band, air, behind)
        .at(air.path(base.path.range_m))["total"]
        .value
    )


def heated(group: str, kelvin: float):
    """Return a change that raises the temperatures of a group by `kelvin`."""

    def change(areas, air, behind):
        sources = [
            replace(source, temperature=source.temperature + kelvin)
            if source.group == group
            else source
            for source in areas.sources
        ]
        return replace(areas, sources=sources), air, behind

    return change


def with_larger_exhausts(folder: Path) -> Path:
    """Write the scene with exhausts of WIDENING times the radius into a folder; returns its file.

    The vertices of turbines, plumes and the ends of the cowls are moved.
    """
    for name in ("a340_landing.xml", "a340_landing", "models/world_sphere"):
        copy = shutil.copytree if (scenes.FOLDER / name).is_dir() else shutil.copy
        (folder / name).parent.mkdir(exist_ok=True)
        copy(scenes.FOLDER / name, folder / name)
    bodies = airliner(WIDENING).values()
    model = folder / "a340.obj"
    model.write_text(wavefront([facet for body in bodies for facet in body], ""), encoding="ascii")
    models3d.export(models3d.read(model), folder / "models/a340")
    return folder / "a340_landing.xml"


def under(sky: str):
    """Return a change to another sky that the target reflects. The background stays the same."""

    def change(areas, air, behind):
        def above(source):
            return (
                source
                if source.spectrum is None
                else replace(source, spectrum=spectrum(sky, float(source.name.split()[1])))
            )

        return replace(areas, sources=[above(source) for source in areas.sources]), air, behind

    return change


def through(name: str):
    """Return a change to another atmosphere."""
    return lambda areas, air, behind: (areas, atmosphere(name), behind)


# Other assumptions that need no new render: name -> function that changes effective areas, air and
# backdrop.
DERIVED = {
    "skin 310 K instead of 300 K": heated("self", 10.0),
    "exhaust plumes 550 K instead of 500 K": heated("plume", 50.0),
    "turbines 850 K instead of 800 K": heated("hot_parts", 50.0),
    "terrain 292.5 K instead of 302.5 K": heated("terrain", -10.0),
    "clear sky reflected, stratus behind": under("midlat_summer_clear"),
    "air of us_standard": through("us_standard"),
    "no air at all": through("vacuum"),
}


def rendered(larger: Path) -> dict[str, dict]:
    """Return the other assumptions, which need a new render: name -> changed values.

    larger: scene file of `with_larger_exhausts`.
    """
    return {
        "radii of the exhausts a fifth larger": {"target.scene": str(larger)},
        "clear sky behind, stratus reflected": {"background.sky": "midlat_summer_clear"},
        "gloss black paint instead of bare aluminium": {"target.parameters.finish": "gloss_black"},
        "all reflection diffuse": {"render.lobe": "diffuse"},
        "all reflection in the mirror direction": {"render.lobe": "mirror"},
        "nose 5 degrees lower": {"pose.pitch_deg": 5},
    }


VARIATIONS = [*DERIVED, *rendered(Path())]


@dataclass
class Changes:
    """Relative changes of the total contrast by variation, and the largest error of a rendered one.

    error: standard error relative to the contrast.
    """

    by_name: dict[str, float]
    error: float


def varied(position: int, band: str, base: Contrast, larger: Path, progress) -> Changes:
    """The changes of the total contrast. larger: scene file of `with_larger_exhausts`."""
    few = {"render.spp": VARIED_SPP, "render.max_bounces": 4}
    reference = mi_lcair.contrast(scenario(position, band, **few)).rows[-1].total
    total = base.rows[-1].total.value
    changes = {name: from_areas(base, change) / total - 1 for name, change in DERIVED.items()}
    progress(len(DERIVED))
    errors = []
    for name, values in rendered(larger).items():
        anew = mi_lcair.contrast(scenario(position, band, **few, **values)).rows[-1].total
        changes[name] = anew.value / reference.value - 1
        errors.append(np.hypot(anew.standard_error, reference.standard_error) / reference.value)
        progress()
    return Changes(changes, float(np.abs(errors).max()))


def save_variations(path, changes: dict) -> None:
    """Draw the relative change of each variation as bars, one panel per case.

    changes: (position, band) -> Changes.
    """
    names = VARIATIONS
    with drawing(path, (13, 9), layout="constrained") as figure:
        panels = figure.subplots(2, 3, sharey=True).T.ravel()
        for panel, ((position, band), relative) in zip(panels, changes.items()):
            values = 100 * np.array([relative.by_name[name] for name in names])
            panel.barh(names, values, color=np.where(values < 0, "C0", "C3"))
            panel.bar_label(
                panel.containers[0], [signed(value) for value in values], fontsize=8, padding=2
            )
            panel.set_title(f"position {position}, {band}", fontsize=10)
            panel.set_xlabel("change of the contrast (%)", fontsize=9)
            panel.axvline(0, color="black", linewidth=0.8)
            panel.margins(x=0.25)
            panel.tick_params(labelsize=8)
        panels[0].invert_yaxis()
        figure.suptitle("What moves the contrast of the landing airliner", fontsize=12)


# Pictures


def save_images(path, position: int, band: str) -> None:
    """Draw the radiance at the target without and with the background (Figures 4.14, 4.18-4.22)."""
    channels = radiance(position, band, BOUNCES[-1])
    show(
        path,
        [("without background", alone(channels)), ("with background", channels["Y"])],
        f"position {position}, {band}",
    )


def save_bounces(path) -> None:
    """Draw position 3 in LWIR with one reflection and with ten (Figure 4.23)."""
    images = []
    for bounces in (1, BOUNCES[-1]):
        images.append(
            (
                f"up to {bounces} reflection{'s' * (bounces > 1)}",
                alone(radiance(3, "LWIR", bounces)),
            )
        )
    show(path, images, "position 3, LWIR")


def radiance(position: int, band: str, bounces: int) -> dict:
    """Render the scene and return the channels of the image."""
    scene = mi_lcair.load(
        "a340_landing", position=position, band=band, max_bounces=bounces, resolution=384
    )
    return mi_lcair.render(scene, spp=IMAGE_SPP, seed=1).channels


def alone(channels: dict) -> np.ndarray:
    """Return the radiance of the pixels that show only the model, NaN elsewhere."""
    return np.where(channels["target.Y"] > 0.999 * channels["Y"], channels["Y"], np.nan)


def show(path, images, title: str) -> None:
    """Draw two pictures side by side, cropped to the model.

    images: (title, radiance) of each. The colour scale goes from the 2nd to the 95th percentile of
    the first picture.
    """
    rows, columns = (np.flatnonzero(np.isfinite(images[0][1]).any(axis=axis)) for axis in (1, 0))
    cut = np.s_[max(rows[0] - 12, 0) : rows[-1] + 12, max(columns[0] - 12, 0) : columns[-1] + 12]
    low, high = np.nanpercentile(images[0][1][cut], (2, 95))
    height, width = images[0][1][cut].shape
    with drawing(path, (12, 1.1 + 5.4 * height / width), layout="constrained") as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for panel, (name, values) in zip(panels, images):
            panel.set_facecolor("0.6")
            picture = panel.imshow(values[cut], vmin=low, vmax=high, cmap="inferno")
            panel.set_title(name, fontsize=10)
            panel.set_xlabel("column (pixel)", fontsize=8)
            panel.tick_params(labelsize=8)
        panels[0].set_ylabel("row (pixel)", fontsize=8)
        figure.colorbar(picture, ax=panels, extend="both", pad=0.01).set_label(
            r"radiance (W m$^{-2}$ sr$^{-1}$)", fontsize=9
        )
        figure.suptitle(title, fontsize=11)


# The page


def number(value: float, digits: int = 3) -> str:
    """Return a number as text with a power of ten."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return (
        f"{mantissa}·10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    )


def signed(percent: float) -> str:
    """Return a percentage with a sign, and with one decimal below 10."""
    return f"{percent:+.0f}" if abs(percent) >= 9.95 else f"{percent:+.1f}"


def with_error(estimate: Estimate) -> str:
    """Return a value with its relative standard error as text."""
    return f"{number(estimate.value)} ± {100 * estimate.standard_error / abs(estimate.value):.1g} %"


def table(position: int, cases: dict) -> str:
    """Return the rows of one of Tables 4.1-4.3, with the thesis's values in brackets."""
    lines = []
    for band in ("MWIR", "LWIR"):
        for row in cases[position, band].rows:
            thesis = THESIS.get((position, band, row.max_bounces))
            terms = [
                with_error(row.target),
                number(row.background.value),
                number(row.path.value),
                with_error(row.total),
            ]
            cells = (
                [f"{own} ({number(value)})" for own, value in zip(terms, thesis)]
                if thesis
                else terms
            )
            lines.append(
                f"| {band} | {row.max_bounces} "
                f"| {row.intensity.value:.0f} ± {row.intensity.standard_error:.0f} "
                f"| {' | '.join(cells)} | {number(row.nei_max.value)} |"
            )
    return "\n".join(lines)


def lost_jacobian(base: Contrast) -> float:
    """Return the factor by which the background is too weak if a Jacobian is left out.

    A spectral radiance per wavenumber [W cm^-2 sr^-1 / cm^-1] is then used as if it were one per
    wavelength. Square centimetres are converted. The factor is the mean of the Jacobian
    d(wavenumber) / d(wavelength) = 10^4 / wavelength^2 [cm^-1 / um].
    """
    irradiance = base.rows[-1].irradiance
    background = irradiance.background(base.path)
    per_wavenumber = background * irradiance.wavelengths_um**2 / 1e4
    return irradiance.in_band(background) / irradiance.in_band(per_wavenumber)


def growth(base: Contrast, first: int, last: int, term: str) -> float:
    """Return the relative growth of a term from `first` to `last` reflections.

    Both have the same random numbers.
    """
    values = {row.max_bounces: getattr(row, term).value for row in base.rows}
    return values[last] / values[first] - 1


def largest(changes: dict[str, float]) -> str:
    """Return the three assumptions with the largest effect on a case.

    "no air at all" is left out, because it is not a realistic assumption.
    """
    order = sorted(
        (name for name in changes if name != "no air at all"), key=lambda name: -abs(changes[name])
    )
    return ", ".join(f"{name} ({signed(100 * changes[name])} %)" for name in order[:3])


def fields(cases: dict, changes: dict) -> dict[str, str]:
    """Return every number on the page as text, name -> text."""
    percent = lambda value: f"{100 * value:.3g} %"
    last = {key: contrast.rows[-1] for key, contrast in cases.items()}
    weakest = min(last, key=lambda key: abs(last[key].total.value))
    text = {
        "spp": str(SPP),
        "nei_thesis": number(THESIS_NEI, 1),
        "weakest": "position {}, {}".format(*weakest),
        "weakest_total": with_error(last[weakest].total),
        "weakest_nei": number(last[weakest].nei_max.value),
        "detected_all": "all six"
        if all(row.nei_max.value >= THESIS_NEI for row in last.values())
        else ", ".join(
            "position {}, {}".format(*key)
            for key, row in last.items()
            if row.nei_max.value >= THESIS_NEI
        ),
    }
    for position in (1, 2, 3):
        text[f"table_{position}"] = table(position, cases)
    for (position, band), contrast in cases.items():
        key, row = f"p{position}_{band}", last[position, band]
        thesis = THESIS[position, band, 10]
        text |= {
            f"{key}_transmittance": f"{contrast.transmittance:.3f}",
            f"{key}_path": f"{contrast.path_radiance:.3g}",
            f"{key}_behind": f"{contrast.background_radiance:.3g}",
            f"{key}_area": f"{row.projected_area.value:.1f}",
            f"{key}_intensity": f"{row.intensity.value:.0f}",
            f"{key}_thesis_intensity": f"{thesis[0] * THESIS_RANGE[position] ** 2:.0f}",
            f"{key}_thesis_behind": f"{thesis[1] / row.solid_angle:.2g}",
            f"{key}_over_thesis": f"{row.background.value / thesis[1]:.0f}",
            f"{key}_path_over_thesis": f"{row.path.value / thesis[2]:.0f}",
            f"{key}_jacobian": f"{lost_jacobian(contrast):.0f}",
            # with the thesis's target, and our background and path
            f"{key}_thesis_mended": number(thesis[0] + row.path.value - row.background.value),
            f"{key}_thesis_mended_share": percent(
                1 + (row.path.value - row.background.value) / thesis[0]
            ),
        }
        for first, to in ((1, 2), (1, 4), (4, 10)):
            for term in ("target", "total"):
                text[f"{key}_{term}_{first}_{to}"] = percent(growth(contrast, first, to, term))
    text["bounces"] = str(BOUNCES[-1])
    text["most_moving"] = "\n".join(
        f"- position {position}, {band}: {largest(changes[position, band].by_name)}."
        for (position, band) in cases
    )
    text["assumption_rows"] = "\n".join(
        "| "
        + " | ".join([name, *(f"{signed(100 * changes[key].by_name[name])} %" for key in cases)])
        + " |"
        for name in VARIATIONS
    )
    text["derived"] = str(len(DERIVED))
    text["varied_error"] = percent(max(change.error for change in changes.values()))
    return text


def main(page: Path) -> None:
    """Write the page and its pictures."""
    folder = page.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    steps = tqdm(total=len(CASES) * (2 + len(VARIATIONS)) + 1, disable=None, leave=False)
    cases, changes = {}, {}
    with TemporaryDirectory() as temporary:
        larger = with_larger_exhausts(Path(temporary))
        for position, band in CASES:
            base = cases[position, band] = mi_lcair.contrast(scenario(position, band))
            steps.update()
            changes[position, band] = varied(position, band, base, larger, steps.update)
            save_images(folder / f"position_{position}_{band}.png", position, band)
            steps.update()
    for band in ("MWIR", "LWIR"):
        cases[1, band].plot(folder / f"spectra_{band}.png")
    save_bounces(folder / "bounces.png")
    save_variations(folder / "assumptions.png", changes)
    steps.close()
    write_page(page, "landing", **fields(cases, changes))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/landing.md"))
