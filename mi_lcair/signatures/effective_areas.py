"""Effective areas of a scene's sources, which give its spectral intensity without another render.

The materials are constant within the band. A source of spectrum S, W m^-2 sr^-1 um^-1, therefore
adds W S to the spectral intensity, with the same effective area W, m^2, at all wavelengths. W is
the in-band intensity that comes from the source, divided by the in-band radiance of S.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.charts import Curve, LineChart, LineCharts, by_wavelength
from mi_lcair.errors import InputError, check_known, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import in_band_radiance, polynomials, spectral_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.properties import TEMPERATURE
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import UNSEEN, Totals, student_factor
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import Section

PARTS = ("target", "scene")
SPECTRUM, UNIT = "Spectral intensity", "W sr-1 um-1"
SPECTRAL = "_W_sr_um"  # end of the names of a spectrum's columns
# Smallest in-band radiance of a source whose effective area is known in single precision
FAINTEST = 1e-30  # W m^-2 sr^-1
# Wavelengths in even steps over the band. The trapezoid rule over them integrates Planck's law in
# MWIR at 250 K with an error of 1e-6.
SPECTRUM_ROWS = 801


@dataclass(frozen=True, repr=False, kw_only=True)
class SourcesInBand(Result):
    """Base class of effective areas: the sources of a scene, and the band that was rendered.

    The amounts are the effective areas of the sources, those of the wavelengths `nodes_um`, and
    last the projected area of the model. All intensities and irradiances are linear in them.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    band : Band
        Band that was rendered.
    sources : list of Source
        Sources, one for each group and spectrum.
    nodes_um : ndarray, shape (nodes,)
        Wavelengths, um, at which the intensity of all blackbodies is known, if the scene has too
        many temperatures for an effective area each. Otherwise it is empty.
    amounts : ndarray, shape (n, sources + nodes + 1)
        Areas, m^2; those of the nodes in W sr^-1 um^-1.
    """

    scene_name: str = ""
    band: Band = entry("band", "name")
    sources: list[Source] = entry()
    nodes_um: np.ndarray = entry()
    amounts: np.ndarray = entry()

    def radiance(self, wavelengths_um: ArrayLike, temperatures: dict | None = None) -> np.ndarray:
        """Spectral radiance of each source, W m^-2 sr^-1 um^-1, shape (sources, n).

        It is not multiplied by the emissivity.
        """
        table = [
            source.spectrum.at(wavelengths_um)
            if T is None
            else spectral_radiance(wavelengths_um, T)
            for source, T in zip(self.sources, self.temperatures(temperatures or {}))
        ]
        return np.reshape(table, (len(self.sources), len(wavelengths_um)))

    def wavelengths_um(self) -> np.ndarray:
        """Wavelengths, um, that resolve all spectra in the band, see `resolved`."""
        return resolved(self.band, self.sources)

    def temperatures(self, changed: Mapping) -> list:
        """Temperature of each source, K, with the changes applied; None for a tabulated source."""
        return temperatures_of(self.sources, changed)

    def in_band_of_sources(self, band: Band, temperatures: Mapping) -> list:
        """In-band radiance of each source, W m^-2 sr^-1, with these temperatures, K, by group.

        It is not multiplied by the emissivity.
        """
        return [
            source.spectrum.in_band_radiance(band) if T is None else in_band_radiance(band, T)
            for source, T in zip(self.sources, self.temperatures(temperatures))
        ]

    def in_band(self, band: Band, temperatures: Mapping) -> np.ndarray:
        """In-band intensity for each of the amounts, W m^-2 sr^-1, (..., amounts)."""
        of_sources = self.in_band_of_sources(band, temperatures)
        rest = polynomials(self.nodes_um, band.wavelengths_um) @ band.weights_um
        return np.stack(np.broadcast_arrays(*of_sources, *rest, 0.0), axis=-1)

    def spectra_of_amounts(self, wavelengths_um: np.ndarray) -> np.ndarray:
        """Spectral intensity for each of the amounts but the last one, (amounts - 1, n)."""
        rest = polynomials(self.nodes_um, wavelengths_um)
        return np.concatenate([self.radiance(wavelengths_um), rest])

    def within(self, band: Band) -> Band:
        """The band itself. Raises InputError if it is not within the rendered band."""
        if not self.band.holds(band):
            raise InputError(
                f"band {band.label}: the effective areas were rendered with the material "
                f"parameters of band {self.band.label} and hold within it only; render band "
                f"{band.label}"
            )
        return band

    def check_resolved(self) -> None:
        """Raise InputError if blackbodies have no effective areas of their own."""
        if self.nodes_um.size:
            raise InputError(
                "the scene has too many temperatures for an effective area of each; only its "
                "spectrum is known"
            )


@dataclass(frozen=True, repr=False, kw_only=True)
class EffectiveAreas(SourcesInBand):
    """Effective areas of the sources, for the target and for the whole scene.

    The first axis of the arrays has two parts: the model's facets (target), and everything in the
    sensor's window (scene). The attributes of `SourcesInBand` come first.

    Attributes
    ----------
    error : ndarray, shape (2, sources)
        Standard errors of the effective areas, m^2, with a bound for sources that paths may have
        missed.
    covariance : ndarray, shape (2, sources + nodes + 1, sources + nodes + 1)
        Covariance of the amounts.
    """

    error: np.ndarray = entry()
    covariance: np.ndarray = entry()

    kind = "effective_areas"
    heading = SPECTRUM
    computed = {
        "projected_area_m2": "projected_area",
        "effective_areas": "as_list",
        "spectrum": "columns",
    }

    @property
    def area(self) -> np.ndarray:
        """Effective areas of the sources, m^2, shape (2, sources)."""
        return self.amounts[:, : len(self.sources)]

    @property
    def projected_area(self) -> float:
        """Projected area of the model's facets that the sensor sees, m^2."""
        return float(self.amounts[0, -1])

    def summary(self) -> str:
        """One line with the number of sources and the projected area of the target."""
        error = float(np.sqrt(self.covariance[0, -1, -1]))
        return (
            f"effective areas of {self.scene_name}, {self.band.label}: {len(self.sources)} "
            f"sources, projected area of the target {self.projected_area:.6g} +- {error:.2g} m^2 "
            "(standard error)"
        )

    def facts(self) -> Iterator[Any]:
        """The areas in one line, and the spectral intensity."""
        yield summary_of(self)
        yield from spectrum_section(self.columns()).parts

    def picture(self) -> LineCharts:
        """Spectral intensity of target and scene, and of their groups."""
        return spectrum_picture(self.columns(), f"{self.scene_name}, {self.band.label}")

    def columns(self) -> dict[str, np.ndarray]:
        """Spectral intensity of target, scene and their groups, with a row for each wavelength.

        The columns are wavelength_um, response (of the band) and NAME_W_sr_um. The trapezoid rule
        over the rows, times the response, gives the in-band intensity to 1e-5.
        """
        wavelengths = self.wavelengths_um()
        return {
            "wavelength_um": wavelengths,
            "response": self.band.response_at(wavelengths),
            **{f"{name}_W_sr_um": values for name, values in self.curves(wavelengths).items()},
        }

    def curves(self, wavelengths_um: ArrayLike) -> dict[str, np.ndarray]:
        """Spectral intensity of target and scene, and of each of their groups.

        Returns {name: values}, W sr^-1 um^-1, with the names "target", "scene", "target.GROUP" and
        "scene.GROUP", and one value for each of `wavelengths_um`.
        """
        spectra = self.spectrum(wavelengths_um)
        groups = [source.group for source in self.sources] + ["blackbodies"] * (
            spectra.shape[1] - len(self.sources)
        )
        curves = {part: spectra[p].sum(axis=0) for p, part in enumerate(PARTS)}
        for p, part in enumerate(PARTS):
            for group in dict.fromkeys(groups):
                of_group = [name == group for name in groups]
                curves[f"{part}.{group}"] = spectra[p][of_group].sum(axis=0)
        return curves

    def as_list(self) -> list[dict]:
        """One dictionary for each source, for JSON.

        The entries are group, spectrum, temperature_K (or None), and the effective areas of target
        and scene with their standard errors, m^2.
        """
        return [
            {
                "group": source.group,
                "spectrum": source.name,
                "temperature_K": source.temperature,
                **{f"{part}_m2": float(self.area[p, k]) for p, part in enumerate(PARTS)},
                **{
                    f"{part}_standard_error_m2": float(self.error[p, k])
                    for p, part in enumerate(PARTS)
                },
            }
            for k, source in enumerate(self.sources)
        ]

    def intensity(
        self, part: str = "target", temperatures: dict | None = None, band: Band | None = None
    ) -> tuple[float, float]:
        """In-band intensity, W/sr, and its standard error, optionally at other temperatures.

        Parameters
        ----------
        part : str
            "target" or "scene".
        temperatures : dict, optional
            New temperatures, K, by group. A group with several temperatures needs keys (group,
            rendered temperature).
        band : Band, str or path-like, optional
            Band within the one that was rendered, by default the same. The effective areas hold for
            the materials of the rendered band only.

        Returns
        -------
        intensity : float
            Intensity, W/sr.
        error : float
            Standard error, W/sr.

        Raises
        ------
        InputError
            If the part, a group or the band is unusable, or if the scene has too many temperatures
            to change them.
        """
        if temperatures:
            self.check_resolved()
        check_known("part", PARTS, part)
        wanted = self.band if band is None else self.within(band_of(band))
        p, per_amount = PARTS.index(part), self.in_band(wanted, temperatures or {})
        error = float(np.sqrt(max(per_amount @ self.covariance[p] @ per_amount, 0)))
        return float(self.amounts[p] @ per_amount), error

    def spectrum(self, wavelengths_um: ArrayLike, temperatures: dict | None = None) -> np.ndarray:
        """Spectral intensity, W sr^-1 um^-1, of each part and source.

        Parameters
        ----------
        wavelengths_um : array_like, shape (n,)
            Wavelengths within the rendered band, um.
        temperatures : dict, optional
            New temperatures, as for `intensity`.

        Returns
        -------
        ndarray, shape (2, sources, n)
            Blackbodies that were recorded by wavelength follow as one more source.
        """
        wavelengths_um = np.asarray(wavelengths_um, dtype=float)
        if wavelengths_um.min() < self.band.lower_um or wavelengths_um.max() > self.band.upper_um:
            raise InputError(
                f"wavelengths {wavelengths_um.min():g}-{wavelengths_um.max():g} um: the effective "
                f"areas hold for the material parameters of band {self.band.label} only"
            )
        if temperatures:
            self.check_resolved()
        by_source = self.area[:, :, None] * self.radiance(wavelengths_um, temperatures)
        if not self.nodes_um.size:
            return by_source
        rest = self.amounts[:, len(self.sources) : -1] @ polynomials(self.nodes_um, wavelengths_um)
        return np.concatenate([by_source, rest[:, None]], axis=1)


