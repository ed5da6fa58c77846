"""Picture of a flight: contrast, signal-to-noise ratio and range against time."""

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.reports.line_charts import draw_with_band
from mi_lcair.results.charts import COLOURS, INK, label


@styled
def figure(flight):
    """Figure with the contrast and its 95 % interval, the ratio to the noise, and the range."""
    table, scenario = flight.table, flight.scenario
    time_s, has_noise = table["time_s"], "snr" in table
    figure = new_figure((8, 7.5 if has_noise else 5.5), layout="constrained")
    panels = figure.subplots(3 if has_noise else 2, 1, sharex=True)
    contrast, half_width = table["contrast_W_m2"], table["contrast_half_width_W_m2"]
    style = {"color": INK, "linewidth": 1.3, "label": "contrast with 95 % interval"}
    draw_with_band(panels[0], time_s, contrast, half_width, **style)
    is_traced = table["traced"] > 0
    panels[0].plot(
        time_s[is_traced], contrast[is_traced], ".", markersize=4, color=COLOURS[0], label="traced"
    )
    panels[0].axhline(0, color="black", linewidth=0.5)
    panels[0].set_ylabel(label("contrast", "W m-2"))
    panels[0].ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    panels[0].legend()
    if has_noise:
        panels[1].semilogy(time_s, table["snr"], color=INK, linewidth=1.3)
        panels[1].axhline(scenario.sensor.snr, color=COLOURS[1], linewidth=1, label="detection")
        panels[1].set_ylabel("signal-to-noise ratio")
        panels[1].legend()
        first = flight.detections_s[0]
        if first is not None:
            panels[1].axvline(first, color=COLOURS[1], linewidth=1, linestyle=":")
    panels[-1].plot(time_s, table["range_m"] / 1e3, color=INK, linewidth=1.3)
    panels[-1].set(ylim=(0, None), ylabel=label("range", "km"), xlabel=label("time", "s"))
    figure.suptitle(plain(f"{scenario.name}, {scenario.sensor.band}"))
    return figure
