"""Public functions about data sets."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from mi_lcair.detection.datasets.description import DatasetDescription
from mi_lcair.detection.datasets.folder import LabelledFrames, record_dataset
from mi_lcair.errors import errors_of
from mi_lcair.files import resumable
from mi_lcair.progress import Progress
from mi_lcair.tasks import exclusively

# `dataset`, labelled frames of many views in a folder
# ----------------------------------------------------


@exclusively
def dataset(
    description: str | PathLike[str] | Mapping,
    folder: str | PathLike[str],
    progress: Progress | None = None,
) -> LabelledFrames:
    """Record labelled frames of a scenario's target from many views.

    Each view has frames with noise, the image without noise, and the true values of its pixels.
    Uncertain quantities get random values. If only temperatures, air and background differ between
    the images of a view, it is traced once. To resume an interrupted call, repeat it. The files are
    then the same.

    Parameters
    ----------
    description : str, path-like or mapping
        TOML file, or a dictionary of its tables [base], [views], [draws], [bands], [frames] and
        [splits].
    folder : path-like
        Folder of the data set. It is created if it does not exist.
    progress : callable, optional
        Called with (views done, all views).

    Returns
    -------
    LabelledFrames

    Raises
    ------
    InputError
        If the description or the folder cannot be used: a view that does not see the target, a
        distribution outside the bounds of its quantity, a folder with other files. All input is
        checked before the first render.
    """
    read = DatasetDescription.read(description)
    with errors_of(f"dataset '{read.name}'"), resumable(Path(folder), "**/frames/*.json"):
        return record_dataset(read, Path(folder), progress)
