"""Tables of a material's BRDF over the hemisphere of reflection (thesis Figures 2.9, 3.14)."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from drjit.llvm.ad import Array3f64, Float64

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.materials import NamedMaterial, material
from mi_lcair.results import Result, entry

if TYPE_CHECKING:
    import xarray

HORIZON = 89.9  # largest tabulated theta_r [degrees]


@dataclass(frozen=True, repr=False)
class BRDFView(Result):
    """The BRDF of a material for one angle of incidence, with its hemispherical values.

    Attributes
    ----------
    material
        The material, with its reflection model and parameters.
    band
        Band in which the parameters hold.
    theta_i
        Angle of incidence [degrees].
    theta_r
        Angles of reflection [degrees], (m,).
    azimuth
        Azimuths of reflection [degrees], (n,): 0 in the half-plane of the mirror direction and 180
        in that of the source.
    brdf
        BRDF at theta_r and azimuth [1/sr], (m, n).
    cut_theta_r
        Signed angles in the plane of incidence [degrees], (k,), positive on the side of the mirror
        direction.
    cut
        BRDF at cut_theta_r [1/sr], (k,).
    dhr
        Directional-hemispherical reflectance for radiation that arrives at theta_i.
    emissivity
        Directional emissivity for an observer at theta_i: 1 - HDR (Kirchhoff).
    """

    material: NamedMaterial = entry("material", "name")
    band: Band = entry("band", "label")
    theta_i: float = entry("theta_i_deg")
    theta_r: np.ndarray = entry()
    azimuth: np.ndarray = entry()
    brdf: np.ndarray = entry()
    cut_theta_r: np.ndarray = entry()
    cut: np.ndarray = entry()
    dhr: float
    emissivity: float

    kind = "brdf"
    computed = {"columns": "columns"}
    drawn_by = "mi_lcair.show.pictures.brdf:figure"

    def summary(self) -> str:
        """One line with the hemispherical reflectance and the emissivity."""
        return (
            f"BRDF of {self.material.name}, {self.band.label}, incidence {self.theta_i:g} degrees: "
            f"DHR {self.dhr:.4f}, emissivity {self.emissivity:.4f}"
        )

    def columns(self) -> dict[str, np.ndarray]:
        """BRDF in the plane of incidence over the signed angle, positive at the mirror's side."""
        return {"theta_r_deg": self.cut_theta_r, "brdf_per_sr": self.cut}

    def to_xarray(self) -> "xarray.Dataset":
        """BRDF over (theta_r_deg, azimuth_deg) as an xarray Dataset.

        Raises InputError if xarray is not installed.
        """
        ticks = {"theta_r_deg": self.theta_r, "azimuth_deg": self.azimuth}
        axes = {name: (name, values) for name, values in ticks.items()}
        return self.dataset({"brdf_per_sr": (tuple(axes), self.brdf)}, axes)


def brdf_view(
    name: str, band: str, theta_i_deg: float = 30.0, materials: str | Path | None = None
) -> BRDFView:
    """Tabulate the BRDF of a material for one angle of incidence.

    Parameters
    ----------
    name
        Name of a material, or path of a fit's JSON file.
    band
        Band in any form that `mi_lcair.physics.bands.band` reads.
    theta_i_deg
        Angle of incidence, 0 <= theta_i_deg < 90 [degrees].
    materials
        TOML file of the user's own materials, which is searched first.

    Returns
    -------
    BRDFView
        The tables, dense around the lobe.

    Raises
    ------
    InputError
        If the angle is out of range, or the material or the band is unknown.
    """
    if not 0 <= theta_i_deg < 90:
        raise InputError(f"theta = {theta_i_deg:g} degrees must lie in 0..90, 90 excluded")
    band = band_of(band)
    surface_material = material(name, band, materials)
    model, S = surface_material.model, surface_material.surface()
    width = float(model.lobe_width(S)[0])
    theta_r = crowded(0, HORIZON, 2, theta_i_deg, width)
    azimuth = crowded(-180, 180, 2, 0, width)
    cut_theta_r = crowded(-HORIZON, HORIZON, 0.2, theta_i_deg, width)
    grid = np.meshgrid(theta_r, azimuth, indexing="ij")
    theta_i = Float64(np.radians(theta_i_deg))
    f = partial(brdf, model, S, theta_i_deg)
    return BRDFView(
        material=surface_material,
        band=band,
        theta_i=theta_i_deg,
        theta_r=theta_r,
        azimuth=azimuth,
        brdf=f(*grid),
        cut_theta_r=cut_theta_r,
        cut=f(cut_theta_r, np.zeros_like(cut_theta_r)),
        dhr=float(model.DHR(S, theta_i)[0]),
        emissivity=1 - min(1.0, float(model.HDR(S, theta_i)[0])),
    )


def brdf(model, S, theta_i, theta_r, azimuth) -> np.ndarray:
    """BRDF [1/sr] at theta_r and azimuth (arrays of one shape), in that shape.

    All angles are in degrees. The azimuth is measured from the mirror direction.
    """
    theta_i, theta, phi = (np.radians(angle) for angle in (theta_i, theta_r, azimuth))
    i = Array3f64(float(np.sin(theta_i)), 0, float(np.cos(theta_i)))
    r = [-np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    f = model.f(S, i, Array3f64(np.array(r).reshape(3, -1)))
    return f.numpy().reshape(np.shape(theta_r))


def crowded(lower: float, upper: float, step: float, peak: float, width: float) -> np.ndarray:
    """Angles [degrees] from lower to upper, about a step apart and denser around a peak.

    width: tangent of the peak's angular width.
    """
    width = np.degrees(width)
    reach = np.arcsinh(180 / width)
    around = peak + width * np.sinh(np.linspace(-reach, reach, 121))
    inside = (around > lower + 1e-6) & (around < upper - 1e-6)
    even = np.linspace(lower, upper, round((upper - lower) / step) + 1)
    return np.unique(np.concatenate([even, around[inside]]))