def temperatures_of(sources: list[Source], changed: Mapping) -> list:
    """Temperature of each source, K, with the changes by group applied.

    It is None for a tabulated source. Raises InputError for an unknown group, for a temperature
    that is not above 0 and at most 1e5 K, and for a source that radiates too little for its
    effective area to be known.
    """
    blackbodies = {
        (source.group, source.temperature) for source in sources if source.temperature is not None
    }
    for key in changed:
        if key not in blackbodies | {group for group, _ in blackbodies}:
            known = sorted({group for group, _ in blackbodies}) + [
                f"{group} at {T:g} K" for group, T in sorted(blackbodies)
            ]
            raise unknown("blackbody group", str(key), known)
        kelvin, where = np.ravel(changed[key]), f"group {key}: temperature"
        TEMPERATURE.check_all(kelvin, lambda k, where=where: where)
    result = [
        None
        if source.temperature is None
        else changed.get(
            (source.group, source.temperature), changed.get(source.group, source.temperature)
        )
        for source in sources
    ]
    for source, T in zip(sources, result):
        if T is not None and source.in_band < FAINTEST and np.any(source.temperature != T):
            raise InputError(
                f"group {source.group}: has {source.temperature:g} K in the scene, at which it "
                "radiates nothing in the band, so that its effective area is not known; load the "
                "scene with a higher temperature"
            )
    return result


