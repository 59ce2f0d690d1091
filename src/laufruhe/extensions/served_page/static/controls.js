// Sliders for what loads are not affine in: each moves one number of the problem, by name.
import { element, shown, typed } from "./parts.js";

/**
 * @typedef {{way: string, name: string, group: string, label: string, value: number, low: number, high: number,
 *   step: number, unit: string, open: boolean, limit: string}} Control
 * @typedef {[string, string, any]} Edit
 */

/** On a narrow page groups are folded: who moves one sees what it does. */
const wide = matchMedia("(min-width: 60rem)");
const ORDER = ["Limits", "Engine", "Open numbers", "Mounts"];

/** All sliders of a problem, in groups. */
export class Controls {
  /** @param {(why: string) => void} complain of what was typed */
  constructor(root, moved, complain) {
    this.root = root;
    this.complain = complain;
    this.moved = moved;
    this.rows = new Map();
  }

  build(controls, edits) {
    this.rows.clear();
    this.root.querySelectorAll("fieldset.numbers").forEach((old) => old.remove());
    for (const group of ORDER) {
      const own = controls.filter((control) => control.group === group);
      if (!own.length) continue;
      const open = wide.matches || group === ORDER[0] || own.some((control) => edits.has(control.name));
      const told = element("summary", {}, `${own.length} number${own.length > 1 ? "s" : ""}`);
      const rows = own.map((control) => this.row(control, edits.get(control.name)));
      const box = element("details", { open }, told, ...rows);
      wide.addEventListener("change", () => { box.open ||= wide.matches; });
      this.root.append(element("fieldset", { class: "numbers" }, element("legend", {}, group), box));
    }
  }

  /** One number: slider, figure, and the way back. */
  row(control, edit) {
    const id = `c-${control.name}`;
    const value = edit ? parseFloat(edit[2]) : control.value;
    const limits = { min: control.low, max: control.high, step: control.step };
    const range = element("input", { type: "range", id, ...limits, "data-control": control.name });
    const number = element("input", { type: "text", inputmode: "decimal", "aria-label": `${control.label}, ${control.unit || "number"}`,
      "data-number-of": control.name });
    const free = element("button", { type: "button", hidden: true, "aria-label": `${control.label}: as in the file` }, "↺");
    const said = element("p", { class: "said" }, control.open ? "optimised; move to fix" : "");
    range.value = String(value);
    number.value = shown(value, 6);
    const row = element("div", { class: "row" }, range, number, element("span", {}, control.unit), free);
    const box = element("div", { class: "control" }, element("label", { for: id }, control.label), row, said);
    range.addEventListener("input", () => this.set(control, Number(range.value)));
    number.addEventListener("change", () => this.typed(control, number));
    free.addEventListener("click", () => this.release(control));
    this.rows.set(control.name, { control, box, range, number, free, said });
    this.mark(control.name, Boolean(edit));
    return box;
  }

  /** Take a number that was typed, or say why it is refused. */
  typed(control, number) {
    const { value, why } = typed(number.value);
    number.setAttribute("aria-invalid", String(Boolean(why)));
    if (why) this.complain(`${control.label}: ${why}. It stays at ${this.rows.get(control.name)?.range.value} ${control.unit}.`);
    else this.set(control, value ?? NaN);
  }

  set(control, value) {
    const row = this.rows.get(control.name);
    if (!row || !Number.isFinite(value)) return;
    const text = shown(value, 6);
    row.number.value = text;
    row.number.removeAttribute("aria-invalid");
    row.range.value = text;
    this.mark(control.name, true);
    this.moved([control.way, control.name, control.unit ? `${text} ${control.unit}` : Number(text)], control);
  }

  release(control) {
    this.place(control.name, control.value);
    this.mark(control.name, false);
    this.rows.get(control.name)?.range.focus();
    this.moved(null, control);
  }

  /** Move a slider without asking for anything. */
  place(name, value) {
    const row = this.rows.get(name);
    if (!row) return;
    row.range.value = String(value);
    row.number.value = shown(value, 6);
  }

  mark(name, changed) {
    const row = this.rows.get(name);
    row?.box.classList.toggle("changed", changed);
    if (row) row.free.hidden = !changed;
  }

  /** How a design stands to its limits, what they cost, and which contradict each other. */
  tell(limits, conflict) {
    for (const { control, box, said } of this.rows.values()) {
      if (!control.limit) continue;
      const own = limits.find((limit) => limit.name === control.limit);
      const against = conflict.includes(control.limit);
      box.classList.toggle("conflict", against);
      box.classList.toggle("broken", Boolean(own?.broken));
      const words = against ? "contradicts the others marked so, or the bounds" : own?.words ?? "";
      if (said.textContent !== words) said.textContent = words;
    }
  }

  /** @param {boolean} dead whether nobody is there to compute */
  disable(dead) {
    this.root.querySelectorAll("fieldset").forEach((box) => { box.disabled = dead; });
  }
}
