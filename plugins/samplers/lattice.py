"""Sampler `lattice`: the points of a randomly shifted lattice, for the numbers that a path uses."""

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.properties import Property

VECTOR = np.loadtxt(Path(__file__).with_name("lattice_vector.txt"), dtype=np.uint32).ravel()
# The golden ratio times 2^32. Its multiples give successive dimensions unrelated hash values.
GOLDEN = 0x9E3779B9
STEEPEST = 2**28  # largest slope of positions in a window, times 2^32
MANTISSA = 24  # bits of a uniform number that Float32 represents exactly, without rounding to 1


def hashed(x: mi.UInt32) -> mi.UInt32:
    """A permutation of the 32-bit integers that looks random (C. Wellons, `lowbias32`)."""
    x = (x ^ (x >> 16)) * mi.UInt32(0x7FEB352D)
    x = (x ^ (x >> 15)) * mi.UInt32(0x846CA68B)
    return x ^ (x >> 16)


def uniform(number: mi.UInt32) -> mi.Float:
    """A 32-bit integer as a number in 0..1, without rounding to 1."""
    return mi.Float(number >> (32 - MANTISSA)) * 2.0**-MANTISSA


def slope(number: mi.UInt32) -> mi.UInt32:
    """A slope between STEEPEST / 2 and STEEPEST from a random number."""
    return STEEPEST // 2 + dr.mul_hi(number, mi.UInt32(STEEPEST // 2))


class Lattice(mi.Sampler):
    r"""Points of an embedded rank-1 lattice with a random shift in each dimension.

    Number d of point i of a randomisation is the fraction

        u_d(i) = (g(i) z_d + s_d) / 2^32 mod 1,

    where g(i) is i with its 32 bits in reverse order, z the generating vector of `VECTOR` and s_d
    the shift, a hash of the randomisation and d. The first 2^m points are a lattice for every m.
    More points continue it. The points of a randomisation are not independent of each other. Their
    scatter therefore gives no error of the mean. Different randomisations are independent. The
    scatter of their means gives the error.

    Beyond dimension 1024 the generating vector is repeated, with other shifts.

    ============ ======= ===========================================================
    sample_count integer points of a pixel                                        (4)
    ============ ======= ===========================================================

    With Mitsuba's own integrators each pixel gets one randomisation of `sample_count` points, from
    `first_point` on, in any variant that starts with `llvm_`. `mi_lcair.render_with_errors` renders
    several randomisations and continues them. Variants that start with `cuda_` have not been tried.
    Variants that start with `scalar_` do not have the sampler. For `bounce_path`, see `Launch`.

    Source: R. Cools, F. Y. Kuo, D. Nuyens, SIAM J. Sci. Comput. 28 (2006) 2162.
    """

    PROPERTIES = (Property("sample_count", "integer", 4, lower=1),)  # read by Mitsuba's class

    def __init__(self, props, vector=None):
        super().__init__(props)
        self.vector = mi.UInt32(VECTOR) if vector is None else vector
        self.reversed_index, self.key, self.dimension = (mi.UInt32(0) for _ in range(3))
        self.first_point = 0  # point of a pixel's randomisation that `seed` begins with

    @staticmethod
    def at(
        randomisation: mi.UInt32, point: mi.UInt32, seed: mi.UInt32, vector: mi.UInt32 | None = None
    ) -> "Lattice":
        """A sampler whose lanes have these numbers of a randomisation and of a point in it.

        vector: a copy of `VECTOR` to use; None makes one.
        """
        sampler = Lattice(mi.Properties(), vector)
        sampler.place(randomisation, point, seed)
        return sampler

    def place(self, randomisation: mi.UInt32, point: mi.UInt32, seed: mi.UInt32) -> None:
        self.reversed_index = dr.brev(point)
        # Two rounds, so that seed 1 of randomisation 2 is not seed 2 of randomisation 1
        self.key = hashed(randomisation + hashed(mi.UInt32(seed) + GOLDEN))
        self.dimension = mi.UInt32(0)

    def seed(self, seed, wavefront_size=0xFFFFFFFF):
        super().seed(seed, wavefront_size)
        lane = dr.arange(mi.UInt32, self.wavefront_size())
        points = dr.opaque(mi.UInt32, self.sample_count())
        # An opaque seed, so that one kernel serves all seeds
        seed = mi.UInt32(seed)
        dr.make_opaque(seed)
        first = dr.opaque(mi.UInt32, self.first_point)
        self.place(lane // points, first + lane % points, seed)

    def advance(self):
        super().advance()
        self.key, self.dimension = hashed(self.key + GOLDEN), mi.UInt32(0)

    def next_1d(self, active=True):
        return uniform(self.next_integer())

    def next_2d(self, active=True):
        x = self.next_1d(active)
        return mi.Point2f(x, self.next_1d(active))

    def next_position(self):
        """A position in a window: the next two numbers, sheared along both axes by random slopes.

        The coordinates of a lattice's points are evenly spaced, and something in the window that
        repeats with their spacing would be hit by all of them or by none. Each randomisation
        therefore moves the points along x by a part of their y, and then along y by a part of their
        x. The slopes are small, so that a function of one coordinate is still sampled evenly.
        """
        first = hashed(self.key ^ GOLDEN)
        x, y = self.next_integer(), self.next_integer()
        x += dr.mul_hi(slope(first), y)
        y += dr.mul_hi(slope(hashed(first)), x)
        return mi.Point2f(uniform(x), uniform(y))

    def next_integer(self) -> mi.UInt32:
        """The next number times 2^32."""
        z = dr.gather(mi.UInt32, self.vector, self.dimension % len(VECTOR))
        number = self.reversed_index * z + hashed(self.key + self.dimension * GOLDEN)
        self.dimension += 1
        return number

    def fork(self):
        """A sampler with the same sample count and first point, not seeded."""
        sampler = Lattice(mi.Properties())
        sampler.first_point = self.first_point
        sampler.set_sample_count(self.sample_count())
        return sampler

    def clone(self):
        """A copy that continues with the same numbers."""
        sampler = self.fork()
        for name in ("reversed_index", "key", "dimension"):
            setattr(sampler, name, mi.UInt32(getattr(self, name)))
        return sampler

    def schedule_state(self):
        super().schedule_state()
        dr.schedule(self.reversed_index, self.key, self.dimension)

    def to_string(self):
        return f"Lattice[sample_count = {self.sample_count()}]"
