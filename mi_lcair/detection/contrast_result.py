"""What `contrast` returns: values with errors for each number of reflections."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mi_lcair.detection.detection_range import DetectionRange, detection_range
from mi_lcair.detection.irradiance import Irradiance
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import option
from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.detector import Detector
from mi_lcair.results import Result, entry
from mi_lcair.results.cells import error_row, interval
from mi_lcair.results.charts import Curve, LineChart, LineCharts, by_wavelength
from mi_lcair.results.result import Recorded
from mi_lcair.results.sections import Section, Table

INTENSITY, IRRADIANCE, IRRADIANCE_UNIT = "W sr-1 um-1", "W m-2 um-1", "W m-2"


@dataclass(frozen=True)
class ContrastRow:
    """Contrast of a target, rendered with one number of reflections.

    Irradiances are at the aperture and weighted with the response of the detector.

    Attributes
    ----------
    max_bounces : int
        Number of reflections.
    intensity : Estimate
        Intensity of the target before the air, W/sr (3.13).
    target : Estimate
        Apparent irradiance of the target, W m^-2 (3.16).
    path : Estimate
        Irradiance of the air before the target, W m^-2.
    background : Estimate
        Irradiance of the background that the target hides, W m^-2.
    total : Estimate
        Contrast, W m^-2, positive or negative (3.19).
    half_width : float
        Half of the 95 % interval of the contrast, W m^-2.
    reached : bool or None
        Whether the half width is within a tolerance; None without one.
    nei_max : Estimate
        Largest noise-equivalent irradiance that detects the target, W m^-2, behind the optics
        (3.14).
    projected_area : Estimate
        Projected area of the target, m^2.
    solid_angle : float
        Solid angle of the target, sr (3.17).
    observed : float or None
        Irradiance of the field of view with the target, W m^-2 (3.18). None without a field of
        view, or if the target may overfill it.
    detected : bool or None
        Whether the target is detected; None without a nei.
    irradiance : Irradiance
        Irradiances of the target at any range.
    """

    max_bounces: int
    intensity: Estimate
    target: Estimate
    path: Estimate
    background: Estimate
    total: Estimate
    half_width: float
    reached: bool | None
    nei_max: Estimate
    projected_area: Estimate
    solid_angle: float
    observed: float | None
    detected: bool | None
    irradiance: Irradiance = field(repr=False)

    def estimates(self) -> dict[str, Estimate]:
        """Values with standard errors by name with the unit, in the order of the console's table.

        They are those of the attributes of the same names.
        """
        return {
            "intensity_W_sr": self.intensity,
            "target_W_m2": self.target,
            "background_W_m2": self.background,
            "path_W_m2": self.path,
            "total_W_m2": self.total,
            "nei_max_W_m2": self.nei_max,
            "projected_area_m2": self.projected_area,
        }

    def numbers(self) -> dict:
        """The other entries by name with the unit, such as half_width_W_m2."""
        return {
            "half_width_W_m2": self.half_width,
            "solid_angle_sr": self.solid_angle,
            "observed_W_m2": self.observed,
            "reached": self.reached,
            "detected": self.detected,
        }

    def as_dict(self) -> dict:
        """The row as a dictionary, for JSON."""
        estimates = {name: value.as_dict() for name, value in self.estimates().items()}
        return {"max_bounces": self.max_bounces, **estimates, **self.numbers()}


def facts_of_entries(entries: dict) -> Iterator[Any]:
    """Yield irradiances and spectra of a contrast from the entries of its JSON."""
    yield from setting(entries)
    yield irradiances(entries["rows"])
    yield from groups(entries.get("groups", {}))
    yield Section("Spectra", [picture_of_entries(entries)])


def picture_of_entries(entries: dict) -> LineCharts:
    """The picture of a contrast from the entries of its JSON."""
    bounces = entries["rows"][-1]["max_bounces"]
    title = f"{entries['scenario_name']}, {entries['band']}, up to {bounces} reflections"
    if entries["scenario"]["sensor"]["response"] is not None:
        title += "; spectra times the response"
    return LineCharts(spectral_charts(entries), title)


def spectral_charts(entries: dict) -> list[LineChart]:
    """Spectra of the last row of a contrast from the entries of its JSON.

    They are the intensity before the air, the target's irradiance with the transmittance of the
    air, and the terms of the contrast, each times the response of the detector, so that the area
    below a curve is the value in band.
    """
    row, spectra = entries["rows"][-1], entries["spectrum"]
    columns = {name: np.array(values, dtype=float) for name, values in spectra.items()}
    x, response = columns["wavelength_um"], columns["response"]

    def weighted(name):
        return columns[name] * response

    def in_band(name):
        return f"{row[name]['value']:.4g}"

    intensity = Curve("intensity", weighted("intensity_W_sr_um"), INTENSITY)
    target = Curve("target", weighted("target_W_m2_um"), IRRADIANCE, 1)
    through = Curve("transmittance (right)", columns["transmittance"], "", 8, on_right=True)
    terms = [
        target,
        Curve("path", weighted("path_W_m2_um"), IRRADIANCE, 0),
        Curve("background, hidden", -weighted("background_W_m2_um"), IRRADIANCE, 2),
        Curve("contrast", weighted("total_W_m2_um"), IRRADIANCE),
    ]
    titles = (
        f"target before the air: {in_band('intensity_W_sr')} W/sr in band",
        f"target through {entries['range_m']:.5g} m of {entries['atmosphere']}: "
        f"{in_band('target_W_m2')} W/m² in band",
        f"contrast: {in_band('total_W_m2')} W/m² in band",
    )
    of_irradiance = "irradiance", IRRADIANCE
    return [
        by_wavelength(titles[0], x, "intensity", INTENSITY, [intensity]),
        by_wavelength(titles[1], x, *of_irradiance, [target, through]),
        by_wavelength(titles[2], x, *of_irradiance, terms, from_zero=False),
    ]


def setting(entries: dict) -> list[tuple[str, str]]:
    """Rows about scenario, sight, air, background, target and error."""
    scenario, elevation, row = (
        entries["scenario"],
        entries["sight_elevation_deg"],
        entries["rows"][-1],
    )
    transmittance = scenario["sensor"]["optics_transmittance"]
    heights = ""
    if entries["observer_height_m"] is not None:
        heights = (
            f", at a height of {entries['observer_height_m']:.5g} m; target "
            f"{entries['target_height_m']:.5g} m"
        )
    area, error = row["projected_area_m2"].values()
    rows = [
        ("scenario", ": ".join(filter(None, (scenario["name"], scenario["title"])))),
        ("band", f"{entries['band']}, optics transmit {transmittance:g}"),
        (
            "line of sight",
            f"{entries['range_m']:.6g} m, {abs(elevation):.4g} degrees "
            f"{'up' if elevation >= 0 else 'down'}ward, observer at azimuth "
            f"{scenario['observer']['azimuth_deg']:.6g}{heights}",
        ),
        (
            "atmosphere",
            f"{entries['atmosphere']}: mean transmittance {entries['transmittance']:.4f}, path "
            f"{entries['path_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        (
            "background",
            f"{entries['background']}: {entries['background_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        ("target", f"projected area {area:.5g} +- {error:.2g} m^2, {row['solid_angle_sr']:.5g} sr"),
    ]
    if entries["no_target_W_m2"] is not None:
        empty = f"{entries['no_target_W_m2']:.5g} W/m^2 in the field of view"
        rows.append(("without target", empty))
    return [*rows, accuracy(entries)]


def irradiances(entries: list[dict]) -> Table:
    """A row for each number of reflections, from the entries of a contrast's rows."""
    last = entries[-1]
    columns = [
        "reflections up to", ("intensity", "W sr-1"), ("target", IRRADIANCE_UNIT),
        ("background", IRRADIANCE_UNIT), ("path", IRRADIANCE_UNIT), "total W/m^2 (95 %)",
        ("nei max", IRRADIANCE_UNIT),
    ]  # fmt: skip
    more = {("observed", IRRADIANCE_UNIT): "observed_W_m2", "detected": "detected"}
    more = {column: name for column, name in more.items() if last[name] is not None}
    estimates = ("intensity_W_sr", "target_W_m2", "background_W_m2", "path_W_m2")
    rows = [
        [
            row["max_bounces"],
            *(tuple(row[name].values()) for name in estimates),
            f"{row['total_W_m2']['value']:.5g} +- {row['half_width_W_m2']:.2g}",
            tuple(row["nei_max_W_m2"].values()),
            *(row[name] for name in more.values()),
        ]
        for row in entries
    ]
    return Table([*columns, *more], rows)


