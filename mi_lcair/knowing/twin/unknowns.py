"""Unknowns of a twin: inputs of its heat balance by group, and parameters of its scene."""

from dataclasses import dataclass, fields, replace

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.estimate import Stated, relative
from mi_lcair.heating.temperatures.description import GroupTable, LayerTable, sigmas_of
from mi_lcair.heating.temperatures.network import LAYER, OF_INERTIA, OF_LAW, OF_WALL, Network
from mi_lcair.knowing.inversion.tables import UnknownEntry
from mi_lcair.rendering.parameters.entries import Parameter

INERTIA = "inertia"  # sqrt(conductivity density heat_capacity), by a factor of the first two
OF_HEAT = ("internal_W_m2", "internal_by_hour")
KNOWN = ("h", "absorptance", "emissivity", *OF_HEAT, *OF_LAW, *OF_WALL)
# Unknowns whose differences count; those of others are logarithms of factors
LINEAR = (
    "absorptance", "emissivity", "wetness", "back_K", "back_W_m2", "radiative", *OF_HEAT,
)  # fmt: skip
OF_LAYER = tuple(f.name for f in fields(LayerTable) if f.name != "material")
LIMITS = {f.name: f.metadata["bounds"] for f in fields(GroupTable) if "bounds" in f.metadata}
# Standard deviations of what no material says; those of others are a factor of e
BROAD = {"absorptance": 0.2, "emissivity": 0.1, "wetness": 0.3, "back_K": 10.0}
BROAD |= dict.fromkeys(OF_HEAT, 100.0)
OF_PARAMETER = 0.1  # the same of a material's parameter
MATERIALS = ("material", "emissivity", "spectrum")  # kinds of parameters that may be sought
STEP = 0.01  # change of an unknown for which scenes are traced again


@dataclass(frozen=True)
class Sought:
    """An unknown at its first guess: value, standard deviation beforehand, bounds.

    name: "GROUP.KEY", or that of the scene's parameter. mean: value that is expected beforehand.
    is_traced: whether its scenes are traced again when it changes. is_of_scene: whether it is a
    parameter of the scene.
    """

    name: str
    value: float
    sigma: float
    lower: float
    upper: float
    mean: float
    is_of_scene: bool = False

    @property
    def expected(self) -> float:
        """x of what is expected beforehand."""
        return self.x_of(self.mean)

    @property
    def key(self) -> str:
        return self.name.rpartition(".")[2]

    @property
    def group(self) -> str:
        return self.name.rpartition(".")[0]

    @property
    def is_linear(self) -> bool:
        return self.is_of_scene or LAYER.fullmatch(self.key)[1] in LINEAR

    @property
    def is_traced(self) -> bool:
        return self.is_of_scene or self.key == "emissivity"

    @property
    def column(self) -> tuple[str, Stated]:
        """Name and size of the change of a balance for a change of x by 1."""
        return self.name, 1.0 if self.is_linear else "100 %"

    def x_of(self, value: float) -> float:
        """x of a value: its difference to the first guess, or the logarithm of their ratio."""
        return value - self.value if self.is_linear else float(np.log(value / self.value))

    def at(self, x: float) -> float:
        """The value for x."""
        value = self.value + x if self.is_linear else self.value * np.exp(min(x, 700.0))
        return float(np.clip(value, self.lower, self.upper))

    @property
    def limits(self) -> tuple[float, float]:
        """x of the bounds."""
        with np.errstate(divide="ignore"):
            return self.x_of(self.lower), self.x_of(self.upper)


def sought(
    name: str, given: UnknownEntry, network: Network, parameters: dict[str, Parameter]
) -> Sought:
    """An unknown with its first guess and what is known of it beforehand.

    parameters: those of the scene.
    """
    with errors_of(f"[unknowns] '{name}'"):
        group, _, key = name.rpartition(".")
        of = parameters.get(name)
        if is_of_scene := group not in network.facets.groups and of is not None:
            if of.kind not in MATERIALS:
                raise InputError(
                    f"is a {of.kind} of the scene; only parameters of materials and inputs of the "
                    "heat balance can be sought"
                )
            value, bounds, sigma = of.value, Bounds(lower=of.lower, upper=of.upper), OF_PARAMETER
        else:
            value, bounds, sigma = of_balance(group, key, network)
        is_linear = Sought(name, 1, 1, 0, 1, 1, is_of_scene).is_linear
        if given.prior is not None:
            value, sigma = given.prior
        mean, value = value, value if given.start is None else given.start
        lower = bounds.lower if given.lower is None else given.lower
        upper = bounds.upper if given.upper is None else given.upper
        Bounds(lower=lower, upper=upper).check(value, key)
        if not is_linear:
            if not (mean > 0 and value > 0):
                raise InputError(f"{key} is {min(mean, value):g}; start and prior must be positive")
            sigma = sigma / mean if given.prior is not None else sigma
        return Sought(name, value, sigma, lower, upper, mean, is_of_scene)


