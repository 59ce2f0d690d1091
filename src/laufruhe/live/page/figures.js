// The figures of a page. Each is made once, and follows a design by `update`.

const POINTS = 360;

/**
 * What is drawn of a curve at one design: per place its rows at every step, means and peaks.
 * @returns {{length: number, places: {name: string, rows: Float64Array[], lengths: Float64Array, mean: number, most: number}[]}}
 */
function drawnOf(signal, k, x) {
  const coarse = gridOf(signal, 1).points[k], fine = gridOf(signal, 8).points[k];
  const places = signal.places.map((name, place) => {
    const own = groupAt(signal, coarse, place, x);
    const mean = own.lengths.reduce((sum, value) => sum + value, 0) / own.lengths.length;
    return { name, ...own, mean, most: largest(groupAt(signal, fine, place, x).lengths) };
  });
  return { length: coarse.length, places };
}

/** Tips of forces, seen from the front: a panel for every place. */
class Polar {
  constructor(signal) {
    this.scale = new Scale();
    this.signal = signal;
    this.panels = signal.places.map((name, place) => this.panel(name, place));
    this.root = element("div", { class: "live-polars" }, ...this.panels.map((panel) => panel.root));
  }

  panel(name, place) {
    const svg = picture(200, 200, "");
    const was = drawn("path", { class: "was" }), now = drawn("path", { class: `now ${colour(place)}` });
    const start = drawn("circle", { r: 3.4, class: `dot ${colour(place)}` }), tick = label(194, 94, "", "end");
    for (const r of [45, 90]) svg.append(drawn("circle", { cx: 100, cy: 100, r, class: "grid" }));
    svg.append(drawn("path", { d: "M10 100H190M100 10V190", class: "axis" }), was, now, start, tick);
    return { svg, was, now, start, tick, name, root: element("figure", { class: "live-polar" }, svg, element("figcaption", {}, name)) };
  }

  update(now, was) {
    const top = this.scale.of(largest([...now.places, ...was.places].map((place) => place.most)));
    this.panels.forEach((panel, k) => {
      panel.now.setAttribute("d", this.path(now.places[k], now.length, top));
      panel.was.setAttribute("d", this.path(was.places[k], was.length, top));
      const [y, z] = this.across(now.places[k]);
      panel.start.setAttribute("cx", 100 + (90 * y[0]) / top);
      panel.start.setAttribute("cy", 100 - (90 * z[0]) / top);
      panel.tick.textContent = figure(top, this.signal, 2);
      const { mean, most } = now.places[k];
      panel.svg.setAttribute("aria-label", `Path of the force on ${panel.name}: mean ${figure(mean, this.signal)}, maximum ${figure(most, this.signal)}.`);
    });
  }

  /** Components to the left and up; of two these. */
  across(place) {
    return place.rows.slice(-2);
  }

  path(place, length, top) {
    const [y, z] = this.across(place), step = thinned(length, POINTS), count = Math.floor(length / step);
    return pathOf(count, (i) => 100 + (90 * y[i * step]) / top, (i) => 100 - (90 * z[i * step]) / top, true);
  }
}

/** Size over the crank angle, a line for every place; of one component with its sign. */
class OverAngle {
  constructor(signal, turns) {
    this.scale = new Scale();
    this.signal = signal;
    this.isSigned = signal.parts === 1;
    this.svg = picture(640, 250, "");
    this.lines = signal.places.map((_, k) => drawn("path", { class: `now ${colour(k)}` }));
    this.was = drawn("path", { class: "was" });
    this.top = label(44, 18, "", "end");
    this.middle = label(44, this.y(0) + 4, "0", "end");
    const grid = drawn("g", { class: "grid" });
    const most = 360 * turns / signal.base / turns;
    for (let k = 0; k <= 4; k++) {
      const x = 52 + (576 * k) / 4;
      grid.append(drawn("path", { d: `M${x} 12V214` }), label(x, 230, trimmed((most * k) / 4)));
    }
    grid.append(drawn("path", { d: `M52 ${this.y(0)}H628M52 ${this.y(1)}H628`, class: "axis" }));
    this.svg.append(grid, label(340, 247, "crank angle [deg]"), this.top, this.middle, this.was, ...this.lines);
    this.root = this.svg;
  }

  /** Height of a share of the largest. */
  y(share) {
    return this.isSigned ? 113 - 99 * share : 212 - 198 * share;
  }

  update(now, was) {
    const top = this.scale.of(largest([...now.places, ...was.places].map((place) => place.most)));
    this.top.textContent = number(top * this.signal.factor, 2);
    this.lines.forEach((line, k) => line.setAttribute("d", this.path(now.places[k], now.length, top)));
    this.was.setAttribute("d", was.places.length === 1 ? this.path(was.places[0], was.length, top) : "");
    const most = now.places.reduce((a, b) => (b.most > a.most ? b : a));
    this.svg.setAttribute("aria-label", `${this.signal.name} over the crank angle, at most ${figure(most.most, this.signal)} (${most.name}).`);
  }

