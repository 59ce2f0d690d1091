// The page: connects a model, a state and a drawing.

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
    this.reference = this.model.reference;
    this.withdrawn = "";
    this.exact = { values: this.optimum ?? this.given, objective: this.reference?.value ?? null, limits: {} };
    this.size = sizeOf(this.model);
    // the address belongs to the first model; later changes stay
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

  // display

  build() {
    const told = (name, value, isLast) => this.move({ [name]: value }, isLast);
    const refuse = (why) => { this.said.textContent = why; };
    this.sliders = fields(this.model).map((field) => new Slider(field, this.marks(field), told, refuse));
    this.limits = new Limits(ofRole(this.model, "limit"));
    this.spoken = element("p", { class: "live-spoken", "aria-live": "polite", role: "status" });
    this.said = element("p", { class: "live-note", role: "status" });
    const region = { class: "live-scroll", tabindex: "0", role: "region", "aria-label": "Limits" };
    const limits = element("div", region, this.limits.root);
    limits.hidden = this.limits.rows.length === 0;
    const sliders = this.sliders.map((slider) => slider.root);
    const group = element("div", { class: "live-sliders", role: "group", "aria-label": "Decisions" }, ...sliders);
    const parts = [this.card(), limits, this.buttons(), this.said, group, this.spoken];
    const controls = element("div", { class: "live-controls" }, ...parts);
    this.figures = element("div", { class: "live-figures" });
    const views = element("div", { class: "live-views" }, this.choices(), this.figures);
    this.root.replaceChildren(element("div", { class: "live" }, controls, views), this.notes());
    this.draw = this.drawing();
  }

  /** Show the objective and its comparison with the optimum. */
  card() {
    const name = element("p", { class: "live-name" }, this.model.objective.name || "No objective");
    this.value = element("output", { class: "live-value", "data-measure": "objective" });
    this.regret = element("p", { class: "live-regret", "data-role": "regret" });
    this.ranks = element("p", { class: "live-note" });
    return element("div", { class: "live-card" }, name, this.value, this.regret, this.ranks);
  }

  marks(field) {
    const designs = [["given", this.given], ["optimum", this.optimum]];
    return designs.filter(([, design]) => design).map(([kind, design]) => [kind, design[field.name]]);
  }

  buttons() {
    const { given, model } = this, old = { isOld: true };
    this.best = button("optimum", this.back(), "The final design", () => this.set(this.optimum));
    this.best.hidden = !this.optimum;
    this.undo = button("undo", "Undo", "Ctrl+Z", () => this.set(this.history.undo(), old));
    this.redo = button("redo", "Redo", "Ctrl+Shift+Z", () => this.set(this.history.redo(), old));
    const start = button("given", "Initial design", "The values in the file", () => this.set(this.given));
    start.hidden = !given;
    const link = button("link", "Copy link", "The address holds the design", () => this.copyLink());
    const save = button("save", "Save as TOML", "A problem file of this design, for laufruhe evaluate", () => this.save());
    save.hidden = !model.save.text;
    const made = [this.best, start, this.undo, this.redo, link, save];
    return element("div", { class: "live-buttons", role: "toolbar", "aria-label": "Designs" }, ...made);
  }

  /** Words of the button back to the final design. */
  back() {
    return this.reference?.isProven ? "Back to the optimum" : "Back to the best design";
  }

  choices() {
    const chosen = (key) => (k) => { this[key] = k; this.redraw(); };
    const titles = this.model.curves.map((curve) => curve.title);
    const curves = choice("Load shown", titles, this.curve, chosen("curve"));
    const points = choice("Operating point", this.model.points, this.point, chosen("point"));
    return element("div", { class: "live-choices" }, curves, points);
  }

  /** Create the figures of the selected load. */
  drawing() {
    const { model, point } = this, signal = model.signals[model.curves[this.curve]?.signal];
    if (!signal) return { compare() {}, update() {}, say() {} };
    const known = designsOf(model).map(({ x }) => x), was = keptOf(signal, point, this.markedAt());
    const forces = forcesOf(signal, was, this.root.clientWidth < 560 ? 430 : 860), orders = new Orders(signal, point, known);
    const legend = legendOf(signal);
    this.figures.replaceChildren(legend, ...[...forces, orders].map(boxOf));
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

  /** The reference design of the figures. */
  markedAt() {
    return vectorOf(this.model, this.optimum ?? this.given);
  }

  redraw() {
    this.draw = this.drawing();
    this.drawNow();
    this.draw.say(this.found.x);
  }

  notes() {
    const { model } = this, hasSliders = model.sliders.length > 0;
    const kept = this.optimum
      ? "the final design, as do rings on the sliders; bars on the sliders show the initial design"
      : "the initial design, as do bars on the sliders";
    const notes = [
      model.whyNot,
      this.given && hasSliders && `Thin grey lines and black marks show ${kept}.`,
      ...grouped(model.unmoved).map(({ names, why }) => `${names.join(", ")}: ${why}.`),
      !model.save.text && hasSliders && model.save.note,
    ].filter(Boolean);
    this.accuracy = element("p", { "data-role": "accuracy" });
    return element("div", { class: "live-notes" }, ...notes.map((text) => element("p", {}, text)), this.accuracy);
  }

  /** Check the page's numbers against those of the model. */
  check() {
    this.error = difference(this.model);
    const size = this.error < 1e-15 ? "less than 1e-15" : exponential(this.error, 2);
    const words = [
      "This page computes its forces in the browser.",
      `At ${designsOf(this.model).length} designs they differ from the exact model by at most ${size} of their size.`,
      this.error > 1e-6 ? "This error is too large for the digits shown; use the numbers of laufruhe evaluate." : "",
    ];
    this.accuracy.textContent = words.join(" ").trim();
    return this.error;
  }

  // actions

  /** Change some values; the end of a drag is an undo step. */
  move(values, isLast) {
    this.set({ ...this.values, ...values }, { isPassing: !isLast });
  }

  /** Set a design and draw it at the next frame. */
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

  /** Update the address and the text for screen readers. */
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
    const found = judged(model, values, this.exact);
    this.found = found;
    this.sliders.forEach((slider) => slider.show(values[slider.field.name]));
    this.value.textContent = found.objective === null ? "" : this.told(found.objective);
    this.value.setAttribute("data-value", found.objective ?? "");
    this.showRegret(found);
    this.limits.update(found.limits);
    const told = (value, measure) => (value === null ? "cannot be followed live" : figure(value, measure));
    const ranks = found.ranks.map(({ measure, value }) => `${measure.name}: ${told(value, measure)}`);
    this.ranks.textContent = ranks.join("; ");
    this.undo.disabled = !this.history.canUndo;
    this.redo.disabled = !this.history.canRedo;
    this.draw.update(found.x);
  }

  showRegret({ objective }) {
    const { reference } = this, broken = this.standingSo(false);
    const isNothing = reference && reference.value <= 1e-9 * this.size;
    this.regret.classList.toggle("broken", broken.length > 0);
    const more = broken.length > 2 ? ` and ${broken.length - 2} more` : "";
    const limits = broken.length ? `Breaks ${broken.slice(0, 2).join(", ")}${more}. ` : "";
    const isUnknown = objective === null && this.model.objective.name;
    this.regret.textContent = this.withdrawn || limits + (isUnknown ? "The objective cannot be followed live." : "");
    this.regret.removeAttribute("data-value");
    if (this.withdrawn || !reference || objective === null) return;
    const isReference = this.optimum !== null && isSame(this.model, this.values, this.optimum);
    const at = { value: objective, isNothing, isReference, isBroken: broken.length > 0, unknown: this.standingSo(null) };
    this.regret.setAttribute("data-value", (objective - reference.value) / (isNothing ? 1 : reference.value));
    this.regret.textContent = limits + against(reference, (value) => this.told(value), at);
  }

  /** The objective in words; a rounding of the known designs is zero. */
  told(value) {
    return figure(value, this.model.objective, 4, this.size);
  }

  /** Names of limits that are kept (true), broken (false) or unknown (null). */
  standingSo(met) {
    return ofRole(this.model, "limit").filter((_, k) => this.found.limits[k].met === met).map((measure) => measure.name);
  }

  sentence() {
    const broken = this.standingSo(false), isKnown = !this.standingSo(null).length;
    const kept = this.found.limits.length ? `All limits${isKnown ? "" : " that can be followed"} are met.` : "";
    const limits = broken.length ? `Broken: ${broken.join(", ")}.` : kept;
    return `${this.model.objective.name} ${this.value.textContent}. ${limits}`;
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.target.type === "text") return;
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
    try {
      await navigator.clipboard.writeText(location.href);
      this.said.textContent = "The link is copied; it shows this design.";
    } catch {
      this.said.textContent = "The address of this page now shows this design: copy it from there.";
    }
  }

  save() {
    const name = `${this.model.name}-moved.toml`;
    download(this.text(), name);
    this.said.textContent = `${name} is saved. ${this.model.save.note}`;
  }

  // interface for the served page

  design() { return { ...this.values }; }
  setDesign(values, { quiet = false } = {}) { this.set({ ...this.values, ...values }, { quiet, isPassing: quiet }); }
  onDesign(callback) { this.listeners.push(callback); }
  text() { return savedText(this.model, this.values); }

  measures() {
    const { objective } = this.model, whole = { words: objective.name, value: this.found.objective, met: true };
    const limits = ofRole(this.model, "limit").map((measure, k) => {
      const { value, met } = this.found.limits[k];
      return { ...unitOf(measure), name: measure.name, words: measure.name, value, met };
    });
    return [{ ...unitOf(objective), name: "objective", ...whole }, ...limits];
  }

  /** True if some measures do not follow sliders. */
  get isAside() { return this.model.measures.some((measure) => !measure.followed); }

  /** Set values of the exact model for measures that do not follow. */
  setExact(exact) {
    this.exact = exact;
    this.askFrame();
  }

  /** Replace the comparison by this text until the next update. */
  withdraw(words) {
    this.withdrawn = words;
    this.root.classList.add("withdrawn");
    this.showRegret(this.found);
  }

  /** Set edges of limits, and values of constant ones. */
  setLimits(limits) {
    for (const { name, sides, value } of limits) {
      const measure = ofRole(this.model, "limit").find((own) => own.name === name);
      if (measure) Object.assign(measure, { sides }, measure.followed && measure.signal === null ? { value } : {});
    }
  }

  /**
   * Set limits, reference and design for other settings of the same loads, in one frame.
   * @param {{limits: object[], reference: {value: number, name: string, isProven: boolean} | null,
   *   decided: object | null, follows: boolean}} told limits, what designs are compared with, the final design,
   *   and whether it is shown
   */
  update({ limits, reference, decided, follows }) {
    this.withdrawn = "";
    this.root.classList.remove("withdrawn");
    this.setLimits(limits);
    this.reference = reference;
    this.optimum = decided && fitting(this.model, decided, this.optimum ?? this.given);
    this.sliders.forEach((slider) => slider.setMark("optimum", this.optimum?.[slider.field.name]));
    this.best.hidden = !this.optimum;
    this.best.textContent = this.back();
    this.isMoved = true;
    if (this.optimum && follows) this.set(this.optimum, { isPassing: true, quiet: true });
    this.askFrame();
  }

  /** Replace the model; values of common sliders stay. */
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

/**
 * Show a model in an element.
 * @returns {Promise<Page>}
 */
async function show(model, root) {
  return new Page(root).open(typeof model === "string" ? JSON.parse(model) : model);
}

window.laufruheLive = { show, element, drawn, download, NORMS, opened, measured, judged, rowsAt, savedText, number, typed };

const told = document.getElementById("live-model");
if (told) window.laufruheLive.page = show(told.textContent, document.getElementById("live"));
