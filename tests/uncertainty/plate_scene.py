"""A scene whose budget has a closed form: a grey diffuse plate, alone and seen along its normal."""

from pathlib import Path

import mi_lcair

XML = """<scene version="3.0.0">
    <default name="band" value="LWIR"/> <default name="temperature" value="310"/>
    <integrator type="bounce_path">
        <integer name="max_bounces" value="2"/> <string name="closure" value="CLOSURE"/>
    </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <scale x="2" y="2"/> <lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/> <integer name="height" value="16"/>
            <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
        </film>
        <sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler>
    </sensor>
    <shape type="rectangle">
        <bsdf type="diffuse" id="paint"> <spectrum name="reflectance" value="0.4"/> </bsdf>
        <emitter type="thermal">
            <string name="band" value="$band"/> <float name="temperature" value="$temperature"/>
            <string name="group" value="plate"/>
        </emitter>
    </shape>
</scene>"""
AREA, EMISSIVITY, TEMPERATURE = 4.0, 0.6, 310.0  # m^2, 1, K


def plate_scene(folder: Path, closure: str = "none", **parameters):
    path = folder / "plate.xml"
    path.write_text(XML.replace("CLOSURE", closure))
    return mi_lcair.load(path, **parameters)
