# %% [markdown]
# # A thousand labelled frames
#
# At the end of this tutorial you have a data set of thermal frames. For each pixel the data set
# contains the visible surface, the true temperature of this surface, and the parts of the radiance.
# The tutorial makes sixteen frames, which takes about ten seconds. Its last paragraph says how to
# make a thousand.
#
# The model is the box of the sample files, between a sky and a ground. An uncooled camera records
# the box.

# %%
import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.physics.surroundings import Words
from mi_lcair.rendering.images.files import read_exr

folder = TemporaryDirectory()
os.chdir(folder.name)
model = models3d.read(scenes.FOLDER / "examples" / "box.obj")
models3d.export(model, "box", around=Words(sky="265", ground="288"))

# %% [markdown]
# In the shell the same command is `mi-lcair import box.obj --sky 265 --ground 288 -o box`. A
# scenario describes the camera and its position. `preset` gives the values of an uncooled camera
# with pixels of 12 µm. Values in the file replace those of the preset.

# %%
Path("box.toml").write_text("""
[target]
scene = "box/scene.xml"

[observer]
range_m = 20
azimuth_deg = 0
elevation_deg = 30

[atmosphere]
table = "vacuum"                # 20 m of air would be clear air such as "us_standard"

[background]
temperature = 285

[sensor]
band = "LWIR"

[render]
spp = 64
max_bounces = 3

[camera]
preset = "microbolometer_12um"
focal_length_mm = 8
width = 80
height = 60
""")

# %% [markdown]
# The data set has eight views around the box. Each view has two images with different random values
# for the unknown quantities: the temperatures of the lid, of the walls and of the background.

# %%
Path("dataset.toml").write_text("""
[base]
scenario = "box.toml"

[views]
sphere = 8
elevation_deg = [15, 60]
range_m = [18, 25]
roll_deg = [-10, 10]

[draws]
"lid.temperature" = {uniform = [300, 350]}
"self.temperature" = {uniform = [280, 310]}
"background.temperature" = {uniform = [270, 290]}

[frames]
cases = 2
truth = true
seed = 1

[splits]
train = 0.75
val = 0.125
test = 0.125
""")
made = mi_lcair.dataset("dataset.toml", "labelled")
print(made)
assert made.images == 16 and made.splits == {"train": 6, "val": 1, "test": 1}

# %% [markdown]
# The description of the data set, `labelled/README.md`, begins with an overview of the images.

# %%
Image.open("labelled/contact.png")

# %% [markdown]
# The next cell shows one image and the true values of its pixels: the counts of the camera, groups,
# true temperature, emissivity toward the camera, and the reflected share of the radiance.

# %%
stem = "000003"
counts = np.asarray(Image.open(f"labelled/images/{stem}.png")).astype(float)
truth, _ = read_exr(f"labelled/truth/{stem}.truth.exr")
on = truth["mask.Y"] > 0.5
reflected = sum(v for name, v in truth.items() if name.startswith("reflected."))
layers = {
    "counts": counts,
    "group": np.where(on, truth["IndexGroup.X"], np.nan),
    "true temperature, K": np.where(on, truth["true_temperature.Y"], np.nan),
    "emissivity": np.where(on, truth["emissivity.Y"], np.nan),
    "share reflected": np.where(on, reflected / np.maximum(truth["target.Y"], 1e-9), np.nan),
}
figure, panels = plt.subplots(1, len(layers), figsize=(14, 2.6), layout="constrained")
for panel, (name, values) in zip(panels, layers.items()):
    drawn = panel.imshow(values, cmap="inferno")
    panel.set_title(name)
    panel.set_axis_off()
    figure.colorbar(drawn, ax=panel, shrink=0.7)

# %% [markdown]
# The parts add up: emitted plus reflected radiance is the radiance that leaves the target.

# %%
whole = truth["emitted.Y"] + reflected
assert np.allclose(whole[on], truth["target.Y"][on], rtol=1e-4)

# %% [markdown]
# The next cell checks a pose. The matrix of a frame transforms coordinates of the camera, which
# looks along -z with y upward, to coordinates of the scene. A pixel and its depth therefore give a
# point of the scene. This point must lie on the box of 1 m.

# %%
tree = json.loads(Path("labelled/transforms.json").read_text())
frame = next(f for f in tree["frames"] if stem in f["file_path"])
matrix = np.array(frame["transform_matrix"])
rows, columns = np.nonzero(truth["Depth.Z"] > 0)
depth = truth["Depth.Z"][rows, columns]
x = (columns + 0.5 - tree["cx"]) / tree["fl_x"]
y = (rows + 0.5 - tree["cy"]) / tree["fl_y"]
points = matrix[:3, :3] @ (depth * [x, -y, -np.ones_like(x)]) + matrix[:3, 3:]
low, high = points.min(axis=1), points.max(axis=1)
print("points from", low.round(3), "to", high.round(3), "m")
assert (low > [-0.51, -0.51, -0.01]).all() and (high < [0.51, 0.51, 1.01]).all()

# %% [markdown]
# For a thousand frames write `sphere = 100` (views) and `cases = 10` (images of each view). All
# images of a view are computed from the same paths, because only temperatures differ. To resume an
# interrupted data set, make the same call again. `mi-lcair dataset dataset.toml -o labelled
# --workers 2` divides the views between processes. The files are identical to those of one process.
# [A data set of labelled frames](../howto/dataset.md) describes other random quantities: weather,
# hours of a day, several bands. [Two baselines](../validation/baselines.md) are simple methods to
# which you can compare your own.
