"""Derivatives through quantities that plugins derive from parameters.

Examples of such quantities are tables of HDR and facet radiances, see `Deriving`.

While paths are replayed, `leaves` replaces `derived` by detached copies. The loop then
differentiates with respect to these copies alone. The chain rule from them to the parameters is
applied once, outside the loop.
"""

import gc
from abc import ABC, abstractmethod
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache

import drjit as dr
import mitsuba as mi

from mi_lcair.tasks import exclusive, is_traced


class Deriving(ABC):
    """What derives something from parameters.

    derived: a PyTree of arrays; None before the first use. derivations: other objects of this kind
    that it holds, such as the table of the emissivity of one of Mitsuba's BSDFs, which a thermal
    emitter holds.

    Plugins are registered as virtual subclasses, because a subclass of Mitsuba's classes can have
    no other base class.
    """

    derived = None
    derivations = ()

    @abstractmethod
    def sources(self) -> tuple:
        """The parameters, Dr.Jit arrays, from which `derived` is computed."""

    @abstractmethod
    def derive(self) -> None:
        """Compute `derived`, with derivatives attached."""

    @abstractmethod
    def refresh(self) -> None:
        """Call `derive` if the parameters have changed."""


def unrecorded(function, *arguments):
    """Result of a function that evaluates arrays, also while Dr.Jit records a loop or call.

    Nothing can be evaluated in a recording. A recording belongs to one thread, so the function then
    runs in another one. Example: Mitsuba's integrators meet a plugin first while they record.

    That thread must not collect garbage: a scene in it would wait for its turn, see
    `mi_lcair.tasks`, which the thread has that waits for the result.
    """
    if not dr.flag(dr.JitFlag.SymbolicScope):
        return function(*arguments)
    collects = gc.isenabled()
    gc.disable()
    try:
        with ThreadPoolExecutor(1) as threads:
            return threads.submit(function, *arguments).result()
    finally:
        if collects:
            gc.enable()


def variables(value) -> list:
    """Dr.Jit variables of an array: one for each component; none for a Python number."""
    if dr.is_tensor_v(value):
        return [value.array]
    if dr.is_array_v(value) and dr.depth_v(value) > 1:
        return [variable for component in value for variable in variables(component)]
    return [value] if dr.is_jit_v(value) else []


def attached(arrays) -> bool:
    """Whether any of the arrays carries derivatives; works also inside `dr.suspend_grad`."""
    return any(array.index_ad != 0 for array in arrays)


def held(arrays) -> list:
    """Copies of the arrays that refer to the same variables.

    Copies are needed because `traverse` reports Mitsuba's own array, which an update changes.
    """
    return [type(array)(array) for array in arrays]


def same_variables(arrays, kept) -> bool:
    """Whether the arrays are the same variables, with the same derivatives, as in `kept`.

    `kept` must come from `held`, which keeps the variables alive. Comparing indices alone would not
    be enough: Dr.Jit reuses the index of a variable that nothing refers to any more.
    """
    return len(arrays) == len(kept) and all(
        (array.index, array.index_ad) == (kept_array.index, kept_array.index_ad)
        for array, kept_array in zip(arrays, kept)
    )


def check_attached(plugin) -> None:
    """Raise RuntimeError if a parameter has gradients and `derived` was computed without them.

    The derivative with respect to that parameter would be lost.
    """
    if is_traced(plugin) is False:
        return
    if (
        plugin.derived is not None
        and attached(plugin.sources())
        and not attached(flatten(plugin.derived))
    ):
        raise RuntimeError(
            f"{plugin.class_name()} '{plugin.id()}': a parameter has got gradients since the scene "
            "was last updated; call params.update() after dr.enable_grad()"
        )


def flatten(tree) -> list:
    """The Dr.Jit arrays of a PyTree of tuples, lists, dictionaries, objects and arrays.

    Mitsuba's objects are left out.
    """
    found = []
    append_arrays(tree, found)
    return found


def append_arrays(tree, found: list) -> None:
    """Append the arrays of a PyTree to a list, see `flatten`."""
    kind = type(tree)
    if has_no_arrays(kind):
        return
    if dr.is_array_v(kind):
        found.append(tree)
        return
    branches = tree if isinstance(tree, (tuple, list, dict)) else vars(tree)
    for branch in branches.values() if isinstance(branches, dict) else branches:
        append_arrays(branch, found)


@cache
def has_no_arrays(kind: type) -> bool:
    """Whether objects of a type hold no arrays that `flatten` gives."""
    if dr.is_array_v(kind) or issubclass(kind, (tuple, list, dict)):
        return False
    return issubclass(kind, mi.Object) or kind.__dictoffset__ == 0


