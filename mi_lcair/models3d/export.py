"""Writes a facet model: meshes, model.xml for inclusion in scenes, scene.xml for rendering."""

import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import LARGEST, filling, read_bytes
from mi_lcair.models3d.label import GROUPS
from mi_lcair.models3d.model import Model
from mi_lcair.models3d.scene_xml import fragment, scene
from mi_lcair.physics.spectrum import sky_names, spectrum


def export(
    model: Model,
    folder: str | Path,
    materials: str | Path | None = None,
    sky: str | Path | None = None,
) -> list[Path]:
    """Write a model into a folder and return the paths of the files.

    The files are model.xml, which places the meshes in a scene; scene.xml, a scene that includes
    model.xml; and one binary PLY for each combination of facet type, material, group and elevation.
    A PLY has the face attributes `temperature` [K] and `facet`, the number in the model. The tables
    `materials` and `sky` are copied. Other files in the folder are not changed.

    Parameters
    ----------
    model : Model
    folder : str or Path
        It is created if it does not exist.
    materials : str, Path or None
        TOML file with the user's materials.
    sky : str, Path or None
        Table with the spectra of sky facets that have an elevation_deg: a bundled name or a file.

    Raises
    ------
    InputError
        If a file cannot be used or written, or if model.xml or scene.xml was edited since it was
        written. Nothing is written then.
    """
    folder = Path(folder)
    for file in ("model.xml", "scene.xml"):
        check_own(folder / file)
    # A comment in XML must not contain two hyphens in a row
    name = re.sub("--+", "-", _plain(folder.resolve().name)) or "model"
    copies = {"materials.toml": _content(materials)} if materials else {}
    if sky:
        spectrum(sky, 45.0)  # raises InputError for a table without spectra by elevation
        sky = str(sky)
        if sky not in sky_names():
            copies[Path(sky).name] = _content(sky)
            sky = Path(sky).name
        if not any(label.elevation_deg is not None for label in model.labels):
            raise InputError(
                f"sky {sky}: no sky facet says at which elevation it lies; label them such as "
                "s*blackbody*288*elevation_deg=4.5*"
            )
    parts = _parts(model)
    with filling(folder) as partial:
        for stem, (_, facets) in parts.items():
            (partial / f"{name}_{stem}.ply").write_bytes(_ply(model, facets))
        for copy, content in copies.items():
            (partial / copy).write_bytes(content)
        labels = {stem: label for stem, (label, _) in parts.items()}
        (partial / "model.xml").write_text(
            signed(fragment(name, labels, bool(materials), sky)), encoding="utf-8"
        )
        (partial / "scene.xml").write_text(
            signed(scene(name, *_bounds(model), sky)), encoding="utf-8"
        )
        files = sorted(file.name for file in partial.iterdir())
    return [folder / file for file in files]


def signed(text: str) -> str:
    """The text of a scene file with its checksum in the last line, which reveals later edits."""
    checksum = sha256(text.encode()).hexdigest()[:16]
    return f"{text}<!-- written by mi-lcair import, checksum {checksum} -->\n"


def check_own(path: Path) -> None:
    """Raise InputError for a file that `export` has not written, or that was edited since."""
    if not path.is_file():
        return
    text = path.read_text(encoding="utf-8", errors="replace")
    head, line, _ = text.rpartition("<!-- written by mi-lcair import")
    if not line or signed(head) != text:
        raise InputError(
            f"{path}: was written by somebody else or edited since it was imported; move it away, "
            "or name another folder"
        )


def _parts(model):
    """Label without a temperature and mask (F,) of the facets of each mesh, by the file's stem."""
    shared = [replace(label, temperature=None) for label in model.labels]
    parts = {}
    for label in dict.fromkeys(shared):
        stem = f"{label.type}_{_plain(label.material)}"
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
    chosen = model.facets_of("f")[model.triangle_facet]
    points = model.vertices[np.unique(model.triangles[chosen] if chosen.any() else model.triangles)]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, np.linalg.norm(points - centre, axis=1).max()


def _content(path):
    return read_bytes(path, largest=LARGEST)


def _plain(name):
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)
