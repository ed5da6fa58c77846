"""The facet model, read from a file of a modelling program, its labels and temperatures."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mi_lcair.coincident import weld
from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, errors_of, option, shown
from mi_lcair.extras import named, optional
from mi_lcair.files import read_text
from mi_lcair.models3d.modellers import exchange
from mi_lcair.models3d.modellers.naming import (
    TYPES,
    Label,
    NameTable,
    find_material,
    kelvin,
    labels_of,
)
from mi_lcair.models3d.modellers.obj import Obj, read_obj
from mi_lcair.models3d.polygons import MOST_CLIPPED, triangulate
from mi_lcair.physics import materials as known_materials
from mi_lcair.results import Result
from mi_lcair.scenes import check_model
from mi_lcair.sections import Remarks
from mi_lcair.table import read_table

FARTHEST = 1e9  # largest coordinate [m], whose square is far below the largest Float32 number
# Largest ratio of distance from the origin to the model's size. At a ratio of 10,000, Float32
# coordinates cause an error of 1 % in intensity.
SIZES_AWAY = 1000
ASK_AXES = ("OBJ", "PLY", "STL")  # kinds of files that do not say which axis is up
WORDS = {"inward": "facing inward", "degenerate": "without area"}  # of figures


@dataclass(frozen=True, repr=False)
class Model(Result):
    """A welded facet model, lengths in m.

    vertices: (V, 3); welding leaves some unused. corners: indices of the vertices, facet after
    facet, (N,). first: position in `corners` at which each facet begins, then N, (F + 1,).
    labels: the labels. label: index into `labels` of each facet, (F,). temperature: (F,) [K].
    triangles: indices of vertices, without slivers, (T, 3). triangle_facet: the facet of each
    triangle, (T,). off_plane: largest distance of a facet's corners from its mean plane, (F,).
    names: that of each facet's object, group or material in the file, "" without one, (F,); None
    for no names. remarks: what a user should know about the reading of the file, one line each.
    files: texts of further files by name, see `Movement.files`.
    """

    vertices: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    labels: list[Label]
    label: np.ndarray
    temperature: np.ndarray
    triangles: np.ndarray
    triangle_facet: np.ndarray
    off_plane: np.ndarray
    names: np.ndarray | None = None
    remarks: tuple[str, ...] = ()
    files: dict[str, str] = field(default_factory=dict)

    kind = "model"
    drawn_by = "mi_lcair.show.pictures.model:figure"

    def summary(self) -> str:
        """One line with the number of facets, the size and the temperatures."""
        size = " x ".join(f"{length:.4g}" for length in np.diff(self.box, axis=0)[0])
        low, high = self.temperature.min(), self.temperature.max()
        return (
            f"model of {self.count} facets ({len(self.triangles)} triangles), {size} m, "
            f"{low:g} to {high:g} K"
        )

    def entries(self) -> dict:
        """Entries for JSON: the figures of `report`."""
        return named("mi_lcair.models3d.checks:report")(self)

    def facts(self, materials: str | Path | None = None):
        """The figures of the model, and what is remarkable about it.

        materials: file of the user's materials, if any.
        """
        figures = self.entries()
        yield "facets", f"{figures['facets']} ({figures['triangles']} triangles)"
        size = " x ".join(f"{a:.4g}" for a in np.diff(self.box, axis=0)[0])
        yield "bounding box", f"{size} m"
        yield "volume", f"{figures['volume']:.6g} m^3"
        for material, area in figures["area_by_material"].items():
            yield f"area of {material}", f"{area:.6g} m^2"
        low, high = figures["temperature_min"], figures["temperature_max"]
        yield "temperature", f"{low:g} to {high:g} K"
        for name in ("open edges", "inward", "degenerate", "duplicate"):
            yield WORDS.get(name, name), figures[name.replace(" ", "_")]
        off = f"(at most {figures['non_planar_mm']:.3g} mm off)"
        yield "not planar", f"{figures['non_planar']} {off}"
        remarkable = named("mi_lcair.models3d.checks:remarkable")
        yield Remarks([*self.remarks, *remarkable(figures, materials)])

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each facet: its number, type, material, group, temperature and area."""
        areas = named("mi_lcair.models3d.checks:triangle_areas")(self)
        labels = [
            (TYPES[label.type], Path(label.material).name, label.group) for label in self.labels
        ]
        kinds, materials, groups = np.array(labels)[self.label].T
        return {
            "facet": np.arange(self.count),
            "type": kinds,
            "material": materials,
            "group": groups,
            "temperature_K": self.temperature,
            "area_m2": np.bincount(self.triangle_facet, areas, self.count),
        }

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.label)

    @property
    def box(self) -> np.ndarray:
        """Lowest and highest coordinates (2, 3) of the facets' corners [m]."""
        return self.box_of(np.ones(self.count, bool))

    def box_of(self, facets: np.ndarray) -> np.ndarray:
        """Lowest and highest coordinates (2, 3) of the corners of the facets in a mask [m]."""
        points = self.vertices[self.corners[np.repeat(facets, np.diff(self.first))]]
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def called(self, facets, most: int = 3) -> str:
        """What some facets are called in the file, in words; "" if they have no names there."""
        names = [] if self.names is None else [*dict.fromkeys(filter(None, self.names[facets]))]
        return ", ".join(names[:most]) + ", ..." * (len(names) > most)

    def facets_of(self, kind: str) -> np.ndarray:
        """Mask (F,) of the facets of a type: f (model), s (sky) or t (terrain)."""
        return np.array([label.type == kind for label in self.labels])[self.label]


