"""Base class of the BSDF plugins of all reflection models.

It provides the tables of HDR, the simplified lobes, the emissivity and the derivatives.
"""

from dataclasses import replace
from functools import lru_cache

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.physics import materials
from mi_lcair.physics.bands import Band, band
from mi_lcair.physics.reflection.interface import (
    SMALLEST,
    ReflectionModel,
    cos_theta,
    sample_cosine,
    sin2_theta,
)
from mi_lcair.physics.spectra.parameters import CHANGES, NODES, Change, SpectralParameters
from mi_lcair.physics.spectral_table import over_the_hemisphere, read_directional_table
from mi_lcair.plugins import derivatives
from mi_lcair.plugins.properties import HOTTEST, Property, beside_scene, read

# Tables over 0..1 with evenly spaced nodes: linear interpolation and cubic refinement
# ------------------------------------------------------------------------------------


def interpolate(table, x):
    """Linear interpolation at `x` in a table with evenly spaced nodes over 0 <= x <= 1."""
    return interpolate_row(table, mi.UInt32(0), dr.width(table) - 1, x)


def interpolate_row(tables, row, steps: int, x):
    """Linear interpolation at `x` in one of several tables, which follow each other.

    row: number of the table. steps: steps of each table.
    """
    node, way = between_nodes(row, x, steps)
    return dr.lerp(dr.gather(mi.Float, tables, node), dr.gather(mi.Float, tables, node + 1), way)


def between_nodes(row, x, steps: int) -> tuple[mi.UInt32, mi.Float]:
    """The node at or before `x` among the even nodes over 0..1 of a row, and the way to the next.

    Nodes are counted over all rows, of which each has steps + 1.
    """
    x = x * steps
    index = dr.minimum(mi.UInt32(x), steps - 1)
    return row * (steps + 1) + index, x - mi.Float(index)


def gather(table, index):
    """Entries of a table, with derivatives that hold if the table is itself a result of `gather`.

    In its default mode Dr.Jit 1.5 sums the gradients of a gather in one copy of the table for each
    thread. Where the table was gathered too, that sum is now and then lost (LLVM).
    """
    return dr.gather(type(table), table, index, mode=dr.ReduceMode.Local)


