"""What a loaded scene tells about itself: one line, or a table for notebooks."""

from html import escape

from mi_lcair.errors import printable, shortened

MOST = 8  # names in a list of the table
LONGEST = 190  # characters of the line


def line(scene) -> str:
    """The scene in one line: name, band, groups, sensors and parameters."""
    parts = [f"band {scene.band.label}", *(f"{name} {text}" for name, text in rows(scene)[1:5])]
    return printable(f"<Scene {scene.name}: {'; '.join(parts)}"[: LONGEST - 1] + ">")


def table(scene) -> str:
    """The scene as an HTML table, with its notes."""
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(text)}</td></tr>"
        for name, text in [*rows(scene), *(("note", note) for note in scene.notes[:MOST])]
    )
    return f"<table><caption>Scene {escape(scene.name)}</caption>{cells}</table>"


def rows(scene) -> list[tuple[str, str]]:
    """(name, text) of the scene's band, groups, materials, sensors and parameters."""
    return [
        ("band", scene.band.label),
        ("groups", names(scene.groups)),
        ("materials", names(dict.fromkeys(s.material for s in scene.surfaces()))),
        ("sensors", names(sensor_text(sensor) for sensor in scene.sensors)),
        ("parameters", names(f"{name}={value}" for name, value in scene.parameters.items())),
    ]


def sensor_text(sensor) -> str:
    """Kind and size of a sensor, such as "orthographic 64 x 64"."""
    kind = sensor.class_name().removesuffix("Camera").lower()
    return f"{kind} {' x '.join(str(int(size)) for size in sensor.film().crop_size())}"


def names(texts) -> str:
    """The first names of a list, and how many there are beyond them."""
    texts = [shortened(text, 40) for text in texts]
    more = f" and {len(texts) - MOST} more" if len(texts) > MOST else ""
    return (", ".join(texts[:MOST]) or "none") + more
