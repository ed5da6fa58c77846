"""How derivatives pass through what plugins derive from their parameters (tables of HDR, facet
radiances).

A plugin that derives something has `sources()`, the parameters it derives from; `derive()`, which
computes `derived`, a PyTree of arrays, from them with derivatives attached; and `refresh()`, which
derives again only where needed. While paths are replayed, `leaves` puts detached copies of
`derived` in their place, so that the loops differentiate with respect to them alone and the chain
rule to the parameters is applied once, outside.
"""

from contextlib import contextmanager

import drjit as dr
import mitsuba as mi


def attached(arrays) -> bool:
    """Whether any of the arrays carries derivatives, also where their tracking is suspended."""
    return any(array.index_ad != 0 for array in arrays)


def held(arrays) -> list:
    """Copies that refer to the same variables. (What `traverse` reports is Mitsuba's own array,
    which an update changes.)
    """
    return [type(array)(array) for array in arrays]


def same_variables(arrays, kept) -> bool:
    """Whether the arrays are the very variables, with the same derivatives, that `kept` refers to,
    as `held` made it.

    An index alone tells nothing: Dr.Jit gives that of a variable to which nothing refers any more
    to a new one.
    """
    return len(arrays) == len(kept) and all(
        (array.index, array.index_ad) == (other.index, other.index_ad)
        for array, other in zip(arrays, kept)
    )


# The plugins of the scene that `bounce_path` is tracing; None while it traces nothing. A module
# variable, because Dr.Jit records its calls for every plugin that is alive, and Mitsuba calls their
# methods with no more than the interaction.
_traced = None


@contextmanager
def tracing(plugins):
    """Within: `is_traced` knows which plugins belong to the scene, and that what they derive is up
    to date.
    """
    global _traced
    before, _traced = _traced, set(plugins)
    try:
        yield
    finally:
        _traced = before


def is_traced(plugin) -> bool | None:
    """Whether the plugin belongs to the scene being traced; None while that is not known, under
    stock integrators.

    Dr.Jit's calls are recorded for every plugin that is alive, also for one that outlived its scene
    and its shape.
    """
    return None if _traced is None else plugin in _traced


def check_attached(plugin) -> None:
    """An error for a parameter whose derivative would be lost on the way through what was derived
    from it earlier.
    """
    if is_traced(plugin) is False:
        return
    if (
        plugin.derived is not None
        and attached(plugin.sources())
        and not attached(flatten(plugin.derived))
    ):
        raise RuntimeError(
            f"{plugin.class_name()} '{plugin.id()}': a parameter has got gradients since the scene was last updated; "
            "call params.update() after dr.enable_grad()"
        )


def flatten(tree) -> list:
    """The Dr.Jit arrays of a PyTree of tuples, dataclasses and arrays."""
    if dr.is_array_v(tree):
        return [tree]
    if isinstance(tree, tuple):
        return [array for branch in tree for array in flatten(branch)]
    return [array for branch in getattr(tree, "__dict__", {}).values() for array in flatten(branch)]


def value_along(bsdf, ctx, si, sample1, sample2, bs, active=True):
    """What a BSDF reflects along the direction of `bs`, which these samples drew without
    derivatives: up to a factor, and with the derivatives of the BSDF's parameters.

    That is its `eval`. A delta lobe has no value; there it is the lobe's weight times the
    probability with which `sample` chose it. (The weight alone would also carry the derivative of
    that probability, where a BSDF has several lobes.)
    """
    is_delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
    value = bsdf.eval(ctx, si, bs.wo, active & ~is_delta)
    chosen, weight = bsdf.sample(ctx, si, sample1, sample2, active & is_delta)
    return dr.select(is_delta, weight * chosen.pdf, value)


class Members(mi.TraversalCallback):
    """Collects what an object's `traverse` reports. (A class inside a function would keep dead
    scenes alive until the garbage collector runs, and Dr.Jit's calls reach every emitter that is
    alive.)
    """

    def __init__(self, node):
        mi.TraversalCallback.__init__(self)
        self.node, self.found = node, {}
        node.traverse(self)

    def put(self, name, value, flags, cpptype=None):
        self.found[name] = value if cpptype is None else mi.get_property(value, cpptype, self.node)


def members(node) -> dict:
    """Parameters and objects that a Mitsuba object holds, by name: a mesh's buffers and BSDF, what
    a BSDF wraps, ...
    """
    return Members(node).found


def children(node) -> list:
    return [member for member in members(node).values() if isinstance(member, mi.Object)]


def deriving_plugins(scene) -> list:
    """The scene's plugins that derive something from parameters, each once."""
    found, waiting, seen = [], [scene], {scene}
    while waiting:
        node = waiting.pop()
        if hasattr(node, "derive"):
            found.append(node)
        new = [child for child in children(node) if child not in seen]
        seen.update(new)
        waiting += new
    return found


def derivations(scene) -> list:
    """All that is derived from the scene's parameters: by plugins themselves, and by what they hold
    as `derivations` (a thermal emitter's table of the emissivity of a stock BSDF).
    """
    plugins = deriving_plugins(scene)
    return plugins + [part for plugin in plugins for part in getattr(plugin, "derivations", ())]


@contextmanager
def leaves(scene, mode: dr.ADMode):
    """Within: `derived` of plugins whose parameters have gradients are leaves; forward: they carry
    the parameters' tangents.

    Afterwards, in backward mode, what the leaves have gathered is passed on to the parameters.
    """
    plugins = [plugin for plugin in derivations(scene) if attached(plugin.sources())]
    with dr.resume_grad():
        for plugin in plugins:
            plugin.derive()
        derived = [plugin.derived for plugin in plugins]
        if mode == dr.ADMode.Forward and plugins:
            dr.forward_to(flatten(tuple(derived)), flags=dr.ADFlag.ClearEdges)
        for plugin, tree in zip(plugins, derived):
            leaf = dr.detach(tree)
            dr.enable_grad(leaf)
            if mode == dr.ADMode.Forward:
                dr.set_grad(leaf, dr.grad(tree))
            plugin.derived = leaf
    try:
        yield
        if mode == dr.ADMode.Backward and plugins:
            with dr.resume_grad():
                for plugin, tree in zip(plugins, derived):
                    for array, leaf in zip(flatten(tree), flatten(plugin.derived)):
                        dr.accum_grad(array, dr.grad(leaf))
                        dr.enqueue(dr.ADMode.Backward, array)
                dr.traverse(dr.ADMode.Backward)
    finally:
        for plugin, tree in zip(plugins, derived):
            plugin.derived = tree
