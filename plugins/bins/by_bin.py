"""Paths by wavelength: the throughput of each bin, in scenes with spectral materials.

The walk follows the mean of the band, by the parameters of the mean reflectance. Here each path
carries, for each bin of wavelengths, its throughput divided by that of the walk. The in-band
radiance of an emission is then the sum over the bins of their throughputs, each with the share of
the source's radiance in the bin.
"""

from dataclasses import replace
from functools import cached_property, lru_cache, partial

import drjit as dr
import mitsuba as mi
import numpy as np
import scipy

from mi_lcair.errors import InputError
from mi_lcair.physics import reflection
from mi_lcair.physics.reflection import microfacet_equations
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.reflection.interface import SMALLEST, cos_theta, sin2_theta
from mi_lcair.physics.spectra.bins import (
    COUNTS,
    TRAPEZOIDS,
    Binning,
    Bins,
    bins_for,
    grid_hats,
    of_falloff,
    reflectances,
)
from mi_lcair.physics.spectra.parameters import SpectralParameters
from mi_lcair.plugins.bsdfs.plume import is_plume, spectral_plumes
from mi_lcair.plugins.bsdfs.reflection_bsdf import (
    LOBES,
    STEPS,
    between_nodes,
    has_spectrum,
    interpolate_row,
    is_spectral,
    tabulated,
)
from mi_lcair.plugins.derivatives import children, own_memory
from mi_lcair.plugins.emission.emitter_table import BinnedRadiance
from mi_lcair.plugins.emission.source import BinOfSpectrum, Source
from mi_lcair.plugins.emission.sources import at_pointer, numbered, spectra, table_by_pointer
from mi_lcair.plugins.emission.triangles import pointer_id, table_size
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.table import rows_at

# Blocks of bins: four neighbouring bins of wavelength, which paths read and multiply at once
# -------------------------------------------------------------------------------------------
# Tables have their bins last, so that one gather finds the numbers of a block.

SIZE = 4  # bins of a block, the entries of mi.Vector4f


def blocks_of(count: int) -> int:
    """Number of blocks that hold a number of bins."""
    return -(-count // SIZE)


def in_blocks(values, beyond: str = "edge") -> mi.Float:
    """Table of values (..., bins) whose last block is filled with the last bin, or "constant" 0."""
    values = np.asarray(values, dtype=float)
    missing = -values.shape[-1] % SIZE
    array = mi.Float(np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)], beyond).ravel())
    own_memory([array])
    return array


def gathered(table: mi.Float, index) -> mi.Vector4f:
    """A block of a table, by its number in it."""
    return dr.gather(mi.Vector4f, table, index)


def interpolated(table: mi.Float, place: tuple, blocks: int, block) -> mi.Vector4f:
    """A block of a table (rows, nodes, bins) at a place from `between_nodes`."""
    node, way = place
    index = node * blocks + block
    return dr.lerp(gathered(table, index), gathered(table, index + blocks), way)


# Reflectances of spectral materials by bin, from tables that the walk reads
# --------------------------------------------------------------------------
# A family is the materials of one reflection model in one form. Its `between` and `toward` compute
# what all bins share; `f` and `HDR` then give the values of a block of bins with few operations.
# Row 0 of a family stands for surfaces that do not belong to it.

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
            peak, spread = (
                microfacet_equations.peak(alpha, gamma)[0],
                microfacet_equations.spread(alpha)[0],
            )
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
        sin2, p2 = microfacet_equations.half_vector(i, r)
        D = microfacet_equations.density(sin2, peak, spread, gamma)
        above = dr.select((i.z > 0) & (r.z > 0), c_i, 0)
        lobe = 0.25 * above * D * microfacet_equations.visibility(c_i, c_r, p2)
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
        dr.backward(microfacet_equations.lobe_reflectance(S, theta, reflectance))
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


ON_BOTH_SIDES = "TwoSidedBRDF"
MOST_BY_BIN = 2048  # sources by bin whose covariances are kept
MOST_PROJECTED = 16  # sources for which the binning error is projected
AT_ONCE = 512  # sources that are tabulated together, to bound the memory
NEIGHBOURS = -1, 0, 1  # bins whose hats overlap that of a bin, counted from it
SPECTRUM_ROWS = 801  # even wavelengths of the spectra of sources by bin


