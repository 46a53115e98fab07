// Small charts in SVG: dots or lines over a common x, a shaded band, few grid lines. Nothing else, no library.

const NS = "http://www.w3.org/2000/svg";

function element(name, attributes, parent, text) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

// Round numbers between low and high, about `count` of them.
export function ticks(low, high, count) {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i += 1) found.push(i * step);
  return { step, found };
}

export function tickText(value, step) {
  if (Math.abs(value) < step * 1e-6) return "0";
  if (step < 1e-5 || step >= 1e6) return value.toExponential(1);
  return value.toFixed(Math.max(0, Math.min(7, -Math.floor(Math.log10(step) + 1e-9)))).replace("-", "\u2212");
}

function span(values, least) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (typeof value !== "number") continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return null;
  const middle = (low + high) / 2;
  const half = Math.max((high - low) / 2, least, Math.abs(middle) * 1e-9, 1e-12) * 1.08;
  return [middle - half, middle + half];
}

// chart: {x, series: [{values, style: "dots"|"line", colour}], band, zero, xUnit, yUnit, label}
export function draw(svg, chart) {
  const width = Math.max(180, svg.clientWidth || 320);
  const height = Math.max(110, svg.clientHeight || 180);
  svg.replaceChildren();
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", chart.label);
  const xs = span(chart.x, 1e-9);
  const inBand = chart.band === undefined ? [] : [-chart.band, chart.band];
  const ys = span([...chart.series.flatMap((s) => s.values), ...inBand], chart.least ?? 0);
  if (!xs || !ys) return;
  if (chart.x.length > 1) { // x reaches exactly from the first to the last
    xs[0] = Math.min(...chart.x);
    xs[1] = Math.max(xs[0] + 1e-9, Math.max(...chart.x));
  }
  const yTicks = ticks(ys[0], ys[1], height / 42);
  const texts = yTicks.found.map((t) => tickText(t, yTicks.step));
  const left = 10 + 6.3 * Math.max(3, ...texts.map((t) => t.length));
  const [right, top, bottom] = [width - 8, 16, height - 20];
  const px = (x) => left + ((x - xs[0]) / (xs[1] - xs[0])) * (right - left);
  const py = (y) => bottom - ((y - ys[0]) / (ys[1] - ys[0])) * (bottom - top);
  if (chart.band !== undefined) {
    const [up, down] = [py(chart.band), py(-chart.band)];
    element("rect", { class: "inside", x: left, y: up, width: right - left, height: Math.max(1.5, down - up) }, svg);
  }
  yTicks.found.forEach((tick, i) => {
    const y = py(tick);
    element("line", { class: "grid", x1: left, x2: right, y1: y, y2: y }, svg);
    element("text", { x: left - 5, y: y + 4, "text-anchor": "end" }, svg, texts[i]);
  });
  const xTicks = ticks(xs[0], xs[1], (right - left) / 70);
  for (const tick of xTicks.found) {
    const x = px(tick);
    element("line", { class: "grid", x1: x, x2: x, y1: top, y2: bottom }, svg);
    if (x < right - 34) element("text", { x, y: bottom + 14, "text-anchor": "middle" }, svg, tickText(tick, xTicks.step));
  }
  if (ys[0] < 0 && ys[1] > 0 && chart.zero) {
    element("line", { class: "zero", x1: left, x2: right, y1: py(0), y2: py(0) }, svg);
  }
  element("text", { x: right, y: bottom + 14, "text-anchor": "end" }, svg, chart.xUnit);
  element("text", { x: 2, y: 10 }, svg, chart.yUnit);
  for (const series of chart.series) {
    const parts = [];
    let pen = false;
    series.values.forEach((value, i) => {
      if (typeof value !== "number") { pen = false; return; }
      const at = `${px(chart.x[i]).toFixed(1)} ${py(value).toFixed(1)}`;
      if (series.style === "dots") parts.push(`M${at}h0`);
      else parts.push(`${pen ? "L" : "M"}${at}`);
      pen = true;
    });
    element("path", { class: `${series.style} s${series.colour % 7}`, d: parts.join("") }, svg);
  }
}
