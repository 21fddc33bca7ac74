"use strict";
/* The bodies, contacts and forces of an instant, drawn. */

let motion = null, contacts = null, joints = null, now = 0, timer = null, scale = run.exaggeration, hidden = new Set(run.left_out), pick = null, place = null;

function ink() {
  const style = getComputedStyle(document.documentElement);
  return { ink: style.getPropertyValue("--ink").trim(), paper: style.getPropertyValue("--paper").trim(), rule: style.getPropertyValue("--rule").trim(), shade: style.getPropertyValue("--shade").trim() };
}

function cut() {  // [axis, coordinate], what lies beyond is not shown
  const axis = $("cut").value;
  return axis === "" ? null : [+axis, run.low[axis] + $("where").value * (run.high[axis] - run.low[axis])];
}

function positions(k) {  // (3 arrays) of all vertices at instant k, cut where asked
  const n = motion.vertices.values.length / 3, xyz = [new Float32Array(n), new Float32Array(n), new Float32Array(n)], base = k * 3 * n;
  for (let v = 0; v < n; v++)
    for (let i = 0; i < 3; i++) xyz[i][v] = motion.low[i] + motion.vertices.at(3 * v + i) + scale * motion.displacement.at(base + 3 * v + i);
  const plane = cut();
  if (plane)  // what lies beyond is laid into the plane: the rest looks sawn through
    for (let along = xyz[plane[0]], v = 0; v < n; v++) if (along[v] > plane[1]) along[v] = plane[1];
  return xyz;
}

function triangles(stressed, beyond) {  // the shown ones of the bodies that have a stress, or of the others
  const keep = [[], [], []], cells = [];
  for (let t = 0; t < motion.triangle.length / 3; t++) {
    const body = motion.body[motion.triangle[3 * t]];
    if (hidden.has(body) || beyond.has(body) || (motion.cell[t] >= 0) !== stressed) continue;
    for (let i = 0; i < 3; i++) keep[i].push(motion.triangle[3 * t + i]);
    cells.push(t);
  }
  return { keep, cells };
}
let parts = [];  // the two of them: deformable bodies and rigid ones

function choose(beyond) { parts = [triangles(true, beyond), triangles(false, beyond)]; }

function bodiesBeyond(xyz) {  // those that a cut leaves nothing of
  const plane = cut(), beyond = new Set();
  if (!plane) return beyond;
  for (const body of motion.body) beyond.add(body);
  for (let v = 0; v < motion.body.length; v++) if (xyz[plane[0]][v] < plane[1]) beyond.delete(motion.body[v]);
  return beyond;
}

function bodyStatus(k) {  // 2 where any contact of the body slides, 1 where one sticks, else 0
  const of = new Map();
  if (contacts && contacts.slave)
    for (let c = contacts.first[k]; c < contacts.first[k + 1]; c++)
      for (const body of [contacts.slave[c], contacts.master[c]]) of.set(body, Math.max(of.get(body) || 0, contacts.status[c]));
  return of;
}

function bar(title, unit, most) {
  const [factor, name] = (PREFIX[unit] || [[1, unit]]).find(([f]) => most >= f) || [1, unit];
  return { factor, colorbar: { title: { text: `${title} [${name}]`, side: "right" }, thickness: 14, len: .8, tickfont: { color: ink().ink } } };
}

