# %% [markdown]
# # Titanium and titanium dioxide by wavelength
#
# A material has one set of parameters for a band, or parameters that depend on wavelength. This
# tutorial compares both kinds of material, for a titanium nozzle at 800 K and for a panel that is
# coated with titanium dioxide. At the end you know when an average over the band is enough. The
# computer needs about ten seconds.
#
# The sample files contain the refractive indices of titanium and of its dioxide (`titanium.csv`,
# `tio2.csv`), a materials file that uses them (`spectral.toml`), and a scene with a nozzle above a
# panel (`nozzle.xml`). This cell copies them to a new folder and changes to this folder.

# %%
import os
import shutil
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import mi_lcair

folder = TemporaryDirectory()
shutil.copytree(files("mi_lcair.scenes") / "examples", folder.name, dirs_exist_ok=True)
os.chdir(folder.name)
print(Path("spectral.toml").read_text().partition("[panel")[0])

# %% [markdown]
# ## The nozzle
#
# `nozzle.xml` uses each material by wavelength. With `surfaces = average` it uses the average of
# the reflectance over the band instead. The average is weighted with the radiation of a blackbody
# at the temperature `average_K`. This temperature matters: a metal absorbs more at short
# wavelengths, and a hot body emits more there.

# %%
surfaces = {
    "by wavelength": {},
    "average for 300 K": {"surfaces": "average", "average_K": 300},
    "average for 800 K": {"surfaces": "average", "average_K": 800},
}
signatures = {
    name: mi_lcair.signature("nozzle.xml", spp=64, parameters=parameters, by_spectrum=True)
    for name, parameters in surfaces.items()
}
exact = signatures["by wavelength"].intensity
pd.DataFrame(
    {
        "intensity (W/sr)": {name: s.intensity for name, s in signatures.items()},
        "difference (%)": {name: 100 * (s.intensity / exact - 1) for name, s in signatures.items()},
    }
).round(3)

# %% [markdown]
# With the average for 300 K, the nozzle is a fifth too dark. With the average for the nozzle's own
# temperature, the intensity is right to a per cent. The spectrum is still wrong. If a sensor uses
# only a part of the band, or if the air absorbs a part of it, the result has an error.

# %%
assert signatures["average for 300 K"].intensity < 0.85 * exact
assert abs(signatures["average for 800 K"].intensity / exact - 1) < 0.02
x = np.linspace(3, 5, 401)
figure, axis = plt.subplots(figsize=(7, 3.5), layout="constrained")
for name, result in signatures.items():
    axis.plot(x, result.effective_areas.curves(x)["target.nozzle"], label=name)
axis.set_xlabel("wavelength (µm)")
axis.set_ylabel("spectral intensity (W sr⁻¹ µm⁻¹)")
axis.set_title("Nozzle of titanium at 800 K")
axis.set_ylim(bottom=0)
axis.legend()
plt.show()

# %% [markdown]
# The program divides the band into wavelength bins. The result says how many bins were used, and
# the error that they cause.

# %%
print(signatures["by wavelength"].bins)

# %% [markdown]
# ## The panel
#
# The reflectance of titanium dioxide changes within LWIR. The sky is cold at wavelengths where the
# air is transparent, and warm where it is not. The reflected sky radiance therefore depends on both
# spectra, wavelength by wavelength. The same is true for the radiance that arrives at a sensor
# through air. The next cell has a horizontal panel under a clear sky.

# %%
Path("panel.xml").write_text("""
<scene version="3.0.0">
    <default name="average_K" value="300"/> <default name="surfaces" value="spectral"/>
    <integrator type="bounce_path"> <integer name="max_bounces" value="1"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world"> <scale value="0.4"/>
            <lookat origin="0, -3, 3" target="0, 0, 0" up="0, 0, 1"/> </transform>
        <film type="hdrfilm"> <integer name="width" value="1"/> <integer name="height" value="1"/>
            <string name="pixel_format" value="luminance"/> </film>
    </sensor>
    <bsdf type="material" id="spectral">
        <string name="material" value="panel"/> <string name="materials" value="spectral.toml"/>
        <string name="band" value="LWIR"/>
    </bsdf>
    <bsdf type="material" id="average">
        <string name="material" value="panel"/> <string name="materials" value="spectral.toml"/>
        <string name="band" value="LWIR"/> <float name="average_K" value="$average_K"/>
    </bsdf>
    <shape type="rectangle">
        <ref id="$surfaces"/>
        <emitter type="thermal"> <string name="band" value="LWIR"/>
            <float name="temperature" value="298"/> </emitter>
    </shape>
    <emitter type="sky"> <string name="band" value="LWIR"/> <string name="sky" value="clear"/>
    </emitter>
</scene>
""")
images = {
    name: mi_lcair.render("panel.xml", spp=4096, bins=54, parameters={"surfaces": name})
    for name in ("spectral", "average")
}
figure, axis = plt.subplots(figsize=(7, 3.5), layout="constrained")
for image, label in zip(images.values(), ("by wavelength", "average for 300 K")):
    axis.plot(image.wavelengths_um, image.cube_temperature[:, 0, 0], label=label)
axis.set_xlabel("wavelength (µm)")
axis.set_ylabel("brightness temperature (K)")
axis.set_title("Panel of titanium dioxide at 298 K under a clear sky")
axis.legend()
plt.show()

# %% [markdown]
# The panel looks colder than 298 K because it reflects a cold sky. Near 9.6 µm the effect is a
# little smaller, because ozone makes the sky warmer. Beyond 11 µm the coating has a high
# reflectance. A material with the average has the same, medium reflectance in the whole band.
#
# ## Its contrast
#
# A sensor looks down on the panel in front of a background at 295 K, from 10 m and from 2 km.

# %%
Path("panel.toml").write_text("""
[target]
scene = "panel.xml"
height_m = 50
[observer]
range_m = 10
azimuth_deg = -90
elevation_deg = 45
[atmosphere]
table = "midlat_summer"
[background]
temperature = 295
[sensor]
band = "LWIR"
[render]
max_bounces = [1]
spp = 4096
resolution = 1
""")
rows = []
for range_m in (10, 2000):
    for name in ("spectral", "average"):
        changes = {"observer.range_m": range_m, "target.parameters.surfaces": name}
        total = mi_lcair.contrast("panel.toml", parameters=changes).rows[0].total
        rows.append((range_m, name, *(range_m**2 * np.array(total.pair))))
columns = ["range (m)", "material", "contrast (W/sr)", "standard error (W/sr)"]
contrasts = pd.DataFrame(rows, columns=columns)
contrasts.round(4)

# %% [markdown]
# With the average, the contrast is wrong by a tenth. No other average would be right: the reflected
# radiance depends on the reflectance weighted with the sky's radiance, and the emitted radiance on
# the reflectance weighted with the radiation of a blackbody at the panel's temperature. The air
# changes both weights.

# %%
spectral, average = (
    contrasts[contrasts["material"] == name].iloc[:, 2].to_numpy() for name in images
)
print(f"differences: {100 * (average / spectral - 1)} %")
assert np.all(abs(average / spectral - 1.1) < 0.03)
