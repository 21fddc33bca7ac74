"use strict";
/* Time, and what the controls do. */

function show(k) {
  now = k;
  $("instant").value = k;
  const at = row(), step = run.columns.step ? `step ${run.columns.step[at]}, ` : "";
  $("when").textContent = `${step}t = ${+time().toPrecision(6)} s`;
  if (motion) { drawSpace(); showPicked(); }
  cursors();
  fill("row", Object.entries(run.columns).map(([name, values]) => [name + (run.units[name] ? ` [${run.units[name]}]` : ""), values[at] === null ? "–" : values[at]]));
}

function goTo(t) {
  const all = motion ? motion.t : run.columns.t;
  show(all.reduce((best, value, k) => Math.abs(value - t) < Math.abs(all[best] - t) ? k : best, 0));
}

function play(on) {
  if (timer) cancelAnimationFrame(timer);
  timer = null;
  $("play").textContent = on ? "Pause" : "Play";
  $("play").setAttribute("aria-pressed", on);
  if (!on) return;
  const last = +$("instant").max, from = now >= last ? 0 : now, seconds = Math.max(2, Math.min(12, (last + 1) / 15)), begin = performance.now();
  const tick = moment => {
    const k = Math.min(last, from + Math.max(0, Math.floor((moment - begin) / 1000 * (last + 1) / seconds)));  // a frame may have begun before the click
    if (k !== now) show(k);
    if (k >= last) play(false); else timer = requestAnimationFrame(tick);
  };
  timer = requestAnimationFrame(tick);
}

// Plotly asks the button once a drawn frame: where frames are slow, a click falls between two. What lies under the pointer is kept instead.
function bindPick() {
  const view = $("view");
  let under = null, pressed = null;
  view.on("plotly_hover", event => { under = event.points[0]; });
  view.on("plotly_unhover", () => { under = null; });
  view.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; }, true);
  view.addEventListener("pointerup", event => {
    if (under && pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) picked(under);
    pressed = null;
  }, true);
}

function picked(point) {
  if (point.curveNumber < 2) pick = { vertex: point.pointNumber };
  else if (point.curveNumber === 3) { const c = place[point.pointNumber]; pick = { contact: c, identity: contacts.identity && contacts.identity[c], slave: contacts.slave && contacts.slave[c], master: contacts.master && contacts.master[c] }; }
  else return;
  showPicked();
}

async function begin() {
  for (const id of ["facts", "parameters", "versions"]) fill(id, Object.entries(run[id]));
  if (run.motion) {
    motion = await unpack(run.motion);
    contacts = run.motion.contacts ? await unpack(run.motion.contacts) : null;
    joints = run.motion.joints ? await unpack(run.motion.joints) : null;
    if (!joints || motion.most.opening <= 1e-9 * Math.max(...run.high.map((h, i) => h - run.low[i]))) $("joints").closest("label").hidden = true;
    const choices = [["stress", "von Mises stress"], ["displacement", "displacement"], ["speed", "speed"], ["body", "body"], ["status", "status"], ["plain", "none"]];
    for (const [value, word] of choices) if ((value !== "stress" || motion.stress) && (value !== "status" || (contacts && contacts.slave))) $("colour").add(new Option(word, value));
    $("scale").value = scale;
    for (const number of [...new Set(motion.body)].sort((a, b) => a - b)) {
      const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", checked: !hidden.has(number) });
      box.addEventListener("change", () => { box.checked ? hidden.delete(number) : hidden.add(number); parts = []; drawSpace(); });
      label.append(box, ` ${bodyName(number)}`);
      $("bodies").append(label);
    }
    if (!contacts) for (const id of ["contacts", "forces"]) $(id).closest("label").hidden = true;
    if (run.motion.left_out) fill("facts", [...Object.entries(run.facts), ["instants", `${motion.t.length} shown, ${run.motion.left_out} left out to keep the page small`]]);
  } else $("space").querySelectorAll("#view, .controls, #hide, #picked, #legend").forEach(part => { part.hidden = true; });
  const count = motion ? motion.t.length : (run.columns.t || []).length;
  $("instant").max = Math.max(0, count - 1);
  if (count) show(count - 1);
  await new Promise(shown => requestAnimationFrame(() => setTimeout(shown)));  // the bodies are seen before the curves are drawn
  performance.mark("first picture");
  $("view").style.backgroundImage = "";  // the still picture has done its service
  drawCurves();

  if (motion) {
    bindPick();
    for (const id of ["colour", "contacts", "forces", "joints", "edges", "through", "cut"]) $(id).addEventListener("change", () => { $("where").hidden = $("cut").value === ""; drawSpace(); });
    $("where").addEventListener("input", drawSpace);
    $("scale").addEventListener("change", () => { const given = +$("scale").value; if (given >= 0 && isFinite(given)) { scale = given; drawSpace(); } });
    $("reset").addEventListener("click", () => { Plotly.purge($("view")); drawSpace(); bindPick(); });
    $("save").addEventListener("click", () => Plotly.downloadImage($("view"), { format: "png", width: 1600, height: 1000, filename: run.title.replace(/\W+/g, "_") }));
  }
  $("instant").addEventListener("input", () => { play(false); show(+$("instant").value); });
  $("play").addEventListener("click", () => play(!timer));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (motion) drawSpace(); drawCurves(); showPicked(); });
  addEventListener("resize", () => requestAnimationFrame(cursors));
  document.documentElement.dataset.ready = "yes";
}

begin();