def value_along(bsdf, ctx, si, sample1, sample2, bs, active=True):
    """Value of a BSDF along a sampled direction, with derivatives and up to a constant factor.

    For a smooth lobe this is `eval`. A delta lobe has no such value: the result is then the weight
    of the lobe times the probability with which `sample` chose it. The weight alone would also
    carry the derivative of that probability, where a BSDF has several lobes.

    Parameters
    ----------
    bsdf : mi.BSDF
    ctx : mi.BSDFContext
    si : mi.SurfaceInteraction3f
    sample1, sample2 : mi.Float, mi.Point2f
        The random numbers with which `bs` was drawn.
    bs : mi.BSDFSample3f
        The sampled direction, drawn without derivatives.
    active : mi.Bool

    Returns
    -------
    mi.Spectrum
        BSDF times cosine [1/sr], or the reflectance of a delta lobe times a constant.
    """
    is_delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
    value = bsdf.eval(ctx, si, bs.wo, active & ~is_delta)
    again, weight = bsdf.sample(ctx, si, sample1, sample2, active & is_delta)
    return dr.select(is_delta, weight * again.pdf, value)


class Members(mi.TraversalCallback):
    """Collects the parameters and objects that an object's `traverse` reports.

    This class is not defined inside a function, because it would then keep deleted scenes alive
    until the garbage collector runs. Dr.Jit calls every emitter that is alive.
    """

    def __init__(self, node):
        mi.TraversalCallback.__init__(self)
        self.node, self.found = node, {}
        node.traverse(self)

    def put(self, name, value, flags, cpptype=None):
        self.found[name] = value if cpptype is None else mi.get_property(value, cpptype, self.node)


def members(node) -> dict:
    """Parameters and objects that a Mitsuba object holds, by name.

    Examples are the buffers and the BSDF of a mesh, and the BSDFs that a BSDF wraps.
    """
    return Members(node).found


def children(node) -> list:
    return [member for member in members(node).values() if isinstance(member, mi.Object)]


def nodes(scene) -> list:
    """The objects of a scene that a path can meet, each once: no sensors and no integrator.

    While another thread records paths, plugins have no attributes, so that this waits for it.
    """
    reached, waiting, seen = [], [scene], {scene}
    with exclusive:
        while waiting:
            node = waiting.pop()
            reached.append(node)
            # A BSDF that is `twosided` may have the same child twice
            new = [child for child in dict.fromkeys(children(node)) if child not in seen]
            seen.update(new)
            waiting += [child for child in new if not isinstance(child, (mi.Sensor, mi.Integrator))]
    return reached


def deriving(objects) -> list:
    """Those objects that derive something from parameters."""
    return [node for node in objects if isinstance(node, Deriving)]


def derivations(plugins) -> list:
    """All objects that derive something from parameters: plugins and what they hold."""
    return plugins + [part for plugin in plugins for part in plugin.derivations]


@contextmanager
def leaves(plugins, mode: dr.ADMode):
    """Context manager that replaces `derived` of plugins by leaves of the graph of derivatives.

    This concerns only objects whose parameters have gradients. In forward mode the leaves carry the
    tangents of the parameters. In backward mode the gradients that the leaves have accumulated are
    passed on to the parameters at the end.
    """
    plugins = [plugin for plugin in derivations(plugins) if attached(plugin.sources())]
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


def own_memory(arrays):
    """Copy arrays that were made from NumPy's into memory of Dr.Jit, and return them.

    NumPy's memory is aligned by chance. Dr.Jit compiles a kernel for either case, and gathers
    vectors faster where it is aligned. A kernel that reads an array entry by entry reads whole
    packets, the last one beyond the array's end. There NumPy's memory may end too, and the process
    with it. A gather reads no more than the entries.
    """
    for array in arrays:
        array[mi.Bool(True)] = gathered(array)
    dr.eval(arrays)
    return arrays


def is_aligned(variable) -> bool:
    """Whether memory of a variable begins as that of Dr.Jit's; that of NumPy's does by chance."""
    if dr.backend_v(variable) != dr.JitBackend.LLVM or variable.state != dr.VarState.Evaluated:
        return True
    return variable.numpy().ctypes.data % 64 == 0


def gathered(array):
    """The entries of an array, read one by one."""
    if dr.depth_v(array) > 1:
        return type(array)(*map(gathered, array))
    if dr.width(array) == 1:  # Dr.Jit would not gather it, but read it as it is aligned
        return dr.opaque(type(array), array[0])
    # An index that is not known to be the lane, for which Dr.Jit would return the array itself
    index = dr.arange(mi.UInt32, dr.width(array)) + dr.opaque(mi.UInt32, 0)
    return dr.gather(type(array), array, index) * dr.opaque(type(array), 1)
