"""Truth by pixel: what each pixel shows, and the parts of its radiance with their errors."""

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import together, write_bytes
from mi_lcair.formats import write_png
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, thermal_shapes
from mi_lcair.plugins.paths.launch import DIRECT, views_of
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.recorders.radiance import FirstEmission, unit_radiance, up_to_prefix
from mi_lcair.plugins.recorders.recorder import Recorders
from mi_lcair.rendering.facets import FacetTable, block_of, pixel_rays
from mi_lcair.rendering.images.files import write_exr
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.pixels import pixel_errors
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals

# The truth of an image, and its files
# ------------------------------------

# Layers of the numbers: Blender's passes where it has one
LAYERS = {
    "facet": "IndexFacet.X",
    "group": "IndexGroup.X",
    "material": "IndexMA.X",
    "instance": "IndexOB.X",
}
MOST_FACETS = 2**24 - 1  # the largest number up to which single precision holds all
MOST_OF_PNG = 2**16 - 1
HALF = 0.5  # share of a pixel from which on it belongs to the mask of the target


@dataclass(frozen=True, repr=False)
class Truth:
    """What each pixel of an image shows, and the parts of its radiance.

    Attributes
    ----------
    channels : dict of str to ndarray, float32 (H, W)
        Layers by name. Numbers, depth, normal, temperature and emissivity are those at the centre
        of the pixel; radiances are means over it.
    legend : dict of str to dict of int to str
        Names of the numbers of each of LAYERS; 0 stands for nothing. Of facets, only those that
        are seen have an entry: instance, group and material.
    header : dict
        Header of the EXR.
    """

    channels: dict[str, np.ndarray]
    legend: dict[str, dict[int, str]]
    header: dict[str, str | int | float]

    def ids(self, kind: str) -> np.ndarray:
        """Numbers (H, W) of one of LAYERS: 1 and more, 0 where nothing is seen."""
        return self.channels[LAYERS[kind]].astype(np.uint32)

    def mask_of_target(self) -> np.ndarray:
        """Which pixels show the target: those that it fills by half, or where it is at all."""
        share = self.channels["mask.Y"]
        return share >= HALF if share.max() >= HALF else share > 0

    def coco(self, file_name: str = "", image_id: int = 1, first: int = 1) -> dict[str, Any]:
        """Boxes and masks as the public format COCO has them.

        The categories are the target, its groups and the instances, and the same in all views of a
        scene. A mask is a run-length code over the columns.

        Parameters
        ----------
        file_name : str
            Name of the image's file.
        image_id : int
        first : int
            Number of the first annotation.
        """
        kinds = ("group", "instance")
        listed = [(kind, k, name) for kind in kinds for k, name in self.legend[kind].items()]
        categories, annotations = [("target", 0, "target"), *listed], []
        ids = {kind: self.ids(kind) for kind in kinds}
        seen = {(kind, k) for kind in kinds for k in np.unique(ids[kind]).tolist()}
        for category, (kind, k, _) in enumerate(categories, 1):
            if kind == "target":
                mask = self.mask_of_target()
            elif (kind, k) in seen:
                mask = ids[kind] == k
            else:
                continue
            if mask.any():
                about = {"image_id": image_id, "category_id": category}
                annotations.append({"id": first + len(annotations)} | about | annotation(mask))
        height, width = self.channels["mask.Y"].shape
        return {
            "images": [{"id": image_id, "file_name": file_name, "width": width, "height": height}],
            "categories": [
                {"id": number, "name": name, "supercategory": kind}
                for number, (kind, _, name) in enumerate(categories, 1)
            ],
            "annotations": annotations,
        }

    def write_exr(self, path: str | Path) -> None:
        """Write all layers as an OpenEXR file."""
        write_exr(path, self.channels, self.header)

    def write_ids(self, path: str | Path, kind: str) -> None:
        """Write numbers as a 16-bit PNG; raises InputError if they do not fit."""
        ids = self.ids(kind)
        if ids.max() > MOST_OF_PNG:
            raise InputError(
                f"{path}: a 16-bit PNG can have numbers up to {MOST_OF_PNG}, and a {kind} has "
                f"number {ids.max()}; use {LAYERS[kind]} of the EXR"
            )
        write_png(path, ids.astype(np.uint16))

    def write_legend(self, path: str | Path) -> None:
        """Write the names of the numbers as JSON."""
        write_bytes(path, json.dumps(self.legend, indent=1).encode())

    def write_coco(self, path: str | Path, file_name: str = "") -> None:
        """Write boxes and masks as JSON, see `coco`."""
        write_bytes(path, json.dumps(self.coco(file_name)).encode())

    def files(self, stem: str | Path) -> dict[Path, Callable[[Path], None]]:
        """The files STEM.truth.exr, STEM.legend.json, STEM.coco.json and STEM.KIND.png.

        Each has the function that writes it. KIND is one of LAYERS. A PNG that cannot hold the
        numbers of facets is left out, with a warning.
        """
        fits = [kind for kind in LAYERS if self.ids(kind).max() <= MOST_OF_PNG]
        for kind in LAYERS.keys() - fits:
            warnings.warn(
                f"no PNG with the numbers of each {kind} is written, because 16 bits are enough "
                f"only up to {MOST_OF_PNG}; use {LAYERS[kind]} of the EXR",
                stacklevel=2,
            )
        image = Path(f"{stem}.truth.exr")
        return {
            image: self.write_exr,
            Path(f"{stem}.legend.json"): self.write_legend,
            Path(f"{stem}.coco.json"): partial(self.write_coco, file_name=image.name),
            **{Path(f"{stem}.{kind}.png"): partial(self.write_ids, kind=kind) for kind in fits},
        }

    def save(self, stem: str | Path) -> list[Path]:
        """Write all `files`, or none; returns their paths."""
        files = self.files(stem)
        with together():
            for path, write in files.items():
                write(path)
        return list(files)


