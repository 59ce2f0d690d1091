// The front between the objective and another measure, drawn as its points come.
import { drawn, shown, ticks } from "./parts.js";

const [WIDE, HIGH, LEFT, LOW, TOP] = [640, 376, 74, 44, 28];

/**
 * @typedef {{across: number, value: number, bound: {at: number, value: number} | null, words: string, simpler: string,
 *   axes: {across: [string, number], value: [string, number]}, name: string, design: Record<string, number>}} Point
 */

/** @param {string} across its name */
export function drawFront(root, points, across, picked) {
  if (!points.length) {
    root.replaceChildren();
    return;
  }
  const sorted = [...points].sort((a, b) => a.across - b.across);
  const x = scale(sorted.map((point) => point.across), LEFT, WIDE - 12);
  const bounds = sorted.flatMap((point) => (point.bound ? [point.bound] : [])).sort((a, b) => a.at - b.at);
  const y = scale([...sorted, ...bounds].map((point) => point.value), HIGH - LOW, TOP);
  const svg = drawn("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "group", "aria-label": `Front against ${across}` });
  const places = (/** @type {[number, number][]} */ pairs) => pairs.map(([a, b]) => `${x.at(a)},${y.at(b)}`).join(" ");
  svg.append(...axes(x, y, sorted[0], across),
    drawn("polyline", { class: "bound", points: places(bounds.map((bound) => [bound.at, bound.value])) }),
    drawn("polyline", { class: "curve", points: places(sorted.map((point) => [point.across, point.value])) }));
  svg.append(...sorted.map((point) => dot(point, x, y, picked)));
  root.replaceChildren(svg);
}

function scale(values, from, to) {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const room = 0.05 * (most - least || Math.abs(most) || 1);
  const [low, high] = [Math.max(least - room, least >= 0 ? 0 : -Infinity), most + room];
  const at = (/** @type {number} */ value) => from + ((value - low) / (high - low)) * (to - from);
  return { low, high, at };
}

function axes(x, y, point, across) {
  const found = [];
  const [unit, factor] = point.axes.across;
  const [upUnit, upFactor] = point.axes.value;
  for (const tick of ticks(x.low * factor, x.high * factor)) {
    const at = x.at(tick / factor);
    found.push(drawn("line", { class: "grid", x1: at, x2: at, y1: TOP, y2: HIGH - LOW }),
      drawn("text", { x: at, y: HIGH - LOW + 15, "text-anchor": "middle" }, shown(tick)));
  }
  for (const tick of ticks(y.low * upFactor, y.high * upFactor)) {
    const at = y.at(tick / upFactor);
    found.push(drawn("line", { class: "grid", x1: LEFT, x2: WIDE - 12, y1: at, y2: at }),
      drawn("text", { x: LEFT - 6, y: at + 4, "text-anchor": "end" }, shown(tick)));
  }
  found.push(drawn("text", { x: WIDE - 12, y: HIGH - 8, "text-anchor": "end" }, `${across} [${unit}]`),
    drawn("text", { x: 4, y: 14 }, `${point.name} [${upUnit}]${point.bound ? "; dashed: no design has less" : point.simpler}`));
  return found;
}

function dot(point, x, y, picked) {
  const made = drawn("circle", { cx: x.at(point.across), cy: y.at(point.value), r: 4.5, tabindex: 0, role: "button",
    "aria-label": `Show the design with ${point.words}` }, drawn("title", {}, point.words));
  made.addEventListener("click", () => picked(point));
  made.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      picked(point);
    }
  });
  return made;
}
