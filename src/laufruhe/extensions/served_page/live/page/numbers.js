// Numbers as the report prints them.

/** A number with `digits` figures, without an exponent where possible. */
function number(value, digits = 4) {
  if (value === null || !Number.isFinite(value)) return "-";
  if (value === 0) return "0";
  const figures = (given) => Math.floor(Math.log10(Math.abs(Number(given.toExponential(digits - 1)))));
  const first = Math.floor(Math.log10(Math.abs(value)));
  if (first < -4 || first > 6) return exponential(value, digits);
  return value.toFixed(Math.max(digits - 1 - figures(value), 0));
}

/** 1.234e-05, as the report writes it. */
function exponential(value, digits) {
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  return `${mantissa}e${power[0]}${power.slice(1).padStart(2, "0")}`;
}

/** A number without trailing zeros. */
function trimmed(value, digits = 4) {
  const text = number(value, digits);
  return text.includes(".") && !text.includes("e") ? text.replace(/0+$/, "").replace(/\.$/, "") : text;
}

/**
 * Parse a typed number, with a decimal point or comma.
 * @param {string} text
 * @returns {{value?: number, why?: string}} the number, or a line that says why it is refused
 */
function typed(text) {
  const plain = text.trim().replace("−", "-");
  if (/^[+-]?[1-9]\d{0,2},\d{3}$/.test(plain)) {
    const [whole, decimal] = [plain.replace(",", ""), plain.replace(",", ".")];
    return { why: `"${plain}" can be read as ${whole} or as ${decimal}: write one of these` };
  }
  const isNumber = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i.test(plain), value = Number(plain.replace(",", "."));
  return isNumber && Number.isFinite(value) ? { value } : { why: `"${plain}" is no number: write one like 2.5` };
}

/** A value in the displayed unit; a rounding of `scale` becomes zero. */
function figure(value, unit, digits = 4, scale = 0) {
  if (value === null) return "-";
  const shown = Math.abs(value) <= 1e-9 * scale ? 0 : value * unit.factor;
  return `${number(shown, digits)} ${unit.shown}`.trimEnd();
}

/** A share with its sign: +1.2 %. */
function percent(share) {
  const text = (100 * share).toFixed(Math.abs(share) < 0.0995 ? 2 : 1);
  return `${share >= 0 ? "+" : "−"}${text.replace("-", "")} %`;
}

/** Round up to 1, 1.5, 2, 3, 5 or 7 times a power of ten. */
function roundUp(value) {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 5, 7, 10].find((step) => step * power >= value * 1.000001) * power;
}
