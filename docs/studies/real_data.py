"""The page docs/real_data.md: six measured surfaces, fitted; every number on it is computed here.

    python -m docs.studies.real_data DATA_FOLDER [PAGE]

DATA_FOLDER holds <surface>.csv and <surface>_emissivity.csv; PAGE (default docs/real_data.md) is
written, with its pictures in a folder of its name beside it. The text is real_data.template.md,
whose {fields} are filled in.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mi_lcair.fitting.estimation import Fit, emissivity_error, fit
from mi_lcair.fitting.loss import SCALES
from mi_lcair.fitting.model import Hemispherical
from mi_lcair.fitting.parameters import NAMES, to_cube
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.scatterometer.reading import read, read_directional
from mi_lcair.physics.reflection.sandford_robertson_equations import FORMS
from mi_lcair.reports.fit_plot import coordinates, predicted, save_plot

TITLES = {
    "aluminium": "Aluminium",
    "aluminium_sandblasted": "Aluminium, sandblasted",
    "copper": "Copper",
    "paint_rough": "Paint, rough",
    "paint_smooth": "Paint, smooth",
    "steel_sandblasted": "Steel, sandblasted",
}
HALF_ANGLE_DEG = 0.909  # of the source, as the files state it in words
MARKS = {
    "determined": "",
    "weakly": " ʷ",
    "not": " ⁿ",
    "at": " ᵇ",
}  # by the first word of a verdict


@dataclass
class Surface:
    """A surface with its fits: to the BRDF alone, jointly with the emissivity, and, on each scale,
    to the BRDF alone: all of it and two halves, every second scan.
    """

    title: str
    measurements: Measurements
    emissivity: DirectionalData
    alone: Fit
    joint: Fit
    by_loss: dict[str, tuple[Fit, Fit, Fit]]

    def emissivity_error(self, one: Fit, max_angle_deg: float = 80) -> float:
        """Rms error of a fit's emissivity at the measured angles up to some angle."""
        predicted = Hemispherical(self.emissivity.theta, "emissivity", one.form)(coordinates(one))[
            0
        ][0]
        return emissivity_error(self.emissivity, predicted, max_angle_deg)

    @property
    def alone_error(self) -> float:
        return self.emissivity_error(self.alone)

    @property
    def joint_error_to_70(self) -> float:
        return self.emissivity_error(self.joint, 70)

    @property
    def forms(self) -> dict[str, dict]:
        """For each form: rms of the best fit to the BRDF alone, and the emissivity's error in the
        best joint fit.
        """
        result = {}
        for form in FORMS:
            alone, joint = (
                next(
                    row
                    for row in one.candidates
                    if (row["form"], row["restriction"]) == (form, None)
                )
                for one in (self.alone, self.joint)
            )
            u = to_cube([joint["parameters"][name] for name in NAMES])[None]
            predicted = Hemispherical(self.emissivity.theta, "emissivity", form)(u)[0][0]
            result[form] = {
                "rms_dex": alone["rms_dex"],
                "error": emissivity_error(self.emissivity, predicted, 80),
            }
        return result

    def spread_of_e(self, loss: str) -> float:
        """By which factor the lobe widths of the two halves differ."""
        widths = [one.parameters["e"] for one in self.by_loss[loss][1:]]
        return max(widths) / min(widths)

    @property
    def isotropic_reflectance(self) -> float:
        """Hemispherical reflectance if the lobe were as wide across the plane as in it, from the
        scan at theta_r = 20 degrees: 2 pi int f cos(theta_i) sin(delta) d delta, delta the distance
        from the mirror direction, both sides averaged. A lower limit: beyond the scan nothing is
        counted.
        """
        data = self.measurements
        scan = np.isclose(data.theta_r, np.radians(20))
        delta, f_cos = np.degrees(data.theta_i[scan]) - 20, (data.brdf * np.cos(data.theta_i))[scan]
        distance = np.arange(0, delta.max())
        sides = np.interp(distance, delta, f_cos), np.interp(-distance, delta, f_cos, left=np.nan)
        radial = np.nanmean(sides, axis=0) * np.sin(np.radians(distance))
        return float(2 * np.pi * np.trapezoid(radial, np.radians(distance)))

    def mirror_excess(self, lowest_deg: float, highest_deg: float) -> float:
        """How many times brighter than the joint fit the mirror direction is: geometric mean over
        theta_r in a range.
        """
        data, theta = self.measurements, np.degrees(self.measurements.theta_r)
        peak = (
            np.isclose(data.theta_i, data.theta_r)
            & (theta > lowest_deg - 0.1)
            & (theta < highest_deg + 0.1)
        )
        model = predicted(self.joint, data.theta_i[peak], data.theta_r[peak])
        return float(np.exp(np.mean(np.log(data.brdf[peak] / model))))

    @property
    def median_excess(self) -> float:
        """How many times brighter than the joint fit the median point is."""
        data, used = self.measurements, self.joint.used_points
        return float(
            np.median(
                data.brdf[used] / predicted(self.joint, data.theta_i[used], data.theta_r[used])
            )
        )


