// A recording on the page: plan view, player, layers, table of tracks, and charts that follow the time.

const TAILS = [0, 5, 10, 30, 60, 120, 300, 600, 1800, Infinity];
const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

/** Fills a section with a picture; returns what the page needs to steer it. */
function createPicture(section, data) {
  const model = unpackPicture(data);
  const view = {
    index: 0,
    time: 0,
    tail: Infinity,
    detections: model.sensors.map(() => true),
    tracks: true,
    tentative: false,
    ellipses: true,
    velocities: true,
    truth: true,
    trails: true,
    labels: true,
    chosen: null,
  };
  const hosts = layOutPicture(section, model);
  const charts = [];
  let plan = null;
  const refresh = () => plan && plan.schedule();

  const player = createPlayer(hosts.player, model, view, () => {
    refresh();
    charts.forEach((chart) => chart.mark(view.time));
    table.markAlive();
  });
  const choose = (id) => {
    view.chosen = view.chosen === id ? null : id;
    table.markChosen();
    refresh();
  };
  const visit = (id) => {
    view.chosen = id;
    const track = model.trackById.get(id);
    if (view.time < track.first || view.time >= track.until) player.moveTo(track.last);
    table.markChosen();
    showTrack(plan, model, track);
  };
  const table = createTrackTable(hosts.tracks, model, view, visit);
  createLayers(hosts.layers, model, view, () => {
    refresh();
    table.refill();
  });
  plan = createPlan(hosts.plan, model, view, choose);
  const clock = { end: model.end, moveTo: player.moveTo };
  for (const chart of data.charts) charts.push(createChart(hosts.charts, chart, clock));
  player.moveTo(model.end);

  const parts = [plan, ...charts];
  return {
    key: player.key,
    recolour() {
      parts.forEach((part) => part.recolour());
      table.refill();
    },
    fit: () => parts.forEach((part) => part.fit()),
  };
}

function layOutPicture(section, model) {
  const hosts = {
    plan: element("div", { class: "plan" }),
    player: element("div", { class: "player", role: "group", "aria-label": "Time" }),
    layers: element("fieldset", { class: "layers" }),
    tracks: element("div", { class: "tracks" }),
    charts: element("div", { class: "charts" }),
  };
  const notes = model.notes.map((note) => element("p", { class: "note" }, note));
  const epoch = model.start ? [element("p", { class: "hint" }, `Times count from ${numeral(model.start, 3)} s of the data.`)] : [];
  section.append(
    element(
      "div",
      { class: "picture-grid" },
      element("div", { class: "picture-main" }, element("h2", {}, "Plan view"), ...notes, hosts.plan, hosts.player, ...epoch),
      element("div", { class: "picture-side" }, hosts.layers, hosts.tracks),
    ),
    hosts.charts,
  );
  return hosts;
}

