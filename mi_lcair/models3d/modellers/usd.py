"""Reader of OpenUSD files: the meshes of a stage in their places, and what it says of their faces.

What is said of a face are attributes `thermal:KEY` with a KEY of `naming.COLUMNS`, and SimReady's
non-visual labels. The nearest of these counts: the face itself (an array of the mesh), a GeomSubset
with the face, the bound material, the mesh, and the prims above it, the lowest first.

It is imported where a USD file is read, because it needs usd-core.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, UsdSkel, UsdUtils, Vt
from scipy.spatial.transform import Rotation

from mi_lcair.coincident import unique_rows, weld
from mi_lcair.declared import Bounds, percent
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.files import check_file
from mi_lcair.models3d.modellers.exchange import AS_BLENDER, EXPORTED, Mesh, label_in
from mi_lcair.models3d.modellers.naming import COLUMNS, GROUPS, OF_FACES, kelvin

LABELS = ("base", "coating", "attributes")  # SimReady's
SURFACE = {"material", "emissivity", "base", "coating"}  # what the nearest prim says as a whole
# Names of attributes. Blender writes properties without ':' as userProperties, and attributes of
# faces as primvars in whose names '_' stands for ':'.
NAME = re.compile(
    r"(?:(?:primvars:|userProperties:)?(?:thermal:|(?P<label>omni:simready:nonvisual:))"
    r"|(?:primvars:|userProperties:)thermal_)(?P<key>\w+)"
)
BLENDER = ("userProperties:blender:object_name", "userProperties:blender:data_name")
AXES = {"Y": EXPORTED, "Z": AS_BLENDER}  # forward and up, by the upAxis of a stage
SHOWN = ("default", "render")  # purposes of prims that are seen
MANY = (UsdGeom.Mesh, UsdGeom.PointInstancer)  # what may say several things
MOST_GROUPS = 64  # branches of the hierarchy that become groups; as many spectra are told apart
REASON = re.compile(r" : '(.*?)'\s*$", re.MULTILINE | re.DOTALL)  # in the text of USD's errors
NAMESPACE = re.compile(r"\w+pxrReserved__::(\w+::)*")  # of C++ names in it
SMALL = 1e-3  # relative change of the area by a subdivision that is not worth a remark
SMALL_CHANGE, RIGID = 1e-9, 1e-4  # of a frame's entries; of the lengths of turned vectors
MOST_MOMENTS = 1_000_000  # places of meshes at all times together
MOST_NAMED = 3  # prims that a remark names
CHANGES = "changes with time, and is read at the first time"


def read_usd(path: str | Path, variants: Mapping[str, str] | None, guess: bool) -> Mesh:
    """Read the meshes of a USD file (.usd, .usda, .usdc, .usdz), each in all of its places.

    Facets are the faces, mesh after mesh in the order of the stage, at its first time. Prims that
    are inactive, invisible or of purpose proxy or guide are left out, and so are holes. The faces
    of left-handed meshes are turned over. A mesh that is doubleSided and has open edges gets a back
    for each face.

    Parameters
    ----------
    path : str or Path
    variants : mapping of str to str, optional
        Variant to select in every variant set of this name.
    guess : bool
        Whether roughness and metallic of a UsdPreviewSurface give an emissivity where nothing is
        said of the surface.

    Raises
    ------
    InputError
        For a file that cannot be read whole or has no mesh.
    """
    path = Path(path)
    check_file(path)
    if not path.is_file():
        raise InputError(f"{path}: cannot be read: No such file or directory")
    delegate = UsdUtils.CoalescingDiagnosticDelegate()  # USD's warnings do not go to the console
    try:
        return Stage(path, variants or {}, guess).mesh()
    finally:
        del delegate


@dataclass(frozen=True)
class Array:
    """Several values of an attribute; over: their interpolation, "" if it is not a primvar."""

    values: np.ndarray
    over: str


@dataclass(frozen=True)
class Place:
    """A mesh of a stage, in one of its places.

    matrix: from the mesh's to the stage's coordinates, for row vectors, (4, 4). said: what the mesh
    and the prims above it say, the nearest first. where: names of the prims from the root of the
    stage to the mesh, through instances.
    """

    prim: object
    matrix: np.ndarray
    said: tuple[dict, ...]
    where: tuple[str, ...]

    @property
    def path(self) -> str:
        return "/" + "/".join(self.where)


@dataclass(frozen=True)
class MeshFaces:
    """Faces of a mesh: points (V, 3), corners (N,), sizes (F,), and what is said of each.

    number: index of each face in `said`, pairs (names, values), (F,). kelvin: temperatures of faces
    that have their own, else NaN, (F,).
    """

    points: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    number: np.ndarray | None = None
    kelvin: np.ndarray | None = None
    said: tuple = ()

    @property
    def first(self) -> np.ndarray:
        """Position in `corners` at which each face begins, (F,)."""
        return np.cumsum(self.sizes) - self.sizes

    @property
    def owner(self) -> np.ndarray:
        """The face of each corner, (N,)."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @property
    def following(self) -> np.ndarray:
        """The point after each corner, (N,)."""
        after = np.arange(1, len(self.corners) + 1)
        after[self.first + self.sizes - 1] = self.first
        return self.corners[after]

    def kept(self, keep: np.ndarray) -> "MeshFaces":
        """The faces in a mask (F,)."""
        corners, own = self.corners[np.repeat(keep, self.sizes)], self.kelvin[keep]
        return replace(
            self, corners=corners, sizes=self.sizes[keep], number=self.number[keep], kelvin=own
        )

    def turned(self) -> "MeshFaces":
        """The faces turned over, with the same first corners."""
        first, size = self.first[self.owner], self.sizes[self.owner]
        back = first + (first - np.arange(len(first))) % size
        return replace(self, corners=self.corners[back])

    def with_backs(self) -> "MeshFaces":
        """The faces, and the same ones turned over."""
        names, back = ("corners", "sizes", "number", "kelvin"), self.turned()
        both = {name: np.tile(getattr(self, name), 2) for name in names[1:]}
        return replace(self, corners=np.concatenate([self.corners, back.corners]), **both)

    def is_open(self) -> bool:
        """Whether a face has no neighbour at one of its edges."""
        welded = weld(self.points)
        edges = np.sort(welded[np.stack([self.corners, self.following], axis=1)], axis=1)
        number = unique_rows(edges[edges[:, 0] != edges[:, 1]])[1]
        return bool((np.bincount(number) == 1).any())

    def at_corners(self, array: Array) -> np.ndarray | None:
        """Values at the corners (N, ...); None if they are not as many as their places."""
        values, count, over = array.values, len(array.values), array.over
        if over in ("", "constant", "uniform") and count == len(self.sizes):
            return values[self.owner]
        if over in ("", "vertex", "varying") and count == len(self.points):
            return values[self.corners]
        return values if over in ("", "faceVarying") and count == len(self.corners) else None

    def means(self, values: np.ndarray) -> np.ndarray:
        """Mean over each face's corners of values (N, ...) at them, (F, ...)."""
        return means_of(values, self.owner, len(self.sizes))

    def vectors(self) -> np.ndarray:
        """Normal of each face, as long as twice its area, by Newell's formula, (F, 3)."""
        a, b = self.points[self.corners], self.points[self.following]
        start = a[self.first][self.owner]
        return np.add.reduceat(np.cross(a - start, b - start), self.first)

    def smoothed_area(self) -> float:
        """Area after a step of Catmull and Clark.

        A corner of a face becomes a quad of the moved point, a point of each of its two edges, and
        the face's middle. A point becomes (F + 2 R + (n - 3) P) / n, of the means F of its n faces'
        middles and R of its edges' middles, and an edge's point is the mean of its ends and of its
        two faces' middles. Points and edges of a border stay. Source: Catmull and Clark 1978.
        """
        at, to, count = self.points[self.corners], self.points[self.following], len(self.points)
        of_faces, of_edges = self.means(at)[self.owner], (at + to) / 2
        n = np.bincount(self.corners, minlength=count)[:, None]
        F, R = (means_of(of, self.corners, count) for of in (of_faces, of_edges))
        moved = np.where(
            n >= 3, (F + 2 * R + (n - 3) * self.points) / np.maximum(n, 1), self.points
        )
        ends = np.sort(np.stack([self.corners, self.following], axis=1), axis=1)
        number = unique_rows(ends)[1]
        faces = np.bincount(number)
        middles = means_of(of_faces, number, len(faces))[number]
        after = np.where(faces[number][:, None] == 2, (of_edges + middles) / 2, of_edges)
        place, last = np.arange(len(at)), (self.first + self.sizes - 1)[self.owner]
        before = after[np.where(place == self.first[self.owner], last, place - 1)]
        quads = np.cross(of_faces - moved[self.corners], before - after)
        return float(np.linalg.norm(quads, axis=1).sum() / 2)


