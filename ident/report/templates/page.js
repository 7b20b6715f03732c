"use strict";
// Draws the plots in the page's colours, links plots of one group, sorts and filters tables.
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const coarse = matchMedia("(pointer: coarse)").matches;
const drawn = new Map();                       // canvas -> {group, roles}

function axisStyle(axis) {
  return Object.assign({}, axis, {
    gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("line"),
    title: Object.assign({ font: { size: 12 }, standoff: 6 }, axis.title), automargin: true,
  });
}

const PAPER = 660;                            // px: A4 and letter inside their margins
let paper = false;

function styled(figure) {
  const layout = Object.assign({}, figure.layout, {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: colour("ink"), size: 12 }, margin: { l: 62, r: 12, t: innerWidth < 700 ? 58 : 32, b: 42 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("faint"), activecolor: colour("accent") },
    hovermode: "x unified", dragmode: coarse ? false : "zoom", bargap: 0.02,
    hoverlabel: { bgcolor: colour("paper"), font: { color: colour("ink") } },
    legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom", yref: "paper" },
    autosize: !paper, width: paper ? PAPER : undefined,
  });
  for (const key of Object.keys(layout)) if (/^[xy]axis/.test(key)) layout[key] = axisStyle(layout[key]);
  const data = figure.data.map((trace) => {
    const ink = colour(trace.meta.role);
    const copy = Object.assign({}, trace);
    if (trace.line) copy.line = Object.assign({ color: ink }, trace.line);
    if (trace.marker || trace.type === "bar") copy.marker = Object.assign({ color: ink }, trace.marker);
    return copy;
  });
  return { data, layout };
}

async function draw(figureElement) {
  const canvas = figureElement.querySelector(".canvas");
  if (drawn.has(canvas)) return;
  const figure = JSON.parse(figureElement.querySelector("script").textContent);
  drawn.set(canvas, { group: figure.group, figure });
  const { data, layout } = styled(figure);
  await Plotly.newPlot(canvas, data, layout, { responsive: true, displaylogo: false,
    displayModeBar: true, modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]] });
  canvas.on("plotly_relayout", (change) => zoomGroup(canvas, figure.group, change));
  canvas.dataset.drawn = "yes";
}

let zooming = false;
async function zoomGroup(source, group, change) {
  const range = change["xaxis.range[0]"] !== undefined
    ? { "xaxis.range": [change["xaxis.range[0]"], change["xaxis.range[1]"]] }
    : change["xaxis.autorange"] ? { "xaxis.autorange": true } : null;
  if (!group || zooming || !range) return;
  zooming = true;
  try {
    for (const [canvas, { group: other }] of drawn)
      if (canvas !== source && other === group && canvas.dataset.drawn) await Plotly.relayout(canvas, range);
  } finally { zooming = false; }
}

const figures = [...document.querySelectorAll("figure.plot")];
const unfolded = (element) => { const fold = element.closest("details"); return !fold || fold.open; };
async function drawAll() {                      // one after the other, leaving the page alive between two
  for (const element of figures) {
    if (!unfolded(element)) continue;
    await draw(element);
    await new Promise((next) => setTimeout(next, 0));
  }
  document.documentElement.dataset.ready = "yes";
}
const repaint = () => { for (const [canvas, { figure }] of drawn) {
  if (!canvas.dataset.drawn) continue;
  const { data, layout } = styled(figure);
  const range = canvas.layout.xaxis.autorange ? null : canvas.layout.xaxis.range;
  if (range) layout.xaxis.range = range;
  Plotly.react(canvas, data, layout);
} };

for (const fold of document.querySelectorAll("details"))
  fold.addEventListener("toggle", () => { if (fold.open) drawAll(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
let folded = [];
addEventListener("beforeprint", () => {        // paper hides nothing: every fold open, every plot drawn
  folded = [...document.querySelectorAll("details:not([open])")];
  paper = true;
  for (const fold of folded) fold.open = true;
  for (const element of figures) draw(element);
  repaint();
});
addEventListener("afterprint", () => {
  paper = false;
  for (const fold of folded) fold.open = false;
  repaint();
});

const sortable = (cell) => {
  const value = cell.dataset.value ?? cell.textContent.trim();
  const number = Number(value);
  return value !== "" && !Number.isNaN(number) ? number : value;
};
function compare(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;     // numbers first, dashes last
  return a.localeCompare(b, undefined, { numeric: true });
}
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.querySelectorAll("th")];
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
    const up = head.getAttribute("aria-sort") !== "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => (up ? 1 : -1) * compare(sortable(a.cells[column]), sortable(b.cells[column])));
    table.tBodies[0].append(...rows);
  }));
}
for (const box of document.querySelectorAll("input.filter"))
  box.addEventListener("input", () => {
    const wanted = box.value.toLowerCase();
    for (const row of box.parentElement.querySelectorAll("tbody tr"))
      row.hidden = !row.textContent.toLowerCase().includes(wanted);
  });

drawAll();
