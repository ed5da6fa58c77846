# %% [markdown]
# # A box through a day
#
# A box of bare aluminium with a black lid stands on soil. This tutorial computes its temperatures
# over a summer day from the weather. Then it computes the intensity of the box against time, and
# images at dawn and at noon.

# %%
import shutil
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mi_lcair
from mi_lcair import models3d, scenes

folder = Path(tempfile.mkdtemp())
for name in ("box.obj", "heat.toml", "day.csv"):
    shutil.copy(scenes.FOLDER / "examples" / name, folder)
models3d.export(models3d.read(folder / "box.obj"), folder / "box")
print((folder / "heat.toml").read_text())

# %% [markdown]
# ## Temperatures
#
# The temperature of each facet follows from a balance of radiation, sunlight, and heat to the air
# and to the wall behind it. The bands in the picture show two standard uncertainties on each side.
# The table says how much each input contributes to the uncertainty.

# %%
heat = mi_lcair.heat(folder / "heat.toml")
heat.plot()
lid = heat.of_groups(heat.kelvin)[:, heat.facets.groups.index("lid")]
error = heat.means.standard_error[:, heat.facets.groups.index("lid")]
noon = heat.row(12)
print(f"lid at noon: {lid[noon]:.1f} +- {error[noon]:.1f} K")
changes = {row.quantity: row.contribution[noon, 5] for row in heat.inputs}
print({name: round(float(change), 2) for name, change in changes.items()})
assert 320 < lid[noon] < 345
assert abs(changes["h"]) > abs(changes["absorptance"])

# %% [markdown]
# The coefficient of convection has an uncertainty of 30 %. By day it contributes most to the
# uncertainty of the temperatures. At night the lid is colder than the air, because it radiates to
# the sky.

# %%
assert lid.min() < 286

# %% [markdown]
# ## Radiance against time
#
# One render gives the effective area of each facet: the intensity that the facet causes, divided by
# its blackbody radiance. The areas do not change with temperature. The intensity at all times
# follows from them.

# %%
figure, axes = plt.subplots()
values, sigma = heat.intensity.value, heat.intensity.standard_error
axes.plot(heat.hours, values)
axes.fill_between(heat.hours, values - 2 * sigma, values + 2 * sigma, alpha=0.2)
axes.set(xlabel="hour", ylabel="intensity of the box, LWIR (W/sr)")
assert values[noon] > values[heat.row(4)]

# %% [markdown]
# ## Images at dawn and at noon
#
# The temperatures at one time are saved in a file. A scene that is loaded with this file as `modes`
# has these temperatures.

# %%
figure, pair = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
kelvin = []
for axes, hour in zip(pair, (4, 12)):
    heat.save(folder / "now.csv", hour=hour)
    view = {"azimuth_deg": 30, "elevation_deg": 35, "resolution": 96}
    scene = mi_lcair.load(folder / "box" / "scene.xml", modes=folder / "now.csv", **view)
    image = mi_lcair.render(scene, spp=64).channels["temperature.Y"]
    kelvin.append(np.where(image > 0, image, np.nan))
    coldest = np.nanpercentile(kelvin[-1], 2)  # pixels at the plate's edge see the void
    drawn = axes.imshow(kelvin[-1], cmap="inferno", vmin=coldest)
    figure.colorbar(drawn, ax=axes, label="apparent temperature (K)")
    axes.set(title=f"{hour}:00", xticks=[], yticks=[])
assert np.nanmax(kelvin[1]) > np.nanmax(kelvin[0]) + 20

# %% [markdown]
# At dawn the lid is darker than the soil. The aluminium reflects the surroundings at both times.
# Its apparent temperature is therefore very different from its true temperature.
