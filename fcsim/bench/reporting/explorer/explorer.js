"use strict";
/* A bench, problem by problem: profiles, a table that sorts and filters, one problem's numbers, another bench beside it. */

const bench = JSON.parse(document.getElementById("content").textContent);
const at = id => document.getElementById(id);
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31", "#7f7f7f"];
const DASHES = ["solid", "dash", "dot", "dashdot"];
const line = k => ({ color: COLOURS[k % COLOURS.length], dash: DASHES[Math.floor(k / COLOURS.length) % DASHES.length], width: 2 });
let order = { key: "contacts", down: false }, chosen = null;

const now = () => bench.tolerances[at("tolerance").value];
const mine = () => at("mine").value;

function time(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const [factor, unit] = seconds >= 1 ? [1, "s"] : seconds >= 1e-3 ? [1e3, "ms"] : [1e6, "µs"];
  return `${Number((seconds * factor).toPrecision(3))} ${unit}`;
}
const plain = text => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;");  // plotly reads some HTML in names
const outcome = cell => cell.status.split(":")[0].toLowerCase().replaceAll("_", " ");
const why = cell => cell.status.includes(":") ? `${outcome(cell)}: ${cell.status.slice(cell.status.indexOf(":") + 1).trim()}` : outcome(cell);
const clocked = seconds => Math.max(seconds, bench.resolution);

function fastest(row) {
  const times = Object.values(row.cells).filter(cell => cell.solved && cell.seconds !== null).map(cell => clocked(cell.seconds));
  return times.length ? Math.min(...times) : Infinity;
}
const ratio = (row, solver) => {
  const cell = row.cells[solver];
  return cell && cell.solved && cell.seconds !== null ? clocked(cell.seconds) / fastest(row) : Infinity;
};

const KINDS = {
  all: () => true,
  lost: row => !row.missing.includes(mine()) && !row.cells[mine()].solved,
  slow: row => Number.isFinite(ratio(row, mine())) && ratio(row, mine()) > 2,
  won: row => ratio(row, mine()) === 1,
  out: row => row.missing.length > 0,
};

