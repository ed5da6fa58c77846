// Colour scales with marks for what lies beyond their limits, linear or logarithmic.
const MAPS = {
  inferno: { stops: ["#000004", "#160b39", "#420a68", "#6a176e", "#932667", "#bc3754", "#dd513a", "#f37819", "#fca50a", "#f6d746", "#fcffa4"],
    below: "#2f7bd9", above: "#3fe8e0" },
  viridis: { stops: ["#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151", "#bddf26", "#fde725"],
    below: "#b34700", above: "#ff4fa3" },
  grey: { stops: ["#000000", "#ffffff"], below: "#7b3fb8", above: "#e5383b", empty: "#4682b4" },
  "blue-red": { stops: ["#053061", "#2166ac", "#4393c3", "#92c5de", "#d1e5f0", "#f7f7f7", "#fddbc7", "#f4a582", "#d6604d", "#b2182b", "#67001f"],
    below: "#00c2b2", above: "#ffb000" },
};
const MARK = 0.02;  // share of the colour bar for each mark
const GUARD = 0.008;  // share between a mark and the scale; WebGL mixes colours that are nearer than 1/256
const CATEGORIES = ["#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#76b7b2", "#edc948", "#b07aa1", "#9c755f", "#ff9da7", "#86bcb6",
  "#a0cbe8", "#ffbe7d", "#8cd17d", "#f1ce63", "#d4a6c8", "#499894", "#d37295", "#79706e"];
const WIDE = 10;  // ratio of robust limits from which a scale is logarithmic at first
const EMPTY = "#b4bac2";  // colour of what has no value, where the map has none of its own

/**
 * What plotly needs to colour values between two limits: a function of a value, the ends of the
 * scale, its colours and the ticks of its bar. Values beyond the limits get the marks' colours.
 * With `hasEmpty`, what has no value gets a mark of its own; otherwise it stays NaN.
 */
function scaleOf(low, high, log, mapName, hasEmpty = false) {
  const map = MAPS[mapName], empty = map.empty || EMPTY;
  if (!(high > low)) high = low + (Math.abs(low) * 1e-6 || 1e-30);
  if (log && !(low > 0)) low = high > 0 ? high * 1e-6 : 1e-30;
  const place = log ? Math.log10 : (value) => value;
  const start = place(low), length = Math.max(place(high) - start, 1e-300);
  const at = (value) => GUARD + (1 - 2 * GUARD) * (place(value) - start) / length;
  const first = -MARK * (hasEmpty ? 2 : 1), last = 1 + MARK, share = (x) => (x - first) / (last - first);
  const stops = map.stops.map((colour, k) => [share(GUARD + (1 - 2 * GUARD) * k / (map.stops.length - 1)), colour]);
  const colorscale = [...(hasEmpty ? [[0, empty], [share(-MARK), empty]] : []), [share(-MARK), map.below], [share(0), map.below],
    [share(0), map.stops[0]], ...stops, [share(1), map.stops.at(-1)], [share(1), map.above], [1, map.above]];
  const marked = (value) => {
    if (!Number.isFinite(value)) return hasEmpty ? -1.5 * MARK : NaN;
    if (log && !(value > 0)) return -0.5 * MARK;
    const x = at(value);
    return x < GUARD - 1e-6 ? -0.5 * MARK : x > 1 - GUARD + 1e-6 ? 1 + 0.5 * MARK : Math.min(Math.max(x, GUARD), 1 - GUARD);
  };
  const ticks = log ? logTicks(low, high) : evenTicks(low, high);
  return { marked, first, last, colorscale, empty, tickvals: ticks.map(at), ticktext: ticks.map((value) => shown(value)) };
}

/** Round numbers between two limits, about six. */
function evenTicks(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / 5));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => (high - low) / size <= 6.5);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(Number((k * step).toPrecision(12)));
  return ticks;
}

/** Round numbers on a logarithmic scale: decades, 1-2-5, or even steps where it is short. */
function logTicks(low, high) {
  const decades = Math.log10(high / low);
  if (decades < 0.7) return evenTicks(low, high);
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++)
    for (const factor of decades > 3 ? [1] : [1, 2, 5]) {
      const value = Number(`${factor}e${power}`);
      if (value >= low * 0.999999 && value <= high * 1.000001) ticks.push(value);
    }
  return ticks;
}

/** A colour bar of plotly for a scale. */
function colourBar(scale, title) {
  return { tickmode: "array", tickvals: scale.tickvals, ticktext: scale.ticktext, thickness: 14, len: 1, x: 1.01,
    outlinewidth: 0.5, ticks: "outside", ticklen: 3, title: { text: title, side: "right", font: { size: 12 } }, tickfont: { size: 11 } };
}

/** Words of a quantity with its unit, for titles. */
function withUnit(words, unit) {
  return unit ? `${words} (${unit})` : words;
}

/** Whether a channel or column has values of both signs, and is coloured around zero. */
function isSigned({ extent }) {
  return extent[0] !== null && extent[0] < 0 && extent[1] > 0;
}

/** The robust or the whole limits of a channel or column. */
function limitsOf(column, log, whole) {
  if (!whole) return [...(log ? column.log_limits : column.limits)];
  const [low, high] = column.extent;
  if (low === null) return [0, 1];
  return log && !(low > 0) ? [column.log_limits[0], high] : low === high ? [...column.limits] : [low, high];
}

/** Whether the robust limits of positive values are so far apart that a logarithmic scale shows more. */
function isWide({ limits, names }) {
  return !names && limits[0] > 0 && limits[1] > WIDE * limits[0];
}
