# %% [markdown]
# # A day of frames
#
# A camera with an uncooled detector looks at a box through a day. Its gain is known to 3 %, and its
# offset drifts. From eight frames this tutorial estimates three parameters of the box, with
# intervals, and forecasts the intensity of the box on the next, overcast day.

# %%
import shutil
import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.toml_table import text_of

folder = Path(tempfile.mkdtemp())
for name in ("box.obj", "heat.toml", "day.csv"):
    shutil.copy(scenes.FOLDER / "examples" / name, folder)
models3d.export(models3d.read(folder / "box.obj"), folder / "box")


def written(tree: dict, name: str) -> Path:
    """A heat.toml with these tables."""
    groups = {f"groups.{group}": table for group, table in tree["groups"].items()}
    path = folder / name
    path.write_text(text_of({k: v for k, v in tree.items() if k != "groups"} | groups))
    return path


guess = tomllib.loads((folder / "heat.toml").read_text())
guess["target"]["scene"] = str(folder / "box" / "scene.xml")
guess["weather"]["file"] = str(folder / "day.csv")
guess["run"] = {"steps": 48, "rays": 4096}
guess["sigma"] = {"air_K": 0.3, "sky_K": 3, "sun_W_m2": "2 %", "model_K": 0.2}
guess["groups"]["lid"]["absorptance"] = 0.8
guess["signature"] = {"spp": 64}
written(guess, "guess.toml")

# %% [markdown]
# ## The frames
#
# The frames are simulated with invented true values: the lid absorbs more sunlight and releases
# more heat than in the first guess, and the soil conducts heat better. Errors of the camera are
# added to each frame: gain, offset, drift and noise.

# %%
TRUTH = {"lid.absorptance": 0.88, "lid.internal_W_m2": 45.0, "terrain.conductivity": 1.7}
truth = tomllib.loads((folder / "guess.toml").read_text())
for name, value in TRUTH.items():
    group, _, key = name.partition(".")
    truth["groups"][group][key] = value
heat = mi_lcair.heat(truth | {"sigma": {}})

VIEW = {"azimuth_deg": 30, "elevation_deg": 40, "resolution": 48}
HOURS = (3, 6, 9, 12, 15, 18, 21, 24)
random, rows = np.random.default_rng(1), []
gain, offset = 1.02, 0.4
for hour in HOURS:
    heat.save(folder / "now.csv", hour=hour)
    scene = mi_lcair.load(folder / "box" / "scene.xml", modes=folder / "now.csv", **VIEW)
    frame = mi_lcair.render(scene, spp=1024, seed=hour).channels["Y"].astype(float)
    drift = random.normal(0, 0.3)
    frame = gain * frame + offset + drift + random.normal(0, 0.03, frame.shape)
    np.save(folder / f"frame_{hour:02}.npy", frame)
    rows.append(f"{hour},frame_{hour:02}.npy")
(folder / "frames.csv").write_text("\n".join(["hour,image", *rows]) + "\n")

figure, pair = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
for axes, hour in zip(pair, (6, 15)):
    drawn = axes.imshow(np.load(folder / f"frame_{hour:02}.npy"), cmap="inferno")
    figure.colorbar(drawn, ax=axes, label="radiance (W m$^{-2}$ sr$^{-1}$)")
    axes.set(title=f"{hour}:00", xticks=[], yticks=[])

# %% [markdown]
# ## The parameters
#
# The problem names the heat balance, the frames with the uncertainties of the camera, and the
# unknowns. Each unknown has a prior: an expected value and its standard deviation.

# %%
problem = {
    "heat": {"file": str(folder / "guess.toml")},
    "frames": [
        {
            "list": str(folder / "frames.csv"),
            "quantity": "radiance",
            "parameters": VIEW,
            "sigma": 0.03,
            "gain_sigma": "3 %",
            "offset_K": 1.0,
            "drift_K": 0.5,
            "spp": 256,
        }
    ],
    "unknowns": {
        "lid.absorptance": {"prior": [0.8, 0.1]},
        "lid.internal_W_m2": {"prior": [20, 30]},
        "terrain.conductivity": {"prior": [1.2, 0.6]},
    },
}
found = mi_lcair.invert(problem)
print(found.summary())
for name, value, low, high in zip(found.names, found.value, found.lower, found.upper):
    print(f"{name}: {value:.3g} ({low:.3g} to {high:.3g}), truth {TRUTH[name]}")
assert found.p_value > 1e-3
error = np.abs(found.value - list(TRUTH.values())) / found.standard_error
assert (error < 4).all()

# %% [markdown]
# ## The next day
#
# The next day has half the sun, a warmer sky and more wind. The uncertainty of the forecast
# includes the errors of the parameters with their correlations, of the weather, and of the balance
# itself.

# %%
text = (folder / "day.csv").read_text().splitlines()
head, table = text[1].split(","), np.array([line.split(",") for line in text[2:]], float).T
day = dict(zip(head, table))
day["sun_W_m2"], day["sky_K"] = 0.5 * day["sun_W_m2"], day["sky_K"] + 10
day["wind_m_s"] = day["wind_m_s"] + 2
lines = [",".join(f"{v:.6g}" for v in row) for row in zip(*day.values())]
(folder / "tomorrow.csv").write_text("\n".join([",".join(head), *lines]) + "\n")

found.save(folder / "twin.toml")
twin = tomllib.loads((folder / "twin.toml").read_text())
other_day = {"file": str(folder / "tomorrow.csv"), "ground_K": 288}
for tree in (twin, truth, guess):
    tree["weather"] = other_day
    tree["target"]["scene"] = str(folder / "box" / "scene.xml")
forecast = mi_lcair.heat(written(twin, "twin.toml"))
happens = mi_lcair.heat(truth | {"sigma": {}})
without = mi_lcair.heat(guess | {"sigma": {}})

figure, axes = plt.subplots(layout="constrained")
value, sigma = forecast.intensity.value, forecast.intensity.standard_error
axes.plot(forecast.hours, value, label="forecast of the twin")
axes.fill_between(forecast.hours, value - 2 * sigma, value + 2 * sigma, alpha=0.2)
axes.plot(happens.hours, happens.intensity.value, "k--", label="what happens")
axes.plot(without.hours, without.intensity.value, ":", label="first guess")
axes.set(xlabel="hour", ylabel="intensity of the box, LWIR (W/sr)")
axes.legend()
inside = np.abs(value - happens.intensity.value) < 2 * sigma
print(f"{inside.mean():.0%} of the hours lie within two standard errors")
assert inside.mean() > 0.8
