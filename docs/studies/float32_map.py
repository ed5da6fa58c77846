"""The error of Float32 against Float64 over the whole parameter box, for the page on stability.

The plugin computes in Float32. The exact answer is computed in Float64 from the same Float32
vectors and parameters.
"""

import mitsuba as mi
import numpy as np
from drjit.llvm.ad import Array3f64, Float64

import mi_lcair  # noqa: F401  it chooses the LLVM and must precede the use of Dr.Jit
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics.reflection.surfaces import direction, surface
from tests.plugins.bsdfs.test_precision import theta_of
from tests.plugins.reflection_models import exact_HDR, interaction, uniform

NAMES = ("epsilon", "rho_d", "b", "e")
E = np.geomspace(1e-5, 1, 26)
B = np.array([0, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95, 1])
SHARES = ((0.0, 0.0), (0.5, 0.2), (0.5, 0.5), (0.0, 1.0))  # epsilon / G(b) and rho_d / G(b)
FROM_HORIZON_DEG = np.array([90, 60, 30, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 1e-3, 1e-4])
PER_ANGLE = 200  # number of sampled directions per viewing angle


def load(parameters, form="thesis"):
    """Return the BSDF with parameters epsilon, rho_d, b, e."""
    return mi.load_dict(
        {"type": "sandford_robertson", "form": form, **dict(zip(NAMES, map(float, parameters)))}
    )


def errors(parameters, from_horizon_deg=FROM_HORIZON_DEG, form="thesis", per_angle=PER_ANGLE):
    """Return the largest errors of one surface for each viewing angle.

    The BRDF is compared at the directions that the plugin draws. If the surface has a lobe, seven
    of eight are drawn from it.

    Parameters
    ----------
    parameters
        epsilon, rho_d, b and e.
    from_horizon_deg
        Viewing angles from the horizon [degrees].
    form
        Form of the model, "thesis" or "normalized".
    per_angle
        Number of sampled directions per viewing angle.

    Returns
    -------
    tuple
        Relative error of the BRDF, relative error of a sample's weight, absolute error of HDR; one
        value per viewing angle each.
    """
    bsdf, count = load(parameters, form), per_angle * len(from_horizon_deg)
    S = surface(*bsdf.values, form)
    r = direction(np.radians(90 - np.repeat(from_horizon_deg, per_angle)), Vector=mi.Vector3f)
    bs, weight = bsdf.sample(
        mi.BSDFContext(), interaction(r), *uniform(count, 1), mi.Point2f(*uniform(count, 2, seed=3))
    )
    value = bsdf.eval(mi.BSDFContext(), interaction(r), bs.wo)[0]
    HDR = bsdf.HDR(r)
    i, r = (np.array(vector, dtype=float) for vector in (bs.wo, r))
    used = (i[2] > 0) & (weight[0].numpy() > 0)
    raw = exact_HDR(bsdf, theta_of(r))
    exact = sr.f(S, Array3f64(i), Array3f64(r)).numpy() * i[2] / np.maximum(raw, 1)
    lobe, floor = (
        part.numpy().astype(float)
        for part in (bsdf.lobe_probability(mi.Vector3f(r)), mi.Float(i[2] / np.pi))
    )
    density = lobe * sr.lobe_pdf(Array3f64(i), Array3f64(r), S.e).numpy() + (1 - lobe) * floor
    relative = lambda value, exact: (
        np.abs(value.numpy() - exact) / np.maximum(np.abs(exact), 1e-30) * used
    )
    by_angle = lambda error: error.reshape(-1, per_angle).max(axis=1)
    return (
        by_angle(relative(value, exact)),
        by_angle(relative(weight[0], exact / np.where(used, density, 1))),
        by_angle(np.abs(HDR.numpy() - np.minimum(raw, 1))),
    )


def feasible(share_epsilon, share_rho_d, b, e):
    """Return epsilon, rho_d, b, e from epsilon and rho_d as shares of their bound G(b)."""
    # The factor keeps the sum below G(b) when it is rounded to Float32.
    G = sr.G(Float64(b))[0] * (1 - 1e-7)
    return share_epsilon * G, share_rho_d * G, b, e


def study():
    """Return four maps of the largest error over the parameters that a map does not show.

    The first is the error of the BRDF up to 89.9 degrees, (len(B), len(E)). The others are the
    errors of the BRDF, of a sample's weight and of HDR, (viewing angles, len(E)).
    """
    by_b, by_angle = np.zeros((len(B), len(E))), np.zeros((3, len(FROM_HORIZON_DEG), len(E)))
    for column, e in enumerate(E):
        for row, b in enumerate(B):
            for shares in SHARES:
                value, weight, HDR = errors(feasible(*shares, b, e))
                by_b[row, column] = max(by_b[row, column], value[FROM_HORIZON_DEG >= 0.1].max())
                by_angle[:, :, column] = np.maximum(by_angle[:, :, column], [value, weight, HDR])
    return by_b, *by_angle


def draw(path, by_b, value, weight, HDR):
    """Draw the four maps of `study` into a file."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), layout="constrained")
    axes = figure.subplots(2, 2)
    panels = [
        ("BRDF value, relative, to 89.9 degrees", by_b, B, "b"),
        ("BRDF value, relative", value, FROM_HORIZON_DEG, "view"),
        ("weight of a sample, relative", weight, FROM_HORIZON_DEG, "view"),
        ("HDR and emissivity, absolute", HDR, FROM_HORIZON_DEG, "view"),
    ]
    for axis, (title, error, labels, what) in zip(axes.flat, panels):
        image = axis.imshow(
            np.log10(np.maximum(error, 1e-8)),
            origin="lower",
            aspect="auto",
            vmin=-7,
            vmax=-1,
            cmap="viridis",
        )
        axis.set_title(f"{title}: worst {error.max():.0e}")
        axis.set_yticks(
            range(len(labels)),
            [f"{label:g}" if what == "b" else f"{90 - label:.8g}" for label in labels],
        )
        axis.set_ylabel("grazing-angle parameter b" if what == "b" else "angle of view [deg]")
        axis.set_xticks(range(0, len(E), 5), [f"1e{round(np.log10(e))}" for e in E[::5]])
        axis.set_xlabel("lobe width e")
    bar = figure.colorbar(image, ax=axes, ticks=range(-7, 0), shrink=0.8)
    bar.ax.set_yticklabels([f"1e{k}" for k in range(-7, 0)])
    bar.set_label("worst error over the rest of the parameter box and all source directions")
    figure.suptitle("sandford_robertson in Float32 against Float64, thesis form")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
