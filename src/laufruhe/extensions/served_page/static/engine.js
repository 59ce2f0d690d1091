// The engine from the front, turning: places of its parts come from the model, weights follow the design.
import { byId, drawn } from "./parts.js";

const LIT = 70;
/** Degrees of crank angle in a second. */
const PACE = 120;

/**
 * @typedef {{name: string, x: number, bank: number, fires: number, crank: number[], pins: number[][], feet: number[][],
 *   pistons: number[][], bodies: {moves: boolean, shapes: number[][][]}[]}} Part
 * @typedef {{name: string, x: number, at: number[], ratio: number, unbalance: number[],
 *   by: {name: string, angle: string | null, gains: number[][]}[]}} Rotor
 * @typedef {{steps: number, cycle: number, bore: number, disc: number, parts: Part[], rotors: Rotor[],
 *   mounts: {name: string, at: number[]}[]}} Engine
 */

/** A picture of one engine. */
export class EngineView {
  constructor(root) {
    this.root = root;
    this.engine = null;
    this.design = {};
    this.angle = 0;
    this.turning = 0;
    this.isSeen = false;
    new IntersectionObserver(([entry]) => {
      this.isSeen = entry.isIntersecting;
      this.draw();
    }).observe(root);
  }

  /** Turn when asked to, or stand at an angle. */
  listen() {
    byId("turn").addEventListener("click", () => this.startOrStop());
    byId("angle").addEventListener("input", () => this.stand(Number(byId("angle").value)));
  }

  startOrStop() {
    const button = byId("turn");
    const runs = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(runs));
    button.textContent = runs ? "Stop" : "Turn";
    this.turning += 1;
    if (runs) this.step(this.turning, performance.now());
  }

  step(mine, before) {
    requestAnimationFrame((now) => {
      if (mine !== this.turning || !this.engine) return;
      this.stand(turned(this.angle, now - before, this.engine.cycle));
      this.step(mine, now);
    });
  }

  /** @param {number} angle [deg] */
  stand(angle) {
    byId("angle").value = String(angle);
    byId("angle-shown").textContent = `${Math.round(angle)}°`;
    this.angle = angle;
    this.draw();
  }

  load(engine) {
    this.engine = engine;
    byId("turning").hidden = !engine;
    if (engine) byId("angle").max = String(engine.cycle);
    this.draw();
  }

  follow(design) {
    this.design = design;
    this.draw();
  }

  /** While it is looked at. */
  draw() {
    const engine = this.engine;
    if (!engine || !this.isSeen) {
      if (!engine) this.root.replaceChildren();
      return;
    }
    const svg = drawn("svg", { viewBox: frame(engine), role: "img", "aria-label": "The engine from the front" });
    const step = Math.round((this.angle / engine.cycle) * engine.steps) % engine.steps;
    const behind = [...engine.parts].sort((a, b) => a.x - b.x);
    svg.append(...engine.rotors.map((rotor) => weight(engine, rotor, this.design, this.angle)));
    behind.forEach((part) => svg.append(...slider(engine, part, step, this.angle)));
    svg.append(...engine.mounts.map((mount) => stand(engine, mount)));
    this.root.replaceChildren(svg);
  }
}

/** How far the angle moves in so many milliseconds. */
export function turned(angle, milliseconds, cycle) {
  // a frame may have begun before it was asked for
  return (angle + (PACE * Math.max(milliseconds, 0)) / 1000) % cycle;
}

function frame(engine) {
  const room = 0.8 * engine.bore;
  const places = [...engine.parts.flatMap((p) => [...p.pins, ...p.pistons, ...p.bodies.flatMap((b) => b.shapes.flat())]),
    ...engine.mounts.map((mount) => mount.at), ...engine.rotors.map((rotor) => rotor.at)];
  const [ys, zs] = [places.map((place) => place[0]), places.map((place) => -place[1])];
  const [left, top] = [Math.min(...ys) - room, Math.min(...zs) - room];
  return [left, top, Math.max(...ys) + room - left, Math.max(...zs) + room - top].map((v) => v.toFixed(1)).join(" ");
}

const up = (place) => [place[0], -place[1]];

