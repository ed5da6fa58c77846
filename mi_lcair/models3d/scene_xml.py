"""The scene files of a facet model: the fragment that places it, and a scene that looks at it.

Model axes: x forward, y left, z up. Yaw turns the nose to the left, pitch lifts it, roll lowers the
right wing.
"""

from xml.sax.saxutils import quoteattr

from mi_lcair.models3d.label import TYPES

TURN = (
    '<rotate x="1" angle="$roll_deg"/> <rotate y="-1" angle="$pitch_deg"/> '
    '<rotate z="1" angle="$yaw_deg"/>'
)
TURN_BACK = (
    '<rotate z="-1" angle="$yaw_deg"/> <rotate y="1" angle="$pitch_deg"/> '
    '<rotate x="-1" angle="$roll_deg"/>'
)
MARGIN = 1.02  # ratio of half the sensor's window to the radius of the sphere around the model
# Ratio of the sensor's distance to half its window. The sensor is outside the model, but inside a
# room around it.
DISTANCE = 1.1


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
    used = dict.fromkeys(label.material for label in labels.values())
    return "\n".join(
        [
            '<scene version="3.0.0">',
            f"    <!-- {name}: the meshes of a facet model, to be included in a scene:",
            '         <path value="FOLDER"/> <include filename="FOLDER/model.xml"/>. '
            "Its parameters are those of the scene. -->",
            "",
            *(
                f'    <default name="{key}" value={quoteattr(str(value))}/>'
                for key, value in defaults.items()
            ),
            *(_material(name, *short[material], materials) for material in used),
            *(_shape(name, stem, label, short, sky) for stem, label in labels.items()),
            "</scene>",
            "",
        ]
    )


def _material(name, short, material, materials):
    table = (
        f'        <string name="materials" value={quoteattr(materials)}/>\n' if materials else ""
    )
    return f"""
    <bsdf type="material" id={quoteattr(f"{name}_{short}")}>
        <string name="material" value={quoteattr(material)}/>
{table}        <string name="band" value="$band"/>
        <boolean name="allow_band" value="$allow_band"/>
        <string name="lobe" value="$lobe"/>
    </bsdf>"""


def _shape(name, stem, label, short, sky):
    turn = f'        <transform name="to_world"> {TURN} </transform>\n' if label.type == "f" else ""
    source = (
        '<texture type="mesh_attribute" name="temperature"> '
        '<string name="name" value="face_temperature"/> </texture>'
        if not sky or label.elevation_deg is None
        else '<string name="spectrum" value="$sky"/> '
        f'<float name="elevation_deg" value="{label.elevation_deg:g}"/>'
    )
    return f"""
    <shape type="ply" id="{name}.{stem}">
        <string name="filename" value="{name}_{stem}.ply"/>
        <boolean name="face_normals" value="true"/>
{turn}        <ref id={quoteattr(f"{name}_{short[label.material][0]}")}/>
        <emitter type="thermal">
            <string name="band" value="$band"/>
            {source}
            <string name="group" value="{label.group}"/>
            <string name="facet_type" value="{TYPES[label.type]}"/>
        </emitter>
    </shape>"""


def scene(name: str, centre, radius: float, sky: str | None) -> str:
    """The text of scene.xml: an orthographic sensor around the model. centre (3,) and radius of the
    model's sphere [m].
    """
    window = MARGIN * radius
    x, y, z = (f"{value:.7g}" for value in centre)
    own_sky = (
        f"""
    <default name="sky" value={quoteattr(sky)}/>   \
<!-- table of the sky's spectral radiance: a bundled name or a CSV -->"""
        if sky
        else ""
    )
    return f"""<scene version="3.0.0">
    <!-- {name}, seen from all sides.

         An imported facet model (x forward, y left, z up) in a square window of \
{2 * window:.4g} m x {2 * window:.4g} m. -->

    <default name="azimuth_deg" value="90"/>    \
<!-- of the observer: 0 sees the nose, 90 the left side, 180 the tail -->
    <default name="elevation_deg" value="0"/>   \
<!-- of the observer above the horizontal; 90 sees the top -->
    <default name="band" value="LWIR"/>         \
<!-- SWIR, MWIR, LWIR, total, a-b in um, or the CSV file of a response -->
    <default name="allow_band" value="false"/>  \
<!-- whether materials that were not measured for this band take the nearest one -->
    <default name="lobe" value="brdf"/>         \
<!-- reflection of all materials: brdf, mirror or diffuse -->
    <default name="yaw_deg" value="0"/>         <!-- of the model: turns the nose to the left -->
    <default name="pitch_deg" value="0"/>       <!-- of the model: lifts the nose -->
    <default name="roll_deg" value="0"/>        \
<!-- of the model: lowers the right wing -->{own_sky}
    <default name="max_bounces" value="5"/>     <!-- reflections after which a path ends -->
    <default name="resolution" value="256"/>    <!-- pixels along each side of the image -->
    <default name="spp" value="64"/>            <!-- paths per pixel -->

    <include filename="model.xml"/>

    <integrator type="bounce_path">
        <integer name="max_bounces" value="$max_bounces"/>
    </integrator>

    <!-- The window stays on the model's centre however the model is turned about its origin. -->
    <sensor type="orthographic" id="sensor">
        <float name="near_clip" value="{0.01 * window:.7g}"/>
        <float name="far_clip" value="{max(1e4, 1e3 * window):.7g}"/>
        <transform name="to_world">
            <scale x="{window:.7g}" y="{window:.7g}"/>
            <lookat origin="{DISTANCE * window:.7g}, 0, 0" target="0, 0, 0" up="0, 0, 1"/>
            <rotate y="-1" angle="$elevation_deg"/>
            <rotate z="1" angle="$azimuth_deg"/>
            {TURN_BACK}
            <translate x="{x}" y="{y}" z="{z}"/>
            {TURN}
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="$resolution"/>
            <integer name="height" value="$resolution"/>
            <string name="pixel_format" value="luminance"/>
            <string name="component_format" value="float32"/>
            <rfilter type="box"/>
        </film>
        <sampler type="lattice">
            <integer name="sample_count" value="$spp"/>
        </sampler>
    </sensor>
</scene>
"""
