"""Base class of the emitters whose group, spectrum and radiance are known."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import Rule
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band, Spectrum, band
from mi_lcair.plugins.derivatives import Deriving
from mi_lcair.plugins.emission.source import OTHER, Source
from mi_lcair.plugins.properties import Property, read


@dataclass(frozen=True)
class EmitterParameter:
    """A parameter of an emitter that multiplies or determines its radiance.

    name: its name, such as "temperature". kind: "temperature", "radiance" or "emissivity". unit,
    upper: its unit and its largest value; the smallest is 0. key: its name in `mi.traverse`.
    is_by_facet: whether the emitter's shape holds it, one number for each primitive; otherwise the
    emitter holds it. group: group in its name in scenes; empty for that of the emitter.
    """

    name: str
    kind: str
    unit: str
    upper: float
    key: str
    is_by_facet: bool = False
    group: str = ""


@Deriving.register
class ThermalEmitter(mi.Emitter):
    """An emitter with a label, whose radiance is known before a path meets it.

    A subclass declares its properties, among them `band` and `group`, and sets or overrides what
    follows. The label decides to which part of a result its radiance belongs.

    values : dict
        The properties that the scene gives, by name.
    group : str
        Label of the emitter.
    band : Band or None
        Band in which it emits; None if it names none.
    facet_type : str
        What its surface belongs to: model, sky or terrain (thesis, section 3.2.1.5).
    spectrum : Spectrum or None
        Tabulated spectrum; None for a blackbody and for a source without one.
    first_temperatures : ndarray or None
        Temperatures when the scene was loaded [K]; None for a source that is no blackbody, and
        until facet temperatures are used.
    given_emissivity : mi.Float or None
        Emissivity that stands for that of the material; None if the material's is used.
    derived : mi.Float or None
        What is computed from `sources()`, see the module `derivatives`.
    """

    PROPERTIES: tuple[Property, ...] = ()
    RULES: tuple[Rule, ...] = ()  # those between the properties
    facet_type = "model"
    spectrum: Spectrum | None = None
    first_temperatures = None
    given_emissivity = None
    derived = None
    derivations = ()
    is_divided = False  # whether it has several parts by direction, see `Sky`
    is_sun = False

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        # Values of the properties by name
        self.values = read(props, props.plugin_name(), self.PROPERTIES, self.RULES)
        self.group: str = self.values["group"]
        text = self.values["band"]
        self.band: Band | None = None if text is None else band(text)

    # ---------------------------------------------------------------- What a subclass declares

    def facet_radiance(self):
        """In-band radiance before the emissivity [W m^-2 sr^-1], with derivatives.

        One value, or one for each primitive of the shape. None if it varies inside a primitive.
        """
        raise NotImplementedError

    def temperatures(self) -> np.ndarray | None:
        """Temperatures of a blackbody [K], one or one for each primitive; None for others."""
        return None

    def parameters(self) -> list[EmitterParameter]:
        """The parameters in which its radiance can be differentiated."""
        raise NotImplementedError

    def sources(self) -> tuple:
        """Parameters from which `derived` is computed."""
        return ()

    def derive(self) -> None:
        """Compute `derived` from `sources()`."""

    def refresh(self) -> None:
        """Compute `derived` again if a parameter has changed."""

    def check_fits(self, sun) -> None:
        """Raise InputError if its radiance is not that of a sky with this `sun`."""

    @property
    def groups(self) -> list[str]:
        """Group of each of its parts; one, unless the directions of an environment have several."""
        return [self.group]

    def relative_slopes(self, key: str) -> np.ndarray | None:
        """Derivative of the radiance of each part with respect to a parameter, divided by it.

        None if it follows from the kind of the parameter.
        """
        return None

    # ---------------------------------------------------------------- Derived methods

    def radiance_bound(self) -> np.ndarray | None:
        """Upper bound of its radiance, one or one for each primitive; None if it has none."""
        radiance = self.facet_radiance()
        if radiance is None:
            return None
        factor = 1.0 if self.given_emissivity is None else dr.detach(self.given_emissivity).numpy()
        return dr.detach(radiance).numpy().astype(np.float64) * factor

    @property
    def has_spectrum(self) -> bool:
        """Whether its spectrum is known, so that its emission can be told apart."""
        return self.spectrum is not None or self.temperatures() is not None

    def spectra(self) -> list[Source]:
        """The sources by which its emission is recorded: one, or one for each primitive.

        Raises InputError for an emitter without a spectrum.
        """
        if self.spectrum is None:
            return Source.of_blackbodies(self.group, self.band, self.temperatures())
        in_band, table = float(self.facet_radiance()[0]), self.spectrum
        factor = in_band / table.in_band_radiance(self.band)
        return [Source(self.group, table.name, in_band, spectrum=table.scaled(factor))]

    def to_string(self):
        given = ", ".join(f"{name} = {value}" for name, value in self.values.items())
        return f"{type(self).__name__}[{given}]"


def is_thermal(emitter) -> bool:
    """Whether an emitter is a `ThermalEmitter`; False for Mitsuba's emitters and for None."""
    return isinstance(emitter, ThermalEmitter)


def groups_of(emitter) -> list[str]:
    """Group of each part of an emitter; OTHER for Mitsuba's emitters and for None."""
    return emitter.groups if is_thermal(emitter) else [OTHER]


def facet_type_of(emitter) -> str:
    """What a surface with this emitter, or with None, belongs to: model, sky or terrain."""
    return emitter.facet_type if is_thermal(emitter) else "model"


def thermal_shapes(scene: mi.Scene) -> list[mi.Shape]:
    """The shapes of a scene that have a thermal emitter."""
    return [shape for shape in scene.shapes() if is_thermal(shape.emitter())]


def one_sun(emitters):
    """The emitter `sun` of a scene; None if it has none.

    Raises InputError for a second one, and for one that does not fit the emitter `sky`.
    """
    thermal = [emitter for emitter in emitters if is_thermal(emitter)]
    suns = [emitter for emitter in thermal if emitter.is_sun]
    if len(suns) > 1:
        raise InputError(f"the scene has {len(suns)} suns; it can have one at most")
    for sky in thermal if suns else []:
        sky.check_fits(suns[0])
    return suns[0] if suns else None
