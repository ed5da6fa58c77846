"""Write the page docs/validation/real_data.md on fits to six measured surfaces.

    python -m docs.studies.real_data DATA_FOLDER [PAGE]

Each reflection model is fitted to the BRDF alone and jointly with the emissivity. So is `auto`,
which chooses among all models. DATA_FOLDER contains <surface>.csv and <surface>_emissivity.csv. The
script writes PAGE (default docs/validation/real_data.md), and its pictures into a folder of the
same name beside it. The text is real_data.template.md, whose {fields} are filled in. Every number
on the page is computed here.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from docs.studies.page import write_page
from docs.studies.real_data_tables import LOSS_FORM, LOSS_MODEL, LOSS_WIDTH, tables
from mi_lcair.fitting.data import COMPARED, SCALES
from mi_lcair.fitting.estimation import emissivity_error, fit
from mi_lcair.fitting.model import Hemispherical, directional, predicted
from mi_lcair.fitting.report import Fit
from mi_lcair.fitting.scatterometer.reading import (
    DirectionalData,
    Measurements,
    read,
    read_directional,
)
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.show.pictures.fit import save_plot

TITLES = {
    "aluminium": "Aluminium",
    "aluminium_sandblasted": "Aluminium, sandblasted",
    "copper": "Copper",
    "paint_rough": "Paint, rough",
    "paint_smooth": "Paint, smooth",
    "steel_sandblasted": "Steel, sandblasted",
}
HALF_ANGLE_DEG = 0.909  # degrees, half-angle of the source as stated in the files' comments


@dataclass
class Surface:
    """A surface with its fits by one model.

    alone: fit to the BRDF alone. joint: fit to BRDF and emissivity. by_loss: for each loss three
    fits to the BRDF alone, of all scans and of two halves; a half has every second scan.
    """

    title: str
    measurements: Measurements
    emissivity: DirectionalData
    alone: Fit
    joint: Fit
    by_loss: dict[str, tuple[Fit, Fit, Fit]]

    def emissivity_error(self, one: Fit, max_angle_deg: float = 80) -> float:
        """Return the rms error of a fit's emissivity at the measured angles up to max_angle_deg."""
        predicted = directional(one, "emissivity", self.emissivity.theta)
        return emissivity_error(self.emissivity, predicted, max_angle_deg)

    @property
    def alone_error(self) -> float:
        return self.emissivity_error(self.alone)

    @property
    def joint_error_to_70(self) -> float:
        return self.emissivity_error(self.joint, 70)

    def measured_emissivity(self, angle_deg: float) -> float:
        data = self.emissivity
        return float(np.interp(np.radians(angle_deg), data.theta, data.value))

    @property
    def peak_excess(self) -> float:
        return self.mirror_excess(15, 70)

    @property
    def grazing_excess(self) -> float:
        return self.mirror_excess(80, 80)

    @property
    def forms(self) -> dict[str, dict]:
        """Return for each form the rms of the best fit to the BRDF alone, and an emissivity error.

        The error is that of the emissivity in the best joint fit.
        """
        model, result = MODELS[self.alone.model], {}
        for form in model.forms:
            alone, joint = (
                next(
                    row
                    for row in one.candidates
                    if (row["form"], row["restriction"]) == (form, None)
                )
                for one in (self.alone, self.joint)
            )
            u = model.to_cube([list(joint["parameters"].values())])
            predicted = Hemispherical(model, form, self.emissivity.theta, "emissivity")(u)[0][0]
            result[form] = {
                "rms_dex": alone["rms_dex"],
                "error": emissivity_error(self.emissivity, predicted, 80),
            }
        return result

    def spread_of_e(self, loss: str) -> float:
        """Return the ratio of the lobe widths that are fitted to the two halves, at least 1."""
        widths = [one.parameters[LOSS_WIDTH] for one in self.by_loss[loss][1:]]
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


def load(folder: Path, name: str) -> tuple[Measurements, DirectionalData]:
    """Read the BRDF and the emissivity of a surface."""
    measurements = replace(read(folder / f"{name}.csv"), name=TITLES[name])
    return measurements, read_directional(folder / f"{name}_emissivity.csv", "emissivity")


