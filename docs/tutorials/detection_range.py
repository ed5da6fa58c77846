# %% [markdown]
# # From a scenario to a detection range
#
# At the end of this tutorial you know from how far two sensors see a landing airliner, by night
# and by day: a detector that integrates its whole field of view, and a camera with pixels, blur
# and noise. It takes twenty minutes to read, and the computer needs about twenty seconds.
#
# Everything goes into one TOML file, the scenario. Its first table names a scene and its
# parameters, here a bundled airliner under a clear sky. Your own scene takes its place, such as
# the one of [the Blender tutorial](blender_model.py). This cell writes the file to a new folder.

# %%
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import mi_lcair

folder = TemporaryDirectory()
Path(folder.name, "airliner.toml").write_text("""
[target]
scene = "a340_landing"
[target.parameters]
sky = "midlat_summer_clear"     # what the aircraft reflects

[pose]
pitch_deg = 10                  # nose up

[observer]                      # as seen from the aircraft
range_m = 2000
azimuth_deg = 90                # on its left side
elevation_deg = -11.3           # below it, so that the observer looks up

[atmosphere]
table = "midlat_summer"         # air between aircraft and sensor

[background]
sky = "midlat_summer_clear"     # what the aircraft hides

[sensor]
band = "MWIR"
nei = 5e-6                      # noise-equivalent irradiance, W/m^2
snr = 10                        # signal-to-noise ratio of a detection

[render]
max_bounces = 3
tolerance = 0.03                # of the contrast

[camera]
focal_length_mm = 60
f_number = 2.5
pitch_um = 15
width = 320
height = 128
integration_time_ms = 0.3
well_Me = 10                    # a pixel holds 10 million electrons
quantum_efficiency = 0.7
read_noise_e = 300
least_pixels = 50               # a detection needs so many pixels on the target
""")
os.chdir(folder.name)
# %% [markdown]
# ## The contrast by night
#
# The detector sees the target through the air. It sees the air before the target, too. It does not
# see the part of the sky that the target hides. The contrast is what the target changes:
#
#     contrast = target + path - background

# %%
night = mi_lcair.contrast("airliner.toml")
night

# %% [markdown]
# The first panel is the spectral intensity of the airliner, before the air. In the
# second panel the air removes all of it near 4.3 µm, where carbon dioxide absorbs. The third panel
# has the terms of the contrast.

# %%
row = night.rows[-1]
for name in ("target", "path", "background", "total"):
    value, error = getattr(row, name).pair
    print(f"{name:10s} {value:.4e} +- {error:.1e} W/m^2 (standard error)")
np.testing.assert_allclose(
    row.total.value, row.target.value + row.path.value - row.background.value, rtol=1e-6
)
assert night.reached and row.half_width <= 0.03 * row.total.value

# %% [markdown]
# ## The detection range
#
# A detection needs a contrast of `snr` times `nei`, which is 5·10⁻⁵ W/m². The range at which the
# contrast falls to that follows without another render, because the intensity of the aircraft does
# not depend on the range. Only the air does.

# %%
(reach,) = night.detection_ranges()
reach

# %% [markdown]
# Two checks. At exactly this range, a new contrast must be 5·10⁻⁵ W/m². And without air the
# contrast falls as one over the range squared, so that the range in vacuum is known in closed
# form.

# %%
needed = 10 * 5e-6  # snr * nei, W/m^2
there = mi_lcair.contrast("airliner.toml", parameters={"observer.range_m": reach.largest_m})
print(f"contrast at {reach.largest_m:.0f} m: {there.rows[-1].total.value:.3e} W/m^2")
assert abs(there.rows[-1].total.value - needed) < there.rows[-1].half_width

vacuum = mi_lcair.contrast("airliner.toml", parameters={"atmosphere.table": "vacuum"})
(in_vacuum,) = vacuum.detection_ranges()
closed_form = 2000 * np.sqrt(vacuum.rows[-1].total.value / needed)
print(f"without air {in_vacuum.largest_m:.1f} m, closed form {closed_form:.1f} m")
np.testing.assert_allclose(in_vacuum.largest_m, closed_form, rtol=1e-6)
assert in_vacuum.largest_m > 1.3 * reach.largest_m

# %% [markdown]
# ## By day
#
# The scene has a parameter for the light. The sun stands 45° high. The sky behind the aircraft is
# now the one with scattered sunlight, and its sun is that of the scene. Azimuths count from the
# nose toward the left side, where we stand.


# %%
def daylight(azimuth_deg):
    """Entries of the scenario with the sun at an azimuth."""
    return {
        "target.parameters.light": "day",
        "target.parameters.sun_azimuth_deg": azimuth_deg,
        "background.daytime_sky": "midlat_summer",
    }


results = {
    "night": night,
    "day, sun at 60°": mi_lcair.contrast("airliner.toml", parameters=daylight(60)),
    "day, sun at 90°": mi_lcair.contrast("airliner.toml", parameters=daylight(90)),
}
pd.DataFrame(
    {
        light: {
            "contrast (µW/m²)": 1e6 * result.rows[-1].total.value,
            "half of its 95 % interval (µW/m²)": 1e6 * result.rows[-1].half_width,
            "detection range (m)": result.detection_ranges()[-1].largest_m,
        }
        for light, result in results.items()
    }
).T.round(1)

