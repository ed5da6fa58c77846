r"""BSDF `plume`: a surface that emits and that rays pass straight through, for exhaust plumes."""

import drjit as dr
import mitsuba as mi

from mi_lcair.declared import needs, one_of
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.spectra.files import FRACTION, columns_of
from mi_lcair.physics.spectra.parameters import spectrum
from mi_lcair.plugins.bsdfs.reflection_bsdf import SpectralBSDF
from mi_lcair.plugins.properties import Property, beside_scene, read

# What a BSDF may do with a ray. A surface whose flags hold only `Null` of these is passed.
ANY_LOBE = int(mi.BSDFFlags.All)


class Plume(SpectralBSDF):
    r"""Partly transparent surface without reflection, such as the outside of an exhaust plume.

    ============= ======= ==========================================================================
    transmittance float   share of the radiance that passes through the surface, 0..1; the same in
                          all directions                                            (differentiable)
    spectrum      string  in place of `transmittance`: a CSV file wavelength_um,transmittance
    band          string  band in which the scene is rendered, for `spectrum`
    ============= ======= ==========================================================================

    .. code-block:: xml

        <bsdf type="plume"> <float name="transmittance" value="0.8"/> </bsdf>

    With a `spectrum`, paths carry the transmittance at each wavelength, as for a material that
    depends on wavelength. Parameters are then `scale`, `offset` and `slope` of its emissivity, as
    those of such a material.

    The emissivity is 1 - transmittance on both sides, by Kirchhoff's law for a surface that does
    not reflect. A ray passes straight through the surface, and its radiance is multiplied by the
    transmittance. `bounce_path` does not count this as a reflection.

    The transmittance does not depend on the direction. For a thin layer of a gas it would be
    transmittance^(1 / cos), which makes the edges of the surface opaque. A plume is a volume, and
    rays near its edge have the shortest path in it. A ray crosses a closed cone twice: a cone whose
    emissivity is known from measurement as 1 - T needs `transmittance` = sqrt(T).

    A path that passes more than 32 plumes in a row is an invalid sample. Invalid samples are
    counted and reported. Mitsuba's integrator `path` counts a passage in `max_depth`. It gives 0 if
    a ray passes plumes and then hits nothing.
    """

    PROPERTIES = (
        Property("transmittance", "float", lower=0, upper=1),
        Property("spectrum", "string", is_file=True),
        Property("band", "string", is_file=True),
    )
    RULES = (
        one_of("transmittance", "spectrum"),
        needs("spectrum", "band", why="it is that in which the scene is rendered"),
    )
    least_share = 0.0  # not 0: rays pass also a plume of transmittance 0
    material = "plume"  # name of the material in tables of facets
    lobe = "mirror"  # by wavelength, what passes takes the place of what a mirror reflects

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        values = read(props, "plume", self.PROPERTIES, self.RULES)
        transmittance = values["transmittance"]
        if values["spectrum"] is not None:
            transmittance = self.mean_of(beside_scene(values["spectrum"]), values["band"])
        self.transmittance = mi.Float(transmittance)
        self.parameters_changed()

    def mean_of(self, path: str, of_band: str) -> float:
        """Mean transmittance in a band of the CSV file at `path`; takes its spectrum.

        The spectrum is 1 - transmittance, as an emissivity.
        """
        wavelengths, transmittance = columns_of(path, {"transmittance": FRACTION})
        rows = {"emissivity": 1 - transmittance}
        of_band, emissivity = band(of_band), spectrum("grey", {}, {}, wavelengths, rows, path)
        emissivity.check_covers(of_band, f"plume: {path}")
        self.take_spectrum(emissivity, of_band)
        return 1 - emissivity.averaged(*emissivity.weights(of_band, None))[0]

    def traverse(self, cb):
        for name, value in (self.change or {"transmittance": self.transmittance}).items():
            cb.put(name, value, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys=()):
        if self.change:
            self.follow_change()
        self.PROPERTIES[0].checked(float(dr.detach(self.transmittance)[0]), "plume")
        dr.make_opaque(self.transmittance)
        # An opaque plume has no lobe at all, so that paths end there as at a blackbody
        is_passed = self.transmits or self.least_share > 0
        passes = mi.BSDFFlags.Null if is_passed else mi.BSDFFlags.Empty
        self.m_components = [passes | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide]
        self.m_flags = self.m_components[0]

    @property
    def transmits(self) -> bool:
        return float(dr.detach(self.transmittance)[0]) > 0

    def explore(self, least_share: float) -> None:
        """Let rays pass also at a transmittance of 0; 0 for not."""
        if least_share != self.least_share:
            self.least_share = least_share
            self.parameters_changed()

    def check_derivative(self, name: str, draws: bool) -> None:
        """Raise InputError if paths would not give the whole derivative in the transmittance.

        name: name of the transmittance in the message. draws: whether emitters are drawn.
        """
        if draws:
            raise InputError(
                f"{name} has no derivative where emitters are drawn; use emitter_sampling = false "
                "and no sun or point light"
            )

    def has_attribute(self, name, active=True):
        return name == "emissivity"

    def eval_attribute_1(self, name, si, active=True):
        """The attribute `emissivity`, the same on both sides."""
        value = 1 - self.transmittance if name == "emissivity" else mi.Float(0)
        return dr.select(active & (si.wi.z != 0), value, 0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.eta, bs.sampled_component = -si.wi, 1, 0
        bs.sampled_type = mi.UInt32(int(self.m_flags) & ANY_LOBE)
        bs.pdf = dr.select(active, mi.Float(1), 0)
        return bs, mi.Spectrum(dr.select(active, self.transmittance, 0))

    def eval_null_transmission(self, si, active=True):
        return mi.Spectrum(dr.select(active, self.transmittance, 0))

    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(0)

    def pdf(self, ctx, si, wo, active=True):
        return mi.Float(0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def eval_diffuse_reflectance(self, si, active=True):
        return mi.Spectrum(0)

    def to_string(self):
        return f"Plume[transmittance = {float(dr.detach(self.transmittance)[0]):g}]"


def is_plume(plugin) -> bool:
    """Whether a plugin is a BSDF `plume`, also one that was loaded under another variant."""
    return type(plugin).__name__ == "Plume"


def spectral_plumes(scene) -> list:
    """The plumes of a scene whose transmittance depends on wavelength, in a fixed order."""
    plumes = {shape.bsdf() for shape in scene.shapes() if is_plume(shape.bsdf())}
    return sorted((b for b in plumes if b.spectrum is not None), key=lambda b: b.id())


def is_passed(flags):
    """Whether every ray passes straight through a BSDF with these flags: `plume` and `null`."""
    return (flags & ANY_LOBE) == int(mi.BSDFFlags.Null)
