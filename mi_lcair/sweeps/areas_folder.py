"""The folder in which a sweep keeps effective areas, so that nothing is traced twice."""

import re
import warnings
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.files import check_writable
from mi_lcair.formats import netcdf
from mi_lcair.signatures.trend import TrendRows
from mi_lcair.signatures.view_areas import ViewAreas, of_dataset
from mi_lcair.sweeps.subject import Batch, Views

READERS = {ViewAreas.kind: of_dataset, TrendRows.kind: TrendRows.of_dataset}
BATCH = re.compile(r"[0-9a-f]{32}\.nc")  # names of the files


class AreasFolder:
    """A folder with a netCDF file for each batch of views, which `ViewAreas.read` reads.

    A file appears whole or not at all. Its name stands for everything on which its content depends.
    It states this name and its checksum: a file that does not match is traced again.

    Parameters
    ----------
    path : path-like
        Folder, which is made if it does not exist.

    Raises
    ------
    InputError
        If the folder cannot be written, or if xarray is not installed.
    """

    def __init__(self, path):
        self.path = Path(path)
        optional("xarray", "a folder of effective areas")
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"'{path}' is no folder; name a folder for effective areas")
        if not self.path.absolute().parent.is_dir():
            raise InputError(f"cannot make '{path}': its folder does not exist; create it first")
        check_writable((self.path if self.path.exists() else self.path.absolute().parent) / "file")

    def file_of(self, batch: Batch) -> Path:
        """The file of a batch."""
        return self.path / f"{batch.key}.nc"

    def read(self, batch: Batch) -> Views | None:
        """What was traced for a batch; None if it is not there, or damaged."""
        path = self.file_of(batch)
        if not path.exists():
            return None
        try:
            dataset = netcdf.read(path)
            stated = dataset.attrs["batch"], dataset.attrs["checksum"]
            if stated == (batch.key, netcdf.checksum(dataset)):
                return READERS[dataset.attrs["kind"]](dataset)
        except (InputError, KeyError, ValueError):
            pass
        warnings.warn(f"{path}: does not match its checksum and is traced again", stacklevel=2)
        return None

    def write(self, batch: Batch, traced: Views) -> None:
        """Keep what was traced for a batch."""
        self.path.mkdir(exist_ok=True)
        dataset = traced.to_xarray().assign_attrs(batch=batch.key)
        stated = dataset.assign_attrs(checksum=netcdf.checksum(dataset))
        netcdf.write(self.file_of(batch), stated)

    def clear(self) -> None:
        """Remove the files of all batches, and the folder if nothing else is in it."""
        if not self.path.exists():
            return
        for path in self.path.iterdir():
            if BATCH.fullmatch(path.name):
                path.unlink()
        if not any(self.path.iterdir()):
            self.path.rmdir()