# %% [markdown]
# With the sun at azimuth 60 a flat facet of the nose mirrors it to us. This glint raises the
# contrast by a third, and the range by a seventh. With the sun 30° further back the glint misses
# us, and what bare metal scatters elsewhere adds a few per cent. The temperatures are those of the
# night, because the sun does not warm the skin here.

# %%
glint, scattered = results["day, sun at 60°"].rows[-1], results["day, sun at 90°"].rows[-1]
error = np.hypot(glint.target.standard_error, row.target.standard_error)
assert glint.target.value - row.target.value > 10 * error
assert 0 < scattered.target.value - row.target.value < 0.1 * row.target.value

# %% [markdown]
# In LWIR the sun has a fourteenth of its irradiance in MWIR, and the sky and the skin are
# brighter. Day and night are the same there within the errors.

# %%
lwir = [
    mi_lcair.contrast("airliner.toml", parameters={"sensor.band": "LWIR", **light}).rows[-1]
    for light in ({}, {"target.parameters.light": "day"})
]
for name, own in zip(("night", "day"), lwir):
    print(f"LWIR by {name:5s}  {own.total.value:.3e} +- {own.half_width:.1e} W/m^2 (95 %)")
assert abs(lwir[1].total.value - lwir[0].total.value) < lwir[0].half_width + lwir[1].half_width

# %% [markdown]
# ## What a camera sees
#
# The detector above is one pixel. The table `[camera]` describes a real one. `image` renders the
# aircraft for it, adds the air, and turns photons into electrons with the noise of each frame.

# %%
frames = mi_lcair.image("airliner.toml", spp=16, frames=20)
frames

# %% [markdown]
# Panel (a) is the first frame. Panel (b) says how the optics and the pixels blur it. Panel (c) has
# two errors that must not be mixed up: the noise of the camera is new in each frame, and the error
# of the rendering is the same in all of them. The exhausts mirror themselves in the metal skin,
# and 16 paths through a pixel leave an error there of more than a kelvin. A remark says so, and
# what helps.

# %%
print(*frames.remarks, sep="\n")

# %% [markdown]
# The noise-equivalent temperature difference (NETD) has a closed form. The frames must show it: in
# a pixel of the sky the apparent temperature scatters from frame to frame by the NETD.

# %%
sky = np.array([frames.temperature(number)[:16] for number in range(20)])
scatter = np.sqrt(np.mean(np.var(sky, axis=0, ddof=1)))
print(f"scatter of the sky {1e3 * scatter:.1f} mK, NETD {1e3 * frames.measures.netd:.1f} mK")
assert abs(scatter / frames.measures.netd - 1) < 0.03

# %% [markdown]
# ## The camera's range
#
# The image is also the table of panel (c): pixels on the target, its electrons above the
# background, and its signal-to-noise ratio over range. This camera resolves the aircraft. The
# range is therefore not limited by noise but by the 50 pixels that we ask for.

# %%
table = frames.to_dataframe()
table

# %% [markdown]
# The table follows from the render alone, without the camera's blur and frame. The electrons in
# the frame must add up to the same. The number of pixels falls as one over the range squared, so
# that the camera's range is known in closed form.

# %%
at = table.set_index("range_m")
seen = np.sum(
    frames.channels["electrons.Y"] - frames.channels["electrons.background.Y"], dtype=float
)
print(f"electrons in the frame {seen:.4e}, in the table {at.electrons[2000]:.4e}")
np.testing.assert_allclose(seen, at.electrons[2000], rtol=0.01)

closed_form = 2000 * np.sqrt(frames.measures.pixels / 50)
print(f"detected up to {frames.detected_to_m:.0f} m, closed form {closed_form:.0f} m")
np.testing.assert_allclose(frames.detected_to_m, closed_form, rtol=0.001)
assert at.lacks[20000] == "pixels" and at.detected[10000]

# %% [markdown]
# By day the camera sees the glint on the nose. Both pictures have the same scale.

# %%
by_day = mi_lcair.image("airliner.toml", parameters=daylight(60), spp=16)
figure, axes = plt.subplots(1, 2, figsize=(10, 2.6), layout="constrained")
for axis, title, result in zip(axes, ("night", "day"), (frames, by_day)):
    kelvin = result.channels["temperature.Y"][30:100, 80:240]
    drawn = axis.imshow(kelvin, cmap="inferno", vmin=288, vmax=325)
    axis.set_title(f"{title}: strongest pixel {result.measures.peak_snr:.0f} times the noise")
figure.colorbar(drawn, ax=axes, label="apparent temperature (K)", extend="max")
plt.show()
assert by_day.measures.snr > frames.measures.snr

# %% [markdown]
# ## Where to go on
#
# - [Contrast and detection range](../howto/contrast.md): all entries of a scenario.
# - [Camera](../howto/camera.md): what its numbers mean, frames as TIFF.
# - [Daylight](../howto/daylight.md) and [clear air](../howto/atmosphere.md): sun, sky and air.
# - [The airliner by day](../validation/day.md): other directions of the sun.
# - [Budget](../howto/budget.md): how uncertain the contrast is if temperatures and materials are.
