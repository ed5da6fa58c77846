"""The fluxes that `audit` returns."""

from dataclasses import dataclass, field

import numpy as np

from mi_lcair.results import Result
from mi_lcair.results.reading import built


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Fluxes of a scene, with their standard errors.

    Attributes
    ----------
    scene_name, band : str
        Names of the scene and of its band.
    total : dict
        {name: (value, standard error)}, W, with the names emitted, absorbed, escaped, behind,
        created, unfinished and balance. The balance is emitted + created less the other fluxes. It
        is 0 except for its error. `emitted` includes the sunlight through a disc that covers
        everything but the sky.
    materials : dict
        {material: {name: (value, standard error)}}, W, with the names of `Flux`.
    shares : dict
        The same fluxes as shares. Under "scene" they are shares of the flux that the scene emits,
        under a material shares of the flux that arrives at the material.
    by_reflection : list of tuple
        (share, standard error) of the emitted flux that leaves surfaces after its first, second,
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
    total: dict[str, tuple[float, float]]
    materials: dict[str, dict[str, tuple[float, float]]]
    shares: dict[str, dict[str, tuple[float, float]]]
    remarks: list[str]
    photons: int
    by_reflection: list[tuple[float, float]] = field(default_factory=list)
    facets: dict[str, np.ndarray] = field(default_factory=dict)

    kind = "audit"

    def summary(self) -> str:
        """One line with the emitted flux and the balance."""
        flux, error = self.total["emitted"]
        share, share_error = self.shares["scene"]["balance"]
        return (
            f"audit of {self.scene_name}, {self.band}: {flux:.5g} +- {error:.2g} W emitted, "
            f"balance {100 * share:.2g} +- {100 * share_error:.1g} % of it (standard errors), "
            f"{len(self.remarks) or 'no'} remarks"
        )

    def entries(self) -> dict:
        """Entries for JSON: fluxes with the names value_W and standard_error_W, and shares."""

        def plain(fluxes, value_name, error_name):
            return {
                name: {value_name: value, error_name: error}
                for name, (value, error) in fluxes.items()
            }

        watts = ("value_W", "standard_error_W")
        return {
            "scene_name": self.scene_name,
            "band": self.band,
            "total": plain(self.total, *watts),
            "photons": self.photons,
            "remarks": self.remarks,
            "by_reflection": [list(pair) for pair in self.by_reflection],
            "materials": {name: plain(flux, *watts) for name, flux in self.materials.items()},
            "shares": {
                name: plain(shares, "value", "standard_error")
                for name, shares in self.shares.items()
            },
        }

    @classmethod
    def of_entries(cls, entries: dict) -> "Audit":
        """The audit with these entries of its JSON."""

        def pairs(fluxes):
            return {name: list(flux.values()) for name, flux in fluxes.items()}

        by_material = {
            table: {name: pairs(fluxes) for name, fluxes in entries[table].items()}
            for table in ("materials", "shares")
        }
        return built(cls, entries | by_material | {"total": pairs(entries["total"])})

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
