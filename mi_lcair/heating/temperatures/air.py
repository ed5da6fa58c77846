"""Heat that air takes from a surface: wind and stability over ground, plates, evaporation.

All functions take complex numbers, so that a complex step gives their derivatives. What is compared
is then the real part.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

KARMAN, GRAVITY = 0.4, 9.81  # constant of Karman, and gravity [m/s^2]
HEAT_CAPACITY, GAS = 1005.0, 287.05  # of air [J kg^-1 K^-1]
PRANDTL = 0.71
LEAST_WIND = 0.3  # wind below which profiles do not hold [m/s]
STABILITY = (-10.0, 5.0)  # range of height over Obukhov length
GUST, MIXED_LAYER = 1.2, 1000.0  # gusts over convective velocity [Beljaars 1995], and its depth [m]
MELTING, MELTS = 273.15, 1.0  # temperature of melting, and the width over which ice turns [K]
STEP = 1e-30  # of complex steps
MOST_STEPS = 60  # of Newton's iteration; each at least halves the bracket


@dataclass(frozen=True)
class SurfaceAir:
    """The air at one time.

    kelvin, wind [m/s], humidity (relative, of water, in percent), pressure [hPa]. wind_height,
    height: of the wind and of the temperature above the ground [m].
    """

    kelvin: complex
    wind: complex = 0.0
    humidity: complex = 0.0
    pressure: complex = 1013.25
    wind_height: complex = 10.0
    height: complex = 2.0

    @property
    def density(self) -> complex:
        """Density [kg/m^3]."""
        return 100 * self.pressure / (GAS * self.kelvin)


# Wind over rough ground
# ----------------------
# The profiles of Monin and Obukhov, with the functions of Businger and Dyer in unstable [Paulson
# 1970] and of Holtslag and De Bruin [1988] in stable air. Where the ground is warmer than the air,
# gusts of free convection add to the wind [Beljaars 1995].


def psi_momentum(zeta):
    """psi of momentum at a height over the Obukhov length."""
    is_stable = np.real(zeta) >= 0
    x = (1 - 16 * np.where(is_stable, 0, zeta)) ** 0.25
    unstable = 2 * np.log((1 + x) / 2) + np.log((1 + x * x) / 2) - 2 * np.arctan(x) + np.pi / 2
    return np.where(is_stable, psi_stable(zeta), unstable)


def psi_heat(zeta):
    """psi of heat at a height over the Obukhov length."""
    is_stable = np.real(zeta) >= 0
    x2 = (1 - 16 * np.where(is_stable, 0, zeta)) ** 0.5
    return np.where(is_stable, psi_stable(zeta), 2 * np.log((1 + x2) / 2))


def psi_stable(zeta):
    """psi in stable air, of momentum as of heat; not to be used where zeta < 0."""
    s = np.where(np.real(zeta) >= 0, zeta, 0)
    return -(0.7 * s + 0.75 * (s - 5 / 0.35) * np.exp(-0.35 * s) + 0.75 * 5 / 0.35)


def rough_profile(zeta, warmer, air: SurfaceAir, roughness, of_heat):
    """Coefficient of convection [W m^-2 K^-1], and the zeta that follows from it.

    warmer: surface less air [K]. roughness, of_heat: lengths of momentum and heat [m].
    """
    per_m = zeta / air.wind_height
    f_m = np.log(air.wind_height / roughness) - psi_momentum(zeta) + psi_momentum(per_m * roughness)
    f_h = np.log(air.height / of_heat) - psi_heat(per_m * air.height) + psi_heat(per_m * of_heat)
    transfer = KARMAN**2 / (f_m * f_h)
    wind = air.wind if np.real(air.wind) > LEAST_WIND else LEAST_WIND
    # The effective wind V has V^2 = U^2 + (GUST w)^2, w^3 = buoyancy V, a cubic for y = V^(2/3)
    buoyancy = GRAVITY * MIXED_LAYER / air.kelvin * transfer * warmer
    gust = np.where(np.real(warmer) > 0, buoyancy, 1e-60) ** (1 / 3) * GUST
    y, gust2 = (wind**2 + gust**3) ** (1 / 3), gust**2
    for _ in range(5):  # quadratic, from 5 % at most
        y = y - (y**3 - gust2 * y - wind**2) / (3 * y**2 - gust2)
    V = y**1.5
    h = air.density * HEAT_CAPACITY * transfer * V
    return h, -GRAVITY * air.wind_height * warmer * f_m**2 / (air.kelvin * f_h * V**2)


@lru_cache(maxsize=64)  # columns of a step ask for the same again
def stability(warmer: bytes, air: SurfaceAir, roughness: float, of_heat: float):
    """zeta, derivative of its residual, and whether it lies within its bounds; all real.

    Newton's iteration within a bracket. warmer: the array (n,) of surface less air [K].
    """
    real, rest = np.frombuffer(warmer), (air, roughness, of_heat)
    least = np.where(real > 0, STABILITY[0], 0.0)
    most = np.where(real > 0, 0.0, STABILITY[1])
    bound = np.where(real > 0, least, most)
    follows = rough_profile(bound, real, *rest)[1]
    is_inside = (follows > STABILITY[0]) & (follows < STABILITY[1])
    zeta, slope = np.where(is_inside, follows, bound), np.ones(len(real))
    for _ in range(MOST_STEPS if is_inside.any() else 0):
        at = zeta + 1j * STEP
        surplus = at - rough_profile(at, real, *rest)[1]
        slope = surplus.imag / STEP
        least = np.where(surplus.real > 0, least, zeta)
        most = np.where(surplus.real > 0, zeta, most)
        new = zeta - surplus.real / slope
        new = np.where((new >= least) & (new <= most), new, (least + most) / 2)
        change, zeta = abs(new - zeta), np.where(is_inside, new, zeta)
        if (change <= 1e-10 * (1e-3 + abs(zeta)))[is_inside].all():
            break
    return zeta, slope, is_inside


def rough_convection(kelvin, air: SurfaceAir, roughness, of_heat):
    """Coefficient of convection over rough ground of some temperatures [W m^-2 K^-1].

    A last step of Newton with the complex inputs gives zeta their derivatives.
    """
    warmer = kelvin - air.kelvin
    plain = SurfaceAir(*(float(np.real(value)) for value in vars(air).values()))
    lengths = float(np.real(roughness)), float(np.real(of_heat))
    zeta, slope, is_inside = stability(np.real(warmer).astype(float).tobytes(), plain, *lengths)
    apart = zeta - rough_profile(zeta, warmer, air, roughness, of_heat)[1]
    zeta = np.where(is_inside, zeta - 1j * np.imag(apart) / slope, zeta)
    return rough_profile(zeta, warmer, air, roughness, of_heat)[0]


# Plates
# ------


def plate_convection(kelvin, air: SurfaceAir, length, facing: str):
    """Coefficient of convection of a plate, natural and by wind [W m^-2 K^-1].

    Natural: Raithby and Hollands (Handbook of Heat Transfer, 3rd ed., 1998) for plates that face up
    or down, and Churchill and Chu (1975) for upright ones. By wind: laminar and turbulent flow
    along the plate (VDI Heat Atlas). The cubes of both add.

    length: side of a square plate, along the wind, or the height of an upright one [m]. Natural
    convection of a level plate has the length of its area over its perimeter, a quarter of that.
    """
    film = (kelvin + air.kelvin) / 2
    conductivity = 0.0241 * (film / MELTING) ** 0.81
    viscosity = 1.458e-6 * film**1.5 / (film + 110.4) * GAS * film / (100 * air.pressure)
    warmer = kelvin - air.kelvin
    size = np.where(np.real(warmer) < 0, -warmer, warmer) + 1e-9
    height = length if facing == "upright" else length / 4
    rayleigh = GRAVITY / film * size * height**3 * PRANDTL / viscosity**2
    if facing == "upright":
        factor = (1 + (0.492 / PRANDTL) ** (9 / 16)) ** (8 / 27)
        natural = (0.825 + 0.387 * rayleigh ** (1 / 6) / factor) ** 2
    else:
        is_warm = (np.real(warmer) > 0) == (facing == "up")
        thin = 0.835 * 0.515 * rayleigh**0.25
        laminar = 1.4 / np.log(1 + 1.4 / thin)
        outward = (laminar**10 + (0.14 * rayleigh ** (1 / 3)) ** 10) ** 0.1
        still = 0.527 / (1 + (1.9 / PRANDTL) ** 0.9) ** (2 / 9) * rayleigh**0.2
        natural = np.where(is_warm, outward, 2.5 / np.log(1 + 2.5 / still))
    reynolds = air.wind * length / viscosity + 1e-9
    laminar = 0.664 * reynolds**0.5 * PRANDTL ** (1 / 3)
    turbulent = 0.037 * reynolds**0.8 * PRANDTL
    turbulent = turbulent / (1 + 2.443 * reynolds**-0.1 * (PRANDTL ** (2 / 3) - 1))
    forced = (laminar**2 + turbulent**2) ** 0.5
    return conductivity * ((natural / height) ** 3 + (forced / length) ** 3) ** (1 / 3)


# Humidity
# --------


def vapour_pressure(kelvin, over_ice: bool = True):
    """Saturation pressure over water, or over ice where it is colder [Pa], by Magnus."""
    celsius = kelvin - MELTING
    water = 611.2 * np.exp(17.62 * celsius / (celsius + 243.12))
    ice = 611.2 * np.exp(22.46 * celsius / (celsius + 272.62))
    return np.where(over_ice & (np.real(celsius) < 0), ice, water)


def evaporation(kelvin, h, air: SurfaceAir, wetness=None, resistance=None):
    """Heat that evaporation takes from a surface; of dew and frost it is negative [W m^-2].

    wetness: share of a wet surface, 0 to 1, in place of which a resistance [s/m] may be given. On
    dew and frost, which are wet, neither acts. h: coefficient of convection.
    """
    vapour = air.humidity / 100 * vapour_pressure(air.kelvin, over_ice=False)
    surplus = vapour_pressure(kelvin) - vapour
    if resistance is not None:
        wetness = 1 / (1 + resistance * h / (air.density * HEAT_CAPACITY))
    ice = (MELTING + MELTS / 2 - kelvin) / MELTS
    ice = np.where(np.real(ice) > 1, 1, np.where(np.real(ice) < 0, 0, ice))
    latent = 2.501e6 - 2361 * (kelvin - MELTING) + 3.34e5 * ice
    rate = h / HEAT_CAPACITY * 0.622 / (100 * air.pressure) * surplus
    return latent * rate * np.where(np.real(surplus) > 0, wetness, 1)


def sky_temperature(air_K, humidity, cloud=0.0):
    """Temperature of a blackbody with the radiance of a sky of some humidity and cloud [K].

    Clear: Brutsaert (1975). Cloud, 0 to 1: Unsworth and Monteith (1975).
    """
    vapour = humidity / 100 * vapour_pressure(air_K, over_ice=False) / 100
    clear = 1.24 * (vapour / air_K) ** (1 / 7)
    return ((1 - 0.84 * cloud) * clear + 0.84 * cloud) ** 0.25 * air_K


def longwave_temperature(irradiance):
    """Temperature of a blackbody sky with a measured irradiance [W m^-2]."""
    return (irradiance / STEFAN_BOLTZMANN) ** 0.25