function colours(k, { cells }, first) {  // what the trace of a mesh takes for its colours
  const by = $("colour").value, n = motion.body.length, plain = { showscale: false };
  if (by === "stress") {
    if (!first) return { ...plain, color: GREY };
    const m = motion.stress.row, { factor, colorbar } = bar("von Mises stress", "Pa", run.stress);
    const intensity = cells.map(t => motion.stress.at(k * m + motion.cell[t]) / factor);
    return { ...plain, intensity, intensitymode: "cell", cmin: 0, cmax: run.stress / factor, colorscale: STRESS, showscale: true, colorbar };
  }
  if (by === "displacement" || by === "speed") {
    const intensity = new Float32Array(n), most = by === "speed" ? motion.most.speed : motion.most.displacement;
    const { factor, colorbar } = bar(by, by === "speed" ? "m/s" : "m", most);
    for (let v = 0; v < n; v++) intensity[v] = (by === "speed" ? motion.speed.at(k * n + v) : moved(k, v)) / factor;
    return { ...plain, intensity, intensitymode: "vertex", cmin: 0, cmax: most / factor || 1, colorscale: SMOOTH, showscale: first || !parts[0].cells.length, colorbar };
  }
  if (by === "plain") return { ...plain, color: first ? STONE : GREY };
  const of = by === "status" ? bodyStatus(k) : null, palette = by === "status" ? STATUS_COLOUR : PALETTE;
  const colorscale = palette.flatMap((colour, n) => [[n / palette.length, colour], [(n + 1) / palette.length, colour]]);
  const intensity = cells.map(t => { const body = motion.body[motion.triangle[3 * t]]; return of ? of.get(body) || 0 : body % palette.length; });
  return { ...plain, intensity, intensitymode: "cell", cmin: -0.5, cmax: palette.length - 0.5, colorscale };
}

function key(entries) {
  for (const [word, colour] of entries) {
    const dot = document.createElement("span");
    dot.className = "dot"; dot.style.background = colour;
    $("legend").append(dot, word);
  }
}

function moved(k, v) {
  const base = 3 * (k * motion.body.length + v), d = motion.displacement;
  return Math.hypot(d.at(base), d.at(base + 1), d.at(base + 2));
}

function lines(xyz, beyond) {
  const found = [[], [], []];
  if ($("edges").checked)
    for (let l = 0; l < motion.line.length / 2; l++) {
      const a = motion.line[2 * l], b = motion.line[2 * l + 1];
      if (hidden.has(motion.body[a]) || beyond.has(motion.body[a])) continue;
      for (let i = 0; i < 3; i++) found[i].push(xyz[i][a], xyz[i][b], null);
    }
  return found;
}

function contactPlace(c, i) {
  return motion.low[i] + contacts.point.at(3 * c + i) + (scale - 1) * (contacts.displacement ? contacts.displacement.at(3 * c + i) : 0);
}

function contactTraces(k) {  // points by status, and arrows on the slave bodies: shaft and two strokes of a head
  const dots = { x: [], y: [], z: [], number: [], colour: [] }, arrows = { x: [], y: [], z: [], colour: [] };
  if (!contacts) return { dots, arrows };
  const size = Math.hypot(...run.high.map((h, i) => h - run.low[i])), unit = 0.14 * size / (motion.most.reaction || 1);
  const plane = cut(), aside = [0.3, -1, 0.25];  // heads lie in the plane across the usual direction of view
  for (let c = contacts.first[k]; c < contacts.first[k + 1]; c++) {
    const p = [0, 1, 2].map(i => contactPlace(c, i)), s = contacts.status[c];
    if (plane && p[plane[0]] > plane[1]) continue;
    if ($("contacts").checked) {
      ["x", "y", "z"].forEach((name, i) => dots[name].push(p[i]));
      dots.number.push(c); dots.colour.push(STATUS_COLOUR[s]);
    }
    if ($("forces").checked && s > 0) {
      const f = [0, 1, 2].map(i => unit * contacts.reaction.at(3 * c + i)), length = Math.hypot(...f);
      if (length < 2e-3 * size) continue;
      let across = [f[1] * aside[2] - f[2] * aside[1], f[2] * aside[0] - f[0] * aside[2], f[0] * aside[1] - f[1] * aside[0]];
      const norm = Math.hypot(...across) || 1, head = Math.min(0.3 * length, 0.02 * size);
      across = across.map(a => a / norm * head * 0.5);
      const tip = p.map((q, i) => q + f[i]), back = tip.map((q, i) => q - f[i] / length * head);
      for (const point of [p, tip, back.map((q, i) => q + across[i]), tip, back.map((q, i) => q - across[i]), null])
        ["x", "y", "z"].forEach((name, i) => arrows[name].push(point ? point[i] : null));
      arrows.colour.push(...Array(6).fill(STATUS_COLOUR[s]));
    }
  }
  return { dots, arrows };
}

