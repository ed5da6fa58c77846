"""Paths by wavelength: the throughput of each bin, in scenes with spectral materials.

The walk follows the mean of the band, by the parameters of the mean reflectance. Here each path
carries, for each bin of wavelengths, its throughput divided by that of the walk. The in-band
radiance of an emission is then the sum over the bins of their throughputs, each with the share of
the source's radiance in the bin.
"""

from functools import cached_property, lru_cache, partial

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.sparse import csr_array, diags_array, hstack

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection.directions import SMALLEST
from mi_lcair.physics.spectra.bins import COUNTS, TRAPEZOIDS, Binning, bins_for, grid_hats
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.plugins.bins.blocks import blocks_of, gathered, in_blocks
from mi_lcair.plugins.bins.lobes import DIFFUSE, MIRROR, families_of
from mi_lcair.plugins.bsdfs.plume import is_plume, spectral_plumes
from mi_lcair.plugins.bsdfs.reflection_bsdf import LOBES
from mi_lcair.plugins.bsdfs.spectral_bsdf import has_spectrum, is_spectral
from mi_lcair.plugins.derivatives import children
from mi_lcair.plugins.emission.samples import BinnedRadiance
from mi_lcair.plugins.emission.source import BinOfBlackbody, Source
from mi_lcair.plugins.emission.sources import at_pointer, numbered, spectra, table_by_pointer
from mi_lcair.plugins.emission.triangles import pointer_id, table_size
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal

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
        self, scene, band, ambient_temperature: float | None, count: int, binning: Binning
    ):
        """ambient_temperature: of the closure [K]; None without it. count: number of bins; 0 for as
        many as the materials need. binning: decides on that.
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
            kind = BinOfBlackbody if source.spectrum is None else Spectrum
            name = source.name if source.spectrum is None else source.spectrum.name
            result += [
                Source.of_bin(source, k, kind(name, rows, radiance * hat), band)
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
def products(count: int) -> csr_array:
    """Weights of the grid of any band, (SAMPLES, neighbours times count), see `ByBin.densities`."""
    hats = grid_hats(count)
    weighted = hats.multiply(TRAPEZOIDS[:, None] / (TRAPEZOIDS @ hats))
    shifted = (diags_array([1.0], offsets=[-step], shape=(count, count)) for step in NEIGHBOURS)
    return hstack([weighted.multiply(hats @ shift) for shift in shifted], format="csr")


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
