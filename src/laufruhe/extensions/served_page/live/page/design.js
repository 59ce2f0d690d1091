// The displayed design: one number per slider, the history, and the address.

/** Numbers of the sliders by name: sizes, and angles where they are open. */
function fields(model) {
  return model.sliders.flatMap((slider) => {
    const size = { slider, name: slider.name, isAngle: false, lower: slider.lower, upper: slider.upper, unit: slider };
    if (slider.width === 1) return [size];
    const [lower, upper] = slider.angles;
    const unit = { unit: "rad", shown: "deg", factor: 180 / Math.PI };
    return [size, { slider, name: slider.angle, isAngle: true, lower, upper, unit }];
  });
}

/** The decision vector of a design. */
function vectorOf(model, values) {
  const x = new Float64Array(model.sliders.reduce((sum, slider) => sum + slider.width, 0));
  for (const slider of model.sliders) {
    const size = values[slider.name];
    if (slider.width === 1) { x[slider.column] = size; continue; }
    x[slider.column] = size * Math.cos(values[slider.angle]);
    x[slider.column + 1] = size * Math.sin(values[slider.angle]);
  }
  return x;
}

/** The design of a decision vector; a zero size has its smallest angle. */
function valuesOf(model, x) {
  const values = {};
  for (const slider of model.sliders) {
    const a = x[slider.column], b = x[slider.column + 1];
    if (slider.width === 1) { values[slider.name] = a; continue; }
    const low = slider.angles[0], turns = (Math.atan2(b, a) - low) / TURN;
    values[slider.name] = Math.hypot(a, b);
    values[slider.angle] = a === 0 && b === 0 ? low : low + TURN * (turns - Math.floor(turns));
  }
  return values;
}

/** Values clipped to the bounds of a model; missing ones are the model's. */
function fitting(model, values, otherwise) {
  const out = { ...otherwise };
  for (const { name, lower, upper } of fields(model)) {
    const value = values[name];
    if (Number.isFinite(value)) out[name] = Math.min(Math.max(value, lower), upper);
  }
  return out;
}

/** Undo history. */
class History {
  constructor(first) { this.states = [first]; this.at = 0; }
  get now() { return this.states[this.at]; }
  get canUndo() { return this.at > 0; }
  get canRedo() { return this.at < this.states.length - 1; }
  /** Add a state, unless it equals the current one. */
  add(state) {
    if (JSON.stringify(state) === JSON.stringify(this.now)) return;
    this.states = [...this.states.slice(0, this.at + 1), state].slice(-200);
    this.at = this.states.length - 1;
  }
  undo() { this.at = Math.max(this.at - 1, 0); return this.now; }
  redo() { this.at = Math.min(this.at + 1, this.states.length - 1); return this.now; }
}

const KEY = "d";

/** The design in the address, or null; other keys stay. */
function fromAddress() {
  const text = new URLSearchParams(location.hash.slice(1)).get(KEY);
  if (!text) return null;
  return Object.fromEntries(text.split(";").map((pair) => {
    const at = pair.lastIndexOf("=");
    return [pair.slice(0, at), Number(pair.slice(at + 1))];
  }));
}

/** Write a design into the address in full precision, or remove it. */
function toAddress(values) {
  const rest = new URLSearchParams(location.hash.slice(1));
  rest.delete(KEY);
  if (values) rest.set(KEY, Object.entries(values).map(([name, value]) => `${name}=${value}`).join(";"));
  const text = rest.toString();
  history.replaceState(null, "", text ? `#${text}` : location.pathname + location.search);
}

/** The problem file of a design, numbers in full precision. */
function savedText(model, values) {
  let text = model.save.text;
  for (const [mark, name, unit] of model.save.numbers) {
    const value = unit === "rad" ? (values[name] * 180) / Math.PI : values[name];
    const written = unit === "" || unit === "rad" ? tomlNumber(value) : JSON.stringify(`${tomlNumber(value)} ${unit}`);
    text = text.replaceAll(JSON.stringify(mark), () => written);
  }
  return `# Saved from the live report of ${model.file}.\n${model.save.note ? `# ${model.save.note}\n` : ""}${text}`;
}

/** A number in TOML syntax. */
function tomlNumber(value) {
  return String(value);
}
