"""Progress reports of long calculations."""


def stepper(progress, total: int):
    """A function that counts a step and calls progress(done, total), unless `progress` is None."""
    done = 0

    def step():
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    return step
