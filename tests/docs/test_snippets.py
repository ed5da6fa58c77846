"""Every command, snippet and sample file that README and the site show is run or compared."""

import shutil
from collections import Counter

import pytest

from tests.cli.test_examples import check_next, examples
from tests.docs.fences import EXAMPLES, Fence, all_fences, fences, pages
from tests.docs.running import commands, run, study_error

RUN = [page for page in pages() if any(fence.is_run for fence in fences(page))]
LANGUAGES = {"sh", "python", "xml", "toml", "csv", "obj", "json", "text"}

ELSEWHERE = "other pages or manuals have each line"
# Fences that no test runs: page and reason -> how many. There should be no more than these.
NOT_RUN = {
    ("README.md", "installs packages"): 1,
    ("README.md", "runs the tests"): 1,
    ("docs/start.md", "installs packages"): 1,
    ("docs/tour.md", ELSEWHERE): 1,
    ("docs/gallery.md", "takes minutes at the picture's resolution"): 3,
    ("docs/gallery.md", "takes minutes"): 1,
    ("docs/gallery.md", "long study"): 5,
    ("docs/gallery.md", "needs measured data"): 1,
    ("docs/validation/gpu.md", "needs a GPU"): 1,
    ("docs/howto/shell.md", "changes the shell that reads it"): 1,
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with copies of the examples, in which commands run."""
    shutil.copytree(EXAMPLES, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MI_LCAIR_DEBUG", raising=False)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("document", RUN)
def test_commands_and_python_run(document, folder):
    """What also ends a command's help names the next command."""
    namespace, of_help = {"__name__": "__main__"}, [words for _, words in examples()]
    for fence in fences(document):
        for output, words in run(fence, namespace):
            if words in of_help:
                check_next(output, words)


def test_what_is_not_run_is_listed():
    marks = ((fence.page, fence.value) for fence in all_fences() if fence.mark == "not run")
    assert Counter(marks) == NOT_RUN


def test_lines_of_elsewhere_are_run_there():
    run_lines, repeated = [words for _, words in examples()], []
    for fence in all_fences():
        if fence.language == "sh" and (fence.is_run or fence.value == ELSEWHERE):
            (run_lines if fence.is_run else repeated).extend(commands(fence))
    assert len(repeated) > 15 and [words for words in repeated if words not in run_lines] == []


@pytest.mark.parametrize("fence", all_fences(), ids=lambda fence: fence.place)
def test_language_is_known(fence):
    assert fence.language in LANGUAGES


@pytest.mark.parametrize(
    "fence",
    [f for f in all_fences() if f.language in LANGUAGES - {"sh", "python", "text"}],
    ids=lambda fence: fence.place,
)
def test_samples_are_those_of_the_repository(fence):
    """A whole file equals the sample of its name; the lines of a part are lines of the sample."""
    assert fence.mark in ("file", "part of"), (
        "name the file of this block, see tests/docs/fences.py"
    )
    if fence.mark == "part of":
        lines = iter(line.strip() for line in fence.sample.read_text(encoding="utf-8").splitlines())
        for line in filter(None, map(str.strip, fence.text.splitlines())):
            assert line in lines, f"{line!r} is not in {fence.value}, or not in this order"
    elif fence.sample is not None:
        assert fence.text == fence.sample.read_text(encoding="utf-8")


@pytest.mark.parametrize("fence", all_fences(), ids=lambda fence: fence.place)
def test_studies_that_are_not_run_exist(fence):
    if fence.language == "sh":
        assert [error for words in commands(fence) if (error := study_error(words))] == []


WRONG = {
    "mi-lcair rendre two_plates": "rendre",
    "mi-lcair render two_plates --no-such-option": "no-such-option",
    "mi-lcair signature missing.xml": "missing.xml",
    "rm box.obj": "only mi-lcair",
}


@pytest.mark.parametrize("command", WRONG)
def test_a_wrong_command_fails(command, folder):
    with pytest.raises(AssertionError, match=WRONG[command]):
        run(Fence("page.md", 1, "sh", f"{command}\n"), {})


def test_wrong_python_fails(folder):
    with pytest.raises(AttributeError, match="rendre"):
        run(Fence("page.md", 1, "python", "import mi_lcair\nmi_lcair.rendre\n"), {})


def test_a_study_that_does_not_exist_is_found():
    assert (
        study_error(["python", "-m", "docs.studies.missing"]) == "there is no docs.studies.missing"
    )
    assert study_error(["python", "-m", "docs.studies.paths"]) is None
