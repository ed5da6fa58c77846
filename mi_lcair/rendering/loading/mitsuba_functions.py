"""`mi.render` and `mi.traverse` take what `mi_lcair.load` returns.

Mitsuba's functions take objects of its own classes only. `mi.render` asserts the class and passes
the scene on to C++, so that no class written in Python can stand for it. Both functions are
therefore replaced by ones that pass on the `mi` of a loaded scene, and anything else as it is.
"""

from functools import wraps

FUNCTIONS = ("render", "traverse")


def take_loaded_scenes() -> None:
    """Let `mi.render` and `mi.traverse` take a `Scene`, in all variants."""
    import mitsuba as mi

    for name in FUNCTIONS:
        function = _with_scene(getattr(mi.util, name))
        setattr(mi.util, name, function)
        setattr(mi, name, function)


def _with_scene(function):
    """The function that gets the `mi` of each argument that has one, in the argument's place."""
    of = lambda value: getattr(value, "mi", value)

    @wraps(function)
    def taking_scene(*arguments, **options):
        options = {name: of(value) for name, value in options.items()}
        return function(*map(of, arguments), **options)

    return taking_scene
