"""What `contrast` returns: values with errors for each number of reflections."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mi_lcair.detection.detection_range import DetectionRange, detection_range
from mi_lcair.detection.irradiance import Estimate, Irradiance
from mi_lcair.detection.scenario import Scenario
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.detector import Detector
from mi_lcair.results import Result


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
        estimates = {name: value._asdict() for name, value in self.estimates().items()}
        return {"max_bounces": self.max_bounces, **estimates, **self.numbers()}


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
    detector: Detector
    air: Atmosphere
    path: LineOfSight
    sight_elevation_deg: float
    observer_height_m: float | None
    target_height_m: float | None
    background_name: str
    transmittance: float
    path_radiance: float
    background_radiance: float
    no_target: float | None
    radius_m: float
    rows: list[ContrastRow]
    remarks: list[str]
    seconds: float

    kind = "contrast"

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
        return {
            "scenario_name": self.scenario.name,
            "scenario": self.scenario,
            "band": self.detector.band.label,
            "range_m": self.path.range_m,
            "atmosphere": self.air.name,
            "background": self.background_name,
            "tolerance": render.tolerance,
            "tolerance_W_m2": render.tolerance_W_m2,
            "reached": self.reached,
            "sight_elevation_deg": self.sight_elevation_deg,
            "observer_height_m": self.observer_height_m,
            "target_height_m": self.target_height_m,
            "transmittance": self.transmittance,
            "path_radiance_W_m2_sr": self.path_radiance,
            "background_radiance_W_m2_sr": self.background_radiance,
            "no_target_W_m2": self.no_target,
            "radius_m": self.radius_m,
            "remarks": self.remarks,
            "time_s": self.seconds,
            "rows": [row.as_dict() for row in self.rows],
            "groups": self.groups(),
            "spectrum": self.spectrum(),
        }

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each number of reflections, with values and standard errors."""
        columns = {"max_bounces": np.array([row.max_bounces for row in self.rows])}
        for name in self.rows[0].estimates():
            estimates = np.array([row.estimates()[name] for row in self.rows])
            quantity, unit = name.rsplit("_W_" if "_W_" in name else "_", 1)
            unit = f"W_{unit}" if "_W_" in name else unit
            columns[name] = estimates[:, 0]
            columns[f"{quantity}_standard_error_{unit}"] = estimates[:, 1]
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
                f"{name}_{unit}": parts[name]._asdict()
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
