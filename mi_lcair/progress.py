"""How long work reports how far it is."""


def stepper(progress, total: int):
    """A function that reports one more step of `total` to progress(done, total), if there is one to
    report to.
    """
    done = 0

    def step():
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    return step
