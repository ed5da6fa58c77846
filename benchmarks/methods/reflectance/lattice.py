"""The method of `half_vector` with the points of the renderer's sampler `lattice`.

Each repetition is a randomisation of the lattice, with shifts of its own.
"""

import drjit as dr
import mitsuba as mi
from drjit.llvm import Float64

from benchmarks.methods.reflectance.half_vector import EFFORTS, weights
from benchmarks.methods.reflectance.method import ReflectanceMethod, lanes, mean
from mi_lcair.plugins.samplers.lattice import Lattice


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    repetition, sample = (mi.UInt32(number) for number in lanes(samples, repetitions))
    sampler = Lattice.at(repetition, sample, dr.opaque(mi.UInt32, seed))
    # The problem's arrays have no derivatives, so those of the sampler lose them
    numbers = (Float64(dr.detach(sampler.next_1d(), preserve_type=False)) for _ in range(3))
    return mean(weights(problem, *numbers), samples)


method = ReflectanceMethod("half-vector sampling, lattice (ours)", "", EFFORTS, run)
