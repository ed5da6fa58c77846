"""A scene that was written for Mitsuba as a thermal one: its surfaces emit by their temperature."""

import os
from pathlib import Path
from xml.etree import ElementTree

from mi_lcair.errors import InputError, option
from mi_lcair.files import read_text, replacing
from mi_lcair.models3d.label import kelvin

REFLECTIONS = 4  # of a scene whose integrator states no max_depth
UNSUITED = ("instance", "shapegroup", "merge")  # shapes that hold others; none of them can emit
VISIBLE = (
    "reflectances are those of the scene, which are meant for visible light; put materials that "
    'were measured in the infrared in their place: <bsdf type="material">'
)


def thermal_scene(
    path: str | Path,
    folder: str | Path,
    temperature: float,
    band: str = "LWIR",
    overwrite: bool = False,
) -> list[str]:
    """Write FOLDER/scene.xml, a thermal version of a scene in Mitsuba's XML.

    The integrator becomes `bounce_path`. Every shape gets an emitter `thermal` in place of its
    own, the other emitters are left out, and samplers become `lattice`. `temperature` and `band`
    are $-parameters of the new scene. Files stay where they are.

    Parameters
    ----------
    path : str or Path
        The scene, an XML file.
    folder : str or Path
        It is created if it does not exist.
    temperature : float
        Temperature of all surfaces [K].
    band : str
        Band of the radiances.
    overwrite : bool
        Replace a scene.xml that is there.

    Returns
    -------
    list of str
        What a user should know about the new scene, one line each.

    Raises
    ------
    InputError
        If the file is no scene, has shapes that cannot emit, or if scene.xml cannot be written.
    """
    path, written = Path(path), Path(folder) / "scene.xml"
    checked = kelvin(f"{temperature:.9g}")
    if written.exists() and (written.samefile(path) or not overwrite):
        instead = f"name another folder or give {option('overwrite', True)}"
        raise InputError(f"{written}: exists; {instead}")
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: is no XML: {error}") from None
    shapes = list(root.iter("shape"))
    if root.tag != "scene" or not shapes:
        raise InputError(f"{path}: must be a scene of Mitsuba with at least one shape")
    for shape in shapes:
        if shape.get("type") in UNSUITED:
            raise InputError(
                f"{path}: a shape {shape.get('type')} cannot emit; write its shapes one by one"
            )
    for name in ("temperature", "band"):
        if root.find(f"default[@name='{name}']") is not None:
            raise InputError(f"{path}: has a parameter {name} of its own; give it another name")
    depth = root.find(".//integrator/integer[@name='max_depth']")
    depth = "" if depth is None else depth.get("value", "")
    bounces = max(int(depth) - 1, 0) if depth.isdigit() else REFLECTIONS
    others = [emitter.get("type", "") for emitter in root.findall("emitter")]
    for child in [*root.findall("emitter"), *root.findall("integrator")]:
        root.remove(child)
    for sampler in root.iter("sampler"):
        sampler.set("type", "lattice")
        for entry in list(sampler):
            if entry.get("name") not in ("sample_count", "seed"):
                sampler.remove(entry)
    lamps = sum(_heat(shape) for shape in shapes)
    _point(root, path.parent, written.parent)
    for name, value in (("temperature", f"{checked:g}"), ("band", band)):
        root.insert(0, ElementTree.Element("default", name=name, value=value))
    integrator = ElementTree.SubElement(root, "integrator", type="bounce_path")
    ElementTree.SubElement(integrator, "integer", name="max_bounces", value=str(bounces))
    ElementTree.indent(root, "    ")
    written.parent.mkdir(parents=True, exist_ok=True)
    with replacing(written) as partial:
        partial.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    remarks = [VISIBLE]
    if lamps:
        remarks.append(f"lamps ({lamps}) have the temperature of all shapes; change theirs")
    if others:
        remarks.append(f"left out: {', '.join(others)}; an emitter `sky` surrounds the scene")
    return remarks


def _heat(shape: ElementTree.Element) -> bool:
    """Give a shape an emitter `thermal`; returns whether it had another one."""
    emitters = shape.findall("emitter")
    for emitter in emitters:
        shape.remove(emitter)
    thermal = ElementTree.SubElement(shape, "emitter", type="thermal")
    ElementTree.SubElement(thermal, "string", name="band", value="$band")
    ElementTree.SubElement(thermal, "float", name="temperature", value="$temperature")
    return bool(emitters)


def _point(root: ElementTree.Element, old: Path, new: Path) -> None:
    """Make relative paths of files, which begin in the folder `old`, begin in `new`."""
    for element in root.iter():
        is_file = element.tag == "string" and element.get("name") == "filename"
        key = "value" if is_file or element.tag == "path" else "filename"
        name = element.get(key) if is_file or element.tag in ("path", "include") else None
        if name and not os.path.isabs(name) and "$" not in name:
            element.set(key, os.path.relpath(old / name, new))
