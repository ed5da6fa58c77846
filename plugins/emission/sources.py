"""What emission is told apart by: the groups of a scene, or within them each spectrum that
something radiates.
"""

from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.spectrum import Spectrum
from mi_lcair.plugins.emission.triangles import pointer_id

OTHER = "other"  # group of what has no thermal emitter
MAX_SOURCES = 64  # told apart one by one; beyond, blackbodies are recorded by wavelength
WAVELENGTHS = (
    32  # Chebyshev nodes of the band: a polynomial through them follows Planck's law to 1e-6
)


@dataclass(frozen=True)
class Source:
    """A group, or that part of it that radiates one spectrum: a blackbody's at `temperature` [K],
    or a tabulated one.

    name: of the spectrum; in_band: radiance before emissivity [W m^-2 sr^-1]. A whole group has
    neither.
    """

    group: str
    name: str | None = None
    in_band: float | None = None
    temperature: float | None = None
    spectrum: Spectrum | None = field(default=None, compare=False)


class Sources:
    """The sources of a scene's emitters, numbered, and which one a hit belongs to.

    Plain: one for each group. by_spectrum: one for each spectrum in each group; where that makes
    more than MAX_SOURCES, the blackbodies of a group become one again, and `share` holds, by their
    temperature, how their radiance is distributed over `wavelengths_um`.
    """

    def __init__(self, emitters, groups: list[str], band, by_spectrum: bool):
        self.by_spectrum = by_spectrum
        self.list = [Source(group) for group in groups]
        self.wavelengths_um, self.share = np.empty(0), None
        per_emitter = [[Source(getattr(emitter, "group", OTHER))] for emitter in emitters]
        if by_spectrum:
            per_emitter = [spectra(emitter, band) for emitter in emitters]
            self.list = list(dict.fromkeys(source for sources in per_emitter for source in sources))
            if len(self.list) > MAX_SOURCES:
                self.tabulate(per_emitter, band)
                per_emitter = [
                    [by_wavelength(source) for source in sources] for sources in per_emitter
                ]
                self.list = list(
                    dict.fromkeys(source for sources in per_emitter for source in sources)
                )
                if len(self.list) > MAX_SOURCES:
                    raise InputError(
                        f"the scene has {len(self.list)} tabulated spectra and groups; at most {MAX_SOURCES} can be told apart"
                    )
            if OTHER in groups:
                self.list.append(Source(OTHER))  # shapes that only reflect, and what escapes
        numbers = {source: k for k, source in enumerate(self.list)}
        rest = numbers.get(Source(OTHER), 0)

        ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in emitters]
        first, stride = np.zeros((2, max(ids, default=0) + 1), dtype=np.uint32)
        entries = [rest]
        for key, sources in zip(ids, per_emitter):
            first[key], stride[key] = len(entries), len(sources) > 1
            entries += [numbers[source] for source in sources]
        self.first, self.stride = mi.UInt32(first), mi.UInt32(stride)
        self.entries = mi.UInt32(np.array(entries, dtype=np.uint32))
        dr.make_opaque(self.first, self.stride, self.entries)

    def tabulate(self, per_emitter, band) -> None:
        """Share of each blackbody's in-band radiance per um at the nodes [1/um], for the entries as
        they are numbered.
        """
        nodes = np.polynomial.chebyshev.chebpts1(WAVELENGTHS)
        self.wavelengths_um = (band.lower_um + band.upper_um) / 2 + nodes * (
            band.upper_um - band.lower_um
        ) / 2
        flat = [source for sources in per_emitter for source in sources]
        temperatures, row = np.unique(
            [source.temperature or np.nan for source in flat], return_inverse=True
        )
        in_band = in_band_radiance(band, np.nan_to_num(temperatures, nan=1.0))
        table = spectral_radiance(
            self.wavelengths_um, np.nan_to_num(temperatures, nan=1.0)[:, None]
        )
        share = np.divide(
            table, in_band[:, None], out=np.zeros_like(table), where=in_band[:, None] > 0
        )
        share[np.isnan(temperatures)] = 0  # tabulated sources are told apart by themselves
        self.share = mi.Float(np.append(share, np.zeros((1, WAVELENGTHS)), axis=0).ravel())
        self.share_row = mi.UInt32(np.append(len(temperatures), row).astype(np.uint32))
        dr.make_opaque(self.share, self.share_row)

    def entry(self, emitter, prim_index):
        """Where the source of a hit stands in the tables; of no emitter: 0."""
        key = dr.reinterpret_array(mi.UInt32, emitter)
        return (
            dr.gather(mi.UInt32, self.first, key)
            + dr.gather(mi.UInt32, self.stride, key) * prim_index
        )

    def number(self, entry):
        """Index into `list`."""
        return dr.gather(mi.UInt32, self.entries, entry)

    def shares(self, entry) -> list:
        """By wavelength, what one W m^-2 sr^-1 from that source is made of [1/um]."""
        row = dr.gather(mi.UInt32, self.share_row, entry) * WAVELENGTHS
        return [dr.gather(mi.Float, self.share, row + k) for k in range(WAVELENGTHS)]


def by_wavelength(source: Source) -> Source:
    return source if source.temperature is None else Source(source.group)


def spectra(emitter, band) -> list[Source]:
    """The sources of one emitter: one, or one for each facet. Raises InputError for an emitter
    without a spectrum.
    """
    if not hasattr(emitter, "group"):
        raise InputError(
            f"an emitter of class {emitter.class_name()} has no spectrum; only thermal emitters have"
        )
    if emitter.spectrum is not None:
        in_band = float(emitter.radiance[0])
        table = emitter.spectrum
        scaled = Spectrum(
            table.name,
            table.wavelengths_um,
            table.radiance * in_band / table.in_band_radiance(emitter.band),
        )
        return [Source(emitter.group, table.name, in_band, spectrum=scaled)]
    if emitter.radiance is not None:
        raise InputError(
            f"group {emitter.group}: a source of given `radiance` has no spectrum; give it a `spectrum`"
        )
    if emitter.derived is None:
        raise InputError(
            f"group {emitter.group}: its temperature varies inside the facets, so that its spectra cannot be told "
            "apart; give it a temperature per facet (face_temperature)"
        )
    # Float32 holds 301.7 K as 301.70001; nobody means temperatures to that digit
    temperatures, number = np.unique(
        dr.detach(emitter.sources()[0]).numpy().astype(float).round(4), return_inverse=True
    )
    radiances = in_band_radiance(band, temperatures)
    sources = [
        Source(emitter.group, f"{T:.7g} K", float(L), float(T))
        for T, L in zip(temperatures, radiances)
    ]
    return [sources[k] for k in number.ravel()]