def groups(parts: dict) -> list[Table]:
    """The target of the last row by what emitted it, from a contrast's entry `groups`.

    There is no table for one group.
    """
    whole = sum(part["target_W_m2"]["value"] for part in parts.values()) or 1.0
    rows = [
        [
            group,
            *(tuple(estimate.values()) for estimate in part.values()),
            f"{part['target_W_m2']['value'] / whole:.1%}",
        ]
        for group, part in parts.items()
    ]
    columns = ["emitted by", ("intensity", "W sr-1"), ("target", IRRADIANCE_UNIT), "share"]
    return [Table(columns, rows)] if len(rows) > 1 else []


def detection_ranges(contrast) -> Table:
    """The ranges at which the target is detected, by number of reflections."""
    detector = contrast.detector
    needed = (
        f"detected at, for a nei of {detector.nei:g} W/m^2 and a signal-to-noise ratio of "
        f"{detector.snr:g}"
    )
    words = [
        detection.summary().removeprefix("detected at ").removesuffix(" (standard error)")
        for detection in contrast.detection_ranges()
    ]
    return Table(
        ["reflections up to", needed],
        [[row.max_bounces, text] for row, text in zip(contrast.rows, words)],
    )


def accuracy(entries: dict) -> tuple[str, str]:
    """Row about the widest 95 % interval of a contrast, and about the tolerances if any."""
    relative, absolute, rows = (entries[k] for k in ("tolerance", "tolerance_W_m2", "rows"))
    allowed = [
        *([] if relative is None else [f"{100 * relative:.4g} %"]),
        *([] if absolute is None else [f"{absolute:.4g} W/m^2"]),
    ]
    stated = [row for row in rows if row["reached"] is False] or rows
    widest = max(stated, key=lambda row: row["half_width_W_m2"])
    half_width, total = widest["half_width_W_m2"], widest["total_W_m2"]["value"]
    several = len(rows) > 1
    of = f"the contrast with {widest['max_bounces']} reflections" if several else "the contrast"
    remedy = f"give {option('tolerance_W_m2')}, as no fraction of zero can be reached"
    return error_row(
        interval(half_width, total, "W/m^2", of, absolute is not None),
        " or ".join(allowed) or None,
        entries["reached"],
        where=f"in {len(stated)} of {len(rows)} rows" if several else "",
        remedy=remedy if half_width >= abs(total) and absolute is None else "",
    )


