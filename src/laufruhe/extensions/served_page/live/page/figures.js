// Figures of a page, created once and updated with the design.

const POINTS = 360;
// refinement of the samples in which maxima are sought (M6)
const FINER = 8;

/**
 * Drawing data of a load at one design: per place its rows at every step, mean and peak.
 * @returns {{length: number, places: {name: string, rows: Float64Array[], lengths: Float64Array, mean: number, most: number}[]}}
 */
function drawnOf(signal, k, x) {
  const [coarse, fine] = [1, FINER].map((times) => pointAt(signal, gridOf(signal, times).points[k], x).groups);
  const places = signal.places.map((name, place) => {
    const { lengths, rows } = coarse[place];
    let sum = 0;
    for (let i = 0; i < lengths.length; i++) sum += lengths[i];
    return { name, lengths, rows, mean: sum / lengths.length, most: largest(fine[place].lengths) };
  });
  return { length: gridOf(signal, 1).points[k].length, places };
}

/** A copy with its own arrays. */
function keptOf(signal, k, x) {
  const { length, places } = drawnOf(signal, k, x);
  const copied = ({ lengths, rows }) => ({ lengths: lengths.slice(), rows: rows.map((row) => row.slice()) });
  return { length, places: places.map((place) => ({ ...place, ...copied(place) })) };
}

/** Largest peak of two designs. */
function peakOf(now, was) {
  return Math.max(largest(now.places.map((place) => place.most)), largest(was.places.map((place) => place.most)));
}

/** A figure of a design and a reference, which is redrawn when it or the scale changes. */
class Compared {
  constructor(signal, was, key, title) {
    Object.assign(this, { signal, was, key, title, scale: new Scale(), isNew: true });
  }

  compare(was) {
    this.was = was;
    this.isNew = true;
  }

  /** Return true if the reference or the scale must be redrawn. */
  follow(now) {
    const isNew = this.scale.follow(peakOf(now, this.was)) || this.isNew;
    this.isNew = false;
    return isNew;
  }
}

/** Tips of forces, seen from the front: a panel for every place. */
class Polar extends Compared {
  constructor(signal, was) {
    super(signal, was, "polar", "Path of the tip over one cycle, seen from the front");
    this.panels = signal.places.map((name, place) => this.panel(name, place));
    this.root = element("div", { class: "live-polars" }, ...this.panels.map((panel) => panel.root));
  }

  panel(name, place) {
    const svg = picture(200, 200, "");
    const was = line("was"), now = line(`now ${colour(place)}`);
    const start = drawn("circle", { r: 3.4, class: `dot ${colour(place)}` }), tick = label(198, 16, "", "end");
    for (const r of [45, 90]) svg.append(drawn("circle", { cx: 100, cy: 100, r, class: "grid" }));
    svg.append(drawn("path", { d: "M10 100H190M100 10V190", class: "axis" }), was, now, start, tick);
    const root = element("figure", { class: "live-polar" }, svg, element("figcaption", {}, name));
    return { svg, was, now, start, tick, name, root };
  }

  update(now) {
    const isNew = this.follow(now), { top } = this.scale;
    this.panels.forEach((panel, k) => {
      const [y, z] = this.across(now.places[k]);
      panel.now.setAttribute("d", this.path(now.places[k], now.length));
      panel.start.setAttribute("transform", `translate(${100 + (90 * y[0]) / top} ${100 - (90 * z[0]) / top})`);
      if (!isNew) return;
      panel.was.setAttribute("d", this.path(this.was.places[k], this.was.length));
      panel.tick.textContent = figure(top, this.signal, 2);
    });
  }

  say(now) {
    this.panels.forEach(({ svg, name }, k) => {
      const [mean, most] = [now.places[k].mean, now.places[k].most].map((value) => figure(value, this.signal));
      svg.setAttribute("aria-label", `Path of the force on ${name}: mean ${mean}, maximum ${most}.`);
    });
  }

  /** Components to the left and up. */
  across(place) {
    return place.rows.slice(-2);
  }

