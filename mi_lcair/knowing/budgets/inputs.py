"""Values and covariance of the uncertain quantities of one result."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mi_lcair.errors import InputError, errors_of, option, unknown
from mi_lcair.estimate import Contribution, Distribution, deviation
from mi_lcair.knowing.budgets.uncertainties import Uncertainties, of_material
from mi_lcair.rendering.parameters.entries import Parameter


@dataclass(frozen=True)
class Group:
    """Quantities with correlated errors, or one quantity. index: their numbers among all."""

    label: str
    index: np.ndarray


@dataclass(frozen=True)
class Inputs:
    """The uncertain quantities of a result.

    Attributes
    ----------
    quantities : list of Parameter
        K quantities.
    covariance : ndarray, shape (K, K)
        Covariance of their errors.
    groups : list of Group
        The quantities whose errors are independent of those of all others.
    distributions : dict of str to Distribution
        Those of the quantities that are not normal, by name.
    """

    quantities: list[Parameter]
    covariance: np.ndarray
    groups: list[Group]
    distributions: dict[str, Distribution] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        return [quantity.name for quantity in self.quantities]

    @property
    def values(self) -> np.ndarray:
        return np.array([quantity.value for quantity in self.quantities])

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations, (K,)."""
        return np.sqrt(np.diag(self.covariance))

    def covariance_of(self, group: Group) -> np.ndarray:
        """Covariance of the quantities of a group, (n, n)."""
        return self.covariance[np.ix_(group.index, group.index)]

    def contributions(self, derivative: np.ndarray, errors: np.ndarray) -> list[Contribution]:
        """What the groups contribute to a result.

        derivative, errors: derivatives of the result, and their standard errors, (K,).
        """
        kinds = {name: of_name.words for name, of_name in self.distributions.items()}
        rows = [
            Contribution.of(
                quantity.name,
                float(sigma),
                float(slope),
                value=quantity.value,
                sensitivity_error=float(error),
                unit=quantity.unit,
                distribution=kinds.get(quantity.name, ""),
            )
            for quantity, sigma, slope, error in zip(
                self.quantities, self.sigma, derivative, errors
            )
        ]
        return [
            Contribution.together(
                group.label, [rows[k] for k in group.index], self.covariance_of(group)
            )
            for group in self.groups
        ]

    @staticmethod
    def of(uncertainties: Uncertainties, known: dict[str, Parameter], what: str) -> "Inputs":
        """The quantities that a result knows, with the uncertainties that were stated for them.

        A parameter of a material that states its sigma has this one, unless another is stated.

        Parameters
        ----------
        uncertainties : Uncertainties
        known : dict of str to Parameter
            All quantities on which the result depends, by name.
        what : str
            Name of the scene or scenario in messages.

        Raises
        ------
        InputError
            If a name is unknown, a relative uncertainty is one of zero, a fit belongs to another
            material, or two statements concern the same quantity.
        """
        with errors_of(uncertainties.source):
            return gathered(uncertainties, known, what)


def gathered(uncertainties: Uncertainties, known: dict[str, Parameter], what: str) -> Inputs:
    def quantity(name: str) -> Parameter:
        if name not in known:
            if name.startswith("scenario.") and not any(
                key.startswith("scenario.") for key in known
            ):
                raise InputError(
                    f"'{name}' is a quantity of a contrast scenario, and {what} is a scene"
                )
            raise unknown(f"quantity of {what}", name, known)
        return known[name]

    blocks: list[tuple[str, list[Parameter], np.ndarray]] = []
    for material, fits in uncertainties.fits.items():
        present = {
            name.removeprefix(f"{material}."): entry.value
            for name, entry in known.items()
            if entry.kind == "material" and name.startswith(f"{material}.")
        }
        if not present:
            materials = {
                name.rpartition(".")[0] for name, entry in known.items() if entry.kind == "material"
            }
            raise unknown(f"material of {what}", material, materials)
        fit = of_material(fits, material, present)
        free = np.diag(fit.covariance) > 0  # a parameter that the fit held has no error
        names = [name for name, is_free in zip(fit.values, free) if is_free]
        blocks.append(
            (
                f"{material} (fit)",
                [known[f"{material}.{name}"] for name in names],
                fit.covariance[np.ix_(free, free)],
            )
        )
    of_materials = {
        name: entry.sigma
        for name, entry in known.items()
        if entry.sigma and name.rpartition(".")[0] not in uncertainties.fits
    }
    all_stated = of_materials | uncertainties.sigma
    distributions = {
        name: Distribution.of(name, stated, quantity(name).value)
        for name, stated in all_stated.items()
        if isinstance(stated, Mapping)
    }
    sigma = {
        name: deviation(name, stated, quantity(name).value) for name, stated in all_stated.items()
    }
    together = set()
    for group in uncertainties.correlated:
        spread = np.array([sigma[name] for name in group.names])
        matrix = group.correlation * np.outer(spread, spread)
        together.update(group.names)
        blocks.append((" & ".join(group.names), [quantity(name) for name in group.names], matrix))
    blocks += [
        (name, [known[name]], np.array([[spread**2]]))
        for name, spread in sigma.items()
        if name not in together
    ]
    quantities = [entry for _, entries, _ in blocks for entry in entries]
    if not (quantities or uncertainties.facets):
        raise InputError(
            f"nothing of {what} is uncertain: no material has a sigma; give "
            f"{option('uncertainties')}"
        )
    names = [entry.name for entry in quantities]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"'{name}' has more than one uncertainty; give each only once")
    covariance, groups, first = np.zeros((len(names),) * 2), [], 0
    for label, entries, matrix in blocks:
        index = np.arange(first, first + len(entries))
        covariance[np.ix_(index, index)] = matrix
        groups.append(Group(label, index))
        first += len(entries)
    return Inputs(quantities, covariance, groups, distributions)