def fit_surface(folder: Path, name: str) -> Surface:
    measurements = replace(read(folder / f"{name}.csv"), name=TITLES[name])
    emissivity = read_directional(folder / f"{name}_emissivity.csv", "emissivity")
    observers = np.unique(measurements.theta_r)
    parts = measurements, part(measurements, observers[0::2]), part(measurements, observers[1::2])
    by_loss = {loss: tuple(fit(one, form="thesis", loss=loss) for one in parts) for loss in SCALES}
    return Surface(
        TITLES[name],
        measurements,
        emissivity,
        fit(measurements),
        fit(measurements, emissivity=emissivity),
        by_loss,
    )


def part(measurements: Measurements, observers) -> Measurements:
    """The scans at some theta_r alone."""
    rows = np.isin(measurements.theta_r, observers)
    return replace(
        measurements,
        theta_i=measurements.theta_i[rows],
        theta_r=measurements.theta_r[rows],
        brdf=measurements.brdf[rows],
    )


def table(header, rows) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def parameters(one: Fit) -> list[str]:
    """The four parameters, to the first digit of their standard errors, with their verdicts' marks."""
    cells = []
    for name in NAMES:
        value, error = one.parameters[name], one.standard_error[name]
        digits = max(0, -int(np.floor(np.log10(max(error, 1e-12)))))
        cells.append(
            f"{value:.{digits}f} ± {error:.{digits}f}{MARKS[one.verdict[name].split()[0]]}"
        )
    return cells


def form_of(one: Fit) -> str:
    return one.form + (f", {one.restriction}" if one.restriction else "")


