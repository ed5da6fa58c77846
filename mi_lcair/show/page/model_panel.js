// A facet model in space, coloured by a column of its table, with a read-out of the whole row.
PANELS.model = (place, data) => new ModelPanel(place, data).draw();

const VIEWS = { "sensor": null, "ahead, left and above": [1, 0.8, 0.6], "nose": [1, 0, 0], "left side": [0, 1, 0], "right side": [0, -1, 0], "tail": [-1, 0, 0], "top": [0, 0, 1], "below": [0, 0, -1] };

const COMPACT = 2.1, FLAT = 3.1;  // lengths of the diagonals of a cube and of a plate as plotly draws them

class ModelPanel {
  constructor(place, data) {
    Object.assign(this, data);
    this.state = { log: isWide(this.columns[this.shown]), map: "viridis", outlines: false };
    this.limits = null;
    this.pinned = null;
    const triangles = this.rows.length;
    this.axes = [0, 1, 2].map((axis) => Float32Array.from({ length: 3 * triangles }, (_, k) => this.corners[3 * k + axis]));
    this.ranges = this.axes.map((axis) => {
      let [low, high] = [Infinity, -Infinity];
      for (const value of axis) { low = Math.min(low, value); high = Math.max(high, value); }
      return [low, high];
    });
    this.readout = new Readout("Every column of a facet", "Point at a facet. A click keeps it, a second click frees it. Drag to turn, scroll to zoom.");
    this.plot = element("div", { className: "plot" });
    this.fields = [0, 1].map((index) => numberField(index ? "to" : "from", (value) => { this.limits[index] = value; this.draw(); }));
    const views = Object.keys(VIEWS).filter((name) => VIEWS[name] || this.toward);
    place.append(
      element("div", { className: "controls" },
        menu("colour by", this.columns.map(({ title, unit }, k) => [k, withUnit(title, unit)]), this.shown, (value) => { this.shown = Number(value); this.reset(false); }),
        menu("scale", [["linear", "linear"], ["log", "logarithmic"]], this.state.log ? "log" : "linear", (value) => { this.state.log = value === "log"; this.reset(false); }),
        menu("colours", Object.keys(MAPS).map((name) => [name, name]), "viridis", (value) => { this.state.map = value; this.draw(); }),
        ...this.fields,
        button("robust limits", () => this.reset(false)), button("whole range", () => this.reset(true)),
        menu("seen from", views.map((name) => [name, name]), views[0], (name) => this.look(name)),
        tick("outlines", false, (value) => { this.state.outlines = value; this.draw(); })),
      element("div", { className: "beside" }, this.plot, this.readout.element),
      element("p", { className: "note", textContent:
        "Limits are at first those of all facets, but for a small area that would stretch the scale. Facets beyond the limits have the colours at the ends of the bar; " +
        "grey ones have no value, such as the radiance of a facet that the sensor does not see. Axes in metres, equal scales." }));
    this.limits = limitsOf(this.column, this.state.log, false);
    this.view = views[0];
  }

  get column() {
    const column = this.columns[this.shown];
    return column.names ? { ...column, limits: [0, 1], log_limits: [0, 1], extent: [0, 1] } : column;
  }

  /** Ranges of the axes, and the lengths in which plotly draws them: equal scales, and a size that fills the panel. */
  get box() {
    const size = Math.hypot(...this.ranges.map(([low, high]) => high - low)) || 1;
    const ranges = this.ranges.map(([low, high]) => [low - 0.02 * size, high + 0.02 * size]);
    const lengths = ranges.map(([low, high]) => high - low), flat = 1 - Math.min(...lengths) / Math.max(...lengths);
    const [x, y, z] = lengths.map((length) => (COMPACT + (FLAT - COMPACT) * flat) * length / size);
    return { ranges, aspectratio: { x, y, z } };
  }

  reset(whole) {
    this.limits = limitsOf(this.column, this.state.log, whole);
    return this.draw();
  }

  /** Camera that looks along a direction at the model's middle. */
  camera(name) {
    const [x, y, z] = VIEWS[name] || this.toward;
    const length = Math.hypot(x, y, z), distance = 2;
    const up = Math.abs(z) > 0.98 * length ? { x: 1, y: 0, z: 0 } : { x: 0, y: 0, z: 1 };
    return { eye: { x: distance * x / length, y: distance * y / length, z: distance * z / length }, up, center: { x: 0, y: 0, z: 0 },
      projection: { type: "orthographic" } };
  }

  look(name) {
    this.view = name;
    return Plotly.relayout(this.plot, { "scene.camera": this.camera(name) });
  }

  /** The mesh. Its triangles do not share corners, so that a hit is one triangle's. */
  mesh(values, scale, title) {
    const corner = (offset) => Float64Array.from({ length: this.rows.length }, (_, triangle) => 3 * triangle + offset);
    const [x, y, z] = this.axes;
    return { type: "mesh3d", x, y, z, i: corner(0), j: corner(1), k: corner(2), intensity: values, intensitymode: "cell",
      cmin: scale.first, cmax: scale.last, colorscale: scale.colorscale, colorbar: { ...colourBar(scale, title), len: 0.85 }, flatshading: true,
      hoverinfo: "none", lighting: { ambient: 0.8, diffuse: 0.35, specular: 0, roughness: 1, fresnel: 0, facenormalsepsilon: 0, vertexnormalsepsilon: 0 } };
  }

