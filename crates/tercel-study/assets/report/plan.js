// The plan view. Plotly draws the frame (axes, grid, zoom, pan); the marks are painted on a canvas over it.

/** Makes a plan in `host`. `choose(track id)` is called when a track is clicked. */
function createPlan(host, model, view, choose) {
  const frame = element("div", { class: "plan-frame" });
  const canvas = element("canvas", { class: "plan-marks", role: "img", "aria-label": "Plan view" });
  const ring = element("div", { class: "plan-ring", hidden: true });
  const tip = element("div", { class: "plan-tip", role: "status", hidden: true });
  host.append(frame, canvas, ring, tip);
  let colours = readColours();
  let waiting = false;

  Plotly.newPlot(frame, [boundsTrace(model.bounds)], planLayout(colours), {
    scrollZoom: true,
    displaylogo: false,
    displayModeBar: true,
    doubleClick: "autosize",
    modeBarButtons: [
      [{ name: "save", title: "Save as picture", icon: Plotly.Icons.camera, click: () => savePicture(frame, canvas) }],
      ["zoom2d", "pan2d"],
      ["zoomIn2d", "zoomOut2d", "autoScale2d"],
    ],
  });

  function paint() {
    waiting = false;
    const scale = planScale(frame);
    const density = Math.max(2, window.devicePixelRatio || 1);
    resizeCanvas(canvas, frame._fullLayout.width, frame._fullLayout.height, density);
    const context = canvas.getContext("2d");
    context.setTransform(density, 0, 0, density, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.save();
    context.beginPath();
    context.rect(scale.left, scale.top, scale.width, scale.height);
    context.clip();
    paintPicture(context, model, view, scale, colours);
    context.restore();
    canvas.setAttribute("aria-label", describe(model, view));
    canvas.dataset.time = view.time;
  }

  /** Paints before the next frame of the screen, once, however often it is asked. */
  function schedule() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(paint);
  }

  frame.on("plotly_relayouting", schedule);
  frame.on("plotly_afterplot", schedule);
  followSize(frame);
  watchPointer(host, frame, { model, view, ring, tip, choose });
  paint();

  return {
    schedule,
    paint,
    recolour() {
      colours = readColours();
      Plotly.relayout(frame, planLayout(colours, frame.layout));
    },
    /** Shows an area of the plan, given by its middle and its larger side, m. */
    show(x, y, side) {
      const { width, height } = planScale(frame);
      const metre = Math.min(width, height) / side;
      const across = width / metre / 2;
      const up = height / metre / 2;
      Plotly.relayout(frame, { "xaxis.range": [x - across, x + across], "yaxis.range": [y - up, y + up] });
    },
    fit() {
      fitPlot(frame);
      paint();
    },
  };
}

/** Gives the canvas the size of the frame, with `density` pixels for each of the style sheet's. */
function resizeCanvas(canvas, width, height, density) {
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const [across, down] = [Math.round(width * density), Math.round(height * density)];
  if (canvas.width !== across) canvas.width = across;
  if (canvas.height !== down) canvas.height = down;
}

/** An invisible trace that tells plotly how large the picture is. */
function boundsTrace({ west, east, south, north }) {
  return { type: "scatter", mode: "none", x: [west, east], y: [south, north], hoverinfo: "skip", showlegend: false };
}

function planLayout(colours, old) {
  const axis = (title) => ({ ...axisStyle(colours, title), showgrid: true, mirror: true });
  const x = { ...axis("East, m"), constrain: "range" };
  const y = { ...axis("North, m"), scaleanchor: "x", scaleratio: 1, constrain: "range" };
  // A change of colours keeps what the reader zoomed to.
  if (old && old.xaxis.autorange === false) {
    x.range = old.xaxis.range.slice();
    y.range = old.yaxis.range.slice();
  } else {
    x.autorange = true;
    y.autorange = true;
  }
  const layout = { ...layoutStyle(colours), xaxis: x, yaxis: y, dragmode: (old && old.dragmode) || "pan" };
  return { ...layout, hovermode: false, showlegend: false, margin: { l: 66, r: 16, t: 34, b: 46 } };
}