def resolved(band: Band, sources: list[Source]) -> np.ndarray:
    """Wavelengths, um, that resolve all spectra of some sources in a band.

    They are even steps, and the rows of the tabulated spectra and of the response.
    """
    tables = [source.spectrum.wavelengths_um for source in sources if source.spectrum is not None]
    steps = np.linspace(band.lower_um, band.upper_um, SPECTRUM_ROWS)
    return np.union1d(steps, band.rows(*tables))


def recorded_amounts(total: Totals) -> tuple[list[Source], list[str], np.ndarray]:
    """Sources that a render recorded, and the channel of each amount but the last, "hit".

    The third result holds the factors that turn all means into shares of the window's area.
    """
    of_scene = total.emitters.sources
    named = {f"source.{k}": source for k, source in enumerate(of_scene.list) if source.name}
    nodes = [f"wavelength.{k}" for k in range(len(of_scene.wavelengths_um))]
    # A source that is too cold to radiate in the band has no intensity. Its area is set to 0.
    scales = [1 / source.in_band if source.in_band > 0 else 0.0 for source in named.values()]
    return list(named.values()), [*named, *nodes], np.append(scales, np.ones(len(nodes) + 1))


def effective_areas(total: Totals, scene: Scene, window_area: float) -> EffectiveAreas:
    """Effective areas from a render that recorded the emission of each source.

    Parameters
    ----------
    total : Totals
        Sums over one window, with the channels source.N and, for many temperatures, wavelength.N.
    scene : Scene
        The rendered scene, which has the name and the band.
    window_area : float
        Area of the sensor's window, m^2.
    """
    sources, channels, scales = recorded_amounts(total)
    scales = window_area * scales
    prefixes = {"target": "target.", "scene": ""}
    names = [[*(prefixes[part] + name for name in channels), "target.hit"] for part in PARTS]
    amounts = scales * [total.mean(row)[:, 0] for row in names]
    deviations = [scales[:, None] * total.deviations(row)[:, 0] for row in names]
    covariance = np.array([of_part @ of_part.T for of_part in deviations])
    # Sources that no path has hit: their area is at most that of UNSEEN paths, and their radiance
    # at most the error of their group
    weight = 1.0 if total.aim is None else total.aim.largest_weight
    few = UNSEEN / student_factor(np.inf) * weight * window_area / max(total.paths[0], 1)
    count = len(sources)
    groups = [f"{prefixes[part]}group.{source.group}" for part in PARTS for source in sources]
    # None because a scene may have no source, and a list of channels must not be empty
    of_groups = np.reshape(total.missed_error([None, *groups])[1:], (2, count))
    missed = np.minimum(of_groups * scales[:count], few)
    # The systematic error is the same fraction of all sources, and is no error of positions
    emitted = amounts * np.append(np.ones(len(scales) - 1), 0)
    covariance += total.systematic**2 * emitted[:, :, None] * emitted[:, None, :]
    return EffectiveAreas(
        band=scene.band,
        sources=sources,
        amounts=amounts,
        error=np.hypot(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:, :count], missed),
        covariance=covariance,
        nodes_um=total.emitters.sources.wavelengths_um,
        scene_name=scene.name,
    )


