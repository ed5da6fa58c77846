"""Measure the estimation of 400 facet temperatures from six noisy images, against Adam.

    python -m docs.studies.facet_temperatures [DRAWS]

The body has a waist, so that its facets reflect each other. Each image has 64 x 64 pixels in LWIR,
and the camera's noise is 50 mK at 300 K. The estimate is repeated with other noise and other paths.
Adam minimises the squared difference of the images, with the renderer's reverse derivatives, from
300 K for all facets. Times are those of the processor. Everything runs once before it is timed, so
that kernels are compiled. The script takes a few minutes.
"""

import sys
import tempfile
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.inversion.data.images import slope
from tests.sensitivity.waist import VIEWS, body, smooth_temperatures, write_scene

RINGS = SEGMENTS = 20
NETD = 0.05  # noise of the camera at 300 K [K]
DRAWS = 10
SPP = 128  # samples per pixel of the inversion
TRUE_SPP = 4096  # samples per pixel of the images to which noise is added
STEPS, ADAM_SPP, START = 200, 16, 300.0  # start [K]
RATES = (1.0, 0.3, 0.1)  # Adam's rates for each third of the steps [K]


def estimated(scene, images, sigma, folder, seed):
    """Return the facets' temperatures and standard errors from images of all views.

    sigma: standard deviation of the camera's noise [W m^-2 sr^-1].
    """
    data = []
    for view, image in enumerate(images):
        file = folder / f"{view}.npy"
        np.save(file, image)
        entry = {"scene": str(scene), "sensor": view, "image": str(file), "sigma": sigma}
        data.append(entry | {"quantity": "radiance"})
    problem = {
        "data": data,
        "unknowns": {"body.facets": {"start": START}},
        "render": {"spp": SPP, "seed": seed},
    }
    answers = mi_lcair.invert(problem, advise=False).answers
    return np.array([(one.value, one.standard_error) for one in answers]).T


def adam(scene, images, facet):
    """Return the facets' temperatures after STEPS steps of Adam, and its seconds.

    facet: facet of each triangle. The first step is not timed.
    """
    key, triangles = "body.face_temperature", mi.UInt32(facet)
    parameters = mi.traverse(scene.mi)
    optimizer = mi.ad.Adam(lr=RATES[0])
    optimizer["T"] = dr.full(mi.Float, START, RINGS * SEGMENTS)
    targets = [mi.TensorXf(image[..., None]) for image in images]
    for step in range(STEPS):
        optimizer.set_learning_rate(RATES[len(RATES) * step // STEPS])
        parameters[key] = dr.gather(mi.Float, optimizer["T"], triangles)
        parameters.update()
        for view, target in enumerate(targets):
            image = mi.render(
                scene.mi, parameters, sensor=view, spp=ADAM_SPP, seed=len(VIEWS) * step + view
            )
            dr.backward(dr.sum(dr.square(image - target), axis=None), dr.ADFlag.ClearInterior)
            # The next view needs the parameters' derivatives again
            parameters[key] = dr.gather(mi.Float, optimizer["T"], triangles)
            parameters.update()
        optimizer.step()
        dr.eval(optimizer["T"])
        dr.sync_thread()
        if step == 0:
            start = time.process_time()
    return optimizer["T"].numpy(), (time.process_time() - start) * STEPS / (STEPS - 1)


def main(draws=DRAWS):
    """Print the errors, the coverage and the seconds of both methods."""
    true = smooth_temperatures(RINGS, SEGMENTS)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        path = write_scene(folder, true, RINGS, SEGMENTS)
        scene = mi_lcair.load(path)
        exact = [
            mi_lcair.render(scene, spp=TRUE_SPP, sensor=view, seed=10**6 + view, split=None)
            for view in range(len(VIEWS))
        ]
        sigma = NETD * float(slope(scene.band, 300.0))
        random = np.random.default_rng(1)
        noisy = lambda: [
            image.channels["Y"] + sigma * random.normal(size=image.channels["Y"].shape)
            for image in exact
        ]
        estimated(path, noisy(), sigma, folder, draws)
        deviations, errors, seconds = [], [], []
        for seed in range(draws):
            data = noisy()
            start = time.process_time()
            temperature, error = estimated(path, data, sigma, folder, seed)
            seconds.append(time.process_time() - start)
            deviations.append(temperature - true.ravel())
            errors.append(error)
        deviations, errors = np.array(deviations), np.array(errors)
        inside = np.abs(deviations) < 1.96 * errors
        rms = lambda values: np.sqrt(np.mean(np.square(values)))
        print(
            f"{deviations.shape[1]} facets, {draws} draws, {SPP} samples per pixel: rms error "
            f"{rms(deviations):.4f} K, standard errors {rms(errors):.4f} K (rms), mean error "
            f"{deviations.mean():+.5f} K, coverage {inside.mean():.3f}; "
            f"{np.median(seconds):.2f} s of processor time",
            flush=True,
        )
        by_adam, adam_seconds = adam(scene, noisy(), body(RINGS, SEGMENTS)[2])
        print(
            f"Adam, {STEPS} steps of {ADAM_SPP} samples per pixel: rms error "
            f"{rms(by_adam - true.ravel()):.3f} K (start {rms(START - true):.2f} K); "
            f"{adam_seconds:.1f} s of processor time, "
            f"{adam_seconds / np.median(seconds):.0f} times the estimate's"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
