"""Every file of the repository that README or the site names exists."""

import re

import pytest

from tests.docs.fences import ROOT, pages

LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")
ADDRESS = re.compile(r"[a-z]+:")
# Paths in code, such as `docs/validation/landing.md`, begin with a folder of the repository
PATH = re.compile(
    r"(?<![\w/.])((?:docs|scenes|tests|mi_lcair|plugins|fitting|benchmarks|\.ci)/[\w./-]*\w)"
)


def missing(page: str) -> list[str]:
    """Names of files on a page that do not exist."""
    file = ROOT / page
    text = file.read_text(encoding="utf-8")
    links = [link for link in LINK.findall(text) if not ADDRESS.match(link)]
    named = [link for link in links if not (file.parent / link).exists()]
    words = re.sub(r"\]\([^)]*\)|https?:\S+|\S*NAME\S*", "", text)
    return [*named, *(path for path in PATH.findall(words) if not (ROOT / path).exists())]


@pytest.mark.parametrize("document", [*pages(), "CONTRIBUTING.md"])
def test_files_that_a_page_names_exist(document):
    assert missing(document) == []


def test_a_missing_file_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("[a](b.md) [c](https://d.org/e.md) `scenes/missing.xml` `scenes/cavity.xml`\n")
    assert missing(page) == ["b.md", "scenes/missing.xml"]
