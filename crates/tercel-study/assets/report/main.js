// Brings the page to life: every section gets its picture or chart.

function start() {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const pictures = [];
  const charts = [];
  for (const section of document.querySelectorAll("section[data-picture]")) {
    const picture = createPicture(section, data[Number(section.dataset.picture)]);
    pictures.push(picture);
    const activate = () => (active = picture);
    section.addEventListener("pointerdown", activate);
    section.addEventListener("focusin", activate);
  }
  let active = pictures[0];
  for (const section of document.querySelectorAll("section[data-chart]")) {
    charts.push(createChart(section, data[Number(section.dataset.chart)]));
  }
  const parts = [...pictures, ...charts];
  const recolour = () => parts.forEach((part) => part.recolour());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  addEventListener("beforeprint", () => layOutFor(true, parts));
  addEventListener("afterprint", () => layOutFor(false, parts));
  document.addEventListener("keydown", (event) => {
    if (!active || event.ctrlKey || event.altKey || event.metaKey || ownsKey(event.target, event.key)) return;
    if (active.key(event)) event.preventDefault();
  });
  document.documentElement.dataset.ready = "true";
}

/** Whether an element has a use of its own for a key. */
function ownsKey(target, key) {
  if (target.closest("select, textarea, [contenteditable]")) return true;
  if (key === " ") return Boolean(target.closest("button, input[type=checkbox], a, summary"));
  return Boolean(target.closest(".scroll")) && (key === "Home" || key === "End");
}

/** Paper is always light and narrower than most windows: plots are drawn again for it, and back afterwards. */
function layOutFor(printing, parts) {
  document.documentElement.toggleAttribute("data-printing", printing);
  for (const part of parts) {
    part.recolour();
    part.fit();
  }
}

start();
