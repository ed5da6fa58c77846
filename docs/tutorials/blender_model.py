# %% [markdown]
# # From a Blender model to signature and trend
#
# At the end of this tutorial you have the intensity of a small aircraft toward an observer, with
# its error, and a polar plot of the intensity all around it. You have both as tables for pandas and
# ParaView. The computer needs about ten seconds. You can replace the aircraft with your own model.
#
# The aircraft `drone.obj` was exported from Blender 5.0.1 with the default settings. It is one of
# the sample files of mi_lcair. This cell copies them to a new folder and changes to this folder.

# %%
import os
import shutil
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import mi_lcair
from mi_lcair import models3d
from mi_lcair.physics.blackbody import in_band_radiance

folder = TemporaryDirectory()
shutil.copytree(files("mi_lcair.scenes") / "examples", folder.name, dirs_exist_ok=True)
os.chdir(folder.name)

# %% [markdown]
# ## Read the model
#
# The faces of the model have the Blender materials `Skin` and `Nozzle`. A table gives the meaning
# of these names: a reflection model, a temperature, and a group. The results are also given for
# each group.

# %%
print(Path("drone.csv").read_text())

# %%
model = models3d.read("drone.obj", names="drone.csv")
print(*model.remarks)

# %% [markdown]
# The reader prints a warning. Blender's OBJ export writes y up unless you change its settings. Give
# the two axes of the export dialogue as `forward` and `up`. The nose of the model then points along
# +x and its top along +z.

# %%
model = models3d.read("drone.obj", names="drone.csv", forward="-Z", up="Y")
model

# %% [markdown]
# Look at this picture first. The nose is at the arrow and the fin points up. A facet emits and
# reflects on one side only, and its back is pink in the picture. There are no pink facets here. The
# nozzle with its 600 K is at the tail, which none of the three views shows.
#
# The report counts other possible faults of a model.

# %%
report = models3d.report(model)
for name in ("open_edges", "inward", "degenerate", "duplicate", "non_planar"):
    print(f"{name:10s} {report[name]}")
    assert report[name] == 0

# %% [markdown]
# ## Make a scene
#
# `export` writes the meshes and the Mitsuba scene `drone/scene.xml`. On the command line,
# `mi-lcair import drone.obj --names drone.csv --forward -Z --up Y -o drone` does all of this.
#
# The scene has parameters. `azimuth_deg` and `elevation_deg` set the direction of the observer:
# azimuth 0 sees the nose, and 90 the left side. Here the observer is on the left, behind and above
# the model.

# %%
models3d.export(model, "drone")
scene = mi_lcair.load("drone/scene.xml", azimuth_deg=140, elevation_deg=20)
image = mi_lcair.render(scene, spp=32)
image.plot(channels=["temperature.Y"])

# %% [markdown]
# The brightness temperature of the skin is below its temperature, because the skin is not black and
# there is nothing around the aircraft that it could reflect. Only the nozzle is black.
#
# ## The signature
#
# The signature is the intensity in W/sr: the radiance, integrated over the area that the observer
# sees. With a tolerance of 1 %, half of the 95 % interval is at most 1 % of the intensity.

# %%
signature = mi_lcair.signature(scene, tolerance="1%", facets=True)
signature

# %%
assert signature.reached and signature.half_width <= 0.01 * signature.intensity
nozzle = signature.target.by_group["exhaust"]
print(f"{nozzle / signature.intensity:.0%} of the intensity comes from the nozzle")

# %% [markdown]
# ## The intensity of each facet
#
# With `facets=True` the same paths also give a table with a row for each facet of the model, that
# is, for each polygon in Blender.

# %%
facets = signature.facets.to_dataframe().sort_values("intensity_W_sr", ascending=False)
facets[["facet", "material", "temperature_K", "intensity_W_sr", "standard_error_W_sr"]].head(6)

# %% [markdown]
# The intensities of the facets add up to the intensity of the model. The brightest facet is the
# rear of the nozzle. This facet is a blackbody that faces backward, so its intensity is known:
# Planck's radiance, times its area, times the cosine between its normal and the observer's
# direction.

