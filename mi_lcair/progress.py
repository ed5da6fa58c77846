"""Progress reports of long calculations."""

from collections.abc import Callable

# Called with the amount of work that is done and all that is expected
Progress = Callable[[int, int], object]


def stepper(progress: Progress | None, total: int) -> Callable[[], None]:
    """A function that counts a step and calls progress(done, total), unless `progress` is None."""
    done = 0

    def step():
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    return step
