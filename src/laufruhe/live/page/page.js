// The page: a model, a state and a drawing, kept apart. `show` brings them together.

const KEPT = 1e-5, AT = 5e-5;

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
  if (measure.signal === null) return { value, met: measure.followed ? measure.met : null, side: measure.sides[0] ?? null };
  const rooms = measure.sides.map(([sense, edge]) => [(sense === "at most" ? edge - value : value - edge) / (Math.abs(edge) || 1), [sense, edge]]);
  const [room, side] = rooms.reduce((a, b) => (b[0] < a[0] ? b : a), [Infinity, null]);
  return { value, met: room >= -KEPT, side };
}

/** What is known of one design: objective, limits, and what is minimised after it. */
function judged(model, values) {
  return judgedAt(model, vectorOf(model, values));
}

function judgedAt(model, x) {
  const found = measured(model, x);
  const at = (role) => model.measures.map((measure, k) => ({ measure, value: found[k] })).filter(({ measure }) => measure.role === role);
  const terms = at("objective");
  return {
    x,
    objective: terms.length && terms.every(({ measure }) => measure.followed) ? terms.reduce((sum, { measure, value }) => sum + measure.weight * value, 0) : null,
    limits: at("limit").map(({ measure, value }) => standing(measure, value)),
    ranks: at("rank"),
  };
}

/** Largest difference between the page's own numbers and those of the exact model, over the largest of each measure. */
function difference(model) {
  const designs = Object.values(model.designs).map(({ x, measured: told }) => [measured(model, Float64Array.from(x)), told]);
  return largest(model.measures.map((_, k) => {
    const known = designs.filter(([, told]) => told[k] !== null), size = largest(known.map(([, told]) => Math.abs(told[k])));
    return largest(known.map(([own, told]) => Math.abs(own[k] - told[k]) / (size || 1)));
  }));
}

