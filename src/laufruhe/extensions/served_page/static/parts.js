// Common helpers: elements with text, and numbers for display.

/** @returns {any} the element, which must exist */
export function byId(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no #${id}`);
  return found;
}

/**
 * @type {{element: (tag: string, attributes?: object, ...children: (Node | string)[]) => any, drawn: typeof element,
 *   download: (text: string, name: string) => void, typed: (text: string) => {value?: number, why?: string}}}
 */
export const { element, drawn, download, typed } = window.laufruheLive;

/** A number with some figures, without trailing zeros. */
export function shown(value, digits = 4) {
  if (!Number.isFinite(value)) return "-";
  return String(Number(value.toPrecision(digits)));
}

/** Round numbers between two ends, for an axis. */
export function ticks(low, high, count = 5) {
  const rough = (high - low) / count || 1;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * ([1, 2, 5, 10].find((times) => times * size >= rough) || 10);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
  return found;
}
