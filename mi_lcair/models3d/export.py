"""Writes a facet model: meshes, model.xml for inclusion in scenes, scene.xml for rendering."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from mi_lcair.errors import InputError, option
from mi_lcair.files import LARGEST, filling, parse_json, parse_toml, read_bytes, read_text
from mi_lcair.models3d.model import Model
from mi_lcair.models3d.modellers.naming import GROUPS, TYPES
from mi_lcair.physics.materials import is_json
from mi_lcair.toml_table import is_file

if TYPE_CHECKING:
    from mi_lcair.physics.surroundings import Words


# Record of what an import wrote, from which the next import sees which files were edited
# ---------------------------------------------------------------------------------------

RECORD = ".import.json"  # file with the checksum of each other file, by its name


def record_of(contents: dict[str, bytes]) -> bytes:
    """Content of the RECORD of files, by name."""
    checksums = {name: _checksum(contents[name]) for name in sorted(contents)}
    return f"{json.dumps(checksums, indent=2)}\n".encode()


def check_unedited(folder: Path, contents: dict[str, bytes]) -> None:
    """Raise InputError if files in a folder would be lost that an import has not written, or that
    were edited since.

    contents: what is to be written, by file name. A file with just this content is no loss.
    """
    record, known = folder / RECORD, {}
    if record.is_file():
        known = parse_json(read_text(record), str(record))
    known = known if isinstance(known, dict) else {}
    edited = [
        str(folder / name)
        for name, content in sorted(contents.items())
        if (folder / name).is_file()
        and _checksum(read_bytes(folder / name)) not in (known.get(name), _checksum(content))
    ]
    if edited:
        raise InputError(
            f"{', '.join(edited)}: {'was' if len(edited) == 1 else 'were'} written by somebody "
            "else or edited since the import; move away what you need, name another folder, or "
            f"give {option('overwrite', True)}"
        )


def _checksum(content: bytes) -> str:
    return sha256(content).hexdigest()[:16]


# The scene files of a facet model: the fragment that places it, and a scene that looks at it
# -------------------------------------------------------------------------------------------
# Model axes: x forward, y left, z up. Yaw turns the nose to the left, pitch lifts it, roll lowers
# the right wing.

TURN = """        <transform name="to_world"> <rotate x="1" angle="$roll_deg"/> \
<rotate y="-1" angle="$pitch_deg"/> <rotate z="1" angle="$yaw_deg"/> </transform>
"""
TEMPERATURES = (
    '<texture type="mesh_attribute" name="temperature"> '
    '<string name="name" value="face_temperature"/> </texture>'
)
AROUND = """
    <default name="{name}" value={value}/>   <!-- {what} -->"""
# $-parameters of surroundings: name, meaning
WORDS = {
    "sky": "clear, overcast, a temperature in K, a bundled sky or a CSV of spectra",
    "ground_temperature": "of the ground, K",
    "ground_material": "emissivity of the ground, or a material that has it",
    "sun_elevation_deg": "of the sun",
    "sun_azimuth_deg": "of the sun: 0 is +x, the nose, and 90 is +y, the left side",
    "atmosphere": "of sky and sun: us_standard or midlat_summer",
}
# Parameters that properties of the emitter `sun` have in scenes with a sky
OF_SUN = {
    "elevation_deg": "sun_elevation_deg",
    "azimuth_deg": "sun_azimuth_deg",
    "air": "atmosphere",
}
SKY = """
    <default name="sky" value={sky}/>   \
<!-- table of the sky's spectral radiance: a bundled name or a CSV -->"""
MARGIN = 1.02  # ratio of half the sensor's window to the radius of the sphere around the model
# Ratio of the sensor's distance to half its window. The sensor is outside the model, but inside a
# room around it.
DISTANCE = 1.1


@cache
def template(name: str) -> str:
    """The text of a template, with fields in braces."""
    return (Path(__file__).parent / "templates" / f"{name}.xml").read_text(encoding="utf-8")


def fragment(name: str, labels: dict, short: dict, materials: str | None, sky: str | None) -> str:
    """The text of model.xml.

    labels: stem of a mesh's file -> Label. short: material -> its name in ids and the value of the
    property `material`. materials, sky: file names of the tables of materials and of the sky's
    spectra.
    """
    turns = any(label.type == "f" for label in labels.values())
    defaults = (
        {"band": "LWIR", "allow_band": "false", "lobe": "brdf"}
        | ({"yaw_deg": 0, "pitch_deg": 0, "roll_deg": 0} if turns else {})
        | ({"sky": sky} if sky else {})
    )
    table = f'        <string name="materials" value={quoteattr(materials or "")}/>\n'
    ids = {material: quoteattr(f"{name}_{stem}") for material, (stem, _) in short.items()}
    lines = [f'    <default name="{k}" value={quoteattr(str(v))}/>' for k, v in defaults.items()]
    materials_used = [
        template("material").format(
            id=ids[material],
            material=quoteattr(short[material][1]),
            table=table if materials else "",
        )
        for material in dict.fromkeys(label.material for label in labels.values())
    ]
    shapes = [
        template("shape").format(
            name=name,
            stem=stem,
            turn=TURN if label.type == "f" else "",
            material=ids[label.material],
            source=_source(label, sky),
            group=label.group,
            type=TYPES[label.type],
        )
        for stem, label in labels.items()
    ]
    meshes = "\n".join([*materials_used, *shapes]).rstrip()
    return template("model").format(name=name, defaults="\n".join(lines), meshes=meshes)


