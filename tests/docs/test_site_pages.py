"""The reference names everything public, and the manuals of all plugins can be converted."""

import re

import pytest
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

import mi_lcair
from docs.site_pages import keys, manual, mathml, on_page_content, on_page_markdown
from mi_lcair.plugins import PLUGINS
from tests.docs.fences import ROOT


@pytest.mark.parametrize("name", PLUGINS)
def test_manual_is_that_of_the_plugin(name):
    assert manual(name).startswith(f"## {PLUGINS[name].kind} `{name}`\n")


def test_all_plugins_have_a_manual():
    page = (ROOT / "docs" / "reference" / "plugins.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: plugin (\w+)$", page, re.MULTILINE)) == sorted(PLUGINS)


def test_all_public_functions_are_in_the_reference():
    folder = ROOT / "docs" / "reference" / "python"
    page = "".join(file.read_text(encoding="utf-8") for file in folder.glob("*.md"))
    for name, home in mi_lcair._HOME.items():
        assert f"\n::: {home.replace('mi_lcair.fitting', 'fitting')}.{name}\n" in page, name


def test_a_page_gets_manuals_and_equations():
    page = on_page_markdown("# Title\n\n::: plugin plume\n")
    assert "transmittance" in page and ":::" not in page
    content = on_page_content(r'<p>with <span class="arithmatex">\(\sigma T^4 &gt; 0\)</span></p>')
    assert content.startswith("<p>with <math") and "arithmatex" not in content


def test_equations_are_mathml():
    assert mathml(r"\varepsilon", as_block=False).startswith("<math")
    assert 'display="block"' in mathml(r"\frac{a}{b}", as_block=True)


def test_links_of_a_tutorial_lead_to_pages():
    sources = ("tutorials/cavity.py", "howto/fit.md")
    files = Files([File(name, "docs", "site", use_directory_urls=False) for name in sources])
    page = type("Page", (), {"file": files.get_file_from_path("tutorials/cavity.py")})
    content = '<a href="../howto/fit.md#files">fit</a> <a href="https://a.org/b.md">b</a>'
    linked = on_page_content(content, page=page, files=files)
    assert linked == content.replace("fit.md", "fit.html")
    with pytest.raises(PluginError, match=r"cavity.py: links to '../howto/fitt.md'"):
        on_page_content(content.replace("fit.md", "fitt.md"), page=page, files=files)


def test_the_page_of_keys_has_every_table_that_a_user_writes():
    """Each class on the base of tables, but for those whose entries are in another table.

    Sampling, View and ImageConditions hold arguments of functions, and Calibration numbers of a
    binary file. They are no tables of a file.
    """
    page = (ROOT / "docs/reference/keys.md").read_text(encoding="utf-8")
    places = re.findall(r"^::: keys (\S+)$", page, re.MULTILINE)
    declared = {
        name
        for file in (ROOT / "mi_lcair").rglob("*.py")
        for name in re.findall(
            r"^class (\w+)\(\s*(?:Described|Weather|Observation)\b", file.read_text(), re.MULTILINE
        )
    }
    in_others = {"Weather", "Detector", "Observation", "InverseProblem"}
    in_others |= {"Sampling", "View", "ImageConditions", "Calibration"}
    missing = declared - {place.rpartition(".")[2] for place in places}
    assert missing == in_others and len(places) >= 25
    text = on_page_markdown(page)
    assert ":::" not in text
    assert "| `focal_length_mm` | needed | Focal length, mm, and its ratio" in text
    assert "| `cos4` | `false` | Whether the irradiance decreases as cos^4" in text
    assert "must lie in 230..320." in keys("mi_lcair.detection.scenario.Air")