def annotation(mask: np.ndarray) -> dict[str, Any]:
    """Box and mask of pixels as COCO has them.

    The mask is the lengths of runs of pixels outside and inside in turn, column after column.
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    box = columns[0], rows[0], np.ptp(columns) + 1, np.ptp(rows) + 1
    flat = np.concatenate([[False], mask.ravel(order="F")])
    starts = np.flatnonzero(flat[1:] != flat[:-1])
    counts = np.diff(starts, prepend=0, append=mask.size).tolist()
    return {
        "bbox": list(map(int, box)),
        "area": int(mask.sum()),
        "iscrowd": 0,
        "segmentation": {"size": list(mask.shape), "counts": counts},
    }


# What the rays through the pixels' centres hit
# ---------------------------------------------


@dataclass(frozen=True)
class CentreRays:
    """Rays through the centres of pixels, row by row.

    ray: Mitsuba's rays, which may begin in front of the camera. eye: position of the camera, (3,)
    [m]. axis: unit vector of the optical axis, (3,). Both are (P, 3) for several cameras. size:
    rows and columns.
    """

    ray: mi.Ray3f
    eye: np.ndarray
    axis: np.ndarray
    size: tuple[int, int]

    @staticmethod
    def of(camera: mi.Sensor) -> "CentreRays":
        """Those of Mitsuba's sensor, or of a batch's sensors side by side."""
        ray, size = pixel_rays(camera)
        places = np.array([view.world_transform().matrix for view in views_of(camera)], dtype=float)
        _, _, axes, eyes = np.moveaxis(places.reshape(-1, 4, 4)[:, :3], 2, 0)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        number = np.tile(np.arange(size[1]) * len(eyes) // size[1], size[0])
        return CentreRays(ray, eyes[number], axes[number], size)

    @property
    def near(self) -> np.ndarray:
        """Distance along the rays from the camera to where they begin, (P,) [m]."""
        start, toward = (np.array(part, dtype=float).T for part in (self.ray.o, self.ray.d))
        return np.einsum("pk,pk->p", start - self.eye, toward)


CAMERAS = {"PerspectiveCamera", "ThinLensCamera", "OrthographicCamera", "RadianceMeter"}


def is_camera(sensor) -> bool:
    """Whether a sensor's pixels, or those of a batch's sensors, see from one place each."""
    return {view.class_name() for view in views_of(sensor)} <= CAMERAS


def check_has_truth(sensor) -> None:
    """Raise InputError for a sensor whose pixels have no truth."""
    if not is_camera(sensor):
        raise InputError(
            "a truth by pixel needs a sensor perspective, thinlens, orthographic or radiancemeter, "
            f"and not a {sensor.class_name()}; name another sensor, or leave out the truth"
        )


def count_from_camera(total: Totals, camera) -> None:
    """Let the ranges of totals begin at the camera, and not where its rays begin (`near_clip`)."""
    if is_camera(camera):
        near = CentreRays.of(camera).near[:, None]
        for prefix in {"", "target."} & {name.removesuffix("range") for name in total.sums}:
            total.sums[f"{prefix}range"] += near * total.sums[f"{prefix}hit"]


def numbers_of(scene: Scene, table: FacetTable) -> tuple[dict[str, np.ndarray], dict]:
    """Numbers from 1 of each facet in the LAYERS but `facet`, (count,), and their names."""
    if table.count > MOST_FACETS:
        raise InputError(
            f"{scene.name}: has {table.count} facets; layers of an image number {MOST_FACETS} at "
            "most; leave out the truth"
        )
    parts = {}  # parts of a model of one type are one instance
    for index, shape in enumerate(scene.mi.shapes()):
        block, kind = block_of(index, shape), facet_type_of(shape.emitter())
        name = shape.id() if isinstance(block, int) else block
        parts[index] = (block, kind), name if kind == "model" else f"{name} ({kind})"
    number = {key: k for k, key in enumerate(dict.fromkeys(key for key, _ in parts.values()), 1)}
    labels: dict[str, dict] = dict.fromkeys(LAYERS, {}) | {"facet": {}}
    labels["instance"] = {number[key]: name for key, name in parts.values()}
    of_shape = np.array([0, *(number[key] for key, _ in parts.values())])
    numbers = {"instance": of_shape[1 + table.shape_index]}
    for kind in ("group", "material"):
        texts, place = np.unique(getattr(table, kind).astype(str), return_inverse=True)
        numbers[kind] = 1 + place
        labels[kind] = {k: str(text) for k, text in enumerate(texts, 1)}
    return numbers, labels


def at_centres(scene: Scene, rays: CentreRays, model_only: bool = False) -> Truth:
    """Layers of what the rays through the pixels' centres hit; radiances are not known yet.

    model_only: whether what is no part of the model is left out.
    """
    table, ray = FacetTable(scene), rays.ray
    numbers, legend = numbers_of(scene, table)
    emitters = [shape.emitter() for shape in thermal_shapes(scene.mi)]
    # Cold facets have an emissivity, too. Materials by wavelength need the true spectra.
    has_unit = not has_spectral_materials(scene.mi)
    blackbodies = [e for e in emitters if has_unit and e.temperatures() is not None]
    with dr.suspend_grad(), scene.prepared() as tracer, unit_radiance(blackbodies):
        hit = nearest_hit(scene.mi, tracer.emitters.sheets, ray, coherent=True)
        si = hit.compute_surface_interaction(ray, mi.RayFlags.All, hit.is_valid())
        sampler = mi.load_dict({"type": "independent"}, parallel=False)
        sampler.seed(0, dr.width(ray))
        recorded = Recorders([FirstEmission(mi.Float(0), mi.Bool(True))])
        *_, recorded = tracer.paths.walk(sampler, (ray, hit), mi.Bool(True), recorded, DIRECT)
        emitted = recorded.of(FirstEmission).radiance
        facet = table.of_hit(hit)
        dr.eval(si, emitted, facet)
    facet = facet.numpy().astype(np.int64)
    seen = si.is_valid().numpy() & (facet < table.count)
    if model_only:
        seen &= (table.type == "model")[np.where(seen, facet, 0)]
    facet = np.where(seen, facet, 0)
    temperature, radiance = sources_at(scene, si, emitters, table.temperature[facet], has_unit)
    start, toward, normal, shown = (
        np.array(part, dtype=float).T for part in (ray.o, ray.d, si.sh_frame.n, si.n)
    )
    place = start - rays.eye + np.where(seen, si.t.numpy(), 0)[:, None] * toward
    turned = np.sign(np.einsum("pk,pk->p", shown, -toward))[:, None]
    layers: dict[str, np.ndarray] = {LAYERS["facet"]: facet + 1}
    layers |= {LAYERS[kind]: numbers[kind][facet] for kind in numbers}
    layers |= {
        "Depth.Z": np.sum(place * rays.axis, axis=1),
        "range.Y": np.linalg.norm(place, axis=1),
    }
    layers |= dict(zip(("Normal.X", "Normal.Y", "Normal.Z"), (turned * normal).T))
    share = emitted.numpy() / np.where(radiance > 0, radiance, np.inf)
    layers |= {"true_temperature.Y": np.nan_to_num(temperature), "emissivity.Y": share}
    instances, groups, materials = (legend[kind] for kind in ("instance", "group", "material"))
    for number in np.unique(facet[seen]).tolist():
        of_facet = (numbers[kind][number] for kind in ("instance", "group", "material"))
        names = (kind[k] for kind, k in zip((instances, groups, materials), of_facet))
        legend["facet"][number + 1] = ", ".join(names)
    channels = {
        name: images(np.where(seen, values, 0), rays.size) for name, values in layers.items()
    }
    return Truth(channels, legend, {})


def sources_at(scene: Scene, si, emitters, temperature: np.ndarray, has_unit: bool) -> tuple:
    """Temperatures [K] at hits, and radiances whose part that is emitted is the emissivity, (n,).

    NaN stands for no temperature, and 0 for no radiance. temperature: those of the facets.
    has_unit: whether blackbodies have the radiance 1.
    """
    is_known = np.isfinite(temperature)
    radiance = in_band_radiance(scene.band, np.where(is_known, temperature, 0))
    radiance = np.where(is_known, 1.0, 0.0) if has_unit else radiance
    shape = dr.reinterpret_array(mi.UInt32, si.shape).numpy()
    for emitter in emitters:
        here = shape == pointer_id(mi.ShapePtr(emitter.get_shape()))
        if emitter.temperatures() is not None or not here.any():
            continue
        if emitter.facet_radiance() is not None:
            radiance[here] = float(emitter.facet_radiance()[0])
        else:  # a texture that varies inside the facets
            at_hits = np.broadcast_to(emitter.texture.eval_1(si).numpy(), here.shape)
            temperature = np.where(here, at_hits, temperature)
            radiance[here] = in_band_radiance(scene.band, temperature[here])
    return temperature, radiance


def images(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Values of pixels (P,) as a channel (H, W)."""
    return np.ascontiguousarray(np.reshape(values, size), dtype=np.float32)