def read(
    path: str | Path,
    temperatures: str | Path | None = None,
    material: str | None = None,
    materials: str | Path | None = None,
    scale: float | None = None,
    *,
    temperature: float | None = None,
    names: str | Path | None = None,
    forward: str | None = None,
    up: str | None = None,
    nose: str = "X",
    variants: Mapping[str, str] | None = None,
    guess: bool = False,
) -> Model:
    """Read the model in an OBJ, glTF, PLY, STL or USD file.

    Parameters
    ----------
    path : str or Path
    temperatures : str, Path or None
        Table facet,kelvin with each facet once, in place of the temperatures in the labels. Or a
        mesh with temperatures of cells or nodes, such as .vtu or .med of a FEM program, which
        meshio reads. Or the JSON file of an inversion, for the facets that were unknown in it.
    material : str or None
        Material of all model facets (f), in place of those in the labels: a name, the emissivity of
        a grey surface, or a fit's JSON file. If temperatures and material are given, facets without
        a label are model facets.
    materials : str, Path or None
        TOML file with the user's materials, or the JSON file of a fit or of an inversion.
    scale : float or None
        Length of the file's unit [m] (default: 1, or what a USD file says).
    temperature : float or None
        Temperature of all model facets (f) [K], in place of those in the labels.
    names : str, Path or None
        Table that describes the faces of each object, group or Blender material: name and type,
        material or emissivity, kelvin, group, elevation_deg.
    forward : str or None
        Forward Axis from the export dialogue of Blender (-Z unless it was changed there), along
        which Blender's +Y was written. Without `forward` and `up`, x, y and z are those of Blender;
        glTF is turned automatically.
    up : str or None
        Up Axis from the export dialogue of Blender (Y unless it was changed there), along which
        Blender's +Z was written.
    nose : str
        Axis along which the nose points in Blender.
    variants : mapping of str to str, optional
        Variant to select in the variant sets of a USD file, by their name.
    guess : bool
        Guess emissivities from metallic and roughness of a USD file where it gives no material.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        For a file, label or table that cannot be used.
    """
    if materials:
        known_materials.entries_of(materials)  # raises InputError for an entry that is impossible
    known = known_materials.names(materials)
    material = material and find_material(material, known)
    if scale is not None:
        hint = ": the metres of the file's unit of length"
        Bounds(is_positive=True, unit="m").check(scale, "scale", hint=hint)
    is_solution = bool(temperatures) and Path(temperatures).suffix.lower() == ".json"
    table_of_temperatures = None if is_solution or not temperatures else Path(temperatures)
    if temperature is not None:
        temperature = kelvin(f"{temperature:.9g}")
        if table_of_temperatures:
            names = f"{option('temperature')} and {option('temperatures')}"
            raise InputError(f"{names} exclude each other; give one")
    check_model(path)
    kind, usual = exchange.KINDS.get(Path(path).suffix.lower(), ("OBJ", exchange.AS_BLENDER))
    exchange.rotation(forward or usual[0], up or usual[1], nose)  # raises InputError at once
    if kind == "USD":
        optional("pxr", f"{path}: a USD file")
        obj = named("mi_lcair.models3d.modellers.usd:read_usd")(path, variants, guess)
    else:
        obj = read_obj(path) if kind == "OBJ" else exchange.read_mesh(path)
    usual = obj.axes or usual
    turn = exchange.rotation(forward or usual[0], up or usual[1], nose)
    table = NameTable(names) if names else None
    labels, label = labels_of(
        obj,
        table,
        materials=known,
        material=material,
        has_temperatures=table_of_temperatures is not None,
        temperature=temperature,
    )
    welded = _welded(obj, scale or obj.unit, turn)
    away = ()
    if table_of_temperatures and table_of_temperatures.suffix.lower() in exchange.SUFFIXES:
        corners = welded["vertices"][welded["corners"]]
        kelvins, away = exchange.temperatures_of_mesh(
            table_of_temperatures, np.split(corners, welded["first"][1:-1])
        )
        for number in (kelvins.min(), kelvins.max()):
            with errors_of(f"temperatures {table_of_temperatures}"):
                kelvin(f"{number:.9g}")
    elif table_of_temperatures:
        kelvins = _read_temperatures(table_of_temperatures, len(label))
    else:
        kelvins = np.array([entry.temperature for entry in labels], float)[label]
        if obj.kelvin is not None:  # a label without a temperature leaves it to the faces
            kelvins = np.where(np.isnan(kelvins), obj.kelvin, kelvins)
    if is_solution:
        kelvins = _solved_temperatures(Path(temperatures), kelvins)
    model = Model(
        **welded,
        labels=labels,
        label=label,
        temperature=kelvins,
        names=np.array([_called(part) for part in obj.parts], object)[obj.part],
        remarks=(
            *away,
            *obj.remarks,
            *_remarks(obj, labels, label, table, kind in ASK_AXES and not (forward or up)),
        ),
    )
    return model if obj.motion is None else _moving(model, obj, turn, scale or obj.unit)


