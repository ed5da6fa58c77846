"""Electrons and signal-to-noise ratio of a pixel, in pyBSM."""

import numpy as np
from pybsm.radiance import blackbody_radiance, photon_detector_SNR
from pybsm.simulation import Sensor


def run(case, effort, seed):
    um = np.linspace(3e-6, 5e-6, effort)
    camera = Sensor(
        name="MWIR",
        D=0.05,
        f=0.1,
        p_x=15e-6,
        opt_trans_wavelengths=um,
        int_time=1e-3,
        qe=np.full(effort, 0.7),
        read_noise=300,
        max_n=20_000_000,
        bit_depth=14,
    )
    target, background = (blackbody_radiance(lambda0=um, T=kelvin) for kelvin in (302, 300))
    snr = photon_detector_SNR(
        sensor=camera,
        radiance_wavelengths=um,
        target_radiance=target,
        background_radiance=background,
    )
    return {"background": (snr.bkg_n, None), "target": (snr.tgt_n, None), "snr": (snr.snr, None)}
