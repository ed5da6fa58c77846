import pytest

import mi_lcair  # noqa: F401  before any test file imports drjit or mitsuba, so that they find the right LLVM


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
