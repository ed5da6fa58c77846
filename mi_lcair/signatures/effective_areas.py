"""Intensity by the spectra that a scene's sources radiate, and the spectral intensity that follows
without rendering again.

A source of spectrum S [W m^-2 sr^-1 um^-1] contributes W S to the spectral intensity, with W [m^2]
the same at all wavelengths, where the materials are constant in the band: W = intensity of the
source / in-band radiance of S.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.plugins.emission.sources import Source
from mi_lcair.rendering.render import Render
from mi_lcair.rendering.statistics import COVARYING

PARTS = ("target", "scene")
SPECTRUM_ROWS = (
    801  # even steps: the trapezoid rule over Planck's law in MWIR at 250 K is right to 1e-6
)


@dataclass(frozen=True)
class EffectiveAreas:
    """Effective areas W [m^2] of the sources, for the model's facets (target) and all in the window
    (scene).

    area, error: (2, sources) in the order of PARTS; projected_area: of the model's facets, as seen;
    covariance: of the areas and, last, of that, (2, sources + 1, sources + 1); None for one sample.
    by_wavelength: where blackbodies are too many to be told apart, the spectral intensity of them
    all [W sr^-1 um^-1] at `nodes_um`, (2, nodes); empty otherwise.
    """

    band: Band
    sources: list[Source]
    area: np.ndarray
    error: np.ndarray | None
    projected_area: float
    covariance: np.ndarray | None
    nodes_um: np.ndarray
    by_wavelength: np.ndarray

    def as_list(self) -> list[dict]:
        """One entry for each source: group, spectrum, temperature [K] or None, and W of target and
        scene [m^2].
        """
        return [
            {
                "group": source.group,
                "spectrum": source.name,
                "temperature": source.temperature,
                **{f"{part}_m2": float(self.area[p, k]) for p, part in enumerate(PARTS)},
                **{
                    f"{part}_error_m2": None if self.error is None else float(self.error[p, k])
                    for p, part in enumerate(PARTS)
                },
            }
            for k, source in enumerate(self.sources)
        ]

    def intensity(
        self, part: str = "target", temperatures: dict | None = None, band=None
    ) -> tuple[float, float | None]:
        """In-band intensity [W/sr] and its standard error, with other temperatures if wanted.

        temperatures: kelvin by group, or by (group, kelvin before) where a group has several. band:
        within the one that was rendered, whose material parameters the areas hold for; InputError
        for any other.
        """
        self.check_told_apart()
        if part not in PARTS:
            raise unknown("part", part, PARTS)
        wanted = self.band if band is None else self.within(band_of(band))
        p = PARTS.index(part)
        radiance = np.array(
            [
                in_band_radiance(wanted, T)
                if T is not None
                else source.spectrum.in_band_radiance(wanted)
                for source, T in zip(self.sources, self.temperatures(temperatures or {}))
            ]
        )
        error = (
            None
            if self.covariance is None
            else float(np.sqrt(max(radiance @ self.covariance[p, :-1, :-1] @ radiance, 0)))
        )
        return float(self.area[p] @ radiance), error

    def spectrum(self, wavelengths_um, temperatures: dict | None = None) -> np.ndarray:
        """Spectral intensity [W sr^-1 um^-1] by part, source and wavelength, (2, sources, n).

        Where blackbodies were recorded by wavelength they follow as one last source.
        """
        wavelengths_um = np.asarray(wavelengths_um, dtype=float)
        if wavelengths_um.min() < self.band.lower_um or wavelengths_um.max() > self.band.upper_um:
            raise InputError(
                f"wavelengths {wavelengths_um.min():g}-{wavelengths_um.max():g} um: the effective areas hold for "
                f"the material parameters of band {self.band.label} only"
            )
        if temperatures:
            self.check_told_apart()
        found = self.area[:, :, None] * self.radiance(wavelengths_um, temperatures)
        if not self.nodes_um.size:
            return found
        rest = BarycentricInterpolator(self.nodes_um, self.by_wavelength.T)(wavelengths_um).T
        return np.concatenate([found, rest[:, None]], axis=1)

    def radiance(self, wavelengths_um, temperatures: dict | None = None) -> np.ndarray:
        """Spectral radiance of each source before its emissivity [W m^-2 sr^-1 um^-1], (sources,
        n).
        """
        table = [
            source.spectrum.at(wavelengths_um)
            if T is None
            else spectral_radiance(wavelengths_um, T)
            for source, T in zip(self.sources, self.temperatures(temperatures or {}))
        ]
        return np.reshape(table, (len(self.sources), len(wavelengths_um)))

    def wavelengths_um(self) -> np.ndarray:
        """Even steps over the band, and every row of the tabulated spectra and of the response
        inside it.
        """
        tables = [
            source.spectrum.wavelengths_um for source in self.sources if source.spectrum is not None
        ]
        rows = np.concatenate(
            [*tables, [] if self.band.response is None else self.band.response[0]]
        )
        inside = rows[(rows > self.band.lower_um) & (rows < self.band.upper_um)]
        return np.unique(
            np.concatenate(
                [np.linspace(self.band.lower_um, self.band.upper_um, SPECTRUM_ROWS), inside]
            )
        )

    def temperatures(self, changed: dict) -> list[float | None]:
        """Kelvin of each source, None for a tabulated one, with the changes applied."""
        blackbodies = {
            (source.group, source.temperature)
            for source in self.sources
            if source.temperature is not None
        }
        for key in changed:
            if key not in blackbodies | {group for group, _ in blackbodies}:
                known = sorted({group for group, _ in blackbodies}) + [
                    f"{group} at {T:g} K" for group, T in sorted(blackbodies)
                ]
                raise unknown("blackbody group", str(key), known)
            if not 0 < changed[key] < np.inf:
                raise InputError(
                    f"group {key}: temperature {changed[key]} K; it must be positive and finite, in kelvin"
                )
        return [
            None
            if source.temperature is None
            else changed.get(
                (source.group, source.temperature), changed.get(source.group, source.temperature)
            )
            for source in self.sources
        ]

    def within(self, band: Band) -> Band:
        if (
            band.is_total
            or band.lower_um < self.band.lower_um
            or band.upper_um > self.band.upper_um
        ):
            raise InputError(
                f"band {band.label}: the effective areas were rendered with the material parameters of band "
                f"{self.band.label} and hold within it only; render band {band.label}"
            )
        return band

    def check_told_apart(self) -> None:
        if self.nodes_um.size:
            raise InputError(
                "the scene has too many temperatures to be told apart: its spectrum is known, but no effective "
                "area for each temperature"
            )


def effective_areas(image: Render, window_area: float) -> EffectiveAreas:
    """From a render that told emission apart by spectrum."""
    told = [k for k, source in enumerate(image.sources.list) if source.name is not None]
    sources = [image.sources.list[k] for k in told]
    # of a source too cold to radiate in the band nothing is known but that it adds nothing
    scale = np.array(
        [window_area / source.in_band if source.in_band > 0 else 0.0 for source in sources]
    )
    prefixes = {"target": "target.", "scene": ""}
    mean = np.array(
        [[image.parts[f"{prefixes[part]}source.{k}"][0] for k in told] for part in PARTS]
    ).reshape(2, -1)
    covariance, error = None, None
    if image.covariance is not None:
        names = [name for name in image.parts if name.startswith(COVARYING)]
        rows = [
            [names.index(f"{prefixes[part]}source.{k}") for k in told] + [names.index("target.hit")]
            for part in PARTS
        ]
        scales = np.append(scale, window_area)
        covariance = np.array(
            [image.covariance[np.ix_(row, row)] * np.outer(scales, scales) for row in rows]
        )
        error = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:, :-1]
    nodes = image.sources.wavelengths_um
    by_wavelength = [
        [image.parts[f"{prefixes[part]}wavelength.{k}"][0] for k in range(len(nodes))]
        for part in PARTS
    ]
    return EffectiveAreas(
        band=image.band,
        sources=sources,
        area=mean * scale,
        error=error,
        projected_area=image.parts["target.hit"][0] * window_area,
        covariance=covariance,
        nodes_um=nodes,
        by_wavelength=np.array(by_wavelength) * window_area,
    )
