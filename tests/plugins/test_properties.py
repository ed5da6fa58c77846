"""Properties of the project's plugins: every value of the wrong kind or out of bounds is one line,
and each plugin's manual page says what its declaration says.
"""

import re

import mitsuba as mi
import pytest

from mi_lcair.declared import one_of
from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.physics import reflection
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.properties import Property, read

WRONG = {
    "float": (True, "300 K", mi.ScalarColor3d(1, 2, 3), float("nan"), float("inf")),
    "float or texture": (True, "300 K", mi.ScalarColor3d(1, 2, 3), float("nan")),
    "integer": (True, 2.5, "2", 2**31, -1),
    "boolean": (1, "false", 0.0),
    "string": (3, True, 2.5),
}
BESIDE = {
    "thermal": {"temperature": 300.0, "band": "LWIR"},
    "sun": {"azimuth_deg": 0.0, "elevation_deg": 40.0, "band": "LWIR"},
    "sky": {"band": "MWIR"},
    "bounce_path": {},
    "material": {"material": "gloss_black", "band": "LWIR"},
    "plume": {"transmittance": 0.5},
}


def declared():
    return [(name, entry) for name in BESIDE for entry in PLUGINS[name].type.PROPERTIES]


def load(plugin, **properties):
    try:
        return mi.load_dict({"type": plugin, **BESIDE[plugin], **properties})
    except RuntimeError as error:
        raise mitsuba_error(error) from None


@pytest.mark.parametrize("plugin, entry", declared(), ids=lambda value: getattr(value, "name", ""))
def test_wrong_kinds_are_refused(plugin, entry):
    """Also what Python would take for a number: True, "2", 2.0 for an integer."""
    # A boolean that may also be a word is a string in scene files
    wrong = ("no", 1, 0.0) if entry.kind == "boolean" and entry.choices else WRONG[entry.kind]
    for value in wrong:
        with pytest.raises(InputError, match=f"{plugin}: {entry.name}") as caught:
            load(plugin, **{entry.name: value})
        assert "\n" not in str(caught.value) and "must" in str(caught.value)


@pytest.mark.parametrize("plugin, entry", declared(), ids=lambda value: getattr(value, "name", ""))
def test_bounds(plugin, entry):
    """A number just outside its bounds is refused."""
    outside = [0.0] if entry.is_positive else []
    outside += [entry.lower - 1, entry.upper * 1.001 + 1]
    for value in outside:
        if entry.kind.startswith(("float", "integer")) and abs(value) < float("inf"):
            value = int(value) if entry.kind == "integer" else value
            with pytest.raises(InputError, match=f"{entry.name} = "):
                load(plugin, **{entry.name: value})


@pytest.mark.parametrize(
    "plugin, properties, message",
    [
        ("thermal", {"group": "a" * 65}, "at most 64"),
        ("thermal", {"group": "hot parts"}, "must consist of letters"),
        ("thermal", {"facet_type": "see"}, "unknown facet_type 'see'; known: sky, model, terrain"),
        ("thermal", {"elevation_deg": 4.5}, "elevation_deg needs spectrum; it chooses"),
        ("bounce_path", {"closure": "tale"}, "unknown closure 'tale'"),
    ],
)
def test_strings(plugin, properties, message):
    with pytest.raises(InputError, match=message):
        load(plugin, **properties)


@pytest.mark.parametrize("plugin", BESIDE)
def test_manual(plugin):
    """The table in a plugin's docstring has the declared names, kinds and defaults."""
    plugin_class = PLUGINS[plugin].type
    rows = manual(plugin_class.__doc__)
    assert {entry.name for entry in plugin_class.PROPERTIES} == set(rows)
    for entry in plugin_class.PROPERTIES:
        kind, text = rows[entry.name]
        assert kind == entry.kind, entry.name
        default = re.search(r"\((\S+)\)", text)
        given = str(entry.default).lower() if isinstance(entry.default, bool) else entry.default
        assert entry.default is None or f"({given})" in text, (entry.name, default)


@pytest.mark.parametrize("name", reflection.NAMES)
def test_parameters_of_models(name):
    """A model's own plugin takes its parameters as floats, and says so in its manual."""
    model = reflection.model(name)
    rows = manual(PLUGINS[name].type.__doc__)
    floats = [key for key, (kind, _) in rows.items() if kind == "float"]
    assert floats == list(model.names)
    for parameter in model.names:
        for value in WRONG["float"][:3]:
            with pytest.raises(InputError, match=f"{name}: {parameter}.*must be a float"):
                try:
                    mi.load_dict({"type": name, parameter: value})
                except RuntimeError as error:
                    raise mitsuba_error(error) from None


def manual(docstring: str) -> dict[str, tuple[str, str]]:
    """Rows of the table in a plugin's docstring: name -> (kind, text of all its lines)."""
    lines = docstring.splitlines()
    rules = [number for number, line in enumerate(lines) if re.fullmatch(r"\s*=+ =+ =+", line)]
    ends = [match.start() for match in re.finditer("=+", lines[rules[0]])]
    rows = {}
    for line in lines[rules[0] + 1 : rules[1]]:
        name, kind, text = line[: ends[1]].strip(), line[ends[1] : ends[2]], line[ends[2] :]
        if name:
            rows[name] = kind.strip(), text
            last = name
        else:
            rows[last] = rows[last][0], rows[last][1] + " " + text
    return rows


@pytest.mark.parametrize(("given", "value"), [("true", True), ("false", False), ("auto", "auto")])
def test_a_boolean_or_a_word(given, value):
    """Bundled scenes give `emitter_sampling` as a string, which -D may set to any of them."""
    assert load("bounce_path", emitter_sampling=given).emitter_sampling is value or given == "auto"
    assert load("bounce_path", emitter_sampling=given).emitter_sampling == value


def test_rules_know_the_defaults_of_the_properties_at_hand():
    """In turn: `radiance` is given where it differs from its default, which is not kept."""
    one, two = ((Property("radiance", "float", default),) for default in (0.0, 5.0))
    rules = (one_of("radiance"),)
    props = mi.Properties("lamp")
    props["radiance"] = 5.0
    for _ in range(2):
        assert read(props, "lamp", one, rules) == {"radiance": 5.0}
        with pytest.raises(InputError, match="radiance is missing"):
            read(props, "lamp", two, rules)