# Parts of the radiance of pixels, and their errors
# -------------------------------------------------

UP_TO = (0,)  # numbers of reflections up to which paths are also summed separately
STEP = 1e-4  # relative step of a radiance, for the slope of its apparent temperature


def with_parts(measurands: Measurands) -> Measurands:
    """Measurands that also record what `add_parts` and the mask of the target need."""
    channels = measurands.channels
    parts, split = tuple({*channels.parts, "group"}), channels.split
    split = "target" if split == "image" else split
    return replace(measurands, channels=replace(channels, split=split, parts=parts, up_to=UP_TO))


def parts_of(channels: dict[str, np.ndarray], prefix: str = "") -> dict[str, np.ndarray]:
    """What is emitted and reflected, from channels by group, up to UP_TO reflections and of all.

    The names are emitted and reflected.group.LABEL, with the prefix; none without such channels.
    """
    before = f"{prefix}{up_to_prefix(0)}group."
    direct = {
        name.removeprefix(before): v for name, v in channels.items() if name.startswith(before)
    }
    parts = {f"{prefix}emitted": sum(direct.values())} if direct else {}
    for label, values in direct.items():
        parts[f"{prefix}reflected.group.{label}"] = channels[f"{prefix}group.{label}"] - values
    return parts


def add_parts(total: Totals, prefix: str = "") -> list[str]:
    """Add the sums of what is emitted and reflected to totals; the names of these channels."""
    parts = parts_of(total.sums, prefix)
    total.sums |= parts
    return list(parts)


