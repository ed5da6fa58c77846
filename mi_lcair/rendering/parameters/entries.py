"""Where a scene keeps the numbers of each parameter, see `mi_lcair.rendering.parameters.values`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError, errors_of
from mi_lcair.physics.spectra.parameters import CHANGES, change_bounds
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectrum, is_reflection_bsdf
from mi_lcair.plugins.derivatives import children, nodes
from mi_lcair.plugins.emission.source import kelvin, rounded
from mi_lcair.plugins.emission.triangles import is_faceted, triangle_corners
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal, thermal_shapes
from mi_lcair.rendering.facets import area_of
from mi_lcair.rendering.motions.pose import known_motions, value_of

SCALED = ("radiance", "emissivity")  # kinds whose several numbers change by a common factor
DIFFERENCED = ("motion", "plugin")  # kinds whose derivatives are differences of renders
NEAREST = 1e-3  # fraction of the way to its lower bound that a temperature keeps away from it
AT = "at_"  # beginning of the name of a spectrum's change at a wavelength, such as "at_8500nm"
BISECTIONS = 50  # steps in the search for the bound of a feasible material parameter


@dataclass(frozen=True)
class Parameter:
    """A parameter of a scene.

    Attributes
    ----------
    name : str
        Its name, such as `self.temperature` or `gloss_black.e`.
    kind : str
        "temperature", "mode" (amplitude of a pattern of temperatures), "radiance", "emissivity",
        "material", "spectrum", "plugin" (a number of a BSDF or emitter of Mitsuba's or of yours) or
        "motion".
    value : float
        Present value; the mean if several numbers belong to the name.
    unit : str
        Unit of the value; "1" for a dimensionless parameter.
    lower, upper : float
        Smallest and largest value that `set_values` takes while the other parameters stay.
        A temperature must be above `lower`.
    sigma : float
        Standard deviation that its material states; 0 for none.
    place : tuple of float, optional
        Of a control point in the axes of the model, metres.
    """

    name: str
    kind: str
    value: float
    unit: str
    lower: float
    upper: float
    sigma: float = 0.0
    place: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class StoredNumbers:
    """Numbers of a Mitsuba object that belong to a parameter.

    node, key: the object, and the name of its array. number: index in the array of each number;
    None for the whole array. weight: weight of each number in the mean.
    """

    node: mi.Object
    key: str
    number: np.ndarray | None
    weight: np.ndarray

    @property
    def owner(self) -> tuple[mi.Object, str]:
        """The object and the array's name, which several parameters may share."""
        return self.node, self.key

    def array(self) -> np.ndarray:
        """The whole array, Float32."""
        return dr.detach(mi.traverse(self.node)[self.key]).numpy()

    def read(self) -> np.ndarray:
        array = self.array()
        return (array if self.number is None else array[self.number]).astype(float)


@dataclass(frozen=True)
class StoredParameter:
    """A parameter of a scene with the numbers that hold its value."""

    name: str
    kind: str
    stored: list[StoredNumbers]
    unit: str = "1"
    upper: float = 1.0
    lower: float = 0.0
    sigma: float = 0.0

    def numbers(self) -> list[np.ndarray]:
        return [stored.read() for stored in self.stored]

    def mean(self, numbers: list[np.ndarray]) -> float:
        values, weights = np.concatenate(numbers), np.concatenate([p.weight for p in self.stored])
        if np.ptp(values) == 0:
            return float(values[0])
        return float(np.average(values, weights=weights if weights.sum() > 0 else None))

    def moved(self, value: float) -> list[np.ndarray]:
        """The stored numbers for a new value of the parameter."""
        numbers = self.numbers()
        mean = self.mean(numbers)
        if np.ptp(np.concatenate(numbers)) == 0:
            return [np.full_like(array, value) for array in numbers]
        if self.kind in SCALED:
            return [array * (value / mean) for array in numbers]
        return [array + (value - mean) for array in numbers]

    def described(self) -> Parameter:
        numbers = self.numbers()
        value, values = self.mean(numbers), np.concatenate(numbers)
        scale = value / values.max() if values.max() > 0 else 1.0
        unit, lower = self.unit, self.lower
        if self.kind in SCALED:
            upper = self.upper * scale
        elif self.kind == "temperature":
            lower, upper = value - values.min(), self.upper - (values.max() - value)
        elif self.kind == "plugin":
            lower, upper = 0.0 if value >= 0 else -np.inf, np.inf
        elif self.model is None:
            upper = self.upper - (values.max() - value)
        else:
            unit = next(p.unit for p in self.model.parameters if p.name == self.stored[0].key)
            lower, upper = self.feasible_range(value)
        return Parameter(self.name, self.kind, value, unit, float(lower), float(upper), self.sigma)

    @property
    def model(self):
        """The reflection model of a material's surfaces; None for other parameters."""
        node = self.stored[0].node
        return node.model if is_reflection_bsdf(node) and not node.change else None

    def feasible_range(self, value: float) -> tuple[float, float]:
        """Lowest and highest feasible value of a material's parameter, the others held."""
        declared = next(p for p in self.model.parameters if p.name == self.stored[0].key)
        return self.last_feasible(value, declared.lower), self.last_feasible(value, declared.upper)

    def last_feasible(self, inside: float, end: float) -> float:
        """The value nearest to `end` that is feasible, where `inside` is."""
        if self.is_feasible(end):
            return end
        for _ in range(BISECTIONS):
            middle = (inside + end) / 2
            inside, end = (middle, end) if self.is_feasible(middle) else (inside, middle)
        return inside

    def is_feasible(self, value: float) -> bool:
        try:
            check_materials([(self, value)])
        except InputError:
            return False
        return True


@dataclass(frozen=True, kw_only=True)
class SingleNumber(StoredParameter):
    """An entry with one number of its own, such as a motion's: what it moves follows from it."""

    value: float
    place: tuple[float, float, float] | None = None
    model = None

    def numbers(self) -> list[np.ndarray]:
        return [np.array([self.value])]

    def mean(self, numbers: list[np.ndarray]) -> float:
        return float(numbers[0][0])

    def described(self) -> Parameter:
        names = "name", "kind", "value", "unit", "lower", "upper", "sigma", "place"
        return Parameter(*(getattr(self, name) for name in names))


# ---------------------------------------------------------------- Where the numbers are


def stored_parameters(scene) -> dict[str, StoredParameter]:
    """All parameters of a scene but modes, by name."""
    known = {}

    def add(emitter, shape, area):
        """Add the parameters of an emitter; area: of the primitives of its shape [m^2]."""
        for of in emitter.parameters():
            name = f"{of.group or emitter.group}.{of.name}"
            node, weight = (shape, area) if of.is_by_facet else (emitter, area.sum(keepdims=True))
            entry = known.setdefault(name, StoredParameter(name, of.kind, [], of.unit, of.upper))
            entry.stored.append(StoredNumbers(node, of.key, None, weight))

    emitting = thermal_shapes(scene.mi)
    for shape in sorted(emitting, key=lambda shape: shape.emitter().group):
        add(shape.emitter(), shape, primitive_areas(shape))
    for emitter in scene.mi.emitters():
        if is_thermal(emitter) and emitter.get_shape() is None:
            add(emitter, None, np.ones(1))
    for entry in list(known.values()):
        if entry.kind == "temperature":
            known.update(single_temperatures(entry, emitting))
    known = dict(sorted(known.items(), key=lambda item: (item[1].kind, item[0])))

    surfaces = {}
    for node in nodes(scene.mi):
        kind = "material"
        if is_reflection_bsdf(node):
            material, keys = node.material, node.parameters
        elif is_grey_diffuse(node):
            material, keys = node.id() or "diffuse", ["reflectance.value"]
        elif is_plume(node):
            material, keys = node.id() or "plume", ["transmittance"]
        elif keys := numbers_of_other(node):
            owner = node.group if is_thermal(node) else node.id()
            material, kind = owner or node.class_name(), "plugin"
        else:
            continue
        if has_spectrum(node):
            add_changes(surfaces, node, material)
            continue
        for key in keys:
            name = f"{material}.{key.removesuffix('.value')}"
            upper = np.inf if kind == "plugin" else 1.0
            sigma = node.sigma.get(key, 0.0) if is_reflection_bsdf(node) else 0.0
            of_key = StoredParameter(name, kind, [], upper=upper, sigma=sigma)
            entry = surfaces.setdefault(name, of_key)
            entry.stored.append(StoredNumbers(node, key, None, np.ones(1)))
    known |= {name: surfaces[name] for name in surfaces if name not in known}
    motions = {
        name: SingleNumber(
            name, "motion", [], m.unit, m.upper, m.lower, value=value_of(scene, m), place=m.place
        )
        for name, m in known_motions(scene).items()
    }
    return known | {name: motions[name] for name in motions if name not in known}


def add_changes(surfaces: dict[str, StoredParameter], node, material: str) -> None:
    """Add the numbers that change the spectrum of a surface.

    A surface that neither reflects nor transmits at any wavelength has none, since no path goes on
    from it.
    """
    if not (node.transmits if is_plume(node) else node.HDR(mi.Vector3f(0, 0, 1))[0] > 0):
        return
    change = node.spectrum_change

    def add(name: str, key: str, number, unit: str):
        bounds = change_bounds(node.measured_spectrum, change, key, node.of_band)
        name, array = f"{material}.{name}", key if number is None else "nodes"
        entry = surfaces.setdefault(
            name, StoredParameter(name, "spectrum", [], unit, bounds[1], bounds[0])
        )
        entry.stored.append(StoredNumbers(node, array, number, np.ones(1)))

    for key, (unit, _) in CHANGES.items():
        add(key, key, None, unit)
    for number, wavelength in enumerate(change.nodes_um):
        add(f"{AT}{1000 * wavelength:.0f}nm", str(number), np.array([number]), "1")


def single_temperatures(entry: StoredParameter, emitting) -> dict[str, StoredParameter]:
    """An entry for each temperature that a group had when it was loaded, if there are several."""
    group = entry.name.removesuffix(".temperature")
    first = {}
    for shape in emitting:
        first[shape] = first[shape.emitter()] = shape.emitter().first_temperatures
    if any(stored.node not in first for stored in entry.stored):
        return {}  # an environment's
    labels = [rounded(first[stored.node]) for stored in entry.stored]
    temperatures, inverse = np.unique(np.concatenate(labels), return_inverse=True)
    if len(temperatures) == 1:
        return {}
    parts = np.split(inverse.ravel(), np.cumsum([len(part) for part in labels])[:-1])
    singles = {}
    for stored, part in zip(entry.stored, parts):
        order = np.argsort(part, kind="stable")
        present, start = np.unique(part[order], return_index=True)
        for k, number in zip(present, np.split(order, start[1:])):
            name = f"{group}@{kelvin(temperatures[k])}.temperature"
            single = singles.setdefault(name, replace(entry, name=name, stored=[]))
            single.stored.append(
                StoredNumbers(stored.node, stored.key, number, stored.weight[number])
            )
    return singles


def is_grey_diffuse(node) -> bool:
    """Whether an object is Mitsuba's BSDF `diffuse` with one reflectance, without a texture."""
    return (
        isinstance(node, mi.BSDF)
        and node.class_name() == "SmoothDiffuse"
        and "reflectance.value" in mi.traverse(node)
    )


def numbers_of_other(node) -> list[str]:
    """Names of the single numbers of another BSDF or emitter in which it can be differentiated.

    None of a BSDF that wraps others, whose own parameters they are. None of an emitter of this
    project, and none that an emitter declares as its `parameters`.
    """
    is_bsdf = isinstance(node, mi.BSDF) and not any(isinstance(c, mi.BSDF) for c in children(node))
    known = [plugin.type for plugin in PLUGINS.values()]
    if not is_bsdf and (not isinstance(node, mi.Emitter) or type(node) in known):
        return []
    parameters = mi.traverse(node)
    declared = {entry.key for entry in node.parameters()} if is_thermal(node) else set()
    return [
        key
        for key, value in parameters.items()
        if isinstance(value, mi.Float)
        and len(value) == 1
        and key not in declared
        and not parameters.flags(key) & mi.ParamFlags.NonDifferentiable.value
    ]


def primitive_areas(shape) -> np.ndarray:
    """Areas of a shape's triangles [m^2], or the area of a shape without triangles.

    A shape whose area Mitsuba cannot compute, such as a curve, counts as 1 m^2 in means of shapes.
    """
    if not is_faceted(shape):
        return np.nan_to_num(area_of(shape), nan=1.0)
    p0, p1, p2 = (corner.astype(float) for corner in triangle_corners(shape))
    return 0.5 * np.linalg.norm(np.cross(p1 - p0, p2 - p0), axis=1)


def set_arrays(arrays: Mapping[tuple[mi.Object, str], mi.Float]) -> None:
    """Set arrays of Mitsuba objects, all those of one object at once."""
    by_node = {}
    for (node, key), array in arrays.items():
        by_node.setdefault(node, {})[key] = array
    for node, new in by_node.items():
        parameters = mi.traverse(node)
        for key, array in new.items():
            parameters[key] = array
        parameters.update()


# ---------------------------------------------------------------- Checks


def check_apart(wanted: list[StoredParameter]) -> None:
    """Raise InputError if two parameters share numbers, such as a group and its temperature."""
    owner = {}
    for entry in wanted:
        for stored in entry.stored:
            others = owner.setdefault(stored.owner, [])
            for other, kind, number in others:
                if kind == entry.kind == "mode":
                    continue
                if number is None or stored.number is None or np.isin(number, stored.number).any():
                    raise InputError(f"'{other}' and '{entry.name}' change the same numbers")
            others.append((entry.name, entry.kind, stored.number))


def check_emission(wanted) -> None:
    """Raise InputError if a temperature, radiance or emissivity would be outside its bounds."""
    for entry, value in wanted:
        if entry.model is not None:
            continue
        bounds = entry.described()
        above = value > bounds.lower if entry.kind == "temperature" else value >= bounds.lower
        if not (above and value <= bounds.upper):
            raise InputError(
                f"{entry.name} = {value:g} is outside its bounds; it must lie in "
                f"{bounds.lower:g}..{bounds.upper:g} {bounds.unit.removesuffix('1')}".rstrip()
            )


def check_materials(wanted) -> None:
    """Raise InputError if a reflection model's parameters together would not be feasible."""
    surfaces = {}
    for entry, value in wanted:
        if entry.model is None:
            continue
        for stored, number in zip(entry.stored, entry.moved(value)):
            new = surfaces.setdefault(
                stored.node, dict(zip(stored.node.parameters, stored.node.values))
            )
            new[stored.key] = float(number[0])
    for node, new in surfaces.items():
        with errors_of(f"material {node.material}"):
            node.model.check_feasible(*new.values(), form=node.form)
