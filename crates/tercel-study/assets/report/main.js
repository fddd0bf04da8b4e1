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
  onColourChange(() => parts.forEach((part) => part.recolour()));
  fitPrint(parts);
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

/** Paper is narrower than most windows: plots are drawn again in its width, and back afterwards. */
function fitPrint(parts) {
  const paper = 700;
  addEventListener("beforeprint", () => parts.forEach((part) => part.fit(paper)));
  addEventListener("afterprint", () => parts.forEach((part) => part.fit()));
}

start();
