// Loads over the cycle: constant + slope x, order by order, at the sample angles of results.

const TURN = 2 * Math.PI;

/**
 * Numbers of a model, deflated as float64.
 * @param {string} text base64
 * @returns {Promise<Float64Array>}
 */
async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Float64Array(await new Response(stream).arrayBuffer());
}

/** An array of the block by offset and shape. */
function arrayOf(block, [start, shape]) {
  return { values: block.subarray(start, start + shape.reduce((a, b) => a * b, 1)), shape };
}

/** Orders and their coefficients, (orders, places, d, ..., 2). */
function wavesOf(block, waves) {
  const { values, shape } = arrayOf(block, waves.coefficients);
  return { orders: arrayOf(block, waves.orders).values, values, shape };
}

/** A smooth series, and polynomials between kinks. */
function bendsOf(block, bends) {
  return {
    smooth: wavesOf(block, bends.smooth),
    corners: arrayOf(block, bends.corners).values,
    pieces: arrayOf(block, bends.pieces),
    at: arrayOf(block, bends.at).values,
  };
}

/**
 * A signal with its numbers.
 * @returns what JSON tells of it, the numbers of every point, and its counts of places, components and columns
 */
function decoded(signal, block) {
  const points = signal.points.map((point) => ({
    share: point.share,
    series: wavesOf(block, point.series),
    slope: wavesOf(block, point.slope),
    bends: point.bends && bendsOf(block, point.bends),
    bent: point.bent.map(([column, bends]) => ({ column, ...bendsOf(block, bends) })),
  }));
  const [, places, parts, columns] = points[0].slope.shape;
  return { ...signal, points, places: signal.places, count: places, parts, columns, grids: new Map() };
}

/** Sum over j of c_j e^(2 pi i j k / n), the real part, for all k. */
function summed(orders, coefficient, n) {
  const re = new Float64Array(n), im = new Float64Array(n);
  let any = false;
  for (let j = 0; j < orders.length; j++) {
    const [a, b] = coefficient(j);
    if (a === 0 && b === 0) continue;
    any = true;
    re[orders[j] % n] += a;
    im[orders[j] % n] += b;
  }
  return any ? transformed(re, im)[0] : null;
}

/** Length up to which a transform is summed directly. */
const SHORT = 32;

/** Discrete Fourier transform with e^(+), of any length, by the smallest factors first. */
function transformed(re, im) {
  const n = re.length, p = factorOf(n);
  if (n <= SHORT || p === n) return summedUp(re, im);
  const m = n / p, parts = [];
  for (let q = 0; q < p; q++) {
    const a = new Float64Array(m), b = new Float64Array(m);
    for (let k = 0, from = q; k < m; k++, from += p) { a[k] = re[from]; b[k] = im[from]; }
    parts.push(transformed(a, b));
  }
  return joined(parts, n, m);
}

/** A transform by direct summation. */
function summedUp(re, im) {
  const n = re.length, { cosine, sine } = tableOf(n);
  const out = [new Float64Array(n), new Float64Array(n)];
  for (let k = 0; k < n; k++) {
    let a = 0, b = 0;
    for (let j = 0, turn = 0; j < n; j++) {
      a += re[j] * cosine[turn] - im[j] * sine[turn];
      b += re[j] * sine[turn] + im[j] * cosine[turn];
      turn += k;
      if (turn >= n) turn -= n;
    }
    out[0][k] = a;
    out[1][k] = b;
  }
  return out;
}

/** Combine the parts of a transform. */
function joined(parts, n, m) {
  const { cosine, sine } = tableOf(n);
  const re = new Float64Array(n), im = new Float64Array(n);
  for (let q = 0; q < parts.length; q++) {
    const [x, y] = parts[q];
    for (let k = 0, at = 0, turn = 0; k < n; k++) {
      re[k] += x[at] * cosine[turn] - y[at] * sine[turn];
      im[k] += x[at] * sine[turn] + y[at] * cosine[turn];
      if (++at === m) at = 0;
      turn += q;
      if (turn >= n) turn -= n;
    }
  }
  return [re, im];
}

/** The smallest factor of a whole number. */
function factorOf(n) {
  for (let p = 2; p * p <= n; p++) if (n % p === 0) return p;
  return n;
}

const tables = new Map();

