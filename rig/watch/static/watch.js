// The live page: listens to the server's news and shows them. Text is set as text, never as HTML.
import { draw } from "./chart.js";

const name = document.body.dataset.name;
const at = (id) => document.getElementById(id);
const seen = { state: null, news: 0, stateAt: 0, view: {} };
const LOST_AFTER_MS = 9000;

// --- words and numbers ---------------------------------------------------------------------------------------

const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const minus = (text) => text.replace(/^-/, "\u2212");

function duration(seconds) {
  if (!isNumber(seconds)) return "\u2013";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 90) return `${minutes} min`;
  if (minutes < 2880) return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
  return `${Math.floor(minutes / 1440)} d ${Math.floor((minutes % 1440) / 60)} h`;
}

const two = (value) => String(value).padStart(2, "0");

function local(utc, day = true) {
  const date = new Date(utc * 1000);
  const time = `${two(date.getHours())}:${two(date.getMinutes())}`;
  const days = date.toLocaleDateString(undefined, { weekday: "short", day: "numeric", month: "short" });
  return day ? `${days}, ${time}` : time;
}

function inUtc(utc) {
  const date = new Date(utc * 1000);
  return `${date.toISOString().slice(0, 10)} ${two(date.getUTCHours())}:${two(date.getUTCMinutes())} UTC`;
}