def spectrum_picture(columns: Mapping[str, np.ndarray], title: str) -> LineCharts:
    """The picture of the table of a spectrum, whose columns are those of `EffectiveAreas`."""
    return LineCharts(spectrum_charts(columns), f"{title}, by what emitted it", across=True)


def spectrum_section(columns: Mapping[str, np.ndarray]) -> Section:
    """The section of the table of a spectrum."""
    words = "Without atmosphere, by the group that emits. Click on a name to hide a curve."
    return Section(SPECTRUM, [words, spectrum_picture(columns, SPECTRUM)])


def spectrum_charts(columns: Mapping[str, np.ndarray]) -> list[LineChart]:
    """Spectral intensity of target and scene, each with the groups that emit in the band."""
    x = np.asarray(columns["wavelength_um"], float)
    spectra = {
        name.removesuffix(SPECTRAL): np.asarray(values, float)
        for name, values in columns.items()
        if name.endswith(SPECTRAL)
    }
    groups = list(dict.fromkeys(name.partition(".")[2] for name in spectra if "." in name))
    result = []
    for part in (part for part in PARTS if part in spectra):
        curves = [Curve("total", spectra[part], UNIT)]
        for number, group in enumerate(groups):
            values = spectra.get(f"{part}.{group}")
            if values is not None and values.any():
                curves.append(Curve(group, values, UNIT, number))
        in_band = np.trapezoid(spectra[part] * columns.get("response", 1.0), x)
        title = f"{part}: {in_band:.5g} W/sr in band"
        result.append(by_wavelength(title, x, "spectral intensity", UNIT, curves))
    return result
