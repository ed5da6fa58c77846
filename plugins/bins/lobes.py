"""Reflectances of spectral materials by bin, from tables that the walk reads.

A family is the materials of one reflection model in one form. Its `between` and `toward` compute
what all bins share; `f` and `HDR` then give the values of a block of bins with few operations. Row
0 of a family stands for surfaces that do not belong to it.
"""

from dataclasses import replace
from functools import lru_cache, partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.physics import reflection
from mi_lcair.physics.reflection import microfacet_distribution as distribution
from mi_lcair.physics.reflection import microfacet_hemispherical as hemispherical
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.directions import cos_theta, sin2_theta
from mi_lcair.physics.spectra.bins import Bins, of_falloff, reflectances
from mi_lcair.physics.spectra.parameters import SpectralParameters
from mi_lcair.plugins.bins.blocks import blocks_of, gathered, in_blocks, interpolated
from mi_lcair.plugins.bsdfs.reflection_bsdf import LOBES, STEPS, tabulated
from mi_lcair.plugins.bsdfs.uniform_table import between_nodes, interpolate_row
from mi_lcair.table import rows_at

STEPS_OF_F = 512  # steps of the table of Fresnel reflectances, even in sqrt(cos)
BRDF, MIRROR, DIFFUSE = range(len(LOBES))


class SandfordRobertsonFamily:
    """Spectral materials of Sandford and Robertson in one form, and grey ones.

    f = X (1 - absorbed_k g(theta_i)) + floor_k g g / pi is linear in slack_k = 1 - absorbed_k and
    floor_k, the coefficients of 1 - (epsilon + rho_d) / G and rho_d / G^2. A grey material has
    b = 0 and no lobe. saturates: whether HDR exceeds 1 in a bin, so that f is scaled down.
    """

    def __init__(self, materials: list[SpectralParameters], bins: Bins):
        self.blocks, form = blocks_of(bins.count), form_of(materials)
        known = reflection.model("sandford_robertson").forms
        self.form = form if form in known else known[0]
        numbers, coefficients, tables = [], [], []
        for material in materials:
            is_grey = material.model.name == "grey"
            fitted = bins.coefficients(reflectances(material, bins.grid_um))
            b, e, G = 0.0, 1.0, 1.0
            if not is_grey:
                b, e, G = material.common["b"], material.common["e"], of_falloff(material)
            absorbed, floor = (np.ones(bins.count), fitted[:, 0]) if is_grey else fitted.T
            numbers.append([b, e, G, 0.0 if is_grey else 1.0])
            coefficients.append([1 - absorbed, floor / G])
            tables += map(mi.Float, lobe_tables(b, e, self.form))
        self.numbers, self.coefficients = in_blocks(numbers), in_blocks(coefficients)
        self.tables = dr.concat(tables)
        dr.make_opaque(self.tables)
        self.saturates = largest_HDR(self, len(materials)) > 1

    def surface(self, row) -> tuple:
        """The surfaces with slack = floor = 1 and absorbed = 0, and whether they have a lobe."""
        b, e, G, has_lobe = gathered(self.numbers, row)
        zero, unit = mi.Float(0), mi.Float(1)
        S = sr.SandfordRobertsonSurface(zero, zero, b, e, unit, zero, unit, G, self.form)
        return S, has_lobe

    def toward(self, row, r) -> tuple:
        """What HDR(theta_r) needs of the observer's direction."""
        S, has_lobe = self.surface(row)
        cos, sin2 = cos_theta(r), sin2_theta(r)
        model = reflection.model("sandford_robertson")
        scale = has_lobe * model.lobe_scale(S, cos, sin2)
        x = dr.sqrt(cos)
        slack, absorbed = (
            scale * interpolate_row(self.tables, 2 * row + part, STEPS, x) for part in range(2)
        )
        return row, model.floor_HDR(S, cos, sin2), absorbed, slack - absorbed

    def between(self, row, i, r) -> tuple:
        """What f needs of the directions; multiplied by the cosine of i."""
        S, has_lobe = self.surface(row)
        above = (i.z > 0) & (r.z > 0)
        cos = dr.select(above, cos_theta(i), 0)
        lobe = has_lobe * cos * sr.f_s(S, i, r)
        one_minus_g = sr.one_minus_g(cos_theta(i), sin2_theta(i), S.b)
        return row, cos * sr.f_d(S, i, r), lobe * one_minus_g, lobe * (1 - one_minus_g)

    def of_block(self, terms, block) -> mi.Vector4f:
        """The values of a block from `toward` or `between`."""
        row, of_floor, constant, of_slack = terms
        index = 2 * self.blocks * row + block
        slack = gathered(self.coefficients, index)
        floor = gathered(self.coefficients, index + self.blocks)
        return floor * of_floor + constant + slack * of_slack

    HDR = f = of_block


