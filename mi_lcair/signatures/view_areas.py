"""Effective areas of a scene's sources toward many observers, rendered together.

All that does not change geometry or reflectances follows from them without another render:
temperatures, ranges, air, background and the noise of a sensor.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair import formats
from mi_lcair.errors import InputError, complete
from mi_lcair.estimate import Estimate
from mi_lcair.physics.bands import Band, Spectrum
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.source import Source, kelvin
from mi_lcair.rendering.measurands import Criterion, Measurands, check_reachable
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals, student_factor
from mi_lcair.rendering.views import RESOLUTION, Target, View, cameras
from mi_lcair.rendering.window import RANDOMISATIONS, Windows
from mi_lcair.signatures.effective_areas import SourcesInBand, recorded_amounts

if TYPE_CHECKING:
    import xarray


# Paths to a scene's model from many observers, traced together
# -------------------------------------------------------------

DEFAULT_TOLERANCE = 0.01  # half of the 95 % interval of a view's intensity, as a fraction of it
# Views fainter than this fraction of the brightest view get an absolute tolerance: that of a view
# with this fraction of the brightest intensity.
FAINT = 1e-3


@dataclass(frozen=True)
class IntensitiesOfViews(Criterion):
    """Half of the 95 % interval of each view's intensity is narrow enough.

    The allowed half width is `tolerance` times the intensity of the view, or times FAINT of the
    brightest view if that is more. For a view of intensity 0 it is `tolerance` times FAINT of the
    intensity of a window that the brightest source fills.

    areas: areas of the views' windows, (V,) [m^2].
    """

    tolerance: float
    areas: np.ndarray

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name, of_interval=True)

    def excess(self, total):
        intensity = total.mean("target") * self.areas
        half_width = total.half_width("target") * self.areas
        least = np.maximum(intensity, FAINT * intensity.max())
        brightest = total.emitters.brightest * self.areas
        allowed = self.tolerance * np.where(intensity > 0, least, FAINT * brightest)
        unknown = np.where(half_width > 0, np.inf, 0)
        return np.divide(half_width, allowed, out=unknown, where=allowed > 0)


def totals_of_views(
    scene: Scene, views: list[View], resolution: int, sampling: Sampling, measurands: Measurands
) -> tuple[Totals, np.ndarray]:
    """Sums over paths to a scene's model toward V views, and areas of their windows, (V,) [m^2].

    With closure = tail, all views have the same ratio of the geometric continuation.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        Samples per pixel count the paths of a view divided by resolution x resolution.
    sampling : Sampling
        Its tolerance is that of `IntensitiesOfViews`.
    measurands : Measurands

    Raises
    ------
    InputError
        For settings out of bounds, and for a tolerance that cannot be reached.
    """
    windows, areas = windows_of(scene, views, resolution)
    criterion = None
    if sampling.tolerance is not None:
        criterion = IntensitiesOfViews(sampling.tolerance, areas)
    return measure(scene, windows, sampling, measurands, criterion), areas


def windows_of(scene: Scene, views: list[View], resolution: int) -> tuple[Windows, np.ndarray]:
    """Windows of a scene's model toward some views, and their areas, (V,) [m^2]."""
    RESOLUTION.check(resolution, "resolution")
    target = Target.of(scene)
    sensor = cameras(scene, target, views)
    areas = np.array([target.window_area(view) for view in views])
    windows = Windows(sensor, columns=len(views), pixels=resolution**2, may_follow_facets=True)
    return windows, areas


FEW_AMOUNTS = 32  # number of amounts whose pairs take less time than the randomisations
NOT_HELD = "is not a file of effective areas that mi_lcair wrote"


