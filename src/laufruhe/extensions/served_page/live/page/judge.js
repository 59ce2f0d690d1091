// Evaluation of a design: measures, limits, and comparison with the optimum.

// relative difference below which objectives count as equal
const AT = 5e-5;

/** A model with its numbers. */
async function opened(model) {
  const block = model.data ? await inflated(model.data) : new Float64Array(0);
  return { ...model, signals: model.signals.map((signal) => decoded(signal, block)) };
}

/** All measures at a decision vector; rows of a signal are computed once. */
function measured(model, x) {
  return model.measures.map(({ signal, norm, refinement, value }) => {
    return signal === null ? value : NORMS[norm](rowsAt(model.signals[signal], refinement, x));
  });
}

/** The tighter side of a limit, and whether it is kept within a relative tolerance; null if unknown. */
function standing(measure, value, isKnown, tolerance) {
  const { sides } = measure;
  const room = ([sense, edge]) => (sense === "at most" ? edge - value : value - edge) / (Math.abs(edge) || 1);
  const side = sides.reduce((a, b) => (a && room(a) <= room(b) ? a : b), null);
  return { value, met: isKnown ? !side || room(side) >= -tolerance : null, side };
}

/** Measures of a role. */
function ofRole(model, role) {
  return model.measures.filter((measure) => measure.role === role);
}

/**
 * Values of one design: objective, limits, and later objectives.
 * @param {{values: object, objective: number | null, limits: object}} told what the exact model says of one design
 */
function judged(model, values, told) {
  return judgedAt(model, vectorOf(model, values), isSame(model, values, told.values) ? told : null);
}

/** Values at a decision vector, with those that the server evaluated. */
function judgedAt(model, x, told = null) {
  const found = measured(model, x), value = (measure) => found[model.measures.indexOf(measure)];
  const known = (measure) => (measure.followed ? undefined : told?.limits[measure.name]) ?? value(measure);
  const terms = ofRole(model, "objective"), isKnown = terms.length > 0 && terms.every((measure) => measure.followed);
  return {
    x,
    objective: isKnown ? terms.reduce((sum, measure) => sum + measure.weight * value(measure), 0) : told?.objective ?? null,
    limits: ofRole(model, "limit").map((measure) =>
      standing(measure, known(measure), measure.followed || told !== null, model.tolerance)),
    ranks: ofRole(model, "rank").map((measure) => ({ measure, value: measure.followed ? value(measure) : null })),
  };
}

/** Designs of the model: vectors, and measures by the exact model. */
function designsOf(model) {
  return Object.values(model.designs).map(({ x, measured: told }) => ({ x: Float64Array.from(x), told }));
}

/** Largest relative difference between the page's numbers and those of the exact model. */
function difference(model) {
  const designs = designsOf(model).map(({ x, told }) => ({ own: measured(model, x), told }));
  return largest(model.measures.map((_, k) => {
    const known = designs.filter(({ told }) => told[k] !== null), size = largest(known.map(({ told }) => Math.abs(told[k])));
    return largest(known.map(({ own, told }) => Math.abs(own[k] - told[k]) / (size || 1)));
  }));
}

/** Largest objective of the model's designs. */
function sizeOf(model) {
  return largest(designsOf(model).map(({ x }) => judgedAt(model, x).objective ?? 0));
}

/** Return true if two designs are equal within rounding. */
function isSame(model, values, others) {
  const x = vectorOf(model, values), y = vectorOf(model, others);
  const size = largest(model.sliders.map((slider) => slider.upper - slider.lower));
  return x.every((value, k) => Math.abs(value - y[k]) <= 1e-9 * size);
}

/**
 * Compare an objective with that of the reference, in words.
 * @param {{value: number, name: string}} reference
 * @param told of an objective
 * @param {{value: number, isNothing: boolean, isReference: boolean, isBroken: boolean, unknown: string[]}} at the objective,
 *   whether that of the reference is nothing, whether the design is the reference, whether it breaks a limit, and limits
 *   not followed
 */
function against(reference, told, at) {
  const best = `${reference.name}: ${told(reference.value)}`, less = at.value - reference.value;
  const aside = at.unknown.length ? ` Not followed here: ${at.unknown.join(", ")}.` : "";
  if (at.isReference) return `This is ${reference.name}.`;
  if (Math.abs(less) <= AT * Math.abs(reference.value)) return `As much as ${best}.${aside}`;
  return `${at.isNothing ? `${told(less)} more than` : `${percent(less / reference.value)} against`} ${best}.${aside}`;
}

/** Index of the objective's curve, or 0. */
function ownCurve(model) {
  const asked = model.measures.find((measure) => measure.role === "objective" && measure.signal !== null);
  const name = (curve) => model.signals[curve.signal].name;
  return Math.max(model.curves.findIndex((curve) => asked && name(curve) === model.signals[asked.signal].name), 0);
}

/** Group names with equal sentences. */
function grouped(unmoved) {
  const by = new Map();
  for (const { name, why } of unmoved) by.set(why, [...(by.get(why) ?? []), name]);
  return [...by].map(([why, names]) => ({ why, names }));
}

/** SI unit, displayed unit, and factor. */
function unitOf({ unit, shown, factor }) {
  return { unit, shown, factor };
}
