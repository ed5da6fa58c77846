"""Draw lag, drift and shutter of an uncooled camera, and print what its frames show of them.

    python -m docs.studies.bolometer [PICTURE]

It writes PICTURE (default docs/pictures/bolometer.png) and prints a table. It takes some seconds.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from mi_lcair.cli.output import print_columns
from mi_lcair.detection.camera.bolometer import (
    Bolometer,
    housing_changes,
    lagged,
    signal_per_kelvin,
)
from mi_lcair.detection.camera.electronics import (
    Pattern,
    apparent_temperature,
    counts,
    electron_band,
    electrons,
    frame,
    signal_of,
)
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import new_figure, styled, write_figure
from mi_lcair.laboratory.noise import NoiseComponents
from mi_lcair.physics.bands import band as band_of

LEVEL_K, STEP_K, SEED = 300.0, 10.0, 1
STEP_S = 0.03, 0.13  # when a warm object comes into the pixel's view, and leaves it, s
CHANGES = {
    "preset": "microbolometer_12um",
    "width": 160,
    "height": 128,
    "housing_walk_K": 0.5,
    "housing_walk_s": 60,
    "drift_mK_K": 200,
    "drift_spread_mK_K": 80,
    "sigma_vh_mK": 30,
    "sigma_v_mK": 15,
    "sigma_h_mK": 12,
    "sigma_tv_mK": 10,
    "sigma_th_mK": 8,
    "sigma_t_mK": 6,
}


class Uncooled:
    """The bolometer of CHANGES before an even scene of LEVEL_K.

    Attributes
    ----------
    band : Band
    imager : Bolometer
    pattern : Pattern
    """

    def __init__(self, **changes):
        camera = {f"camera.{name}": value for name, value in (CHANGES | changes).items()}
        imager = Scenario.read("a340_landing/position_3", **camera).camera
        self.band = electron_band(band_of("LWIR"), imager)
        self.imager = Bolometer.of(imager, self.band)
        self.pattern = Pattern.of(self.imager, SEED, signal_per_kelvin(imager, self.band))

    def kelvin(self, signal, number: int, warmer_K: float = 0.0) -> np.ndarray:
        """Apparent temperature of a frame of a scene with this signal, (H, W) [K]."""
        recorded = frame(self.imager, self.pattern, signal, SEED, number, warmer_K=warmer_K)
        return apparent_temperature(
            self.band, signal_of(self.imager, counts(self.imager, recorded))
        )

    def step(self) -> dict[str, np.ndarray]:
        """Power, response and frames of one pixel when a warm object passes, against time [s]."""
        imager, band = self.imager, self.band
        low, high = (float(electrons(band, T)) for T in (LEVEL_K, LEVEL_K + STEP_K))
        fine = np.unique([*np.arange(0, 0.2, 1e-4), *STEP_S, *(np.array(STEP_S) + 1e-9)])
        power = np.where((fine > STEP_S[0]) & (fine <= STEP_S[1]), high, low)
        seen = np.array(
            [s[0, 0] for s in lagged(imager, fine, (np.full((1, 1), p) for p in power))]
        )
        closed = low + (high - low) * (1 - np.exp(-(fine - STEP_S[0]) / 0.01))
        up = (fine > STEP_S[0]) & (fine <= STEP_S[1])
        frames = np.arange(0, 0.2, 1 / imager.frame_rate_hz)
        shown = [
            self.kelvin(np.full((128, 160), level), number)[64, 80]
            for number, level in enumerate(np.interp(frames, fine, seen))
        ]
        return {
            "time": fine,
            "power": apparent_temperature(band, power),
            "response": apparent_temperature(band, seen),
            "frames": frames,
            "shown": np.array(shown),
            "error": np.max(abs(seen - closed)[up]) / (high - low),
        }

    def drift(self, minutes: float = 12, every_s: float = 4.0) -> dict[str, np.ndarray]:
        """Mean and spread of the frames less the scene, and the housing, against time [s]."""
        times = np.arange(0, 60 * minutes, every_s)
        changes = housing_changes(self.imager, times, SEED)
        free = housing_changes(replace(self.imager, shutter_every_s=None), times, SEED)
        level = float(electrons(self.band, LEVEL_K))
        frames = [self.kelvin(level, n, change) for n, change in enumerate(changes)]
        without = [self.kelvin(level, n, change) for n, change in enumerate(free)]
        return {
            "time": times,
            "housing": free,
            "mean": np.array([each.mean() for each in frames]) - LEVEL_K,
            "free": np.array([each.mean() for each in without]) - LEVEL_K,
            "spread": np.array([each.std() for each in frames]),
        }


@styled
def pictures(step: dict, drift: dict, shutter_s: float):
    """Figure of a passing object in the frames, and of the drift with and without a shutter."""
    figure = new_figure((11, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(1e3 * step["time"], step["power"], color="0.6", label="scene")
    left.plot(1e3 * step["time"], step["response"], color="C0", label="pixel, time constant 10 ms")
    left.plot(1e3 * step["frames"], step["shown"], "o", color="C3", label="frames, 60 Hz")
    left.set(xlabel="time (ms)", ylabel="apparent temperature (K)", title="(a) lag")
    left.legend(loc="lower center")
    minutes = drift["time"] / 60
    right.plot(minutes, 1e3 * drift["free"], ":", color="0.5", label="mean, no shutter")
    right.plot(minutes, 1e3 * drift["mean"], color="C0", label="mean of the frame")
    right.plot(minutes, 1e3 * drift["spread"], color="C1", label="standard deviation over pixels")
    for event in np.arange(1, drift["time"][-1] // shutter_s + 1) * shutter_s / 60:
        right.axvline(event, color="0.8", linewidth=0.8, zorder=-1)
    right.set(xlabel="time (minutes)", ylabel="apparent temperature less scene (mK)")
    right.set_title("(b) drift with the housing, shutter every 3 minutes")
    right.legend()
    return figure


def components(frames: int = 200) -> NoiseComponents:
    """Components of frames of the even scene at one temperature of the housing [K]."""
    camera = Uncooled()
    level = float(electrons(camera.band, camera.imager.netd_temperature))
    slope = signal_per_kelvin(camera.imager, camera.band)
    recorded = (
        signal_of(
            camera.imager,
            counts(camera.imager, frame(camera.imager, camera.pattern, level, SEED, n)),
        )
        for n in range(frames)
    )
    return NoiseComponents.of((values.astype(float) - level) / slope for values in recorded)


def main(path: Path) -> None:
    camera = Uncooled(sigma_t_mK=0)
    step, drift = camera.step(), camera.drift()
    write_figure(pictures(step, drift, camera.imager.shutter_every_s), path)
    at_events = (drift["time"] % camera.imager.shutter_every_s == 0) & (drift["time"] > 0)
    offset = 1e3 * abs(drift["mean"][at_events]).max()
    walks = np.array(
        [
            housing_changes(
                replace(camera.imager, shutter_every_s=None), np.array([0, 60.0, 600.0]), s
            )
            for s in range(20_000)
        ]
    )
    rows = [("what", "stated", "in the frames")]
    rows.append(("step response, largest error", "0", f"{step['error']:.1g} of the step"))
    rows.append(("offset at a shutter event", "0 mK", f"{offset:.1g} mK"))
    for k, seconds in ((1, 60), (2, 600)):
        stated = 0.25 * seconds / 60
        rows.append(
            (
                f"variance of the walk, {seconds} s",
                f"{stated:g} K^2",
                f"{walks[:, k].var():.4g} K^2",
            )
        )
    given = {"sigma_tvh": camera.imager.nep / signal_per_kelvin(camera.imager, camera.band) * 1e3}
    given |= {name[:-3]: value for name, value in CHANGES.items() if name.startswith("sigma")}
    for name, value in components()._asdict().items():
        rows.append((name, f"{given[name]:.3g} mK", f"{1e3 * value:.3g} mK"))
    print_columns(rows)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/bolometer.png"))