# %%
np.testing.assert_allclose(facets.intensity_W_sr.sum(), signature.intensity, rtol=1e-6)

brightest = facets.iloc[0]
planck = float(in_band_radiance(scene.band, 600.0))  # W m^-2 sr^-1
cosine = -np.cos(np.radians(140)) * np.cos(np.radians(20))
exact = planck * model.to_dataframe().area_m2[brightest.facet] * cosine
rendered, error = brightest.intensity_W_sr, brightest.standard_error_W_sr
print(f"rendered {rendered:.2f} +- {error:.2f} W/sr, closed form {exact:.2f} W/sr")
assert abs(rendered - exact) < 4 * error

# %% [markdown]
# A `.vtp` file contains the table and the geometry, for ParaView. Other suffixes give other
# formats, such as `.csv`, `.json` and `.vtu`.

# %%
signature.facets.save("facets.vtp")
signature.facets.save("facets.csv")
print(*sorted(Path().glob("facets*")))

# %% [markdown]
# ## The trend
#
# A trend is the intensity toward many observers. Here there are 36 azimuths at two elevations, each
# with a tolerance of 1 %.

# %%
trend = mi_lcair.trend(scene, range(0, 360, 10), [0, 20], tolerance="1%")
trend

# %% [markdown]
# Seen from behind, the nozzle alone is brighter than everything else. Seen from the front, the
# nozzle is hidden, and only the skin is visible. The model is symmetric. The intensities on the
# left and on the right must therefore agree within their errors. The trend and the signature must
# agree for the same direction. On average, one of twenty 95 % intervals does not contain the true
# value. A few differences may therefore be larger than their intervals.

# %%
table = trend.to_dataframe().set_index(["elevation_deg", "azimuth_deg"])
view = table.loc[20, 140]
print(f"trend     {view.intensity_W_sr:.2f} +- {view.half_width_W_sr:.2f} W/sr")
print(f"signature {signature.intensity:.2f} +- {signature.half_width:.2f} W/sr")
difference = abs(view.intensity_W_sr - signature.intensity)
assert difference < 2 * np.hypot(view.half_width_W_sr, signature.half_width)

level = table.loc[0]  # all azimuths at elevation 0
left = level.loc[10:170]
right = level.loc[350:190:-1].set_index(left.index)
error = np.hypot(left.half_width_W_sr, right.half_width_W_sr)
ratio = abs(left.intensity_W_sr - right.intensity_W_sr) / error
print(f"left and right differ by at most {ratio.max():.1f} half widths")
assert ratio.max() < 2
assert level.intensity_W_sr[180] > 5 * level.intensity_W_sr[0]

# %% [markdown]
# ## A check with one temperature
#
# If all facets are black and have the same temperature, the intensity toward every observer is
# Planck's radiance times the projected area. If a facet faced inward, it would be dark, and the
# check would fail. The arguments `material` and `temperature` replace the table of names.

# %%
black = models3d.read("drone.obj", material="blackbody", temperature=300, forward="-Z", up="Y")
models3d.export(black, "black")
even = mi_lcair.trend("black/scene.xml", range(0, 360, 30), tolerance="1%").table
radiance = even["intensity_W_sr"] / even["projected_area_m2"]
planck = float(in_band_radiance(scene.band, 300.0))
print(f"{radiance.min():.4f} to {radiance.max():.4f} W m^-2 sr^-1, Planck {planck:.4f}")
np.testing.assert_allclose(radiance, planck, rtol=1e-5)

# %% [markdown]
# ## Where to go on
#
# - [From Blender](../howto/blender.md): export settings, names, other file formats.
# - [Labels and facets](../howto/labels.md): a temperature for each facet, sky and terrain.
# - [Trend](../howto/trend.md): large trends, and how to resume them.
# - [From a scatterometer's data to a material](material.py): your own paint on this model.
# - [From a scenario to a detection range](detection_range.py): the air, the sun and a camera.