/** Cosine and sine of k turns over n. */
function tableOf(n) {
  if (!tables.has(n)) {
    const cosine = new Float64Array(n), sine = new Float64Array(n);
    for (let k = 0; k < n; k++) { cosine[k] = Math.cos((TURN * k) / n); sine[k] = Math.sin((TURN * k) / n); }
    tables.set(n, { cosine, sine });
  }
  return tables.get(n);
}

/**
 * Prepare the rows of a signal at refined steps, and at possible peaks between them.
 * @returns per point the constant by place and component (null where it is nothing), and waves of the slope
 */
function gridOf(signal, times) {
  const key = signal.adds ? 1 : times;
  if (!signal.grids.has(key)) {
    const steps = signal.samples * key;
    signal.grids.set(key, { steps, points: signal.points.map((point) => pointGrid(signal, point, steps, key > 1)) });
  }
  return signal.grids.get(key);
}

function pointGrid(signal, point, steps, isFine) {
  const bends = isFine ? point.bends : null;
  const between = bends ? bends.at : new Float64Array(0);
  const length = steps + between.length;
  const parts = Array.from({ length: signal.count * signal.parts }, (_, at) => at);
  const constant = parts.map((at) => constantOf(signal, point, bends, at, steps, between));
  const bent = (isFine ? point.bent : []).map((own) => {
    return { column: own.column, rows: parts.map((at) => constantOf(signal, point, own, at, steps, between)) };
  });
  const waves = Array.from(point.slope.orders, (order) => waveOf(order, signal.base, steps, between));
  return { share: point.share, length, constant, bent, waves, point };
}

/** Constant part of one component, at equal steps and at the angles between. */
function constantOf(signal, point, bends, at, steps, between) {
  const waves = bends ? bends.smooth : point.series;
  const stride = signal.count * signal.parts;
  const coefficient = (j) => [waves.values[2 * (j * stride + at)], waves.values[2 * (j * stride + at) + 1]];
  const own = summed(waves.orders, coefficient, steps);
  if (!own && !bends) return null;
  const out = new Float64Array(steps + between.length);
  if (own) out.set(own);
  for (let k = 0; k < between.length; k++) {
    for (let j = 0; j < waves.orders.length; j++) {
      const angle = waves.orders[j] * signal.base * between[k], [a, b] = coefficient(j);
      out[steps + k] += a * Math.cos(angle) - b * Math.sin(angle);
    }
  }
  if (bends) addCorners(out, signal, bends, at, steps, between);
  return out;
}

/** A step on a jump is read this angle behind it [rad]. */
const BEHIND = 1e-13;

/** Add the polynomials between the kinks (L5a). */
function addCorners(out, signal, bends, at, steps, between) {
  const period = TURN / signal.base, [powers, corners] = bends.pieces.shape, stride = signal.count * signal.parts;
  const piece = (power, k) => bends.pieces.values[(power * corners + k) * stride + at];
  for (let k = 0; k < corners; k++) {
    const factors = Array.from({ length: powers }, (_, power) => piece(power, k));
    if (factors.every((factor) => factor === 0)) continue;
    for (let i = 0; i < out.length; i++) {
      const angle = i < steps ? (period * i) / steps + BEHIND : between[i - steps];
      const turns = (angle - bends.corners[k]) / period, x = turns - Math.floor(turns) - 0.5;
      let value = 0;
      for (let power = powers - 1; power >= 0; power--) value = value * x + factors[power];
      out[i] += value;
    }
  }
}

/** Cosine and sine of one order at equal steps and at the angles between. */
function waveOf(order, base, steps, between) {
  const { cosine, sine } = tableOf(steps), length = steps + between.length;
  const out = { cosine: new Float64Array(length), sine: new Float64Array(length) };
  for (let i = 0, at = 0; i < steps; i++, at = (at + order) % steps) {
    out.cosine[i] = cosine[at];
    out.sine[i] = sine[at];
  }
  for (let k = 0; k < between.length; k++) {
    out.cosine[steps + k] = Math.cos(order * base * between[k]);
    out.sine[steps + k] = Math.sin(order * base * between[k]);
  }
  return out;
}