/** From metres to pixels of the frame, as plotly has them now. */
function planScale(frame) {
  const { _size: size, xaxis, yaxis } = frame._fullLayout;
  const metre = size.w / (xaxis.range[1] - xaxis.range[0]);
  const up = size.h / (yaxis.range[1] - yaxis.range[0]);
  const [left, top] = [size.l, size.t];
  return {
    left,
    top,
    width: size.w,
    height: size.h,
    metre,
    reach: 2 * (size.w + size.h),
    px: (x) => left + (x - xaxis.range[0]) * metre,
    py: (y) => top + (yaxis.range[1] - y) * up,
    holds: (px, py) => px > left - 8 && px < left + size.w + 8 && py > top - 8 && py < top + size.h + 8,
  };
}

/** What the picture shows, for those who cannot see it. */
function describe(model, view) {
  const alive = model.tracks.filter((track) => track.believed && rowAt(track, view.time) >= 0).length;
  const objects = model.truths.filter((truth) => truthAt(truth, view.time)).length;
  const truth = model.truths.length ? `, ${objects} true objects` : "";
  return `Plan view at ${numeral(view.time, 1)} seconds: ${alive} confirmed tracks${truth}.`;
}

/** Saves frame and marks as one picture. */
async function savePicture(frame, canvas) {
  const size = { width: frame.clientWidth, height: frame.clientHeight };
  const drawing = new Image();
  drawing.src = await Plotly.toImage(frame, { format: "svg", ...size });
  await drawing.decode();
  const whole = element("canvas", { width: canvas.width, height: canvas.height });
  const context = whole.getContext("2d");
  context.fillStyle = style("--paper");
  context.fillRect(0, 0, whole.width, whole.height);
  context.drawImage(drawing, 0, 0, whole.width, whole.height);
  context.drawImage(canvas, 0, 0);
  element("a", { href: whole.toDataURL("image/png"), download: "plan-view.png" }).click();
}

