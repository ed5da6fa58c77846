// Images of the channels of a radiance image, side by side, and a read-out of every channel.
PANELS.image = (place, data) => new ImagePanel(place, data).drawAll();

const MOST_PICTURES = 6;
const USUAL = "usual";  // temperatures in greys, signed values in blue and red, others in inferno

class ImagePanel {
  constructor(place, data) {
    Object.assign(this, data);
    this.state = { log: isWide(this.channels[this.shown[0]]), common: false, map: USUAL };
    this.ratio = this.size_m ? this.size_m[1] / this.size_m[0] : this.height / this.width;
    this.pictures = [];
    this.pinned = null;
    this.readout = new Readout("Every channel of a pixel", "Point at a pixel. A click keeps it, a second click frees it.");
    this.box = element("div", { className: "pictures" });
    place.append(
      element("div", { className: "controls" },
        menu("scale", [["linear", "linear"], ["log", "logarithmic"]], this.state.log ? "log" : "linear", (value) => this.set({ log: value === "log" })),
        menu("colours", [USUAL, ...Object.keys(MAPS)].map((name) => [name, name]), USUAL, (value) => { this.state.map = value; this.drawAll(); }),
        tick("common scale", false, (value) => this.set({ common: value })),
        button("robust limits", () => this.reset(false)),
        button("whole range", () => this.reset(true)),
        button("add a picture", () => this.add(this.shown[0]))),
      element("div", { className: "beside" }, this.box, this.readout.element),
      element("p", { className: "note", textContent:
        `Limits are at first those of all pixels${this.part ? " around the target" : ""}, but for few that would stretch the scale. ` +
        "Pixels beyond the limits have the colours at the ends of the bar. Those without a value are grey, or blue where the scale is grey." }));
    this.shown.forEach((channel) => this.add(channel, false));
  }

  /** Change the scale, and take robust limits for it. */
  set(change) {
    Object.assign(this.state, change);
    this.reset(false);
  }

  /** Robust limits of all pictures, or those of all values. */
  reset(whole) {
    for (const picture of this.pictures) picture.limits = limitsOf(this.channels[picture.channel], this.state.log, whole);
    if (this.state.common) for (const picture of this.pictures) {
      const alike = this.alike(picture).map((one) => limitsOf(this.channels[one.channel], this.state.log, whole));
      picture.limits = [Math.min(...alike.map((pair) => pair[0])), Math.max(...alike.map((pair) => pair[1]))];
    }
    return this.drawAll();
  }

  /** Pictures that share a picture's scale: those of the same unit. */
  alike(picture) {
    const unit = this.channels[picture.channel].unit;
    return this.state.common ? this.pictures.filter((one) => this.channels[one.channel].unit === unit) : [picture];
  }

  add(channel, draw = true) {
    if (this.pictures.length >= MOST_PICTURES) return;
    const picture = { channel, plot: element("div", { className: "plot" }), limits: limitsOf(this.channels[channel], this.state.log, false) };
    const limit = (index) => (value) => {
      const limits = [...picture.limits];
      limits[index] = value;
      for (const one of this.alike(picture)) one.limits = [...limits];
      this.drawAll();
    };
    picture.fields = [numberField("from", limit(0)), numberField("to", limit(1))];
    picture.box = element("div", { className: "picture" },
      element("div", { className: "controls" },
        menu("", this.channels.map(({ name }, k) => [k, name]), channel, (value) => { picture.channel = Number(value); this.reset(false); }),
        ...picture.fields,
        button("✕", () => this.remove(picture))),
      picture.plot);
    if (this.ratio < 0.6) picture.box.style.flexBasis = "100%";  // wide pictures stand one above the other
    this.pictures.push(picture);
    this.box.append(picture.box);
    if (draw) this.reset(false);
  }

  remove(picture) {
    if (this.pictures.length === 1) return;
    Plotly.purge(picture.plot);
    picture.box.remove();
    this.pictures = this.pictures.filter((one) => one !== picture);
    this.drawAll();
  }

  async drawAll() {
    for (const picture of this.pictures) await this.draw(picture);
  }

