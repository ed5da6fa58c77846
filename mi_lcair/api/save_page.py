"""`save_page`, the page of one result: what `Result.save` does for FILE.html."""

from os import PathLike
from typing import Any

from mi_lcair.reports.page.page import check_output, save
from mi_lcair.results import Result


def save_page(path: str | PathLike[str], result: Result, **options: Any) -> None:
    """Write the page of a result in memory.

    Parameters
    ----------
    path : path-like
        File to write, FILE.html.
    result : Result
        Any result.
    **options
        Options of its sections, such as `scene`, which shows the facets of a signature. A scene may
        be given in any form that `mi_lcair.load` takes.

    Raises
    ------
    InputError
        If the file cannot be written, or if the result has no such option.
    """
    check_output(path)
    if "scene" in options:
        from mi_lcair.api.load import scene_of  # loads the renderer, which other results need not

        options["scene"] = scene_of(options["scene"])
    save(path, result.page_title(), result.page(**options))