function element(name, text, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

function sortable(row, key) {
  if (key === "problem" || key === "form") return row[key];
  if (key === "contacts" || key === "unknowns") return row[key];
  const cell = row.cells[key];
  return cell && cell.solved && cell.seconds !== null ? cell.seconds : cell ? 1e30 : 1e31;
}

function head(table, names, sort) {
  const line = element("tr");
  for (const [key, label] of names) {
    const th = element("th");
    th.scope = "col";
    if (sort) {
      const button = element("button", label);
      button.type = "button";
      button.addEventListener("click", () => { order = { key, down: order.key === key && !order.down }; drawTable(); });
      th.append(button);
      th.setAttribute("aria-sort", order.key === key ? (order.down ? "descending" : "ascending") : "none");
    } else th.textContent = label;
    line.append(th);
  }
  table.tHead.replaceChildren(line);
}

function shown() {
  const part = at("filter").value.trim().toLowerCase(), fits = KINDS[at("show").value];
  const rows = now().problems.filter(row => fits(row) && row.problem.toLowerCase().includes(part));
  const less = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
  return rows.sort((a, b) => (order.down ? -1 : 1) * less(sortable(a, order.key), sortable(b, order.key)) || less(a.problem, b.problem));
}

function drawTable() {
  const solvers = [mine(), ...bench.solvers.filter(name => name !== mine())], rows = shown();
  head(at("problems"), [["problem", "problem"], ["form", "form"], ["contacts", "contacts"], ...solvers.map(name => [name, name])], true);
  at("problems").tBodies[0].replaceChildren(...rows.map(row => {
    const tr = element("tr", undefined, row === chosen ? "chosen" : "");
    const first = element("td"), open = element("a", row.problem);
    open.href = "#one";
    open.addEventListener("click", event => { event.preventDefault(); choose(row); });
    first.append(open);
    tr.append(first, element("td", row.form), element("td", String(row.contacts)));
    for (const solver of solvers) {
      const cell = row.cells[solver];
      if (!cell) tr.append(element("td", "not measured", "absent"));
      else if (cell.solved) tr.append(element("td", time(cell.seconds), ratio(row, solver) === 1 ? "best" : ""));
      else {
        const td = element("td", outcome(cell), "unsolved");
        td.title = why(cell);
        tr.append(td);
      }
    }
    tr.addEventListener("click", () => choose(row));
    return tr;
  }));
  const all = now().problems, lost = all.filter(KINDS.lost).length, won = all.filter(KINDS.won).length, out = all.filter(KINDS.out).length;
  at("said").textContent = `${rows.length} of ${all.length} problems shown. ${mine()} is the fastest on ${won} and does not solve ${lost}` +
    (out ? `; ${out} are left out of profiles and tables, since some solver was not measured on them.` : ".");
  document.documentElement.dataset.rows = String(rows.length);
}

function layout(more) {
  const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue(name).trim(), narrow = innerWidth < 600;
  const axis = { gridcolor: of("--rule"), zerolinecolor: of("--rule"), automargin: true };
  return {
    margin: { l: 50, r: 10, t: 10, b: 45 }, paper_bgcolor: of("--paper"), plot_bgcolor: of("--paper"), font: { color: of("--ink"), size: 12 },
    hoverlabel: { bgcolor: of("--shade"), font: { color: of("--ink") } }, hovermode: "closest", showlegend: true,
    legend: narrow ? { orientation: "h", y: -0.25 } : { x: 1.01, y: 1 }, ...more, xaxis: { ...axis, ...more.xaxis }, yaxis: { ...axis, ...more.yaxis },
  };
}

function drawProfile() {
  const part = now();
  at("profile").setAttribute("role", "img");
  at("profile").setAttribute("aria-label", `Performance profiles at tolerance ${part.name}`);
  Plotly.react("profile", bench.solvers.map((solver, k) => ({
    x: part.profiles[solver].tau, y: part.profiles[solver].rho, name: plain(solver), mode: "lines", line: { ...line(k), shape: "hv", width: solver === mine() ? 4 : 2 },
    hovertemplate: `${plain(solver)}<br>within %{x:.3g} times the fastest: %{y:.0%}<extra></extra>`,
  })), layout({
    xaxis: { type: "log", title: { text: "τ, times the time of the fastest" }, range: [0, Math.log10(part.largest)] },
    yaxis: { title: { text: `share of ${part.count} problems` }, range: [0, 1.02], tickformat: ".0%" },
  }), { displayModeBar: false, responsive: true }).then(plot => {
    plot.removeAllListeners("plotly_click");
    plot.on("plotly_click", hit => { at("mine").value = bench.solvers[hit.points[0].curveNumber]; draw(); });
    document.documentElement.dataset.ready = "yes";
  });
}

function choose(row) {
  chosen = row;
  drawTable();
  drawOne();
  at("one").scrollIntoView({ block: "nearest" });
}

function drawOne() {
  const row = chosen;
  at("one").hidden = row === null;
  if (row === null) return;
  at("which").textContent = `${row.problem}, ${row.form} form, ${row.contacts} contacts, ${row.unknowns} unknowns, ${row.dimension}D`;
  at("why").textContent = row.missing.length ? `Left out of the comparison: not measured with ${row.missing.join(", ")}.` : "";
  const names = ["solver", "ended", `${bench.clock}`, "to the fastest", "iterations", "error", ...(bench.other ? [`in ${bench.other}`] : [])];
  head(at("numbers"), names.map(name => [name, name]), false);
  at("numbers").tBodies[0].replaceChildren(...bench.solvers.filter(name => row.cells[name]).map(name => {
    const cell = row.cells[name], there = row.other[name], tr = element("tr"), r = ratio(row, name);
    const texts = [name, cell.solved ? "solved" : why(cell), time(cell.seconds), Number.isFinite(r) ? r.toPrecision(3) : "–", cell.iterations ?? "–",
      cell.error === null ? "–" : cell.error.toExponential(1), ...(bench.other ? [there ? (there.solved ? time(there.seconds) : why(there)) : "not measured"] : [])];
    tr.append(...texts.map((text, k) => element("td", String(text), k === 1 && !cell.solved ? "unsolved" : "")));
    return tr;
  }));
  const curves = bench.curves[row.problem];
  at("curve").hidden = !curves;  // before it is drawn: a plot takes the width that its place has
  if (!curves) Plotly.purge("curve");
  if (curves) Plotly.react("curve", curves.map((curve, k) => ({
    x: curve.seconds, y: curve.error.map(v => v > 0 ? v : null), customdata: curve.iteration, name: plain(curve.solver), mode: "lines+markers", marker: { size: 4 },
    line: line(Math.max(0, bench.solvers.indexOf(curve.solver)) || k), hovertemplate: "%{x:.3g} s, iteration %{customdata}: %{y:.1e}<extra></extra>",
  })), layout({ xaxis: { title: { text: "time [s]" }, type: "log" }, yaxis: { title: { text: "relative error" }, type: "log", exponentformat: "power" } }), { displayModeBar: false, responsive: true });
  const picture = bench.pictures[row.problem];
  const image = element("img");
  image.src = picture ?? "";
  image.alt = `Where ${row.problem} comes from`;
  at("picture").replaceChildren(...(picture ? [image] : []));
}

function drawAgainst() {
  at("against").hidden = !bench.other;
  if (!bench.other) return;
  at("beside").textContent = `Beside ${bench.other}, tolerance ${now().name}`;
  const names = ["solver", "measured in both", "solved here", "solved there", "time here to there", "only here", "only there"];
  head(at("both"), names.map(name => [name, name]), false);
  at("both").tBodies[0].replaceChildren(...bench.solvers.map(solver => {
    const rows = now().problems.filter(row => row.cells[solver] && row.other[solver]), here = row => row.cells[solver], there = row => row.other[solver];
    const both = rows.filter(row => here(row).solved && there(row).solved && here(row).seconds !== null && there(row).seconds !== null);
    const mean = Math.exp(both.reduce((sum, row) => sum + Math.log(clocked(here(row).seconds) / clocked(there(row).seconds)), 0) / both.length);
    const only = (a, b) => rows.filter(row => a(row).solved && !b(row).solved).map(row => row.problem).join(", ") || "–";
    const tr = element("tr");
    const texts = [solver, rows.length, rows.filter(row => here(row).solved).length, rows.filter(row => there(row).solved).length,
      both.length ? `${mean.toPrecision(3)} (${both.length})` : "–", only(here, there), only(there, here)];
    tr.append(...texts.map(text => element("td", String(text))));
    return tr;
  }));
}

function draw() { drawTable(); drawProfile(); drawOne(); drawAgainst(); }

bench.tolerances.forEach((part, k) => { const option = element("option", part.name); option.value = String(k); at("tolerance").append(option); });
at("tolerance").value = String(bench.tolerances.length - 1);
at("tolerance").addEventListener("change", () => {
  const same = chosen && now().problems.find(row => row.problem === chosen.problem && row.form === chosen.form);
  chosen = same || null;
  draw();
});
for (const id of ["mine", "show"]) at(id).addEventListener("change", draw);
at("filter").addEventListener("input", drawTable);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
draw();
