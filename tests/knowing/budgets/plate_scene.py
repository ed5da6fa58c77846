"""A scene whose budget has a closed form: a grey diffuse plate, alone and seen along its normal."""

from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.physics.blackbody import in_band_radiance
from tests.detection.disc_scenario import triangles

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


def row(budget, name):
    return next(row for row in budget.rows if row.quantity == name)


def slope(band, T):
    """dB/dT of a blackbody [W m^-2 sr^-1 K^-1]."""
    return float(in_band_radiance(band, T + 0.01) - in_band_radiance(band, T - 0.01)) / 0.02


def triangle_areas():
    """Areas of the disc's triangles, m^2."""
    a, b, c = np.moveaxis(triangles(), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
