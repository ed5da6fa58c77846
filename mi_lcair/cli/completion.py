"""What the shell completes: names of scenes, scenarios and materials, and keys of -D.

Nothing here loads Mitsuba or NumPy. A completion that takes longer than a key press is of no use.
"""

import tomllib
from pathlib import Path

from click.shell_completion import BashComplete, CompletionItem, add_completion_class

from mi_lcair import physics
from mi_lcair import scenes as bundled
from mi_lcair.errors import InputError

MATERIALS = Path(physics.__file__).with_name("materials.toml")
ADD_WORD = "COMPREPLY+=($value)"
# A key is followed by its value, and not by a blank.
ADD_KEY = f"{ADD_WORD}; [[ $value == *= ]] && compopt -o nospace"


class Bash(BashComplete):
    """click's completion for Bash, which adds no blank behind `key=`."""

    source_template = BashComplete.source_template.replace(ADD_WORD, ADD_KEY)


add_completion_class(Bash)


def scene_titles() -> dict[str, str]:
    """Titles of the bundled scenes by name."""
    return {name: bundled.title(name) for name in bundled.names()}


def scenario_titles() -> dict[str, str]:
    """Titles of the bundled scenarios by name."""
    return {name: bundled.scenario_title(name) for name in bundled.scenarios()}


def material_names() -> dict[str, str]:
    """The bundled materials."""
    return dict.fromkeys(tomllib.loads(MATERIALS.read_text(encoding="utf-8")), "")


# Bundled names that may stand in place of a file, by its suffix
BUNDLED = {".xml": scene_titles, ".toml": scenario_titles, ".json": material_names}


def completer(*suffixes: str):
    """Function that completes the files with these suffixes, and the names in place of them.

    If nothing begins with the text, the shell completes file names.
    """

    def complete(ctx, param, incomplete: str) -> list[CompletionItem]:
        names = {}
        for suffix in suffixes:
            names |= BUNDLED.get(suffix, dict)()
            names |= {path.name: "" for path in sorted(Path().glob(f"*{suffix}"))}
        items = [
            CompletionItem(name, help=text)
            for name, text in names.items()
            if name.startswith(incomplete)
        ]
        return items or [CompletionItem(incomplete, type="file")]

    return complete


scenes, scenarios, materials = completer(".xml"), completer(".toml"), completer(".json")
scenes_and_scenarios, pictured = completer(".xml", ".toml"), completer(".exr", ".xml", ".json")


def keys(ctx, param, incomplete: str) -> list[CompletionItem]:
    """Keys of -D, `key=`, of the scene or scenario that stands before it on the line."""
    # An option at the end of the line lacks its value. click then leaves the arguments in ctx.args.
    subjects = []
    for name in ("scene", "scenario", "what"):
        given = ctx.params.get(name) or ()
        subjects += [given] if isinstance(given, str) else given
    subject = next(iter([*subjects, *ctx.args]), None)
    if subject is None or "=" in incomplete:
        return []
    try:
        known = entries_of_scenario(subject) or parameters_of_scene(subject)
    except (InputError, OSError, ValueError):
        return []  # the command reports what is wrong with the file
    return [
        CompletionItem(f"{key}=", help=text)
        for key, text in known.items()
        if key.startswith(incomplete)
    ]


def parameters_of_scene(scene: str) -> dict[str, str]:
    """Names of a scene's $-parameters, with their meanings if the scene is bundled."""
    from mi_lcair.rendering.loading.files import survey

    is_bundled = scene in bundled.names()
    meanings = bundled.parameters(scene) if is_bundled else {}
    file = bundled.path(scene) if is_bundled else bundled.in_folder(scene) or Path(scene)
    names = survey(file, {})
    others = sorted(names - meanings.keys())
    return {key: meaning.description for key, meaning in meanings.items()} | dict.fromkeys(
        others, ""
    )


def entries_of_scenario(scenario: str) -> dict[str, str]:
    """The entries that a scenario states, such as sensor.band; none for what is no scenario."""
    if scenario in bundled.scenarios():
        path = bundled.scenario_path(scenario)
    elif scenario.lower().endswith(".toml"):
        path = Path(scenario)
    else:
        return {}
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return {
        f"{table}.{key}": str(value)
        for table, entries in tables.items()
        if isinstance(entries, dict)
        for key, value in entries.items()
    }
