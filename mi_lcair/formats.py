"""Files that other programs read, written from plain arrays: CSV, netCDF, VTK, USD and TIFF."""

import base64
import csv
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from mi_lcair.errors import InputError, check_known, escaped, option
from mi_lcair.extras import optional
from mi_lcair.files import FACET_FILES, USD, check_suffix, replacing, together, write_bytes
from mi_lcair.sections import UNITS, quantity_of, unit_of
from mi_lcair.table import read_table, safe_cell

# Channels of radiance images: what they hold, in which unit, and where they have no value
# ----------------------------------------------------------------------------------------

RADIANCE = "W m-2 sr-1"
SPECTRAL = "S0"  # beginning of the channels of a spectral image
# Quantity and UDUNITS unit by the beginning of a channel's name. Other channels are radiances.
CHANNELS = {
    SPECTRAL: ("spectral radiance", f"{RADIANCE} um-1"),
    "temperature": ("brightness temperature", "K"),
    "range": ("range", "m"),
    "stderr": ("standard error of radiance", RADIANCE),
    f"stderr.{SPECTRAL}": ("standard error of spectral radiance", f"{RADIANCE} um-1"),
    "stderr.d": ("standard error of derivative", f"{RADIANCE} per unit"),
    "mean_temperature": ("apparent temperature without noise", "K"),
    "stderr_K": ("standard error of the rendering", "K"),
    "noise_K": ("noise of the camera", "K"),
    "speckle": ("whether the rendering's error is above the camera's noise", ""),
    "spp": ("samples of a pixel", ""),
    "apparent": ("radiance at the aperture", RADIANCE),
    "electrons": ("electrons", ""),
    "electrons.background": ("electrons without the target", ""),
    "power": ("power on a pixel", "W"),
    "power.background": ("power on a pixel without the target", "W"),
    "counts": ("counts", ""),
    "sigma_K": ("standard uncertainty of temperature", "K"),
    "sigma": ("standard uncertainty of radiance", RADIANCE),
    "d": ("derivative of radiance", f"{RADIANCE} per unit"),
    "IndexFacet": ("number of the facet", ""),
    "IndexGroup": ("number of the group", ""),
    "IndexMA": ("number of the material", ""),
    "IndexOB": ("number of the instance", ""),
    "Depth": ("depth along the optical axis", "m"),
    "Normal": ("coordinate of the normal", ""),
    "true_temperature": ("true temperature", "K"),
    "emissivity": ("emissivity along the view", ""),
    "mask": ("share of the pixel", ""),
    "transmittance": ("transmittance of the air", ""),
    "apparent_temperature": ("apparent temperature", "K"),
    "stderr.apparent_temperature": ("standard error of apparent temperature", "K"),
}
OF_PARTS = ("bounce", "closure", "group.", "seen.")  # channels of a render with `parts`
EMPTY_AT_0 = (
    "temperature",
    "range",
    "Depth",
    "true_temperature",
    "apparent_temperature",
)  # channels in which 0 means that nothing was hit
ENDS = {unit: end for end, unit in UNITS.items()}  # ends of columns' names by unit


def spectral_channel(wavelength_um: float) -> str:
    """Channel of a spectral image at a wavelength [um], such as "S0.8075,000000nm".

    The name is that of A. Fichet, R. Pacanowski and A. Wilkie, An OpenEXR layout for spectral
    images, JCGT 10(3), 2021: Stokes component 0, and a comma as the decimal mark.
    """
    return f"{SPECTRAL}.{1000 * wavelength_um:.6f}nm".replace(".", ",").replace(",", ".", 1)


def wavelengths_of(channels) -> dict[str, float]:
    """The channels of a spectral image and their wavelengths [um], by rising wavelength."""
    known = {
        name: float(match[1].replace(",", ".")) / 1000
        for name in channels
        if (match := re.fullmatch(rf"{SPECTRAL}\.([0-9]+,[0-9]+)nm", name))
    }
    return dict(sorted(known.items(), key=lambda item: item[1]))


