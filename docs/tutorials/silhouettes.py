# %% [markdown]
# # The shape of a blob from eight silhouettes
#
# A warm blob floats before a background that is 2 K cooler. A camera on a circle around it takes
# eight frames. This tutorial finds the shape of the blob from its silhouettes. It begins with a
# sphere, moves 24 control points of its surface, and states how well each of them is known.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import ConvexHull

import mi_lcair
from mi_lcair import models3d
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions

folder = Path(tempfile.mkdtemp())
RADIUS = 0.5  # of the first guess, m


def directions(count: int) -> np.ndarray:
    """Unit vectors (count, 3) that are spread evenly over the sphere."""
    z, turn = 1 - (2 * np.arange(count) + 1) / count, np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)


def true_radius(unit: np.ndarray) -> np.ndarray:
    """Distance (n,) of the blob's surface from the origin in directions (n, 3) [m]."""
    bumps = {(1, 0.3, 0.2): 0.24, (-0.5, 1, -0.3): -0.16, (-0.2, -0.8, 0.8): 0.15}
    radius = np.full(len(unit), RADIUS)
    for at, height in bumps.items():
        radius += RADIUS * height * np.exp(2.5 * (unit @ (at / np.linalg.norm(at)) - 1))
    return radius


def written(name: str, unit: np.ndarray, radius) -> Path:
    """The scene of a black body of 300 K with vertices in these directions."""
    hull = ConvexHull(unit)
    a, b, c = unit[hull.simplices].swapaxes(0, 1)
    is_outward = np.einsum("tk,tk->t", np.cross(b - a, c - a), a + b + c) > 0
    triangles = np.where(is_outward[:, None], hull.simplices, hull.simplices[:, ::-1])
    lines = ["v {} {} {}".format(*point) for point in np.reshape(radius, (-1, 1)) * unit]
    lines += ["o f*blackbody*300*blob", *("f {} {} {}".format(*t) for t in triangles + 1)]
    (folder / f"{name}.obj").write_text("\n".join(lines))
    models3d.export(models3d.read(folder / f"{name}.obj"), folder / name)
    scene = folder / name / "scene.xml"
    text, sensor = scene.read_text(), '<sensor type="orthographic"'
    begin, end = text.index(sensor), text.index("</sensor>") + len("</sensor>")
    scene.write_text(text[:begin] + CAMERA + text[end:])
    return scene


# %% [markdown]
# ## The frames
#
# The sensor of the scenes becomes a perspective camera, 4 m from the blob. The true blob is a mesh
# of its own, 2.5 times as fine, and with another kind of bumps than those of the control points.
# The noise of the camera is 250 mK.

# %%
BACKGROUND = 37.25  # radiance of a black background of 298 K, W m^-2 sr^-1
CAMERA = f"""
<emitter type="constant"> <spectrum name="radiance" value="{BACKGROUND}"/> </emitter>
<sensor type="perspective"> <float name="fov" value="20"/>
    <transform name="to_world"> <lookat origin="4, 0, 0" target="0, 0, 0" up="0, 0, 1"/>
        <rotate y="-1" angle="$elevation_deg"/> <rotate z="1" angle="$azimuth_deg"/> </transform>
    <film type="hdrfilm">
        <integer name="width" value="$resolution"/> <integer name="height" value="$resolution"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
    <sampler type="lattice"> <integer name="sample_count" value="$spp"/> </sampler>
</sensor>"""
EXACT = {"camera_sigma": "0", "model_sigma": "0"}  # a calibrated camera, and a black body
VIEWS = [
    {"azimuth_deg": 45 * k, "elevation_deg": 25 * (-1) ** k, "resolution": 24} for k in range(8)
]
truth = written("truth", directions(2000), true_radius(directions(2000)))
guess = written("guess", directions(800), RADIUS)

data, frames = [], []
for number, view in enumerate(VIEWS):
    scene = mi_lcair.load(truth, **view)
    frame = mi_lcair.render(scene, spp=1024, seed=number).channels["Y"].astype(float)
    frames.append(frame + np.random.default_rng(number).normal(0, 0.15, frame.shape))
    np.save(folder / f"view_{number}.npy", frames[-1])
    datum = {"scene": str(guess), "parameters": view, "image": str(folder / f"view_{number}.npy")}
    data.append(datum | {"quantity": "radiance", "sigma": 0.15, **EXACT})

