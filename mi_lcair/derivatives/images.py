"""Images of the derivatives of the radiance with respect to many parameters, from one render."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Unpack

import numpy as np
import scipy
from scipy import sparse

from mi_lcair.charts import ChannelImages, Scale, named_channels
from mi_lcair.declared import Bounds
from mi_lcair.derivatives import window
from mi_lcair.derivatives.common_numbers import METHOD, renders_beside
from mi_lcair.derivatives.frames import ALONG_FRAME, along_frame
from mi_lcair.derivatives.motions.differences import ON_FILM
from mi_lcair.errors import InputError, unknown
from mi_lcair.formats import pixel_axes
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.emitters.thermal_emitter import thermal_shapes
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.radiance import (
    Contributions,
    column_table,
    contributions,
    slots,
    unit_radiance,
)
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.measurands import Measurands, check_memory, check_paths
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.values import parameters_named, units
from mi_lcair.rendering.pixels import around, missed_nearby
from mi_lcair.rendering.sampling import MOST_SPP, Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals, check_valid
from mi_lcair.rendering.window import Windows
from mi_lcair.results import Result, entry

if TYPE_CHECKING:
    import xarray


# Images of the radiance and of its derivatives with respect to parameters of a scene
# -----------------------------------------------------------------------------------

MOST_PANELS = 9  # the radiance and derivatives that are drawn without a choice


@dataclass(frozen=True, repr=False)
class DerivativeImages(Result):
    """Independent images of the radiance and of its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.rendering.parameters.values`.
    radiance : ndarray, shape (R, height, width), float32
        Radiance, W m^-2 sr^-1, in each of R independent randomisations.
    derivatives : ndarray, shape (R, K, height, width), float32
        Its derivatives, per unit of the parameter, from the same randomisations.
    missed : ndarray, shape (1 + K, height, width)
        Standard errors of the radiance and the derivatives from sources that no path has met.
    method : tuple of str
        How each derivative was found, as for `Sensitivities`, or "edges and attached paths".
    scene_name, band : str
        Names of the scene and of its band.
    units : tuple of str
        Units of the parameters; "1" for a dimensionless one.
    """

    names: tuple[str, ...] = entry()
    radiance: np.ndarray = entry()
    derivatives: np.ndarray = entry()
    missed: np.ndarray = entry()
    method: tuple[str, ...] = entry()
    scene_name: str
    band: str
    units: tuple[str, ...] = entry()

    kind = "derivative_images"
    computed = {"images": "as_rows"}
    saved_by = {".exr": "mi_lcair.rendering.images.files:write_render"}

    @property
    def mean(self) -> np.ndarray:
        """Radiance, (height, width)."""
        return mean(self.radiance)

    @property
    def derivative(self) -> np.ndarray:
        """Derivatives of the radiance, (K, height, width)."""
        return mean(self.derivatives)

    @property
    def error(self) -> np.ndarray:
        """Standard error of `mean`, (height, width); infinite for one randomisation."""
        return np.hypot(standard_errors(self.radiance), self.missed[0])

    @property
    def derivative_error(self) -> np.ndarray:
        """Standard errors of `derivative`, (K, height, width); infinite for one randomisation."""
        return np.hypot(standard_errors(self.derivatives), self.missed[1:])

    @property
    def channels(self) -> dict[str, np.ndarray]:
        """Channels of an EXR, float32 (height, width), by name.

        Y is the radiance; d.NAME.Y are its derivatives per unit of the parameter. stderr.Y and
        stderr.d.NAME.Y are their standard errors, if there are several randomisations.
        """
        images = {"Y": (self.mean, self.error)}
        images |= {
            f"d.{name}.Y": (derivative, error)
            for name, derivative, error in zip(self.names, self.derivative, self.derivative_error)
        }
        channels = {name: value for name, (value, _) in images.items()}
        if len(self.radiance) > 1:
            channels |= {f"stderr.{name}": error for name, (_, error) in images.items()}
        return {name: values.astype(np.float32) for name, values in channels.items()}

    @property
    def header(self) -> dict[str, str]:
        """Header of the EXR."""
        return {
            "scene": self.scene_name,
            "band": self.band,
            "units": "W m^-2 sr^-1; d.NAME.Y per unit of the parameter",
            "parameters": json.dumps(dict(zip(self.names, self.units))),
        }

    def summary(self) -> str:
        """One line with the size of the images, the mean radiance and the number of parameters."""
        randomisations, height, width = self.radiance.shape
        means = self.radiance.mean(axis=(1, 2), dtype=float)
        error = f" +- {scipy.stats.sem(means):.2g}" if randomisations > 1 else ""
        return (
            f"derivatives of {self.scene_name}, {self.band}: {width} x {height} pixels, mean "
            f"radiance {means.mean():.6g}{error} W m^-2 sr^-1 (standard error), "
            f"{len(self.names)} parameters"
        )

    def entries(self) -> dict:
        """Entries for JSON: the table of `columns`, without the pixels."""
        randomisations, height, width = self.radiance.shape
        of_size = {"width": width, "height": height, "randomisations": randomisations}
        return super().entries() | of_size

    def picture(
        self, channels: Sequence[str] | None = None, **scale: Unpack[Scale]
    ) -> ChannelImages:
        """Channels of the images, each with its colour bar.

        channels: names of channels; by default the radiance and the first derivatives. scale:
        options of the colour scales.
        """
        known = self.channels
        if channels is None:
            channels = [name for name in known if not name.startswith("stderr.")][:MOST_PANELS]
        drawn = named_channels(known, channels, self.scene_name)
        return ChannelImages(drawn, f"{self.scene_name}, {self.band}", scale=scale)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for the radiance and for each derivative: mean, least and greatest pixel."""
        images = np.array([self.mean, *self.derivative])
        unit = "W m^-2 sr^-1"
        return {
            "image": np.array(["radiance", *self.names]),
            "mean": images.mean(axis=(1, 2)),
            "least": images.min(axis=(1, 2)),
            "greatest": images.max(axis=(1, 2)),
            "unit": np.array([unit, *(window.per_unit(unit, of) for of in self.units)]),
            "method": np.array(["", *self.method]),
        }

    def to_xarray(self) -> "xarray.Dataset":
        """The images as an xarray Dataset over (row, column), one variable for each.

        The derivatives and their errors are over (parameter, row, column). Raises InputError if
        xarray is not installed.
        """
        over = "row", "column"
        return self.dataset(
            {
                "radiance_W_m2_sr": (over, self.mean),
                "standard_error_W_m2_sr": (over, self.error),
                "derivative": (("parameter", *over), self.derivative),
                "derivative_standard_error": (("parameter", *over), self.derivative_error),
            },
            {
                "parameter": ("parameter", list(self.names)),
                "parameter_unit": ("parameter", list(self.units)),
                **pixel_axes(self.mean.shape),
            },
        )


def mean(images: np.ndarray) -> np.ndarray:
    return images.mean(axis=0, dtype=float)


def standard_errors(images: np.ndarray) -> np.ndarray:
    """Standard errors of the pixels of the mean over the first axis.

    They come from the variances in the pixels' neighbourhood, as those of `pixel_errors`.
    """
    if len(images) < 2:
        return np.full(images.shape[1:], np.inf)
    variance = images.var(axis=0, ddof=1, dtype=float) / len(images)
    return np.sqrt(around(variance))


def differentiate_image(
    scene: Scene, names: Sequence[str], sampling: Sampling, randomisations: int = 4
) -> DerivativeImages:
    """Images of a loaded scene's radiance and of its derivatives, all from the same paths.

    names: names of parameters, some of which are differentiated `by_difference` of images with the
    same random numbers. randomisations: number of independent images.
    """
    camera = scene.sensor(sampling.sensor)
    sampling = sampling.settled(camera)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    windows.check(sampling)
    kinds = {entry.name: entry.kind for entry in parameters_named(scene, names)}
    differenced = window.by_difference(scene, names)
    along_paths = [name for name in names if name not in differenced]
    explored = window.explored_by(window.columns_of(scene, along_paths).values())
    measurands = replace(Measurands.of(None), explored=explored)
    first, images, method = None, {}, {}
    with scene.prepared(explored=explored) as tracer:
        check_memory(windows.count * randomisations * (1 + len(names)))
        batches = window.recordings(
            scene, tracer, camera, along_paths, measurands, seed=sampling.seed
        )
        if not batches:
            first = measure(scene, windows, sampling, Measurands.of(None))
            radiance = images_of(first, windows).astype(np.float32)
        for number, batch in enumerate(batches):
            total = measure(
                scene,
                windows,
                sampling.part(number, len(batches)),
                measurands.with_columns(batch.tables),
            )
            if first is None:
                first = total
                radiance = images_of(total, windows, ["weighted"]).astype(np.float32)
            method |= batch.method
            for name, channels in batch.channels.items():
                images[name] = images_of(total, windows, channels).astype(np.float32)
    moved = [name for name in differenced if kinds[name] == "motion"]
    along = along_frame(
        scene, moved, windows, sampling, partial(difference_of_images, scene, windows)
    )
    for name in differenced:
        if name in along:
            images[name] = along[name][0].reshape(radiance.shape).astype(np.float32)
            method[name] = ALONG_FRAME
            continue
        images[name] = difference_of_images(scene, windows, name, sampling).astype(np.float32)
        method[name] = ON_FILM if kinds[name] == "motion" else METHOD
    # A motion moves what paths have met
    still = [name for name in names if kinds[name] != "motion"]
    missed = dict(zip(still, window.missed_errors(scene, first, still)))
    missed = [first.missed_error(), *(missed.get(name, 0 * first.paths) for name in names)]
    missed = np.array(
        [missed_nearby(errors, windows.size).reshape(windows.size) for errors in missed]
    )
    for name, (_, of_ends) in along.items():
        missed[1 + names.index(name)] = of_ends.reshape(windows.size)
    derivatives = np.array([images[name] for name in names]).reshape(-1, *radiance.shape)
    return DerivativeImages(
        names=tuple(names),
        radiance=radiance,
        derivatives=derivatives.swapaxes(0, 1),
        missed=missed,
        method=tuple(method[name] for name in names),
        scene_name=scene.name,
        band=scene.band.label,
        units=units(scene, names),
    )


def difference_of_images(scene: Scene, windows: Windows, name: str, sampling: Sampling):
    """Derivatives with respect to a parameter from two renders, (R, height, width)."""
    *ends, step = renders_beside(scene, name, windows, sampling, Measurands.of(None))
    high, low = (images_of(end, windows) for end in ends)
    return (high - low) / step


def randomised_images(scene: Scene, sampling: Sampling, randomisations: int) -> np.ndarray:
    """Independent images of the radiance, (randomisations, height, width) [W m^-2 sr^-1]."""
    camera = scene.sensor(sampling.sensor)
    windows = Windows.of_image(camera, randomisations, by_randomisation=True)
    return images_of(measure(scene, windows, sampling, Measurands.of(None)), windows)


def images_of(total: Totals, windows: Windows, channels=None) -> np.ndarray:
    """Mean over the paths of each pixel, (randomisations, height, width), of some channels' sum.

    channels: their names; None for the radiance.
    """
    sums = total.radiance if channels is None else sum(total.sums[name] for name in channels)
    means = sums / np.maximum(total.valid, 1)
    return means.T.reshape(-1, windows.rows, windows.columns)


# Radiance of an image as a sparse matrix times the blackbody radiances of the emitting facets
# --------------------------------------------------------------------------------------------

# Independent randomisations of a pixel's points. An estimate from the matrices weights one half of
# them by the variance in the other half, which needs at least four in each.
RANDOMISATIONS = 8
# Entries for contributions in one pass. They need 16 bytes each while they are sorted.
PASS_SLOTS = 2**23


@dataclass(frozen=True)
class FacetMatrix:
    """Radiance of the pixels of an image by emitting facet.

    For each independent randomisation of the paths,
    radiance = matrix @ in_band_radiance(band, temperatures of the facets) + rest.

    Attributes
    ----------
    matrices : list of scipy.sparse.csr_array
        One for each randomisation, (pixels, facets), pixels row by row. An entry is the radiance of
        a pixel for a blackbody radiance of 1 of the facet.
    rest : ndarray, shape (R, pixels)
        Radiance from everything but the facets of the chosen groups [W m^-2 sr^-1].
    facets : ndarray, shape (F,)
        Facets of the columns, numbered as in `FacetTable`.
    temperature : ndarray, shape (F,)
        Temperatures of these facets in the scene [K].
    band : Band
    size : (int, int)
        Width and height of the image.
    """

    matrices: list[sparse.csr_array]
    rest: np.ndarray
    facets: np.ndarray
    temperature: np.ndarray
    band: Band
    size: tuple[int, int]

    @property
    def mean(self) -> sparse.csr_array:
        """Mean of the matrices, (pixels, facets)."""
        return sparse.csr_array(sum(self.matrices) / len(self.matrices))

    def radiance(self, temperature=None) -> np.ndarray:
        """Radiance of each randomisation, (R, height, width) [W m^-2 sr^-1].

        temperature: temperatures of the facets [K], (F,) or a number; None takes the scene's.
        """
        temperature = self.temperature if temperature is None else temperature
        source = in_band_radiance(self.band, np.broadcast_to(temperature, self.facets.shape))
        of_facets = [matrix @ source for matrix in self.matrices]
        return (np.array(of_facets) + self.rest).reshape(len(of_facets), *self.size[::-1])


def facet_matrix(
    scene: Scene,
    *,
    groups=None,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = RANDOMISATIONS,
    model_only: bool = False,
) -> FacetMatrix:
    """Trace a scene once, for the images of all temperatures of its facets.

    The paths are those of `mi_lcair.render` if the seed and the numbers of samples and of
    randomisations are the same. With `emitter_sampling`, the emitters are drawn by their radiances
    at the scene's own temperatures. The matrix then also holds for other temperatures, but a render
    at these has other paths.

    Parameters
    ----------
    scene : Scene
    groups : iterable of str or None
        Groups whose facets get columns. None: all groups with temperatures. Facets without a
        temperature of their own, such as those of a texture, belong to the rest.
    sensor : int
        Number of the sensor, counted from 0.
    spp : int or None
        Samples per pixel (the number in the scene), rounded up to a multiple of `randomisations`.
    seed : int
    randomisations : int
        Number of independent randomisations of each pixel's points.
    model_only : bool
        Whether only paths that first hit the model count, as those of a target's intensity.

    Returns
    -------
    FacetMatrix

    Raises
    ------
    InputError
        For an unknown group, groups without temperatures, and closure = tail, whose radiance is not
        linear in that of the facets.
    """
    camera = scene.sensor(sensor)
    spp = camera.sampler().sample_count() if spp is None else spp
    for name, value in (("spp", spp), ("randomisations", randomisations)):
        Bounds(is_positive=True, upper=MOST_SPP).check(value, name)
    width, height = camera.film().crop_size()
    check_paths(width * height, spp)
    points = -(-spp // randomisations)
    if has_spectral_materials(scene.mi):
        raise InputError(
            f"{scene.name}: temperatures of facets are no unknowns with materials by wavelength; "
            "give these `average_K`"
        )
    with scene.prepared() as tracer:
        if tracer.closure == "tail":
            raise InputError(
                f"{scene.name}: closure = tail is not linear in the radiance of the facets; "
                "use none or ambient"
            )
        emitters, facets, columns, temperature = chosen_facets(scene, groups)
        table = column_table(emitters, columns)
        shape = (width * height, randomisations, len(facets))
        blocks, invalid, done = {}, 0, 0
        with unit_radiance(emitters):
            for launch in launches(width, height, seed, randomisations, points, slots(tracer)):
                traced = contributions(tracer, camera, launch, table, model_only)
                invalid += int((~traced.valid).sum())
                summed = pass_sums(traced, launch, shape[-1])
                before = blocks.get(launch.first)
                blocks[launch.first] = (
                    summed if before is None else [a + b for a, b in zip(before, summed)]
                )
                done += launch.paths
        check_valid(invalid, done, scene.name)
    sums, rest, valid = zip(*blocks.values())
    valid = np.maximum(np.concatenate(valid), 1)
    matrix = sparse.vstack(sums, format="csr")
    matrix.data /= np.repeat(valid, np.diff(matrix.indptr))
    return FacetMatrix(
        matrices=[matrix[r::randomisations] for r in range(randomisations)],
        rest=(np.concatenate(rest) / valid).reshape(shape[:2]).T,
        facets=facets,
        temperature=temperature,
        band=scene.band,
        size=(width, height),
    )


def launches(width: int, height: int, seed: int, randomisations: int, points: int, slots: int):
    """Yield launches that trace `points` points of each randomisation of each pixel.

    They have at most about PASS_SLOTS / slots paths each.
    """
    paths = max(1, PASS_SLOTS // slots)
    step = min(points, max(1, paths // randomisations))
    run = max(1, paths // (step * randomisations))
    for first_point in range(0, points, step):
        for first in range(0, width * height, run):
            yield Launch(
                columns=width,
                rows=height,
                seed=seed,
                randomisations=randomisations,
                points=min(step, points - first_point),
                first_point=first_point,
                first=first,
                windows=min(run, width * height - first),
            )


def pass_sums(found: Contributions, launch: Launch, facets: int) -> list:
    """Sums over the points of each randomisation of a launch.

    Returns the sums by facet, (windows * randomisations, facets), of the rest and of the valid
    paths.
    """
    rows = launch.windows * launch.randomisations
    begin = np.searchsorted(found.path, np.arange(rows + 1) * launch.points)
    by_facet = sparse.csr_array((found.value, found.column, begin), shape=(rows, facets))
    by_facet.sum_duplicates()

    def total(values):
        return values.reshape(rows, -1).sum(axis=1, dtype=np.float64)

    return [by_facet, total(found.rest), total(found.valid)]


def chosen_facets(scene: Scene, groups) -> tuple:
    """Emitters whose facets get columns, the facets, each emitter's columns, the temperatures.

    The columns of an emitter are those of the primitives of its shape, (primitives,).
    """
    facets = FacetTable(scene)
    shapes = thermal_shapes(scene.mi)
    with_temperature = [shape for shape in shapes if shape.emitter().temperatures() is not None]
    known = {shape.emitter().group for shape in with_temperature}
    for group in known if groups is None else groups:
        if group not in {shape.emitter().group for shape in shapes}:
            raise unknown("group", group, known)
        if group not in known:
            raise InputError(f"{scene.name}: group {group} has no facets with temperatures")
    wanted = [
        shape for shape in with_temperature if groups is None or shape.emitter().group in groups
    ]
    if not wanted:
        raise InputError(f"{scene.name}: no facets with temperatures were chosen")
    numbers = [facets.of_primitives[shape] for shape in wanted]
    used, columns = np.unique(np.concatenate(numbers), return_inverse=True)
    ends = np.cumsum([len(of_shape) for of_shape in numbers])[:-1]
    emitters = [shape.emitter() for shape in wanted]
    return emitters, used, np.split(columns, ends), facets.temperature[used]