  path(place, length) {
    const [y, z] = this.across(place), step = thinned(length, POINTS), share = 90 / this.scale.top;
    return pathOf(Math.floor(length / step), (i) => 100 + share * y[i * step], (i) => 100 - share * z[i * step], true);
  }
}

/** Magnitude over the crank angle, a line per place; a single component with its sign. */
class OverAngle extends Compared {
  constructor(signal, was, width) {
    super(signal, was, "angle", `${signal.parts > 1 ? "Size" : "Value"} over the crank angle [${signal.shown}]`);
    Object.assign(this, { wide: width - 64, isSigned: signal.parts === 1 });
    this.root = picture(width, 304, "");
    this.lines = signal.places.map((_, k) => line(`now ${colour(k)}`));
    this.before = line("was");
    this.top = label(46, 18, "", "end");
    const zero = label(46, this.y(0) + 4, "0", "end"), grid = drawn("g", { class: "grid" }), most = 360 / signal.base;
    for (let k = 0; k <= 4; k++) {
      const x = 52 + (this.wide * k) / 4;
      grid.append(drawn("path", { d: `M${x} 12V264` }), label(x, 280, trimmed((most * k) / 4)));
    }
    grid.append(drawn("path", { d: `M52 ${this.y(0)}h${this.wide}M52 ${this.y(1)}h${this.wide}`, class: "axis" }));
    this.root.append(grid, label(52 + this.wide / 2, 297, "crank angle [°]"), this.top, zero, this.before, ...this.lines);
  }

  /** Height of a share of the largest. */
  y(share) {
    return this.isSigned ? 138 - 124 * share : 262 - 248 * share;
  }

  update(now) {
    const isNew = this.follow(now);
    this.lines.forEach((own, k) => own.setAttribute("d", this.path(now.places[k], now.length)));
    if (!isNew) return;
    this.top.textContent = number(this.scale.top * this.signal.factor, 2);
    this.before.setAttribute("d", this.was.places.length === 1 ? this.path(this.was.places[0], this.was.length) : "");
  }

  say(now) {
    const most = now.places.reduce((a, b) => (b.most > a.most ? b : a));
    const words = `${this.signal.name} over the crank angle, at most ${figure(most.most, this.signal)} (${most.name}).`;
    this.root.setAttribute("aria-label", words);
  }

  path(place, length) {
    const values = this.isSigned ? place.rows[0] : place.lengths, step = thinned(length, POINTS);
    const { top } = this.scale, wide = (this.wide * step) / length;
    return pathOf(Math.floor(length / step) + 1, (i) => 52 + wide * i, (i) => this.y(values[(i * step) % length] / top));
  }
}

/** Mean and maximum of every place, the optimum's marked. */
class Bars extends Compared {
  constructor(signal, was) {
    super(signal, was, "bars", "Mean (dark) and maximum (light) over one cycle");
    const height = 16 + 30 * signal.places.length;
    this.root = picture(420, height + 20, "");
    this.rows = signal.places.map((name, k) => this.row(name, k));
    this.top = label(410, height + 14, "", "end");
    this.root.append(drawn("path", { d: `M120 8V${height}`, class: "axis" }), this.top);
  }

  row(name, k) {
    const y = 12 + 30 * k, most = drawn("rect", { x: 120, y, height: 20, class: `most ${colour(k)}` });
    const mean = drawn("rect", { x: 120, y: y + 3, height: 14, class: `mean ${colour(k)}` });
    const marks = [drawn("path", { class: "mark" }), drawn("path", { class: "mark" })];
    const short = name.length > 17 ? `${name.slice(0, 16)}…` : name;
    this.root.append(label(112, y + 14, short, "end", "name"), most, mean, ...marks);
    return { most, mean, marks, y };
  }

  update(now) {
    const isNew = this.follow(now), x = (value) => ((290 * value) / this.scale.top).toFixed(1);
    this.rows.forEach((row, k) => {
      row.most.setAttribute("width", x(now.places[k].most));
      row.mean.setAttribute("width", x(now.places[k].mean));
      if (!isNew) return;
      const { mean, most } = this.was.places[k];
      [mean, most].forEach((value, j) => row.marks[j].setAttribute("d", `M${120 + Number(x(value))} ${row.y - 3}v26`));
    });
    if (isNew) this.top.textContent = figure(this.scale.top, this.signal, 2);
  }

