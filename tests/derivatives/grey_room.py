"""A grey plate in a black room, with a second plate at a right angle if it is asked for."""

import mi_lcair

EMITTER = """<emitter type="thermal"> <string name="band" value="LWIR"/>
    <float name="temperature" value="{T}"/> <string name="group" value="{group}"/>
    <string name="facet_type" value="{kind}"/> </emitter>"""
NAMED = """<bsdf type="material"> <string name="material" value="{}"/>
    <string name="band" value="LWIR"/> </bsdf>"""
NUMBER = '<bsdf type="grey" id="paint"> <float name="emissivity" value="{}"/> </bsdf>'
ROOM = """<scene version="3.0.0">
    <integrator type="bounce_path"> <integer name="max_bounces" value="4"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale x="0.5" y="0.5"/>
        <lookat origin="0, -2, 4" target="0, 0, 0" up="0, 1, 0"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="16"/> <integer name="height" value="16"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
        <sampler type="lattice"> <integer name="sample_count" value="64"/> </sampler>
    </sensor>
    <shape type="rectangle"> {paint} {plate} </shape> {second}
    <shape type="sphere"> <float name="radius" value="20"/> <boolean name="flip_normals"
        value="true"/> {black} {room} </shape>
</scene>"""
# A second plate of the same material, at a right angle to the first
SECOND = """<shape type="rectangle"> <ref id="paint"/> <transform name="to_world">
    <rotate x="1" angle="90"/> <translate y="1" z="1"/> </transform> {plate} </shape>"""
NAME = {NAMED: "{}.emissivity", NUMBER: "paint.emissivity"}


def load(tmp_path, material, emissivity, plate=310, room=260, second=""):
    parts = {
        "paint": material.format(emissivity),
        "plate": EMITTER.format(T=plate, group="plate", kind="model"),
        "black": NAMED.format("blackbody"),
        "room": EMITTER.format(T=room, group="room", kind="sky"),
    }
    path = tmp_path / "room.xml"
    path.write_text(ROOM.format(second=second.format(**parts), **parts))
    return mi_lcair.load(path), NAME[material].format(emissivity)
