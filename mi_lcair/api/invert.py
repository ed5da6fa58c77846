"""`invert`, the unknowns of a scene from measurements."""

from os import PathLike

from mi_lcair.errors import errors_of
from mi_lcair.inversion.invert import solve_problem
from mi_lcair.inversion.problem import InverseProblem
from mi_lcair.inversion.solution import Solution
from mi_lcair.progress import Progress
from mi_lcair.startup.threads import exclusively
from mi_lcair.toml_table import plain


@exclusively
def invert(
    problem: str | PathLike[str] | dict | InverseProblem,
    advise: bool = True,
    progress: Progress | None = None,
) -> Solution:
    """Estimate the unknowns of an inverse problem.

    Parameters
    ----------
    problem : path-like, dict or InverseProblem
        TOML file, its content as a dictionary, or the problem itself.
    advise : bool
        Whether to compute what further measurements would bring, if something is not determined.
    progress : callable or None
        Called with (renders of each datum done, largest number).

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If the problem, or one of its files or scenes, cannot be used.
    """
    if isinstance(problem, dict):
        problem = InverseProblem.of(plain(problem))
    elif not isinstance(problem, InverseProblem):
        problem = InverseProblem.read(problem)
    with errors_of(f"problem '{problem.name}'"):
        return solve_problem(problem, advise, progress)