  say(now) {
    const told = (value) => figure(value, this.signal);
    const words = now.places.map(({ name, mean, most }) => `${name}: mean ${told(mean)}, maximum ${told(most)}`);
    this.root.setAttribute("aria-label", `${words.join("; ")}.`);
  }
}

const MOST_ORDERS = 12;

/** Amplitudes of the largest orders of all known designs, a bar per place. */
class Orders {
  constructor(signal, k, designs) {
    Object.assign(this, { signal, point: signal.points[k], scale: new Scale() });
    Object.assign(this, { key: "orders", title: `Amplitude by order [${signal.shown}]` });
    this.orders = this.counted(designs);
    this.root = picture(420, 194, "");
    this.width = 360 / this.orders.length;
    this.bars = this.orders.map((order, j) => this.column(order, j));
    this.top = label(4, 12, "", "start");
    this.root.append(drawn("path", { d: "M44 160H410", class: "axis" }), this.top, label(227, 188, "order of crank speed"));
  }

  /** The largest orders above a share of the largest amplitude. */
  counted(designs) {
    const { signal, point } = this, all = ordersOf(signal, point), share = all.map(() => 0);
    for (const x of designs) {
      const own = signal.places.map((_, place) => amplitudesAt(signal, point, place, x, all)), top = largest(own.map(largest));
      all.forEach((_, j) => { share[j] = Math.max(share[j], largest(own.map((place) => place[j])) / (top || 1)); });
    }
    const felt = all.map((order, j) => [order, share[j]]).filter(([, value]) => value > 0.01);
    return felt.sort((p, q) => q[1] - p[1]).slice(0, MOST_ORDERS).map(([order]) => order).sort((p, q) => p - q);
  }

  column(order, j) {
    const left = 48 + this.width * j, each = (0.8 * this.width) / this.signal.places.length;
    this.root.append(label(left + 0.4 * this.width, 174, trimmed(order)));
    return this.signal.places.map((_, place) => {
      const where = { x: left + each * place, width: Math.max(each - 0.6, 0.8) };
      const bar = drawn("rect", { ...where, class: `mean ${colour(place)}` });
      this.root.append(bar);
      return bar;
    });
  }

  update(x) {
    this.found = this.signal.places.map((_, place) => amplitudesAt(this.signal, this.point, place, x, this.orders));
    const isNew = this.scale.follow(largest(this.found.map(largest)));
    this.orders.forEach((_, j) => this.bars[j].forEach((bar, place) => {
      const height = ((146 * this.found[place][j]) / this.scale.top).toFixed(1);
      bar.setAttribute("y", 160 - height);
      bar.setAttribute("height", height);
    }));
    if (isNew) this.top.textContent = number(this.scale.top * this.signal.factor, 2);
  }

  say() {
    const most = (j) => figure(largest(this.found.map((own) => own[j])), this.signal);
    const words = this.orders.map((order, j) => `order ${trimmed(order)}: ${most(j)}`);
    this.root.setAttribute("aria-label", `Largest amplitudes. ${words.join("; ")}.`);
  }
}

/** Figures of a load; with a path for a force or a couple across the crank. */
function forcesOf(signal, was, width) {
  const isPath = signal.parts > 1 && signal.unit.startsWith("N");
  return [...(isPath ? [new Polar(signal, was)] : []), new OverAngle(signal, was, width), new Bars(signal, was)];
}

/** Names of the places in their colours. */
function legendOf(signal) {
  const names = signal.places.map((name, k) => element("span", { class: colour(k) }, name));
  const made = element("p", { class: "live-legend", "aria-hidden": "true" }, ...names);
  made.hidden = names.length < 2;
  return made;
}

/** A figure with its title. */
function boxOf({ key, title, root }) {
  return element("figure", { "data-figure": key, class: `live-figure ${key}` }, element("figcaption", {}, title), root);
}