function jointTrace(k, xyz) {  // facets by their opening: triangles in space, lines in the plane
  const none = { type: "mesh3d", name: "joints", x: [], y: [], z: [], i: [], j: [], k: [] };
  if (!joints || !$("joints").checked) return none;
  const corners = joints.vertex.length / (joints.opening.row), n = joints.opening.row, found = [[], [], []], open = [];
  const { factor, colorbar } = bar("opening of joints", "m", motion.most.opening), shade = { cmin: 0, cmax: motion.most.opening / factor, colorscale: run.cracks };
  for (let f = 0; f < n; f++) {
    const opening = joints.opening.at(k * n + f), own = joints.vertex.subarray(corners * f, corners * (f + 1));
    if (opening < 1e-3 * motion.most.opening || hidden.has(motion.body[own[0]])) continue;
    for (let c = 0; c < corners; c++) {
      for (let i = 0; i < 3; i++)
        found[i].push(own.reduce((sum, v, m) => sum + joints.weight.at(corners * (corners * f + c) + m) * xyz[i][v], 0));
      if (corners === 2) open.push(opening / factor);
    }
    if (corners === 2) { found.forEach(axis => axis.push(null)); open.push(opening / factor); } else open.push(opening / factor);
  }
  const [x, y, z] = found, every = [...open.keys()].map(f => 3 * f);
  if (corners === 2) return { type: "scatter3d", mode: "lines", name: "joints", x, y, z, line: { color: open, width: 7, colorbar, showscale: true, ...shade }, hoverinfo: "skip" };
  return { ...none, x, y, z, i: every, j: every.map(f => f + 1), k: every.map(f => f + 2), intensity: open, intensitymode: "cell", colorbar: { ...colorbar, x: 0, xanchor: "left" }, ...shade,
    hoverinfo: "skip", flatshading: true, lighting: { ambient: 1, diffuse: 0, specular: 0, fresnel: 0 } };
}

function gravityTrace(k) {  // an arrow beside the bodies, as long as a tenth of them
  const g = motion.gravity && motion.gravity[k], none = { type: "scatter3d", mode: "lines", name: "gravity", x: [], y: [], z: [] };
  if (!g) return none;
  const size = Math.max(...run.high.map((h, i) => h - run.low[i])), length = 0.1 * size / Math.hypot(...g), tail = run.planar ? [run.low[0], run.high[1], 0] : [run.low[0], run.low[1], run.high[2]];
  const tip = tail.map((q, i) => q + length * g[i]), aside = run.planar ? [-g[1], g[0], 0] : Math.hypot(g[0], g[1]) > .9 * Math.hypot(...g) ? [0, 0, 1] : [1, 0, 0], wide = 0.02 * size / Math.hypot(...aside);
  const strokes = [1, -1].map(side => tip.map((q, i) => q - 0.3 * length * g[i] + side * wide * aside[i]));
  const path = [tail, tip, strokes[0], tip, strokes[1]];
  return { ...none, x: path.map(p => p[0]), y: path.map(p => p[1]), z: path.map(p => p[2]), line: { color: ink().ink, width: 4 }, hoverinfo: "skip" };
}

function gravityWord({ x, y, z }) {  // at the arrow's tail; not as the trace's text, whose letters WebGL would make one by one
  return x.length ? [{ x: x[0], y: y[0], z: z[0], text: "g", showarrow: false, yanchor: "bottom", font: { color: ink().ink, size: 13 } }] : [];
}

// What has nothing to show is not drawn at all: no program of the graphics card is compiled for it before the first picture.
const seen = trace => ({ ...trace, visible: trace.x.length > 0 && (trace.i || trace.x).length > 0 });

// The nearest eye that sees a whole box about the origin, from a direction. half: the box's half extents; plotly's camera opens 45 degrees
// from top to bottom. A point c at the depth D - c.e is seen where |c.up| and |c.right| are at most that depth times the tangents.
const OPENS = Math.tan(Math.PI / 8) * .94, SCALE_BESIDE = 90;  // px that the scale of colours takes

