// The page: a model, a state and a drawing, kept apart. `show` brings them together.

const KEPT = 1e-5;

/** A model with its numbers. */
async function opened(model) {
  const block = model.data ? await inflated(model.data) : new Float64Array(0);
  return { ...model, signals: model.signals.map((signal) => decoded(signal, block)) };
}

/** All measures at a decision vector, in their order; rows of one signal are taken once. */
function measured(model, x) {
  const known = new Map();
  return model.measures.map((measure) => {
    if (measure.signal === null) return measure.value;
    const key = `${measure.signal} ${measure.refinement}`;
    if (!known.has(key)) known.set(key, rowsAt(model.signals[measure.signal], measure.refinement, x));
    return NORMS[measure.norm](known.get(key));
  });
}

/** How a value stands to a limit: the side that has least room, and whether it is kept. */
function standing(measure, value) {
  if (measure.signal === null) return { value, met: measure.met, side: measure.sides[0] ?? null };
  const rooms = measure.sides.map(([sense, edge]) => [(sense === "at most" ? edge - value : value - edge) / (Math.abs(edge) || 1), [sense, edge]]);
  const [room, side] = rooms.reduce((a, b) => (b[0] < a[0] ? b : a), [Infinity, null]);
  return { value, met: room >= -KEPT, side };
}

/** What is known of one design: objective, limits, and what is minimised after it. */
function judged(model, values) {
  const x = vectorOf(model, values), found = measured(model, x);
  const at = (role) => model.measures.map((measure, k) => ({ measure, value: found[k] })).filter(({ measure }) => measure.role === role);
  const terms = at("objective");
  return {
    x,
    objective: terms.length ? terms.reduce((sum, { measure, value }) => sum + measure.weight * value, 0) : null,
    limits: at("limit").map(({ measure, value }) => standing(measure, value)),
    ranks: at("rank"),
  };
}

/** Largest relative difference between the page's own numbers and those of the exact model. */
function difference(model) {
  let most = 0;
  for (const { x, measured: told } of Object.values(model.designs)) {
    measured(model, Float64Array.from(x)).forEach((value, k) => {
      if (told[k] !== null) most = Math.max(most, Math.abs(value - told[k]) / (Math.abs(told[k]) || 1));
    });
  }
  return most;
}

/** A page of a model in an element, and a handle to it. */
class Page {
  constructor(root) {
    this.root = root;
    this.listeners = [];
    this.values = {};
    this.frame = 0;
    this.keys = (event) => this.key(event);
    this.hash = () => this.readAddress();
  }

  async open(model) {
    this.model = await opened(model);
    this.curve = 0;
    this.point = 0;
    this.optimum = this.known("optimum");
    this.given = this.known("given");
    this.bound = this.model.proved;
    this.values = fitting(this.model, { ...this.values, ...fromAddress() }, this.optimum ?? this.given);
    this.history = new History({ ...this.values });
    this.build();
    this.drawNow();
    document.addEventListener("keydown", this.keys);
    window.addEventListener("hashchange", this.hash);
    return this;
  }

  known(name) {
    const found = this.model.designs[name];
    return found ? valuesOf(this.model, found.x) : null;
  }

  // what is shown

  build() {
    const { model } = this, told = (name, value, isLast) => this.move({ [name]: value }, isLast);
    this.sliders = fields(model).map((field) => new Slider(field, this.marks(field), told));
    this.limits = new Limits(model.measures.filter((measure) => measure.role === "limit"));
    this.value = element("output", { class: "live-value", "data-measure": "objective" });
    this.regret = element("p", { class: "live-regret", "data-role": "regret" });
    this.ranks = element("p", { class: "live-note" });
    this.spoken = element("p", { class: "live-spoken", "aria-live": "polite", role: "status" });
    this.said = element("p", { class: "live-note" });
    const objective = model.objective.name;
    const card = element("div", { class: "live-card" }, element("p", { class: "live-name" }, objective || "No objective"), this.value, this.regret, this.ranks);
    const controls = element("div", { class: "live-controls" }, card, this.buttons(),
      element("div", { class: "live-sliders", role: "group", "aria-label": "Decisions" }, ...this.sliders.map((slider) => slider.root)),
      element("div", { class: "live-scroll", tabindex: "0", role: "region", "aria-label": "Limits" }, this.limits.root), this.said, this.spoken);
    this.figures = element("div", { class: "live-figures" });
    this.root.replaceChildren(element("div", { class: "live" }, controls, element("div", { class: "live-views" }, this.choices(), this.figures)), this.notes());
    this.draw = this.drawing();
  }

  marks(field) {
    const designs = [["given", this.given], ["optimum", this.optimum]];
    return designs.filter(([, design]) => design).map(([kind, design]) => [kind, design[field.name]]);
  }