def _source(label, sky):
    """What a mesh radiates: the temperatures of its facets, or a spectrum of the sky."""
    if not sky or label.elevation_deg is None:
        return TEMPERATURES
    return (
        '<string name="spectrum" value="$sky"/> '
        f'<float name="elevation_deg" value="{label.elevation_deg:g}"/>'
    )


def scene(name: str, centre, radius: float, sky: str | None, around: list[dict]) -> str:
    """The text of scene.xml: an orthographic sensor around the model. centre (3,) and radius of the
    model's sphere [m]. around: properties of the emitters sky and sun, see `Words.emitters`.
    """
    window = MARGIN * radius
    given = {key: value for emitter in around[:1] for key, value in emitter.items() if key in WORDS}
    defaults = "".join(
        AROUND.format(name=key, value=quoteattr(str(value)), what=WORDS[key])
        for key, value in given.items()
    )
    if sky:
        defaults += SKY.format(sky=quoteattr(sky))
    return template("scene").format(
        name=name,
        centre=centre,
        window=window,
        width=2 * window,
        near_clip=0.01 * window,
        far_clip=max(1e4, 1e3 * window),
        distance=DISTANCE * window,
        sky=defaults,
        emitters="".join(_emitter(emitter) for emitter in around),
    )


def _emitter(properties):
    """The element of an emitter whose properties in WORDS are $-parameters, as is the band."""
    lines = []
    for key, value in properties.items():
        if key != "type":
            kind = "float" if isinstance(value, float) else "string"
            name = OF_SUN.get(key, key)
            lines.append(f'        <{kind} name="{key}" value="${name}"/>')
    return "\n".join([f'    <emitter type="{properties["type"]}">', *lines, "    </emitter>\n"])


def export(
    model: Model,
    folder: str | Path,
    materials: str | Path | None = None,
    sky: str | Path | None = None,
    overwrite: bool = False,
    also: dict[str, Callable[[], bytes]] | None = None,
    around: "Words | None" = None,
) -> list[Path]:
    """Write a model into a folder and return the paths of the files.

    The files are model.xml, which places the meshes in a scene; scene.xml, a scene that includes
    model.xml; and one binary PLY for each combination of facet type, material, group and elevation.
    A PLY has the face attributes `temperature` [K] and `facet`, the number in the model. The tables
    `materials` and `sky` and the JSON files of fits that are materials are copied. Other files in
    the folder are not changed. The file RECORD holds the checksums of all others, which reveal
    later edits.

    Parameters
    ----------
    model : Model
    folder : str or Path
        It is created if it does not exist.
    materials : str, Path or None
        File with the user's materials: TOML, or the JSON of a fit or of an inversion.
    sky : str, Path or None
        Table with the spectra of sky facets that have an elevation_deg: a bundled name or a file.
    overwrite : bool
        Replace files that were edited since they were written, or that something else wrote.
    also : dict of str to callable or None
        Functions that give the content of further files by name, such as a picture.
    around : Words or None
        Surroundings of the model. The scene gets their emitters sky and sun.

    Raises
    ------
    InputError
        If a file cannot be used or written, or if it was edited since it was written and
        `overwrite` is false. Nothing is written then.
    """
    folder = Path(folder)
    # A comment in XML must not contain two hyphens in a row
    name = re.sub("--+", "-", _plain(folder.resolve().name)) or "model"
    sources = {}  # name in the folder: file to copy
    table = None  # of the user's materials
    if materials:
        sources[Path(materials).name if is_json(materials) else "materials.toml"] = materials
        table = None if is_json(materials) else _with_files(materials, sources)
        materials = next(iter(sources))
    short = _short_names(dict.fromkeys(label.material for label in model.labels), sources)
    if sky:
        from mi_lcair.physics.sky import check_brightness, sky_names, spectrum  # loads clear air

        spectrum(sky, 45.0)  # raises InputError for a table without spectra by elevation
        sky = str(sky)
        if sky not in sky_names():
            check_brightness(sky)
            _add(sources, sky)
            sky = Path(sky).name
        if not any(label.elevation_deg is not None for label in model.labels):
            raise InputError(
                f"sky {sky}: no sky facet says at which elevation it lies; label them such as "
                "s*blackbody*288*elevation_deg=4.5*"
            )
    emitters = [] if around is None else _emitters(model, around, sources)
    parts = _parts(model, short)
    contents = {f"{name}_{stem}.ply": _ply(model, facets) for stem, (_, facets) in parts.items()}
    contents |= {
        copy: read_bytes(source, largest=LARGEST)
        for copy, source in sources.items()
        if not _is_same(folder / copy, source)
    }
    if table is not None and materials in contents:
        contents[materials] = table.encode()
    contents |= {file: text.encode() for file, text in model.files.items()}
    contents |= {file: content() for file, content in (also or {}).items()}
    labels = {stem: label for stem, (label, _) in parts.items()}
    contents["model.xml"] = fragment(name, labels, short, materials, sky).encode()
    contents["scene.xml"] = scene(name, *_bounds(model), sky, emitters).encode()
    if not overwrite:
        check_unedited(folder, contents)
    with filling(folder) as partial:
        for file, content in (contents | {RECORD: record_of(contents)}).items():
            (partial / file).write_bytes(content)
    return [folder / file for file in sorted(contents)]