@dataclass(frozen=True, repr=False)
class Contrast(Result):
    """Contrast of a scenario.

    Attributes
    ----------
    scenario : Scenario
        Scenario as it was read.
    detector : Detector
        Detector of the sensor.
    air : Atmosphere
        Atmosphere of the scenario.
    path : LineOfSight
        Path from the target to the sensor.
    sight_elevation_deg : float
        Elevation of the line of sight, degrees, upward from the sensor.
    observer_height_m, target_height_m : float or None
        Heights above the ground, m. None where neither the scenario nor its air states them.
    background_name : str
        Name of the background.
    transmittance : float
        Mean transmittance of the path in the band.
    path_radiance, background_radiance : float
        Radiance of the path and of the background, W m^-2 sr^-1, weighted with the response.
    no_target : float or None
        Irradiance of the background in the whole field of view, W m^-2 (3.15). None without a field
        of view.
    radius_m : float
        Radius of the sphere that holds the target, m.
    rows : list of ContrastRow
        One row for each number of reflections.
    remarks : list of str
        Limits of the results, one line each.
    seconds : float
        Time of the calculation, s.
    """

    scenario: Scenario
    detector: Detector = entry()
    air: Atmosphere = entry("atmosphere", "name")
    path: LineOfSight = entry("range_m", "range_m")
    sight_elevation_deg: float
    observer_height_m: float | None
    target_height_m: float | None
    background_name: str = entry("background")
    transmittance: float
    path_radiance: float = entry("path_radiance_W_m2_sr")
    background_radiance: float = entry("background_radiance_W_m2_sr")
    no_target: float | None = entry("no_target_W_m2")
    radius_m: float
    rows: list[ContrastRow]
    remarks: list[str]
    seconds: float = entry("time_s")

    kind = "contrast"
    computed = {"reached": "reached", "groups": "groups", "spectrum": "spectrum"}
    facts_of = staticmethod(facts_of_entries)
    picture_of = staticmethod(picture_of_entries)

    @property
    def reached(self) -> bool | None:
        """Whether all rows have reached a tolerance; None without one."""
        return all(row.reached for row in self.rows) if self.scenario.render.has_tolerance else None

    def detection_ranges(self) -> list[DetectionRange]:
        """Detection range of each row, along the line of sight. Raises InputError without a nei."""
        return self._detection_ranges

    @cached_property
    def _detection_ranges(self) -> list[DetectionRange]:
        """They are searched once; the rows, the detector and the air of a result never change."""
        return [
            detection_range(row.irradiance, self.detector, self.air, self.radius_m)
            for row in self.rows
        ]

    def summary(self) -> str:
        """One line with the contrast of the last row and its 95 % interval."""
        row = self.rows[-1]
        detected = {None: "", True: ", detected", False: ", not detected"}[row.detected]
        return (
            f"contrast of {self.scenario.name}, {self.detector.band.label}: {row.total.value:.5g} "
            f"+- {row.half_width:.2g} W m^-2 (95 %) at {self.path.range_m:.6g} m, up to "
            f"{row.max_bounces} reflections{detected}"
        )

    def entries(self) -> dict:
        """Entries for JSON: the scenario as it was read, the results, the rows, and the spectra.

        Spectra and groups are those of the last row.
        """
        render = self.scenario.render
        return super().entries() | {
            "scenario_name": self.scenario.name,
            "band": self.detector.band.label,
            "tolerance": render.tolerance,
            "tolerance_W_m2": render.tolerance_W_m2,
        }

    def facts(self, ranges: bool = True) -> Iterator[Any]:
        """Irradiances, detection ranges and spectra.

        ranges: whether to find the detection ranges; they need a sensor with a nei.
        """
        *head, spectra = facts_of_entries(self.as_dict())
        found = ranges and self.detector.nei is not None
        table = [Section("Detection range", [detection_ranges(self)])] if found else []
        return [*head, *table, spectra]

    def picture(self) -> LineCharts:
        """The spectra of the last row."""
        return picture_of_entries(self.as_dict())

    @classmethod
    def of_entries(cls, entries: dict) -> Recorded:
        """The contrast with these entries of its JSON."""
        return Recorded(cls, entries)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each number of reflections, with values and standard errors."""
        columns = {"max_bounces": np.array([row.max_bounces for row in self.rows])}
        for name in self.rows[0].estimates():
            estimates = [row.estimates()[name] for row in self.rows]
            quantity, unit = name.rsplit("_W_" if "_W_" in name else "_", 1)
            unit = f"W_{unit}" if "_W_" in name else unit
            columns[name] = np.array([estimate.value for estimate in estimates])
            errors = np.array([estimate.standard_error for estimate in estimates])
            columns[f"{quantity}_standard_error_{unit}"] = errors
        for name in self.rows[0].numbers():
            columns[name] = np.array([row.numbers()[name] for row in self.rows], dtype=float)
        return columns

    def groups(self, number: int = -1) -> dict[str, dict[str, dict[str, float]]]:
        """The target of a row by the group that emitted it, with standard errors.

        They are the intensity before the air (intensity_W_sr) and the apparent irradiance
        (target_W_m2). Empty for a scene with too many temperatures to be told apart.
        """
        return {
            group: {
                f"{name}_{unit}": parts[name].as_dict()
                for name, unit in (("intensity", "W_sr"), ("target", "W_m2"))
            }
            for group, parts in self.rows[number].irradiance.by_group(self.path).items()
        }

    def spectrum(self, number: int = -1) -> dict[str, np.ndarray]:
        """Spectra of a row, by name with the unit: columns over wavelength_um.

        They are the response of the detector, the transmittance of the path, the intensity of the
        target before the air, and the irradiances of target, path, hidden background and contrast.
        """
        irradiance = self.rows[number].irradiance
        wavelengths = irradiance.wavelengths_um
        spectral = irradiance.spectral(self.path)
        return {
            "wavelength_um": wavelengths,
            "response": irradiance.response,
            "transmittance": self.path.at(wavelengths)[0],
            "intensity_W_sr_um": spectral["intensity"],
            **{
                f"{name}_W_m2_um": spectral[name]
                for name in ("target", "path", "background", "total")
            },
        }
