"""The intensities that `signature` returns."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.formats import VTK
from mi_lcair.rendering.facets import polygons
from mi_lcair.results import Result
from mi_lcair.signatures.effective_areas import EffectiveAreas
from mi_lcair.signatures.facet_results import FacetResults

if TYPE_CHECKING:
    from mi_lcair.plugins.paths.aim import Aim


@dataclass(frozen=True)
class Intensity:
    """Intensity toward the sensor, W/sr, and its parts.

    Attributes
    ----------
    intensity, standard_error : float
        Intensity and its standard error, W/sr.
    half_width : float
        Half of the 95 % interval of the intensity, W/sr.
    by_bounce, by_bounce_error : list of float
        Part of the paths with 0, 1, ... max_bounces reflections, W/sr, and its standard error. The
        last entry holds all reflections from the 64th on. With `closure` they add up to the
        intensity.
    by_group, by_group_error : dict of str to float
        Part that each group emitted, W/sr, and its standard error.
    by_seen, by_seen_error : dict of str to float
        Part of the pixels that show each group, W/sr, and its standard error.
    closure : float
        Estimate of the reflections beyond max_bounces, W/sr. It is included in `intensity`.
    """

    intensity: float
    standard_error: float
    half_width: float
    by_bounce: list[float]
    by_bounce_error: list[float]
    by_group: dict[str, float]
    by_group_error: dict[str, float]
    by_seen: dict[str, float]
    by_seen_error: dict[str, float]
    closure: float

    @property
    def up_to_bounce(self) -> list[float]:
        """Intensity of the paths with at most 0, 1, ... reflections, W/sr: sums of `by_bounce`."""
        return np.cumsum(self.by_bounce).tolist()

    def rows(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Values and standard errors, W/sr, of the whole and of each part by what and name."""
        parts = {
            "bounce": zip(map(str, count()), self.by_bounce, self.by_bounce_error),
            "group": zip(self.by_group, self.by_group.values(), self.by_group_error.values()),
            "seen": zip(self.by_seen, self.by_seen.values(), self.by_seen_error.values()),
        }
        rows = {(of, name): pair for of, part in parts.items() for name, *pair in part}
        return {("all", ""): (self.intensity, self.standard_error)} | rows

    def as_dict(self) -> dict:
        """The entries for JSON, all in W/sr."""
        entries = asdict(self) | {"up_to_bounce": self.up_to_bounce}
        return {f"{name}_W_sr": value for name, value in entries.items()}


@dataclass(frozen=True, repr=False)
class Signature(Result):
    """Intensity of a scene toward an orthographic sensor.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    band : str
        Name of the band.
    scene : Intensity
        Intensity of all that lies in the sensor's window.
    target : Intensity
        Intensity of the model's facets. It includes sky and terrain that they reflect, but not sky
        and terrain that the sensor sees directly.
    effective_areas : EffectiveAreas or None
        Effective area of each source, if it was asked for.
    facets : FacetResults or None
        Results of each facet, if they were asked for.
    window_area : float
        Area of the sensor's window, m^2.
    seconds : float
        Time of the render, s.
    paths : int
        Number of paths.
    invalid : int
        Number of samples that were NaN or infinite, and count as 0.
    degrees_of_freedom : int
        Degrees of freedom of all standard errors, see `student_factor`.
    missed : float
        Intensity that a source which no path has hit may add to the target, W/sr.
    systematic : float
        Relative error of every intensity that more paths do not reduce.
    tolerance : float or None
        Tolerance that was asked for.
    reached : bool or None
        Whether the tolerance was reached, or the criterion `excess` was met; None without them.
    aim : Aim or None
        Where in the window the paths began. Renders with one aim and one number share their paths.
    remarks : sequence of str
        Remarks on the scene, one line each.
    bins : str
        Bins of wavelength and their error, in words; empty without spectral materials.
    fewer : tuple of Signature
        The same with fewer reflections, if they were asked for, from the same paths.
    """

    scene_name: str
    band: str
    scene: Intensity
    target: Intensity
    effective_areas: EffectiveAreas | None
    facets: FacetResults | None
    window_area: float
    seconds: float
    paths: int
    invalid: int
    degrees_of_freedom: int
    missed: float
    systematic: float
    tolerance: float | None
    reached: bool | None = None
    aim: "Aim | None" = None
    remarks: Sequence[str] = ()
    bins: str = ""
    fewer: "tuple[Signature, ...]" = ()

    kind = "signature"
    saved_by = dict.fromkeys(VTK, f"{__name__}:write_vtk")

    def suffixes(self) -> list[str]:
        """Suffixes of the files that `save` can write; those of ParaView need `facets=True`."""
        known = super().suffixes()
        return [suffix for suffix in known if suffix not in VTK or self.facets is not None]

    @property
    def main_part(self) -> str:
        """Part that a tolerance refers to: "target", or "scene" if the target is dark."""
        return "target" if self.target.intensity > 0 else "scene"

    @property
    def main(self) -> Intensity:
        """The Intensity of `main_part`."""
        return getattr(self, self.main_part)

    @property
    def intensity(self) -> float:
        """Intensity of `main_part`, W/sr: of the target, or of the scene if the target is dark."""
        return self.main.intensity

    @property
    def standard_error(self) -> float:
        """Standard error of `intensity`, W/sr."""
        return self.main.standard_error

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval of `intensity`, W/sr."""
        return self.main.half_width

    def summary(self) -> str:
        """One line with the intensity of `main_part` and its 95 % interval."""
        return (
            f"signature of {self.scene_name}, {self.band}: {self.main_part} "
            f"{self.intensity:.6g} +- {self.half_width:.2g} W/sr (95 %), {self.paths} paths"
        )

    def entries(self) -> dict:
        """Entries for JSON: "target" and "scene", and what both share."""
        entries = {
            "scene_name": self.scene_name,
            "band": self.band,
            "main_part": self.main_part,
            "target": self.target.as_dict(),
            "scene": self.scene.as_dict(),
            "window_area_m2": self.window_area,
            "missed_W_sr": self.missed,
            "systematic": self.systematic,
            "degrees_of_freedom": self.degrees_of_freedom,
            "time_s": self.seconds,
            "paths": self.paths,
            "invalid": self.invalid,
            "tolerance": self.tolerance,
            "reached": self.reached,
            "remarks": list(self.remarks),
        } | ({"bins": self.bins} if self.bins else {})
        if self.effective_areas is not None:
            entries["effective_areas"] = self.effective_areas.as_list()
            entries["spectrum"] = self.effective_areas.columns()
        if self.facets is not None:
            entries["facets"] = self.facets.columns()
        return entries

    def columns(self) -> dict[str, np.ndarray]:
        """Intensity of target and scene: all of it, by reflections, by emitter, by what is seen."""
        rows = self.target.rows(), self.scene.rows()
        of, names = zip(*rows[1])
        values = np.array([[part[row] for part in rows] for row in rows[1]], dtype=float)
        return {
            "part": np.array(of),
            "name": np.array(names),
            "target_W_sr": values[:, 0, 0],
            "target_standard_error_W_sr": values[:, 0, 1],
            "scene_W_sr": values[:, 1, 0],
            "scene_standard_error_W_sr": values[:, 1, 1],
        }


def write_vtk(path, signature: Signature) -> None:
    """Write the facets of a signature as a .vtp or .vtu file."""
    polygons.write_vtk(path, signature.facets)
