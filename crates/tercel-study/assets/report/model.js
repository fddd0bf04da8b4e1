// The data of a picture, unpacked, and the questions that the painter asks of it.

/** Index of the last of the ascending `values` that is at most `limit`; -1 if there is none. */
function lastAtMost(values, limit) {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function median(values) {
  if (!values.length) return NaN;
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[sorted.length >> 1];
}

/** Rounds to 1, 2 or 5 times a power of ten. */
function roundNicely(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const lead = value / power;
  return (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power;
}

/** Unpacks a picture: per-detection times and sensors, lives of tracks, bounds, and who used which detection. */
function unpackPicture(data) {
  const model = { ...data };
  model.end = data.times.length ? data.times[data.times.length - 1] : 0;
  model.detections = unpackDetections(data);
  model.sensors = unpackSensors(data);
  model.users = new Map();
  model.tracks = data.tracks.map((track, index) => unpackTrack(track, index, model.users));
  model.trackById = new Map(model.tracks.map((track) => [track.id, track]));
  model.bounds = boundsOf(model);
  model.lead = leadTime(model);
  return model;
}

function unpackDetections(data) {
  const { scans, detections } = data;
  const count = detections.x.length;
  const scan = new Uint32Array(count);
  const first = new Uint32Array(scans.t.length + 1);
  for (let k = 0, i = 0; k < scans.t.length; k += 1) {
    first[k] = i;
    for (const end = i + scans.n[k]; i < end; i += 1) scan[i] = k;
    first[k + 1] = i;
  }
  const { x, y } = detections;
  return { ...detections, x: Float64Array.from(x), y: Float64Array.from(y), scan, first };
}

function unpackSensors(data) {
  return data.sensors.map((sensor, index) => {
    const rows = [];
    data.scans.s.forEach((s, k) => {
      if (s === index) rows.push(k);
    });
    const times = rows.map((k) => data.scans.t[k]);
    const gaps = times.slice(1).map((time, i) => time - times[i]).filter((gap) => gap > 0);
    // A sensor's last picture stands until it is clear that no other came.
    const holds = 2 * (median(gaps) || 0) + 1e-3;
    return { ...sensor, index, scans: rows, times, holds };
  });
}

function unpackTrack(track, index, users) {
  const last = track.t.length - 1;
  track.detection.forEach((id) => {
    if (id !== null) users.set(id, track.id);
  });
  const until = track.until === null ? Infinity : track.until;
  const name = track.name === undefined ? String(track.id) : track.name;
  return { ...track, name, index, first: track.t[0], last: track.t[last], until, believed: /[CK]/.test(track.status) };
}

function boundsOf(model) {
  const bounds = { west: Infinity, east: -Infinity, south: Infinity, north: -Infinity };
  const include = (xs, ys) => {
    for (let i = 0; i < xs.length; i += 1) {
      if (xs[i] === null || ys[i] === null) continue;
      bounds.west = Math.min(bounds.west, xs[i]);
      bounds.east = Math.max(bounds.east, xs[i]);
      bounds.south = Math.min(bounds.south, ys[i]);
      bounds.north = Math.max(bounds.north, ys[i]);
    }
  };
  include(model.detections.x, model.detections.y);
  include(model.scans.x, model.scans.y);
  model.tracks.filter((track) => track.believed).forEach((track) => include(track.x, track.y));
  model.truths.forEach((truth) => include(truth.x, truth.y));
  if (bounds.west > bounds.east) return { west: -100, east: 100, south: -100, north: 100 };
  const margin = 0.03 * Math.max(bounds.east - bounds.west, bounds.north - bounds.south) || 10;
  return {
    west: bounds.west - margin,
    east: bounds.east + margin,
    south: bounds.south - margin,
    north: bounds.north + margin,
  };
}

/** How far ahead a velocity is drawn, s: so that a typical one takes a twentieth of the picture. */
function leadTime(model) {
  const speeds = [];
  for (const track of model.tracks) {
    if (!track.vx || !track.vy || !track.believed) continue;
    const middle = track.t.length >> 1;
    const speed = Math.hypot(track.vx[middle], track.vy[middle]);
    if (speed > 0) speeds.push(speed);
  }
  const size = Math.max(model.bounds.east - model.bounds.west, model.bounds.north - model.bounds.south);
  const typical = median(speeds);
  return typical > 0 ? roundNicely(size / 20 / typical) : 0;
}

/** The row of a track at a time, or -1 when the track does not live then. */
function rowAt(track, time) {
  const row = lastAtMost(track.t, time);
  if (row < 0 || time >= track.until || track.status[row] === "D") return -1;
  return track.x[row] === null || track.y[row] === null ? -1 : row;
}

/** Where a true object is at a time, between its rows by a straight line; null when it is not there. */
function truthAt(truth, time) {
  const row = lastAtMost(truth.t, time);
  if (row < 0 || time > truth.t[truth.t.length - 1]) return null;
  const next = Math.min(row + 1, truth.t.length - 1);
  const gap = truth.t[next] - truth.t[row];
  const part = gap > 0 ? (time - truth.t[row]) / gap : 0;
  const between = (column) => column[row] + part * (column[next] - column[row]);
  if ([truth.x[row], truth.y[row], truth.x[next], truth.y[next]].includes(null)) return null;
  return { x: between(truth.x), y: between(truth.y), row };
}

/** The scan of a sensor that is on its screen at a time, or -1. */
function scanAt(sensor, time) {
  const i = lastAtMost(sensor.times, time);
  return i >= 0 && time - sensor.times[i] <= sensor.holds ? sensor.scans[i] : -1;
}
