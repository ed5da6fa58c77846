"""The scripts and the style sheet of a page lie beside its modules, and so in the wheel."""

from mi_lcair.show.page.page import FOLDER, SCRIPTS, STYLE


def test_all_scripts_are_used():
    """hatchling packs every file of the package; a page includes every script that is there."""
    found = {path.name for path in FOLDER.iterdir() if path.suffix in (".js", ".css")}
    assert found == {STYLE, *SCRIPTS}