def check_channels(kind: str, known, *names) -> None:
    """Raise InputError for the first name that is no known channel of an image; see `check_known`.

    The error says what records it if the image was rendered without its parts.
    """
    for name in names:
        if name.startswith(OF_PARTS) and not any(other.startswith(OF_PARTS) for other in known):
            made = f"{option('parts', True)} of render makes it"
            raise InputError(f"unknown {kind} '{name}'; {made}")
        check_known(kind, known, name)


def quantity_of_channel(channel: str) -> tuple[str, str]:
    """Quantity of a channel of a radiance image in words, and its unit as UDUNITS writes it."""
    first, *rest = channel.split(".")
    radiance = ("radiance", RADIANCE)
    return CHANNELS.get(".".join([first, *rest[:1]]), CHANNELS.get(first, radiance))


def column_of(channel: str) -> str:
    """Name of a channel as a column of a table, which ends in the unit if that has an end."""
    name = channel.removesuffix("Y").removesuffix(".") or "radiance"
    if name.startswith("stderr"):
        name = name.replace("stderr", "standard_error", 1)
    end = ENDS.get(quantity_of_channel(channel)[1], "")
    return name.removesuffix(end) + end


def pixel_axes(shape, window_m=None) -> dict[str, tuple[str, np.ndarray]]:
    """Numbers of pixels, and their centres [m] in a window, by name: each with its dimension.

    row and column begin with 0 at the upper left. x_m and y_m begin in the middle of the window;
    x is to the right and y upward. shape: (H, W).
    """
    axes = {name: (name, np.arange(count)) for name, count in zip(("row", "column"), shape)}
    if window_m is not None:
        down, across = ((np.arange(count) + 0.5) / count for count in shape)
        axes["x_m"] = "column", (across - 0.5) * window_m[0]
        axes["y_m"] = "row", (0.5 - down) * window_m[1]
    return axes


def has_value(channel: str, values: np.ndarray) -> np.ndarray:
    """Which pixels of a channel have a value. NaN and infinite values are none."""
    known = np.isfinite(values)
    return known & (values != 0) if channel.split(".")[0] in EMPTY_AT_0 else known


def or_nan(channel: str, values: np.ndarray) -> np.ndarray:
    """The values of a channel, with NaN where it has no value."""
    return np.where(has_value(channel, values), values, np.nan)


# Plain CSV files: one header line, one row a line, nothing else
# --------------------------------------------------------------

DIGITS = 9  # significant digits of a number; they keep every Float32


