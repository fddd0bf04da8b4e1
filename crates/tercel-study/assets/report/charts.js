// Charts: curves, steps and stacked areas, over the time of a recording or any other quantity.

/**
 * Draws a chart in `host`. With `moveTo`, a click calls it with the abscissa, and the result's `mark(x)` moves a line.
 */
function createChart(host, chart, moveTo) {
  const title = uniqueId("chart");
  const plot = element("div", { class: "chart-plot" });
  const line = element("div", { class: "chart-time", hidden: true });
  const unit = chart.unit ? `, ${chart.unit}` : "";
  const box = element("div", { class: "chart-box" }, plot, line);
  const caption = element("figcaption", { id: title }, chart.title);
  host.append(element("figure", { class: "chart-figure", "aria-labelledby": title }, caption, box));
  let colours = readColours();
  let marked = null;

  const layout = () => chartLayout(colours, chart, (chart.parts.length === 1 ? chart.parts[0].name : chart.title) + unit);
  Plotly.newPlot(plot, chartTraces(chart, colours), layout(), {
    displaylogo: false,
    displayModeBar: false,
    doubleClick: "autosize",
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
  if (moveTo) {
    plot.classList.add("clickable");
    plot.on("plotly_click", (event) => moveTo(event.points[0].x));
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
    fit: (width) => fitPlot(plot, width),
  };
}

function chartTraces(chart, colours) {
  return chart.parts.map((part, i) => {
    const colour = colours.parts[i % colours.parts.length];
    const stacked = chart.form === "stacked";
    return {
      type: "scatter",
      mode: chart.x.length > 1 ? "lines" : "markers",
      name: plotText(part.name),
      x: chart.x,
      y: part.y,
      line: { color: colour, width: stacked ? 1 : 1.8, shape: chart.form === "steps" ? "hv" : "linear" },
      marker: { color: colour },
      stackgroup: stacked ? "parts" : undefined,
      hovertemplate: "%{y:.4~g}",
      hoverlabel: { namelength: -1 },
    };
  });
}

function chartLayout(colours, chart, ordinate) {
  return {
    ...layoutStyle(colours),
    xaxis: { ...axisStyle(colours, chart.abscissa), showgrid: false, hoverformat: ".1f" },
    yaxis: { ...axisStyle(colours, ordinate), rangemode: "tozero", fixedrange: true },
    margin: { l: 66, r: 16, t: chart.parts.length > 1 ? 28 : 10, b: 42 },
    hovermode: "x unified",
    hoverdistance: -1,
    dragmode: "zoom",
    showlegend: chart.parts.length > 1,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal" },
  };
}