  path(place, length, top) {
    const values = this.isSigned ? place.rows[0] : place.lengths, step = thinned(length, 2 * POINTS), count = Math.floor(length / step) + 1;
    return pathOf(count, (i) => 52 + (576 * i * step) / length, (i) => this.y(values[(i * step) % length] / top));
  }
}

/** Mean and maximum of every place, the optimum's marked. */
class Bars {
  constructor(signal) {
    this.signal = signal;
    this.scale = new Scale();
    const height = 16 + 30 * signal.places.length;
    this.svg = picture(420, height + 20, "");
    this.rows = signal.places.map((name, k) => this.row(name, k));
    this.top = label(410, height + 14, "", "end");
    this.svg.append(drawn("path", { d: `M120 8V${height}`, class: "axis" }), this.top);
    this.root = this.svg;
  }

  row(name, k) {
    const y = 12 + 30 * k, [most, mean] = ["most", "mean"].map((kind) => drawn("rect", { x: 120, y: kind === "most" ? y : y + 3, height: kind === "most" ? 20 : 14, class: `${kind} ${colour(k)}` }));
    const marks = [drawn("path", { class: "mark" }), drawn("path", { class: "mark" })];
    const short = name.length > 17 ? `${name.slice(0, 16)}…` : name;
    this.svg.append(label(112, y + 14, short, "end", "name"), most, mean, ...marks);
    return { most, mean, marks, y };
  }

  update(now, was) {
    const top = this.scale.of(largest([...now.places, ...was.places].map((place) => place.most)));
    const x = (value) => (290 * value) / top;
    this.rows.forEach((row, k) => {
      row.most.setAttribute("width", x(now.places[k].most).toFixed(2));
      row.mean.setAttribute("width", x(now.places[k].mean).toFixed(2));
      [was.places[k].mean, was.places[k].most].forEach((value, j) => row.marks[j].setAttribute("d", `M${(120 + x(value)).toFixed(2)} ${row.y - 3}v26`));
    });
    this.top.textContent = figure(top, this.signal, 2);
    const words = now.places.map((place) => `${place.name}: mean ${figure(place.mean, this.signal)}, maximum ${figure(place.most, this.signal)}`);
    this.svg.setAttribute("aria-label", `${words.join("; ")}.`);
  }
}

const MOST_ORDERS = 12;

/** Amplitude of every order that counts in one of the designs known, a bar for every place. */
class Orders {
  constructor(signal, k, designs) {
    this.signal = signal;
    this.point = signal.points[k];
    this.scale = new Scale();
    this.orders = this.counted(designs);
    this.svg = picture(420, 190, "");
    this.width = 360 / this.orders.length;
    this.bars = this.orders.map((order, j) => this.column(order, j));
    this.top = label(40, 20, "", "end");
    this.svg.append(drawn("path", { d: "M44 160H410", class: "axis" }), this.top, label(227, 186, "order of crank speed"));
    this.root = this.svg;
  }

  counted(designs) {
    const most = new Map();
    for (const x of designs) {
      this.signal.places.forEach((_, place) => {
        for (const [order, value] of amplitudesAt(this.signal, this.point, place, x)) most.set(order, Math.max(value, most.get(order) ?? 0));
      });
    }
    const top = largest(most.values()), felt = [...most].filter(([, value]) => value > 0.01 * top);
    return felt.sort((a, b) => b[1] - a[1]).slice(0, MOST_ORDERS).map(([order]) => order).sort((a, b) => a - b);
  }

  column(order, j) {
    const left = 48 + this.width * j, each = (0.8 * this.width) / this.signal.places.length;
    this.svg.append(label(left + 0.4 * this.width, 174, trimmed(order)));
    return this.signal.places.map((_, place) => {
      const bar = drawn("rect", { x: left + each * place, width: Math.max(each - 0.6, 0.8), class: `mean ${colour(place)}` });
      this.svg.append(bar);
      return bar;
    });
  }

  update(x) {
    const found = this.signal.places.map((_, place) => amplitudesAt(this.signal, this.point, place, x));
    const value = (order, place) => found[place].get(order) ?? 0;
    const most = this.orders.map((order) => largest(found.map((_, place) => value(order, place))));
    const top = this.scale.of(largest(most));
    this.orders.forEach((order, j) => this.bars[j].forEach((bar, place) => {
      const height = (146 * value(order, place)) / top;
      bar.setAttribute("y", (160 - height).toFixed(2));
      bar.setAttribute("height", height.toFixed(2));
    }));
    this.top.textContent = number(top * this.signal.factor, 2);
    const words = this.orders.map((order, j) => `order ${trimmed(order)}: ${figure(most[j], this.signal)}`);
    this.svg.setAttribute("aria-label", `Largest amplitudes. ${words.join("; ")}.`);
  }
}
