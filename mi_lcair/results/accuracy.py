"""The error of a result in words, and whether it was allowed."""

from mi_lcair.fraction import percent


def interval(half_width: float, value: float, unit: str, of: str, absolute: bool = False) -> str:
    """The 95 % interval of a value in words, as a fraction of the value if it is not zero.

    `half_width` is half of the interval. `of` names the value, such as "the target's intensity".
    `absolute`: state the half width in its unit too.
    """
    width = f"{half_width:.2g} {unit}"
    if half_width >= abs(value):
        return f"the 95 % interval is +- {width}, and {of} may be zero"
    fraction = percent(half_width / abs(value))
    return f"the 95 % interval is +- {f'{width}, ' if absolute else ''}{fraction} of {of}"


def error_row(
    error: str,
    tolerance: float | str | None = None,
    reached: bool | None = None,
    where: str = "",
    remedy: str = "raise --max-spp",
) -> tuple[str, str]:
    """Row (label, text) of `Facts`: the error of a result and whether it was allowed.

    Parameters
    ----------
    error : str
        The error in words, see `interval`.
    tolerance : float or str or None
        Allowed error, a fraction or in words. Without one, the row only states the error.
    reached : bool or None
        Whether the tolerance was reached.
    where : str
        Which of several results reached it.
    remedy : str
        What to do if it was not reached.
    """
    if tolerance is None:
        return "error", error
    allowed = tolerance if isinstance(tolerance, str) else f"{100 * tolerance:.4g} %"
    where = f" {where}" if where else ""
    if reached:
        return "tolerance", f"{allowed} reached{where}: {error}"
    return "tolerance", f"{allowed} NOT reached{where}: {error}; {remedy}"


def planned_row(error: str, entries: dict) -> tuple[str, str]:
    """`error_row` for the dictionary of a result that may have a plan.

    The tolerance is then that of plan and noise together.
    """
    plan = entries.get("plan")
    if plan:
        error += f", and the plan leaves out at most {percent(plan['bias'])}"
    return error_row(error, (plan or entries)["tolerance"], entries["reached"])
