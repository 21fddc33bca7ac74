"use strict";
/* The page of a run: plotly draws, these scripts move. Everything comes from the JSON within the page; nothing is loaded.
   This one: colours, numbers with units. */

const $ = id => document.getElementById(id);
const PALETTE = ["#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#f0e442", "#999999"];
const STATUS = ["open", "stick", "slip"], STATUS_COLOUR = ["#a6a6a6", "#0072b2", "#d55e00"];
const STONE = "#d9cfbf", GREY = "#b9bcbf", STRESS = run.colours, SMOOTH = "Viridis";
const PREFIX = { Pa: [[1e9, "GPa"], [1e6, "MPa"], [1e3, "kPa"], [1, "Pa"]],
  N: [[1e9, "GN"], [1e6, "MN"], [1e3, "kN"], [1, "N"], [1e-3, "mN"], [1e-6, "µN"], [1e-9, "nN"]],
  m: [[1, "m"], [1e-3, "mm"], [1e-6, "µm"], [1e-9, "nm"]], "m/s": [[1, "m/s"], [1e-3, "mm/s"], [1e-6, "µm/s"]] };

function shown(value, unit) {
  if (value === null || value === undefined) return "–";
  if (typeof value !== "number") return String(value);
  const choices = PREFIX[unit];
  if (!choices || value === 0) return `${+value.toPrecision(4)} ${unit}`.trim();
  const [factor, name] = choices.find(([f]) => Math.abs(value) >= f) || choices[choices.length - 1];
  return `${+(value / factor).toPrecision(4)} ${name}`;
}

function shownAll(values, unit) {  // of a vector, to four digits of its largest
  const most = Math.max(...values.map(Math.abs)), choices = PREFIX[unit] || [[1, unit]];
  const [factor, name] = choices.find(([f]) => most >= f) || choices[choices.length - 1];
  const step = most > 0 ? 10 ** (Math.floor(Math.log10(most / factor)) - 3) : 1;
  return `${values.map(v => +(Math.round(v / factor / step) * step).toPrecision(4)).join(", ")} ${name}`;
}
