// Paints the marks of a plan on a canvas. 20,000 detections take about a tenth of a second this way without a
// graphics card; as elements of a drawing they would take a second, whatever moves.

const MARKS = ["disc", "cross", "square", "triangle", "plus", "diamond"];

/** Which of the colours a track has: the same as long as its number is. */
function colourIndex(track) {
  const number = Number(track.id);
  return (Number.isSafeInteger(number) ? number : track.index) % TRACK_COLOURS;
}

const trackColour = (track, colours) => colours.tracks[colourIndex(track)];

/**
 * Paints the picture at one time.
 * `scale` has `px(x)`, `py(y)`, and `metre`, the pixels of a metre; `view` has what the controls say.
 */
function paintPicture(context, model, view, scale, colours) {
  const from = view.time - view.tail;
  const labels = [];
  if (view.detections.some(Boolean)) paintDetections(context, model, view, scale, colours, from);
  if (view.truth) paintTruths(context, model, view, scale, colours, from, labels);
  if (view.tracks || view.tentative) paintTracks(context, model, view, scale, colours, from, labels);
  paintSensors(context, model, view, scale, colours, labels);
  if (view.labels) paintLabels(context, labels, scale, colours);
}

function paintDetections(context, model, view, scale, colours, from) {
  const { detections } = model;
  for (const sensor of model.sensors) {
    if (!view.detections[sensor.index]) continue;
    const colour = colours.sensors[sensor.index % SENSOR_COLOURS];
    const mark = MARKS[sensor.index % MARKS.length];
    const current = scanAt(sensor, view.time);
    const last = lastAtMost(sensor.times, view.time);
    // A cloud of many detections stays a cloud: each mark is fainter.
    const crowd = Math.min(1, 3000 / Math.max(detections.x.length, 1));
    context.strokeStyle = colour;
    context.fillStyle = colour;
    context.globalAlpha = 0.28 + 0.27 * crowd;
    const older = [];
    for (let k = last; k >= 0 && sensor.times[k] >= from; k -= 1) {
      if (sensor.scans[k] !== current) older.push(sensor.scans[k]);
    }
    paintScans(context, model, older, scale, mark, 1.7);
    context.globalAlpha = 1;
    if (current >= 0) {
      paintScans(context, model, [current], scale, mark, 3);
      paintRays(context, model, current, scale, colour);
    }
  }
}

// One path of all marks takes more than twice as long to fill as many short ones.
const MARKS_PER_PATH = 100;

function paintScans(context, model, list, scale, mark, size) {
  const { x, y, first, bearing } = model.detections;
  const lines = mark === "cross" || mark === "plus";
  let path = new Path2D();
  let marks = 0;
  const flush = () => {
    if (lines) context.stroke(path);
    else context.fill(path);
    path = new Path2D();
    marks = 0;
  };
  context.lineWidth = 1.4;
  for (const k of list) {
    for (let i = first[k]; i < first[k + 1]; i += 1) {
      if (bearing && bearing[i] !== null) continue;
      const px = scale.px(x[i]);
      const py = scale.py(y[i]);
      if (!scale.holds(px, py)) continue;
      addMark(path, mark, px, py, size);
      marks += 1;
      if (marks === MARKS_PER_PATH) flush();
    }
  }
  flush();
}

function addMark(path, mark, x, y, size) {
  if (mark === "disc") {
    path.moveTo(x + size, y);
    path.arc(x, y, size, 0, 2 * Math.PI);
  } else if (mark === "square") {
    path.rect(x - size, y - size, 2 * size, 2 * size);
  } else if (mark === "cross") {
    path.moveTo(x - size, y - size);
    path.lineTo(x + size, y + size);
    path.moveTo(x - size, y + size);
    path.lineTo(x + size, y - size);
  } else if (mark === "plus") {
    path.moveTo(x - 1.3 * size, y);
    path.lineTo(x + 1.3 * size, y);
    path.moveTo(x, y - 1.3 * size);
    path.lineTo(x, y + 1.3 * size);
  } else {
    const wide = mark === "diamond" ? 1.3 * size : 1.2 * size;
    path.moveTo(x, y - 1.3 * size);
    path.lineTo(x + wide, mark === "diamond" ? y : y + size);
    path.lineTo(mark === "diamond" ? x : x - wide, y + (mark === "diamond" ? 1.3 : 1) * size);
    if (mark === "diamond") path.lineTo(x - wide, y);
    path.closePath();
  }
}