/** Shows the whole of a track, with some water around it. */
function showTrack(plan, model, track) {
  const known = track.x.map((x, i) => [x, track.y[i]]).filter(([x, y]) => x !== null && y !== null);
  if (!known.length) return;
  const span = (axis) => {
    const values = known.map((point) => point[axis]);
    const [low, high] = [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
    return { middle: (low + high) / 2, size: high - low };
  };
  const [x, y] = [span(0), span(1)];
  const whole = Math.max(model.bounds.east - model.bounds.west, model.bounds.north - model.bounds.south);
  plan.show(x.middle, y.middle, Math.max(1.5 * Math.max(x.size, y.size), 0.05 * whole));
}

/** The time slider with its buttons. `changed` is called when the time is another. */
function createPlayer(host, model, view, changed) {
  const { times } = model;
  const last = Math.max(times.length - 1, 0);
  const slider = element("input", { type: "range", class: "time", min: 0, max: last, step: 1, value: 0, "aria-label": "Time" });
  const play = element("button", { type: "button", class: "play", "aria-label": "Play" }, "▶");
  const back = element("button", { type: "button", "aria-label": "One scan back" }, "‹");
  const forth = element("button", { type: "button", "aria-label": "One scan forth" }, "›");
  const readout = element("output", { class: "readout" });
  const length = model.end - (times[0] || 0);
  const speeds = SPEEDS.map((speed) => [speed, `${speed}×`]);
  const natural = SPEEDS.find((speed) => length / speed <= 45) || SPEEDS[SPEEDS.length - 1];
  const speed = chooser("Speed", speeds, natural, () => {});
  const tails = TAILS.filter((tail) => tail < length || tail === Infinity);
  const named = tails.map((tail) => [tail, tail === Infinity ? "whole" : tail === 0 ? "none" : `${tail} s`]);
  const tail = chooser("Tail", named, Infinity, (value) => {
    view.tail = value;
    changed();
  });
  const row = element("div", { class: "player-row" }, play, back, slider, forth);
  host.append(row, element("div", { class: "player-row" }, readout, tail.label, speed.label));
  for (const control of [slider, play, back, forth]) control.disabled = times.length < 2;

  let playing = null;

  function setIndex(index) {
    view.index = Math.min(Math.max(index, 0), last);
    view.time = times.length ? times[view.index] : 0;
    slider.value = view.index;
    const text = times.length ? `${seconds(view.time)} of ${seconds(model.end)}` : "no scans";
    readout.value = times.length ? `${text} · step ${view.index + 1} of ${times.length}` : text;
    slider.setAttribute("aria-valuetext", text);
    changed();
  }

  function stop() {
    if (playing !== null) cancelAnimationFrame(playing);
    playing = null;
    play.textContent = "▶";
    play.setAttribute("aria-label", "Play");
  }

  function start() {
    if (times.length < 2) return;
    if (view.index === last) setIndex(0);
    play.textContent = "❚❚";
    play.setAttribute("aria-label", "Pause");
    let clock = view.time;
    let before = performance.now();
    const step = (now) => {
      clock += (Math.max(now - before, 0) / 1000) * speed.value();
      before = now;
      const index = lastAtMost(times, clock);
      if (index !== view.index) setIndex(index);
      if (view.index >= last) stop();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  const toggle = () => (playing === null ? start() : stop());
  const move = (index) => {
    stop();
    setIndex(index);
  };
  play.addEventListener("click", toggle);
  back.addEventListener("click", () => move(view.index - 1));
  forth.addEventListener("click", () => move(view.index + 1));
  slider.addEventListener("input", () => move(Number(slider.value)));

  const keys = {
    ArrowLeft: (event) => move(view.index - (event.shiftKey ? 10 : 1)),
    ArrowRight: (event) => move(view.index + (event.shiftKey ? 10 : 1)),
    Home: () => move(0),
    End: () => move(last),
    " ": toggle,
  };
  return {
    moveTo: (time) => move(Math.max(lastAtMost(times, time + 1e-6), 0)),
    /** Acts on a key; tells whether it was one of ours. */
    key(event) {
      const act = keys[event.key];
      if (act) act(event);
      return Boolean(act);
    },
  };
}

/** A labelled selection of numbers. */
function chooser(name, options, initial, changed) {
  const select = element("select", {});
  options.forEach(([value, text], i) => {
    select.append(element("option", { value: i, selected: value === initial }, text));
  });
  const value = () => options[Number(select.value)][0];
  select.addEventListener("change", () => changed(value()));
  return { label: element("label", { class: "chooser" }, `${name} `, select), value };
}

/** The switches for what the plan shows; they are its legend, too. */
function createLayers(host, model, view, changed) {
  host.append(element("legend", {}, "Shown"));
  const add = (key, text, swatch, target = view) => {
    const box = element("input", { type: "checkbox", checked: target[key] });
    box.addEventListener("change", () => {
      target[key] = box.checked;
      changed();
    });
    box.dataset.layer = target === view ? key : `detections-${key}`;
    host.append(element("label", {}, box, swatch, element("span", {}, text)));
  };
  const tentative = model.tracks.filter((track) => !track.believed).length;
  model.sensors.forEach((sensor, i) => {
    add(i, `${sensor.name}: ${numeral(sensor.count, 0)}`, sensorSwatch(i), view.detections);
  });
  add("tracks", `Tracks: ${model.tracks.length - tentative}`, lineSwatch("--track-0", "solid"));
  add("tentative", `Tentative: ${tentative}`, lineSwatch("--tentative", "solid"));
  if (model.truths.length) add("truth", `Truth: ${model.truths.length}`, lineSwatch("--truth", "dashed"));
  add("trails", "Trails", "");
  add("ellipses", "2σ ellipses", "");
  if (model.lead) add("velocities", `Velocity, ${numeral(model.lead, model.lead < 1 ? 2 : 0)} s ahead`, "");
  add("labels", "Names", "");
}

function lineSwatch(variable, dash) {
  return element("i", { class: "swatch line", style: `border-top: 2px ${dash} var(${variable})` });
}

/** A mark as the plan paints it, in a colour that follows the scheme. */
function sensorSwatch(index) {
  const shapes = {
    disc: "M12 7a5 5 0 1 1-10 0a5 5 0 1 1 10 0z",
    cross: "M2 2L12 12M2 12L12 2",
    square: "M2.5 2.5h9v9h-9z",
    triangle: "M7 1.5L12.5 12h-11z",
    plus: "M7 1v12M1 7h12",
    diamond: "M7 1l6 6l-6 6l-6-6z",
  };
  const names = "http://www.w3.org/2000/svg";
  const drawing = document.createElementNS(names, "svg");
  const path = document.createElementNS(names, "path");
  drawing.setAttribute("class", "swatch");
  drawing.setAttribute("viewBox", "0 0 14 14");
  drawing.setAttribute("aria-hidden", "true");
  path.setAttribute("d", shapes[MARKS[index % MARKS.length]]);
  path.setAttribute("style", `fill: var(--sensor-${index % SENSOR_COLOURS}); stroke: var(--sensor-${index % SENSOR_COLOURS})`);
  drawing.append(path);
  return drawing;
}