def write_csv(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns of equal length as a CSV file, completely or not at all.

    `pandas.read_csv(path)` gives them back without options. Separators are commas, the decimal mark
    is a point, a missing value (NaN) is an empty cell.

    Parameters
    ----------
    path : path-like
        File to write.
    columns : dict of str to array-like
        Numbers or texts by name of column. The unit is the end of the name, such as intensity_W_sr.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(map(safe_cell, columns))
        for row in zip(*columns.values(), strict=True):
            writer.writerow(map(cell, row))


def cell(value) -> str:
    """A value as the file holds it.

    Texts come from the user's files and are made safe for spreadsheets.
    """
    if isinstance(value, str):
        return safe_cell(value)
    if isinstance(value, (bool, np.bool_)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else f"{value:.{DIGITS}g}"
    return str(value)


# Spectral images as ENVI files: a text header, and the numbers of one band after another
# ---------------------------------------------------------------------------------------


def write_envi(
    path: str | Path, cube: np.ndarray, wavelengths_um: np.ndarray, description: str
) -> None:
    """Write FILE.hdr and FILE.img, both or none.

    Parameters
    ----------
    path : path-like
        The header, FILE.hdr.
    cube : ndarray, shape (wavelengths, H, W)
        Stored as float32, band sequential, with the lowest byte first.
    wavelengths_um : ndarray, shape (wavelengths,)
        Even wavelengths. Their distance is the full width at half maximum of the channels.
    description : str
        What the values are, and their unit.
    """
    bands, lines, samples = cube.shape
    wavelengths_um = np.asarray(wavelengths_um, dtype=float)
    listed = ", ".join(f"{x:.9g}" for x in wavelengths_um)
    widths = ", ".join([f"{wavelengths_um[1] - wavelengths_um[0]:.9g}"] * bands)
    entries = {
        "description": f"{{{description}}}",
        "samples": samples,
        "lines": lines,
        "bands": bands,
        "header offset": 0,
        "file type": "ENVI Standard",
        "data type": 4,
        "interleave": "bsq",
        "byte order": 0,
        "wavelength units": "Micrometers",
        "wavelength": f"{{{listed}}}",
        "fwhm": f"{{{widths}}}",
    }
    text = "".join(f"{name} = {value}\n" for name, value in entries.items())
    with together():
        write_bytes(Path(path), f"ENVI\n{text}".encode())
        write_bytes(Path(path).with_suffix(".img"), cube.astype("<f4").tobytes())


# netCDF files of labelled arrays, and the labelled arrays of a table
# -------------------------------------------------------------------
# The files are netCDF-3 with 64-bit offsets, which SciPy writes and every netCDF reader reads. The
# netCDF-4 engines would need HDF5 beside it.

KEYS = ("wavelength_um", "facet", "time_s")  # columns that number the rows of a table
ASPECT = ("elevation_deg", "azimuth_deg")  # axes of a trend
LARGEST_WHOLE = 2**31 - 1  # largest integer of netCDF-3


def write_netcdf(path, dataset) -> None:
    """Write an xarray Dataset as a netCDF file, completely or not at all.

    Integers beyond 31 bits become Float64. A slash in a name, which netCDF does not allow, becomes
    an underscore.

    Parameters
    ----------
    path : path-like
        File to write.
    dataset : xarray.Dataset
        Variables with their units in the attribute `units`, see `table` and `grid`.

    Raises
    ------
    InputError
        If the file cannot be written, if two names differ only by the characters that are replaced,
        or if xarray is not installed.
    """
    optional("xarray", "a netCDF file")
    names = {name: str(name).strip().replace("/", "_") for name in dataset.variables}
    if len(set(names.values())) < len(names):
        raise InputError(
            f"output '{path}': two columns have the same name in netCDF, where / becomes _; "
            "rename a group, or write a CSV"
        )
    renamed = dataset.rename({name: new for name, new in names.items() if name != new})
    stored = renamed.map(_storable).assign_attrs(renamed.attrs)
    stored = stored.assign_coords(
        {name: _storable(value) for name, value in renamed.coords.items()}
    )
    with replacing(path) as partial:
        stored.to_netcdf(partial, engine="scipy", format="NETCDF3_64BIT")


def table(columns: dict[str, np.ndarray], dimension: str = "", **attributes):
    """The Dataset of a table.

    Parameters
    ----------
    columns : dict of str to array-like
        Columns by name, whose end is the unit.
    dimension : str
        Name of the rows' dimension. If it is a column, that is the dimension's coordinate. By
        default it is the first column of KEYS, or "row".
    **attributes
        Attributes of the Dataset, such as `title`.

    Returns
    -------
    xarray.Dataset
        A variable for each column, with the attributes `units` and `long_name`.

    Raises
    ------
    InputError
        If xarray is not installed.
    """
    xarray = optional("xarray", "a netCDF file or an xarray Dataset")
    dimension = dimension or next((name for name in KEYS if name in columns), "row")
    variables = {name: ((dimension,), values) for name, values in _arrays(columns).items()}
    return described(xarray.Dataset(variables, attrs=attributes))


def grid(columns: dict[str, np.ndarray], axes: tuple[str, ...], **attributes):
    """The Dataset of a table whose rows are the points of a grid.

    As `table`, but with the columns `axes` as coordinates: (elevation_deg, azimuth_deg) makes each
    other column an array (elevations, azimuths). Points without a row are NaN. Columns of integers
    stay integers where the grid is full.
    """
    xarray = optional("xarray", "a netCDF file or an xarray Dataset")
    from pandas import DataFrame  # which xarray needs

    frame = DataFrame(_arrays(columns)).set_index(list(axes))
    made = xarray.Dataset.from_dataframe(frame)
    texts = [name for name, values in made.items() if values.dtype.kind == "O"]
    return described(made.assign(made[texts].fillna("")).assign_attrs(attributes))


def dataset(columns: dict[str, np.ndarray], **attributes):
    """The Dataset of a table of this project: a `grid` over ASPECT for a trend, or a `table`.

    A table whose rows have another key, or one direction twice, as a sweep over ranges, is no grid.
    """
    if not set(ASPECT) <= set(columns) or set(KEYS) & set(columns):
        return table(columns, **attributes)
    directions = list(zip(*(np.asarray(columns[name]).tolist() for name in ASPECT)))
    is_grid = len(set(directions)) == len(directions)
    return grid(columns, ASPECT, **attributes) if is_grid else table(columns, **attributes)


def _arrays(columns) -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in columns.items()}


def described(dataset):
    """The Dataset with `units` and `long_name` of each variable, from its name."""
    for name, variable in dataset.variables.items():
        if unit := unit_of(name):
            variable.attrs["units"] = unit
        variable.attrs["long_name"] = quantity_of(name)
    return dataset


def _storable(array):
    """A DataArray in a type that netCDF-3 has."""
    kind = array.dtype.kind
    if kind in "iu" and array.size and np.abs(array.values.astype(float)).max() > LARGEST_WHOLE:
        return array.astype(np.float64)
    return array.astype(str) if kind == "O" else array


def checksum(dataset) -> str:
    """16 hexadecimal digits that stand for all that a Dataset holds.

    It is the same before `write` and after `read`. An attribute `checksum` does not count.
    """
    digest = sha256()
    for name, value in sorted(dataset.attrs.items()):
        if name != "checksum":
            digest.update(f"{name}={value};".encode())
    for name in sorted(map(str, dataset.variables)):
        values = dataset[name].values
        is_text = values.dtype.kind not in "iufb"
        content = (
            repr(list(map(str, values))).encode() if is_text else values.astype("<f8").tobytes()
        )
        digest.update(f"{name}{dataset[name].dims}{values.shape}".encode() + content)
    return digest.hexdigest()[:16]


def read_netcdf_columns(path) -> dict[str, np.ndarray]:
    """The columns of a netCDF file that `write` made from `dataset`, by name.

    Raises InputError for a file that cannot be read, and if xarray is not installed.
    """
    frame = _read(path, lambda dataset: dataset.load().to_dataframe().reset_index())
    return {str(name): frame[name].to_numpy() for name in frame}


def read_attributes(path) -> dict:
    """The attributes of a netCDF file; raises InputError as `read_columns`."""
    return _read(path, lambda dataset: dict(dataset.attrs))


def read(path):
    """The Dataset of a netCDF file; raises InputError as `read_columns`."""
    return _read(path, lambda dataset: dataset.load())


def _read(path, content):
    xarray = optional("xarray", "a netCDF file")
    try:
        with xarray.open_dataset(path, engine="scipy") as dataset:
            return content(dataset)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AssertionError) as error:
        raise InputError(f"{path}: cannot be read as netCDF-3: {error}") from None


