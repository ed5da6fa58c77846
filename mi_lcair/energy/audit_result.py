"""The fluxes that `audit` returns."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mi_lcair.results import Result, entry
from mi_lcair.results.sections import Lines, Remarks, Table

SCENE = ("absorbed", "escaped", "behind", "created", "unfinished", "balance")
MATERIAL = ("absorbed", "reflected", "behind", "created", "scaled")


class FluxAndError(NamedTuple):
    """A flux [W], or its share of another one, with its standard error."""

    value: float
    standard_error: float

    @property
    def percent(self) -> str:
        return f"{100 * self.value:.3f} +- {100 * self.standard_error:.1g}"


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Fluxes of a scene, with their standard errors.

    Attributes
    ----------
    scene_name, band : str
        Names of the scene and of its band.
    total : dict
        {name: FluxAndError}, W, with the names emitted, absorbed, escaped, behind,
        created, unfinished and balance. The balance is emitted + created less the other fluxes. It
        is 0 except for its error. `emitted` includes the sunlight through a disc that covers
        everything but the sky.
    materials : dict
        {material: {name: FluxAndError}}, W, with the names of `photons.Flux`.
    shares : dict
        The same fluxes as shares. Under "scene" they are shares of the flux that the scene emits,
        under a material shares of the flux that arrives at the material.
    by_reflection : list of FluxAndError
        Share of the emitted flux that leaves surfaces after its first, second,
        ... reflection.
    remarks : list of str
        Notes on the scene, such as that nothing surrounds its model, and one line for each
        imbalance with the facets that cause most of it.
    photons : int
        Number of photons that were followed.
    facets : dict of str to ndarray, shape (facets,)
        Irradiance and radiant exitance (thesis Table 2.1) of each facet with their standard errors,
        W m^-2. Not in the JSON.
    """

    scene_name: str
    band: str
    total: dict[str, FluxAndError] = entry("total_W")
    materials: dict[str, dict[str, FluxAndError]] = entry("materials_W")
    shares: dict[str, dict[str, FluxAndError]]
    remarks: list[str]
    photons: int
    by_reflection: list[FluxAndError] = field(default_factory=list)
    facets: dict[str, np.ndarray] = entry(default_factory=dict)

    kind = "audit"
    heading = "Energy audit"

    def summary(self) -> str:
        """One line with the emitted flux and the balance."""
        flux, error = self.total["emitted"]
        share, share_error = self.shares["scene"]["balance"]
        return (
            f"audit of {self.scene_name}, {self.band}: {flux:.5g} +- {error:.2g} W emitted, "
            f"balance {100 * share:.2g} +- {100 * share_error:.1g} % of it (standard errors), "
            f"{len(self.remarks) or 'no'} remarks"
        )

    def facts(self) -> Iterator[Any]:
        """Energy of the scene: what is emitted, absorbed and escapes, by material."""
        yield (
            "Flux is followed from the emitters until it is absorbed or escapes. Shares of the "
            "scene are of the emitted flux."
        )
        flux, error = self.total["emitted"]
        yield "band", self.band
        yield "photons", self.photons
        yield "emitted", f"{flux:.6g} W +- {error:.2g}"
        for key in SCENE:
            yield f"{key} %", self.shares["scene"][key].percent
        yield Table(
            [
                "material",
                ("emitted", "W"),
                ("incident", "W"),
                *(f"{key} % of incident" for key in MATERIAL),
            ],
            [
                [
                    name,
                    flux["emitted"].value,
                    flux["incident"].value,
                    *(self.shares[name][key].percent for key in MATERIAL),
                ]
                for name, flux in self.materials.items()
            ],
        )
        yield (
            "What a reflection adds falls with their number: the share of the emitted flux that "
            "leaves surfaces after it."
        )
        rows = [[n, 100 * a, 100 * b] for n, (a, b) in enumerate(self.by_reflection, start=1)]
        yield Table(["reflection", "% of emitted", "standard error, %"], rows)
        nothing = ["nothing to remark: energy is conserved within the errors above"]
        yield Lines("", self.remarks or nothing)
        yield Remarks([])  # they are among the facts

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each flux of the scene and of each material: in watts, and as a share.

        A share of "scene" is that of the emitted flux, a share of a material that of the flux that
        arrives there. The column `of` tells them apart.
        """
        rows = [
            (of, name, *flux, *self.shares[of][name])
            for of, fluxes in {"scene": self.total, **self.materials}.items()
            for name, flux in fluxes.items()
        ]
        of, names, *numbers = zip(*rows)
        names_of = ("flux_W", "standard_error_W", "share", "share_standard_error")
        return {"of": np.array(of), "name": np.array(names)} | {
            name: np.array(values, dtype=float) for name, values in zip(names_of, numbers)
        }