/** Tells what is under the pointer, and lets a click choose a track. */
function watchPointer(host, frame, { model, view, ring, tip, choose }) {
  let pressed = null;
  const position = (event) => {
    const box = frame.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const hide = () => {
    ring.hidden = true;
    tip.hidden = true;
  };
  const look = (event) => {
    const [x, y] = position(event);
    const scale = planScale(frame);
    const found = event.buttons === 0 ? pick(model, view, scale, x, y) : null;
    if (!found) return hide();
    ring.hidden = false;
    ring.style.transform = `translate(${found.px}px, ${found.py}px)`;
    tip.replaceChildren(...describeMark(model, found));
    tip.hidden = false;
    const left = found.px > scale.left + scale.width / 2 ? found.px - tip.offsetWidth - 14 : found.px + 14;
    const top = Math.min(Math.max(found.py - tip.offsetHeight / 2, 4), frame.clientHeight - tip.offsetHeight - 4);
    tip.style.transform = `translate(${Math.max(left, 4)}px, ${top}px)`;
    return undefined;
  };
  host.addEventListener("pointermove", look);
  host.addEventListener("pointerleave", hide);
  host.addEventListener("pointerdown", (event) => (pressed = position(event)), true);
  host.addEventListener(
    "pointerup",
    (event) => {
      const [x, y] = position(event);
      if (!pressed || Math.hypot(x - pressed[0], y - pressed[1]) > 4) return;
      const found = pick(model, view, planScale(frame), x, y);
      if (found && found.track) choose(found.track.id);
    },
    true,
  );
}

const PICK_RADIUS = 9;

/** The mark nearest to a pixel; tracks win over truth, and truth over detections, when both are near. */
function pick(model, view, scale, px, py) {
  let best = null;
  const offer = (x, y, handicap, mark) => {
    if (x === null || y === null) return;
    const [qx, qy] = [scale.px(x), scale.py(y)];
    const distance = Math.hypot(qx - px, qy - py);
    if (distance > PICK_RADIUS || (best && distance + handicap >= best.score)) return;
    best = { ...mark, px: qx, py: qy, score: distance + handicap };
  };
  const from = view.time - view.tail;
  if (view.tracks || view.tentative) pickTracks(model, view, from, offer);
  if (view.truth) {
    for (const truth of model.truths) {
      const stop = lastAtMost(truth.t, view.time);
      for (let row = stop; row >= 0 && truth.t[row] >= from; row -= 1) offer(truth.x[row], truth.y[row], 3, { truth, row });
    }
  }
  for (const sensor of model.sensors) if (view.detections[sensor.index]) pickDetections(model, view, sensor, from, offer);
  return best;
}

function pickTracks(model, view, from, offer) {
  for (const track of model.tracks) {
    if (!track.believed && !view.tentative) continue;
    const now = rowAt(track, view.time);
    if (now >= 0) offer(track.x[now], track.y[now], -3, { track, row: now });
    if (!view.trails) continue;
    for (let row = lastAtMost(track.t, view.time); row >= 0 && track.t[row] >= from; row -= 1) {
      const shown = track.status[row] === "T" ? view.tentative : view.tracks;
      if (shown) offer(track.x[row], track.y[row], 0, { track, row });
    }
  }
}

function pickDetections(model, view, sensor, from, offer) {
  const { x, y, first, bearing } = model.detections;
  const current = scanAt(sensor, view.time);
  for (let i = lastAtMost(sensor.times, view.time); i >= 0; i -= 1) {
    const k = sensor.scans[i];
    if (sensor.times[i] < from && k !== current) break;
    for (let d = first[k]; d < first[k + 1]; d += 1) {
      if (!bearing || bearing[d] === null) offer(x[d], y[d], 4, { sensor, detection: d });
    }
  }
}

/** The lines of the tip for a mark. */
function describeMark(model, found) {
  if (found.track) return describeTrack(model, found.track, found.row);
  if (found.truth) return describeTruth(model, found.truth, found.row);
  return describeDetection(model, found.sensor, found.detection);
}

function tipLines(title, lines) {
  const rows = lines.map(([name, value]) => element("div", {}, element("span", {}, name), element("b", {}, value)));
  return [element("strong", {}, title), ...rows];
}

function motionLines(vx, vy) {
  if (!isNumber(vx) || !isNumber(vy)) return [];
  return [["speed", `${numeral(Math.hypot(vx, vy), 2)} m/s`], ["course", course(vx, vy)]];
}

const placeLine = (x, y) => ["east, north", `${numeral(x, 1)}, ${numeral(y, 1)} m`];

const STATUS_NAMES = { T: "tentative", C: "confirmed", K: "coasted", D: "deleted" };

function describeTrack(model, track, row) {
  const lines = [["status", STATUS_NAMES[track.status[row]]], ["time", seconds(track.t[row])]];
  lines.push(placeLine(track.x[row], track.y[row]));
  lines.push(...motionLines(track.vx && track.vx[row], track.vy && track.vy[row]));
  lines.push(["existence", numeral(track.existence[row], 3)]);
  if (isNumber(track.major[row])) {
    lines.push(["2σ ellipse", `${numeral(track.major[row], 1)} × ${numeral(track.minor[row], 1)} m`]);
  }
  model.modes.forEach((name, i) => lines.push([`mode ${name}`, numeral(track.modes[i][row], 2)]));
  const used = track.detection[row];
  lines.push(["detection", used === null ? "none" : String(used)]);
  return tipLines(`Track ${track.name}`, lines);
}

function describeTruth(model, truth, row) {
  const lines = [["time", seconds(truth.t[row])], placeLine(truth.x[row], truth.y[row])];
  lines.push(...motionLines(truth.vx && truth.vx[row], truth.vy && truth.vy[row]));
  return tipLines(`Truth: ${truth.name}`, lines);
}

function describeDetection(model, sensor, i) {
  const { detections, scans } = model;
  const k = detections.scan[i];
  const lines = [["time", seconds(scans.t[k])], ["id", String(detections.id[i])], placeLine(detections.x[i], detections.y[i])];
  if (scans.x[k] !== null && scans.y[k] !== null) {
    const [dx, dy] = [detections.x[i] - scans.x[k], detections.y[i] - scans.y[k]];
    lines.push(["range, bearing", `${numeral(Math.hypot(dx, dy), 1)} m, ${course(dx, dy)}`]);
  }
  if (detections.rate && detections.rate[i] !== null) lines.push(["range rate", `${numeral(detections.rate[i], 2)} m/s`]);
  if (detections.truth && detections.truth[i] !== null) lines.push(["object", model.objects[detections.truth[i]]]);
  const user = model.users.get(detections.id[i]);
  lines.push(["used by", user === undefined ? "no track" : `track ${model.trackById.get(user).name}`]);
  return tipLines(`Detection of ${sensor.name}`, lines);
}