def refine(table, factor: int):
    """The table with each step divided into `factor` steps; derivatives are kept.

    New nodes lie on the cubic through the four old nodes nearest to them. At the ends the cubic of
    the neighbouring step is used. The table must have at least four nodes.
    """
    Float, steps = type(table), dr.width(table) - 1
    node = dr.arange(mi.UInt32, steps * factor + 1)
    first = dr.clip(mi.Int32(node // factor) - 1, 0, steps - 3)
    x = Float(node) / factor - Float(first)
    # Lagrange's weights for nodes at 0, 1, 2 and 3
    weights = (
        (x - 1) * (x - 2) * (3 - x) / 6,
        x * (x - 2) * (x - 3) / 2,
        x * (x - 1) * (3 - x) / 2,
        x * (x - 1) * (x - 2) / 6,
    )

    def neighbour(k):
        return gather(table, mi.UInt32(first + k))

    return sum(weight * neighbour(k) for k, weight in enumerate(weights))


# Base class of BSDFs whose parameters may depend on wavelength
# -------------------------------------------------------------


class SpectralBSDF(mi.BSDF):
    """A BSDF that may have a spectrum, with numbers that change it.

    measured_spectrum: parameters over wavelength; None without. spectrum: the same with the change.
    of_band: band in which the scene is rendered. change: numbers of the change, see `Change`; they
    are the parameters of the scene then, since the mean of the spectrum only decides where paths
    go.
    """

    spectrum: SpectralParameters | None = None
    measured_spectrum: SpectralParameters | None = None
    of_band: Band | None = None
    change: dict[str, mi.Float] = {}

    def take_spectrum(self, spectrum: SpectralParameters, of_band: Band) -> None:
        """Depend on wavelength."""
        self.spectrum = self.measured_spectrum = spectrum
        self.of_band = of_band
        self.change = {name: mi.Float(value) for name, (_, value) in CHANGES.items()}
        self.change["nodes"] = mi.Float(np.zeros(NODES))

    @property
    def spectrum_change(self) -> Change:
        """The change of the spectrum, from its numbers."""
        numbers = {name: float(self.change[name][0]) for name in CHANGES}
        nodes = tuple(self.change["nodes"].numpy().tolist())
        return Change((self.of_band.lower_um, self.of_band.upper_um), **numbers, nodes=nodes)

    def follow_change(self) -> None:
        """Set `spectrum` for the present numbers of the change."""
        self.spectrum = changed_spectrum(self.measured_spectrum, self.spectrum_change)


@lru_cache(maxsize=128)
def changed_spectrum(spectrum: SpectralParameters, change: Change) -> SpectralParameters:
    """A spectrum with a change, the same object for all surfaces that have it."""
    return spectrum if change.is_none else replace(spectrum, change=change)


def has_spectrum(plugin) -> bool:
    """Whether a plugin is a BSDF that depends on wavelength; None is not."""
    return isinstance(plugin, SpectralBSDF) and plugin.spectrum is not None


def is_spectral(bsdf) -> bool:
    """Whether a BSDF, or what it wraps, has a spectral material."""
    return any(map(has_spectrum, (bsdf, *derivatives.children(bsdf))))


def has_spectral_materials(scene) -> bool:
    """Whether a surface of a scene has a spectral material."""
    return any(is_spectral(shape.bsdf()) for shape in scene.shapes())


LOBES = ("brdf", "mirror", "diffuse")
OF_MATERIALS = (
    Property("material", "string"),
    Property("band", "string", is_file=True),
    Property("materials", "string", is_file=True),
    Property("allow_band", "boolean", False),
    Property("average_K", "float", lower=1, upper=HOTTEST),
)
OF_EVERY_SURFACE = (
    Property("form", "string"),
    Property("emissivity", "string", "kirchhoff"),
    Property("lobe", "string", "brdf", choices=LOBES),
)
# Steps of the table of HDR. They are even in t, with cos(theta) = t^2. Linear interpolation between
# the nodes has an error below 5e-6 up to 89.5 degrees.
STEPS = 1024
# Every fourth node is computed by quadrature. The nodes between are interpolated by cubics, with an
# error below 1e-6.
STEPS_PER_QUADRATURE = 4
# Narrow lobes bend sharply at the horizon, so each of the first nodes is a quadrature of its own.
STEPS_AT_HORIZON = 64
# Error of HDR from the table and from single precision. It matters where little is emitted.
HDR_ERROR = 8e-7
LEAST_EMISSIVITY = 0.01  # surfaces that emit less are taken to emit this much of what is seen
# Excess of HDR over 1 that causes a remark; a smaller excess may be an error of the table.
ALARM = 1e-5


@derivatives.Deriving.register
class ReflectionBSDF(SpectralBSDF):
    """BSDF of a reflection model: a subclass sets `model` and has the manual as its docstring.

    `si.wi` points to the observer and `wo` to the source. A model may violate reciprocity, so the
    order of the directions matters; TransportMode.Importance swaps them. The surface is one-sided:
    it reflects and emits on the side of its normal. At angles where a model would reflect more than
    the incident power, HDR(theta_r) > 1, the BRDF is divided by HDR(theta_r) and the emissivity is
    0.
    """

    # Plugins of a model set it. In BSDF `material` it is None until the material is read.
    model: ReflectionModel | None = None
    OF_SURFACE: tuple[Property, ...] = OF_EVERY_SURFACE
    PROPERTIES: tuple[Property, ...] = ()
    derived = None
    derivations = ()
    notes: tuple[str, ...] = ()  # remarks on the material's spectrum
    named: tuple | None = None  # name and file of its material; None if given by numbers
    sigma: dict[str, float] = {}  # standard deviations of its material's parameters
    least_share = 0.0  # least probability of the floor and of the lobe, see `explore`

    def __init_subclass__(cls):
        """Declare the properties of a plugin: those of all surfaces and its model's parameters."""
        super().__init_subclass__()
        names = cls.model.names if cls.model else ()
        numbers = (Property(name, "float") for name in names)
        # The grey surface has a number where the others choose the formula of their emissivity.
        cls.OF_SURFACE = tuple(entry for entry in OF_EVERY_SURFACE if entry.name not in names)
        cls.PROPERTIES = (*OF_MATERIALS, *cls.OF_SURFACE, *numbers)

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        plugin = self.model.name if self.model else "material"
        given = read(props, plugin, self.OF_SURFACE)
        values, form = self.read_surface(props, plugin)
        self.form = given["form"] or form
        self.model.check_form(self.form)
        self.model.check_feasible(*values, form=self.form)
        self.parameters = {name: mi.Float(value) for name, value in zip(self.model.names, values)}

        self.emissivity = given.get("emissivity", "kirchhoff")
        self.measured = None
        if self.emissivity not in ("kirchhoff", "model"):
            path, cos = beside_scene(self.emissivity), np.linspace(0, 1, STEPS + 1) ** 2
            theta, emissivity, _ = read_directional_table(path)
            self.measured = mi.Float(over_the_hemisphere(path, theta, emissivity, np.arccos(cos)))
        elif self.emissivity == "model" and not self.model.has_emissivity:
            raise InputError(
                f"{self.model.name}: emissivity = model, but the model has no own formula for "
                "it; use kirchhoff or a measured table"
            )
        self.set_lobe(given["lobe"])
        if self.spectrum is not None and (self.emissivity != "kirchhoff" or given["form"]):
            raise InputError(
                f"material '{self.material}': depends on wavelength; its entry sets its form, "
                "and its emissivity is 1 - HDR; leave `form` and `emissivity` out"
            )

    def read_surface(self, props, plugin: str) -> tuple[tuple[float, ...], str]:
        """Values of the parameters and the form, from a material or from numbers.

        Sets `model` and `material`.
        """
        if "material" not in props:
            self.material = self.id() or self.model.name
            return self.read_numbers(props)
        given = read(props, plugin, OF_MATERIALS)
        self.material = given["material"]
        self.named = beside_scene(self.material), given["materials"]
        of_band = None if given["band"] is None else band(given["band"])
        name, file = self.named
        entry = materials.material(name, of_band, file, given["allow_band"])
        if entry.spectrum is not None:
            entry = self.averaged(entry, of_band, given["average_K"])
        # A grey surface is a limit of the other models, and any plugin takes its material
        if self.model not in (None, entry.model) and entry.model.name != "grey":
            raise InputError(
                f"{self.model.name}: material '{entry.name}' is one of the model "
                f"{entry.model.name}; "
                'use <bsdf type="material">, which takes any'
            )
        self.model, self.sigma = entry.model, entry.sigma
        return entry.values, entry.form

    def averaged(self, entry, of_band, temperature):
        """A spectral material with parameters of its mean in a band; sets `notes`, `spectrum`.

        temperature: of the radiation for which it is constant in the band [K]; None for none.
        """
        if temperature is None:
            self.notes = entry.spectrum.remarks_in(of_band)
            self.take_spectrum(entry.spectrum, of_band)
            return entry
        of_average = entry.spectrum.remark_on_average(of_band, temperature)
        self.notes = *entry.spectrum.remarks_in(of_band), of_average
        return entry.averaged(of_band, temperature)

    def read_numbers(self, props) -> tuple[tuple[float, ...], str]:
        if self.model is None:
            raise InputError("material: give `material`, the name of one, and `band`")
        declared = tuple(Property(name, "float") for name in self.model.names)
        given = read(props, self.model.name, declared)
        missing = [name for name, value in given.items() if value is None]
        if missing:
            raise InputError(
                f"{self.model.name}: give `material` and `band`, or {', '.join(missing)}"
            )
        return tuple(given.values()), self.model.forms[0]

    def set_lobe(self, lobe: str) -> None:
        """Choose the angular distribution of the reflected radiance: brdf, mirror or diffuse."""
        with errors_of(self.model.name):
            check_known("lobe", LOBES, lobe)
        self.lobe = lobe
        asymmetry = 0 if self.model.reciprocal else mi.BSDFFlags.NonSymmetric
        if self.model.name == "grey" and lobe == "brdf":
            lobe = "diffuse"
        kind = {
            "brdf": mi.BSDFFlags.GlossyReflection | asymmetry,
            "mirror": mi.BSDFFlags.DeltaReflection | 0,
            "diffuse": mi.BSDFFlags.DiffuseReflection | 0,
        }[lobe]
        self.m_components = [kind | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    # ------------------------------------------------ Parameters and what is derived from them

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters as numbers, in the model's order."""
        return tuple(float(dr.detach(number)[0]) for number in self.sources())

    @property
    def reflection(self) -> tuple:
        """What decides how it reflects and emits; equal for equal surfaces."""
        of_model = self.model.name, *self.values, self.form, self.emissivity, self.lobe
        return of_model if self.spectrum is None else (*of_model, id(self.spectrum))

    def sources(self):
        return tuple(self.parameters.values())

    def traverse(self, cb):
        for name, value in (self.change or self.parameters).items():
            cb.put(name, value, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys=()):
        if self.change:
            self.follow_change()
            return
        self.model.check_feasible(*self.values, form=self.form)
        self.derive()

    def derive(self) -> None:
        """Compute the tables that `eval` and `sample` use, in Float64 and with derivatives."""
        dr.make_opaque(*self.sources(), self.measured)
        if derivatives.attached(self.sources()):
            self.derived = tables(self.model, self.sources(), self.form)
        else:
            self.derived = stored_tables(self.model, self.values, self.form)
        dr.make_opaque(self.derived)

    def refresh(self) -> None:
        if self.derived is None or (
            derivatives.attached(self.sources())
            and not derivatives.attached(derivatives.flatten(self.derived))
        ):
            self.derive()

    @property
    def tables(self) -> tuple:
        """`derived`, which is computed at the first use: a constructor must not evaluate arrays."""
        if self.derived is None:
            derivatives.unrecorded(self.derive)
        return self.derived

    @property
    def surface(self):
        return self.tables[0]

    def remarks(self) -> list[str]:
        """Remarks for the user about this surface, one line each, for when a scene is loaded."""
        angle = self.first_saturated_angle_deg()
        lines = self.model.remarks(*self.values, form=self.form)
        if angle is not None:
            lines = [
                f"the model would reflect more than 100 % beyond {angle:.1f} degrees; its BRDF "
                "is scaled down to HDR = 1 there",
                *lines,
            ]
        return [*self.notes, *lines]

    # ------------------------------------------------ Hemispherical reflectance and emissivity

    def raw_HDR(self, cos, sin2):
        """Floor and lobe parts of the model's HDR(theta_r) (thesis Eq 2.9), not limited to 1."""
        derivatives.check_attached(self)
        return parts_of_HDR(self.model, self.tables, cos, sin2)

    def HDR(self, w):
        """HDR as rendered: at most 1; 0 for a direction below the surface."""
        floor, lobe = self.raw_HDR(cos_theta(w), sin2_theta(w))
        return dr.select(w.z > 0, dr.minimum(floor + lobe, 1), 0)

    def first_saturated_angle_deg(self) -> float | None:
        """Smallest angle [degrees] at which the model's HDR exceeds 1; None if there is none."""
        return first_saturated_angle_deg(self.model, self.values, self.form)

    @property
    def relative_error(self) -> float:
        """Error of the emissivity 1 - HDR at normal incidence, relative to it."""
        if self.emissivity != "kirchhoff" or self.measured is not None:
            return 0.0
        return emissivity_error(self.model, self.values, self.form)

    def explore(self, least_share: float) -> None:
        """Sample floor and lobe at least so often; 0 as often as their reflectances say."""
        self.least_share = least_share

    def lobe_probability(self, w):
        """Probability of sampling the lobe instead of the floor, at the angle of `w`."""
        floor, lobe = (dr.detach(part) for part in self.raw_HDR(cos_theta(w), sin2_theta(w)))
        share = dr.select(floor + lobe > 0, lobe / dr.maximum(floor + lobe, SMALLEST), 1)
        return dr.clip(share, self.least_share, 1 - self.least_share) if self.least_share else share

    def has_attribute(self, name, active=True):
        return name == "emissivity"

    def eval_attribute_1(self, name, si, active=True):
        """The attribute `emissivity`: directional emissivity toward si.wi, 0 below the surface."""
        cos, sin2 = cos_theta(si.wi), sin2_theta(si.wi)
        if name != "emissivity":
            value = mi.Float(0)
        elif self.measured is not None:
            value = interpolate(self.measured, dr.sqrt(cos))
        elif self.emissivity == "model":
            value = self.model.emissivity(self.surface, cos, sin2)
        else:
            value = 1 - self.HDR(si.wi)
        return dr.select(active & (si.wi.z > 0), value, 0)

    # ------------------------------------------------ Mitsuba's interface

    def brdf_cos(self, ctx, wi, wo):
        """BRDF times cosine of `wo` [1/sr], for the lobes brdf and diffuse."""
        i, r = (wo, wi) if ctx.mode == mi.TransportMode.Radiance else (wi, wo)
        above = (i.z > 0) & (r.z > 0)
        if self.lobe == "diffuse":
            return dr.select(above, self.HDR(r) * dr.inv_pi * wo.z, 0)
        floor, lobe = self.raw_HDR(cos_theta(r), sin2_theta(r))
        value = self.model.f(self.surface, i, r) * wo.z / dr.maximum(floor + lobe, 1)
        return dr.select(above, value, 0)

    def density(self, wi, wo):
        """Density of `sample` [1/sr] for the lobes brdf and diffuse, without derivatives."""
        density = dr.inv_pi * cos_theta(wo)
        if self.lobe == "brdf":
            lobe = self.model.lobe_pdf(dr.detach(self.surface), wo, wi)
            density = dr.lerp(density, lobe, self.lobe_probability(wi))
        return dr.select((wi.z > 0) & (wo.z > 0), density, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.eta = 1
        bs.sampled_component = 0
        bs.sampled_type = mi.UInt32(self.m_flags)
        active = active & (si.wi.z > 0)
        if self.lobe == "mirror":
            bs.wo = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            bs.pdf = dr.select(active, mi.Float(1), 0)
            return bs, mi.Spectrum(dr.select(active, self.HDR(si.wi), 0))

        bs.wo = sample_cosine(mi.Vector3f, sample2.x, sample2.y)
        if self.lobe == "brdf":
            S, r = dr.detach(self.surface), dr.detach(si.wi)
            probability = self.lobe_probability(r)
            u3 = sample1 / dr.maximum(probability, SMALLEST)  # uniform in 0..1 for the lobe
            reflected = self.model.sample_lobe(S, r, sample2.x, sample2.y, u3)
            bs.wo = dr.select(sample1 < probability, reflected, bs.wo)
        bs.pdf = self.density(si.wi, bs.wo)
        active &= bs.pdf > 0
        value = self.brdf_cos(ctx, si.wi, bs.wo)
        weight = dr.select(active, value / dr.select(active, bs.pdf, 1), 0)
        return bs, mi.Spectrum(weight)

    def eval(self, ctx, si, wo, active=True):
        if self.lobe == "mirror":
            return mi.Spectrum(0)
        return mi.Spectrum(dr.select(active, self.brdf_cos(ctx, si.wi, wo), 0))

    def pdf(self, ctx, si, wo, active=True):
        if self.lobe == "mirror":
            return mi.Float(0)
        return dr.select(active, self.density(si.wi, wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def eval_diffuse_reflectance(self, si, active=True):
        return mi.Spectrum(dr.select(active, self.HDR(si.wi), 0))

    def to_string(self):
        numbers = ", ".join(
            f"{name} = {value:g}" for name, value in zip(self.parameters, self.values)
        )
        return (
            f"{self.model.title.replace(' ', '')}[material = {self.material}, {numbers}, "
            f"form = {self.form}, emissivity = {self.emissivity}, lobe = {self.lobe}]"
        )


def tables(model: ReflectionModel, values: tuple, form: str) -> tuple:
    """The `Surface` with these parameters, and the table of the lobe's HDR, in single precision.

    They are computed in Float64 and keep derivatives. values: the parameters, as Mitsuba's floats.
    """
    Float64 = dr.float64_array_t(mi.Float)
    S = model.surface(*(Float64(number) for number in values), form=form)

    return S.cast(mi.Float), tabulated(lambda theta: model.lobe_HDR(S, theta))


def tabulated(reflectance) -> mi.Float:
    """Table of a function of theta_r [rad], a Float64 array, at even steps of sqrt(cos)."""
    Float64, count = dr.float64_array_t(mi.Float), STEPS // STEPS_PER_QUADRATURE + 1
    # One quadrature for all, which is traced once
    t = dr.concat([dr.linspace(Float64, 0, 1, count), dr.arange(Float64, STEPS_AT_HORIZON) / STEPS])
    values, node = reflectance(dr.acos(dr.square(t))), dr.arange(mi.UInt32, STEPS + 1)
    coarse = gather(values, dr.arange(mi.UInt32, count))
    fine = gather(values, count + dr.arange(mi.UInt32, STEPS_AT_HORIZON))
    table = dr.select(
        node < STEPS_AT_HORIZON,
        gather(fine, dr.minimum(node, STEPS_AT_HORIZON - 1)),
        refine(coarse, STEPS_PER_QUADRATURE),
    )
    return mi.Float(table)


# Scenes repeat a material on many shapes. What it needs is therefore computed once for equal
# parameters. It is kept as NumPy arrays, of which each BSDF takes a copy.


@lru_cache(maxsize=128)
def table_numbers(model: ReflectionModel, values: tuple, form: str) -> tuple:
    """`tables` as NumPy arrays."""
    # As literals they would make kernels of their own
    opaque = tuple(dr.opaque(mi.Float, value) for value in values)
    S, lobe = tables(model, opaque, form)
    return S.map(lambda number: number.numpy()), lobe.numpy()


def stored_tables(model: ReflectionModel, values: tuple, form: str) -> tuple:
    """`tables` without derivatives. values: the parameters, as Python's floats."""
    S, lobe = table_numbers(model, values, form)
    arrays = S.cast(mi.Float), mi.Float(lobe)
    derivatives.own_memory(derivatives.flatten(arrays))
    return arrays


@lru_cache(maxsize=128)
def first_saturated_angle_deg(model: ReflectionModel, values: tuple, form: str) -> float | None:
    """Smallest angle [degrees] at which a model's HDR exceeds 1; None if there is none."""
    theta = np.linspace(0, 0.5 * np.pi, 1801)[:-1]
    cos, sin2 = derivatives.own_memory([mi.Float(np.cos(theta)), mi.Float(np.sin(theta) ** 2)])
    floor, lobe = parts_of_HDR(model, stored_tables(model, values, form), cos, sin2)
    above = (floor + lobe).numpy() > 1 + ALARM
    return float(np.degrees(theta[above.argmax()])) if above.any() else None


@lru_cache(maxsize=128)
def emissivity_error(model: ReflectionModel, values: tuple, form: str) -> float:
    """Relative error of the emissivity 1 - HDR at normal incidence."""
    cos, sin2 = dr.opaque(mi.Float, 1), dr.opaque(mi.Float, 0)
    floor, lobe = parts_of_HDR(model, stored_tables(model, values, form), cos, sin2)
    emissivity = 1 - float((floor + lobe).numpy()[0])
    # A mirror that emits nothing has no error of what it emits
    return HDR_ERROR / max(emissivity, LEAST_EMISSIVITY) if emissivity > HDR_ERROR else 0.0


def parts_of_HDR(model: ReflectionModel, derived: tuple, cos, sin2) -> tuple:
    """Floor and lobe parts of a model's HDR(theta_r), not limited to 1; derived: from `tables`."""
    S, table = derived
    lobe = model.lobe_scale(S, cos, sin2) * interpolate(table, dr.sqrt(cos))
    return model.floor_HDR(S, cos, sin2), lobe


def is_reflection_bsdf(plugin) -> bool:
    """Whether a plugin is the BSDF of a reflection model."""
    return isinstance(plugin, ReflectionBSDF)


def reflection_layers(bsdf) -> list:
    """The BSDFs of reflection models in a BSDF: the BSDF itself, or those that it wraps."""
    return [layer for layer in (bsdf, *derivatives.children(bsdf)) if is_reflection_bsdf(layer)]
