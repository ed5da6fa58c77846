"""What a loaded scene tells about itself in one line."""

from mi_lcair.errors import printable, shortened

MOST = 8  # names in a list
LONGEST = 190  # characters of the line


def line(scene) -> str:
    """The scene in one line: name, band, groups, materials, sensors and parameters."""
    lists = {
        "groups": scene.groups,
        "materials": dict.fromkeys(surface.material for surface in scene.surfaces()),
        "sensors": map(sensor_text, scene.sensors),
        "parameters": [f"{name}={value}" for name, value in scene.parameters.items()],
    }
    parts = [f"band {scene.band.label}", *(f"{name} {names(of)}" for name, of in lists.items())]
    return printable(f"<Scene {scene.name}: {'; '.join(parts)}"[: LONGEST - 1] + ">")


def sensor_text(sensor) -> str:
    """Kind and size of a sensor, such as "orthographic 64 x 64"."""
    kind = sensor.class_name().removesuffix("Camera").lower()
    return f"{kind} {' x '.join(str(int(size)) for size in sensor.film().crop_size())}"


def names(texts) -> str:
    """The first names of a list, and how many there are beyond them."""
    texts = [shortened(text, 40) for text in texts]
    more = f" and {len(texts) - MOST} more" if len(texts) > MOST else ""
    return (", ".join(texts[:MOST]) or "none") + more
