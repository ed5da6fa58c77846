"""Paths per second against Mitsuba's own integrators."""

from mi_lcair.benchmark import throughput


class Throughput:
    """Speed of `bounce_path` relative to other integrators, from `mi-lcair chart throughput`."""

    params = ["prb_basic", "path", "ray intersection alone"]
    param_names = ["against"]
    unit = "ours / theirs"
    timeout = 900

    def setup_cache(self, **settings):
        """Ratios of one measurement by the name of the rival; all contestants run in turn."""
        ratios = {}
        for row in throughput.measure(**settings).rows:
            if row.ratio is not None:
                ratios.setdefault(row.against, row.ratio)
        return ratios

    def track_paths(self, ratios, against):
        """Ratio of our first contestant's paths per second to the rival's."""
        return ratios[against]
