# %% [markdown]
# # From a scatterometer's data to a material in a scene
#
# At the end of this tutorial a measured paint is a material that every scene takes, and you know
# how far it can be trusted. It takes a quarter of an hour to read, and the computer needs about
# fifteen seconds.
#
# `paint.csv` holds the BRDF of a real, rough paint in the plane of incidence. It was measured from
# 2 to 5.7 µm with a goniometer and an infrared camera (its source and its licence, CC0, stand in
# the file). `paint_emissivity.csv` holds the emissivity of the same paint, which was measured in
# another way. Both are sample files of mi_lcair. This cell copies them to a new folder and goes
# there.

# %%
import os
import shutil
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import mi_lcair
from mi_lcair.fitting import read
from mi_lcair.physics.blackbody import in_band_radiance

folder = TemporaryDirectory()
shutil.copytree(files("mi_lcair.scenes") / "examples", folder.name, dirs_exist_ok=True)
os.chdir(folder.name)

# %% [markdown]
# ## Read the file
#
# A file says its angles and units in the names of its columns, and its band in the lines before
# them. `theta_r` is positive on the side of the mirror direction.

# %%
print(*Path("paint.csv").read_text().splitlines()[:10], sep="\n")

# %%
data = read("paint.csv")
print(f"{data.name}: {len(data.brdf)} points from {data.band_um[0]} to {data.band_um[1]} µm")
assert len(data.brdf) == 870

# %% [markdown]
# ## Fit a model
#
# `fit` compares all reflection models that it knows, and takes the simplest one that describes the
# data not significantly worse than the best of all. For this paint that is the microfacet model,
# with a complex refractive index n + ik, a roughness alpha, a tail exponent gamma and a diffuse
# part rho_d.

# %%
brdf_alone = mi_lcair.fit(data, starts=16)  # starting points of the search; 64 if it is left out
brdf_alone

# %% [markdown]
# Dots are measured and lines are fitted, one colour for each position of the camera. The panel
# below has their ratio. Three things are worth reading before the numbers:
#
# - `LACK OF FIT`. The residuals are no noise, because neighbouring ones are alike. A model with
#   five parameters follows this paint to about 24 %. The standard errors account for it.
# - The verdict beside each parameter says how well these data determine it. A model that misses
#   the data determines none.
# - The emissivity in the last panel was not measured here. It is what Kirchhoff's law says about
#   the fitted BRDF.

# %%
brdf_alone.to_dataframe()[["parameter", "value", "standard_error", "low", "high"]].round(4)

# %%
for parameter, verdict in brdf_alone.verdict.items():
    print(f"{parameter:6s} {verdict}")
assert brdf_alone.quality.lack_of_fit and brdf_alone.converged
assert "the model misses the measured values" in brdf_alone.verdict["n"]

# %% [markdown]
# ## What the BRDF leaves open
#
# The verdict on k asks for an emissivity. A scan in one plane does not see all of the reflected
# radiation, so it cannot tell k from 0. We have an emissivity, and give it to the fit as well. To
# save time we name the model and ask for fewer starting points.

# %%
paint = mi_lcair.fit(
    data, emissivity="paint_emissivity.csv", model="microfacet", form="standard", starts=4
)
paint

# %%
for parameter, verdict in paint.verdict.items():
    print(f"{parameter:6s} {verdict}")

# %% [markdown]
# No parameter is at its bound any more, and the misfit of the BRDF has not grown. Both kinds of
# data agree on one surface. Still k is only known to lie between 0 and 0.6. The correlation says
# why: a smaller n with a larger k reflects as much. The data determine the reflectance, and not
# the two numbers behind it.

# %%
order = list(paint.parameters)
between = paint.correlation[order.index("n"), order.index("k")]
print(f"correlation of n and k: {between:.2f}")
assert between < -0.5 and paint.rms_dex < 1.05 * brdf_alone.rms_dex
assert not any("bound" in verdict for verdict in paint.verdict.values())

# %% [markdown]
# ## Emissivity against angle
#
# The first fit did not know the measured emissivity. Its prediction is therefore a test of the
# model and of the measurement together.

# %%
angle, measured, deviation = np.loadtxt("paint_emissivity.csv", delimiter=",", skiprows=5).T
chosen = angle <= 80  # where the fits have BRDFs

figure, axis = plt.subplots(figsize=(7, 4))
axis.errorbar(angle, measured, deviation, fmt="o", color="black", label="measured")
for result, label in ((brdf_alone, "BRDF alone"), (paint, "BRDF and emissivity")):
    theta, emissivity = result.emissivity
    axis.plot(np.degrees(theta), emissivity, "-", label=f"fitted: {label}")
    misfit = np.interp(angle[chosen], np.degrees(theta), emissivity) - measured[chosen]
    print(f"{label:20s} rms difference {np.sqrt(np.mean(misfit**2)):.3f}")
    assert (abs(misfit) < 1.5 * deviation[chosen]).all()
axis.set_xlabel("angle to the normal (degrees)")
axis.set_ylabel("emissivity")
axis.legend()
plt.show()

# %% [markdown]
# Up to 80 degrees, both curves lie within 1.5 standard deviations of the measurement. The paint is
# nearly black from the front, and loses emissivity toward grazing angles, as Fresnel's equations
# say.
#
# ## Save the material
#
# The JSON file of a fit is a material. It also holds the data's checksum, the errors and the
# verdicts. The fit is refused in a band in which the paint was not measured.

# %%
paint.save("paint.json")

try:
    mi_lcair.load("furnace", material="paint.json", band="LWIR")
except mi_lcair.InputError as error:
    print(str(error).partition("paint.json': ")[2])
else:
    raise AssertionError("a material without data in LWIR was accepted")

# %% [markdown]
# ## Render it
#
# The bundled scene `furnace` is a closed room with three bodies of one material. Everything in it
# has 300 K. A blackbody's radiance must come from everywhere, whatever the material, because a
# surface reflects what it does not emit. One number that is wrong in emissivity or reflection
# breaks this.

# %%
scene = mi_lcair.load("furnace", material="paint.json", band="MWIR", resolution=64)
image = mi_lcair.render(scene, spp=64, parts=True)
blackbody = float(in_band_radiance(scene.band, 300.0))
print(f"rendered  {image.mean:.5f} +- {image.mean_error:.5f} W m^-2 sr^-1 (standard error)")
print(f"blackbody {blackbody:.5f} W m^-2 sr^-1")
assert image.mean_error < 2e-4 * blackbody
assert abs(image.mean - blackbody) < 4 * image.mean_error

# %% [markdown]
# The parts differ. `bounce00` is what each surface emits. The sphere is darker at its edge, where
# its emissivity is smaller. `bounce01` and `bounce02` came by one and two reflections. They are
# brighter where the first one is darker. `Y` is the sum of all reflections, and it is even.

# %%
image.plot(channels=["bounce00.Y", "bounce01.Y", "bounce02.Y", "Y"])

# %% [markdown]
# ## Where to go on
#
# - [Fit a material](../howto/fit.md): file formats, several bands, options.
# - [Your own reflection model](../howto/reflection_model.md): if neither model follows your
#   surface.
# - [Real surfaces](../validation/real_data.md): six of them, and what the models cannot represent.
# - [From a Blender model to its signature](blender_model.py): there, `material="paint.json"`
#   paints the whole model.
