"""Recording of the launches of one tracer, so that later ones do not run its Python code.

Dr.Jit's `freeze` records which kernels a function launches, and launches them again for other
arrays. An array that it was not given is an error, but a Python number goes into the recording
unseen. A recording must therefore never outlive the state of the scene for which it was made. It
belongs to a `PathTracer`, which does not change. What differs between its launches is either an
array or part of the key.
"""

import os
import warnings

import drjit as dr

OFF = "MI_LCAIR_NO_RECORDING"  # environment variable; not empty: nothing is recorded
MOST_RECORDINGS = 16  # of one tracer; the one used least recently is dropped


class Recorded:
    """Recordings of a tracer's `block_sums`, called like it with the tracer before the arguments.

    reason: why launches are traced and not recorded; None if they are recorded.
    """

    def __init__(self):
        self.frozen = dr.freeze(run, limit=MOST_RECORDINGS, warn_after=2**31 - 1)
        self.reason = f"{OFF} is set" if os.environ.get(OFF) else None

    @property
    def count(self) -> int:
        """Number of recordings made so far."""
        return self.frozen.n_recordings

    def __call__(self, tracer, *arguments):
        """Result of the function, from a recording if there is one.

        arguments: PyTrees of Dr.Jit arrays, and numbers and texts. There is a recording for each
        set of numbers and texts. The widths of arrays may differ from call to call.
        """
        if self.reason is None:
            try:
                return self.frozen(tracer, *arguments)
            except RuntimeError as error:
                self.frozen.clear()
                self.reason = f"the recording failed: {error.__cause__ or error}"
                warnings.warn(
                    f"launches are not recorded, and small ones are slower: {self.reason}",
                    stacklevel=2,
                )
        return tracer.block_sums(*arguments)


def run(tracer, *arguments):
    """The function that is recorded."""
    return tracer.block_sums(*arguments)