# %% [markdown]
# ## The shape
#
# The unknown `blob.shape` stands for all control points. The prior says that the surface is within
# some 6 cm of the sphere, and that displacements over 0.4 m are alike.

# %%
motions = '[motions]\n"blob.shape" = {groups = ["self"], control_points = 24}\n'
(folder / "shape.toml").write_text(motions)
problem = {
    "data": data,
    "motions": {"blob.shape": {"groups": ["self"], "control_points": 24}},
    "unknowns": {"blob.shape": {"prior": [0, 0.06], "correlation_m": 0.4}},
    "render": {"spp": 32, "iterations": 14},
}
solution = mi_lcair.invert(problem, advise=False)
print(solution.summary())
print(f"p = {solution.p_value:.2g}, {solution.renders} renders")
assert solution.converged and solution.p_value > 1e-3

# %% [markdown]
# The start, the truth and the result in the third view, and the frame. The values of the control
# points, which are motions of the scene, give the scene the shape that was found.

# %%
values = {answer.label: answer.value for answer in solution.answers}
errors = np.array([answer.standard_error for answer in solution.answers])
found = mi_lcair.load(guess, motions=folder / "shape.toml", **VIEWS[2], **values)
sphere = mi_lcair.load(guess, **VIEWS[2])
shown = {"frame": frames[2], "first guess": sphere, "found": found, "truth": None}
shown["truth"] = mi_lcair.load(truth, **VIEWS[2])
figure, row = plt.subplots(1, 4, figsize=(9, 2.6), layout="constrained")
for axes, (title, of) in zip(row, shown.items()):
    is_frame = isinstance(of, np.ndarray)
    image = of if is_frame else mi_lcair.render(of, spp=64).channels["Y"]
    drawn = axes.imshow(image, cmap="inferno", vmin=37, vmax=39)
    axes.set(title=title, xlabel="column")
row[0].set_ylabel("row")
figure.colorbar(drawn, ax=row, label="radiance (W m$^{-2}$ sr$^{-1}$)", extend="both")

# %% [markdown]
# ## How near it is
#
# The blob is about 1 m wide. Over the whole surface, the distance to the truth is measured along
# the radius, at the corners and the middles of the triangles of the mesh that was found.

# %%
mesh = found.mi.shapes()[0]
corners = vertex_positions(mesh).astype(float)
points = np.concatenate([corners, corners[triangle_vertices(mesh)].mean(axis=1)])
radius = np.linalg.norm(points, axis=1)
distance = np.abs(radius - true_radius(points / radius[:, None]))
first = np.abs(RADIUS - true_radius(points / radius[:, None]))
for name, of in (("first guess", first), ("found", distance)):
    print(f"{name}: mean {1e3 * of.mean():.1f} mm, 95 % below {1e3 * np.quantile(of, 0.95):.1f} mm")
assert distance.mean() < 0.005 and np.quantile(distance, 0.95) < 0.01

# %% [markdown]
# The errors of the control points come from the noise of the camera and of the renders. They do not
# include that 24 control points and flat triangles cannot follow every shape. Here that is about as
# large as the noise.

# %%
parameters = mi_lcair.parameters(found)
unit = np.array([parameters[name].place for name in values])
unit /= np.linalg.norm(unit, axis=1, keepdims=True)
displacement, exact = np.array(list(values.values())), true_radius(unit) - RADIUS
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
number = np.arange(len(exact))
axes.errorbar(number, 1e3 * displacement, 2e3 * errors, fmt="o", ms=3, label="found, 2 sigma")
axes.plot(number, 1e3 * exact, "k_", label="truth")
axes.set(xlabel="control point", ylabel="displacement (mm)")
figure.legend(loc="outside upper right", ncols=2)
inside = np.abs(displacement - exact) < 2 * errors
print(f"{inside.mean():.0%} of the control points are within two standard errors")
assert np.sqrt(np.mean((displacement - exact) ** 2)) < 0.005