def _moving(model: Model, obj: Obj, turn: np.ndarray, unit: float) -> Model:
    """The model with the files of its motion, from a file with times, its unit [m] and rotation."""
    of_labels = [at.group if at.type == "f" else "" for at in model.labels]
    groups = np.array(of_labels, object)[model.label]
    boxes = {group: model.box_of(groups == group) for group in set(groups) - {""}}
    boxes[""] = model.box_of(groups != "") if boxes else model.box
    files, remarks = obj.motion.files(groups, boxes, turn, unit)
    return replace(model, files=files, remarks=(*model.remarks, *remarks))


def _called(part) -> str:
    """The name of a face's object, group or material, the first that is no label; "" for none."""
    return next((name for name in part[::-1] if name and "*" not in name), "")


def _welded(obj: Obj, scale: float, turn: np.ndarray) -> dict:
    """The geometry of a Model, from the faces of a file, its unit [m] and a rotation (3, 3).

    Raises InputError for faces that are too far away, that cross themselves or have no area.
    """
    vertices = obj.vertices * scale
    if (turn != np.eye(3)).any():
        vertices = vertices @ turn.T
    used = np.unique(obj.corners)
    away, size = abs(vertices[used]).max(), np.ptp(vertices[used], axis=0).max()
    if away > FARTHEST:
        raise InputError(
            f"{obj.path}: a corner lies {away:g} m from the origin, more than {FARTHEST:g} m; see "
            f"{option('scale')}"
        )
    if away > SIZES_AWAY * size > 0:
        raise InputError(
            f"{obj.path}: the model, {size:g} m in size, lies {away:g} m from the origin, too far "
            "for the renderer's single precision; move it to the origin"
        )
    weld_to = np.arange(len(vertices))
    weld_to[used] = used[weld(vertices[used])]
    corners = weld_to[obj.corners]
    triangles, triangle_facet, off_plane, crossed = triangulate(vertices, corners, obj.first)
    if crossed.any():
        raise _crossed(obj, crossed)
    if len(triangles) == 0:
        raise InputError(f"{obj.path}: no face has an area; all corners of each lie on a line")
    return {
        "vertices": vertices,
        "corners": corners,
        "first": obj.first,
        "triangles": triangles,
        "triangle_facet": triangle_facet,
        "off_plane": off_plane,
    }


