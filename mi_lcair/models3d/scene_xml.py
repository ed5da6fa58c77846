"""The scene files of a facet model: the fragment that places it, and a scene that looks at it.

Model axes: x forward, y left, z up. Yaw turns the nose to the left, pitch lifts it, roll lowers the
right wing.
"""

from functools import cache
from pathlib import Path
from xml.sax.saxutils import quoteattr

from mi_lcair.models3d.label import TYPES

TURN = """        <transform name="to_world"> <rotate x="1" angle="$roll_deg"/> \
<rotate y="-1" angle="$pitch_deg"/> <rotate z="1" angle="$yaw_deg"/> </transform>
"""
TEMPERATURES = (
    '<texture type="mesh_attribute" name="temperature"> '
    '<string name="name" value="face_temperature"/> </texture>'
)
AROUND = """
    <default name="{name}" value={value}/>   <!-- {what} -->"""
# $-parameters of surroundings: name, meaning
WORDS = {
    "sky": "clear, overcast, a temperature in K, a bundled sky or a CSV of spectra",
    "ground_temperature": "of the ground, K",
    "ground_material": "emissivity of the ground, or a material that has it",
    "sun_elevation_deg": "of the sun",
    "sun_azimuth_deg": "of the sun: 0 is +x, the nose, and 90 is +y, the left side",
    "atmosphere": "of sky and sun: us_standard or midlat_summer",
}
# Parameters that properties of the emitter `sun` have in scenes with a sky
OF_SUN = {
    "elevation_deg": "sun_elevation_deg",
    "azimuth_deg": "sun_azimuth_deg",
    "air": "atmosphere",
}
SKY = """
    <default name="sky" value={sky}/>   \
<!-- table of the sky's spectral radiance: a bundled name or a CSV -->"""
MARGIN = 1.02  # ratio of half the sensor's window to the radius of the sphere around the model
# Ratio of the sensor's distance to half its window. The sensor is outside the model, but inside a
# room around it.
DISTANCE = 1.1


@cache
def template(name: str) -> str:
    """The text of a template, with fields in braces."""
    return (Path(__file__).parent / "templates" / f"{name}.xml").read_text(encoding="utf-8")


def fragment(name: str, labels: dict, short: dict, materials: str | None, sky: str | None) -> str:
    """The text of model.xml.

    labels: stem of a mesh's file -> Label. short: material -> its name in ids and the value of the
    property `material`. materials, sky: file names of the tables of materials and of the sky's
    spectra.
    """
    turns = any(label.type == "f" for label in labels.values())
    defaults = (
        {"band": "LWIR", "allow_band": "false", "lobe": "brdf"}
        | ({"yaw_deg": 0, "pitch_deg": 0, "roll_deg": 0} if turns else {})
        | ({"sky": sky} if sky else {})
    )
    table = f'        <string name="materials" value={quoteattr(materials or "")}/>\n'
    ids = {material: quoteattr(f"{name}_{stem}") for material, (stem, _) in short.items()}
    lines = [f'    <default name="{k}" value={quoteattr(str(v))}/>' for k, v in defaults.items()]
    materials_used = [
        template("material").format(
            id=ids[material],
            material=quoteattr(short[material][1]),
            table=table if materials else "",
        )
        for material in dict.fromkeys(label.material for label in labels.values())
    ]
    shapes = [
        template("shape").format(
            name=name,
            stem=stem,
            turn=TURN if label.type == "f" else "",
            material=ids[label.material],
            source=_source(label, sky),
            group=label.group,
            type=TYPES[label.type],
        )
        for stem, label in labels.items()
    ]
    meshes = "\n".join([*materials_used, *shapes]).rstrip()
    return template("model").format(name=name, defaults="\n".join(lines), meshes=meshes)


def _source(label, sky):
    """What a mesh radiates: the temperatures of its facets, or a spectrum of the sky."""
    if not sky or label.elevation_deg is None:
        return TEMPERATURES
    return (
        '<string name="spectrum" value="$sky"/> '
        f'<float name="elevation_deg" value="{label.elevation_deg:g}"/>'
    )


def scene(name: str, centre, radius: float, sky: str | None, around: list[dict]) -> str:
    """The text of scene.xml: an orthographic sensor around the model. centre (3,) and radius of the
    model's sphere [m]. around: properties of the emitters sky and sun, see `Words.emitters`.
    """
    window = MARGIN * radius
    given = {key: value for emitter in around[:1] for key, value in emitter.items() if key in WORDS}
    defaults = "".join(
        AROUND.format(name=key, value=quoteattr(str(value)), what=WORDS[key])
        for key, value in given.items()
    )
    if sky:
        defaults += SKY.format(sky=quoteattr(sky))
    return template("scene").format(
        name=name,
        centre=centre,
        window=window,
        width=2 * window,
        near_clip=0.01 * window,
        far_clip=max(1e4, 1e3 * window),
        distance=DISTANCE * window,
        sky=defaults,
        emitters="".join(_emitter(emitter) for emitter in around),
    )


def _emitter(properties):
    """The element of an emitter whose properties in WORDS are $-parameters, as is the band."""
    lines = []
    for key, value in properties.items():
        if key != "type":
            kind = "float" if isinstance(value, float) else "string"
            name = OF_SUN.get(key, key)
            lines.append(f'        <{kind} name="{key}" value="${name}"/>')
    return "\n".join([f'    <emitter type="{properties["type"]}">', *lines, "    </emitter>\n"])