def drop_groups(total: Totals, keeps_all: bool) -> None:
    """Take sums by group out of totals; keeps_all: whether those of all reflections stay."""
    for name in list(total.sums):
        beginning = name.removeprefix("target.")
        if beginning.startswith("upto.") or (beginning.startswith("group.") and not keeps_all):
            del total.sums[name]


def layer_of(name: str) -> str:
    """Name of the layer of a channel of `add_parts`."""
    return name.removeprefix("target.").replace("reflected.group.", "reflected.") + ".Y"


def apparent_temperature(band: Band, radiance, error) -> dict[str, np.ndarray]:
    """Layers of the apparent temperature [K] of a radiance with a standard error."""
    radiance = np.maximum(radiance, 0)
    low, middle, high = (
        brightness_temperature(band, radiance * factor) for factor in (1 - STEP, 1, 1 + STEP)
    )
    slope = (high - low) / np.where(radiance > 0, 2 * STEP * radiance, np.inf)
    error = slope * np.where(slope > 0, error, 0)  # one path knows no error
    return {"apparent_temperature.Y": middle, "stderr.apparent_temperature.Y": error}


def truth_of_render(
    scene: Scene, camera, total: Totals, size: tuple[int, int], air: dict[str, np.ndarray]
) -> Truth:
    """The truth of a render.

    total: with the sums of `add_parts`. size: rows and columns. air: what `apparent` gives; empty
    without air.
    """
    names = [name for name in total.sums if name.startswith(("emitted", "reflected."))]
    layers = {layer_of(name): total.mean(name) for name in names}
    if scene.mi.integrator().closure != "none":
        layers["rest.Y"] = total.mean() - sum(layers.values())
    for name in names:
        layers[f"stderr.{layer_of(name)}"] = pixel_errors(total, size, name, False)
    layers |= {"Y": total.mean(), "stderr.Y": pixel_errors(total, size, None, False)}
    layers |= {"mask.Y": total.mean("target.hit"), "target.Y": total.mean("target")}
    apparent, error = total.mean(), layers["stderr.Y"]
    if air:
        apparent, path = air["apparent.Y"], air["path.Y"]
        behind, target = total.mean() - layers["target.Y"], layers["target.Y"]
        arrives = apparent - behind - path
        through = arrives / np.where(target > 0, target, np.inf)
        # Each randomisation has the air of its pixel
        share = layers["mask.Y"]
        of_path = path / np.where(share > 0, share, np.inf)
        total.sums["apparent"] = (
            total.radiance
            + (through - 1)[:, None] * total.sums["target"]
            + of_path[:, None] * total.sums["target.hit"]
        )
        error = pixel_errors(total, size, "apparent", False)
        layers |= {"path.Y": path, "transmittance.Y": through, "background.Y": behind}
    layers |= {"apparent.Y": apparent, "stderr.apparent.Y": error}
    layers |= apparent_temperature(scene.band, apparent, error)
    at_centre = at_centres(scene, CentreRays.of(camera))
    if total.randomisations < 2:  # one path says nothing of its error
        layers = {name: v for name, v in layers.items() if not name.startswith("stderr.")}
    channels = {name: images(values, size) for name, values in layers.items()}
    return replace(at_centre, channels=at_centre.channels | channels)
