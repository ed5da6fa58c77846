"""A body of 400 facets with a waist, whose facets reflect each other, and views of it."""

import mitsuba as mi
import numpy as np

SCENE = """<scene version="3.0.0">
<integrator type="bounce_path"> <integer name="max_bounces" value="{max_bounces}"/>
<boolean name="emitter_sampling" value="{emitter_sampling}"/> {extra} </integrator>
{sensors}
<shape type="ply" id="body"> <string name="filename" value="body.ply"/>
<boolean name="face_normals" value="true"/>
<bsdf type="sandford_robertson"> <float name="epsilon" value="{epsilon}"/>
<float name="rho_d" value="{rho_d}"/> <float name="b" value="0.1"/> <float name="e" value="0.05"/>
<string name="lobe" value="{lobe}"/> </bsdf>
<emitter type="thermal"> <string name="band" value="LWIR"/> <string name="group" value="body"/>
<texture type="mesh_attribute" name="temperature">
<string name="name" value="face_temperature"/> </texture> </emitter> </shape>
{background}
</scene>"""
SKY = """<shape type="sphere" id="sky"> <float name="radius" value="20"/>
<boolean name="flip_normals" value="true"/>
<bsdf type="sandford_robertson"> <string name="band" value="LWIR"/>
<string name="material" value="blackbody"/> </bsdf>
<emitter type="thermal"> <string name="band" value="LWIR"/> <string name="group" value="sky"/>
<string name="facet_type" value="sky"/> <float name="temperature" value="{kelvin}"/> </emitter>
</shape>"""
SENSOR = """<sensor type="orthographic"> <transform name="to_world"> <scale x="0.75" y="0.75"/>
<lookat origin="{origin}" target="0, 0, 0" up="{up}"/> </transform>
<film type="hdrfilm"> <integer name="width" value="{size}"/>
<integer name="height" value="{size}"/> <string name="pixel_format" value="luminance"/>
<string name="component_format" value="float32"/> <rfilter type="box"/> </film>
<sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler> </sensor>"""
VIEWS = [
    ("5, 0, 0", "0, 0, 1"),
    ("-5, 0, 0", "0, 0, 1"),
    ("0, 5, 0", "0, 0, 1"),
    ("0, -5, 0", "0, 0, 1"),
    ("0, 0, 5", "1, 0, 0"),
    ("0, 0, -5", "1, 0, 0"),
]


def body(rings: int, segments: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles and the facet of each triangle of a body of revolution with a waist.

    It has rings x segments facets: quadrilaterals, and triangles at the two poles.
    """
    angle = np.linspace(0, np.pi, rings + 1)[1:-1]
    radius = np.sin(angle) * (0.35 + 0.25 * np.cos(2 * angle) ** 2)
    turn = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = [
        np.column_stack([r * around, np.full(segments, 0.7 * np.cos(a))])
        for r, a in zip(radius, angle)
    ]
    vertices = np.concatenate([*rows, [[0, 0, 0.7], [0, 0, -0.7]]])
    top, bottom, at = len(vertices) - 2, len(vertices) - 1, lambda ring, k: ring * segments + k
    triangles, facet = [], []
    for ring in range(rings):
        for k in range(segments):
            after = (k + 1) % segments
            if ring == 0:
                found = [(top, at(0, k), at(0, after))]
            elif ring == rings - 1:
                found = [(at(ring - 1, k), bottom, at(ring - 1, after))]
            else:
                a, b, c, d = at(ring - 1, k), at(ring, k), at(ring, after), at(ring - 1, after)
                found = [(a, b, c), (a, c, d)]
            triangles += found
            facet += [ring * segments + k] * len(found)
    return vertices, np.array(triangles), np.array(facet)


def smooth_temperatures(rings: int, segments: int, seed: int = 1) -> np.ndarray:
    """Temperatures of the facets: 290 to 320 K over the body, and 2 K of scatter, (facets,) [K]."""
    ring, segment = np.divmod(np.arange(rings * segments), segments)
    wave = np.sin(2 * np.pi * segment / segments) + np.cos(np.pi * ring / rings)
    return 305 + 6 * wave + 2 * np.random.default_rng(seed).normal(size=rings * segments)


def write_body(path, temperature, rings: int, segments: int) -> np.ndarray:
    """Write the body as PLY with a temperature for each facet; return the triangles' facets."""
    vertices, triangles, facet = body(rings, segments)
    mesh = mi.Mesh("body", len(vertices), len(triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(np.ravel(vertices).astype(np.float32))
    parameters["faces"] = mi.UInt32(np.ravel(triangles).astype(np.uint32))
    parameters.update()
    mesh.add_attribute("face_temperature", 1, np.asarray(temperature)[facet].astype(np.float32))
    mesh.add_attribute("face_facet", 1, facet.astype(np.float32))
    mesh.write_ply(str(path))
    return facet


def write_scene(
    folder,
    temperature,
    rings: int = 20,
    segments: int = 20,
    size: int = 64,
    views: int = 6,
    sky: float | None = 260.0,
    max_bounces: int = 3,
    emitter_sampling: bool = False,
    epsilon: float = 0.8,
    rho_d: float = 0.1,
    lobe: str = "brdf",
    extra: str = "",
):
    """Write the scene with the body, a spherical sky (None: none) and the first views."""
    write_body(folder / "body.ply", temperature, rings, segments)
    sensors = [SENSOR.format(origin=o, up=up, size=size) for o, up in VIEWS[:views]]
    file = folder / "waist.xml"
    file.write_text(
        SCENE.format(
            max_bounces=max_bounces,
            emitter_sampling=str(emitter_sampling).lower(),
            extra=extra,
            sensors="\n".join(sensors),
            epsilon=epsilon,
            rho_d=rho_d,
            lobe=lobe,
            background="" if sky is None else SKY.format(kelvin=sky),
        )
    )
    return file
