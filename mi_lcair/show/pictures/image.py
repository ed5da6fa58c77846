"""Picture of a camera's image: apparent temperature, MTF, and the target over range."""

import numpy as np

from mi_lcair.detection.camera.image_result import Image, millikelvin
from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.show.pictures.image_channels import draw_pixels, limits_of

SIZE = (11, 6.4)  # inches


@styled
def figure(image: Image):
    """Figure of a camera's image, with three panels.

    They are the apparent temperature of the first frame, the MTF, and signal-to-noise ratio and
    pixels on the target over range.
    """
    scenario, measures, camera = image.scenario, image.measures, image.scenario.camera
    figure = new_figure(SIZE, layout="constrained")
    panels = figure.subplot_mosaic([["frame", "mtf"], ["frame", "ranges"]])
    draw_frame(figure, panels["frame"], image)
    _mtf(panels["mtf"], image)
    _ranges(panels["ranges"], image)
    figure.suptitle(
        plain(
            f"{scenario.name}, {image.band.label}, {scenario.observer.range_m:.5g} m, "
            f"f = {camera.focal_length_mm:g} mm, f/{camera.f_number:g}, "
            f"{1e3 * camera.seconds:g} ms, NETD {millikelvin(measures.netd)} "
            f"at {measures.temperature:.4g} K"
        )
    )
    return figure


def draw_frame(figure, axes, image: Image) -> None:
    """Draw the apparent temperature of the first frame around the target."""
    (left, top), (columns, rows) = image.view.window
    height, width = image.channels["temperature.Y"].shape
    beside = max(8, max(columns, rows) // 8)
    part = (
        slice(max(top - beside, 0), min(top + rows + beside, height)),
        slice(max(left - beside, 0), min(left + columns + beside, width)),
    )
    values = image.channels["temperature.Y"][part]
    scale = limits_of([values[np.isfinite(values)]], log=False)
    edges = part[1].start, part[1].stop, part[0].stop, part[0].start
    drawn = draw_pixels(axes, values, scale, cmap="gray", extent=edges)
    bar = figure.colorbar(drawn, ax=axes, extend=scale.extend, shrink=0.9)
    bar.set_label("apparent temperature (K)")
    axes.set_title("(a) first frame, around the target")
    axes.set_xlabel("column (pixel)")
    axes.set_ylabel("row (pixel)")
    axes.locator_params(integer=True)


def _mtf(axes, image: Image) -> None:
    """The MTF as the product of its parts, its parts, and as measured on a slanted edge."""
    mtf = image.measures.mtf
    for name, values in image.mtf_parts.items():
        if not np.all(values == 1):
            axes.plot(mtf["frequency"], values, linewidth=0.8, linestyle="--", label=name)
    axes.plot(mtf["frequency"], mtf["predicted"], color="black", linewidth=1.2, label="product")
    some, style = slice(None, None, 4), {"color": "C3", "markersize": 3.5}
    measured = mtf["frequency"][some], mtf["measured"][some]
    axes.plot(*measured, "o", **style, label="measured on a slanted edge")
    axes.set_ylim(0, 1.02)
    axes.set_xlim(0, mtf["frequency"][-1])
    axes.set_title("(b) MTF up to Nyquist")
    axes.set_xlabel("frequency in the image plane (cycles/mm)")
    axes.set_ylabel("MTF")
    axes.legend()


def _ranges(axes, image: Image) -> None:
    """Signal-to-noise ratio and pixels on the target over range, with what a detection needs."""
    from matplotlib.ticker import LogLocator, NullLocator

    rows, sensor = image.ranges, image.scenario.sensor
    x = np.array([row.range_m for row in rows])
    snr, peak, pixels = (
        axes.plot(x, [getattr(row, name) for row in rows], marker, color=color, markersize=3)[0]
        for name, marker, color in (
            ("snr", "o-", "C3"),
            ("peak_snr", "^-", "C1"),
            ("pixels", "s-", "C0"),
        )
    )
    axes.axhline(sensor.snr, color="C3", linewidth=0.8, linestyle=":")
    axes.axhline(image.scenario.camera.least_pixels, color="C0", linewidth=0.8, linestyle=":")
    axes.axvline(image.scenario.observer.range_m, color="0.6", linewidth=0.8)
    if image.detected_to_m:
        axes.axvspan(x.min(), image.detected_to_m, color="0.93", zorder=-1)
    axes.set(xscale="log", yscale="log", xlim=(x.min(), x.max()))
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if x.max() < 300 * x.min() else (1,)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter("{x:g}")
    detected = (
        f"detected up to {image.detected_to_m:.5g} m" if image.detected_to_m else "not detected"
    )
    if image.detected_to_m and image.detected_to_m > 0.999 * x.max():
        detected += " at least"
    axes.set_title(f"(c) over range, by matched filter: {detected}")
    axes.set_xlabel("range (m)")
    axes.set_ylabel("ratio, number (dotted: needed)")
    names = ["signal to noise, matched filter", "of the peak pixel", "pixels on the target"]
    axes.legend([snr, peak, pixels], names)
