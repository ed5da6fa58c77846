# %% [markdown]
# # A heated cavity against theory
#
# A sphere with an opening has grey, diffuse walls with an emissivity of 0.5 at 800 K. A ray that
# enters the opening hits the wall many times before it leaves again. The opening is therefore
# almost black. This tutorial computes the radiance of the opening, compares it with the closed form
# for each number of reflections, and checks that the computed error is right.

# %%
import matplotlib.pyplot as plt
import numpy as np

import mi_lcair

scene = mi_lcair.load("cavity", opening=8)
result = mi_lcair.signature(scene, tolerance=0.001)
print(f"{result.target.intensity:.4f} W/sr +- {result.target.half_width:.4f} (95 %)")

# %% [markdown]
# ## The closed form
#
# The opening covers the fraction f of the sphere. In a sphere, diffuse walls irradiate each other
# evenly. After each reflection the fraction q = (1 - ε)(1 - f) of the radiation remains. After N
# reflections the radiance is
#
#     L_N = ε L_b(T) (1 + q + q² + ... + q^N) = ε L_b(T) (1 - q^(N + 1)) / (1 - q)
#
# with the radiance of a blackbody L_b = σT⁴/π (Harkiss 2007, Eq 3.12). For the parameter
# `opening=8`, f is 0.030902. The sensor sees a square of 0.06 m, its window, which lies inside the
# opening.

# %%
emissivity, temperature, fraction, window_m2 = 0.5, 800.0, 0.030902, 0.06**2
blackbody = 5.670374419e-8 * temperature**4 / np.pi  # W m^-2 sr^-1
kept = (1 - emissivity) * (1 - fraction)
exact = emissivity * blackbody / (1 - kept) * window_m2

print(f"closed form {exact:.4f} W/sr, difference {result.target.intensity / exact - 1:+.3%}")
# The facets differ from a sphere by at most 0.02 %
assert abs(result.target.intensity - exact) < result.target.half_width + 2e-4 * exact

# %% [markdown]
# ## After each number of reflections
#
# One render gives the radiance for every number of reflections. An image has it in the channels
# `bounce00.Y`, `bounce01.Y` and so on.

# %%
image = mi_lcair.render(scene, spp=64, parts=True)
by_bounce = [image.channels[f"bounce{k:02d}.Y"].mean() for k in range(8)]
expected = emissivity * blackbody * kept ** np.arange(8)
for k, (value, theory) in enumerate(zip(by_bounce, expected)):
    print(f"{k} reflections: {value:9.3f} W m^-2 sr^-1, closed form {theory:9.3f}")
np.testing.assert_allclose(by_bounce, expected, rtol=2e-3)

# %%
figure, axis = plt.subplots(figsize=(6, 3.5))
axis.semilogy(by_bounce, "o", label="rendered")
axis.semilogy(expected, "-", label="closed form")
axis.set_xlabel("reflections")
axis.set_ylabel("radiance (W m⁻² sr⁻¹)")
axis.legend()
plt.show()

# %% [markdown]
# ## How many reflections are enough?
#
# Each further reflection multiplies the missing radiance by q = 0.485. With four reflections 2.7 %
# are missing, and with ten 0.035 %. The closure `tail` estimates the missing radiance: it continues
# the radiances after the last two reflections as a geometric series. Two reflections are then
# enough.

# %%
for reflections in (4, 10):
    few = mi_lcair.load("cavity", opening=8, max_bounces=reflections)
    missing = 1 - mi_lcair.signature(few, tolerance=0.001).target.intensity / exact
    theory = kept ** (reflections + 1)
    print(f"{reflections} reflections: {missing:.3%} missing, closed form {theory:.3%}")
    assert abs(missing - theory) < 0.0015

# %% [markdown]
# ## Is the error right?
#
# Forty seeds give forty intensities with 95 % intervals. About 38 of these intervals should contain
# the mean of all intensities.

# %%
seeds = [mi_lcair.signature(scene, spp=1, seed=seed).target for seed in range(40)]
mean = np.mean([each.intensity for each in seeds])
held = sum(abs(each.intensity - mean) <= each.half_width for each in seeds)
print(f"{held} of {len(seeds)} intervals contain the mean, {mean:.4f} W/sr")
assert held >= 34