function slider(engine, part, step, angle) {
  const bore = engine.bore;
  if (part.bodies.length) return [...part.bodies.map((body) => shape(body, step)), ...crank(engine, part, step)];
  const [x, y] = up(part.pistons[step]);
  const [fx, fy] = up(part.feet[step]);
  const piston = drawn("rect", { class: "piston", x: -0.48 * bore, y: -0.25 * bore, width: 0.96 * bore, height: 0.5 * bore,
    transform: `translate(${x} ${y}) rotate(${part.bank})`, "stroke-width": 0.015 * bore });
  const rod = drawn("line", { class: "rod", x1: fx, y1: fy, x2: x, y2: y, "stroke-width": 0.16 * bore });
  const found = [...walls(engine, part), piston, rod, ...crank(engine, part, step)];
  if ((angle - part.fires + 2 * engine.cycle) % engine.cycle < LIT) {
    const turn = (part.bank * Math.PI) / 180;
    found.push(drawn("circle", { class: "fires", cx: x + 0.42 * bore * Math.sin(turn), cy: y - 0.42 * bore * Math.cos(turn),
      r: 0.1 * bore }));
  }
  return found;
}

function crank(engine, part, step) {
  const [[cx, cy], [px, py], bore] = [up(part.crank), up(part.pins[step]), engine.bore];
  return [drawn("line", { class: "web", x1: cx, y1: cy, x2: px, y2: py, "stroke-width": 0.3 * bore }),
    drawn("circle", { class: "piston", cx: px, cy: py, r: 0.08 * bore, "stroke-width": 0.015 * bore }),
    drawn("circle", { class: "metal", cx, cy, r: 0.08 * bore, "stroke-width": 0.015 * bore })];
}

function shape(body, step) {
  const points = body.shapes[step].map((place) => up(place).join(",")).join(" ");
  return drawn("polygon", { class: body.moves ? "piston" : "fixed", points, "stroke-width": 1 });
}

function walls(engine, part) {
  const turn = (part.bank * Math.PI) / 180;
  const [along, side] = [[Math.sin(turn), -Math.cos(turn)], [Math.cos(turn), Math.sin(turn)]];
  const [cx, cy] = up(part.crank);
  const places = part.pistons.map(up).map(([x, y]) => [x - cx, y - cy]);
  const heights = places.map(([x, y]) => x * along[0] + y * along[1]);
  const off = places[0][0] * side[0] + places[0][1] * side[1];
  const [low, high] = [Math.min(...heights) - 0.25 * engine.bore, Math.max(...heights) + 0.3 * engine.bore];
  return [-0.5, 0.5].map((k) => {
    const [x, y] = [cx + (off + k * engine.bore) * side[0], cy + (off + k * engine.bore) * side[1]];
    return drawn("line", { class: "wall", x1: x + low * along[0], y1: y + low * along[1], x2: x + high * along[0],
      y2: y + high * along[1], "stroke-width": 0.02 * engine.bore });
  });
}

/** A half disc of steel with the weight's unbalance (zeta = z + i y). */
function weight(engine, rotor, design, angle) {
  let [re, im] = rotor.unbalance;
  for (const own of rotor.by) {
    const [size, turn] = [design[own.name] || 0, own.angle === null ? 0 : design[own.angle] || 0];
    const columns = own.angle === null ? [size] : [size * Math.cos(turn), size * Math.sin(turn)];
    columns.forEach((column, k) => {
      re += column * own.gains[k][0];
      im += column * own.gains[k][1];
    });
  }
  const radius = Math.cbrt(engine.disc * Math.hypot(re, im));
  const [x, y] = up(rotor.at);
  const degrees = (Math.atan2(im, re) * 180) / Math.PI + rotor.ratio * angle;
  return drawn("path", { class: "weight", d: `M ${-radius} 0 A ${radius} ${radius} 0 0 1 ${radius} 0 Z`,
    transform: `translate(${x} ${y}) rotate(${degrees})`, "stroke-width": 0.01 * engine.bore },
  drawn("title", {}, rotor.name));
}

function stand(engine, mount) {
  const [[x, y], size] = [up(mount.at), 0.14 * engine.bore];
  return drawn("polygon", { class: "mount", points: `${x},${y - size} ${x - size},${y + size} ${x + size},${y + size}` },
    drawn("title", {}, mount.name));
}
