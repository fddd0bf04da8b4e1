// The table of tracks: one row a track, sorted by any column; a click shows the track.

const TRACK_COLUMNS = [
  { name: "Track", value: (track) => track.id, text: (track) => track.name },
  { name: "First,\u00a0s", value: (track) => track.first, text: (track) => numeral(track.first, 1) },
  { name: "Last,\u00a0s", value: (track) => track.last, text: (track) => numeral(track.last, 1) },
  { name: "Duration,\u00a0s", value: (track) => track.last - track.first, text: (track) => numeral(track.last - track.first, 1) },
  { name: "Updates", value: (track) => track.updates, text: (track) => numeral(track.updates, 0) },
  { name: "Max existence", value: (track) => track.peak, text: (track) => numeral(track.peak, 3) },
];

/** Makes the table. `visit(id)` is called when a track is clicked. */
function createTrackTable(host, model, view, visit) {
  const title = element("h2", { id: uniqueId("tracks") }, "Tracks");
  const body = element("tbody");
  const heads = TRACK_COLUMNS.map((column, i) => {
    const button = element("button", { type: "button", on: { click: () => sortBy(i) } }, column.name);
    return element("th", { scope: "col" }, button);
  });
  const table = element("table", { "aria-labelledby": title.id }, element("thead", {}, element("tr", {}, ...heads)), body);
  const hint = element("p", { class: "hint" });
  host.append(title, hint, element("div", { class: "scroll", tabindex: 0, role: "region", "aria-labelledby": title.id }, table));
  let sorted = 0;
  let falling = false;
  let rows = [];

  function sortBy(column) {
    falling = sorted === column ? !falling : column > 2;
    sorted = column;
    refill();
  }

  function refill() {
    const shown = model.tracks.filter((track) => track.believed || view.tentative);
    const { value } = TRACK_COLUMNS[sorted];
    const order = (a, b) => (value(a) < value(b) ? -1 : value(a) > value(b) ? 1 : 0);
    shown.sort((a, b) => (falling ? order(b, a) : order(a, b)));
    rows = shown.map((track) => ({ track, row: trackRow(track, visit) }));
    body.replaceChildren(...rows.map(({ row }) => row));
    heads.forEach((head, i) => {
      if (i === sorted) head.setAttribute("aria-sort", falling ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    const hidden = model.tracks.length - shown.length;
    const none = model.tracks.length ? "" : "There are no tracks.";
    hint.textContent = hidden ? `Click to show one. ${hidden} never confirmed are hidden.` : none || "Click to show one.";
    markAlive();
    markChosen();
  }

  function markAlive() {
    for (const { track, row } of rows) row.classList.toggle("alive", rowAt(track, view.time) >= 0);
  }

  function markChosen() {
    for (const { track, row } of rows) {
      const chosen = track.id === view.chosen;
      row.classList.toggle("chosen", chosen);
      if (chosen) row.scrollIntoView({ block: "nearest" });
    }
  }

  refill();
  return { refill, markAlive, markChosen };
}

function trackRow(track, visit) {
  const colour = track.believed ? `--track-${colourIndex(track)}` : "--tentative";
  const swatch = element("i", { class: "swatch dot", style: `background: var(${colour})` });
  const button = element("button", { type: "button", "aria-label": `Show track ${track.name}` }, swatch, TRACK_COLUMNS[0].text(track));
  const cells = TRACK_COLUMNS.slice(1).map((column) => element("td", {}, column.text(track)));
  const row = element("tr", { on: { click: () => visit(track.id) } }, element("th", { scope: "row" }, button), ...cells);
  row.dataset.track = track.id;
  return row;
}
