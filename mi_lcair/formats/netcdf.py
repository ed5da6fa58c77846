"""netCDF files of labelled arrays, and the labelled arrays of a table.

The files are netCDF-3 with 64-bit offsets, which SciPy writes and every netCDF reader reads. The
netCDF-4 engines would need HDF5 beside it.
"""

from hashlib import sha256

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.files import replacing
from mi_lcair.results.cells import quantity_of, unit_of

KEYS = ("wavelength_um", "facet", "time_s")  # columns that number the rows of a table
ASPECT = ("elevation_deg", "azimuth_deg")  # axes of a trend
LARGEST_WHOLE = 2**31 - 1  # largest integer of netCDF-3


def write(path, dataset) -> None:
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
    stored = renamed.map(_storable).assign_attrs(
        {name: value for name, value in renamed.attrs.items() if value is not None}
    )
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


def read_columns(path) -> dict[str, np.ndarray]:
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