/** Coefficient of one order of the slope times x: real and imaginary part of a component. */
function slopeAt(signal, point, j, at, x) {
  const { values } = point.slope;
  let from = 2 * (j * signal.count * signal.parts + at) * signal.columns, a = 0, b = 0;
  for (let column = 0; column < signal.columns; column++, from += 2) {
    a += values[from] * x[column];
    b += values[from + 1] * x[column];
  }
  return [a, b];
}

/** Write one component of a point's rows at x into `out`; return false if it is zero. */
function component(signal, own, at, x, out) {
  const constant = own.constant[at];
  let any = constant !== null;
  if (constant) out.set(constant); else out.fill(0);
  let smooth = x;
  for (const { column, rows } of own.bent) {
    const row = rows[at], by = x[column];
    if (smooth === x) smooth = x.slice();
    smooth[column] = 0;
    if (!row || by === 0) continue;
    any = true;
    for (let i = 0; i < own.length; i++) out[i] += by * row[i];
  }
  for (let j = 0; j < own.waves.length; j++) {
    const [a, b] = slopeAt(signal, own.point, j, at, smooth);
    if (a === 0 && b === 0) continue;
    const { cosine, sine } = own.waves[j];
    any = true;
    for (let i = 0; i < own.length; i++) out[i] += a * cosine[i] - b * sine[i];
  }
  return any;
}

/**
 * Rows of a signal at x, in arrays that the next call overwrites.
 * @returns {{adds: boolean, points: {share: number, groups: {lengths: Float64Array, rows: Float64Array[]}[]}[]}}
 */
function rowsAt(signal, times, x) {
  return { adds: signal.adds, points: gridOf(signal, times).points.map((own) => pointAt(signal, own, x)) };
}

/** Rows of one operating point, computed once per design. */
function pointAt(signal, own, x) {
  if (own.x === x) return own;
  own.x = x;
  own.groups ??= signal.places.map(() => groupOf(signal, own.length));
  own.groups.forEach((group, place) => fill(signal, own, place, x, group));
  return own;
}

/** Arrays of one place. */
function groupOf(signal, length) {
  return { lengths: new Float64Array(length), rows: Array.from({ length: signal.parts }, () => new Float64Array(length)) };
}

/** Components and lengths of one place at x. */
function fill(signal, own, place, x, { lengths, rows }) {
  let used = 0;
  for (let part = 0; part < signal.parts; part++) {
    const row = rows[part];
    if (!component(signal, own, place * signal.parts + part, x, row)) continue;
    if (used++ === 0) for (let i = 0; i < own.length; i++) lengths[i] = row[i] * row[i];
    else for (let i = 0; i < own.length; i++) lengths[i] += row[i] * row[i];
  }
  if (used === 0) lengths.fill(0);
  for (let i = 0; i < own.length; i++) lengths[i] = Math.sqrt(lengths[i]);
}

/** Index of an order among waves, or -1. */
function waveNumber(signal, waves, order) {
  return waves.orders.findIndex((own) => Math.abs(own * signal.base - order) < 1e-9);
}

/** Non-zero orders of a point. */
function ordersOf(signal, point) {
  return [...new Set([...point.series.orders, ...point.slope.orders])].map((order) => order * signal.base);
}

/**
 * Amplitude of orders at a place, the long half axis of the ellipse that the vector turns on (M5).
 * @returns {number[]}
 */
function amplitudesAt(signal, point, place, x, orders) {
  const stride = signal.count * signal.parts, { series, slope } = point;
  return orders.map((order) => {
    const [j, k] = [series, slope].map((waves) => waveNumber(signal, waves, order));
    const c = new Float64Array(2 * signal.parts);
    for (let part = 0; part < signal.parts; part++) {
      const at = place * signal.parts + part, [a, b] = k < 0 ? [0, 0] : slopeAt(signal, point, k, at, x);
      const from = 2 * (j * stride + at);
      c[2 * part] = a + (j < 0 ? 0 : series.values[from]);
      c[2 * part + 1] = b + (j < 0 ? 0 : series.values[from + 1]);
    }
    return longAxis(c);
  });
}

function longAxis(c) {
  let total = 0, re = 0, im = 0;
  for (let k = 0; k < c.length; k += 2) {
    total += c[k] * c[k] + c[k + 1] * c[k + 1];
    re += c[k] * c[k] - c[k + 1] * c[k + 1];
    im += 2 * c[k] * c[k + 1];
  }
  return Math.sqrt(0.5 * (total + Math.hypot(re, im)));
}
