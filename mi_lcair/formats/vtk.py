"""Facets as VTK's XML files, which ParaView, VTK, pyvista and (.vtu) meshio read.

The file is written here: meshio has no .vtp and no texts, and pyvista would bring all of VTK.
Numbers are stored in full, in base64.
"""

import base64
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from mi_lcair.errors import escaped
from mi_lcair.files import check_suffix, replacing
from mi_lcair.formats import VTK

TRIANGLE, POLYGON, QUAD = 5, 7, 9  # VTK's numbers of cell types
TYPES = {"i": "Int64", "u": "Int64", "b": "Int64", "f": "Float64"}  # by NumPy's kind of type


def write_facets(
    path: str | Path, vertices: np.ndarray, faces, columns: dict[str, np.ndarray]
) -> None:
    """Write polygons with columns of values as a .vtp or .vtu file, completely or not at all.

    A column of texts such as `group` becomes two arrays: the texts themselves, and `group_number`,
    the number of each text in their alphabetical order, by which ParaView colours. A .vtu file has
    the numbers only, because meshio reads no texts; a comment in it lists what they stand for.

    Parameters
    ----------
    path : path-like
        File to write; .vtp is VTK's PolyData, .vtu its UnstructuredGrid.
    vertices : ndarray, shape (n, 3)
        Corners of the polygons [m], stored in Float64.
    faces : sequence of sequences of int
        Corners of each polygon, as rows of `vertices`, in their order around it.
    columns : dict of str to array-like, shape (len(faces),)
        Numbers or texts of each polygon, by name with the unit.

    Raises
    ------
    InputError
        If the suffix is neither of both, or if the file cannot be written.
    """
    suffix = check_suffix(path, VTK)
    texts, numbers = {}, {}
    for name, values in columns.items():
        values = np.asarray(values)
        if values.dtype.kind in TYPES:
            numbers[name] = values
        else:
            texts[name] = values = values.astype(str)
            numbers[f"{name}_number"] = np.unique(values, return_inverse=True)[1]
    cells = {
        "connectivity": np.concatenate([np.zeros(0, np.int64), *map(np.asarray, faces)]),
        "offsets": np.cumsum([len(face) for face in faces], dtype=np.int64),
    }
    is_grid = suffix == ".vtu"
    kind, element = ("UnstructuredGrid", "Cells") if is_grid else ("PolyData", "Polys")
    if is_grid:
        cells["types"] = np.array([{3: TRIANGLE, 4: QUAD}.get(len(f), POLYGON) for f in faces])
    count = f'NumberOf{element}="{len(faces)}"'
    lines = [
        '<?xml version="1.0"?>',
        *(_comment(name, values) for name, values in texts.items() if is_grid),
        f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        f'<{kind}><Piece NumberOfPoints="{len(vertices)}" {count}>',
        "<Points>",
        _array("Points", np.asarray(vertices, np.float64).reshape(-1, 3)),
        "</Points>",
        f"<{element}>",
        *(_array(name, values.astype(np.int64)) for name, values in cells.items()),
        f"</{element}>",
        "<CellData>",
        *(_array(name, values) for name, values in numbers.items()),
        *(_strings(name, values) for name, values in texts.items() if not is_grid),
        "</CellData>",
        f"</Piece></{kind}></VTKFile>",
        "",
    ]
    with replacing(path) as partial:
        partial.write_text("\n".join(lines), encoding="utf-8")


def _array(name: str, values: np.ndarray) -> str:
    """Element of an array of numbers, (n,) or (n, components)."""
    kind = TYPES[values.dtype.kind]
    data = values.astype(f"<{kind[0].lower()}8").tobytes()
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    header = np.uint64(len(data)).astype("<u8").tobytes()
    return (
        f'<DataArray type="{kind}" Name={_attribute(name)}{components} format="binary">'
        f"{base64.b64encode(header + data).decode()}</DataArray>"
    )


def _strings(name: str, values: np.ndarray) -> str:
    """Element of an array of texts: the bytes of all, with a zero after each."""
    codes = b"".join(text.encode() + b"\0" for text in values.tolist())
    return (
        f'<Array type="String" Name={_attribute(name)} format="ascii">'
        f"{' '.join(map(str, codes))}</Array>"
    )


def _attribute(text: str) -> str:
    return quoteattr(escaped(text))


def _comment(name: str, values: np.ndarray) -> str:
    """XML comment that lists the numbers of a column of texts."""
    listed = ", ".join(f"{k} = {text}" for k, text in enumerate(np.unique(values)))
    # Two hyphens would end the comment.
    return f"<!-- {escape(escaped(f'{name}_number: {listed}')).replace('--', '- -')} -->"
