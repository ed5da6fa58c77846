"""The method of `half_vector` with scrambled Sobol points in place of random numbers.

Each repetition has its own scrambling. It is Owen's, computed by a hash: Burley, Practical
Hash-based Owen Scrambling, JCGT 9(4), 2020.
"""

from functools import cache

import drjit as dr
import numpy as np
from drjit.llvm import Float64, UInt32
from scipy.stats import qmc

from benchmarks.methods.reflectance.half_vector import EFFORTS, weights
from benchmarks.methods.reflectance.method import ReflectanceMethod, lanes, mean

DIMENSIONS, BITS = 3, 32


def run(problem, samples, repetitions, seed):
    """Return `repetitions` estimates of the DHR, each from `samples` directions."""
    rng = dr.rng(seed)
    repetition, sample = lanes(samples, repetitions)
    numbers = []
    for digits in reversed_digits():
        key = UInt32(rng.random(Float64, repetitions) * 2.0**BITS)
        scrambled = dr.brev(
            laine_karras(dr.gather(UInt32, digits, sample), dr.gather(UInt32, key, repetition))
        )
        numbers.append((Float64(scrambled) + 0.5) * 2.0**-BITS)
    return mean(weights(problem, *numbers), samples)


@cache
def reversed_digits() -> list[UInt32]:
    """Return the first Sobol points with their binary digits in reverse, an array per dimension."""
    points = qmc.Sobol(DIMENSIONS, scramble=False, bits=BITS).random(max(EFFORTS))
    return [dr.brev(UInt32(np.ldexp(column, BITS).astype(np.uint32))) for column in points.T]


def laine_karras(x, key):
    """Return a hash of x in which each digit depends only on the key and on lower digits.

    Applied to reversed digits it is Owen's scrambling.
    """
    x = x + key
    for multiplier in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x = x ^ (x * multiplier)
    return x


method = ReflectanceMethod("half-vector sampling, Sobol (ours)", "", EFFORTS, run)