function seenWhole(toward, upward, half, view) {
  const dot = (a, b) => a.reduce((sum, q, i) => sum + q * b[i], 0), unit = a => a.map(q => q / Math.hypot(...a));
  const e = unit(toward), up = unit(upward.map((q, i) => q - dot(upward, e) * e[i])), right = [1, 2, 0].map((j, i) => up[j] * e[3 - i - j] - up[3 - i - j] * e[j]);
  const high = OPENS, wide = OPENS * Math.max(view.clientWidth - SCALE_BESIDE, 50) / Math.max(view.clientHeight, 50);
  const corners = [...Array(8).keys()].map(k => half.map((h, i) => k >> i & 1 ? h : -h));
  const far = Math.max(...corners.map(c => dot(c, e) + Math.max(Math.abs(dot(c, up)) / high, Math.abs(dot(c, right)) / wide)));
  return { x: far * e[0], y: far * e[1], z: far * e[2] };
}

function drawSpace() {
  const xyz = positions(now), beyond = bodiesBeyond(xyz), edge = lines(xyz, beyond), { dots, arrows } = contactTraces(now), c = ink();
  if (beyond.size || !parts.length || parts.cut) choose(beyond);
  parts.cut = beyond.size > 0;
  const extent = run.high.map((h, i) => h - run.low[i]), most = Math.max(...extent);
  // invisible by parts: of an axis that is not `visible` plotly still makes all tick labels, letter by letter
  const axis = i => ({ showgrid: false, zeroline: false, showline: false, showticklabels: false, showspikes: false, showbackground: false, ticks: "", tickmode: "array", tickvals: [], title: { text: "" }, range: [run.low[i] - 0.04 * most, run.high[i] + 0.04 * most], autorange: false });
  const toward = run.planar ? [0, 0, 1] : extent[0] >= extent[1] ? [.3, -1.15, .28] : [1.15, .3, .28], upward = run.planar ? [0, 1, 0] : [0, 0, 1];
  const eye = seenWhole(toward, upward, extent.map(e => (e / most + .02) * 1.05 / 2), $("view"));
  const ratio = extent.map(e => (e + 0.08 * most) / most * 1.05), opacity = $("through").checked ? 0.4 : 1;
  const mesh = parts.map((part, n) => ({ type: "mesh3d", name: n ? "rigid" : "deformable", x: xyz[0], y: xyz[1], z: xyz[2], i: part.keep[0], j: part.keep[1], k: part.keep[2],
    opacity, flatshading: true, hoverinfo: "none", lighting: { ambient: 1, diffuse: .15, specular: 0, fresnel: 0 }, lightposition: { x: -2e4, y: -1e5, z: 6e4 }, ...colours(now, part, n === 0) }));
  const gravity = gravityTrace(now);
  Plotly.react($("view"), [...mesh,
    { type: "scatter3d", mode: "lines", name: "edges", x: edge[0], y: edge[1], z: edge[2], line: { color: c.ink, width: 1.5 }, hoverinfo: "skip" },
    { type: "scatter3d", mode: "markers", name: "contacts", x: dots.x, y: dots.y, z: dots.z, marker: { size: 3.5, color: dots.colour }, hoverinfo: "none" },
    { type: "scatter3d", mode: "lines", name: "forces", x: arrows.x, y: arrows.y, z: arrows.z, line: { color: arrows.colour, width: 3 }, hoverinfo: "skip" },
    jointTrace(now, xyz), gravity,
  ].map(seen), {
    margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: c.shade, uirevision: "kept", showlegend: false, font: { color: c.ink },
    scene: { xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual", aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] }, bgcolor: c.shade, uirevision: "kept", annotations: gravityWord(gravity),
      camera: { eye, up: { x: upward[0], y: upward[1], z: upward[2] } } },
  }, { displayModeBar: false, responsive: true, scrollZoom: true });
  place = dots.number;
  drawLegend();
}

function drawLegend() {
  $("legend").textContent = "";
  if ($("colour").value === "status") key([["no closed contact", STATUS_COLOUR[0]], ["its closed contacts stick", STATUS_COLOUR[1]], ["a contact slips", STATUS_COLOUR[2]]]);
  else if (contacts && ($("forces").checked || $("contacts").checked)) key(STATUS.map((word, s) => [word, STATUS_COLOUR[s]]));
  if (contacts && $("forces").checked) $("legend").append(` · longest arrow of the run: ${shown(motion.most.reaction, "N")}`);
}
