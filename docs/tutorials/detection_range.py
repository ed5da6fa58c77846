# %% [markdown]
# # From a scenario to a detection range
#
# This tutorial computes the ranges at which two sensors detect a landing airliner, by night and by
# day. One sensor is a detector that integrates over its whole field of view. The other one is a
# camera with pixels, blur and noise. The computer needs about twenty seconds.
#
# One TOML file, the scenario, describes everything. Its first table names a scene and its
# parameters, here a bundled airliner under a clear sky. You can use your own scene instead, such as
# that of [the Blender tutorial](blender_model.py). This cell writes the file to a new folder.

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
sky = "midlat_summer_clear" # sky that the aircraft reflects

[pose]
pitch_deg = 10                  # nose up

[observer] # direction from the aircraft
range_m = 2000
azimuth_deg = 90                # on its left side
elevation_deg = -11.3           # below it, so that the observer looks up

[atmosphere]
table = "midlat_summer"         # air between aircraft and sensor

[background]
sky = "midlat_summer_clear" # sky behind the aircraft

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
least_pixels = 50 # a detection needs this many pixels on the target
""")
os.chdir(folder.name)
# %% [markdown]
# ## The contrast by night
#
# The detector sees the target through the air. It also sees the radiation of the air in front of
# the target. It does not see the part of the sky that the target hides. The contrast is the change
# that the target causes:
#
#     contrast = target + path - background

# %%
night = mi_lcair.contrast("airliner.toml")
night

# %% [markdown]
# The first panel shows the spectral intensity at the airliner. The second panel shows the spectrum
# after the air. Near 4.3 µm carbon dioxide absorbs all radiation. The third panel shows the terms
# of the contrast.

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
# A detection needs a contrast of `snr` (required signal-to-noise ratio) times `nei`
# (noise-equivalent irradiance), which is 5·10⁻⁵ W/m² here. The program computes the range at which
# the contrast falls to this value. This needs no other render, because the intensity of the
# aircraft does not depend on the range. Only the air does.

# %%
(reach,) = night.detection_ranges()
reach

# %% [markdown]
# There are two checks. At exactly this range, a new contrast must be 5·10⁻⁵ W/m². Without air the
# contrast is inversely proportional to the square of the range. The range in vacuum is therefore
# known in closed form.

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
# The scene has a parameter that adds the sun. The elevation of the sun is 45°. The sky behind the
# aircraft now includes scattered sunlight, from the same sun as in the scene. Azimuths are counted
# from the nose toward the left side, where the sensor is.


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
# With the sun at azimuth 60, a flat facet of the nose mirrors it to the sensor. Compared with the
# night, this glint increases the contrast by a third, and the range by a seventh. With the sun 30°
# further back, the glint misses the sensor. Sunlight that the bare metal scatters then adds a few
# per cent. The temperatures are the same as at night, because heating by the sun is not included
# here.

# %%
glint, scattered = results["day, sun at 60°"].rows[-1], results["day, sun at 90°"].rows[-1]
error = np.hypot(glint.target.standard_error, row.target.standard_error)
assert glint.target.value - row.target.value > 10 * error
assert 0 < scattered.target.value - row.target.value < 0.1 * row.target.value

# %% [markdown]
# In LWIR the irradiance of the sun is a fourteenth of that in MWIR, and the sky and the skin are
# brighter than in MWIR. Day and night therefore give the same contrast within the errors.

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
# The detector above has one pixel. The table `[camera]` of the scenario describes a real camera.
# `image` renders the aircraft for this camera, adds the air, and computes the electrons from the
# photons, with the noise of each frame.

# %%
frames = mi_lcair.image("airliner.toml", spp=16, frames=20)
frames

# %% [markdown]
# Panel (a) is the first frame. Panel (b) shows the blur of the optics and the pixels. Panel (c)
# compares two different errors: the noise of the camera is new in each frame, and the error of the
# rendering is the same in all frames. The metal skin mirrors the exhausts. With 16 paths per pixel,
# the error of the rendering is more than a kelvin there. A warning says so, and says how to reduce
# the error.

# %%
print(*frames.remarks, sep="\n")

# %% [markdown]
# The noise-equivalent temperature difference (NETD) has a closed form. The next cell compares it
# with the frames: in a pixel of the sky, the standard deviation of the apparent temperature from
# frame to frame must be the NETD.

# %%
sky = np.array([frames.temperature(number)[:16] for number in range(20)])
scatter = np.sqrt(np.mean(np.var(sky, axis=0, ddof=1)))
print(f"scatter of the sky {1e3 * scatter:.1f} mK, NETD {1e3 * frames.measures.netd:.1f} mK")
assert abs(scatter / frames.measures.netd - 1) < 0.03

# %% [markdown]
# ## The camera's range
#
# The result also has the table of panel (c): pixels on the target, its electrons above the
# background, and its signal-to-noise ratio against range. This camera resolves the aircraft. The
# detection range is therefore limited by the required 50 pixels, not by noise.

# %%
table = frames.to_dataframe()
table

# %% [markdown]
# The table is computed from the render, without the blur of the camera and the edges of the frame.
# The sum of the electrons of the target in the frame must agree with the table. The number of
# pixels on the target is inversely proportional to the square of the range. The camera's detection
# range is therefore known in closed form.

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
# - [Camera](../howto/camera.md): the meaning of its numbers, frames as TIFF.
# - [Daylight](../howto/daylight.md) and [clear air](../howto/atmosphere.md): sun, sky and air.
# - [The airliner by day](../validation/day.md): other directions of the sun.
# - [Budget](../howto/budget.md): the uncertainty of the contrast due to uncertain temperatures and
#   materials.