function benchTime(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${Math.floor(minutes / 60)}:${two(minutes % 60)}`;
}

// A mean to as many decimals as its standard deviation has two digits.
function decimals(sd, value) {
  if (isNumber(sd) && sd > 0) return Math.max(0, Math.min(9, 1 - Math.floor(Math.log10(sd))));
  return Math.abs(value) >= 100 ? 2 : 4;
}
const fixed = (value, digits) => (isNumber(value) ? minus(value.toFixed(digits)) : "\u2013");

const UNITS = { uV: "\u00b5V", degC: "\u00b0C", deg: "deg" };
const unitText = (unit) => UNITS[unit] ?? unit;

// --- small pieces of page ------------------------------------------------------------------------------------

function node(tag, text, className) {
  const made = document.createElement(tag);
  if (text !== undefined && text !== null) made.textContent = text;
  if (className) made.className = className;
  return made;
}

function write(id, text) {
  if (at(id).textContent !== text) at(id).textContent = text; // a screen reader is told of changes only
}

function rows(table, content) {
  const body = table.tBodies[0];
  body.replaceChildren(...content.map((cells) => {
    const row = document.createElement("tr");
    cells.forEach((cell, i) => {
      const made = node(i === 0 ? "th" : "td", cell.text ?? cell, cell.n ? `n ${cell.className ?? ""}` : "");
      if (i === 0) made.scope = "row";
      row.append(made);
    });
    return row;
  }));
}
const n = (text) => ({ text, n: true });

// --- sections ------------------------------------------------------------------------------------------------

function showAbout(about) {
  if (!about.run_id) return;
  at("simulated").hidden = !about.simulated;
  write("title", about.procedure);
  write("subtitle", `${about.bench}, begun ${local(about.began_utc_s)} (${inUtc(about.began_utc_s)}), ${about.file}`);
  write("made", about.software ? `calibration-rig ${about.software}.` : "");
}

function facts(state) {
  const list = [];
  const add = (what, text, small) => list.push([what, text, small]);
  add("bench time so far", duration(state.elapsed_s));
  if (state.running) add("time left", isNumber(state.remaining_s) ? duration(state.remaining_s) : "not known yet");
  if (isNumber(state.end_utc_s)) add("expected end", local(state.end_utc_s), inUtc(state.end_utc_s));
  if (state.whole_plots) add("whole plot of the design", `${state.whole_plot ?? "\u2013"} of ${state.whole_plots}`);
  if (state.skipped) add("points skipped", String(state.skipped));
  add("faults", String(state.faults));
  if (isNumber(state.last_record_utc_s)) add("last record", local(state.last_record_utc_s), inUtc(state.last_record_utc_s));
  if (state.running) add("news from the controller", age());
  return list;
}

function age() {
  if (!seen.state || !isNumber(seen.state.news_s)) return "\u2013";
  const seconds = seen.state.news_s + (Date.now() - seen.stateAt) / 1000;
  return seconds < 3 ? "just now" : `${duration(seconds)} ago`;
}

function showState(state) {
  at("word").className = `chip ${["good", "busy", "hold", "bad"].includes(state.tone) ? state.tone : ""}`;
  write("word", state.word);
  write("doing", state.doing === state.word ? "" : state.doing);
  const todo = at("notrunning");
  const wanted = `${state.running ? "" : state.said} ${state.todo}`;
  todo.hidden = !state.todo || (state.running && seen.view.acts?.length > 0); // buttons say it then
  if (todo.dataset.said !== wanted) {
    todo.dataset.said = wanted;
    todo.replaceChildren(node("span", state.running ? "To let it go on: " : `${state.said} Carry on with: `), node("code", state.todo));
  }
  at("said").hidden = !state.running || (todo.hidden && state.todo !== ""); // it speaks of the command
  write("said", state.running ? state.said : "");
  at("problem").hidden = !state.error;
  write("problem", state.error);
  const share = state.points ? state.done / state.points : 0;
  at("progress").max = Math.max(1, state.points);
  at("progress").value = state.done;
  write("share", `${state.done} of ${state.points} points (${Math.floor(share * 100)} %)`);
  showFacts();
  document.title = `${state.points ? `${Math.floor(share * 100)} % ` : ""}${state.word}: ${seen.view.about?.procedure ?? name}`;
}

// What a visitor who is logged in may do; a page that only looks has none.
function showActs(acts) {
  const box = at("acts");
  const wanted = JSON.stringify(acts);
  if (box.dataset.acts === wanted) return;
  box.dataset.acts = wanted;
  box.hidden = acts.length === 0;
  box.replaceChildren(...acts.map(([address, words]) => {
    const link = node("a", words, "act");
    link.href = address;
    return link;
  }));
}

function showFacts() {
  const content = facts(seen.state);
  const list = at("facts");
  if (list.children.length !== content.length) {
    list.replaceChildren(...content.map(() => {
      const box = node("div");
      box.append(node("dt"), node("dd"));
      return box;
    }));
  }
  content.forEach(([what, text, small], i) => {
    const [term, value] = list.children[i].children;
    if (term.textContent !== what) term.textContent = what;
    const all = small ? `${text}${small}` : text;
    if (value.textContent !== all) value.replaceChildren(document.createTextNode(text), ...(small ? [node("small", small)] : []));
  });
}

// Charts stay where they are and are drawn again; a figure is made once for each name.
const drawn = new Map();

function figures(holder, wanted) {
  const keys = wanted.map((one) => one.key);
  for (const old of [...holder.children]) {
    if (!keys.includes(old.dataset.key)) {
      drawn.delete(old);
      old.remove();
    }
  }
  for (const one of wanted) {
    let figure = [...holder.children].find((child) => child.dataset.key === one.key);
    if (!figure) {
      figure = node("figure");
      figure.dataset.key = one.key;
      const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      svg.setAttribute("class", "chart");
      figure.append(node("figcaption"), svg);
      holder.append(figure);
    }
    figure.firstChild.replaceChildren(...one.caption);
    drawn.set(figure, one.chart);
    draw(figure.lastChild, one.chart);
  }
}

function caption(title, more) {
  return [node("b", title), node("span", more, "sub")];
}

function showSettling(settling) {
  at("settling").hidden = settling.length === 0;
  figures(at("settlingcharts"), settling.map((one) => {
    const last = one.samples.at(-1);
    const unit = unitText(one.unit);
    const inMinutes = one.samples.length > 0 && one.samples[0][0] < -180;
    const digits = Math.max(0, Math.min(7, 1 - Math.floor(Math.log10(one.band))));
    const now = last ? fixed(last[1], digits) : "\u2013";
    const waited = isNumber(one.for_s) ? ` for ${duration(one.for_s)}` : "";
    const words = `${now} of ${fixed(one.target, digits)} \u00b1 ${one.band} ${unit}, ${one.outcome}${waited}`;
    const by = one.by && one.by !== one.name ? ` (${one.by.replaceAll("_", " ")})` : "";
    return {
      key: one.name,
      caption: caption(one.name.replaceAll("_", " ") + by, words),
      chart: {
        x: one.samples.map(([t]) => (inMinutes ? t / 60 : t)),
        series: [{ values: one.samples.map(([, v]) => v - one.target), style: "line", colour: 0 }],
        band: one.band,
        zero: true,
        xUnit: inMinutes ? "min" : "s",
        yUnit: `from setpoint / ${unit}`,
        label: `${one.name} settling: ${words}`,
      },
    };
  }));
}

function showReadings(readings) {
  if (!readings) return;
  const where = readings.setpoints.map(({ what, value, unit }) => `${what} ${minus(String(Number(value.toPrecision(9))))} ${unitText(unit)}`);
  const flags = readings.flags.length ? `; flagged: ${readings.flags.join(", ")}` : "";
  write("readingsat", `Point ${readings.index} at ${where.join(", ")}; ${local(readings.utc_s, true)}${flags}`);
  at("readings").hidden = false;
  rows(at("readings"), readings.rows.map((row) => {
    const { what, unit } = row;
    const digits = decimals(row.sd, row.mean);
    const title = row.kind === "reference" ? `${what} (reference)` : row.kind === "chamber" ? `${what} (controller)` : what;
    return [title, n(fixed(row.mean, digits)), unitText(unit), n(isNumber(row.sd) ? row.sd.toPrecision(2) : "\u2013"), { ...n(row.kind === "chamber" ? "\u2013" : String(row.n)), className: "count" }];
  }));
}

// Bench time in hours, or minutes where there is not much of it yet.
function overTime(elapsed) {
  const short = (elapsed.at(-1) ?? 0) < 7200;
  return { x: elapsed.map((s) => s / (short ? 60 : 3600)), xUnit: short ? "min" : "h" };
}

function showCharts(charts) {
  const found = charts.residuals;
  const shown = charts.shown < charts.observed ? ` Shown are ${charts.shown} of ${charts.observed} observations, chosen evenly, the last 100 among them.` : "";
  write("against", found.sensors.length ? `Of ${found.against}, over bench time.${shown}` : found.why_none);
  figures(at("residualcharts"), found.sensors.map((sensor, i) => ({
    key: sensor.name,
    caption: caption(sensor.name, `rms ${isNumber(sensor.rms) ? sensor.rms.toPrecision(3) : "\u2013"} ${unitText(sensor.unit)}`),
    chart: {
      ...overTime(found.elapsed_s),
      series: [{ values: sensor.values, style: "dots", colour: i }],
      zero: true,
      yUnit: unitText(sensor.unit),
      label: `Residuals of ${sensor.name} over bench time, ${sensor.values.length} points, rms ${sensor.rms} ${sensor.unit}`,
    },
  })));
  const series = charts.temperatures.series;
  at("temperatures").hidden = series.length === 0;
  figures(at("temperaturecharts"), series.map((one, i) => {
    const last = one.values.at(-1);
    const words = isNumber(last) ? `${fixed(last, 2)} \u00b0C` : "";
    return {
      key: one.name,
      caption: caption(one.what, words),
      chart: {
        ...overTime(charts.temperatures.elapsed_s),
        series: [{ values: one.values, style: "line", colour: i }],
        least: 0.05,
        yUnit: "\u00b0C",
        label: `${one.name} over bench time, now ${words}`,
      },
    };
  }));
}

function showWarnings(warnings) {
  at("warnings").hidden = warnings.length === 0;
  at("warninglist").replaceChildren(...warnings.map((one) => node("li", `${local(one.utc_s)}: ${one.words}`)));
}

function showSessions(sessions) {
  rows(at("sessions"), [...sessions].reverse().map((one, i) => {
    const gap = isNumber(one.gap_s) ? `${duration(one.gap_s)}${one.gap_certain ? "" : " (by UTC, across a restart)"}` : "\u2013";
    const running = i === 0 && seen.state?.running;
    const ended = one.ended ?? (running ? "running" : "without a word: killed, or power lost");
    return [n(String(one.number)), local(one.began_utc_s), local(one.last_utc_s), gap, ended];
  }));
}

function showWholePlots(plots) {
  at("wholeplots").hidden = plots.length === 0;
  rows(at("plots"), [...plots].reverse().map((one) => {
    const where = one.settings.map(([what, value, unit]) => `${what} ${minus(String(Number(value.toPrecision(5))))} ${unit.replace("degC", "\u00b0C")}`);
    return [n(String(one.number)), n(String(one.planned)), where.join(", "), n(String(one.points)), one.lost ? `lost: ${one.lost}` : "stands"];
  }));
}

function showNothing() {
  const list = at("story");
  at("nothing").hidden = !list.classList.contains("matters") || list.querySelector(".fault, .decision, .warning") !== null;
}

function showStory(story) {
  const list = at("story");
  for (const line of story.lines) {
    if (line.seq <= (seen.line ?? 0)) continue;
    seen.line = line.seq;
    const item = node("li", null, ["fault", "decision", "session", "warning"].includes(line.kind) ? line.kind : "step");
    const time = node("time", `${local(line.utc_s, false)}, ${benchTime(line.elapsed_s)} h`);
    time.title = inUtc(line.utc_s);
    item.append(time, node("span", line.words));
    list.prepend(item);
  }
  while (list.children.length > 300) list.lastChild.remove();
  showNothing();
  const hidden = story.told - list.children.length;
  at("earlier").hidden = hidden <= 0;
  write("earlier", `The newest first; ${hidden} earlier lines are in the run file and its report.`);
}

// --- news ----------------------------------------------------------------------------------------------------

function take(news) {
  Object.assign(seen.view, news);
  if (news.about) showAbout(news.about);
  if (news.state) {
    seen.state = news.state;
    seen.stateAt = Date.now();
    showState(news.state);
  }
  if (news.acts) showActs(news.acts);
  if (news.settling) showSettling(news.settling);
  if (news.readings) showReadings(news.readings);
  if (news.charts) showCharts(news.charts);
  if (news.warnings) showWarnings(news.warnings);
  if (news.sessions || (news.state && seen.view.sessions)) showSessions(seen.view.sessions);
  if (news.whole_plots) showWholePlots(news.whole_plots);
  if (news.story) showStory(news.story);
}

let source = null;

function heard() {
  seen.news = Date.now();
  at("lost").hidden = true;
  document.querySelector("main").classList.remove("old");
}

function listen() {
  source = new EventSource(`/run/${encodeURIComponent(name)}/events`);
  source.addEventListener("news", (event) => {
    heard();
    take(JSON.parse(event.data));
  });
  source.addEventListener("beat", heard);
  source.addEventListener("open", heard);
}

function look() {
  if (seen.state) showFacts();
  if (Date.now() - seen.news > LOST_AFTER_MS) {
    const since = new Date(seen.news);
    write("lost", `This page has lost its server since ${two(since.getHours())}:${two(since.getMinutes())}:${two(since.getSeconds())}. What it shows is old. The run itself does not need this page; it is being tried again.`);
    at("lost").hidden = false;
    document.querySelector("main").classList.add("old");
    if (source.readyState === EventSource.CLOSED) listen(); // refused, not merely cut off: the browser does not try again
  }
}

for (const button of document.querySelectorAll("button[data-show]")) {
  button.addEventListener("click", () => {
    at("story").classList.toggle("matters", button.dataset.show === "matters");
    showNothing();
    for (const other of document.querySelectorAll("button[data-show]")) other.setAttribute("aria-pressed", String(other === button));
  });
}

let redraw = 0;
new ResizeObserver(() => {
  cancelAnimationFrame(redraw);
  redraw = requestAnimationFrame(() => { for (const [figure, chart] of drawn) draw(figure.lastChild, chart); });
}).observe(document.querySelector("main"));

seen.news = Date.now();
listen();
setInterval(look, 1000);
