"""Groups of a scene, and sources by which emission is recorded: groups, or their spectra."""

from copy import copy
from itertools import chain

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.plugins.emission.source import OTHER, Source
from mi_lcair.plugins.emission.triangles import PrimitiveTable, pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, groups_of, is_thermal

MAX_SOURCES = 64  # sources recorded separately; if there are more, blackbodies share wavelengths
# Chebyshev nodes of the band. A polynomial through them agrees with Planck's law to 1e-6.
WAVELENGTHS = 32


class Groups:
    """The group and the facet type of each emitter of a scene.

    labels: the groups of the thermal emitters, and OTHER if the scene has other emitters or shapes
    that do not emit.
    """

    def __init__(self, scene, emitters):
        labels = {group for emitter in emitters for group in groups_of(emitter)}
        if not all(is_thermal(shape.emitter()) for shape in scene.shapes()):
            labels.add(OTHER)
        self.labels = sorted(labels)
        number = {label: k for k, label in enumerate(self.labels)}
        types = [facet_type_of(emitter) for emitter in emitters]
        self.number = table_by_pointer(
            emitters, [number[groups_of(emitter)[0]] for emitter in emitters], number.get(OTHER, 0)
        )
        self.is_background = table_by_pointer(emitters, [of != "model" for of in types])
        self.is_sky = table_by_pointer(emitters, [of == "sky" for of in types])


def table_by_pointer(emitters, values, otherwise=0) -> mi.UInt32:
    """Integers of emitters, for `at_pointer`; `otherwise` stands for a null pointer."""
    ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in emitters]
    table = np.full(max(ids, default=0) + 1, otherwise, dtype=np.uint32)
    table[ids] = values
    table = mi.UInt32(table)
    dr.make_opaque(table)
    return table


def at_pointer(table: mi.UInt32, emitter: mi.EmitterPtr) -> mi.UInt32:
    """The integers of emitter pointers in a `table_by_pointer`."""
    return dr.gather(mi.UInt32, table, dr.reinterpret_array(mi.UInt32, emitter))


class Sources:
    """Numbered list of the sources of a scene's emitters; finds the source of a hit.

    Without `by_spectrum`, each group is one source. With it, each spectrum in each group is one
    source. If that gives more than MAX_SOURCES, all blackbodies of a group become one source. Their
    radiance is then recorded at the wavelengths `wavelengths_um` [um]. `share` holds the relative
    spectral radiance of each temperature at these wavelengths [1/um]. by_bin: whether `list` holds
    the sources by bin of wavelength. The paths then sum the radiance of groups.
    """

    def __init__(self, emitters, groups: list[str], band, by_spectrum: bool):
        self.by_spectrum, self.by_bin = by_spectrum, False
        self.list = [Source(group) for group in groups]
        self.wavelengths_um, self.share = np.empty(0), None
        per_emitter = [list(map(Source, groups_of(emitter))) for emitter in emitters]
        if by_spectrum:
            per_emitter = [spectra(emitter) for emitter in emitters]
            self.list = list(dict.fromkeys(chain(*per_emitter)))
            if len(self.list) > MAX_SOURCES:
                self.tabulate(per_emitter, band)
                per_emitter = [list(map(by_wavelength, sources)) for sources in per_emitter]
                self.list = list(dict.fromkeys(chain(*per_emitter)))
                if len(self.list) > MAX_SOURCES:
                    raise InputError(
                        f"the scene has {len(self.list)} tabulated spectra and groups; "
                        f"at most {MAX_SOURCES} can be told apart"
                    )
            if OTHER in groups:
                # For shapes that only reflect, and for rays that escape
                self.list.append(Source(OTHER))
        self.recorded = self.list  # those whose radiance the paths sum
        rest = self.list.index(Source(OTHER)) if Source(OTHER) in self.list else 0
        self.numbers = numbered(emitters, per_emitter, self.list, rest)

    def split(self, by_bin: list[Source]) -> None:
        """Let the sources be those by bin of wavelength, which `BySourceAndBin` records."""
        self.by_spectrum, self.by_bin, self.list = True, True, by_bin

    def replaced(self, sources: list[Source]) -> "Sources":
        """The same numbers with other sources, such as those of other temperatures."""
        result = copy(self)
        result.list = sources
        return result

    def tabulate(self, per_emitter, band) -> None:
        """Set `wavelengths_um`, `share` and, for each entry, its row in `share`.

        A row is the spectral radiance at the nodes divided by the in-band radiance [1/um].
        """
        nodes = np.polynomial.chebyshev.chebpts1(WAVELENGTHS)
        middle, half = (band.lower_um + band.upper_um) / 2, (band.upper_um - band.lower_um) / 2
        self.wavelengths_um = middle + nodes * half
        given = [source.temperature or np.nan for source in chain(*per_emitter)]
        temperatures, row = np.unique(given, return_inverse=True)
        known = np.nan_to_num(temperatures, nan=1.0)[:, None]
        table = spectral_radiance(self.wavelengths_um, known)
        in_band = in_band_radiance(band, known)
        share = np.divide(table, in_band, out=np.zeros_like(table), where=in_band > 0)
        share[np.isnan(temperatures)] = 0  # tabulated spectra are sources recorded separately
        self.share = mi.Float(np.append(share, np.zeros((1, WAVELENGTHS)), axis=0).ravel())
        self.share_row = mi.UInt32(np.append(len(temperatures), row).astype(np.uint32))
        dr.make_opaque(self.share, self.share_row)

    def entry(self, emitter, prim_index):
        """Entry of a hit in the tables `numbers` and `share_row`; 0 if there is no emitter."""
        return self.numbers.entry(emitter, prim_index)

    def number(self, entry):
        """Index into `list` of the source at an entry of the tables."""
        return dr.gather(mi.UInt32, self.numbers.values, entry)

    def shares(self, entry) -> list:
        """Spectral radiance per in-band radiance at each wavelength, for an entry [1/um]."""
        row = dr.gather(mi.UInt32, self.share_row, entry) * WAVELENGTHS
        return [dr.gather(mi.Float, self.share, row + k) for k in range(WAVELENGTHS)]


def numbered(emitters, per_emitter, sources: list[Source], otherwise: int = 0) -> PrimitiveTable:
    """Numbers of the emitters' sources in a list, by hit. per_emitter: those of each emitter."""
    ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in emitters]
    numbers = {source: k for k, source in enumerate(sources)}
    return PrimitiveTable(ids, [[numbers[s] for s in many] for many in per_emitter], otherwise)


def by_wavelength(source: Source) -> Source:
    """The source where blackbodies are recorded by wavelength: the group, for a blackbody."""
    return source if source.temperature is None else Source(source.group)


def spectra(emitter) -> list[Source]:
    """The sources of an emitter; raises InputError for one that is not thermal."""
    if not is_thermal(emitter):
        raise InputError(
            f"an emitter of class {emitter.class_name()} has no spectrum; "
            "only thermal emitters have"
        )
    return emitter.spectra()