def means_of(values: np.ndarray, index: np.ndarray, count: int) -> np.ndarray:
    """Means of the values (N, ...) that have each index from 0, (count, ...); NaN for none."""
    sums = np.zeros((count, *values.shape[1:]))
    np.add.at(sums, index, values)
    with np.errstate(invalid="ignore"):
        return (sums.T / np.bincount(index, minlength=count)).T


def reason_of(error: Exception) -> str:
    """What is wrong with a file, in the words of an error of USD."""
    try:
        text = str(error)
    except UnicodeDecodeError:  # it quotes the file
        return "it is damaged, or its text is not UTF-8"
    reason = REASON.search(text)
    return NAMESPACE.sub("", reason[1] if reason else text)


class Stage:
    """A stage of USD, and what a user should know about the reading of it.

    notes: paths of prims by what is remarkable about them. changes: times at which prims move.
    """

    def __init__(self, path: Path, variants: Mapping[str, str], guess: bool):
        self.path, self.guess, self.notes, self.changes = path, guess, {}, set()
        try:
            self.usd = Usd.Stage.Open(str(path))
        except Tf.ErrorException as error:
            raise InputError(f"{path}: cannot be read as USD: {reason_of(error)}") from None
        self.usd.SetEditTarget(self.usd.GetSessionLayer())
        self._select(variants)
        for error in self.usd.GetCompositionErrors():
            raise InputError(f"{path}: is incomplete: {error}")
        first = self.usd.GetStartTimeCode()
        has_range = self.usd.HasAuthoredTimeCodeRange()
        self.time = Usd.TimeCode(first) if has_range else Usd.TimeCode.EarliestTime()

    def note(self, what: str, path) -> None:
        """Keep the path of a prim for a remark."""
        self.notes.setdefault(what, {})[str(path)] = None

    def remarks(self) -> tuple[str, ...]:
        """What is remarkable, one line each."""
        return tuple(
            f"{what}: {', '.join([*paths][:MOST_NAMED])}"
            + f", ... ({len(paths)})" * (len(paths) > MOST_NAMED)
            for what, paths in self.notes.items()
        )

    def _select(self, variants: Mapping[str, str]) -> None:
        """Select variants by the name of their set; raises InputError for those that are none."""
        known, chosen = set(), []
        for prim in self.usd.TraverseAll():
            for name in prim.GetVariantSets().GetNames():
                variant_set = prim.GetVariantSet(name)
                names, selected = variant_set.GetVariantNames(), variants.get(name)
                known.add(name)
                check_known(f"variant of '{name}'", names, selected)
                chosen.append((variant_set, selected))
                was = selected or variant_set.GetVariantSelection() or "none"
                words = f"variant {name}={was} of {', '.join(names)} is read"
                self.note(words, prim.GetPath())
        check_known(f"variant set of {self.path.name}", known, *variants)
        for variant_set, name in chosen:
            if name:
                variant_set.SetVariantSelection(name)

    def _units(self) -> tuple[float, tuple[str, str]]:
        """Length of the stage's unit [m], and its axes forward and up."""
        unit, up = UsdGeom.GetStageMetersPerUnit(self.usd), UsdGeom.GetStageUpAxis(self.usd)
        for name, value in (("metersPerUnit", unit), ("upAxis", up)):
            if not self.usd.HasAuthoredMetadata(name):
                self.note(f"{name} is missing, and USD's default of {value} is used", "/")
            for layer in self.usd.GetUsedLayers():
                root = layer.pseudoRoot
                if root.HasInfo(name) and root.GetInfo(name) != value:
                    words = f"{name} is {root.GetInfo(name)} where the stage has {value}, and USD "
                    self.note(f"{words} does not convert: check sizes and axes", layer.identifier)
        with errors_of(self.path):
            Bounds(is_positive=True, unit="m").check(unit, "metersPerUnit")
            check_known("upAxis", AXES, up)
        return unit, AXES[up]

    def places(self, time) -> Iterator[Place]:
        """Yield the meshes that are seen, in each of their places, at a time of the stage."""
        yield from self._below(self.usd.GetPseudoRoot(), np.eye(4), (), (), "default", time)

    def _below(self, prim, *context) -> Iterator[Place]:
        # Prototypes may be below an `over` or a class, so that only their own specifier counts
        wanted = Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(wanted)):
            if child.GetSpecifier() == Sdf.SpecifierDef:
                yield from self._at(child, *context)

    def _at(self, prim, matrix, said, where, purpose, time) -> Iterator[Place]:
        """Yield the meshes of a prim and below it; the other arguments are those of its parent."""
        seen, where = UsdGeom.Imageable(prim), (*where, prim.GetName())
        if seen:
            if seen.GetVisibilityAttr().Get(time) == UsdGeom.Tokens.invisible:
                self.note("invisible, and is left out", prim.GetPath())
                return
            if seen.GetPurposeAttr().HasAuthoredValue():
                purpose = seen.GetPurposeAttr().Get()
        if movable := UsdGeom.Xformable(prim):
            local = np.array(movable.GetLocalTransformation(time))
            matrix = local if movable.GetResetXformStack() else local @ matrix
            if movable.TransformMightBeTimeVarying():
                self.changes |= set(movable.GetTimeSamples())
        said = (self._said(prim), *said)
        kind = prim.GetTypeName()
        if prim.IsA(UsdGeom.PointInstancer):
            yield from self._instances(prim, matrix, said, where, purpose, time)
            return
        if prim.IsA(UsdGeom.Mesh) and purpose in SHOWN:
            yield Place(prim, matrix, said, where)
        elif prim.IsA(UsdGeom.Mesh):
            self.note(f"of purpose {purpose}, and is left out", prim.GetPath())
        elif prim.IsA(UsdGeom.Gprim) or kind.endswith("Light"):
            self.note(f"{kind} is not a mesh, and is left out", prim.GetPath())
        yield from self._below(prim, matrix, said, where, purpose, time)

    def _instances(self, prim, matrix, said, where, purpose, time) -> Iterator[Place]:
        """Yield the meshes of a point instancer's prototypes in the places of its instances."""
        instancer = UsdGeom.PointInstancer(prim)
        paths = instancer.GetPrototypesRel().GetForwardedTargets()
        prototypes = [self.usd.GetPrimAtPath(path) for path in paths]
        which = np.array(instancer.GetProtoIndicesAttr().Get(time) or [], int)
        shown = instancer.ComputeMaskAtTime(time) or [True] * len(which)
        for name in ("positions", "orientations", "scales"):
            self.changes |= set(prim.GetAttribute(name).GetTimeSamples())
        kind = UsdGeom.PointInstancer
        placed = instancer.ComputeInstanceTransformsAtTime(
            time, time, kind.ExcludeProtoXform, kind.IgnoreMask
        )
        if len(placed) != len(which) or not np.isin(which, np.arange(len(prototypes))).all():
            raise InputError(
                f"{self.path}: {prim.GetPath()}: its protoIndices, positions and prototypes do not "
                "belong together"
            )
        for key, value in said[0].items():
            if isinstance(value, Array) and len(value.values) != len(which):
                many = f"{len(value.values)} values for {len(which)} instances"
                raise InputError(f"{self.path}: {prim.GetPath()}: {key} has {many}")
        for k in np.flatnonzero(shown).tolist():
            prototype = prototypes[which[k]]
            own = {
                key: value.values[k] if isinstance(value, Array) else value
                for key, value in said[0].items()
            }
            if prototype and prototype.IsActive():
                context = np.array(placed[k]) @ matrix, (own, *said[1:]), where, purpose, time
                yield from self._at(prototype, *context)

    def _said(self, prim) -> dict:
        """What a prim says, by key; an Array where it has several values."""
        said = {}
        for attribute in prim.GetAuthoredAttributes():
            match = NAME.fullmatch(attribute.GetName())
            if not match:
                continue
            with errors_of(f"{self.path}: {prim.GetPath()}"):
                check_known("attribute", LABELS if match["label"] else COLUMNS, match["key"])
            primvar, over = UsdGeom.Primvar(attribute), ""
            value = attribute.Get(self.time)
            if primvar:
                value, over = primvar.ComputeFlattened(self.time), primvar.GetInterpolation()
            if attribute.ValueMightBeTimeVarying():
                self.note(CHANGES, attribute.GetPath())
            if value is not None and not isinstance(value, str) and hasattr(value, "__len__"):
                values = np.array(value)
                value = values[0] if len(values) == 1 else Array(values, over)
                if match["key"] == "attributes":
                    value = ", ".join(map(str, values))
                elif len(values) != 1 and not any(map(prim.IsA, MANY)):
                    self.note("several values count only on meshes and instancers", prim.GetPath())
                    continue
            if hasattr(value, "resolvedPath"):  # an asset, such as the JSON of a fit
                value = value.resolvedPath or value.path
            if value is not None and not (match["label"] and str(value) in ("none", "")):
                said[match["key"]] = value
        if said.keys() & {"material", "emissivity"}:
            said = {key: value for key, value in said.items() if key not in LABELS}
        return said

    def mesh(self) -> Mesh:
        """The file as a Mesh."""
        places = list(self.places(self.time))
        seconds, frames, paths = self._paths(places)
        home = np.linalg.inv(frames[0])
        found = [(p, self.faces(replace(p, matrix=p.matrix @ home))) for p in places]
        of_face = np.repeat(np.arange(len(found)), [len(faces.sizes) for _, faces in found])
        pieces = [(place, faces) for place, faces in found if len(faces.sizes)]
        if not pieces:
            left = "; ".join(self.remarks()) or "export meshes"
            raise InputError(f"{self.path}: no mesh that is seen ({left})")
        parts, given, numbers, count = [], [], [], 0
        for group, (place, faces) in zip(self._groups([place for place, _ in pieces]), pieces):
            numbers.append(faces.number + len(parts))
            for number, (names, values) in enumerate(faces.said):
                mine = np.flatnonzero(faces.number == number) + count
                size = f"{len(mine)} face{'s' * (len(mine) != 1)}"
                first = f", from facet {mine[0]} on" if len(mine) else ""
                given.append((f"{self.path}: {place.path} ({size}{first})", values, group))
                parts.append(names)
            count += len(faces.sizes)
        numbers, labels = np.concatenate(numbers), [label_in(part) for part in parts]
        names = list(filter(None, labels))
        name = np.array([names.index(label) if label else -1 for label in labels])[numbers]
        offsets = np.cumsum([0, *(len(faces.points) for _, faces in pieces)])
        unit, axes = self._units()
        return Mesh(
            self.path,
            np.concatenate([faces.points for _, faces in pieces]),
            np.concatenate([faces.corners + first for first, (_, faces) in zip(offsets, pieces)]),
            np.concatenate([[0], *(faces.sizes for _, faces in pieces)]).cumsum(),
            np.arange(count),
            [(0, *label) for label in names],
            name,
            parts,
            numbers,
            given=given,
            kelvin=np.concatenate([faces.kelvin for _, faces in pieces]),
            unit=unit,
            axes=axes,
            remarks=self.remarks(),
            motion=Movement(seconds, frames, paths, of_face) if len(seconds) > 1 else None,
        )

    def _paths(self, places: list[Place]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times [s], frames of the model and paths of its meshes, see `Movement`."""
        still = np.zeros(1), np.eye(4)[None], np.tile(np.eye(4), (len(places), 1, 1, 1))
        if len(self.changes) < 2:
            return still
        first, last = self.usd.GetStartTimeCode(), self.usd.GetEndTimeCode()
        if not self.usd.HasAuthoredTimeCodeRange():
            first, last = min(self.changes), max(self.changes)
        if (last - first + len(self.changes)) * len(places) > MOST_MOMENTS:
            self.note("too many times to read a motion", "/")
            return still
        times = sorted({first, last, *np.arange(first, last), *self.changes})
        times = [time for time in times if first <= time <= last]
        common = os.path.commonprefix([place.where for place in places])
        prim = self.usd.GetPrimAtPath("/" + "/".join(common))
        frames, matrices = [], []
        for time in map(Usd.TimeCode, times):
            cache, now = UsdGeom.XformCache(time), list(self.places(time))
            if [place.where for place in now] != [place.where for place in places]:
                self.note("meshes appear or vanish with time; no motion is read", "/")
                return still
            frame = cache.GetLocalToWorldTransform(prim) if prim else Gf.Matrix4d(1)
            frames.append(np.array(frame.RemoveScaleShear()))
            matrices.append([place.matrix for place in now])
        frames, matrices = np.array(frames), np.array(matrices).swapaxes(0, 1)
        if np.ptp(frames, axis=0).max() < SMALL_CHANGE:  # the model stays where it is
            frames[:] = np.eye(4)
        in_model = matrices @ np.linalg.inv(frames)
        paths = np.linalg.pinv(in_model[:, :1]) @ in_model
        turns = paths[:, :, :3, :3]
        error = abs(turns @ turns.swapaxes(2, 3) - np.eye(3)).max(axis=(1, 2, 3))
        for k in np.flatnonzero(~(error < RIGID)):
            self.note("changes size or shape with time, and keeps the first one", places[k].path)
            paths[k] = np.eye(4)
        return (np.array(times) - times[0]) / self.usd.GetTimeCodesPerSecond(), frames, paths

    def _groups(self, places: list[Place]) -> list[str]:
        """Group of each place: its branch of the hierarchy, where that forks; "" for none."""
        depth = len(os.path.commonprefix([place.where for place in places]))
        names = [place.where[min(depth, len(place.where) - 1)] for place in places]
        if len(set(names)) > MOST_GROUPS:
            words = f"more than {MOST_GROUPS} branches, too many for groups; set thermal:group"
            self.note(words, "/" + "/".join(places[0].where[:depth]))
        if not 1 < len(set(names)) <= MOST_GROUPS:
            return [""] * len(places)
        plain, taken = {}, set(GROUPS.values())
        for name in dict.fromkeys(names):
            plain[name] = re.sub(r"[^A-Za-z0-9_-]", "_", name)
            while plain[name] in taken:
                plain[name] += "_"
            taken.add(plain[name])
        return [plain[name] for name in names]

    def faces(self, place: Place) -> MeshFaces:
        """The faces of a mesh in one of its places, without holes, with the backs of sheets."""
        mesh, where = UsdGeom.Mesh(place.prim), f"{self.path}: {place.path}"
        points = mesh.GetPointsAttr().Get(self.time) or Vt.Vec3fArray()
        sizes = mesh.GetFaceVertexCountsAttr().Get(self.time) or Vt.IntArray()
        corners = mesh.GetFaceVertexIndicesAttr().Get(self.time) or Vt.IntArray()
        is_valid, why = UsdGeom.Mesh.ValidateTopology(corners, sizes, len(points))
        if not is_valid or min(sizes, default=0) < 0:
            why = why or "a face has a negative number of corners"
            raise InputError(f"{where}: {why}")
        keep = np.array(sizes, int) >= 3
        if not keep.all():
            self.note("faces of fewer than 3 corners are left out", place.path)
        for hole in mesh.GetHoleIndicesAttr().Get(self.time) or ():
            keep[self._inside([hole], len(keep), f"{where}: holeIndices")] = False
        points = np.array(points, float).reshape(-1, 3)
        faces = MeshFaces(points, np.array(corners, int), np.array(sizes, int))
        if not (np.isfinite(points).all() and np.isfinite(place.matrix).all()):
            raise InputError(f"{where}: a coordinate is not finite")
        if not np.allclose(place.matrix[:, 3], (0, 0, 0, 1)):
            raise InputError(f"{where}: its transform is a projection; bake it into the points")
        faces = self._described(place, faces).kept(keep)
        if not keep.any():
            return faces
        is_left = mesh.GetOrientationAttr().Get(self.time) == UsdGeom.Tokens.leftHanded
        self._compare(mesh, place, faces.turned() if is_left else faces, keep)
        if mesh.GetPointsAttr().ValueMightBeTimeVarying():
            self.note(CHANGES, mesh.GetPointsAttr().GetPath())
        if UsdSkel.BindingAPI(place.prim).GetInheritedSkeleton():
            self.note("moved by a skeleton, and read in the rest pose", place.path)
        if is_left != (np.linalg.det(place.matrix[:3, :3]) < 0):
            faces = faces.turned()
        faces = replace(faces, points=points @ place.matrix[:3, :3] + place.matrix[3, :3])
        if mesh.GetDoubleSidedAttr().Get(self.time) and faces.is_open():
            self.note("doubleSided and open: each face gets a second face for its back", place.path)
            faces = faces.with_backs()
        return faces

    @staticmethod
    def _inside(indices, count: int, where: str) -> np.ndarray:
        """Indices of faces; raises InputError if one is none of `count`."""
        indices = np.array(indices if indices is not None else [], int)
        if not np.isin(indices, np.arange(count)).all():
            raise InputError(f"{where}: an index is none of the {count} faces")
        return indices

    def _compare(self, mesh, place: Place, faces: MeshFaces, keep: np.ndarray) -> None:
        """Note a subdivision that is left out, and normals that point against the winding."""
        scheme, vectors = mesh.GetSubdivisionSchemeAttr().Get(self.time), faces.vectors()
        if scheme not in (UsdGeom.Tokens.none, UsdGeom.Tokens.bilinear):
            area, smooth = np.linalg.norm(vectors, axis=1).sum() / 2, faces.smoothed_area()
            if abs(smooth - area) > SMALL * area:
                change = percent((smooth - area) / area)
                words = f"subdivision {scheme} is not applied; one step would change the area by"
                self.note(f"{words} {change}", place.path)
        primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
        normals = primvar.ComputeFlattened(self.time) if primvar else None
        over = primvar.GetInterpolation() if primvar else mesh.GetNormalsInterpolation()
        normals = normals or mesh.GetNormalsAttr().Get(self.time)
        if normals and keep.all():
            normals = faces.at_corners(Array(np.array(normals, float), over))
            if normals is not None and (vectors * faces.means(normals)).sum() < 0:
                self.note(
                    "normals point against the winding of the faces, which is used", place.path
                )

    def _described(self, place: Place, faces: MeshFaces) -> MeshFaces:
        """The faces of a mesh with what is said of them."""
        where, count = f"{self.path}: {place.path}", len(faces.sizes)
        own = {}
        for key, value in place.said[0].items():
            if isinstance(value, Array):
                at_corners = faces.at_corners(value)
                is_text = value.values.dtype.kind not in "fiu"
                if at_corners is None or (is_text and len(value.values) != count):
                    raise InputError(
                        f"{where}: {key} has {len(value.values)} values; the mesh has {count} "
                        f"faces and {len(faces.points)} points"
                    )
                own[key] = value.values if len(value.values) == count else faces.means(at_corners)
        kelvins = np.array(own.pop("kelvin", np.full(count, np.nan)), float)
        for number in (np.nanmin, np.nanmax) if np.isfinite(kelvins).any() else ():
            with errors_of(where):
                kelvin(repr(float(number(kelvins))))
        subsets = [
            subset
            for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(place.prim))
            if subset.GetElementTypeAttr().Get(self.time) == UsdGeom.Tokens.face
        ]
        inside = np.zeros((len(subsets), count), int)
        for row, subset in zip(inside, subsets):
            path = f"{self.path}: {subset.GetPath()}"
            row[self._inside(subset.GetIndicesAttr().Get(self.time), count, path)] = 1
        codes = [np.unique(values, return_inverse=True)[1] for values in own.values()]
        rows = np.stack([*inside, ~np.isnan(kelvins), *codes], axis=1)
        firsts, number = unique_rows(rows)
        said = []
        for face in firsts:
            mine = {key: values[face] for key, values in own.items()}
            mine |= {} if np.isnan(kelvins[face]) else {"kelvin": OF_FACES}
            with_face = [subset.GetPrim() for subset, row in zip(subsets, inside) if row[face]]
            said.append(self._surface(place, mine, with_face))
        return replace(faces, number=number, kelvin=kelvins, said=tuple(said))

    def _surface(self, place: Place, mine: dict, subsets: list) -> tuple:
        """The names of a face, and what is said of it: texts by the columns of a table of names.

        mine: what arrays of the mesh say of it. subsets: the GeomSubsets that hold it.
        """
        subsets = sorted(subsets, key=lambda subset: not _bound(subset))
        bound = next(filter(None, map(_bound, subsets)), None)
        bound = bound or UsdShade.MaterialBindingAPI(place.prim).ComputeBoundMaterial("full")[0]
        material = bound.GetPrim() if bound else None
        of_material = self._said(material) if material else {}
        values, outer = merged([mine, *map(self._said, subsets), of_material]), merged(place.said)
        own = outer.get("kelvin", OF_FACES)
        if own != OF_FACES and values.get("kelvin", own) not in (own, OF_FACES):
            self.note("its material's thermal:kelvin is used instead of its own", place.path)
        values = merged([values, outer])
        if "attributes" in values:
            self.note(f"attributes {values.pop('attributes')} are not used", place.path)
        guessed = guess_of(bound) if self.guess and not SURFACE & values.keys() else None
        if guessed is not None:
            values["emissivity"] = f"{guessed:.3g}"
            words = "emissivity is guessed from UsdPreviewSurface"
            self.note(f"{words} ({guessed:.2g} +- {GUESSED:g})", place.path)
        parent = place.prim.GetParent()
        names = [called(prim) if prim else "" for prim in (material, place.prim, parent)]
        return tuple(names), values


def _bound(prim):
    """The material that is bound to a prim itself."""
    return UsdShade.MaterialBindingAPI(prim).GetDirectBinding().GetMaterial()


def called(prim) -> str:
    """The name of a prim in Blender, for people, or in its path."""
    for name in BLENDER:
        if (attribute := prim.GetAttribute(name)) and attribute.Get():
            return attribute.Get()
    return prim.GetDisplayName() or ("" if prim.IsPseudoRoot() else prim.GetName())


def merged(levels) -> dict[str, str]:
    """Texts by key of what prims say, the nearest first."""
    values = {}
    for level in levels:
        has_surface = SURFACE & values.keys()
        for key, value in level.items():
            if not (isinstance(value, Array) or (key in SURFACE and has_surface)):
                values.setdefault(key, str(value))
    return values


# A first guess from UsdPreviewSurface, which is made for light: metals emit little, less so where
# they are smooth, and everything else emits much.
DIELECTRIC, SMOOTH_METAL, ROUGH_METAL, GUESSED = 0.9, 0.05, 0.3, 0.1


def guess_of(material) -> float | None:
    """Emissivity that metallic and roughness of a material let guess; None where it has none."""
    shader = material and material.ComputeSurfaceSource()[0]
    if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
        return None
    values = []
    for name, default in (("metallic", 0.0), ("roughness", 0.5)):
        sources = UsdShade.Utils.GetValueProducingAttributes(shader.GetInput(name))
        value = sources[0].Get() if sources else default
        if not isinstance(value, float):  # a texture
            return None
        values.append(value)
    metallic, roughness = values
    metal = SMOOTH_METAL + (ROUGH_METAL - SMOOTH_METAL) * roughness
    return metallic * metal + (1 - metallic) * DIELECTRIC


# Motion of a model with time: the path of a flight, and values of the motions of its groups
# ------------------------------------------------------------------------------------------

PATH, VALUES, SWEEP = "flight.csv", "motion.csv", "motion.toml"  # files that are written
ATTITUDE, SHIFT = ("yaw_deg", "pitch_deg", "roll_deg"), ("x_m", "y_m", "z_m")
HALF_TURN = 180.0  # degrees
SAME = 1e-6  # changes by rounding, in half turns and in sizes of the model
HEAD = """# What moves in the model, moment after moment (time_s of {file}): mi-lcair sweep {sweep}
[base]
scene = "scene.xml"
product = false

[conditions]
"""


@dataclass(frozen=True)
class Movement:
    """How the meshes of a file move, in its coordinates, for row vectors.

    seconds: (T,). frames: where the whole model is, (T, 4, 4). places: where each mesh is in the
    model, from its place at the first time, (P, T, 4, 4). of_face: the mesh of each face, (F,).
    """

    seconds: np.ndarray
    frames: np.ndarray
    places: np.ndarray
    of_face: np.ndarray

    def files(self, groups: np.ndarray, boxes: dict[str, np.ndarray], turn, unit: float):
        """Texts of files by name, and a remark on each group that they leave out.

        groups: that of each face, "" for faces that are not the model's, (F,). boxes: lowest and
        highest corner [m] of each group and, named "", of all, (2, 3). turn (3, 3), unit [m]: from
        the file's coordinates to those of the model.
        """
        size = np.ptp(boxes[""], axis=0).max()
        files, remarks, values = {}, [], {}
        rounding = SAME * np.array([size] * 3 + [HALF_TURN] * 3)
        whole = moved(self.frames, boxes[""].mean(axis=0), turn, unit)
        if varies(whole, rounding).any():
            whole[:, 3:] = np.unwrap(whole[:, 3:], period=360, axis=0)
            rows = {"time_s": self.seconds} | dict(zip((*SHIFT, *ATTITUDE), whole.T))
            files[PATH] = csv_of(rows)
            remarks.append(f"the model moves with time: {PATH} is a path for [flight]")
        for group in sorted(set(groups) - {""}):
            middle = boxes[group].mean(axis=0)
            places = self.places[np.unique(self.of_face[groups == group])]
            own = np.array([moved(place, middle, turn, unit) for place in places])
            own[:, :, :3] -= middle
            if any(varies(other - own[0], rounding).any() for other in own):
                remarks.append(f"parts of group {group} move apart, and keep the first pose")
                continue
            for name, column, is_used in zip(
                (*SHIFT, *ATTITUDE), own[0].T, varies(own[0], rounding)
            ):
                values |= {f"{group}.{name}": column} if is_used else {}
        if values:
            files[VALUES] = csv_of({"time_s": self.seconds} | values)
            files[SWEEP] = HEAD.format(file=VALUES, sweep=SWEEP) + "".join(
                f'"{name}" = {{ csv = "{VALUES}", column = "{name}" }}\n' for name in values
            )
            moving = ", ".join(dict.fromkeys(name.rpartition(".")[0] for name in values))
            remarks.append(f"groups move with time ({moving}): {SWEEP} is a sweep over {VALUES}")
        return files, remarks


def moved(matrices: np.ndarray, middle: np.ndarray, turn: np.ndarray, unit: float) -> np.ndarray:
    """Places of a point [m] and attitude [deg] of what matrices (T, 4, 4) move, (T, 6)."""
    turns = turn @ matrices[:, :3, :3].swapaxes(1, 2) @ turn.T
    places = turns @ middle + unit * matrices[:, 3, :3] @ turn.T
    # Attitudes are turns about z, -y and x, roll first
    with catch_warnings():
        simplefilter("ignore")  # straight up, one of yaw and roll is free
        angles = Rotation.from_matrix(turns).as_euler("ZYX", degrees=True) * (1, -1, 1)
    return np.concatenate([places, angles], axis=1)


def varies(rows: np.ndarray, rounding: np.ndarray) -> np.ndarray:
    """Which columns (6,) of `moved` change by more than rounding (6,)."""
    return np.ptp(rows, axis=0) > rounding


def csv_of(columns: dict[str, np.ndarray]) -> str:
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values())]
    return "\n".join([",".join(columns), *rows, ""])