@lru_cache(maxsize=32)
def lobe_tables(b: float, e: float, form: str) -> list[np.ndarray]:
    """Tables of Sandford and Robertson's lobe, its HDR for absorbed = 0 and for absorbed = 1."""
    Float64 = dr.float64_array_t(mi.Float)
    model = reflection.model("sandford_robertson")
    S = model.surface(Float64(0), Float64(0), Float64(b), Float64(e), form=form)
    parts = [replace(S, slack=Float64(1 - a), absorbed=Float64(a)) for a in (0, 1)]
    return [tabulated(lambda theta, S=S: model.lobe_HDR(S, theta)).numpy() for S in parts]


class FamilyOfTables:
    """Base class of families whose HDR, at most 1, is tabulated for each bin.

    tables: HDR at even steps of sqrt(cos), by blocks. steps: their number.
    """

    saturates = False
    tables: mi.Float
    steps: int

    def toward(self, row, r) -> tuple:
        """What HDR(theta_r) needs of the observer's direction."""
        return between_nodes(row, dr.sqrt(cos_theta(r)), self.steps)

    def HDR(self, place, block) -> mi.Vector4f:
        return interpolated(self.tables, place, self.blocks, block)


class MicrofacetFamily(FamilyOfTables):
    """Spectral microfacet materials: the lobe is linear in the Fresnel reflectance of a facet."""

    steps = STEPS

    def __init__(self, materials: list[SpectralParameters], bins: Bins):
        self.blocks = blocks_of(bins.count)
        numbers, tables = [], []
        for material in materials:
            common = material.common
            tables.append(facet_tables(material, bins.band, bins.count))
            alpha, gamma = (dr.scalar.ArrayXf64(common[name]) for name in ("alpha", "gamma"))
            peak, spread = distribution.peak(alpha, gamma)[0], distribution.spread(alpha)[0]
            numbers.append([peak, spread, common["gamma"], common["rho_d"]])
        self.has_floor = any(material.common["rho_d"] > 0 for material in materials)
        self.numbers = in_blocks(numbers)
        self.F, self.tables = map(in_blocks, zip(*tables))

    def facet(self, place, block) -> mi.Vector4f:
        """Fresnel reflectances at a place of the table."""
        return interpolated(self.F, place, self.blocks, block)

    def between(self, row, i, r) -> tuple:
        """What f needs of the directions; multiplied by the cosine of i."""
        peak, spread, gamma, rho_d = gathered(self.numbers, row)
        c_i, c_r = cos_theta(i), cos_theta(r)
        sin2, p2 = distribution.half_vector(i, r)
        D = distribution.density(sin2, peak, spread, gamma)
        above = dr.select((i.z > 0) & (r.z > 0), c_i, 0)
        lobe = 0.25 * above * D * distribution.visibility(c_i, c_r, p2)
        p = dr.minimum(dr.sqrt(p2), 1)
        places = (between_nodes(row, dr.sqrt(cos), STEPS_OF_F) for cos in (p, c_i, c_r))
        return lobe, above * dr.inv_pi * rho_d, *places

    def f(self, terms, block) -> mi.Vector4f:
        lobe, floor, p, c_i, c_r = terms
        value = lobe * self.facet(p, block)
        if not self.has_floor:
            return value
        return value + floor * (1 - self.facet(c_i, block)) * (1 - self.facet(c_r, block))


class DirectionalFamily(FamilyOfTables):
    """Spectral materials whose emissivity is known by angle, with a reciprocal diffuse reflection.

    f = rho(theta_i) rho(theta_r) / (pi m) with the mean m of rho over the hemisphere, weighted by
    the cosine, has the HDR rho(theta_r) = 1 - emissivity(theta_r).
    """

    steps = STEPS_OF_F

    def __init__(self, materials: list[SpectralParameters], bins: Bins):
        self.blocks, cos = blocks_of(bins.count), np.linspace(0, 1, STEPS_OF_F + 1) ** 2
        tables = [
            bins.coefficients(material.facet_reflectance(bins.grid_um, cos)).T
            for material in materials
        ]
        means = np.array([2 * np.trapezoid(rho.T * cos, cos, axis=1) for rho in tables])
        self.tables = in_blocks(tables)
        self.inverse = in_blocks(np.divide(1, np.pi * means, where=means > 0, out=0 * means))

    def between(self, row, i, r) -> tuple:
        """What f needs of the directions; multiplied by the cosine of i."""
        above = dr.select((i.z > 0) & (r.z > 0), cos_theta(i), 0)
        return row, above, self.toward(row, i), self.toward(row, r)

    def f(self, terms, block) -> mi.Vector4f:
        row, above, i, r = terms
        inverse = gathered(self.inverse, row * self.blocks + block)
        return above * self.HDR(i, block) * self.HDR(r, block) * inverse


