"""What a cavity's TOML file says: its shape, wall, view and uncertainties."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import radians
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from mi_lcair import toml_table
from mi_lcair.declared import Bounds, Described, entry, excludes, one_of, rule
from mi_lcair.errors import InputError, check_known
from mi_lcair.estimate import Stated, sigmas
from mi_lcair.laboratory.cavities.rings import Beam, CavityView, Cone, HemisphereView
from mi_lcair.laboratory.cavities.shape import OwnMesh, Shape
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.materials import NamedMaterial, bands_of, material
from mi_lcair.physics.spectra.files import spectrum_of
from mi_lcair.table import read_table
from mi_lcair.toml_table import check_tables, filled

KELVIN = {"lower": 10, "upper": 6000, "unit": "K"}
WAVELENGTHS = {"lower": 0.2, "upper": 100, "unit": "um"}
TABLES = ("shape", "wall", "view", "sigma")
# What may have an uncertainty. temperature_K: common to the whole wall. gradient_K: of the
# temperature of the aperture's edge against the deepest point, linear in depth.
SIZES = ("radius_m", "length_m", "angle_deg", "aperture_radius_m")
SIGMA = ("emissivity", "specular", "temperature_K", "gradient_K", *SIZES)
OF_A_WALL = (
    one_of("emissivity", "spectrum", "material"),
    excludes("specular", "material", why="it goes with emissivity or spectrum"),
    excludes("temperature_K", "profile"),
)
OF_A_VIEW = (
    rule(lambda t: t.wavelengths_um, "wavelengths_um is empty; give one or more"),
    rule(
        lambda t: not t.angle_deg or t.direction == "normal" and t.distance_m is None,
        'angle_deg needs from = "normal" and no distance_m',
    ),
)
ROUNDED = 1e-3  # part of the depth that a profile may lack, because its last row is rounded


@dataclass(frozen=True, kw_only=True)
class WallTable(Described, where="[wall]", rules=OF_A_WALL):
    """[wall]: one of emissivity, spectrum and material, and the temperature.

    Attributes
    ----------
    emissivity : float or None
        Emissivity at all wavelengths and angles.
    spectrum : str or None
        CSV file wavelength_um,emissivity.
    material : str or None
        Name of a material with a reflection model.
    specular : float
        Specular share of the reflectance; the rest is diffuse. Not for a material.
    temperature_K : float or None
        Temperature of an isothermal wall; None: 300 K.
    profile : str or None
        CSV file z_m,kelvin: temperatures at depths below the aperture's plane.
    """

    emissivity: float | None = entry(None, upper=1, is_positive=True)
    spectrum: str | None = None
    material: str | None = None
    specular: float = entry(0.0, lower=0, upper=1)
    temperature_K: float | None = entry(None, **KELVIN)
    profile: str | None = None


@dataclass(frozen=True, kw_only=True)
class ViewTable(Described, where="[view]", rules=OF_A_VIEW):
    """[view], whose key `from` is `direction` here.

    Attributes
    ----------
    direction : str
        "hemisphere": all directions; "normal": parallel to the axis.
    angle_deg : float
        Angle of parallel rays to the axis, with "normal".
    distance_m : float or None
        Distance of a small detector on the axis from the aperture, in place of a direction.
    spot_m : float or None
        Diameter of the circle in the aperture that is viewed; None: the whole aperture.
    wavelengths_um : tuple of float
        Wavelengths of the results.
    reference_K : float or None
        Temperature of the blackbody to which the radiance is compared; None: that of the deepest
        point.
    """

    direction: Literal["hemisphere", "normal"] = "hemisphere"
    angle_deg: float = entry(0.0, lower=0, upper=89, unit="degrees")
    distance_m: float | None = entry(None, is_positive=True, unit="m")
    spot_m: float | None = entry(None, is_positive=True, unit="m")
    wavelengths_um: tuple[float, ...] = entry((4.0, 10.0), **WAVELENGTHS)
    reference_K: float | None = entry(None, **KELVIN)

    def of(self, shape: Shape | OwnMesh) -> CavityView:
        """The view of a shape; raises InputError for a spot that the aperture does not hold."""
        spot = shape.aperture if self.spot_m is None else self.spot_m / 2
        if spot > shape.aperture * (1 + 1e-9):
            raise InputError(
                f"view: spot_m = {self.spot_m:g} is wider than the aperture, "
                f"{2 * shape.aperture:g} m"
            )
        if self.distance_m is not None:
            return Cone(spot, self.distance_m)
        if self.direction == "normal":
            return Beam(spot, radians(self.angle_deg))
        return HemisphereView(spot)


@dataclass(frozen=True)
class CavityDescription:
    """A cavity: shape, wall, view and uncertainties.

    sigma: standard uncertainty of each of the quantities SIGMA. shift, gradient: change of the
    wall's temperature [K], and of that of the aperture's edge against the deepest point. folder:
    that of the files that it names.
    """

    name: str
    shape: Shape | OwnMesh
    wall: WallTable
    seen: ViewTable
    sigma: dict[str, Stated]
    folder: Path
    shift: float = 0.0
    gradient: float = 0.0
    offset: float = 0.0  # change of the wall's emissivity

    @staticmethod
    def read(cavity: str | PathLike[str] | Mapping) -> "CavityDescription":
        """A TOML file, or its tables; raises InputError for what cannot be used."""
        return toml_table.read(cavity, CavityDescription.of, "cavity")

    @staticmethod
    def of(tables: Mapping, folder: Path, name: str) -> "CavityDescription":
        """The description of the tables of a file in a folder."""
        check_tables(TABLES, tables)
        for key in ("shape", "wall"):
            if key not in tables:
                raise InputError(f"table [{key}] is missing")
        shape, view = tables["shape"], tables.get("view", {})
        if isinstance(shape, Mapping) and "mesh" in shape:
            shape = OwnMesh.read(shape, folder)
        else:
            shape = filled(Shape, shape, "[shape]")
        if isinstance(view, Mapping) and "from" in view:
            view = {("direction" if key == "from" else key): value for key, value in view.items()}
        described = CavityDescription(
            name=name,
            shape=shape,
            wall=filled(WallTable, tables["wall"], "[wall]"),
            seen=filled(ViewTable, view, "[view]"),
            sigma=sigmas(tables),
            folder=folder,
        )
        check_known("quantity of [sigma]", SIGMA, *described.sigma)
        for quantity in described.sigma:
            if not described.has(quantity):
                raise InputError(f"sigma: {quantity}: the cavity has no such number")
        if described.wall.profile is not None:
            described.check_profile()
        return described

    @property
    def view(self) -> CavityView:
        return self.seen.of(self.shape)

    @property
    def wavelengths_um(self) -> np.ndarray:
        return np.array(self.seen.wavelengths_um)

    def temperature(self, depths: np.ndarray) -> np.ndarray:
        """Temperature of the wall at depths [m], [K]."""
        change = self.shift + self.gradient * (1 - depths / self.shape.depth)
        if self.wall.profile is None:
            return np.full(np.shape(depths), self.wall.temperature_K or 300.0) + change
        return np.interp(depths, *self.profile()) + change

    def profile(self) -> tuple[np.ndarray, np.ndarray]:
        """Depths [m] and temperatures [K] of the profile; raises InputError for unusable ones."""
        path = self.folder / self.wall.profile
        table = read_table(path, ("z_m", "kelvin"), "profile").numbers(("z_m", "kelvin"))
        z, kelvin = table["z_m"], table["kelvin"]
        if len(z) < 2 or (np.diff(z) <= 0).any():
            raise InputError(f"{path}: z_m must rise, over two rows or more")
        for value in kelvin:
            Bounds(**KELVIN).check(float(value), f"{path}: kelvin")
        return z, kelvin

    def check_profile(self) -> None:
        """Raise InputError for a profile that does not cover the cavity."""
        z, _ = self.profile()
        if z[0] > 1e-9 or z[-1] < self.shape.depth * (1 - ROUNDED):
            raise InputError(
                f"{self.folder / self.wall.profile}: covers z_m {z[0]:g}..{z[-1]:g}; the cavity "
                f"needs 0..{self.shape.depth:g}"
            )

    @property
    def is_isothermal(self) -> bool:
        """Whether all of the wall has the temperature of the reference."""
        at_reference = self.seen.reference_K in (None, self.wall.temperature_K or 300.0)
        return self.wall.profile is None and at_reference and not (self.shift or self.gradient)

    @property
    def reference(self) -> float:
        """Temperature of the reference [K], that of the deepest point if none is stated."""
        if self.seen.reference_K is not None:
            return self.seen.reference_K
        unchanged = replace(self, shift=0.0, gradient=0.0)
        return float(unchanged.temperature(np.array([self.shape.depth]))[0])

    def surfaces(self) -> list:
        """The wall at each wavelength: its emissivity, or a `NamedMaterial`."""
        if self.wall.material is not None:
            return [self.material_at(wavelength) for wavelength in self.wavelengths_um]
        if self.wall.spectrum is None:
            return [self.wall.emissivity + self.offset] * len(self.wavelengths_um)
        path = self.folder / self.wall.spectrum
        x, y = spectrum_of(path, "emissivity")
        lowest, highest = self.wavelengths_um.min(), self.wavelengths_um.max()
        if lowest < x[0] or highest > x[-1]:
            raise InputError(f"{path}: wavelength_um must cover {lowest:g}..{highest:g}")
        values = np.interp(self.wavelengths_um, x, y) + self.offset
        return np.clip(values, 1e-6, 1).tolist()

    def material_at(self, wavelength: float) -> NamedMaterial | float:
        """The material in a band that holds the wavelength [um]; a number for a grey one."""
        known = bands_of(self.wall.material)
        for name in known:
            if name == "any":
                return grey_or_not(material(self.wall.material, None))
            band = band_of(name)
            if band.lower_um <= wavelength <= band.upper_um:
                return grey_or_not(material(self.wall.material, band))
        raise InputError(
            f"wall: material '{self.wall.material}' is known for {', '.join(known)}; "
            f"not at {wavelength:g} um"
        )

    def has(self, quantity: str) -> bool:
        """Whether the cavity has a quantity of [sigma]."""
        if quantity in ("emissivity", "specular"):
            return self.wall.material is None
        of_the_wall = quantity in ("temperature_K", "gradient_K")
        return of_the_wall or getattr(self.shape, quantity, None) is not None

    def value_of(self, quantity: str) -> float | None:
        """Value of a quantity of [sigma]; None for the wall's emissivity by wavelength."""
        if quantity == "gradient_K":
            return self.gradient
        if quantity == "temperature_K":
            return self.wall.temperature_K or self.reference
        if quantity in ("emissivity", "specular"):
            return getattr(self.wall, quantity)
        return getattr(self.shape, quantity)

    def changed(self, quantity: str, change: float) -> "CavityDescription":
        """The cavity with a changed quantity of [sigma]."""
        if quantity == "temperature_K":
            return replace(self, shift=self.shift + change)
        if quantity == "gradient_K":
            return replace(self, gradient=self.gradient + change)
        if quantity == "emissivity":
            return replace(self, offset=self.offset + change)
        table = "wall" if quantity == "specular" else "shape"
        value = getattr(getattr(self, table), quantity) + change
        return replace(self, **{table: replace(getattr(self, table), **{quantity: value})})


def grey_or_not(entry: NamedMaterial) -> NamedMaterial | float:
    """The emissivity of a grey material; any other material itself."""
    return entry.parameters["emissivity"] if entry.model.name == "grey" else entry