def _emitters(model, around, sources):
    """Properties of the emitters around a model; files of sky and sun are added to `sources`.

    Raises InputError for a model with sky facets, if the surroundings have a sky, too.
    """
    if around.sky is not None and any(label.type == "s" for label in model.labels):
        raise InputError(
            f"sky {around.sky}: the model already has sky facets; remove them, or leave the sky out"
        )
    emitters = around.emitters("$band")
    if around.sky_file is not None:
        _add(sources, around.sky_file)
        emitters[0]["sky"] = Path(around.sky_file).name
    if around.sun_file is not None:
        _add(sources, around.sun_file)
        emitters[0]["sun_file"] = emitters[1]["air"] = Path(around.sun_file).name
    return emitters


def _short_names(materials, sources):
    """Name for ids and value of the property `material` of each material.

    The JSON files of fits are added to `sources`. Their short name is that of the file.
    """
    short = {}
    for material in materials:
        if is_json(material):
            _add(sources, material)
            stem = Path(material).stem
            taken = stem in materials or stem in {short_name for short_name, _ in short.values()}
            short[material] = (f"{stem}_json" if taken else stem), Path(material).name
        else:
            short[material] = material, material
    return short


def _with_files(materials, sources) -> str:
    """The text of a table of materials, whose spectra and fits are added to `sources`."""
    text = read_text(materials, "materials")
    values, folder = [parse_toml(text, f"materials '{materials}'")], Path(materials).parent
    for value in values:
        if isinstance(value, dict):
            values += value.values()
        elif isinstance(value, str) and is_file(folder, value):
            _add(sources, folder / value)
            for quote in "\"'":
                text = text.replace(f"{quote}{value}{quote}", f"{quote}{Path(value).name}{quote}")
    return text


def _add(sources, path):
    """Add a file to those that are copied, under its own name."""
    name = Path(path).name
    if not _is_same(sources.setdefault(name, path), path):
        raise InputError(
            f"{path}: the file {sources[name]} has the same name, and both are copied into one "
            "folder; rename one of them"
        )


def _parts(model, short):
    """Label without a temperature and mask (F,) of the facets of each mesh, by the file's stem."""
    shared = [replace(label, temperature=None) for label in model.labels]
    parts = {}
    for label in dict.fromkeys(shared):
        stem = f"{label.type}_{_plain(short[label.material][0])}"
        if label.group != GROUPS[label.type]:
            stem += f"_{label.group}"
        if label.elevation_deg is not None:
            stem += f"_{label.elevation_deg:g}deg"
        while stem in parts:  # such as material a_b beside material a of group b
            stem += "_"
        parts[stem] = label, np.array([other == label for other in shared])[model.label]
    return parts


def _ply(model, facets):
    """Content of the binary PLY of the facets in a mask (F,), with temperatures and numbers."""
    mine = facets[model.triangle_facet]
    owner = model.triangle_facet[mine]
    triangles = model.triangles[mine]
    used = np.zeros(len(model.vertices), bool)
    used[triangles] = True
    number = np.cumsum(used) - 1
    faces = np.empty(
        len(owner),
        [("count", "u1"), ("corners", "<i4", 3), ("temperature", "<f4"), ("facet", "<f4")],
    )
    faces["count"] = 3
    faces["corners"] = number[triangles]
    faces["temperature"], faces["facet"] = model.temperature[owner], owner
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment metres, kelvin\n"
        f"element vertex {np.count_nonzero(used)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
        "property float temperature_0\nproperty float facet_0\nend_header\n"
    )
    return header.encode() + model.vertices[used].astype("<f4").tobytes() + faces.tobytes()


def _bounds(model):
    """Centre (3,) and radius [m] of a sphere around the model facets, or around all facets."""
    of_model = model.facets_of("f")[model.triangle_facet]
    points = model.vertices[
        np.unique(model.triangles[of_model] if of_model.any() else model.triangles)
    ]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, np.linalg.norm(points - centre, axis=1).max()


def _is_same(path, other):
    path, other = Path(path), Path(other)
    return path.exists() and other.exists() and path.samefile(other)


def _plain(name):
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)
