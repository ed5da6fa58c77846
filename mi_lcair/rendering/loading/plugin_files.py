"""Python files of the user that register plugins with Mitsuba: BSDFs, emitters and others."""

import traceback
from collections.abc import Iterable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import mitsuba as mi

from mi_lcair.errors import InputError

RUN: set[tuple[Path, str]] = set()  # files that have been run, each with Mitsuba's variant


def run_plugin_files(files: Iterable[str | Path]) -> None:
    """Run files that register plugins, each once in the present variant of Mitsuba.

    Raises InputError if a file is absent, is no Python file, or fails.
    """
    for file in files:
        path = Path(file).resolve()
        if (path, mi.variant()) in RUN:
            continue
        if path.suffix != ".py" or not path.is_file():
            raise InputError(
                f"plugin '{file}' is no Python file; give a file that ends with "
                "mi.register_bsdf or mi.register_emitter"
            )
        spec = spec_from_file_location(path.stem, path)
        try:
            spec.loader.exec_module(module_from_spec(spec))
        except Exception as error:  # of any kind, because the code is the user's
            line = traceback.extract_tb(error.__traceback__)[-1]
            what = f"{type(error).__name__}: {error}".splitlines()[0]
            raise InputError(
                f"plugin '{file}': {what} ({Path(line.filename).name}, line {line.lineno})"
            ) from None
        RUN.add((path, mi.variant()))