def tables(surfaces: list[Surface]) -> dict[str, str]:
    """The tables of the page, by the name of their field."""
    columns = ["Surface", "Form", "ε", "ρ_d", "b", "e", "rms (decades)"]
    losses = ("log", "cube_root", "linear")
    return {
        "alone_table": table(
            [*columns, "Points", "Independent", "Error of emissivity"],
            [
                [
                    one.title,
                    form_of(one.alone),
                    *parameters(one.alone),
                    f"{one.alone.rms_dex:.4f}",
                    str(one.alone.used),
                    f"{one.alone.effective_points:.0f}",
                    f"{one.alone_error:.3f}",
                ]
                for one in surfaces
            ],
        ),
        "form_table": table(
            [
                "Surface",
                "thesis: rms",
                "normalized: rms",
                "thesis: error of emissivity",
                "normalized: error of emissivity",
            ],
            [
                [
                    one.title,
                    *(f"{one.forms[form]['rms_dex']:.4f}" for form in FORMS),
                    *(f"{one.forms[form]['error']:.3f}" for form in FORMS),
                ]
                for one in surfaces
            ],
        ),
        "joint_table": table(
            [*columns, "Change", "Error of emissivity", "Change"],
            [
                [
                    one.title,
                    form_of(one.joint),
                    *parameters(one.joint),
                    f"{one.joint.rms_dex:.4f}",
                    f"{one.joint.rms_dex / one.alone.rms_dex - 1:+.0%}",
                    f"{one.joint.emissivity_rms:.3f}",
                    f"{one.joint.emissivity_rms / one.alone_error - 1:+.0%}",
                ]
                for one in surfaces
            ],
        ),
        "loss_table": table(
            ["Surface"]
            + [
                f"{loss.replace('_', ' ')}: {what}"
                for what in ("rms (decades)", "e, halves")
                for loss in losses
            ],
            [
                [
                    one.title,
                    *(f"{one.by_loss[loss][0].rms_dex:.3f}" for loss in losses),
                    *(f"× {one.spread_of_e(loss):.2f}" for loss in losses),
                ]
                for one in surfaces
            ],
        ),
        "limits_table": table(
            [
                "Surface",
                "Reflectance if isotropic",
                "1 - measured emissivity",
                "Mirror direction, 15-70°",
                "Mirror direction, 80°",
            ],
            [
                [
                    one.title,
                    f"{one.isotropic_reflectance:.2f}",
                    f"{1 - np.interp(np.radians(20), one.emissivity.theta, one.emissivity.value):.2f}",
                    f"× {one.mirror_excess(15, 70):.1f}",
                    f"× {one.mirror_excess(80, 80):.1f}",
                ]
                for one in surfaces
            ],
        ),
    }


def numbers(surfaces: dict[str, Surface]) -> dict[str, float]:
    """The single numbers in the page's text."""

    def emissivity(name, angle_deg):
        data = surfaces[name].emissivity
        return float(np.interp(np.radians(angle_deg), data.theta, data.value))

    aluminium = surfaces["aluminium"]
    worst = {
        f"worst_{loss}": max(one.spread_of_e(loss) for one in surfaces.values()) for loss in SCALES
    }
    std = np.concatenate([one.emissivity.std for one in surfaces.values()])
    return {
        **worst,
        "least_std": std.min(),
        "largest_std": std.max(),
        "copper_median": surfaces["copper"].median_excess,
        "worst_log": worst["worst_log"] - 1,
        "smooth_paint_linear": 10 ** surfaces["paint_smooth"].by_loss["linear"][0].rms_dex,
        "aluminium_peak": aluminium.mirror_excess(15, 70),
        "aluminium_with_aperture": fit(
            aluminium.measurements, form="thesis", source_half_angle_deg=HALF_ANGLE_DEG
        ).rms_dex,
        "half_angle_deg": HALF_ANGLE_DEG,
        "aluminium_15": emissivity("aluminium", 15),
        "aluminium_85": emissivity("aluminium", 85),
        "aluminium_thesis_rms": aluminium.forms["thesis"]["rms_dex"],
        "aluminium_thesis": aluminium.forms["thesis"]["error"],
        "aluminium_normalized": aluminium.forms["normalized"]["error"],
        "sandblasted_80": surfaces["aluminium_sandblasted"].mirror_excess(80, 80),
        "paint_rough_80": surfaces["paint_rough"].mirror_excess(80, 80),
        "paint_rough_emissivity_70": emissivity("paint_rough", 70),
        "paint_rough_emissivity_80": emissivity("paint_rough", 80),
    }


def main(folder: Path, page: Path) -> None:
    pictures = page.with_suffix("")
    pictures.mkdir(parents=True, exist_ok=True)
    surfaces = {}
    for name in TITLES:
        print(name, file=sys.stderr)
        surfaces[name] = one = fit_surface(folder, name)
        save_plot(
            pictures / f"{name}.png",
            [(one.measurements, one.joint, {"emissivity": one.emissivity})],
        )
    template = Path(__file__).with_name("real_data.template.md").read_text(encoding="utf-8")
    fields = (
        surfaces | tables(list(surfaces.values())) | numbers(surfaces) | {"pictures": pictures.name}
    )
    page.write_text(template.format(**fields), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/real_data.md"))
