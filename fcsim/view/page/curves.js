"use strict";
/* The curves, and the numbers of what was picked. */

const graphs = [], LINE = 36;

function inLines(text) {  // of at most LINE characters or so, between words
  const lines = [""];
  for (const word of text.split(" ")) if (lines.at(-1).length + word.length > LINE) lines.push(word); else lines[lines.length - 1] += ` ${word}`;
  return lines.join("<br>").trim();
}

function drawCurves() {
  const c = ink();
  for (const graph of run.graphs) {
    let box = graph.box;
    if (!box) {
      box = graph.box = document.createElement("div");
      box.className = "graph";
      box.innerHTML = '<h3></h3><div class="plot"></div><div class="cursor"></div>';
      box.querySelector("h3").textContent = graph.title + (graph.unit ? ` [${graph.unit}]` : "");
      $("curves").append(box);
      graphs.push(graph);
    }
    const plot = box.querySelector(".plot");
    plot.style.height = `${11 + 1.2 * Math.ceil(graph.curves.length / 3)}rem`;
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", `${graph.title} against ${graph.x.title}`);
    Plotly.react(plot, graph.curves.map((curve, n) => ({
      x: graph.x.values, y: graph.logarithmic ? curve.values.map(v => v > 0 ? v : null) : curve.values, name: curve.label, connectgaps: true, mode: graph.x.values.length < 3 ? "markers" : "lines",
      line: { color: PALETTE[n % PALETTE.length], width: 1.6, dash: n < PALETTE.length ? "solid" : "dot" },
    })), {
      margin: { l: 55, r: 8, t: 6, b: graph.x.title.length > LINE ? 50 : 36 }, paper_bgcolor: c.paper, plot_bgcolor: c.paper, font: { color: c.ink, size: 11 }, hovermode: "x unified", hoverlabel: { bgcolor: c.shade },
      showlegend: graph.curves.length > 1, legend: { orientation: "h", y: 1.02, yanchor: "bottom", font: { size: 10 } },
      xaxis: { title: { text: inLines(`${graph.x.title}${graph.x.unit ? ` [${graph.x.unit}]` : ""}`), standoff: 4 }, gridcolor: c.rule, zerolinecolor: c.rule },
      yaxis: { type: graph.logarithmic ? "log" : "linear", gridcolor: c.rule, zerolinecolor: c.rule, exponentformat: "e" },
    }, { displayModeBar: false, responsive: true });
    plot.removeAllListeners("plotly_click");
    plot.on("plotly_click", event => goTo(run.columns.t[event.points[0].pointIndex]));
    plot.removeAllListeners("plotly_relayout");
    plot.on("plotly_relayout", cursors);
  }
  cursors();
}

function time() { return motion ? motion.t[now] : run.columns.t[now]; }

function row() {  // of the table, nearest to the instant
  const t = time(), all = run.columns.t || [];
  let best = 0;
  for (let k = 1; k < all.length; k++) if (Math.abs(all[k] - t) < Math.abs(all[best] - t)) best = k;
  return best;
}

function cursors() {
  const at = row();
  for (const graph of graphs) {
    const plot = graph.box.querySelector(".plot"), line = graph.box.querySelector(".cursor"), layout = plot._fullLayout;
    if (!layout || !layout.xaxis) continue;
    const x = layout.xaxis.d2p(graph.x.values[at]), inside = x >= 0 && x <= layout._size.w;
    Object.assign(line.style, { display: inside ? "block" : "none", left: `${plot.offsetLeft + layout._size.l + x - 1}px`, top: `${plot.offsetTop + layout._size.t}px`, height: `${layout._size.h}px` });
  }
}

function fill(id, entries) {
  const body = $(id).tBodies[0];
  body.replaceChildren(...entries.map(([name, value]) => {
    const line = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
    head.scope = "row"; head.textContent = name; cell.textContent = value;
    line.append(head, cell);
    return line;
  }));
}

function bodyName(number) { return run.bodies[number] || `body ${number}`; }

