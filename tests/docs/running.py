"""Run the commands and the Python of a page, in this process.

They run with few paths and without the drawing of pictures, because a page is tried for what it
calls. What is computed and drawn has tests of its own.
"""

import importlib.util
import io
import pickle
import shlex
import warnings
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from matplotlib.figure import Figure

import mi_lcair
from mi_lcair.api import heating
from mi_lcair.cli import main as command_line
from mi_lcair.detection.camera import ranges
from mi_lcair.fitting import estimation
from mi_lcair.physics.air import clear_air
from mi_lcair.physics.estimation import verdicts
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.show.pictures import model
from tests.docs.fences import Fence

FEW = {"spp": 2, "paths": 2**10}  # largest numbers of samples
TOLERANCE = 0.2  # smallest allowed error
STARTS = 1  # of each fit
STEPS = 3  # of the search for each end of an interval
RANGES = 6  # at which clear air and the spread of a target are computed
CELLS = 128  # along each side of a silhouette
FITS = {}  # arguments of a fit -> its result; several pages fit the same file
HEATED = {}  # file with its content -> its heat balance, which a page writes in several formats


@contextmanager
def quick():
    """Context manager in which renders take few paths, equal fits and heat balances are
    made once, intervals, air and silhouettes are coarse, and pictures have no content.
    """
    check, fit, draw = Sampling.__post_init__, estimation.fit, Figure.savefig

    def with_few_paths(self):
        check(self)
        for name, most in FEW.items():
            object.__setattr__(self, name, getattr(self, name) and min(getattr(self, name), most))
        object.__setattr__(self, "tolerance", self.tolerance and max(self.tolerance, TOLERANCE))

    def fit_once(measurements, *, progress=None, **settings):
        if isinstance(measurements, str):
            measurements = estimation.reading.read(measurements)
        settings["starts"] = STARTS
        key = pickle.dumps((measurements, settings))
        if key not in FITS:
            FITS[key] = fit(measurements, progress=progress, **settings)
        return FITS[key]

    def heat_once(described):
        if not isinstance(described, str):
            return heating.heat(described)
        key = Path(described).resolve(), Path(described).read_text()
        if key not in HEATED:
            HEATED[key] = heating.heat(described)
        return HEATED[key]

    def savefig(self, file, **options):
        if isinstance(file, str):  # a user's own call
            draw(self, file, **options)
        else:
            file.write(b"picture")

    with ExitStack() as stack:
        for replaced, name, value in (
            (Sampling, "__post_init__", with_few_paths),
            (estimation, "fit", fit_once),
            (estimation, "mistake", lambda *arguments: ""),
            (Figure, "savefig", savefig),
            (model, "png", lambda *arguments: b"picture"),
            (verdicts, "STEPS", STEPS),
            (ranges, "SPREADS", RANGES),
            (ranges, "CELLS", CELLS),
            (clear_air, "RANGES", RANGES),
            (clear_air, "LIGHT_RANGES", RANGES),
        ):
            stack.enter_context(patch.object(replaced, name, value))
        stack.enter_context(patch.dict(vars(mi_lcair), heat=heat_once))
        yield


def run(fence: Fence, namespace: dict) -> list[tuple[str, list[str]]]:
    """Write a fence's file or run its commands or Python; raises AssertionError if that fails.

    Returns output and words of each command.
    """
    if fence.mark == "file" and fence.sample is None:
        Path(fence.value).write_text(fence.text, encoding="utf-8")
    if fence.is_run and fence.language == "python":
        run_python(fence, namespace)
    of_shell = commands(fence) if fence.is_run and fence.language == "sh" else []
    return [(run_command(words, fence.place), words) for words in of_shell]


def commands(fence: Fence) -> list[list[str]]:
    """The words of each command of a fence; a backslash at the end continues a line."""
    lines = fence.text.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def run_python(fence: Fence, namespace: dict) -> None:
    """Run a fence with the names that earlier fences of the page have defined."""
    code = compile("\n" * (fence.line - 1) + fence.text, fence.page, "exec")
    with quick(), warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("default")  # remarks on a scene are warnings
        exec(code, namespace)


def run_command(words: list[str], place: str) -> str:
    """Run a command in the current folder, and return its output.

    Raises AssertionError unless its exit status is 0.
    """
    run_words, words = command_line, words if words[0] != "python" else words[2:]
    if words[0].startswith("benchmarks."):
        run_words = importlib.import_module(words[0]).main
    else:
        known = words[0] in ("mi-lcair", "mi_lcair")
        assert known, f"{place}: only mi-lcair and benchmarks can be run: {shlex.join(words)}"
    output = io.StringIO()
    try:
        with quick(), redirect_stdout(output), redirect_stderr(output):
            run_words(words[1:])
        status = 0
    except SystemExit as end:
        status = end.code or 0
    assert status == 0, f"{place}: {shlex.join(words)}\n{output.getvalue()}"
    return output.getvalue()


def study_error(words: list[str]) -> str | None:
    """What is wrong with a command `python -m docs.studies.NAME ...` that is not run, or None.

    The same holds for `python -m benchmarks.NAME`.
    """
    if words[:2] != ["python", "-m"] or not words[2].startswith(("docs.studies.", "benchmarks.")):
        return None
    if importlib.util.find_spec(words[2]) is None:
        return f"there is no {words[2]}"
    usage = importlib.import_module(words[2]).__doc__
    if words[2] not in usage:
        return f"the docstring of {words[2]} does not show how it is called"
    return None
