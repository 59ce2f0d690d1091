// Sliders, and the measures beside them: they display a state and report input.

const STEPS = 1000;

/** A range and a number field of one value. */
class Slider {
  /** @param refuse called with the reason for refusing a typed number; empty if accepted */
  constructor(field, marks, told, refuse) {
    Object.assign(this, { field, refuse });
    const { name, unit, lower, upper } = field, id = `live-${name.replace(/[^\w-]/g, "-")}`;
    const step = ((upper - lower) * unit.factor) / STEPS || 1;
    const bounds = { min: lower * unit.factor, max: upper * unit.factor, step: "any" };
    const words = unit.shown ? `${name} in ${unit.shown}` : name;
    this.range = element("input", { type: "range", id, ...bounds, "data-decision": name });
    const kind = { type: "text", inputmode: "decimal", autocomplete: "off" };
    this.number = element("input", { ...kind, "data-number": name, "aria-label": words });
    this.range.addEventListener("keydown", (event) => this.key(event, step, told));
    this.range.addEventListener("input", () => told(name, this.range.valueAsNumber / unit.factor, false));
    this.range.addEventListener("change", () => told(name, this.range.valueAsNumber / unit.factor, true));
    this.number.addEventListener("input", () => { this.editing = true; });
    this.number.addEventListener("change", () => this.typed(told));
    this.number.addEventListener("blur", () => { if (this.editing) this.write(); });
    this.rail = element("div", { class: "live-rail" }, this.range);
    this.marks = {};
    for (const [kind, value] of marks) this.setMark(kind, value);
    const [low, high] = [lower, upper].map((value) => trimmed(value * unit.factor));
    const ends = element("span", { class: "live-ends" }, `${low} to ${high} ${unit.shown}`.trimEnd());
    const entry = element("span", { class: "live-typed" }, this.number, element("span", { "aria-hidden": "true" }, unit.shown));
    this.root = element("div", { class: "live-slider" },
      element("label", { for: id }, name, ends), this.rail, entry);
  }

  /** Mark the value of a known design. */
  setMark(kind, value) {
    const { lower, upper } = this.field;
    if (value === undefined) {
      this.marks[kind]?.remove();
      return;
    }
    const made = this.marks[kind] ??= element("i", { class: `live-mark ${kind}`, "aria-hidden": "true" });
    if (!made.parentNode) this.rail.append(made);
    // the centre of a thumb moves from half its width to the end less half its width
    made.style.left = `calc(8px + (100% - 16px) * ${(value - lower) / (upper - lower || 1)})`;
  }

  /** Arrows move by a thousandth of the range, pages by a twentieth. */
  key(event, step, told) {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 50, PageDown: -50 }[event.key];
    if (!by || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const { name, unit, lower, upper } = this.field;
    const value = Math.min(Math.max(this.value + (by * (event.shiftKey ? 10 : 1) * step) / unit.factor, lower), upper);
    told(name, value, true);
  }

  typed(told) {
    const { name, unit, lower, upper } = this.field, { value, why } = typed(this.number.value);
    this.editing = false;
    this.number.setAttribute("aria-invalid", String(Boolean(why)));
    this.refuse(why ? `${name}: ${why}.` : "");
    if (why) return;
    this.value = NaN;
    told(name, Math.min(Math.max(value / unit.factor, lower), upper), true);
  }

  show(value) {
    const { unit } = this.field;
    if (value === this.value) return;
    this.value = value;
    this.range.value = value * unit.factor;
    this.range.setAttribute("aria-valuetext", figure(value, unit));
    if (!this.editing) this.write();
  }

  /** Write the value into the number field, unless the user is typing in it. */
  write() {
    this.editing = false;
    this.number.value = trimmed(this.value * this.field.unit.factor, 4);
    this.number.removeAttribute("aria-invalid");
  }
}

/** Rows of limits: value, edge, and the used share of the limit. */
class Limits {
  constructor(measures) {
    this.rows = measures.map((measure) => this.row(measure));
    const heads = ["limit", "value", "bound", "used"].map((text) => element("th", { scope: "col" }, text));
    const body = element("tbody", {}, ...this.rows.map((row) => row.root));
    this.root = element("table", { class: "live-limits" }, element("thead", {}, element("tr", {}, ...heads)), body);
  }

  row(measure) {
    const value = element("td", {}), edge = element("td", { class: "edge" });
    const bar = element("i"), met = element("span", { class: "live-met" });
    const root = element("tr", { "data-measure": measure.name }, element("th", { scope: "row" }, measure.name), value, edge,
      element("td", {}, element("span", { class: "live-gauge", "aria-hidden": "true" }, bar), met));
    return { measure, root, value, edge, bar, met };
  }

  update(found) {
    this.rows.forEach((row, k) => {
      const { value, met, side } = found[k], { measure, root } = row;
      root.setAttribute("data-value", value);
      root.setAttribute("data-met", met ?? "");
      row.value.textContent = figure(value, measure);
      row.edge.textContent = side ? `${side[0]} ${trimmed(side[1] * measure.factor)} ${measure.shown}`.trimEnd() : "";
      row.bar.style.width = `${side && side[1] ? Math.min(100, (100 * value) / side[1]) : 0}%`;
      row.met.textContent = met === null ? "cannot be followed live" : met ? "kept" : "broken";
    });
  }
}

/** A button. */
function button(what, text, title, pressed) {
  const made = element("button", { type: "button", "data-do": what, title }, text);
  made.addEventListener("click", pressed);
  return made;
}

/** A choice of several options. */
function choice(name, texts, first, chosen) {
  const list = texts.map((text, k) => {
    const input = element("input", { type: "radio", name, value: k, checked: k === first });
    input.addEventListener("change", () => chosen(k));
    return element("label", {}, input, element("span", {}, text));
  });
  const made = element("div", { class: "live-choice", role: "radiogroup", "aria-label": name }, ...list);
  made.hidden = texts.length < 2;
  return made;
}
