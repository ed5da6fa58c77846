import gc
import os
import signal
import sys

import pytest

# Each of several processes has a core of its own. Threads of Dr.Jit and of a BLAS that share the
# cores with those of another process wait for each other without sleep. This precedes their import.
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[int(worker.removeprefix("gw")) % len(cores)]})

import mi_lcair  # noqa: E402, F401  before any test file imports drjit or mitsuba, so that they find the right LLVM

# A shell that runs pytest in the background, and nohup, have these signals ignored in all that it
# starts. The programs that tests start and interrupt must receive them.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# Compiled modules are kept. Otherwise each process would compile all tests and the package anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Whoever leaves out slow tests leaves out studies."""
    for item in items:
        if item.get_closest_marker("study"):
            item.add_marker("slow")


def pytest_collection_finish():
    """Take what is alive before the first test out of all later collections of garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="module")
def no_remains():
    """Free the scenes of a module of tests.

    Dr.Jit's calls reach every emitter that is alive, and a kernel that it compiles for them is of
    no use to other tests.
    """
    yield
    gc.collect()


@pytest.fixture
def figures(monkeypatch):
    """The Matplotlib figures that are saved, in order."""
    from matplotlib.figure import Figure

    saved = []
    save = Figure.savefig
    monkeypatch.setattr(
        Figure,
        "savefig",
        lambda self, *args, **kwargs: (saved.append(self), save(self, *args, **kwargs)),
    )
    return saved