/** Number of the curve that the objective is of; else the first. */
function ownCurve(model) {
  const asked = model.measures.find((measure) => measure.role === "objective" && measure.signal !== null);
  return Math.max(model.curves.findIndex((curve) => asked && model.signals[curve.signal].name === model.signals[asked.signal].name), 0);
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
    this.curve = ownCurve(this.model);
    this.point = 0;
    this.optimum = this.known("optimum");
    this.given = this.known("given");
    this.bound = this.model.proved;
    this.size = largest(Object.values(this.model.designs).map(({ x }) => judgedAt(this.model, Float64Array.from(x)).objective ?? 0));
    // the address is that of the first model, whatever was moved since stays
    this.values = fitting(this.model, this.history ? this.values : fromAddress() ?? {}, this.optimum ?? this.given);
    this.history = new History({ ...this.values });
    this.build();
    this.drawNow();
    this.draw.say(this.found.x);
    // after the first picture
    this.checked = new Promise((done) => { this.checking = setTimeout(() => done(this.check())); });
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
    const limits = element("div", { class: "live-scroll", tabindex: "0", role: "region", "aria-label": "Limits" }, this.limits.root);
    limits.hidden = this.limits.rows.length === 0;
    const controls = element("div", { class: "live-controls" }, card, limits, this.buttons(), this.said,
      element("div", { class: "live-sliders", role: "group", "aria-label": "Decisions" }, ...this.sliders.map((slider) => slider.root)), this.spoken);
    this.figures = element("div", { class: "live-figures" });
    this.root.replaceChildren(element("div", { class: "live" }, controls, element("div", { class: "live-views" }, this.choices(), this.figures)), this.notes());
    this.draw = this.drawing();
  }

  marks(field) {
    const designs = [["given", this.given], ["optimum", this.optimum]];
    return designs.filter(([, design]) => design).map(([kind, design]) => [kind, design[field.name]]);
  }

  buttons() {
    const { given, model } = this;
    this.best = button("optimum", "Back to the optimum", "The design that was decided", () => this.set(this.optimum));
    this.best.hidden = !this.optimum;
    this.undo = button("undo", "Undo", "Ctrl+Z", () => this.set(this.history.undo(), { isOld: true }));
    this.redo = button("redo", "Redo", "Ctrl+Shift+Z", () => this.set(this.history.redo(), { isOld: true }));
    const made = [
      this.best,
      ...(given ? [button("given", "As given", "Where the file starts", () => this.set(this.given))] : []),
      this.undo, this.redo,
      button("link", "Copy link", "The address holds the design", () => this.copyLink()),
      ...(model.save.text ? [button("save", "Save as TOML", "A problem file of this design, for laufruhe evaluate", () => this.save())] : []),
    ];
    return element("div", { class: "live-buttons", role: "toolbar", "aria-label": "Designs" }, ...made);
  }

  choices() {
    const curves = choice("Load shown", this.model.curves.map((curve) => curve.title), this.curve, (k) => { this.curve = k; this.redraw(); });
    const points = choice("Operating point", this.model.points, this.point, (k) => { this.point = k; this.redraw(); });
    return element("div", { class: "live-choices" }, curves, points);
  }

  /** The figures of the load that is chosen, and what brings them to a design. */
  drawing() {
    const { model, point } = this, curve = model.curves[this.curve], signal = model.signals[curve?.signal];
    if (!signal) return { compare() {}, update() {}, say() {} };
    const known = Object.values(model.designs).map((design) => Float64Array.from(design.x));
    const was = keptOf(signal, point, this.markedAt());
    const polar = signal.parts > 1 && signal.unit.startsWith("N") ? new Polar(signal, was) : null;
    const over = new OverAngle(signal, was, this.root.clientWidth < 560 ? 430 : 860), bars = new Bars(signal, was), orders = new Orders(signal, point, known);
    const boxes = [
      polar && ["polar", "Path of the tip over one cycle, seen from the front", polar.root],
      ["angle", `${signal.parts > 1 ? "Size" : "Value"} over the crank angle [${signal.shown}]`, over.root],
      ["bars", "Mean (dark) and maximum (light) over one cycle", bars.root],
      ["orders", `Amplitude by order [${signal.shown}]`, orders.root],
    ].filter(Boolean);
    const legend = element("p", { class: "live-legend", "aria-hidden": "true" }, ...signal.places.map((name, k) => element("span", { class: colour(k) }, name)));
    legend.hidden = signal.places.length < 2;
    this.figures.replaceChildren(legend, ...boxes.map(([key, title, root]) => element("figure", { "data-figure": key, class: `live-figure ${key}` }, element("figcaption", {}, title), root)));
    const forces = [polar, over, bars].filter(Boolean);
    return {
      compare: () => {
        const other = keptOf(signal, point, this.markedAt());
        forces.forEach((each) => each.compare(other));
      },
      update: (x) => {
        const now = drawnOf(signal, point, x);
        forces.forEach((each) => each.update(now));
        orders.update(x);
      },
      say: (x) => {
        const now = drawnOf(signal, point, x);
        forces.forEach((each) => each.say(now));
        orders.say();
      },
    };
  }

  /** The design that figures are compared with. */
  markedAt() {
    return vectorOf(this.model, this.optimum ?? this.given);
  }

  redraw() {
    this.draw = this.drawing();
    this.drawNow();
    this.draw.say(this.found.x);
  }

  notes() {
    const { model } = this, kept = this.optimum ? "the design that was decided, as rings on the sliders do; bars on them show the one given" : "the design as given, as bars on the sliders do";
    const notes = [
      ...(model.whyNot ? [model.whyNot] : []),
      ...(this.given && model.sliders.length ? [`Thin grey lines and black marks show ${kept}.`] : []),
      ...grouped(model.unmoved).map(({ names, why }) => `${names.join(", ")}: ${why}.`),
      ...(!model.save.text && model.save.note && model.sliders.length ? [model.save.note] : []),
    ];
    this.accuracy = element("p", { "data-role": "accuracy" });
    return element("div", { class: "live-notes" }, ...notes.map((text) => element("p", {}, text)), this.accuracy);
  }

  /** Hold the page's own numbers against those that came with the model. */
  check() {
    this.error = difference(this.model);
    const size = this.error < 1e-15 ? "less than 1e-15" : exponential(this.error, 2);
    const bad = this.error > 1e-6 ? " That is more than the figures shown can bear: take the numbers of laufruhe evaluate." : "";
    this.accuracy.textContent = `Numbers of this page are float64. Held against the exact model at ${Object.keys(this.model.designs).length} designs as it opened, they differ by ${size} of their size at the most.${bad}`;
    return this.error;
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
    this.askFrame();
    if (!isPassing) this.settle(quiet);
    if (!quiet) this.listeners.forEach((listener) => listener({ ...this.values }, { isPassing }));
  }

  /** Draw once, at the next frame. */
  askFrame() {
    if (!this.frame) this.frame = requestAnimationFrame(() => { this.frame = 0; this.drawNow(); });
  }

  /** After a change: the address, and what is read aloud. */
  settle(quiet) {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      if (!quiet) toAddress(this.values);
      this.spoken.textContent = this.sentence();
      this.draw.say(this.found.x);
    }, 250);
  }

  drawNow() {
    const { values, model } = this;
    if (this.isMoved) this.draw.compare();
    this.isMoved = false;
    const found = judged(model, values);
    this.found = found;
    this.sliders.forEach((slider) => slider.show(values[slider.field.name]));
    this.value.textContent = found.objective === null ? "" : this.told(found.objective);
    this.value.setAttribute("data-value", found.objective ?? "");
    this.showRegret(found);
    this.limits.update(found.limits);
    this.ranks.textContent = found.ranks.map(({ measure, value }) => `${measure.name}: ${figure(value, measure)}`).join("; ");
    this.undo.disabled = !this.history.canUndo;
    this.redo.disabled = !this.history.canRedo;
    this.draw.update(found.x);
  }

  showRegret(found) {
    const { bound, model } = this, broken = this.broken();
    this.regret.classList.toggle("broken", broken.length > 0);
    const more = broken.length > 2 ? ` and ${broken.length - 2} more` : "";
    const limits = broken.length ? `Breaks ${broken.slice(0, 2).join(", ")}${more}. ` : "";
    if (!bound || found.objective === null) { this.regret.textContent = limits; return; }
    const share = this.isNothing(bound.value) ? found.objective - bound.value : found.objective / bound.value - 1;
    this.regret.setAttribute("data-value", share);
    this.regret.textContent = `${limits}${this.against(found.objective, share, limits !== "")}`;
  }

  /** How the objective stands to the proven one. */
  against(value, share, isBroken) {
    const { bound, model } = this, best = `the optimum of ${this.told(bound.value)} (${proofWords(bound)})`;
    const unknown = model.measures.filter((measure) => !measure.followed).map((measure) => measure.name);
    const aside = unknown.length ? ` Not followed here: ${unknown.join(", ")}.` : "";
    if (this.isOptimum()) return `This is ${best}.`;
    if (Math.abs(value - bound.value) <= AT * Math.abs(bound.value)) return `As much as ${best}.${aside}`;
    if (share < 0 && (aside || isBroken)) return `Less than ${best}, which keeps all limits.${aside}`;
    return `${this.isNothing(bound.value) ? `${this.told(share)} more than` : `${percent(share)} against`} ${best}.${aside}`;
  }

  /** The objective in words; what is a rounding beside the designs known is nothing. */
  told(value) {
    return figure(value, this.model.objective, 4, this.size);
  }

  isNothing(value) {
    return value <= 1e-9 * this.size;
  }

  /** Whether the design is the one that was decided, but for roundings. */
  isOptimum() {
    const x = vectorOf(this.model, this.values), best = vectorOf(this.model, this.optimum ?? this.values);
    const size = largest(this.model.sliders.map((slider) => slider.upper - slider.lower));
    return this.optimum !== null && x.every((value, k) => Math.abs(value - best[k]) <= 1e-9 * size);
  }

  /** Names of the limits that are broken. */
  broken() {
    const limits = this.model.measures.filter((measure) => measure.role === "limit");
    return limits.filter((_, k) => this.found.limits[k].met === false).map((measure) => measure.name);
  }

  sentence() {
    const broken = this.broken(), kept = this.found.limits.length ? "All limits are kept." : "";
    return `${this.model.objective.name} ${this.value.textContent}. ${broken.length ? `Broken: ${broken.join(", ")}.` : kept}`;
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
    const { model } = this, objective = { ...unitOf(model.objective), name: "objective", words: model.objective.name, value: this.found.objective, met: true };
    const limits = this.model.measures.filter((measure) => measure.role === "limit");
    return [objective, ...limits.map((measure, k) => ({ ...unitOf(measure), name: measure.name, words: measure.name, value: this.found.limits[k].value, met: this.found.limits[k].met }))];
  }

  /** Another optimum of the same loads, as limits move. */
  setOptimum({ design, value, bound, kind, proof, gap = 0 }) {
    this.optimum = fitting(this.model, design, this.optimum ?? this.given);
    this.bound = { value, bound: bound ?? value, kind: kind ?? proof ?? "global", gap };
    this.sliders.forEach((slider) => slider.setMark("optimum", this.optimum[slider.field.name]));
    this.best.hidden = false;
    this.isMoved = true;
    this.askFrame();
  }

  /** Other edges of limits: at most what is told. */
  setLimits(limits) {
    for (const { name, maximum } of limits) {
      const measure = this.model.measures.find((own) => own.role === "limit" && own.name === name);
      if (measure) measure.sides = measure.sides.map(([sense, edge]) => [sense, sense === "at most" ? maximum : edge]);
    }
    this.askFrame();
  }

  /** All of these at once, drawn in one frame. */
  update({ limits, optimum, design }) {
    if (limits) this.setLimits(limits);
    if (optimum) this.setOptimum(optimum);
    if (design) this.setDesign(design, { quiet: true });
  }

  /** Another model; values of sliders that it still has stay. */
  async setModel(model) {
    this.end();
    return this.open(model);
  }

  end() {
    cancelAnimationFrame(this.frame);
    clearTimeout(this.waiting);
    clearTimeout(this.checking);
    this.frame = 0;
    document.removeEventListener("keydown", this.keys);
    window.removeEventListener("hashchange", this.hash);
  }
}

/** SI unit, the one that is shown, and its factor. */
function unitOf({ unit, shown, factor }) {
  return { unit, shown, factor };
}

/** What was proven of an optimum. */
function proofWords({ kind, gap }) {
  if (kind === "global") return "proven";
  return kind === "global within gap" ? `proven to ${trimmed(100 * gap, 2)} %` : "a local one";
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