class ByBin:
    """Tables of a scene with spectral materials, and what the walk does with them.

    bins: the hats. binning_error: relative error that they cause. sources: the sources of emission,
    one for each spectrum.
    """

    def __init__(
        self,
        scene,
        band,
        ambient_temperature: float | None,
        count: int,
        binning: Binning,
        by_source: bool = False,
    ):
        """ambient_temperature: of the closure [K]; None without it. count: number of bins; 0 for as
        many as the materials need. binning: decides on that. by_source: whether sources are told
        apart, of which many leave fewer bins.
        """
        bsdfs = {shape.bsdf() for shape in scene.shapes()}
        spectral = {id(b): b for b in sorted(bsdfs, key=lambda b: b.id()) if is_spectral(b)}
        self.layers = [(bsdf, sides_of(bsdf)) for bsdf in spectral.values()]
        layers = [side for _, sides in self.layers for side in sides if has_spectrum(side)]
        for layer in layers:
            layer.spectrum.check_covers(band, f"material '{layer.material}'")
        materials = list(dict.fromkeys(layer.spectrum for layer in layers))
        emitters = list(scene.emitters())
        per_emitter = [spectra(emitter) for emitter in emitters]
        self.sources = list(dict.fromkeys(source for many in per_emitter for source in many))
        self.ambient = None
        if ambient_temperature is not None:
            self.ambient = dr.opaque(mi.UInt32, len(self.sources))
            self.sources += Source.of_blackbodies("ambient", band, [ambient_temperature])
        some = np.linspace(0, len(self.sources) - 1, MOST_PROJECTED).round().astype(int)
        projected = [self.sources[k] for k in np.unique(some)]
        counts = (count,) if count else COUNTS
        if by_source:
            counts = [of for of in counts if of * len(self.sources) <= MOST_BY_BIN] or counts[:1]
        spectra_at = partial(radiances, projected)
        # A change of a spectrum, as for a derivative, must not change the number of bins
        measured = list(dict.fromkeys(layer.measured_spectrum for layer in layers))
        self.bins, self.binning_error = bins_for(band, measured, spectra_at, counts, binning)
        self.count, self.blocks = self.bins.count, blocks_of(self.bins.count)
        self.families, of_families = families_of(materials, self.bins)
        self.tabulate_surfaces(materials, of_families)
        self.tabulate_plumes(spectral_plumes(scene))
        self.tabulate_sources(emitters, per_emitter)

    def __str__(self):
        return f"{self.count} bins, which cause a relative error of {self.binning_error:.1e}"

    def sources_by_bin(self) -> list[Source]:
        """The sources by bin: those of the first source, then those of the second one, and so on.

        The spectrum of each is that of its source times a hat. Raises InputError if they are too
        many to be told apart.
        """
        if len(self.sources) * self.count > MOST_BY_BIN:
            raise InputError(
                f"the scene has {len(self.sources)} spectra of sources; with {self.count} bins of "
                f"wavelength at most {MOST_BY_BIN // self.count} can be told apart"
            )
        steps = np.linspace(0, len(self.bins.grid_um) - 1, SPECTRUM_ROWS).round().astype(int)
        tables = [s.spectrum.wavelengths_um for s in self.sources if s.spectrum is not None]
        band, rows = self.bins.band, np.concatenate([self.bins.nodes_um, *tables])
        inside = rows[(rows >= band.lower_um) & (rows <= band.upper_um)]
        rows = np.unique(np.concatenate([self.bins.grid_um[steps], inside]))
        hats = self.bins.hats(rows).T
        result = []
        for source, radiance in zip(self.sources, radiances(self.sources, rows)):
            name = source.name if source.spectrum is None else source.spectrum.name
            result += [
                Source.of_bin(
                    source, k, BinOfSpectrum(name, rows, radiance * hat, source.spectrum), band
                )
                for k, hat in enumerate(hats)
            ]
        return result

    @cached_property
    def densities(self) -> np.ndarray:
        """int S h_k h_(k + step) dlambda / int h_k dlambda of the sources, for steps in NEIGHBOURS.

        They are divided by the in-band radiance, (sources, neighbours, count) [1/um]. The response
        of the band does not enter.
        """
        in_band = np.array([source.in_band for source in self.sources])
        weights = products(self.count)
        means = self.of_spectra(lambda radiance: radiance @ weights)
        means = means.reshape(len(in_band), len(NEIGHBOURS), self.count)
        return means / np.where(in_band > 0, in_band, np.inf)[:, None, None]

    def of_spectra(self, function) -> np.ndarray:
        """A function of the spectra of all sources on the grid, of a few sources at a time."""
        groups = [self.sources[k : k + AT_ONCE] for k in range(0, len(self.sources), AT_ONCE)]
        return np.concatenate([function(radiances(of, self.bins.grid_um)) for of in groups])

    def tabulate_surfaces(self, materials, of_families) -> None:
        """Set the material and the lobe of the front and the back of each BSDF, by its pointer.

        Entry 0 stands for surfaces whose material is constant in the band. of_families: numbers of
        the materials of each family.
        """
        ids = [pointer_id(mi.BSDFPtr(bsdf)) for bsdf, _ in self.layers]
        table = np.zeros((2, 2, table_size(ids)), dtype=np.uint32)  # (what, side, pointer)
        for number, (_, sides) in zip(ids, self.layers):
            for side, layer in enumerate(sides):
                if has_spectrum(layer):
                    table[0, side, number] = 1 + materials.index(layer.spectrum)
                    table[1, side, number] = LOBES.index(layer.lobe)
        self.has_simple_lobes = bool(table[1].any())  # mirror or diffuse
        self.width = table.shape[-1]
        self.material, self.lobe = (mi.UInt32(part.ravel()) for part in table)
        # Row of each material in each family; NO_ROW in the others
        self.rows = []
        for numbers in of_families:
            rows = np.full(len(materials) + 1, len(materials), dtype=np.uint32)
            rows[1 + np.array(numbers)] = np.arange(len(numbers))
            self.rows.append(mi.UInt32(rows))
        self.none = mi.UInt32(len(materials))
        dr.make_opaque(self.material, self.lobe, self.rows, self.none)

    def tabulate_plumes(self, plumes) -> None:
        """Set the transmittance of each plume in each bin, divided by its mean in the band."""
        relative = [
            (1 - self.bins.coefficients(plume.spectrum.at(self.bins.grid_um)["emissivity"]))
            / max(float(plume.transmittance[0]), SMALLEST)
            for plume in plumes
        ]
        self.relative = in_blocks(relative) if plumes else None

    def tabulate_sources(self, emitters, per_emitter) -> None:
        """Set the source of each primitive, the shares of its bins and its in-band radiance."""
        self.source_numbers = numbered(emitters, per_emitter, self.sources)
        self.shares = in_blocks(self.of_spectra(self.bins.shares), beyond="constant")
        self.in_band = mi.Float([source.in_band for source in self.sources])
        by_material = [is_thermal(e) and e.given_emissivity is None for e in emitters]
        self.by_material = table_by_pointer(emitters, by_material)
        dr.make_opaque(self.in_band)

    # ---------------------------------------------------------------- Along the paths

    def ones(self) -> dr.Local:
        """A path's own array with a 1 for each bin, by blocks."""
        return dr.alloc_local(mi.Vector4f, self.blocks, value=mi.Vector4f(1))

    def surface(self, bsdf, z, active) -> tuple[mi.UInt32, mi.UInt32]:
        """Material and lobe of a surface seen from a side, `z` the sign of the side.

        Material 0 stands for one that is constant in the band.
        """
        pointer = dr.reinterpret_array(mi.UInt32, bsdf)
        index = pointer + dr.select(z < 0, mi.UInt32(self.width), 0)
        known = active & (pointer < self.width)
        material = dr.gather(mi.UInt32, self.material, index, known)
        return material, dr.gather(mi.UInt32, self.lobe, index, known)

    def in_families(self, material) -> list[tuple]:
        """Each family, whether a material belongs to it, and its row there."""
        rows = [dr.gather(mi.UInt32, rows, material) for rows in self.rows]
        return [
            (family, row != self.none, dr.select(row != self.none, row, 0))
            for family, row in zip(self.families, rows)
        ]

    def reflects(self, bsdf, wi, wo, active, passed=()) -> tuple:
        """What the bins' values of a BSDF need, for `value`: materials, lobe, terms.

        passed: how often a drawn ray passes each spectral plume.
        """
        material, lobe = self.surface(bsdf, wi.z, active)
        side = dr.select(wi.z < 0, -1, mi.Float(1))
        r, i = mi.Vector3f(wi.x, wi.y, side * wi.z), mi.Vector3f(wo.x, wo.y, side * wo.z)
        terms = [
            (here, family.between(row, i, r), family.toward(row, r))
            for family, here, row in self.in_families(material)
        ]
        return material > 0, lobe, dr.maximum(i.z, 0), terms, passed

    def value(self, reflection: tuple, block) -> mi.Vector4f:
        """BSDF times cosine of a block of bins [1/sr]; HDR for a mirror."""
        _, lobe, cos, terms, _ = reflection
        total = mi.Vector4f(0)
        for family, (here, between, toward) in zip(self.families, terms):
            value = family.f(between, block)
            if family.saturates or self.has_simple_lobes:
                HDR = family.HDR(toward, block)
                value /= dr.maximum(HDR, 1)
            if self.has_simple_lobes:
                HDR = dr.minimum(HDR, 1)
                value = dr.select(lobe == DIFFUSE, HDR * cos * dr.inv_pi, value)
                value = dr.select(lobe == MIRROR, HDR, value)
            total += dr.select(here, value, 0)
        return total

    def emits(self, emitter, bsdf, wi, active) -> tuple:
        """What the bins' emissivities need, for `emissivity`."""
        by_material = at_pointer(self.by_material, emitter) > 0
        material, _ = self.surface(bsdf, wi.z, active & by_material)
        r = mi.Vector3f(wi.x, wi.y, dr.abs(wi.z))
        families = self.in_families(material)
        return material > 0, [(here, family.toward(row, r)) for family, here, row in families]

    def emissivity(self, emission: tuple, block) -> mi.Vector4f:
        """Emissivity of a block of bins; 1 where the emitter's radiance holds it already."""
        value = mi.Vector4f(1)
        for family, (here, toward) in zip(self.families, emission[1]):
            value = dr.select(here, 1 - dr.minimum(family.HDR(toward, block), 1), value)
        return value

    @dr.syntax
    def reflect(self, throughputs: dr.Local, hit, bs, weight):
        """Multiply the throughputs by the bins' reflectances along the sampled direction."""
        wi = hit.si.wi
        reflection = self.reflects(hit.bsdf, wi, bs.wo, hit.goes_on)
        mean = weight[0] * bs.pdf
        multiplied = reflection[0] & (mean > 0)
        inverse = dr.select(multiplied, 1 / dr.select(multiplied, mean, 1), 0)
        block = mi.UInt32(0)
        while block < self.blocks:
            factor = dr.select(multiplied, inverse * self.value(reflection, block), 1)
            throughputs.write(throughputs.read(block) * factor, block)
            block += 1

    @dr.syntax
    def sums(self, throughputs: dr.Local, factors: dr.Local, sources, emission, reflection):
        """In-band radiance relative to that of the sources, and the factors of the bins.

        Parameters
        ----------
        throughputs : dr.Local
        factors : dr.Local
            Set to the throughput of each bin, times its emissivity and the BSDF.
        sources : list of mi.UInt32
            Numbers of the sources that emit.
        emission : tuple
            Of `emits`.
        reflection : tuple or None
            Of `reflects`, for a direction that was drawn at a surface.

        Returns
        -------
        list of mi.Float
            For each source the sum of the factors times the shares of its bins.
        """
        totals = [mi.Float(0) for _ in sources]
        block = mi.UInt32(0)
        while block < self.blocks:
            factor = throughputs.read(block) * self.emissivity(emission, block)
            factor *= self.reflected(reflection, block)
            factors.write(factor, block)
            totals = self.with_block(totals, factor, sources, block)
            block += 1
        return totals

    def reflected(self, reflection: tuple | None, block) -> mi.Vector4f:
        """`value` of a spectral surface, times the transmittances of passed plumes.

        It is 1 for another surface, and where nothing is reflected. The transmittances are relative
        to their means in the band.
        """
        if reflection is None:
            return mi.Vector4f(1)
        value = dr.select(reflection[0], self.value(reflection, block), 1)
        for number, times in enumerate(reflection[-1]):
            relative = gathered(self.relative, number * self.blocks + block)
            value *= dr.select(times > 0, dr.power(relative, mi.Float(times)), 1)
        return value

    def with_block(self, totals, factor, sources, block) -> list:
        """The sums of `sums` with those of a block."""
        shares = [gathered(self.shares, n * self.blocks + block) for n in sources]
        return [total + dr.dot(factor, share) for total, share in zip(totals, shares)]

    def numbers(self, emitter, parts, beyond=None) -> list[mi.UInt32]:
        """Numbers of the sources of an emitter's parts.

        parts: numbers of the parts, and their shares of the radiance. beyond: whether the ambient
        radiance stands for the emitter.
        """
        numbers = [self.source_numbers.at(emitter, prim) for prim, _ in parts]
        if beyond is not None and self.ambient is not None:
            numbers = [dr.select(beyond, self.ambient, number) for number in numbers]
        return numbers

    def radiance(self, path, emitted, parts, numbers, emits=None, reflection=None):
        """What the bins of a path see of an emitter.

        Parameters
        ----------
        path : PathState
            Its `factors` are set to the factors of the bins.
        emitted : mi.Spectrum
            Radiance of the emitter for the mean of the band.
        parts : list of tuple
            Numbers of its parts, and their shares of the radiance.
        numbers : list of mi.UInt32
            Numbers of the sources of the parts.
        emits : tuple or None
            Of `emits`, for a surface; None for an emitter whose radiance is known.
        reflection : tuple or None
            Of `reflects`, for a direction that was drawn at a surface.

        Returns
        -------
        BinnedRadiance
        """
        emitted = mi.Float(emitted[0])
        base = emitted
        if emits is not None:
            base = dr.select(emits[0], dr.gather(mi.Float, self.in_band, numbers[0]), emitted)
        emits = emits or (False, [])
        totals = self.sums(path.by_bin, path.factors, numbers, emits, reflection)
        relative = sum(share * total for (_, share), total in zip(parts, totals))
        sources = [(number, share) for number, (_, share) in zip(numbers, parts)]
        return BinnedRadiance(base * relative, base, sources, path.factors)

    def drawn(self, path, hit, direct, value, radiance, parts) -> BinnedRadiance:
        """What the bins see along a direction that was drawn toward an emitter, times the BSDF.

        hit: where it was drawn. direct: what the ray hits, an `EmitterSample`. value: the direction
        in the frame of the surface, BSDF times cosine for the mean of the band, and the density.
        """
        surface, (to, f, _) = direct.hit, value
        emits = self.emits(direct.emitter, surface.bsdf(), surface.wi, direct.counts)
        reflection = self.reflects(hit.bsdf, hit.si.wi, to, hit.reflects, direct.passed)
        numbers = self.numbers(direct.emitter, parts)
        result = self.radiance(path, radiance, parts, numbers, emits, reflection)
        factor = dr.select(reflection[0], 1, f[0])
        if direct.transmittance is not None:
            # The radiance of a surface comes from a table, without what its ray has passed
            factor *= dr.select(emits[0], direct.transmittance, 1)
        return result.times(factor)


@lru_cache(maxsize=8)
def products(count: int) -> "scipy.sparse.csr_array":
    """Weights of the grid of any band, (SAMPLES, neighbours times count), see `ByBin.densities`."""
    hats = grid_hats(count)
    weighted = hats.multiply(TRAPEZOIDS[:, None] / (TRAPEZOIDS @ hats))
    shifted = (
        scipy.sparse.diags_array([1.0], offsets=[-step], shape=(count, count))
        for step in NEIGHBOURS
    )
    return scipy.sparse.hstack([weighted.multiply(hats @ shift) for shift in shifted], format="csr")


def radiances(sources: list[Source], wavelengths_um: np.ndarray) -> np.ndarray:
    """Spectral radiance of sources [W m^-2 sr^-1 um^-1], (sources, wavelengths)."""
    return np.array([source.radiance(wavelengths_um) for source in sources])


def sides_of(bsdf) -> tuple:
    """The reflection models of the front and the back of a BSDF; None for a side without one.

    Both sides of a plume are the same.
    """
    if is_plume(bsdf):
        return bsdf, bsdf
    if bsdf.class_name() == ON_BOTH_SIDES:
        layers = children(bsdf)
        return layers[0], layers[-1]
    return bsdf, None
