# %% [markdown]
# # From a scatterometer's data to a material in a scene
#
# At the end of this tutorial you have a material for scenes from measurements of a paint, and you
# know how reliable it is. The computer needs about fifteen seconds.
#
# `paint.csv` contains the BRDF of a real, rough paint in the plane of incidence. It was measured
# from 2 to 5.7 µm with a goniometer and an infrared camera (the file names its source and its
# licence, CC0). `paint_emissivity.csv` contains the emissivity of the same paint, which was
# measured with another method. Both are sample files of mi_lcair. This cell copies them to a new
# folder and changes to this folder.

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
# The names of the columns give the angles and units. The lines before the names give the band.
# `theta_r` is positive on the side of the mirror direction.

# %%
print(*Path("paint.csv").read_text().splitlines()[:10], sep="\n")

# %%
data = read("paint.csv")
print(f"{data.name}: {len(data.brdf)} points from {data.band_um[0]} to {data.band_um[1]} µm")
assert len(data.brdf) == 870

# %% [markdown]
# ## Fit a model
#
# `fit` compares all reflection models that it knows. It chooses the simplest model that describes
# the data about as well as the best one. For this paint it is the microfacet model, with a complex
# refractive index n + ik, a roughness alpha, a tail exponent gamma and a diffuse part rho_d.

# %%
brdf_alone = mi_lcair.fit(data, starts=16)  # starting points of the search; default 64
brdf_alone

# %% [markdown]
# Dots are measurements and lines are the fit, with one colour for each position of the camera. The
# panel below shows the ratio of measurement and fit. Read these three points before the numbers:
#
# - `LACK OF FIT`. The residuals are not noise, because neighbouring residuals are similar. The
#   model with five parameters describes this paint to about 24 %. The standard errors take this
#   into account.
# - The verdict of each parameter says how well these data determine it. If the model does not fit
#   the data, no parameter is determined.
# - The emissivity in the last panel was not measured. It is computed from the fitted BRDF with
#   Kirchhoff's law.

# %%
brdf_alone.to_dataframe()[["parameter", "value", "standard_error", "low", "high"]].round(4)

# %%
for parameter, verdict in brdf_alone.verdict.items():
    print(f"{parameter:6s} {verdict}")
assert brdf_alone.quality.lack_of_fit and brdf_alone.converged
assert "the model misses the measured values" in brdf_alone.verdict["n"]

# %% [markdown]
# ## What the BRDF does not determine
#
# The verdict on k recommends a measured emissivity. A scan in one plane does not measure all of the
# reflected radiation. The scan therefore cannot distinguish k from 0. Here the emissivity was
# measured, and the next fit uses it as well. To save time, the call names the model and has fewer
# starting points.

# %%
paint = mi_lcair.fit(
    data, emissivity="paint_emissivity.csv", model="microfacet", form="standard", starts=4
)
paint

# %%
for parameter, verdict in paint.verdict.items():
    print(f"{parameter:6s} {verdict}")

# %% [markdown]
# No parameter is at a bound of its allowed range any more, and the residuals of the BRDF are not
# larger than before. BRDF and emissivity are consistent. However, k can still be anywhere between 0
# and 0.6. The correlation explains this: a smaller n with a larger k gives the same reflectance.
# The data determine the reflectance, but not n and k separately.

# %%
order = list(paint.parameters)
between = paint.correlation[order.index("n"), order.index("k")]
print(f"correlation of n and k: {between:.2f}")
assert between < -0.5 and paint.rms_dex < 1.05 * brdf_alone.rms_dex
assert not any("bound" in verdict for verdict in paint.verdict.values())

# %% [markdown]
# ## Emissivity against angle
#
# The first fit did not use the measured emissivity. Its prediction therefore tests the model and
# the measurement together.

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
# Up to 80 degrees, both curves are within 1.5 standard deviations of the measurement. The paint is
# nearly black along the normal. Its emissivity decreases toward grazing angles, according to
# Fresnel's equations.
#
# ## Save the material
#
# The JSON file of a fit is a material. It also contains the checksum of the data, the errors and
# the verdicts. In a band in which the paint was not measured, the scene is not loaded.

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
# has 300 K. With any material, the radiance must be that of a blackbody everywhere, because a
# surface reflects the part that it does not emit. An error in the emissivity or in the reflection
# would change this.

# %%
scene = mi_lcair.load("furnace", material="paint.json", band="MWIR", resolution=64)
image = mi_lcair.render(scene, spp=64, parts=True)
blackbody = float(in_band_radiance(scene.band, 300.0))
print(f"rendered  {image.mean:.5f} +- {image.mean_error:.5f} W m^-2 sr^-1 (standard error)")
print(f"blackbody {blackbody:.5f} W m^-2 sr^-1")
assert image.mean_error < 2e-4 * blackbody
assert abs(image.mean - blackbody) < 4 * image.mean_error

# %% [markdown]
# The parts of the radiance by number of reflections differ. `bounce00` is the emission of each
# surface. The sphere is darker at its edge, where its emissivity is smaller. `bounce01` and
# `bounce02` are radiation after one and two reflections. They are brighter where `bounce00` is
# darker. `Y` is the sum of all parts, and it is uniform.

# %%
image.plot(channels=["bounce00.Y", "bounce01.Y", "bounce02.Y", "Y"])

# %% [markdown]
# ## Where to go on
#
# - [Fit a material](../howto/fit.md): file formats, several bands, options.
# - [Your own reflection model](../howto/reflection_model.md): if no model describes your surface.
# - [Real surfaces](../validation/real_data.md): six of them, and what the models cannot represent.
# - [From a Blender model to its signature](blender_model.py): there, `material="paint.json"`
#   paints the whole model.
