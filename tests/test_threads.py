"""One thread at a time uses Dr.Jit: public functions hold the lock for as long as they use it."""

import gc
import inspect
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Thread

import pytest

import mi_lcair
from mi_lcair.plugins.derivatives import unrecorded
from mi_lcair.tasks import exclusive, exclusively

# Modules that use Dr.Jit, beside all plugins
ROOMS = ("mi_lcair.plugins.", "mi_lcair.rendering.facets.", "mi_lcair.rendering.window")

CONDITIONS = {
    "base": {"scene": "cylinder_ir_range"},
    "conditions": {"azimuth_deg": [0, 90]},
    "sampling": {"resolution": 4, "spp": 4},
}
CALLS_EACH = 4  # of each of three threads
CALLS = {
    "load": lambda scene: mi_lcair.load("two_plates"),
    "render": lambda scene: mi_lcair.render(scene, spp=1),
    "signature": lambda scene: mi_lcair.signature(scene, spp=1, facets=True),
    "parameters": mi_lcair.parameters,
    "audit": lambda scene: mi_lcair.audit(scene, paths=64),
    "trend": lambda scene: mi_lcair.trend(scene, [0], resolution=4, spp=4),
    "sweep": lambda scene: mi_lcair.sweep(CONDITIONS),
    "sensitivities": lambda scene: mi_lcair.sensitivities(scene, ["plate.temperature"], spp=4),
    "derivative_images": lambda scene: mi_lcair.derivative_images(scene, [], spp=4),
}


@pytest.mark.parametrize("name", CALLS)
def test_the_lock_is_held(name):
    """No function of the plugins, and none that asks a sensor or a shape, runs without it."""
    scene = mi_lcair.load("two_plates", resolution=4)
    CALLS[name](scene)  # imports its modules
    without = set()

    def watch(frame, event, argument):
        if event == "call" and not exclusive._is_owned():
            module, function = frame.f_globals.get("__name__", ""), frame.f_code.co_name
            if module.startswith(ROOMS) and function != "__del__":  # it takes the lock itself
                without.add(f"{module}: {function}")

    sys.setprofile(watch)
    try:
        CALLS[name](scene)
    finally:
        sys.setprofile(None)
    assert not without


def test_garbage_waits_for_no_thread_that_waits(monkeypatch):
    """A scene in the garbage takes its turn, which the thread has that waits for `unrecorded`."""
    had_a_turn = []

    class Garbage:
        def __init__(self):
            self.cycle = self

        def __del__(self):
            had_a_turn.append(exclusive.acquire(timeout=1))
            if had_a_turn[-1]:
                exclusive.release()

    monkeypatch.setattr("drjit.flag", lambda flag: True)
    with exclusive:
        Garbage()
        assert len(unrecorded(lambda: [[k] for k in range(100_000)])) == 100_000
    gc.collect()
    assert had_a_turn == [True] and gc.isenabled()


def test_every_public_function_takes_its_turn():
    """But those that use no Dr.Jit, or wait for workers."""
    functions = {name: getattr(mi_lcair, name) for name in mi_lcair.__all__}
    free = {
        name
        for name, function in functions.items()
        if inspect.isfunction(function) and not hasattr(function, "__wrapped__")
    }
    assert free == {"noise_components", "sweep", "temperature", "trend", "trust", "workers"}


def test_a_scene_that_another_thread_discards_is_deleted_in_the_next_turn():
    """The thread that has the turn may wait for the other one, which must not wait for it."""

    class Part:
        pass

    scenes = [mi_lcair.load("two_plates", resolution=4)]
    scenes[0].moved["part"] = Part()
    part, other = weakref.ref(scenes[0].moved["part"]), Thread(target=scenes.clear)
    with exclusive:
        other.start()
        other.join(5)
        assert not other.is_alive() and part() is not None
    exclusively(lambda: None)()
    assert part() is None


def test_functions_take_turns():
    """A second thread waits until the first has left its function; the same thread does not."""
    order, entered, leave = [], Event(), Event()

    @exclusively
    def work(name):
        order.append(f"{name} begins")
        if name == "first":
            entered.set()
            leave.wait(10)
            nested()
        order.append(f"{name} ends")

    nested = exclusively(lambda: order.append("nested"))
    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(work, "first")
        assert entered.wait(10)
        second = threads.submit(work, "second")
        assert not second.done() and order == ["first begins"]
        leave.set()
        first.result(), second.result()
    assert order == ["first begins", "nested", "first ends", "second begins", "second ends"]


@pytest.mark.slow
@pytest.mark.parametrize("shared", [True, False], ids=["one scene", "three scenes"])
def test_three_threads_at_once(shared):
    """All get the numbers of one thread. Without the lock the process ended or raised."""
    names = ["two_plates"] * 3 if shared else ["two_plates", "open_box", "furnace"]
    scenes = {name: mi_lcair.load(name, resolution=4) for name in names}
    alone = {name: [intensity(scenes[name], seed) for seed in range(CALLS_EACH)] for name in names}
    with ThreadPoolExecutor(3) as threads:
        jobs = [
            (name, seed, threads.submit(intensity, scenes[name], seed))
            for seed in range(CALLS_EACH)
            for name in names
        ]
    for name, seed, job in jobs:
        assert job.result() == alone[name][seed]


def intensity(scene, seed: int) -> float:
    return mi_lcair.signature(scene, spp=16, seed=seed).intensity