# Tables of this project as files: their columns
# ----------------------------------------------


def read_columns(path: str | Path) -> dict[str, np.ndarray]:
    """Columns of a .csv or .nc file by name: Float64 with NaN for what is missing, or texts.

    Raises InputError for a file that is no table.
    """
    if Path(path).suffix.lower() == ".nc":
        return read_netcdf_columns(path)
    table = read_table(path, ())
    columns = {}
    for place, name in enumerate(table.columns):
        try:
            columns[name] = table.numbers([name], may_lack=True)[name]
        except InputError:
            columns[name] = np.array([cells[place] for _, cells in table.rows], dtype=object)
    return columns


# TIFF images: 32-bit floating point numbers as thermography tools read them, 16-bit counts
# -----------------------------------------------------------------------------------------

LARGEST = 2**32 - 2**24  # bytes of a file, whose offsets have 32 bits


def write_tiff(path: str | Path, values: np.ndarray, description: str = "") -> None:
    """Write an image, or frames as the pages of one file, completely or not at all.

    Parameters
    ----------
    path : path-like
        File to write.
    values : ndarray, shape (H, W) or (frames, H, W)
        uint16 becomes 16-bit pages, compressed without loss. Any other type becomes 32-bit
        floating point pages, which are not compressed, so that every reader of such files takes
        them. NaN stays NaN.
    description : str
        Text of the file's tag ImageDescription, in ASCII: what the values are and their unit.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    from PIL import Image

    values = np.asarray(values)
    counts = values.dtype == np.uint16
    pages = [
        Image.fromarray(np.ascontiguousarray(page, np.uint16 if counts else np.float32))
        for page in values.reshape(-1, *values.shape[-2:])
    ]
    content = BytesIO()
    pages[0].save(
        content,
        format="TIFF",
        save_all=True,
        append_images=pages[1:],
        compression="tiff_adobe_deflate" if counts else None,
        description=description.encode("ascii", "replace").decode(),
    )
    write_bytes(path, content.getvalue())


def write_png(path: str | Path, values: np.ndarray) -> None:
    """Write an image of integers as a PNG of as many bits, completely or not at all."""
    from PIL import Image

    content = BytesIO()
    Image.fromarray(np.ascontiguousarray(values)).save(content, format="PNG")
    write_bytes(path, content.getvalue())


def check_fits(path: str | Path, pages: int, columns: int, rows: int) -> None:
    """Raise InputError if so many 16-bit pages are too large for one file."""
    size = 2 * pages * columns * rows
    if size > LARGEST:
        raise InputError(
            f"'{path}': {pages} pages of {columns} x {rows} pixels have {size / 2**30:.1f} GiB, "
            f"and a TIFF at most {LARGEST / 2**30:.1f}; write fewer"
        )


@contextmanager
def stack(path: str | Path) -> Iterator[Callable]:
    """Context manager that gives a function, which adds 16-bit pages (H, W) to a file.

    The file appears at the end of the block.
    """
    from PIL import Image
    from PIL.TiffImagePlugin import AppendingTiffWriter

    class Pages(AppendingTiffWriter):
        def close(self) -> None:
            if not self.f.closed:  # Python from 3.13 on closes it again when it is deleted
                super().close()

    with replacing(path) as partial, Pages(str(partial), new=True) as file:

        def add(page: np.ndarray) -> None:
            Image.fromarray(np.ascontiguousarray(page, np.uint16)).save(file, format="TIFF")
            file.newFrame()

        yield add


# Facets as VTK's XML files, which ParaView, VTK, pyvista and (.vtu) meshio read
# ------------------------------------------------------------------------------
# The file is written here: meshio has no .vtp and no texts, and pyvista would bring all of VTK.
# Numbers are stored in full, in base64.

TRIANGLE, POLYGON, QUAD = 5, 7, 9  # VTK's numbers of cell types
TYPES = {"i": "Int64", "u": "Int64", "b": "Int64", "f": "Float64"}  # by NumPy's kind of type


def write_facets(
    path: str | Path, vertices: np.ndarray, faces, columns: dict[str, np.ndarray]
) -> None:
    """Write polygons with columns of values as VTK or USD, completely or not at all.

    A column of texts such as `group` becomes two arrays: the texts themselves, and `group_number`,
    the number of each text in their alphabetical order, by which ParaView colours. A .vtu file has
    the numbers only, because meshio reads no texts; a comment in it lists what they stand for.
    For USD see `_write_usd`.

    Parameters
    ----------
    path : path-like
        File to write; .vtp is VTK's PolyData, .vtu its UnstructuredGrid, .usd[a|c] a stage.
    vertices : ndarray, shape (n, 3)
        Corners of the polygons [m], stored in Float64.
    faces : sequence of sequences of int
        Corners of each polygon, as rows of `vertices`, in their order around it.
    columns : dict of str to array-like, shape (len(faces),)
        Numbers or texts of each polygon, by name with the unit.

    Raises
    ------
    InputError
        If the suffix is none of these, if the file cannot be written, or if usd-core is missing.
    """
    suffix = check_suffix(path, FACET_FILES)
    if suffix in USD:
        _write_usd(path, suffix, vertices, faces, columns)
        return
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
        _array("Points", np.asarray(vertices, np.float64)),
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


# Attributes by which `import` knows columns of facets again. Others are `facets:NAME`, where
# '_' stands for what a name in USD cannot have.
SAID = {"temperature_K": "kelvin", "material": "material", "group": "group", "type": "type"}
LETTERS = {"model": "f", "sky": "s", "terrain": "t"}  # types of facets in labels
COLOURS = "inferno"  # of Matplotlib


def _write_usd(path, suffix: str, vertices, faces, columns: dict[str, np.ndarray]) -> None:
    """Write polygons as a mesh of OpenUSD, with primvars over its faces.

    Those of SAID are `thermal:NAME`, as `import` reads them. Numbers have single precision, which
    is all that Blender reads, but temperatures that it does not hold are doubles. Viewers show
    `displayColor`, which is the temperature from the lowest (black) to the highest (yellow); grey
    has none.
    """
    optional("pxr", f"{path}: a USD file")
    from matplotlib import colormaps
    from pxr import Sdf, Tf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, "/facets")
    stage.SetDefaultPrim(mesh.GetPrim())
    flat = np.concatenate([np.zeros(0, int), *map(np.asarray, faces)])
    used, corners = np.unique(flat, return_inverse=True)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(vertices, np.float32)[used]))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners.astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    primvars, kinds = UsdGeom.PrimvarsAPI(mesh), Sdf.ValueTypeNames
    for name, values in columns.items():
        values = np.asarray(values)
        if values.ndim > 1 or not len(values):
            continue
        other = f"facets:{Tf.MakeValidIdentifier(name)}"
        name = f"thermal:{SAID[name]}" if name in SAID else other
        known = {"i": kinds.IntArray, "f": kinds.FloatArray, "b": kinds.BoolArray}
        kind = known.get(values.dtype.kind.replace("u", "i"), kinds.StringArray)
        if name == "thermal:kelvin" and (values != values.astype(np.float32))[values > 0].any():
            kind = kinds.DoubleArray
        written = values.tolist() if kind != kinds.StringArray else [*map(str, values)]
        if name == "thermal:type":
            written = [LETTERS.get(value, value) for value in written]
        primvars.CreatePrimvar(name, kind, UsdGeom.Tokens.uniform).Set(written)
    if "temperature_K" in columns and len(faces):
        kelvin = np.asarray(columns["temperature_K"], float)
        low, high = (np.nanmin(kelvin), np.nanmax(kelvin)) if np.isfinite(kelvin).any() else (0, 1)
        colours = colormaps[COLOURS]((kelvin - low) / max(high - low, 1e-9))[:, :3]
        colours[np.isnan(kelvin)] = 0.5
        colour = primvars.CreatePrimvar("displayColor", kinds.Color3fArray, UsdGeom.Tokens.uniform)
        colour.Set(Vt.Vec3fArray.FromNumpy(colours.astype(np.float32)))
    with TemporaryDirectory() as folder:
        file = Path(folder, f"facets{suffix}")
        stage.Export(str(file), addSourceFileComment=False)
        content = file.read_bytes()
    write_bytes(path, content)


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
