// What all parts of the page share: elements, numbers as text, colours, and how plots look.

/** Makes an element. Text is set as text, so that names from the data stay names. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) made.addEventListener(event, listener);
    } else if (value !== null && value !== undefined && value !== false) {
      made.setAttribute(name, value === true ? "" : value);
    }
  }
  made.append(...children);
  return made;
}

let elementsNamed = 0;

/** An id that no other element of the page has. */
function uniqueId(stem) {
  elementsNamed += 1;
  return `${stem}-${elementsNamed}`;
}

const isNumber = (value) => typeof value === "number";

/** A number with fixed decimals and thin spaces between thousands, or a dash when it is not known. */
function numeral(value, decimals = 1) {
  if (!isNumber(value)) return "–";
  const [whole, fraction] = Math.abs(value).toFixed(decimals).split(".");
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u2009") : whole;
  const sign = value < 0 && Number(value.toFixed(decimals)) !== 0 ? "\u2212" : "";
  return sign + grouped + (fraction ? "." + fraction : "");
}

const seconds = (value) => `${numeral(value, 1)}\u00a0s`;

/** Course of a velocity as a navigator reads it: degrees clockwise from north, three digits. */
function course(vx, vy) {
  const degrees = Math.round((Math.atan2(vx, vy) * 180) / Math.PI + 360) % 360;
  return String(degrees).padStart(3, "0") + "°";
}

/** The value of a style variable such as `--ink`. All colours of the plots live in the style sheet. */
function style(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

const TRACK_COLOURS = 10;
const SENSOR_COLOURS = 6;

/** The colours of the moment, read anew when the scheme changes. */
function readColours() {
  const row = (stem, count) => Array.from({ length: count }, (_, i) => style(`--${stem}-${i}`));
  return {
    ink: style("--ink"),
    muted: style("--muted"),
    grid: style("--grid"),
    paper: style("--paper"),
    truth: style("--truth"),
    tentative: style("--tentative"),
    tracks: row("track", TRACK_COLOURS),
    sensors: row("sensor", SENSOR_COLOURS),
    parts: row("part", 6),
  };
}

/** Calls back when the page turns dark or light, and around printing, which is always light. */
function onColourChange(callback) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", callback);
  const scheme = (value) => () => {
    if (value) document.documentElement.dataset.scheme = value;
    else delete document.documentElement.dataset.scheme;
    callback();
  };
  addEventListener("beforeprint", scheme("light"));
  addEventListener("afterprint", scheme(null));
}

/** Text for labels of plotly, which reads some tags: none of ours shall be taken for one. */
function plotText(text) {
  return String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

/** An axis as all plots have it. */
function axisStyle(colours, title) {
  return {
    title: { text: plotText(title), standoff: 8, font: { size: 12, color: colours.muted } },
    color: colours.muted,
    gridcolor: colours.grid,
    linecolor: colours.grid,
    zeroline: false,
    showline: true,
    ticks: "outside",
    ticklen: 4,
    tickcolor: colours.grid,
    tickfont: { size: 11 },
    separatethousands: false,
    exponentformat: "none",
  };
}

/** The layout that all plots start from. */
function layoutStyle(colours) {
  return {
    font: { family: style("--font"), size: 12, color: colours.ink },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 62, r: 14, t: 10, b: 42 },
    hoverlabel: { bgcolor: colours.paper, bordercolor: colours.grid, font: { color: colours.ink, size: 12 } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colours.muted, activecolor: colours.ink, orientation: "h" },
    separators: ". ",
  };
}

/** Draws a plot again in the size that its host has, or in another width. */
function fitPlot(plot, width = plot.clientWidth) {
  const height = plot.clientHeight;
  const { width: oldWidth, height: oldHeight } = plot._fullLayout;
  if (width > 0 && height > 0 && (width !== oldWidth || height !== oldHeight)) Plotly.relayout(plot, { width, height });
}

/** Keeps a plot as large as its host. Plotly's own way waits a tenth of a second, and does not see every change. */
function followSize(plot) {
  new ResizeObserver(() => fitPlot(plot)).observe(plot);
}