  buttons() {
    const { optimum, given, model } = this;
    this.undo = button("undo", "Undo", "Ctrl+Z", () => this.set(this.history.undo(), { isOld: true }));
    this.redo = button("redo", "Redo", "Ctrl+Shift+Z", () => this.set(this.history.redo(), { isOld: true }));
    const made = [
      ...(optimum ? [button("optimum", "Back to the optimum", "The design that was decided", () => this.set(this.optimum))] : []),
      ...(given ? [button("given", "As given", "Where the file starts", () => this.set(this.given))] : []),
      this.undo, this.redo,
      button("link", "Copy link", "The address holds the design", () => this.copyLink()),
      ...(model.save.text ? [button("save", "Save as TOML", "A problem file of this design, for laufruhe evaluate", () => this.save())] : []),
    ];
    return element("div", { class: "live-buttons", role: "toolbar", "aria-label": "Designs" }, ...made);
  }

  choices() {
    const curves = choice("Load shown", this.model.curves.map((curve) => curve.title), (k) => { this.curve = k; this.redraw(); });
    const points = choice("Operating point", this.model.points, (k) => { this.point = k; this.redraw(); });
    return element("div", { class: "live-choices" }, curves, points);
  }

  /** The figures of the load that is chosen, and what brings them to a design. */
  drawing() {
    const { model, point } = this, curve = model.curves[this.curve], signal = model.signals[curve.signal];
    const known = Object.values(model.designs).map((design) => Float64Array.from(design.x));
    const polar = signal.parts > 1 ? new Polar(signal) : null;
    const over = new OverAngle(signal, model.turns), bars = new Bars(signal), orders = new Orders(signal, point, known);
    const boxes = [
      polar && ["polar", "Path of the tip over one cycle, seen from the front", polar.root],
      ["angle", `${signal.parts > 1 ? "Size" : "Value"} over the crank angle [${signal.shown}]`, over.root],
      ["bars", "Mean (dark) and maximum (light) over one cycle", bars.root],
      ["orders", `Amplitude by order [${signal.shown}]`, orders.root],
    ].filter(Boolean);
    const legend = element("p", { class: "live-legend", "aria-hidden": "true" }, ...signal.places.map((name, k) => element("span", { class: colour(k) }, name)));
    this.figures.replaceChildren(legend, ...boxes.map(([key, title, root]) => element("figure", { "data-figure": key, class: `live-figure ${key}` }, element("figcaption", {}, title), root)));
    const was = drawnOf(signal, point, this.markedAt());
    return (x) => {
      const now = drawnOf(signal, point, x);
      polar?.update(now, was);
      over.update(now, was);
      bars.update(now, was);
      orders.update(x);
    };
  }

  /** The design that figures are compared with. */
  markedAt() {
    return vectorOf(this.model, this.optimum ?? this.given);
  }

  redraw() {
    this.draw = this.drawing();
    this.drawNow();
  }

  notes() {
    const { model } = this, error = difference(model);
    this.error = error;
    const notes = [`Numbers of this page are float64. Held against the exact model at ${Object.keys(model.designs).length} designs as it opened, they differ by ${error < 1e-15 ? "less than 1e-15" : exponential(error, 2)} of their size at the most.`];
    if (error > 1e-6) notes.push("More than the figures shown can bear: take the numbers of laufruhe evaluate.");
    if (this.optimum) notes.push("Thin grey lines and marks are the design that was decided; rings on the sliders show it, bars the design as given.");
    for (const { names, why } of grouped(model.unmoved)) notes.push(`${names.join(", ")}: ${why}.`);
    if (!model.save.text && model.save.note) notes.push(model.save.note);
    return element("div", { class: "live-notes" }, ...notes.map((text) => element("p", {}, text)));
  }

  // what is done

  /** Some values changed; the last of a drag can be gone back from. */
  move(values, isLast) {
    this.set({ ...this.values, ...values }, { isPassing: !isLast });
  }

  /** A whole design; drawn at the next frame. */
  set(values, { isPassing = false, isOld = false, quiet = false } = {}) {
    this.values = fitting(this.model, values, this.values);
    if (!isPassing && !isOld) this.history.add({ ...this.values });
    if (!this.frame) this.frame = requestAnimationFrame(() => { this.frame = 0; this.drawNow(); });
    if (!isPassing) this.settle(quiet);
    if (!quiet) this.listeners.forEach((listener) => listener({ ...this.values }, { isPassing }));
  }