@dataclass(frozen=True, repr=False, kw_only=True)
class ViewAreas(SourcesInBand):
    """Effective areas of the sources of a scene's model toward V views.

    The first axis of the arrays is that of the views. The attributes of `SourcesInBand` come first.

    Attributes
    ----------
    views : tuple of View
        Directions toward the observers.
    deviations : ndarray, shape (V, randomisations, sources + nodes + 1)
        Deviations of independent renders from the amounts. The sum of their products over the
        randomisations is the covariance of the amounts.
    relative : ndarray, shape (V,)
        Standard error, as a fraction of the intensity, that the deviations do not show.
    missed : ndarray, shape (V,)
        Intensity that a source which no path has hit may add, W/sr.
    paths, reached : ndarray, shape (V,)
        Number of paths, and whether the tolerance was reached.
    is_drawn : bool
        Whether directions toward emitters were drawn.
    """

    views: tuple[View, ...]
    deviations: np.ndarray
    relative: np.ndarray
    missed: np.ndarray
    paths: np.ndarray
    reached: np.ndarray
    is_drawn: bool = False

    kind = "view_areas"
    OF_VIEWS = ("amounts", "deviations", "relative", "missed", "paths", "reached")

    def summary(self) -> str:
        """One line with the number of views and sources, and the largest error."""
        estimates = self.intensity()
        worst = np.max(estimates.half_width / np.maximum(estimates.value, np.finfo(float).tiny))
        return (
            f"effective areas of {self.scene_name}, {self.band.label}: {len(self.views)} views, "
            f"{len(self.sources)} sources, intensities within {worst:.2g} (95 %)"
        )

    def entries(self) -> dict:
        """Entries for JSON."""
        return {
            "scene_name": self.scene_name,
            "band": self.band.name,
            "sources": [[source.group, source.name] for source in self.sources],
            "columns": self.columns(),
        }

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each view: intensity, projected area, and the effective area of each source."""
        intensity = self.intensity()
        return {
            "azimuth_deg": np.array([view.azimuth_deg for view in self.views]),
            "elevation_deg": np.array([view.elevation_deg for view in self.views]),
            "intensity_W_sr": intensity.value,
            "standard_error_W_sr": intensity.standard_error,
            "half_width_W_sr": intensity.half_width,
            "projected_area_m2": self.amounts[:, -1],
            "paths": self.paths,
            "reached": self.reached,
            **{
                f"{source.group}.{source.name}_m2": self.amounts[:, k]
                for k, source in enumerate(self.sources)
            },
        }

    def intensity(
        self,
        temperatures: Mapping[str, ArrayLike] | None = None,
        band: Band | str | PathLike[str] | None = None,
    ) -> Estimate:
        """Intensities toward all views, W/sr, optionally at other temperatures.

        Parameters
        ----------
        temperatures : mapping of str to array_like, optional
            New temperatures, K, by group, as for `EffectiveAreas.intensity`: one, or n for n sets
            of temperatures.
        band : Band, str or path-like, optional
            Band within the one that was rendered, by default the same.

        Returns
        -------
        Estimate
            Arrays of shape (V,), or (n, V) for n sets of temperatures.

        Raises
        ------
        InputError
            If a group or the band is unusable, or if the scene has too many temperatures.
        """
        wanted = self.band if band is None else self.within(band_of(band))
        if temperatures:
            self.check_resolved()
        changed = {group: np.asarray(T, dtype=float) for group, T in (temperatures or {}).items()}
        per_amount = self.in_band(wanted, changed)
        brightest = 1.0 if self.nodes_um.size else self.brighter(per_amount)
        return self.estimates(per_amount, per_amount, brightest)

    def brighter(self, radiance: np.ndarray) -> np.ndarray:
        """Ratio by which new in-band radiances of the sources raise the bound `missed`."""
        before = np.array([source.in_band for source in self.sources])
        radiance = radiance[..., : len(before)]
        if self.is_drawn:  # the bound is that of a product with the probability of a draw
            ratio = np.divide(radiance, before, out=np.ones_like(radiance), where=before > 0)
            return ratio.max(axis=-1)
        return radiance.max(axis=-1) / before.max()

    def estimates(
        self, per_amount: np.ndarray, of_target: np.ndarray, per_missed: ArrayLike
    ) -> Estimate:
        """Numbers that are linear in the amounts, for each view.

        Parameters
        ----------
        per_amount : ndarray, shape (..., amounts)
            Derivatives of the number with respect to the amounts.
        of_target : ndarray, shape (..., amounts)
            Those of the part that comes from the target's radiation.
        per_missed : array_like, shape (...)
            Derivative with respect to the intensity that paths may have missed.

        Returns
        -------
        Estimate
            Arrays of shape (..., V).
        """
        variance = self.variance(per_amount)
        value, systematic = per_amount @ self.amounts.T, of_target @ self.amounts.T
        systematic = (systematic * self.relative) ** 2
        missed = np.asarray(per_missed)[..., None] * self.missed
        freedom = self.deviations.shape[1] - 1
        variance = np.maximum(variance, 0)  # rounding
        half_width = np.sqrt(
            student_factor(freedom) ** 2 * variance
            + student_factor(np.inf) ** 2 * systematic
            + missed**2
        )
        return Estimate(value, np.sqrt(variance + systematic), half_width=half_width)

    def variance(self, per_amount: np.ndarray) -> np.ndarray:
        """Variance of numbers that are linear in the amounts, from the deviations, (..., V)."""
        if per_amount.shape[-1] > FEW_AMOUNTS:
            return sum((per_amount @ part.T) ** 2 for part in self.deviations.swapaxes(0, 1))
        # A quadratic form of few coefficients is one product of matrices
        first, second = np.triu_indices(per_amount.shape[-1])
        return (per_amount[..., first] * per_amount[..., second]) @ self.covariances

    @cached_property
    def covariances(self) -> np.ndarray:
        """Coefficients of the variance: those of pairs of the amounts in each view, (pairs, V)."""
        first, second = np.triu_indices(self.deviations.shape[-1])
        of_pairs = np.einsum("vra,vra->va", *(self.deviations[..., k] for k in (first, second)))
        return (of_pairs * np.where(first == second, 1, 2)).T

    def of_views(self, numbers: ArrayLike) -> "ViewAreas":
        """Effective areas of the views with these numbers, in their order."""
        numbers = np.asarray(numbers, dtype=int)
        arrays = {name: getattr(self, name)[numbers] for name in self.OF_VIEWS}
        return replace(self, views=tuple(self.views[k] for k in numbers), **arrays)

    @staticmethod
    def joined(parts: list["ViewAreas"]) -> "ViewAreas":
        """The effective areas of several sets of views of the same sources as one."""
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ViewAreas.OF_VIEWS
        }
        views = tuple(view for part in parts for view in part.views)
        return replace(parts[0], views=views, **arrays)

    def at_temperatures(self, temperatures: Mapping[str, float]) -> "ViewAreas":
        """Effective areas of the same scene at other temperatures, K, by group.

        They are the same areas of other sources. What may have been missed changes with them.
        """
        if not temperatures:
            return self
        self.check_resolved()
        sources = [
            source
            if source.temperature in (None, T)
            else replace(source.at(T, self.band), name=f"{kelvin(T)} K")
            for source, T in zip(self.sources, self.temperatures(temperatures))
        ]
        ratio = self.brighter(np.array([source.in_band for source in sources]))
        return replace(self, sources=sources, missed=self.missed * ratio)

    def to_xarray(self) -> "xarray.Dataset":
        """All arrays as an xarray Dataset, from which `read` makes the same effective areas.

        Raises InputError if xarray is not installed.
        """
        wavelengths = self.wavelengths_um()
        views = {
            name: (("view",), np.array([getattr(view, name) for view in self.views]))
            for name in ("azimuth_deg", "elevation_deg")
        }
        made = self.dataset(
            {
                "amount_m2": (("view", "amount"), self.amounts),
                "deviation_m2": (("view", "randomisation", "amount"), self.deviations),
                "relative_error": (("view",), self.relative),
                "missed_W_sr": (("view",), self.missed),
                "paths": (("view",), self.paths.astype(float)),
                "reached": (("view",), self.reached.astype(np.int8)),
                "radiance_W_m2_sr_um": (("source", "wavelength_um"), self.radiance(wavelengths)),
                "temperature_K": (
                    ("source",),
                    np.array([source.temperature or np.nan for source in self.sources]),
                ),
                "node_um": (("node",), self.nodes_um),
            },
            {
                **views,
                "wavelength_um": (("wavelength_um",), wavelengths),
                "group": (("source",), np.array([source.group for source in self.sources])),
                "spectrum": (("source",), np.array([source.name for source in self.sources])),
            },
        )
        return made.assign_attrs(
            scene=self.scene_name, band=self.band.name, is_drawn=int(self.is_drawn)
        )

    @staticmethod
    def read(path: str | PathLike[str]) -> "ViewAreas":
        """The effective areas in a .nc file that `save` wrote.

        Tabulated spectra are those at the sensor of the scene, without the air's amounts of
        absorbers. Raises InputError for a file of another kind, and for one of a sweep's folder
        that is damaged.
        """
        dataset = formats.read(path)
        if dataset.attrs.get("checksum", stated := formats.checksum(dataset)) != stated:
            raise InputError(f"{path}: does not match its checksum; trace it again")
        with complete(f"{path}: {NOT_HELD}, or"):
            return of_dataset(dataset)


def of_dataset(dataset: "xarray.Dataset") -> ViewAreas:
    """The effective areas of a Dataset that `ViewAreas.to_xarray` made."""
    values = {name: dataset[name].values for name in dataset.variables}
    band = band_of(dataset.attrs["band"])
    sources = []
    for group, name, T, radiance in zip(
        *(values[key] for key in ("group", "spectrum", "temperature_K", "radiance_W_m2_sr_um"))
    ):
        spectrum = Spectrum(str(name), values["wavelength_um"], radiance) if np.isnan(T) else None
        in_band = spectrum.in_band_radiance(band) if spectrum else in_band_radiance(band, T)
        temperature = None if spectrum else float(T)
        sources.append(Source(str(group), str(name), float(in_band), temperature, spectrum))
    return ViewAreas(
        scene_name=str(dataset.attrs["scene"]),
        band=band,
        sources=sources,
        nodes_um=values["node_um"],
        views=tuple(
            View(float(azimuth), float(elevation))
            for azimuth, elevation in zip(values["azimuth_deg"], values["elevation_deg"])
        ),
        amounts=values["amount_m2"],
        deviations=values["deviation_m2"],
        relative=values["relative_error"],
        missed=values["missed_W_sr"],
        paths=values["paths"].astype(int),
        reached=values["reached"].astype(bool),
        is_drawn=bool(dataset.attrs["is_drawn"]),
    )


def measure_view_areas(
    scene: Scene, views: list[View], resolution: int, sampling: Sampling
) -> ViewAreas:
    """Render the effective areas toward some views together.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        Samples per pixel count the paths of a view divided by resolution x resolution.
    sampling : Sampling
        Its tolerance is half of the 95 % interval of each view's intensity, as a fraction of it.
        See `IntensitiesOfViews` for faint views.

    Raises
    ------
    InputError
        For settings out of bounds, for a tolerance that cannot be reached, and for band "total".
    """
    scene.band.check_limits(f"{scene.name}: effective areas")
    measurands = Measurands.of("model", by_spectrum=True, parts=())
    total, areas = totals_of_views(scene, views, resolution, sampling, measurands)
    return view_areas(total, scene, views, areas)


def view_areas(total: Totals, scene: Scene, views: list[View], areas: np.ndarray) -> ViewAreas:
    """Effective areas from sums over paths; areas: those of the windows, (V,) [m^2]."""
    sources, channels, scales = recorded_amounts(total)
    names = [*channels, "hit"]
    of_windows = scales * areas[:, None]
    amounts = total.mean(names).T * of_windows
    deviations = np.moveaxis(total.deviations(names), 0, -1)
    mean = total.mean("target")
    # What the deviations do not show: edges, which Student's interval may cover already
    covered = total.scatter_error("target") * student_factor(RANDOMISATIONS - 1)
    of_edges = total.edge_error("target") * student_factor(np.inf)
    edges = np.sqrt(np.maximum(of_edges**2 - covered**2, 0)) / student_factor(np.inf)
    relative = np.divide(edges, mean, out=np.zeros_like(mean), where=mean > 0)
    return ViewAreas(
        scene_name=scene.name,
        band=scene.band,
        sources=sources,
        nodes_um=total.emitters.sources.wavelengths_um,
        views=tuple(views),
        amounts=amounts,
        deviations=deviations * of_windows[:, None],
        relative=np.hypot(relative, total.systematic),
        missed=total.missed("target") * areas,
        paths=total.traced.astype(int),
        reached=total.reached_by_window,
        is_drawn=bool(total.emitters.draws),
    )
