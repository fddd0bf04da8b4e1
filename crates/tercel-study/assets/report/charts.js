// Charts: curves, steps and stacked areas, over the time of a recording or any other quantity.

/**
 * Draws a chart in `host`. A chart over the time of a recording has a `clock`: it spans `[0, clock.end]`, a click calls
 * `clock.moveTo(time)`, and `mark(time)` of the result moves a line.
 */
function createChart(host, chart, clock) {
  const title = uniqueId("chart");
  const plot = element("div", { class: "chart-plot" });
  const line = element("div", { class: "chart-time", hidden: true });
  const box = element("div", { class: "chart-box" }, plot, line);
  const caption = element("figcaption", { id: title }, chart.title);
  host.append(element("figure", { class: "chart-figure", "aria-labelledby": title }, caption, box));
  let colours = readColours();
  let marked = null;

  const range = clock && clock.end > 0 ? [0, clock.end] : undefined;
  const layout = () => chartLayout(colours, chart, range);
  Plotly.newPlot(plot, chartTraces(chart, colours), layout(), {
    displaylogo: false,
    displayModeBar: false,
    doubleClick: "reset",
  });

  function place() {
    const { _size: size, xaxis } = plot._fullLayout;
    const part = (marked - xaxis.range[0]) / (xaxis.range[1] - xaxis.range[0]);
    line.hidden = marked === null || !(part >= 0 && part <= 1);
    line.style.transform = `translateX(${size.l + part * size.w}px)`;
    line.style.top = `${size.t}px`;
    line.style.height = `${size.h}px`;
  }

  followSize(plot);
  plot.on("plotly_afterplot", place);
  if (clock) {
    plot.classList.add("clickable");
    plot.on("plotly_click", (event) => clock.moveTo(event.points[0].x));
  }
  return {
    mark(x) {
      marked = x;
      place();
    },
    recolour() {
      colours = readColours();
      Plotly.react(plot, chartTraces(chart, colours), layout());
    },
    fit: () => fitPlot(plot),
  };
}

function chartTraces(chart, colours) {
  return chart.parts.flatMap((part, i) => {
    const colour = colours.parts[part.place % colours.parts.length];
    const stacked = chart.form === "stacked";
    const curve = {
      type: "scatter",
      mode: chart.x.length > 1 ? "lines" : "markers",
      name: plotText(part.name),
      x: chart.x,
      y: part.y,
      line: { color: colour, width: stacked ? 1 : 1.8, shape: chart.form === "steps" ? "hv" : "linear", dash: dashOf(part.place, colours) },
      marker: { color: colour },
      stackgroup: stacked ? "parts" : undefined,
      hovertemplate: "%{y:.4~g}",
      hoverlabel: { namelength: -1 },
      legendgroup: String(i),
    };
    return part.band && chart.form === "lines" ? [...bandTraces(chart.x, part.band, colour, i), curve] : [curve];
  });
}

/** More parts than colours: the later ones are dashed. */
function dashOf(index, colours) {
  return ["solid", "dash", "dot", "dashdot"][Math.floor(index / colours.parts.length) % 4];
}

/** The area between two edges. It comes and goes with its curve when the legend is clicked. */
function bandTraces(x, [low, high], colour, index) {
  const edge = { type: "scatter", mode: "lines", x, line: { width: 0 }, hoverinfo: "skip", showlegend: false, legendgroup: String(index) };
  return [{ ...edge, y: low }, { ...edge, y: high, fill: "tonexty", fillcolor: withAlpha(colour, 0.18) }];
}

/** A colour of the style sheet, `#rrggbb`, with an opacity. */
function withAlpha(colour, alpha) {
  return colour + Math.round(255 * alpha).toString(16).padStart(2, "0");
}

function chartLayout(colours, chart, range) {
  return {
    ...layoutStyle(colours),
    xaxis: { ...axisStyle(colours, chart.abscissa), range, showgrid: false, hoverformat: ".1f" },
    yaxis: { ...axisStyle(colours, chart.unit), rangemode: "tozero", fixedrange: true },
    margin: { l: 66, r: 16, t: chart.parts.length > 1 ? 28 : 10, b: 42 },
    hovermode: "x unified",
    hoverdistance: -1,
    dragmode: "zoom",
    showlegend: chart.parts.length > 1,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal" },
  };
}
