"""An invented result of a fit, for tests of the report and the plots."""

from itertools import cycle

import numpy as np

from mi_lcair.fitting.quality import Quality
from mi_lcair.fitting.report import Fit
from mi_lcair.fitting.scatterometer.reading import DirectionalData, Measurements
from mi_lcair.physics.reflection.models import MODELS

PARAMETERS = {"epsilon": 0.1 + 0.2, "rho_d": 1 / 3, "b": 0.05, "e": 0.1}  # two have 17 digits
VERDICTS = (
    "not determined by these data: any value in 0..0.5 fits; measure the emissivity and give it "
    "to the fit",
    "determined",
    "at its bound 0: interval 0..0.1",
    "determined",
)


QUALITY = Quality(
    lack_of_fit=True,
    verdict="LACK OF FIT: the model misses the data by about 12 %",
    reduced_chi_square=7.5,
    degrees_of_freedom=62,
    p_value=1e-12,
    noise_dex=0.02,
    residual_correlation=0.8,
    correlation_by_chance=0.3,
    systematic_dex=0.05,
)


def measurements(theta_i=(20, 50), theta_r=range(-80, 86, 5), band_um=(3.0, 5.0), file="scan.csv"):
    i, r = (
        angles.ravel()
        for angles in np.meshgrid(np.radians(theta_i), np.radians(theta_r), indexing="ij")
    )
    return Measurements(
        i,
        r,
        brdf=0.01 + np.exp(-np.degrees(abs(r - i))),
        band_um=band_um,
        name="a plate",
        source=[{"file": file, "sha256": "00"}],
        dropped={"off the plane of incidence": 2},
        reading={"quantity": "brdf"},
    )


def emissivity():
    return DirectionalData(
        np.radians([15.0, 60.0]),
        np.array([0.6, 0.5]),
        np.array([0.02, 0.03]),
        "emissivity",
        [{"file": "emissivity.csv", "sha256": "11"}],
    )


def fit_of(
    data,
    *,
    model="auto",
    emissivity=None,
    dhr=None,
    progress=None,
    seconds=1.25,
    **settings,
):
    """An invented `Fit`, with the signature of `fit`.

    Points beyond 80 degrees are left out. The parameters of models other than the first are those
    in the middle of their cube.
    """
    first = next(iter(MODELS))
    model = MODELS[first if model == "auto" else model]
    middle = dict(zip(model.names, model.values_at(np.full(len(model.names), 0.5)).tolist()))
    parameters = PARAMETERS if model.name == first else middle
    if progress:
        progress(1, 2)
        progress(2, 2)
    used = np.degrees(abs(data.theta_r)) < 80.1
    theta = np.radians([0.0, 30.0, 60.0]) if emissivity is None else emissivity.theta
    return Fit(
        parameters=parameters,
        standard_error=dict.fromkeys(parameters, 0.01),
        interval=dict.fromkeys(parameters, (0.0, 0.5)),
        verdict=dict(zip(parameters, cycle(VERDICTS))),
        correlation=np.eye(len(parameters)),
        model=model.name,
        form=model.forms[-1],
        restriction="b = 0",
        rms_dex=0.1234,
        used=int(used.sum()),
        used_points=used,
        dropped={"theta_i or theta_r beyond 80 degrees": int((~used).sum())},
        effective_points=20.5,
        outliers=0,
        converged=True,
        gradient_norm=1e-13,
        starts_in_basin=0.75,
        candidates=[
            {
                "model": model.name,
                "form": "normalized",
                "restriction": "b = 0",
                "free_parameters": 3,
                "rms_dex": 0.1234,
                "criterion": -5.0,
                "chosen": True,
            }
        ],
        emissivity=(theta, np.full(len(theta), 0.55)),
        emissivity_error=np.full(len(theta), 0.02),
        emissivity_interval=np.tile([0.51, 0.59], (len(theta), 1)),
        brdf_interval=data.brdf[used, None] * [0.95, 1.05],
        emissivity_rms=None if emissivity is None else 0.05,
        seconds=seconds,
        compile_seconds=0.5,
        settings={**settings, "source_half_angle_deg": 0.0},
        quality=QUALITY,
        measurements=data,
        directional={
            name: table for name, table in (("emissivity", emissivity), ("dhr", dhr)) if table
        },
    )