function showPicked() {
  if (!pick) return;
  const k = now, n = motion.body.length, entries = [];
  let values = [], title = "";
  if (pick.vertex !== undefined) {
    const v = pick.vertex, body = motion.body[v], d = i => motion.displacement.at(3 * (k * n + v) + i);
    $("what").textContent = `Body ${bodyName(body)}, at the picked point`;
    entries.push(["displacement", shown(moved(k, v), "m")], ["along x, y, z", shownAll([0, 1, 2].map(d), "m")], ["speed", shown(motion.speed.at(k * n + v), "m/s")]);
    const cell = motion.stress ? stressCell(v) : -1;
    if (cell >= 0) entries.push(["von Mises stress", shown(motion.stress.at(k * motion.stress.row + cell), "Pa")]);
    if (contacts && contacts.slave) {
      const sum = [0, 0, 0]; let closed = 0;
      for (let c = contacts.first[k]; c < contacts.first[k + 1]; c++) {
        const sign = (contacts.slave[c] === body) - (contacts.master[c] === body);
        if (sign && contacts.status[c] > 0) closed++;
        for (let i = 0; i < 3; i++) sum[i] += sign * contacts.reaction.at(3 * c + i);
      }
      entries.push(["closed contacts", closed], ["contact force on it, x, y, z", shownAll(sum, "N")]);
    }
    title = "displacement [m]";
    values = motion.t.map((_, j) => moved(j, v));
  } else {
    let c = null;
    for (let j = contacts.first[k]; j < contacts.first[k + 1]; j++) if (contacts.identity ? contacts.identity[j] === pick.identity : j === pick.contact) c = j;
    $("what").textContent = contacts.slave ? `Contact of ${bodyName(pick.slave)} on ${bodyName(pick.master)}` : "Contact";
    if (c === null) entries.push(["at this instant", "no such contact"]);
    else for (const [name, label, unit] of [["reaction_normal", "normal force", "N"], ["reaction_tangential", "tangential force", "N"], ["gap", "gap", "m"], ["sliding_velocity", "sliding velocity", "m/s"], ["mu", "friction coefficient", ""]])
      if (contacts[name]) entries.push([label, shown(contacts[name].at(c), unit)]);
    if (c !== null) entries.unshift(["status", STATUS[contacts.status[c]]]);
    title = "normal force [N]";
    if (contacts.identity) {
      const of = new Map();
      for (let j = 0; j + 1 < contacts.first.length; j++) for (let i = contacts.first[j]; i < contacts.first[j + 1]; i++) if (contacts.identity[i] === pick.identity) of.set(j, contacts.reaction_normal.at(i));
      values = motion.t.map((_, j) => of.has(j) ? of.get(j) : null);
    }
  }
  fill("numbers", entries);
  const c = ink();
  Plotly.react($("history"), [{ x: motion.t, y: values, mode: "lines+markers", marker: { size: 3, color: PALETTE[0] }, line: { color: PALETTE[0] } }, { x: [motion.t[k]], y: [values[k]], mode: "markers", marker: { size: 9, color: PALETTE[3] } }], {
    margin: { l: 55, r: 8, t: 6, b: 36 }, showlegend: false, paper_bgcolor: c.paper, plot_bgcolor: c.paper, font: { color: c.ink, size: 11 },
    xaxis: { title: { text: "time [s]", standoff: 4 }, gridcolor: c.rule, zerolinecolor: c.rule }, yaxis: { title: { text: title }, gridcolor: c.rule, zerolinecolor: c.rule, exponentformat: "e" } }, { displayModeBar: false, responsive: true });
  $("history").setAttribute("role", "img");
  $("history").setAttribute("aria-label", `${title} over time`);
}

function stressCell(v) {
  for (let t = 0; t < motion.triangle.length / 3; t++)
    if (motion.triangle[3 * t] === v || motion.triangle[3 * t + 1] === v || motion.triangle[3 * t + 2] === v) return motion.cell[t];
  return -1;
}