  /** After a change: the address, and what is read aloud. */
  settle(quiet) {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      if (!quiet) toAddress(this.values);
      this.spoken.textContent = this.sentence();
    }, 250);
  }

  drawNow() {
    const { values, model } = this, found = judged(model, values);
    this.found = found;
    this.sliders.forEach((slider) => slider.show(values[slider.field.name]));
    this.value.textContent = found.objective === null ? "" : figure(found.objective, model.objective);
    this.value.setAttribute("data-value", found.objective ?? "");
    this.showRegret(found);
    this.limits.update(found.limits);
    this.ranks.textContent = found.ranks.map(({ measure, value }) => `${measure.name}: ${figure(value, measure)}`).join("; ");
    this.undo.disabled = !this.history.canUndo;
    this.redo.disabled = !this.history.canRedo;
    this.draw(found.x);
  }

  showRegret(found) {
    const { bound, model } = this, broken = found.limits.filter((limit) => !limit.met).length;
    this.regret.classList.toggle("broken", broken > 0);
    const limits = broken ? `Breaks ${broken} limit${broken > 1 ? "s" : ""}. ` : "";
    if (!bound || found.objective === null) { this.regret.textContent = limits; return; }
    const share = bound.value > 0 ? found.objective / bound.value - 1 : found.objective - bound.value;
    const more = Math.abs(share) < 5e-7 ? "at the optimum" : bound.value > 0 ? `${percent(share)} against the optimum` : `${figure(share, model.objective)} over the optimum`;
    const proof = bound.kind === "global" ? "proven" : bound.kind === "global within gap" ? `proven to ${trimmed(100 * bound.gap, 2)} %` : "a local one";
    this.regret.setAttribute("data-value", share);
    this.regret.textContent = `${limits}${more} of ${figure(bound.value, model.objective)} (${proof})`;
  }

  sentence() {
    const { model, found } = this, broken = model.measures.filter((measure) => measure.role === "limit").filter((_, k) => !found.limits[k].met);
    const limits = broken.length ? `Broken: ${broken.map((measure) => measure.name).join(", ")}.` : found.limits.length ? "All limits are kept." : "";
    return `${model.objective.name} ${this.value.textContent}. ${limits}`;
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.target.type === "number") return;
    const letter = event.key.toLowerCase();
    if (letter !== "z" && letter !== "y") return;
    event.preventDefault();
    this.set(letter === "y" || event.shiftKey ? this.history.redo() : this.history.undo(), { isOld: true });
  }

  readAddress() {
    const values = fromAddress();
    if (values) this.set(values);
  }

  async copyLink() {
    toAddress(this.values);
    try { await navigator.clipboard.writeText(location.href); this.said.textContent = "The link is copied; it shows this design."; }
    catch { this.said.textContent = "The address of this page now shows this design: copy it from there."; }
  }

  save() {
    const url = URL.createObjectURL(new Blob([savedText(this.model, this.values)], { type: "application/toml" }));
    const link = element("a", { href: url, download: `${this.model.name}-moved.toml` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
    this.said.textContent = `${this.model.name}-moved.toml is saved. ${this.model.save.note}`;
  }

  // the handle

  design() { return { ...this.values }; }
  setDesign(values, { quiet = false } = {}) { this.set({ ...this.values, ...values }, { quiet, isPassing: quiet }); }
  onDesign(callback) { this.listeners.push(callback); }
  text() { return savedText(this.model, this.values); }

  measures() {
    const objective = { name: "objective", value: this.found.objective, unit: this.model.objective.unit, met: true };
    const limits = this.model.measures.filter((measure) => measure.role === "limit");
    return [objective, ...limits.map((measure, k) => ({ name: measure.name, unit: measure.unit, value: this.found.limits[k].value, met: this.found.limits[k].met }))];
  }

  /** Another optimum of the same loads, as limits move. */
  setOptimum({ design, value, bound, kind = "global", gap = 0 }) {
    this.optimum = fitting(this.model, design, this.optimum ?? this.given);
    this.bound = { value, bound: bound ?? value, kind, gap };
    this.redraw();
  }

  /** Other edges of limits: at most what is told. */
  setLimits(limits) {
    for (const { name, maximum } of limits) {
      const measure = this.model.measures.find((own) => own.role === "limit" && own.name === name);
      if (measure) measure.sides = measure.sides.map(([sense, edge]) => [sense, sense === "at most" ? maximum : edge]);
    }
    this.drawNow();
  }

  /** Another model; values of sliders that it still has stay. */
  async setModel(model) {
    this.end();
    return this.open(model);
  }

  end() {
    cancelAnimationFrame(this.frame);
    clearTimeout(this.waiting);
    this.frame = 0;
    document.removeEventListener("keydown", this.keys);
    window.removeEventListener("hashchange", this.hash);
  }
}

/** Names that have the same to be said of them. */
function grouped(unmoved) {
  const by = new Map();
  for (const { name, why } of unmoved) by.set(why, [...(by.get(why) ?? []), name]);
  return [...by].map(([why, names]) => ({ why, names }));
}

/**
 * Show a model in an element.
 * @returns {Promise<Page>}
 */
async function show(model, root) {
  return new Page(root).open(typeof model === "string" ? JSON.parse(model) : model);
}

window.laufruheLive = { show, NORMS, opened, measured, judged, rowsAt, savedText, number };

const told = document.getElementById("live-model");
if (told) window.laufruheLive.page = show(told.textContent, document.getElementById("live"));