/** Detections without a range: rays from the sensor to the edge of the picture. */
function paintRays(context, model, k, scale, colour) {
  const { x, y, bearing, first } = model.detections;
  if (!bearing) return;
  const length = scale.reach;
  context.save();
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.setLineDash([6, 4]);
  context.beginPath();
  for (let i = first[k]; i < first[k + 1]; i += 1) {
    if (bearing[i] === null) continue;
    const px = scale.px(x[i]);
    const py = scale.py(y[i]);
    context.moveTo(px, py);
    context.lineTo(px + length * Math.cos(bearing[i]), py - length * Math.sin(bearing[i]));
  }
  context.stroke();
  context.restore();
}

function paintTruths(context, model, view, scale, colours, from, labels) {
  context.save();
  context.strokeStyle = colours.truth;
  context.lineWidth = 1.5;
  context.setLineDash([5, 4]);
  for (const truth of model.truths) {
    const start = Math.max(lastAtMost(truth.t, from), 0);
    const stop = lastAtMost(truth.t, view.time);
    const here = truthAt(truth, view.time);
    context.beginPath();
    for (let i = start, pen = false; i <= stop; i += 1) pen = drawTo(context, scale, truth.x[i], truth.y[i], pen);
    if (here && stop >= 0) context.lineTo(scale.px(here.x), scale.py(here.y));
    context.stroke();
    const end = here || (truth.t[stop] >= from ? { x: truth.x[stop], y: truth.y[stop] } : null);
    if (!end || stop < 0 || end.x === null) continue;
    if (here) paintTruthMark(context, scale.px(here.x), scale.py(here.y));
    labels.push({ x: end.x, y: end.y, text: truth.name, colour: colours.truth, below: true, faint: !here });
  }
  context.restore();
}

function paintTruthMark(context, x, y) {
  context.save();
  context.setLineDash([]);
  context.beginPath();
  context.rect(x - 5, y - 5, 10, 10);
  context.stroke();
  context.restore();
}

/** Goes on with a line to a point of the plan; a gap lifts the pen. Returns whether the pen is down. */
function drawTo(path, scale, x, y, pen) {
  if (x === null || y === null) return false;
  if (pen) path.lineTo(scale.px(x), scale.py(y));
  else path.moveTo(scale.px(x), scale.py(y));
  return true;
}

function paintTracks(context, model, view, scale, colours, from, labels) {
  for (const track of model.tracks) {
    if (track.first > view.time || (!track.believed && !view.tentative)) continue;
    const row = rowAt(track, view.time);
    if (row < 0 && track.last < from) continue;
    const chosen = track.id === view.chosen;
    context.globalAlpha = row < 0 && !chosen ? 0.75 : 1;
    if (view.trails) paintTrail(context, track, view, scale, colours, from, chosen);
    context.globalAlpha = 1;
    if (row >= 0) paintNow(context, track, row, model, view, scale, colours, chosen);
    labelTrack(track, row, view, colours, from, labels);
  }
}

/** Segments of a trail by what the track was when it came to their end: tentative, seen, or missed. */
function paintTrail(context, track, view, scale, colours, from, chosen) {
  const stop = lastAtMost(track.t, view.time);
  const start = Math.max(lastAtMost(track.t, from), 0);
  const paths = { T: new Path2D(), C: new Path2D(), K: new Path2D() };
  for (let i = start + 1; i <= stop; i += 1) {
    const path = paths[track.status[i]];
    if (!path || track.x[i] === null || track.x[i - 1] === null) continue;
    path.moveTo(scale.px(track.x[i - 1]), scale.py(track.y[i - 1]));
    path.lineTo(scale.px(track.x[i]), scale.py(track.y[i]));
  }
  context.save();
  context.lineCap = "round";
  if (view.tracks) {
    context.strokeStyle = trackColour(track, colours);
    context.lineWidth = chosen ? 3.6 : 2;
    context.stroke(paths.C);
    context.lineWidth = chosen ? 2 : 1;
    context.stroke(paths.K);
  }
  if (view.tentative) {
    context.strokeStyle = colours.tentative;
    context.lineWidth = chosen ? 2.4 : 1.2;
    context.stroke(paths.T);
  }
  context.restore();
}

