"""The BRDF of a material over the hemisphere of reflection (thesis Figures 2.9, 3.14), as numbers."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from drjit.llvm.ad import Array3f64, Float64

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.materials import Material, material

HORIZON = 89.9  # degrees; the last theta_r


@dataclass(frozen=True)
class BRDFView:
    """The raw model, f_r [1/sr], of light that comes in at theta_i. theta_r (m,), azimuth (n,),
    both in degrees: the azimuth is 0 in the mirror direction's half of the plane of incidence and
    180 in the source's. brdf (m, n); cut: in-plane, f_r at the signed angles cut_theta_r, positive
    on the mirror direction's side. dhr at theta_i; emissivity: 1 - HDR (Kirchhoff), at theta_i too,
    but as seen by an observer.
    """

    material: Material
    band: Band
    theta_i: float
    theta_r: np.ndarray
    azimuth: np.ndarray
    brdf: np.ndarray
    cut_theta_r: np.ndarray
    cut: np.ndarray
    dhr: float
    emissivity: float


def brdf_view(
    name: str, band: str, theta_i_deg: float = 30.0, materials: str | Path | None = None
) -> BRDFView:
    """The BRDF of a material (a name or a fit's JSON file) in a band, for incidence at theta_i_deg
    degrees. materials: a TOML file of the user's own, consulted first.
    """
    if not 0 <= theta_i_deg < 90:
        raise InputError(f"theta = {theta_i_deg:g} degrees must lie in 0..90, 90 excluded")
    band = band_of(band)
    found = material(name, band, materials)
    S = found.surface()
    width = float(found.model.lobe_width(S)[0])
    theta_r = crowded(0, HORIZON, 2, theta_i_deg, width)
    azimuth = crowded(-180, 180, 2, 0, width)
    cut_theta_r = crowded(-HORIZON, HORIZON, 0.2, theta_i_deg, width)
    grid = np.meshgrid(theta_r, azimuth, indexing="ij")
    theta_i = Float64(np.radians(theta_i_deg))
    f = partial(brdf, found.model, S, theta_i_deg)
    return BRDFView(
        material=found,
        band=band,
        theta_i=theta_i_deg,
        theta_r=theta_r,
        azimuth=azimuth,
        brdf=f(*grid),
        cut_theta_r=cut_theta_r,
        cut=f(cut_theta_r, np.zeros_like(cut_theta_r)),
        dhr=float(found.model.DHR(S, theta_i)[0]),
        emissivity=1 - min(1.0, float(found.model.HDR(S, theta_i)[0])),
    )


def brdf(model, S, theta_i, theta_r, azimuth) -> np.ndarray:
    """f_r [1/sr] at angles in degrees, azimuth from the mirror direction; shape of theta_r."""
    theta_i, theta, phi = (np.radians(angle) for angle in (theta_i, theta_r, azimuth))
    r = Array3f64(
        np.array(
            [-np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
        ).reshape(3, -1)
    )
    return (
        model.f(S, Array3f64(float(np.sin(theta_i)), 0, float(np.cos(theta_i))), r)
        .numpy()
        .reshape(np.shape(theta_r))
    )


def crowded(lower: float, upper: float, step: float, peak: float, width: float) -> np.ndarray:
    """Angles [degrees] over a range, about a step apart but crowded around a peak.

    width: of the peak, a tangent.
    """
    width = np.degrees(width)
    reach = np.arcsinh(180 / width)
    around = peak + width * np.sinh(np.linspace(-reach, reach, 121))
    inside = (around > lower + 1e-6) & (around < upper - 1e-6)
    return np.unique(
        np.concatenate(
            [np.linspace(lower, upper, round((upper - lower) / step) + 1), around[inside]]
        )
    )