def _crossed(obj, crossed):
    """The error for faces, in a mask, that `triangulate` cannot divide."""
    place, size = obj.place(crossed.argmax()), int(np.diff(obj.first)[crossed.argmax()])
    if size > MOST_CLIPPED:
        return InputError(
            f"{place}: the face has {size} corners and is not convex; split it into polygons of at "
            f"most {MOST_CLIPPED}"
        )
    more = int(crossed.sum()) - 1
    others = f" ({more} more do{'es' * (more == 1)})" if more else ""
    return InputError(
        f"{place}: the face crosses itself or folds back on itself{others}; split it into simple "
        "polygons"
    )


def _remarks(obj: Obj, labels, label, table, ask_axes):
    """Lines about the axes of a file and about names in the table that the file does not have."""
    lines = []
    if ask_axes:
        of_model = np.array([entry.type == "f" for entry in labels])[label]
        judged = np.repeat(of_model | ~of_model.any(), np.diff(obj.first))
        points = obj.vertices[np.unique(obj.corners[judged])]
        lines.append(exchange.remark(points, obj.blender))
    if table and (unused := table.unused()):
        lines.append(f"{table.path}: nothing in {obj.path} is called {', '.join(unused)}")
    return tuple(filter(None, lines))


def _read_temperatures(path, count):
    """Temperatures (F,) in kelvin from a CSV facet,kelvin that names each facet once."""
    table = read_table(path, ("facet", "kelvin"))
    facet_column, kelvin_column = (table.columns.index(name) for name in ("facet", "kelvin"))
    temperature = np.zeros(count)
    for number, cells in table.rows:
        cell = cells[facet_column]
        with errors_of(f"{path}, line {number}"):
            facet = int(cell) if cell.isascii() and cell.isdecimal() and len(cell) < 10 else -1
            if not 0 <= facet < count:
                raise InputError(
                    f"facet {shown(cell)} does not exist; facets are numbered 0..{count - 1}"
                )
            if temperature[facet]:
                raise InputError(f"facet {facet} is given twice")
            mark = "." if table.separator == "," else ","
            temperature[facet] = kelvin(cells[kelvin_column].replace(mark, "."))
    missing = np.flatnonzero(temperature == 0)
    if len(missing):
        raise InputError(
            f"{path}: {count - len(missing)} temperatures for {count} facets; the first that is "
            f"missing is facet {missing[0]}"
        )
    return temperature


def _solved_temperatures(path, given):
    """The labels' temperatures `given` (F,), with those of facets in an inversion's solution."""
    try:
        data = [entry["facets"] for entry in json.loads(read_text(path))["data"]]
        groups = [facets for of_datum in data for facets in of_datum.values()]
        solved = [(int(facet), float(value)) for group in groups for facet, value in group.items()]
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise InputError(f"{path}: is not a solution of an inversion; a table needs .csv") from None
    if not solved:
        raise InputError(f"{path}: has no temperatures of facets; make GROUP.facets unknown")
    temperature = given.copy()
    for facet, value in dict(solved).items():
        if not 0 <= facet < len(given):
            raise InputError(
                f"{path}: facet {facet} does not exist; facets are numbered 0..{len(given) - 1}"
            )
        temperature[facet] = kelvin(f"{value:.9g}")
    several = {facet for facet, value in solved if dict(solved)[facet] != value}
    if several:
        raise InputError(
            f"{path}: facet {min(several)} has several temperatures, one for each state"
        )
    return temperature