/** The track where it is now: marker, velocity, ellipse, extent. */
function paintNow(context, track, row, model, view, scale, colours, chosen) {
  const tentative = track.status[row] === "T";
  if (tentative ? !view.tentative : !view.tracks) return;
  const colour = tentative ? colours.tentative : trackColour(track, colours);
  const x = scale.px(track.x[row]);
  const y = scale.py(track.y[row]);
  context.save();
  context.strokeStyle = colour;
  context.fillStyle = colour;
  if (view.ellipses) paintEllipse(context, x, y, track.major[row], track.minor[row], track.angle[row], scale, true);
  const extent = track.extent && track.extent[row];
  if (extent) paintEllipse(context, x, y, ...extent, scale, false);
  if (view.velocities && track.vx && track.vy && track.vx[row] !== null && track.vy[row] !== null) {
    context.lineWidth = 1.4;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(scale.px(track.x[row] + model.lead * track.vx[row]), scale.py(track.y[row] + model.lead * track.vy[row]));
    context.stroke();
  }
  context.beginPath();
  context.arc(x, y, chosen ? 5.5 : 4, 0, 2 * Math.PI);
  // A track that was missed in this scan is hollow.
  if (track.status[row] === "K") context.fillStyle = colours.paper;
  context.fill();
  context.lineWidth = 1.6;
  if (track.status[row] !== "K") context.strokeStyle = colours.paper;
  context.stroke();
  context.restore();
}

/** An ellipse whose first semi-axis lies at `angle` from east towards north; lengths in metres. */
function paintEllipse(context, x, y, major, minor, angle, scale, filled) {
  if (!isNumber(major) || !isNumber(minor) || !isNumber(angle)) return;
  context.lineWidth = filled ? 1 : 2;
  context.beginPath();
  context.ellipse(x, y, major * scale.metre, minor * scale.metre, -angle, 0, 2 * Math.PI);
  if (filled) {
    context.globalAlpha = 0.13;
    context.fill();
    context.globalAlpha = 1;
  }
  context.stroke();
}

function labelTrack(track, row, view, colours, from, labels) {
  if (row >= 0) {
    const tentative = track.status[row] === "T";
    if (tentative ? !view.tentative : !view.tracks) return;
    const colour = tentative ? colours.tentative : trackColour(track, colours);
    labels.push({ x: track.x[row], y: track.y[row], text: track.name, colour, strong: true });
  } else if (view.tracks && view.trails && track.believed && track.last >= from) {
    const last = track.t.length - 1;
    const colour = trackColour(track, colours);
    labels.push({ x: track.x[last], y: track.y[last], text: track.name, colour, faint: true });
  }
}

/** Sensors where they are, with the way that they came. Sensors at one place share a mark. */
function paintSensors(context, model, view, scale, colours, labels) {
  const { scans } = model;
  const places = [];
  for (const sensor of model.sensors) {
    const last = lastAtMost(sensor.times, view.time);
    const k = last < 0 ? sensor.scans[0] : sensor.scans[last];
    if (k === undefined || scans.x[k] === null || scans.y[k] === null) continue;
    context.strokeStyle = colours.muted;
    context.lineWidth = 1;
    context.beginPath();
    for (let i = 0, pen = false; i <= last; i += 1) {
      if (sensor.times[i] < view.time - view.tail) continue;
      pen = drawTo(context, scale, scans.x[sensor.scans[i]], scans.y[sensor.scans[i]], pen);
    }
    context.stroke();
    const here = { x: scans.x[k], y: scans.y[k], names: [sensor.name] };
    const near = places.find((place) => scale.metre * Math.hypot(place.x - here.x, place.y - here.y) < 8);
    if (near) near.names.push(sensor.name);
    else places.push(here);
  }
  for (const { x, y, names } of places) {
    const path = new Path2D();
    addMark(path, "triangle", scale.px(x), scale.py(y), 7);
    context.fillStyle = colours.ink;
    context.fill(path);
    labels.push({ x, y, text: names.join(", "), colour: colours.ink, below: true, strong: true });
  }
}

/** Writes names beside their marks, the important ones first, and leaves out those that would cover another. */
function paintLabels(context, labels, scale, colours) {
  const taken = [];
  const rank = (label) => (label.strong ? 0 : label.faint ? 2 : 1);
  context.save();
  context.textBaseline = "middle";
  context.lineJoin = "round";
  for (const label of [...labels].sort((a, b) => rank(a) - rank(b))) {
    context.font = `${label.strong ? 600 : 400} 12px ${colours.font}`;
    const text = label.text.length > 24 ? label.text.slice(0, 23) + "…" : label.text;
    const x = scale.px(label.x) + 9;
    const y = scale.py(label.y) + (label.below ? 11 : -10);
    const box = [x - 1, y - 7, x + context.measureText(text).width + 1, y + 7];
    if (!scale.holds(x - 9, y) || taken.some((other) => overlap(box, other))) continue;
    taken.push(box);
    context.lineWidth = 3;
    context.strokeStyle = colours.paper;
    context.globalAlpha = 0.85;
    context.strokeText(text, x, y);
    context.globalAlpha = label.faint ? 0.7 : 1;
    context.fillStyle = label.colour;
    context.fillText(text, x, y);
  }
  context.restore();
}

function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}
