"""Write the page docs/real_data.md on fits to six measured surfaces.

    python -m docs.studies.real_data DATA_FOLDER [PAGE]

DATA_FOLDER contains <surface>.csv and <surface>_emissivity.csv. The script writes PAGE (default
docs/real_data.md), and its pictures into a folder of the same name beside it. The text is
real_data.template.md, whose {fields} are filled in. Every number on the page is computed here.
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
HALF_ANGLE_DEG = 0.909  # degrees, half-angle of the source as stated in the files' comments
# Mark of a parameter by the first word of its verdict.
MARKS = {"determined": "", "weakly": " ʷ", "not": " ⁿ", "at": " ᵇ"}


@dataclass
class Surface:
    """A surface with its fits.

    alone: fit to the BRDF alone. joint: fit to BRDF and emissivity. by_loss: for each loss three
    fits to the BRDF alone, of all scans and of two halves; a half has every second scan.
    """

    title: str
    measurements: Measurements
    emissivity: DirectionalData
    alone: Fit
    joint: Fit
    by_loss: dict[str, tuple[Fit, Fit, Fit]]

    def emissivity_error(self, fit: Fit, max_angle_deg: float = 80) -> float:
        """Return the rms error of a fit's emissivity at the measured angles up to max_angle_deg."""
        model = Hemispherical(self.emissivity.theta, "emissivity", fit.form)
        predicted = model(coordinates(fit))[0][0]
        return emissivity_error(self.emissivity, predicted, max_angle_deg)

    def emissivity_at(self, angle_deg: float) -> float:
        """Return the measured emissivity at an angle, interpolated."""
        return float(np.interp(np.radians(angle_deg), self.emissivity.theta, self.emissivity.value))

    @property
    def alone_error(self) -> float:
        return self.emissivity_error(self.alone)

    @property
    def joint_error_to_70(self) -> float:
        return self.emissivity_error(self.joint, 70)

    @property
    def forms(self) -> dict[str, dict]:
        """Return for each form the rms of the best fit to the BRDF alone, and an emissivity error.

        The error is that of the emissivity in the best joint fit.
        """
        result = {}
        for form in FORMS:
            alone, joint = (
                next(
                    row
                    for row in fit.candidates
                    if (row["form"], row["restriction"]) == (form, None)
                )
                for fit in (self.alone, self.joint)
            )
            u = to_cube([joint["parameters"][name] for name in NAMES])[None]
            predicted = Hemispherical(self.emissivity.theta, "emissivity", form)(u)[0][0]
            result[form] = {
                "rms_dex": alone["rms_dex"],
                "error": emissivity_error(self.emissivity, predicted, 80),
            }
        return result

    def spread_of_e(self, loss: str) -> float:
        """Return the ratio of the lobe widths that are fitted to the two halves, at least 1."""
        widths = [fit.parameters["e"] for fit in self.by_loss[loss][1:]]
        return max(widths) / min(widths)

    @property
    def isotropic_reflectance(self) -> float:
        """Return the hemispherical reflectance that a round lobe would have.

        It is computed from the scan at theta_r = 20 degrees, as if the lobe were as wide across the
        plane of incidence as in it: 2 pi int f cos(theta_i) sin(delta) d delta. Here delta is the
        angle from the mirror direction, and both sides are averaged. The result is a lower limit,
        because angles beyond the scan are not counted.
        """
        data = self.measurements
        scan = np.isclose(data.theta_r, np.radians(20))
        delta, f_cos = np.degrees(data.theta_i[scan]) - 20, (data.brdf * np.cos(data.theta_i))[scan]
        distance = np.arange(0, delta.max())
        sides = np.interp(distance, delta, f_cos), np.interp(-distance, delta, f_cos, left=np.nan)
        radial = np.nanmean(sides, axis=0) * np.sin(np.radians(distance))
        return float(2 * np.pi * np.trapezoid(radial, np.radians(distance)))

    def mirror_excess(self, lowest_deg: float, highest_deg: float) -> float:
        """Return the ratio of measured BRDF to joint fit in the mirror direction.

        It is the geometric mean over theta_r from lowest_deg to highest_deg.
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
        """Return the median ratio of measured BRDF to joint fit."""
        data, used = self.measurements, self.joint.used_points
        return float(
            np.median(
                data.brdf[used] / predicted(self.joint, data.theta_i[used], data.theta_r[used])
            )
        )


def fit_surface(folder: Path, name: str) -> Surface:
    """Read the files of a surface and make all its fits."""
    measurements = replace(read(folder / f"{name}.csv"), name=TITLES[name])
    emissivity = read_directional(folder / f"{name}_emissivity.csv", "emissivity")
    observers = np.unique(measurements.theta_r)
    parts = measurements, part(measurements, observers[0::2]), part(measurements, observers[1::2])
    by_loss = {
        loss: tuple(fit(scans, form="thesis", loss=loss) for scans in parts) for loss in SCALES
    }
    return Surface(
        TITLES[name],
        measurements,
        emissivity,
        fit(measurements),
        fit(measurements, emissivity=emissivity),
        by_loss,
    )


def part(measurements: Measurements, observers) -> Measurements:
    """Return the scans at the theta_r in `observers` [rad]."""
    rows = np.isin(measurements.theta_r, observers)
    return replace(
        measurements,
        theta_i=measurements.theta_i[rows],
        theta_r=measurements.theta_r[rows],
        brdf=measurements.brdf[rows],
    )


def table(header, rows) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def parameters(fit: Fit) -> list[str]:
    """Return the four parameters as text with standard errors and the marks of their verdicts.

    Values are rounded to the first digit of the standard error.
    """
    cells = []
    for name in NAMES:
        value, error = fit.parameters[name], fit.standard_error[name]
        digits = max(0, -int(np.floor(np.log10(max(error, 1e-12)))))
        cells.append(
            f"{value:.{digits}f} ± {error:.{digits}f}{MARKS[fit.verdict[name].split()[0]]}"
        )
    return cells


def form_of(fit: Fit) -> str:
    """Return the form of a fit, and its restriction if it has one."""
    return fit.form + (f", {fit.restriction}" if fit.restriction else "")


def tables(surfaces: list[Surface]) -> dict[str, str]:
    """Return the tables of the page, name of the field -> table."""
    columns = ["Surface", "Form", "ε", "ρ_d", "b", "e", "rms (decades)"]
    losses = ("log", "cube_root", "linear")
    return {
        "alone_table": table(
            [*columns, "Points", "Independent", "Error of emissivity"],
            [
                [
                    surface.title,
                    form_of(surface.alone),
                    *parameters(surface.alone),
                    f"{surface.alone.rms_dex:.4f}",
                    str(surface.alone.used),
                    f"{surface.alone.effective_points:.0f}",
                    f"{surface.alone_error:.3f}",
                ]
                for surface in surfaces
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
                    surface.title,
                    *(f"{surface.forms[form]['rms_dex']:.4f}" for form in FORMS),
                    *(f"{surface.forms[form]['error']:.3f}" for form in FORMS),
                ]
                for surface in surfaces
            ],
        ),
        "joint_table": table(
            [*columns, "Change", "Error of emissivity", "Change"],
            [
                [
                    surface.title,
                    form_of(surface.joint),
                    *parameters(surface.joint),
                    f"{surface.joint.rms_dex:.4f}",
                    f"{surface.joint.rms_dex / surface.alone.rms_dex - 1:+.0%}",
                    f"{surface.joint.emissivity_rms:.3f}",
                    f"{surface.joint.emissivity_rms / surface.alone_error - 1:+.0%}",
                ]
                for surface in surfaces
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
                    surface.title,
                    *(f"{surface.by_loss[loss][0].rms_dex:.3f}" for loss in losses),
                    *(f"× {surface.spread_of_e(loss):.2f}" for loss in losses),
                ]
                for surface in surfaces
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
                    surface.title,
                    f"{surface.isotropic_reflectance:.2f}",
                    f"{1 - surface.emissivity_at(20):.2f}",
                    f"× {surface.mirror_excess(15, 70):.1f}",
                    f"× {surface.mirror_excess(80, 80):.1f}",
                ]
                for surface in surfaces
            ],
        ),
    }


def numbers(surfaces: dict[str, Surface]) -> dict[str, float]:
    """Return the single numbers in the text of the page, name of the field -> number."""
    aluminium, paint_rough = surfaces["aluminium"], surfaces["paint_rough"]
    worst = {
        f"worst_{loss}": max(surface.spread_of_e(loss) for surface in surfaces.values())
        for loss in SCALES
    }
    std = np.concatenate([surface.emissivity.std for surface in surfaces.values()])
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
        "aluminium_15": aluminium.emissivity_at(15),
        "aluminium_85": aluminium.emissivity_at(85),
        "aluminium_thesis_rms": aluminium.forms["thesis"]["rms_dex"],
        "aluminium_thesis": aluminium.forms["thesis"]["error"],
        "aluminium_normalized": aluminium.forms["normalized"]["error"],
        "sandblasted_80": surfaces["aluminium_sandblasted"].mirror_excess(80, 80),
        "paint_rough_80": paint_rough.mirror_excess(80, 80),
        "paint_rough_emissivity_70": paint_rough.emissivity_at(70),
        "paint_rough_emissivity_80": paint_rough.emissivity_at(80),
    }


def main(folder: Path, page: Path) -> None:
    """Fit all surfaces and write the page and its pictures."""
    pictures = page.with_suffix("")
    pictures.mkdir(parents=True, exist_ok=True)
    surfaces = {}
    for name in TITLES:
        print(name, file=sys.stderr)
        surfaces[name] = surface = fit_surface(folder, name)
        save_plot(
            pictures / f"{name}.png",
            [(surface.measurements, surface.joint, {"emissivity": surface.emissivity})],
        )
    template = Path(__file__).with_name("real_data.template.md").read_text(encoding="utf-8")
    fields = (
        surfaces | tables(list(surfaces.values())) | numbers(surfaces) | {"pictures": pictures.name}
    )
    page.write_text(template.format(**fields), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/real_data.md"))
