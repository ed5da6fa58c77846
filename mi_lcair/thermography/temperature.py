"""Temperature of an object from its apparent temperature, and the budget of its uncertainty.

A camera receives the in-band radiance

    W(T_app) = epsilon tau W(T_obj) + (1 - epsilon) tau W(T_refl) + W_path              (1)

of an object of emissivity epsilon and temperature T_obj in surroundings of temperature T_refl,
through air of transmittance tau that radiates W_path = (1 - tau) W(T_air). W(T) is the integral of
Planck's law over the band. Source: the measurement formula in FLIR, Photon user's manual, chapter
History and Theory of Infrared Technology, Equations 2 to 4. For air by wavelength, tau W(T) is the
integral of transmittance and Planck's law together.
"""

from dataclasses import dataclass

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate, slope
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.thermography.air import Air
from mi_lcair.thermography.temperature_result import Temperature

KELVIN = Bounds(lower=60, upper=6000, unit="K")
# The quantities in their order in a budget
QUANTITIES = {
    "emissivity": Bounds(upper=1, is_positive=True),
    "reflected": KELVIN,
    "transmittance": Bounds(upper=1, is_positive=True),
    "air_temperature": KELVIN,
    "distance": Bounds(is_positive=True, upper=200_000, unit="m"),
    "humidity": Bounds(lower=0, upper=0.98),
}
STEP = 0.01  # half of a difference that gives a sensitivity, in standard uncertainties


@dataclass(frozen=True)
class Conditions:
    """The quantities of a measurement. quantities: the given ones of QUANTITIES, by name."""

    quantities: dict[str, Estimate]

    def checked(self) -> tuple["Conditions", list[str]]:
        """The conditions with default values for the other quantities, and remarks about these.

        Raises InputError for quantities that are missing or exclude each other.
        """
        known, remarks = dict(self.quantities), []
        if "reflected" not in known:
            if not is_one(known["emissivity"]):
                raise InputError(
                    "reflected is missing: an object of an emissivity below 1 reflects its "
                    "surroundings; give their temperature in K"
                )
            known["reflected"] = Estimate(KELVIN.lower)  # does not count
        if "distance" in known:
            if "transmittance" in known:
                raise InputError("transmittance and distance exclude each other; give one of them")
            return Conditions(known), remarks
        if "humidity" in known:
            raise InputError("humidity needs the distance; with a transmittance it does not count")
        known.setdefault("transmittance", Estimate(1.0))
        if "air_temperature" not in known:
            known["air_temperature"] = Estimate(known["reflected"].value)
            if not is_one(known["transmittance"]):
                remarks.append(
                    f"the air is taken to have the reflected temperature, "
                    f"{known['reflected'].value:g} K; air_temperature states another"
                )
        return Conditions(known), remarks

    def air(self, band: Band, values: dict[str, float]) -> Air:
        """The air for values of the quantities."""
        if "distance" not in values:
            return Air.given(band, values["transmittance"], values["air_temperature"])
        weather = Weather(values.get("air_temperature"), values.get("humidity"))
        return Air.computed(band, values["distance"], weather)


def object_temperature(apparent, emissivity: float, reflected: float, air: Air) -> np.ndarray:
    """Temperature of the object by (1), [K]; NaN where no object can have the apparent temperature.

    apparent: apparent temperatures [K]. reflected: temperature of the surroundings [K].
    """
    arriving = in_band_radiance(air.band, apparent) - air.path
    emitted = arriving - (1 - emissivity) * air.transmitted(reflected)
    return air.source_temperature(emitted / emissivity)


def temperature_of(
    apparent: np.ndarray, sigma: float, band: Band, conditions: Conditions, name: str
) -> Temperature:
    """The temperature of an object with its budget.

    Parameters
    ----------
    apparent : ndarray
        Apparent temperatures [K], of any shape; NaN for nothing.
    sigma : float
        Their standard uncertainty [K], common to all pixels.
    band : Band
    conditions : Conditions
    name : str
        Name of the image in the result.

    Raises
    ------
    InputError
        For conditions that are incomplete, and if no object can have any of the temperatures.
    """
    band.check_limits("camera")
    conditions, remarks = conditions.checked()
    stated = {"apparent": Estimate(0.0, sigma, "K"), **conditions.quantities}
    values = {quantity: number.value for quantity, number in stated.items()}

    def solved(changes: dict[str, float]) -> np.ndarray:
        new = values | changes
        air = conditions.air(band, new)
        return object_temperature(
            apparent + new["apparent"], new["emissivity"], new["reflected"], air
        )

    kelvin = solved({})
    impossible = int(np.sum(np.isnan(kelvin) & np.isfinite(apparent)))
    if impossible:
        low, high = np.nanmin(apparent), np.nanmax(apparent)
        text = (
            f"{impossible} of {np.sum(np.isfinite(apparent))} pixels are colder than what "
            f"reflection and air alone give, in an image of {low:.4g} to {high:.4g} K"
        )
        if not np.isfinite(kelvin).any():
            raise InputError(f"{name}: {text}; check emissivity, reflected and the air")
        remarks.append(f"{text}; they have no temperature (NaN)")
    rows = []
    for quantity, number in stated.items():
        if sigma := number.standard_error:
            known = quantity in QUANTITIES
            of_quantity = slope(
                lambda value, quantity=quantity: solved({quantity: value}),
                number.value,
                STEP * sigma,
                limits(QUANTITIES[quantity] if known else Bounds()),
            )
            value = number.value if known else None  # `apparent` differs from pixel to pixel
            rows.append(
                Contribution.of(quantity, sigma, of_quantity, value=value, unit=number.unit)
            )
    return Temperature(
        name=name,
        band=band,
        estimate=Estimate.of(np.asarray(kelvin), "K", rows),
        conditions=conditions.quantities,
        transmittance=conditions.air(band, values).transmittance(float(np.nanmedian(kelvin))),
        remarks=tuple(remarks),
    )


def is_one(number: Estimate) -> bool:
    """Whether a number is exactly 1."""
    return (number.value, number.standard_error) == (1, 0)


def limits(bounds: Bounds) -> tuple[float, float]:
    """Smallest and largest value of a quantity in a difference."""
    return max(bounds.lower, 1e-9 if bounds.is_positive else -np.inf), bounds.upper
