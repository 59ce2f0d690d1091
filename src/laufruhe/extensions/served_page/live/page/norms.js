// Norms of rows by their names in problem files: functions of the result of `rowsAt`.

/** Sum of a function over all lengths of a point. */
function total(point, of) {
  let sum = 0;
  for (const { lengths } of point.groups) for (let i = 0; i < lengths.length; i++) sum += of(lengths[i]);
  return sum;
}

/** Number of rows of a point. */
function size(point) {
  return point.groups.reduce((sum, group) => sum + group.lengths.length, 0);
}

/** Sum over all rows, each by its weight: masses add up, loads are averaged. */
function weighted(rows, of) {
  return rows.points.reduce((sum, point) => {
    if (point.share === 0) return sum;
    return sum + (rows.adds ? total(point, of) : (point.share / size(point)) * total(point, of));
  }, 0);
}

/** Points with a positive share. */
function counted(rows) {
  return rows.points.filter((point) => point.share > 0);
}

/** Largest number; 0 for an empty list. */
function largest(numbers) {
  let most = 0;
  for (const value of numbers) if (value > most) most = value;
  return most;
}

/** Twice the radius of the smallest ball that holds a signal. */
function diameter({ rows }) {
  const used = rows.filter((row) => row.some((value) => value !== 0));
  if (used.length === 0) return 0;
  if (used.length > 1) return 2 * ballOf(used);
  let low = Infinity, high = -Infinity;
  for (const value of used[0]) { if (value < low) low = value; if (value > high) high = value; }
  return high - low;
}

const distance = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

/** Index of the point farthest from a centre; rows are components. */
function farthest(rows, centre) {
  let best = 0, most = -1;
  for (let i = 0; i < rows[0].length; i++) {
    let square = 0;
    for (let k = 0; k < rows.length; k++) square += (rows[k][i] - centre[k]) ** 2;
    if (square > most) { most = square; best = i; }
  }
  return best;
}

/** Radius of the smallest enclosing ball: add the farthest point to the support until none is outside. */
function ballOf(rows) {
  const at = (i) => rows.map((row) => row[i]);
  let held = [at(0)], ball = { centre: at(0), radius: 0 };
  for (let round = 0; round < rows[0].length; round++) {
    const far = at(farthest(rows, ball.centre));
    if (distance(far, ball.centre) <= ball.radius * (1 + 1e-13)) break;
    if (held.some((point) => distance(point, far) === 0)) break;
    [held, ball] = ballOfFew([...held, far]);
  }
  return ball.radius;
}

/** Smallest enclosing ball of few points: that of a subset which encloses all. */
function ballOfFew(few) {
  let best = null;
  for (let mask = 1; mask < 1 << few.length; mask++) {
    const chosen = few.filter((_, k) => mask & (1 << k));
    if (chosen.length < 2 || chosen.length > few[0].length + 1) continue;
    const centre = centreOf(chosen);
    if (!centre) continue;
    const radius = Math.max(...chosen.map((point) => distance(point, centre)));
    const outside = Math.max(...few.map((point) => distance(point, centre)));
    if (outside <= radius * (1 + 1e-12) && (!best || radius < best[1].radius)) {
      best = [chosen, { centre, radius: Math.max(radius, outside) }];
    }
  }
  return best ?? [few, { centre: few[0], radius: Math.max(...few.map((point) => distance(point, few[0]))) }];
}

/** Circumcentre of points in the plane that they span; null if it lies outside them. */
function centreOf(points) {
  const apart = points.slice(1).map((point) => point.map((value, k) => value - points[0][k]));
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
  const shares = solved(apart.map((a) => apart.map((b) => 2 * dot(a, b))), apart.map((a) => dot(a, a)));
  if (!shares) return null;
  const first = 1 - shares.reduce((a, b) => a + b, 0);
  if (Math.min(first, ...shares) < -1e-9) return null;
  return points[0].map((value, k) => value + apart.reduce((sum, a, j) => sum + shares[j] * a[k], 0));
}

/** Solve a small linear system by elimination; null if singular. */
function solved(matrix, right) {
  const rows = matrix.map((row, k) => [...row, right[k]]), n = rows.length;
  for (let k = 0; k < n; k++) {
    const pivot = rows.slice(k).reduce((best, row) => (Math.abs(row[k]) > Math.abs(best[k]) ? row : best));
    if (Math.abs(pivot[k]) < 1e-300) return null;
    rows.splice(rows.indexOf(pivot), 1);
    rows.splice(k, 0, pivot);
    for (let j = 0; j < n; j++) {
      if (j === k) continue;
      const factor = rows[j][k] / pivot[k];
      for (let i = k; i <= n; i++) rows[j][i] -= factor * pivot[i];
    }
  }
  return rows.map((row, k) => row[n] / row[k]);
}

/** @type {Record<string, (rows: object) => number>} */
const NORMS = {
  mean: (rows) => weighted(rows, (length) => length),
  rms: (rows) => Math.sqrt(weighted(rows, (length) => length * length)),
  maximum: (rows) => largest(counted(rows).flatMap((point) => point.groups.map((group) => largest(group.lengths)))),
  "peak to peak": (rows) => largest(counted(rows).flatMap((point) => point.groups.map(diameter))),
  "worst mean": (rows) => largest(counted(rows).map((point) => total(point, (length) => length) / size(point))),
};
