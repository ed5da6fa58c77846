"""Surroundings as commands and scenarios state them, and the emitters of scenes that they are."""

from dataclasses import dataclass
from functools import cached_property

from mi_lcair.declared import Table, entry, given, rule
from mi_lcair.errors import InputError
from mi_lcair.physics.sky import sky_names
from mi_lcair.physics.surroundings.skies import CLEAR, OVERCAST
from mi_lcair.physics.surroundings.surroundings import (
    ATMOSPHERE,
    Ground,
    Surroundings,
    surroundings,
)

BLACK = "1"  # emissivity of ground that states none


@dataclass(frozen=True)
class Words(
    Table,
    where="surroundings",
    rules=(
        rule(
            lambda t: given(t, ("sky", "ground")),
            "sky and ground are missing; give one of them, or both",
        ),
    ),
):
    """Table [surroundings] of a scenario, and the options of `mi-lcair import`.

    Attributes
    ----------
    sky : str, optional
        "clear", "overcast", a temperature, K, of an even black sky, a bundled sky or a file.
    ground : str, optional
        KELVIN or KELVIN,EMISSIVITY or KELVIN,MATERIAL: temperature of the ground, K, and its
        emissivity (1), or the material whose hemispherical emissivity it has.
    sun : str, optional
        ELEVATION, ELEVATION,AZIMUTH or ELEVATION,AZIMUTH,FILE: the sun in the scene's axes,
        degrees; azimuth 0 is +x, and 90 is +y. FILE is a CSV wavelength_um,irradiance_W_m2_um of
        what arrives at the scene, in place of that of clear air. Without a sun, it is night.
    atmosphere : str
        Clear air of sky, sun and ground: us_standard or midlat_summer. A scenario without it takes
        the clear air of its path.
    """

    sky: str | None = entry(None, is_file=True)
    ground: str | None = None
    sun: str | None = None
    atmosphere: str = ATMOSPHERE

    def complete(self) -> None:
        self.at_height(None)  # raises InputError for what cannot be used

    def at_height(self, height_m: float | None) -> Surroundings:
        """The `Surroundings` at a height [m]; the ground is black if it has a material."""
        ground = None
        if self.ground is not None:
            temperature, material = self.ground_parts
            ground = Ground(temperature, number(material) or 1.0)
        elevation = None if self.sun is None else self.sun_parts[0]
        of_sky = self.sky, ground, elevation, self.atmosphere, height_m
        return surroundings(*of_sky, sun_file=self.sun_file)

    @cached_property
    def ground_parts(self) -> tuple[float, str]:
        """Temperature of the ground [K], and its emissivity or material."""
        kelvin, _, material = self.ground.partition(",")
        temperature, material = number(kelvin), material.strip() or BLACK
        emissivity = number(material)
        if temperature is None or not 0 < temperature <= 1e5:
            raise InputError(
                f"ground {self.ground}: must be KELVIN, KELVIN,EMISSIVITY or KELVIN,MATERIAL, such "
                "as 288,0.95"
            )
        if emissivity is not None and not 0 < emissivity <= 1:
            raise InputError(f"ground {self.ground}: an emissivity must lie in 0..1, above 0")
        return temperature, material

    @cached_property
    def sun_parts(self) -> tuple[float, float]:
        """Elevation and azimuth of the sun [degrees]."""
        parts = [number(part) for part in self.sun.split(",")[:2]]
        if None in parts or number(self.sun_file or "") is not None or not 1 <= parts[0] <= 90:
            raise InputError(
                f"sun {self.sun}: must be ELEVATION, ELEVATION,AZIMUTH or ELEVATION,AZIMUTH,FILE, "
                "in degrees and with an elevation in 1..90, such as 45,120"
            )
        return parts[0], ([*parts, 0.0])[1]

    @property
    def sun_file(self) -> str | None:
        """The file of the sun's irradiance; None for the sun of clear air."""
        parts = [] if self.sun is None else self.sun.split(",", 2)
        return (parts[2].strip() or None) if len(parts) == 3 else None

    @property
    def sky_file(self) -> str | None:
        """The file of the sky; None for a sky without one."""
        known = self.sky in (None, CLEAR, OVERCAST, *sky_names()) or number(self.sky) is not None
        return None if known else self.sky

    def emitters(self, band: str) -> list[dict]:
        """Properties of the emitters `sky` and `sun` of a scene in a band."""
        sky = {"type": "sky", "band": band, "sky": self.sky or "none"}
        sky["atmosphere"] = self.atmosphere
        if self.ground is not None:
            temperature, material = self.ground_parts
            sky |= {"ground_temperature": temperature, "ground_material": material}
        if self.sun is None:
            return [sky]
        elevation, azimuth = self.sun_parts
        sun = {"type": "sun", "band": band, "air": self.sun_file or self.atmosphere}
        sun |= {"elevation_deg": elevation, "azimuth_deg": azimuth}
        sky |= {} if self.sun_file is None else {"sun_file": self.sun_file}
        return [sky | {"sun_elevation_deg": elevation, "sun_azimuth_deg": azimuth}, sun]


def number(text: str) -> float | None:
    """The finite number that a text is; None for another text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if abs(value) < 1e30 else None