  async draw(picture) {
    const { width, height, state } = this, channel = this.channels[picture.channel];
    const usual = isSigned(channel) && !state.log ? "blue-red" : channel.unit === "K" ? "grey" : "inferno";
    const map = state.map === USUAL ? usual : state.map;
    const scale = scaleOf(...picture.limits, state.log, map);
    picture.fields.forEach((field, k) => field.show(picture.limits[k]));
    const z = [];
    for (let row = 0; row < height; row++) {
      const line = new Float32Array(width);
      for (let column = 0; column < width; column++) line[column] = scale.marked(channel.values[row * width + column]);
      z.push(line);
    }
    const trace = { type: "heatmap", z, zmin: scale.first, zmax: scale.last, zsmooth: false, colorscale: scale.colorscale,
      colorbar: colourBar(scale, withUnit(channel.quantity, channel.unit)), hoverinfo: "none" };
    const size = this.size_m, [columns, rows] = [width, height];
    const metres = size && { x0: size[0] * (0.5 / columns - 0.5), dx: size[0] / columns, y0: size[1] * (0.5 - 0.5 / rows), dy: -size[1] / rows };
    Object.assign(trace, metres || { x0: 0, dx: 1, y0: 0, dy: 1 });
    const words = size ? ["right (m)", "up (m)"] : ["column (pixel)", "row (pixel)"];
    const old = picture.ranges || {};
    const layout = { template: TEMPLATE, height: this.plotHeight(picture), margin: { l: 56, r: 12, t: 10, b: 44 }, plot_bgcolor: scale.empty,
      xaxis: { title: { text: words[0] }, showgrid: false, constrain: "domain", range: old.x },
      yaxis: { title: { text: words[1] }, showgrid: false, scaleanchor: "x", constrain: "domain", range: old.y, autorange: old.y ? false : size ? true : "reversed" } };
    await Plotly.react(picture.plot, [trace], layout, CONFIG);
    if (!picture.listens) this.listen(picture);
  }

  plotHeight(picture) {
    const { ratio } = this;
    const inside = Math.max(220, (picture.box.clientWidth || 420) - 170);
    return Math.min(640, Math.round(inside * ratio)) + 60;
  }

  listen(picture) {
    picture.listens = true;
    picture.plot.on("plotly_hover", ({ points, event }) => {
      const [row, column] = points[0].pointNumber;
      tip(this.lines(picture, row, column), event);
      if (!this.pinned) this.show(row, column);
    });
    picture.plot.on("plotly_unhover", () => tip([]));
    picture.plot.on("plotly_click", ({ points }) => {
      this.pinned = this.pinned ? null : points[0].pointNumber;
      this.show(...points[0].pointNumber);
    });
    picture.plot.on("plotly_relayout", (change) => {
      const { xaxis, yaxis } = picture.plot.layout;
      if (!Object.keys(change).some((key) => key.startsWith("xaxis.") || key.startsWith("yaxis."))) return;
      const whole = change["xaxis.autorange"];
      for (const one of this.pictures) {
        one.ranges = whole ? null : { x: [...xaxis.range], y: [...yaxis.range] };
        if (one !== picture) this.draw(one);
      }
    });
  }

  value(channel, row, column) {
    return this.channels[channel].values[row * this.width + column];
  }

  /** The group that a pixel shows first, with its share if it shows several. */
  seenFirst(row, column) {
    if (!this.seen.names.length) return null;
    const values = this.seen.channels.map((channel) => Math.abs(this.value(channel, row, column)) || 0);
    const most = values.indexOf(Math.max(...values)), sum = values.reduce((total, value) => total + value, 0);
    if (!(sum > 0)) return "nothing";
    const share = Math.round(100 * values[most] / sum);
    return share < 100 ? `${this.seen.names[most]} (${share} % of the radiance)` : this.seen.names[most];
  }

  lines(picture, row, column) {
    const lines = [`row ${row}, column ${column}`];
    const told = new Set();
    const tell = (k, words) => {
      if (k < 0 || told.has(k)) return;
      told.add(k);
      const value = this.value(k, row, column), { unit } = this.channels[k];
      lines.push(`${words}: ${shown(value)}${Number.isFinite(value) && unit ? ` ${unit}` : ""}`);
    };
    tell(picture.channel, this.channels[picture.channel].name);
    const find = (name) => this.channels.findIndex((channel) => channel.name === name);
    tell(find("Y"), "radiance");
    tell(find("temperature.Y"), "brightness temperature");
    tell(find("range.Y"), "range");
    const seen = this.seenFirst(row, column);
    if (seen !== null) lines.push(`seen first: ${seen}`);
    return lines;
  }

  show(row, column) {
    const rows = this.channels.map(({ name, unit }, k) => [name, shown(this.value(k, row, column)), unit]);
    const seen = this.seenFirst(row, column);
    if (seen !== null) rows.unshift(["seen first", seen, ""]);
    this.readout.show(`Row ${row}, column ${column}${this.pinned ? " (kept)" : ""}`, rows);
  }
}

/** Text for plotly's labels, in which < and & would be markup. */
function escaped(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
}
