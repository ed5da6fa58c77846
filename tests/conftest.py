import signal

import pytest

import mi_lcair  # noqa: F401  before any test file imports drjit or mitsuba, so that they find the right LLVM

# A shell that runs pytest in the background, and nohup, have these signals ignored in all that it
# starts. The programs that tests start and interrupt must receive them.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


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