def fit_surface(
    measurements: Measurements, emissivity: DirectionalData, model: str, by_loss=None
) -> Surface:
    """Fit one model to a surface."""
    return Surface(
        measurements.name,
        measurements,
        emissivity,
        fit(measurements, model=model),
        fit(measurements, model=model, emissivity=emissivity),
        by_loss or {},
    )


def fit_by_loss(measurements: Measurements) -> dict[str, tuple[Fit, Fit, Fit]]:
    """Fit the BRDF with each loss: all scans, and two halves with every second scan."""
    observers = np.unique(measurements.theta_r)
    parts = measurements, part(measurements, observers[0::2]), part(measurements, observers[1::2])
    return {
        loss: tuple(fit(one, model=LOSS_MODEL, form=LOSS_FORM, loss=loss) for one in parts)
        for loss in SCALES
    }


def part(measurements: Measurements, observers) -> Measurements:
    """Return the scans at the theta_r in `observers` [rad]."""
    rows = np.isin(measurements.theta_r, observers)
    return replace(
        measurements,
        theta_i=measurements.theta_i[rows],
        theta_r=measurements.theta_r[rows],
        brdf=measurements.brdf[rows],
    )


def numbers(surfaces: dict[str, Surface]) -> dict[str, float]:
    """Return the numbers of the page's text that are in no table, name of the field -> number.

    surfaces: name -> surface with its fits by LOSS_MODEL.
    """
    worst = {
        f"worst_{loss}": max(one.spread_of_e(loss) for one in surfaces.values()) for loss in SCALES
    }
    std = np.concatenate([one.emissivity.std for one in surfaces.values()])
    aluminium, rough = surfaces["aluminium"], surfaces["paint_rough"]
    with_aperture = {
        name: fit(aluminium.measurements, model=name, source_half_angle_deg=HALF_ANGLE_DEG).rms_dex
        for name in COMPARED
    }
    return {
        **worst,
        "worst_log": worst["worst_log"] - 1,
        "least_std": std.min(),
        "largest_std": std.max(),
        "smooth_paint_linear": 10 ** surfaces["paint_smooth"].by_loss["linear"][0].rms_dex,
        "aluminium_with_aperture": with_aperture,
        "half_angle_deg": HALF_ANGLE_DEG,
        "aluminium_15": aluminium.measured_emissivity(15),
        "aluminium_85": aluminium.measured_emissivity(85),
        "aluminium_forms": aluminium.forms,
        "paint_rough_70": rough.measured_emissivity(70),
        "paint_rough_80": rough.measured_emissivity(80),
    }


def main(folder: Path, page: Path) -> None:
    """Fit all models to all surfaces and write the page and its pictures."""
    pictures = page.with_suffix("")
    pictures.mkdir(parents=True, exist_ok=True)
    by_model, chosen = {name: {} for name in COMPARED}, []
    for name in TITLES:
        print(name, file=sys.stderr)
        brdf, emissivity = load(folder, name)
        for model in COMPARED:
            by_loss = fit_by_loss(brdf) if model == LOSS_MODEL else None
            by_model[model][name] = fit_surface(brdf, emissivity, model, by_loss)
        chosen.append((fit(brdf), fit(brdf, emissivity=emissivity)))
        joint = [surfaces[name].joint for surfaces in by_model.values()]
        save_plot(
            pictures / f"{name}.png", [(brdf, one, {"emissivity": emissivity}) for one in joint]
        )
    rows = {model: list(surfaces.values()) for model, surfaces in by_model.items()}
    fields = by_model | tables(rows, chosen) | numbers(by_model[LOSS_MODEL])
    fields |= {"title": TITLES, "pictures": pictures.name}
    write_page(page, "real_data", **fields)


if __name__ == "__main__":
    main(
        Path(sys.argv[1]),
        Path(sys.argv[2] if len(sys.argv) > 2 else "docs/validation/real_data.md"),
    )