def largest_HDR(family, materials: int) -> float:
    """Largest HDR of the materials of a family, at the angles of its tables and in any bin."""
    lane = dr.arange(mi.UInt32, materials * family.blocks * STEPS)
    node, block = lane % STEPS, lane // STEPS
    cos = dr.square(mi.Float(node + 1) / STEPS)
    r = mi.Vector3f(dr.safe_sqrt(1 - dr.square(cos)), 0, cos)
    HDR = family.HDR(family.toward(block // family.blocks, r), block % family.blocks)
    return float(dr.max(HDR, axis=None)[0])


@lru_cache(maxsize=32)
def facet_tables(material: SpectralParameters, band, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Tables of a microfacet material by bin, which scenes share.

    The Fresnel reflectances (STEPS_OF_F + 1, count), and HDR (STEPS + 1, count).
    """
    Float64 = dr.float64_array_t(mi.Float)
    bins, x = Bins(band, count), np.linspace(0, 1, STEPS_OF_F + 1)
    F = bins.coefficients(material.facet_reflectance(bins.grid_um, x**2))
    alpha, gamma = material.common["alpha"], material.common["gamma"]

    def of_bin(theta, F):
        return Float64(weights_of_facets(alpha, gamma, tuple(theta.numpy())) @ F)

    lobe = np.array([tabulated(partial(of_bin, F=F_of_bin)).numpy() for F_of_bin in F])
    refracted = 2 * np.trapezoid((1 - F) * x**2, x**2, axis=1)  # mean of 1 - F over the hemisphere
    floor = material.common["rho_d"] * refracted * (1 - F.T)
    return F.T, lobe.T + rows_at(np.linspace(0, 1, STEPS + 1), x, floor)


@lru_cache(maxsize=16)
def weights_of_facets(alpha: float, gamma: float, angles: tuple[float, ...]) -> np.ndarray:
    """Matrix (angles, STEPS_OF_F + 1) of the lobe's HDR, which is linear in facets' reflectances.

    The derivative of the quadrature with respect to the reflectance of each of its points is the
    weight of the point. It is divided between the two neighbours in the table.
    """
    Float64, points = dr.float64_array_t(mi.Float), []
    theta = Float64(np.array(angles))
    S = reflection.model("microfacet").surface(*map(Float64, (alpha, gamma, 1.5, 0.0, 0.0)))

    def reflectance(S, p):
        value = dr.zeros(Float64, dr.width(p))
        dr.enable_grad(value)
        points.append((p.numpy(), value))
        return value

    with dr.resume_grad():
        dr.backward(hemispherical.lobe_reflectance(S, theta, reflectance))
    count, nodes = len(angles), STEPS_OF_F + 1
    matrix = np.zeros(count * nodes)
    for p, value in points:
        weight, x = dr.grad(value).numpy(), np.sqrt(np.clip(p, 0, 1)) * STEPS_OF_F
        low = np.minimum(x.astype(int), STEPS_OF_F - 1)
        first = low + nodes * np.repeat(np.arange(count), len(p) // count)
        for number, share in ((first, low + 1 - x), (first + 1, x - low)):
            matrix += np.bincount(number, weight * share, len(matrix))
    return matrix.reshape(count, nodes)


def form_of(materials: list[SpectralParameters]) -> str:
    """Form of the first one of Sandford and Robertson's model; without one, of the first of all."""
    forms = (m.form for m in materials if m.model.name == "sandford_robertson")
    return next(forms, materials[0].form)


def families_of(materials: list[SpectralParameters], bins: Bins) -> tuple[list, list]:
    """The families of some materials, and the numbers of the materials of each."""
    kinds = {}
    for number, material in enumerate(materials):
        family, form = SandfordRobertsonFamily, material.form
        if material.model.name == "grey":  # a limit of any form, lest it cost a family of its own
            form = form_of(materials)
        if material.by_angle is not None:
            family = DirectionalFamily
        elif material.model.name == "microfacet":
            family = MicrofacetFamily
        kinds.setdefault((family, form), []).append(number)
    families = [family([materials[k] for k in of], bins) for (family, _), of in kinds.items()]
    return families, list(kinds.values())
