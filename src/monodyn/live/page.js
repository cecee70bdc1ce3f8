// Fetches what is known twice a second and writes it into the page; texts are set as texts, never as markup.
"use strict";
const at = (id) => document.getElementById(id);
const minus = (text) => String(text).replace("-", "\u2212");
const phases = { searching: "looking for the mechanism" };
const shown = { rad: [180 / Math.PI, "deg"], m: [1000, "mm"] };

// A value with half its interval: two digits of that, and the value down to there.
function interval(value, half) {
  if (half === null || half === 0) return minus(Number(value.toPrecision(5))) + " \u00b1 " + (half ?? "?");
  const decimals = 1 - Math.floor(Math.log10(half));
  if (decimals < 0 || decimals > 7) return minus(value.toPrecision(3)) + " \u00b1 " + minus(half.toPrecision(2));
  return minus(value.toFixed(decimals)) + " \u00b1 " + half.toFixed(decimals);
}

function fill(table, rows) {
  const made = rows.map((cells) => {
    const row = document.createElement("tr");
    for (const [text, kind] of cells) {
      const cell = row.insertCell();
      if (kind) cell.className = kind;
      if (kind === "bar" && text !== null) {
        const bar = document.createElement("meter");
        bar.value = text;
        cell.append(bar);
      } else cell.textContent = text ?? "";
    }
    return row;
  });
  at(table).tBodies[0].replaceChildren(...made);
}

const facts = (state, step) => {
  const one = (s) => (s < 0.9995 ? [1000 * s, "ms"] : [s, "s"]);
  const ms = (pair) => {
    const [[low, unit], [high, other]] = pair.map(one);
    const short = (x) => Number(x.toPrecision(3));
    return short(low) + (unit === other ? "" : " " + unit) + "/" + short(high) + " " + other;
  };
  const parts = [step.time.toFixed(2) + " s"];
  if (state.rate) parts.push(state.rate.toFixed(1) + " frames/s");
  if (state.pose_latency) parts.push("pose " + ms(state.pose_latency));
  if (state.fit_latency) parts.push("fit " + ms(state.fit_latency) + " (median/99 %)");
  return [...parts, step.skipped + " skipped"].join("   \u00b7   ");
};

const joint = (state, step, name) => {
  const [scale, unit] = shown[state.units[name]] ?? [1, ""];
  const short = (x) => (x === null || x === undefined ? "\u2013" : minus(Number((x * scale).toPrecision(2))));
  const value = step.pose[name];
  const where = value === null ? "not seen" : minus((value * scale).toFixed(2));
  return [[name], [where], [short(step.std[name])], [short(step.error?.[name])], [unit, "unit"]];
};

const parameter = ([full, row]) => {
  const name = full.replace(".", ".\u200b");
  if (row.std === null) return [[name], ["not determined", "open"], [row.unit, "unit"], [""], [null, "bar"]];
  const half = row.upper === null || row.lower === null ? null : (row.upper - row.lower) / 2;
  // an angle may be about zero
  const share = half === null || !row.value || row.unit === "rad" ? null : half / Math.abs(row.value);
  const text = interval(row.value, half);
  // by the logarithm: full at 100 %, empty at 0.1 %
  const bar = share === null ? null : Math.min(Math.max((Math.log10(share) + 3) / 3, 0), 1);
  const percent = share === null ? "" : share < 9.995 ? Number((100 * share).toPrecision(share < 1 ? 2 : 3)) : "> 999";
  return [[name], [text], [row.unit, "unit"], [percent], [bar, "bar"]];
};

function show(state) {
  const step = state.step;
  at("name").textContent = document.title = state.name;
  at("ahead").textContent = "in " + state.ahead + " s";
  at("off").textContent = "off after " + state.ahead + " s";
  if (!step) { at("phase").textContent = "opening"; return; }
  at("phase").textContent = phases[step.phase] ?? step.phase;
  at("facts").textContent = facts(state, step);
  at("verdict").hidden = !step.said && !step.verdict;
  at("verdict").className = step.verdict ?? "";
  at("grade").textContent = step.verdict ? step.verdict[0].toUpperCase() + step.verdict.slice(1) + "." : "";
  at("said").textContent = step.verdict ? step.said.replace(/^Approximate\. /, "") : step.said;
  const enough = document.createElement("b");
  enough.className = step.enough_motion ? "yes" : "no";
  enough.textContent = step.enough_motion ? "yes" : "not yet";
  const lacking = state.hardly_known.length ? ": " + state.hardly_known.join(", ") : "";
  at("enough").replaceChildren(...(step.enough_motion === null ? [] : ["Enough motion? ", enough, lacking]));
  at("joints").hidden = !step.pose;
  at("parameters").hidden = !Object.keys(step.parameters).length;
  fill("joints", Object.keys(step.pose ?? {}).map((name) => joint(state, step, name)));
  const rows = Object.entries(step.parameters);
  const known = (row) => row[1].std !== null;
  fill("parameters", [...rows.filter(known), ...rows.filter((row) => !known(row))].map(parameter));
}

let lost = true;
async function again() {
  try {
    const answer = await fetch("state", { signal: AbortSignal.timeout(3000) });
    show(await answer.json());
    // a film that has broken off does not begin again by itself
    if (lost) at("film").src = "film?" + Date.now();
    at("film").hidden = false;
    lost = false;
  } catch {
    at("phase").textContent = "the stream has ended, or cannot be reached";
    lost = true;
  }
  setTimeout(again, 500);
}
again();