  traces() {
    const column = this.column, { state } = this, title = withUnit(column.title, column.unit);
    let scale;
    if (column.names) {
      const count = column.names.length;
      const colorscale = column.names.flatMap((_, k) => [[k / count, CATEGORIES[k % CATEGORIES.length]], [(k + 1) / count, CATEGORIES[k % CATEGORIES.length]]]);
      scale = { marked: (value) => value, first: -0.5, last: count - 0.5, colorscale, tickvals: column.names.map((_, k) => k), ticktext: column.names.map(escaped) };
    } else {
      const map = state.map === "viridis" && isSigned(column) && !state.log ? "blue-red" : state.map;
      scale = scaleOf(...this.limits, state.log, map, column.values.some(Number.isNaN));
    }
    const traces = [this.mesh(Float32Array.from(this.rows, (row) => scale.marked(column.values[row])), scale, title)];
    if (state.outlines) traces.push(this.outlines());
    return traces;
  }

  /** Edges of the facets: those of their triangles that do not lie within one facet. */
  outlines() {
    if (this.edges) return this.edges;
    const [X, Y, Z] = this.axes, key = (k) => `${X[k].toFixed(4)},${Y[k].toFixed(4)},${Z[k].toFixed(4)}`;
    const count = new Map();
    this.rows.forEach((row, triangle) => {
      for (let k = 0; k < 3; k++) {
        const [a, b] = [3 * triangle + k, 3 * triangle + (k + 1) % 3], [p, q] = [key(a), key(b)];
        const name = `${row}|${p < q ? p + "|" + q : q + "|" + p}`;
        count.set(name, count.has(name) ? null : [a, b]);
      }
    });
    const pairs = [...count.values()].filter(Boolean);
    const line = (axis) => Float32Array.from({ length: 3 * pairs.length }, (_, k) => (k % 3 === 2 ? NaN : axis[pairs[(k / 3) | 0][k % 3]]));
    this.edges = { type: "scatter3d", mode: "lines", x: line(X), y: line(Y), z: line(Z), line: { color: "#3b4654", width: 1 },
      hoverinfo: "skip", showlegend: false };
    return this.edges;
  }

  async draw() {
    const numbers = !this.column.names;
    this.fields.forEach((field, k) => { field.hidden = !numbers; if (numbers) field.show(this.limits[k]); });
    const { ranges, aspectratio } = this.box;
    const axis = (words, range) => ({ title: { text: words }, range, backgroundcolor: "#fff", gridcolor: "#e6e9ee", zeroline: false, showspikes: false, tickfont: { size: 11 } });
    const camera = this.drawn ? this.plot.layout.scene.camera : this.camera(this.view);
    const layout = { template: TEMPLATE, height: 540, margin: { l: 0, r: 0, t: 6, b: 0 }, showlegend: false, uirevision: "kept",
      scene: { aspectmode: "manual", aspectratio: this.drawn ? this.plot.layout.scene.aspectratio : aspectratio, camera, dragmode: "turntable",
        xaxis: axis("x (m)", ranges[0]), yaxis: axis("y (m)", ranges[1]), zaxis: axis("z (m)", ranges[2]) } };
    await Plotly.react(this.plot, this.traces(), layout, { ...CONFIG, scrollZoom: true });
    if (!this.drawn) this.listen();
    this.drawn = true;
  }

  listen() {
    const rowOf = ({ points }) => { const [point] = points; return this.rows[point.pointNumber]; };
    this.plot.on("plotly_hover", (hit) => {
      const row = rowOf(hit);
      tip(this.lines(row), hit.event || lastPointer);
      if (this.pinned === null) this.show(row);
    });
    this.plot.on("plotly_unhover", () => tip([]));
    this.plot.on("plotly_click", (hit) => {
      this.pinned = this.pinned === null ? rowOf(hit) : null;
      this.show(rowOf(hit));
    });
  }

  cell(column, row) {
    const value = column.values[row];
    return column.names ? column.names[value] : column.name === "facet" || column.name === "samples" ? String(value) : shown(value);
  }

  lines(row) {
    const named = (name) => this.columns.find((column) => column.name === name);
    const text = (name) => { const column = named(name); return column && `${this.cell(column, row)}${column.unit && Number.isFinite(column.values[row]) ? ` ${column.unit}` : ""}`; };
    const labels = ["type", "group", "material"].map(text).filter(Boolean).join(", ");
    const lines = [`facet ${text("facet")}${labels ? `: ${labels}` : ""}`];
    const tell = (words, value) => { if (value) lines.push(`${words}: ${value}`); };
    tell("temperature", text("temperature_K"));
    tell("emissivity toward the sensor", text("emissivity_toward_the_sensor"));
    tell("radiance", text("radiance_W_m2_sr"));
    const error = named("standard_error_W_sr");
    if (named("intensity_W_sr")) tell("intensity", error ? `${this.cell(named("intensity_W_sr"), row)} ± ${shown(error.values[row], 2)} W sr⁻¹` : text("intensity_W_sr"));
    const column = this.columns[this.shown];
    if (!["facet", "type", "group", "material", "temperature_K", "emissivity_toward_the_sensor", "radiance_W_m2_sr", "intensity_W_sr"].includes(column.name))
      tell(column.title, text(column.name));
    return lines;
  }

  show(row) {
    this.readout.show(`Facet ${this.cell(this.columns.find(({ name }) => name === "facet"), row)}${this.pinned === null ? "" : " (kept)"}`,
      this.columns.slice(0).filter(({ name }) => name !== "facet").map((column) => [column.title, this.cell(column, row), column.unit]));
  }
}

let lastPointer = { clientX: 0, clientY: 0 };
window.addEventListener("pointermove", (event) => { lastPointer = event; }, true);
