"use strict";
// What all panels of a page share: numbers as text, elements, the tip beside the pointer, controls.
const PANELS = {};  // kind of panel: function of (element, data)
const NO_VALUE = "no value";

/** Bytes of a compressed text element, as mi_lcair.show.page.page.packed writes it. */
async function unpacked(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The data of a panel with arrays in the place of references. */
function revived(data, numbers) {
  if (Array.isArray(data)) return data.map((item) => revived(item, numbers));
  if (data === null || typeof data !== "object") return data;
  if ("first" in data && "shape" in data) {
    const size = data.shape.reduce((product, length) => product * length, 1);
    return numbers.subarray(data.first, data.first + size);
  }
  return Object.fromEntries(Object.entries(data).map(([key, item]) => [key, revived(item, numbers)]));
}

/** A number as text with at most `digits` digits, or "no value". */
function shown(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NO_VALUE;
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const [digit, power] = value.toExponential(digits - 1).split("e");
    return `${Number(digit)}e${Number(power)}`;
  }
  return String(Number(value.toPrecision(digits)));
}

/** An element with properties and children; text is set as text, never as HTML. */
function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** A labelled menu of [value, words]; `changed` gets the value as text. */
function menu(words, choices, chosen, changed) {
  const select = element("select", { title: words },
    ...choices.map(([value, text]) => element("option", { value, textContent: text })));
  select.value = String(chosen);
  select.addEventListener("change", () => changed(select.value));
  return element("label", {}, words, select);
}

/** A labelled box to tick; `changed` gets true or false. */
function tick(words, checked, changed) {
  const box = element("input", { type: "checkbox", checked });
  box.addEventListener("change", () => changed(box.checked));
  return element("label", {}, box, words);
}

/** A labelled field for a number; `changed` gets it. What is no number is put back. */
function numberField(words, changed) {
  const field = element("input", { type: "text", inputMode: "decimal", title: words });
  field.addEventListener("change", () => {
    const value = Number(field.value);
    if (field.value.trim() !== "" && Number.isFinite(value)) changed(value);
    else field.value = field.dataset.last;
  });
  const label = element("label", {}, words, field);
  label.show = (value) => { field.value = field.dataset.last = shown(value, 6); };
  return label;
}

/** A button; `pressed` is called without arguments. */
function button(words, pressed) {
  const made = element("button", { type: "button", textContent: words });
  made.addEventListener("click", () => pressed());
  return made;
}

/** Show lines of text beside the pointer; no lines hide them. */
function tip(lines, event) {
  const box = document.getElementById("tip");
  box.hidden = !lines.length;
  if (box.hidden) return;
  box.textContent = lines.join("\n");
  const right = event.clientX + 18 + box.offsetWidth > window.innerWidth;
  const below = event.clientY + 18 + box.offsetHeight > window.innerHeight;
  box.style.left = `${right ? Math.max(0, event.clientX - 18 - box.offsetWidth) : event.clientX + 18}px`;
  box.style.top = `${below ? Math.max(0, event.clientY - 18 - box.offsetHeight) : event.clientY + 18}px`;
}

/** A read-out: a heading over a table of [name, value, unit]. */
class Readout {
  constructor(heading, hint) {
    this.heading = element("h3", { textContent: heading });
    this.body = element("tbody");
    this.element = element("div", { className: "readout" }, this.heading,
      element("div", { className: "hint", textContent: hint }), element("table", {}, this.body));
  }
  show(heading, rows) {
    this.heading.textContent = heading;
    this.body.replaceChildren(...rows.map(([name, value, unit]) => element("tr", {},
      element("th", { textContent: name }), element("td", { textContent: value }),
      element("td", { className: "unit", textContent: unit }))));
  }
}

const FONT = { family: '"Segoe UI", "Helvetica Neue", "Liberation Sans", Arial, sans-serif', size: 12, color: "#1c2430" };
const AXIS = { showline: true, linecolor: "#5b6675", ticks: "outside", ticklen: 4, tickcolor: "#5b6675",
  gridcolor: "#e6e9ee", zeroline: false, automargin: true, exponentformat: "power", title: { standoff: 6 } };
const POLAR_AXIS = { gridcolor: "#dde1e7", linecolor: "#5b6675" };
const TEMPLATE = { layout: { font: FONT, paper_bgcolor: "#fff", plot_bgcolor: "#fff", xaxis: AXIS, yaxis: AXIS,
  polar: { bgcolor: "#fff", angularaxis: POLAR_AXIS, radialaxis: { ...POLAR_AXIS, tickfont: { size: 11 } } },
  legend: { bgcolor: "rgba(255,255,255,0.7)" }, hoverlabel: { font: { ...FONT, color: "#fff" }, bgcolor: "#1c2430" },
  colorway: ["#1f5fa8", "#d1495b", "#2e8b57", "#e08e0b", "#6a4c93", "#0fa3b1", "#8d5a2b", "#c2569c", "#6b7280", "#9aa800"] } };
const CONFIG = { responsive: true, displaylogo: false, scrollZoom: false,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "sendChartToCloud"] };

/** A figure of plotly, as mi_lcair.show.page.figures describes it. */
PANELS.figure = (place, data) => {
  const plot = element("div", { className: "plot" });
  place.append(plot);
  return Plotly.newPlot(plot, data.data, { template: TEMPLATE, ...data.layout }, CONFIG);
};