def of_balance(group: str, key: str, network: Network) -> tuple[float, Bounds, float]:
    """Value, bounds and standard deviation of an input of the balance; relative if not linear."""
    check_known("group", network.facets.groups, group)
    bare = (LAYER.fullmatch(key) or [key, key])[1]
    check_known("input", KNOWN, bare)
    table = network.tables[group]
    if table.temperature is not None and key not in ("absorptance", "emissivity"):
        raise InputError(f"group {group} has a fixed temperature, which {key} does not change")
    value = value_of(table, key)
    if value is None and key in ("absorptance", "emissivity"):
        value = of_surface(network, group, key)
    if value is None:
        raise InputError(f"{key} is missing; give a first guess in the heat.toml")
    known = (*table.by_material, "h") if table.material else ()
    owner = table
    if bare in OF_LAYER and table.layers:
        owner = table.layers[int(LAYER.fullmatch(key)[2])]
        known = OF_LAYER if owner.material else ()
    stated = {k: sigma for k, sigma in sigmas_of(owner).items() if k in known}.get(bare)
    sigma = stated if stated is not None else BROAD.get(bare, 1.0)
    if isinstance(sigma, str):
        sigma = relative(sigma) * (value if bare in LINEAR else 1.0)
    elif stated is not None and bare not in LINEAR:
        sigma = sigma / value
    bounds = LIMITS.get({"h": "h_factor", INERTIA: "conductivity"}.get(bare, bare))
    return float(value), bounds or Bounds(lower=1e-6, upper=1e12), sigma


def of_surface(network: Network, group: str, key: str) -> float | None:
    """Absorptance or emissivity with which a group was traced; None without sunlight."""
    of = network.facets if key == "emissivity" else network.sun
    mine = network.facets.group == network.facets.groups.index(group)
    return None if of is None else float(getattr(of, key)[mine].mean())


def value_of(table: GroupTable, key: str) -> float | None:
    """An input of a group; conductivity[1] is that of its second layer."""
    bare, number = LAYER.fullmatch(key).groups()
    if bare == INERTIA:
        wall = [getattr(table, name) for name in ("conductivity", "density", "heat_capacity")]
        return None if None in wall else float(np.sqrt(np.prod(wall)))
    is_of_layer = bare != "internal_by_hour"
    of = table.layers if is_of_layer else table.internal_by_hour
    if number is None and is_of_layer and not (of and bare in OF_LAYER):
        return getattr(table, "h_factor" if bare == "h" else bare)
    check_known("input with a number", (*OF_LAYER, "internal_by_hour"), bare)
    if number is None or int(number) >= len(of):
        what = "layers" if is_of_layer else bare
        last = f"the last one is {bare}[{len(of) - 1}]" if of else f"the heat.toml gives no {what}"
        raise InputError(f"there is no {key}; {last}")
    return getattr(of[int(number)], bare) if is_of_layer else of[int(number)]


def with_value(table: GroupTable, key: str, value: float) -> GroupTable:
    """A group with another value of an input."""
    bare, number = LAYER.fullmatch(key).groups()
    if bare == INERTIA:
        factor = value / value_of(table, INERTIA)
        wall = {name: getattr(table, name) * factor for name in OF_INERTIA}
        return replace(table, **wall)
    if number is None:
        return replace(table, **{"h_factor" if bare == "h" else bare: value})
    if bare == "internal_by_hour":
        hours = list(table.internal_by_hour)
        hours[int(number)] = value
        return replace(table, internal_by_hour=tuple(hours))
    layers = list(table.layers)
    layers[int(number)] = replace(layers[int(number)], **{bare: value})
    return replace(table, layers=tuple(layers))


def check_apart(names) -> None:
    """Raise InputError for an inertia beside a part of it."""
    for name in names:
        group, _, key = name.rpartition(".")
        for part in OF_INERTIA if key == INERTIA else ():
            if f"{group}.{part}" in names:
                raise InputError(f"[unknowns] '{name}' is a factor of '{group}.{part}'; give one")


def changed(network: Network, unknowns: list[Sought], x: np.ndarray) -> Network:
    """The network with the values of the unknowns at x, apart from those that are traced."""
    groups, more = dict(network.tables), 0.0
    for unknown, step in zip(unknowns, x):
        if unknown.is_traced:
            continue
        value, group = unknown.at(step), unknown.group
        if unknown.key == "absorptance":  # linear, also in what is reflected on others
            if (now := of_surface(network, group, "absorptance")) is not None:
                more = more + network.of_absorptance(group, 1.0) * (value - now)
            continue
        groups[group] = with_value(groups[group], unknown.key, value)
    result = replace(network, groups=groups)
    result.__dict__["light"] = network.light + more  # takes the place of the cached property
    return result


def of_others(sigmas: dict, unknowns: list[Sought], network: Network) -> dict:
    """The uncertainties without those of the unknowns.

    One of all groups, such as that of h, becomes one of each other group.
    """
    names, keys, result = {u.name for u in unknowns}, {u.key for u in unknowns}, {}
    names |= {f"{u.group}.density" for u in unknowns if u.key == INERTIA}
    for name, sigma in sigmas.items():
        if name not in keys:
            result[name] = sigma
            continue
        for group, table in network.tables.items():
            has_it = name not in OF_WALL or table.thickness_mm or table.layers
            if table.temperature is None and has_it:
                result[f"{group}.{name}"] = sigmas.get(f"{group}.{name}", sigma)
    return {name: sigma for name, sigma in result.items() if name not in names}
