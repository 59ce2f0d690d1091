// What is known of a design: every measure, how it stands to its limits, and how good it is against the optimum.

// relative excess over a limit that counts as none, and difference of objectives that are told as one
const KEPT = 1e-5, AT = 5e-5;

/** A model with its numbers. */
async function opened(model) {
  const block = model.data ? await inflated(model.data) : new Float64Array(0);
  return { ...model, signals: model.signals.map((signal) => decoded(signal, block)) };
}

/** All measures at a decision vector, in their order; rows of one signal are taken once. */
function measured(model, x) {
  return model.measures.map(({ signal, norm, refinement, value }) => {
    return signal === null ? value : NORMS[norm](rowsAt(model.signals[signal], refinement, x));
  });
}

/** How a value stands to a limit: the side that has least room, and whether it is kept; null where that is not known. */
function standing(measure, value, isKnown) {
  const { sides } = measure;
  const room = ([sense, edge]) => (sense === "at most" ? edge - value : value - edge) / (Math.abs(edge) || 1);
  const side = sides.reduce((a, b) => (a && room(a) <= room(b) ? a : b), null);
  return { value, met: isKnown ? !side || room(side) >= -KEPT : null, side };
}

/** Measures of a role. */
function ofRole(model, role) {
  return model.measures.filter((measure) => measure.role === role);
}

/**
 * What is known of one design: objective, limits, and what is minimised after it.
 * @param {{values: object, objective: number | null, limits: object}} told what the exact model says of one design
 */
function judged(model, values, told) {
  return judgedAt(model, vectorOf(model, values), isSame(model, values, told.values) ? told : null);
}

/** The same of a decision vector, and of what does not follow where that is told of it. */
function judgedAt(model, x, told = null) {
  const found = measured(model, x), value = (measure) => found[model.measures.indexOf(measure)];
  const known = (measure) => (measure.followed ? undefined : told?.limits[measure.name]) ?? value(measure);
  const terms = ofRole(model, "objective"), isKnown = terms.length > 0 && terms.every((measure) => measure.followed);
  return {
    x,
    objective: isKnown ? terms.reduce((sum, measure) => sum + measure.weight * value(measure), 0) : told?.objective ?? null,
    limits: ofRole(model, "limit").map((measure) => standing(measure, known(measure), measure.followed || told !== null)),
    ranks: ofRole(model, "rank").map((measure) => ({ measure, value: measure.followed ? value(measure) : null })),
  };
}

/** Designs that came with the model: their vectors, and what the exact model measures of them. */
function designsOf(model) {
  return Object.values(model.designs).map(({ x, measured: told }) => ({ x: Float64Array.from(x), told }));
}

/** Largest difference between the page's own numbers and those of the exact model, over the largest of each measure. */
function difference(model) {
  const designs = designsOf(model).map(({ x, told }) => ({ own: measured(model, x), told }));
  return largest(model.measures.map((_, k) => {
    const known = designs.filter(({ told }) => told[k] !== null), size = largest(known.map(({ told }) => Math.abs(told[k])));
    return largest(known.map(({ own, told }) => Math.abs(own[k] - told[k]) / (size || 1)));
  }));
}

/** Largest objective of the designs that came with the model. */
function sizeOf(model) {
  return largest(designsOf(model).map(({ x }) => judgedAt(model, x).objective ?? 0));
}

/** Whether two designs are one, but for roundings. */
function isSame(model, values, others) {
  const x = vectorOf(model, values), y = vectorOf(model, others);
  const size = largest(model.sliders.map((slider) => slider.upper - slider.lower));
  return x.every((value, k) => Math.abs(value - y[k]) <= 1e-9 * size);
}

/**
 * How an objective stands to that of the reference, in words.
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

/** Number of the curve that the objective is of; else the first. */
function ownCurve(model) {
  const asked = model.measures.find((measure) => measure.role === "objective" && measure.signal !== null);
  const name = (curve) => model.signals[curve.signal].name;
  return Math.max(model.curves.findIndex((curve) => asked && name(curve) === model.signals[asked.signal].name), 0);
}

/** Names that have the same to be said of them. */
function grouped(unmoved) {
  const by = new Map();
  for (const { name, why } of unmoved) by.set(why, [...(by.get(why) ?? []), name]);
  return [...by].map(([why, names]) => ({ why, names }));
}

/** SI unit, the one that is shown, and its factor. */
function unitOf({ unit, shown, factor }) {
  return { unit, shown, factor };
}
