"use strict";
/* Curves of several runs over each other: a colour for each run, a dash for each curve of it. */

const all = JSON.parse(document.getElementById("content").textContent);
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999", "#b8a900"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];

function drawAll() {
  const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue(name).trim();
  for (const graph of all.graphs) {
    if (!graph.box) {
      graph.box = document.createElement("div");
      graph.box.className = "graph";
      graph.box.append(document.createElement("h3"), document.createElement("div"));
      graph.box.firstChild.textContent = graph.title + (graph.unit ? ` [${graph.unit}]` : "");
      document.getElementById("curves").append(graph.box);
    }
    const plot = graph.box.lastChild, kinds = [...new Set(graph.curves.map(curve => curve.label))];
    plot.className = "plot";
    plot.style.height = `${14 + 1.2 * Math.ceil(graph.curves.length / 2)}rem`;
    plot.setAttribute("role", "img");
    plot.setAttribute("aria-label", `${graph.title} against ${graph.x.title}`);
    Plotly.react(plot, graph.curves.map(curve => ({
      x: curve.x, y: graph.logarithmic ? curve.y.map(v => v > 0 ? v : null) : curve.y, connectgaps: true, mode: curve.x.length < 3 ? "markers" : "lines",
      name: kinds.length > 1 ? `${all.names[curve.run]}: ${curve.label}` : all.names[curve.run],
      line: { color: COLOURS[curve.run % COLOURS.length], dash: DASHES[kinds.indexOf(curve.label) % DASHES.length], width: 1.6 },
    })), {
      margin: { l: 60, r: 8, t: 6, b: 40 }, paper_bgcolor: of("--paper"), plot_bgcolor: of("--paper"), font: { color: of("--ink"), size: 11 }, hoverlabel: { bgcolor: of("--shade") },
      showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
      xaxis: { title: { text: `${graph.x.title}${graph.x.unit ? ` [${graph.x.unit}]` : ""}`, standoff: 4 }, gridcolor: of("--rule"), zerolinecolor: of("--rule") },
      yaxis: { type: graph.logarithmic ? "log" : "linear", gridcolor: of("--rule"), zerolinecolor: of("--rule"), exponentformat: "e" },
    }, { displayModeBar: false, responsive: true });
  }
  document.documentElement.dataset.ready = "yes";
}

drawAll();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
