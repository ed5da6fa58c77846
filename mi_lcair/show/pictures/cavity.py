"""Picture of a cavity: its profile with the wall's temperature, and the effective emissivity."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.laboratory.cavities.cavity import Cavity
from mi_lcair.laboratory.cavities.shape import OwnMesh


@styled
def figure(cavity: Cavity):
    """Figure of the profile, coloured by temperature, and of the emissivity by wavelength."""
    figure = new_figure((9, 3.8), layout="constrained")
    profile, spectrum = figure.subplots(1, 2)
    r, z = outline(cavity.shape)
    drawn = profile.scatter(
        *(np.concatenate([z, z]), np.concatenate([r, -r])),
        c=np.tile(np.interp(z, cavity.depths, cavity.kelvin), 2),
        s=3,
        cmap="inferno",
    )
    figure.colorbar(drawn, ax=profile, label="wall (K)", shrink=0.8)
    spot = cavity.shape.aperture if cavity.view.spot_m is None else cavity.view.spot_m / 2
    profile.plot([0, 0], [-spot, spot], color="C0", lw=2)
    profile.annotate("viewed", (0, 0), (4, 0), textcoords="offset points", color="C0", va="center")
    profile.set(xlabel="depth (m)", ylabel="radius (m)", aspect="equal", title="profile")
    order = np.argsort(cavity.wavelengths_um)
    um = cavity.wavelengths_um[order]
    spectrum.errorbar(
        um,
        cavity.effective[order],
        2 * cavity.sigma[order],
        marker="o",
        capsize=3,
        label="effective, k = 2",
    )
    spectrum.plot(um, cavity.gouffe[order], "--", color="0.5", label="Gouffé, isothermal")
    spectrum.set(xlabel="wavelength (µm)", ylabel="emissivity", title=cavity.seen)
    spectrum.legend()
    figure.suptitle(plain(cavity.summary()), fontsize=10)
    return figure


def outline(shape) -> tuple[np.ndarray, np.ndarray]:
    """Radii and depths of points on the wall [m]: of a mesh its corners."""
    if isinstance(shape, OwnMesh):
        x, y, z = shape.triangles.corners[:-1].T
        return np.hypot(x, y), z
    if shape.kind == "sphere":
        return tuple(shape.nodes(400))
    lines = [np.linspace(a, b, 400) for a, b in zip(shape.corners(), shape.corners()[1:])]
    return tuple(np.concatenate(lines).T)
