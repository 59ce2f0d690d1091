// Two designs side by side: A is kept, B is the one that is shown.
import { byId, element, shown } from "./parts.js";

/**
 * @typedef {{name: string, value: number, unit: string, words?: string, shown?: string, factor?: number, met?: boolean | null}} Measured
 */

/** The design that is kept. */
export class Comparison {
  constructor() {
    this.kept = null;
  }

  /**
   * @param {object} state whatever shows it again
   * @param {HTMLElement} live whose pictures are kept
   */
  keep(measures, state, live) {
    this.kept = { measures, state };
    byId("kept").replaceChildren(...[...live.querySelectorAll("[data-figure]")].map(copied));
    byId("compare").hidden = false;
    this.tell(measures);
  }

  drop() {
    this.kept = null;
    byId("compare").hidden = true;
    byId("kept").replaceChildren();
  }

  /** @param {Measured[]} measures of B */
  tell(measures) {
    if (!this.kept) return;
    const head = element("tr", {}, ...["", "A", "B", "B against A"].map((word) => element("th", { scope: "col" }, word)));
    const rows = this.kept.measures.map((own) => row(own, measures.find((other) => other.name === own.name)));
    byId("compared").replaceChildren(head, ...rows);
  }
}

function row(a, b) {
  const change = b && b.value !== null && a.value ? `${b.value >= a.value ? "+" : ""}${shown((100 * (b.value - a.value)) / a.value, 3)} %` : "-";
  return element("tr", {}, element("th", { scope: "row" }, a.words ?? a.name), ...[a, b].map(cell), element("td", {}, change));
}

function cell(measured) {
  const broken = measured?.met === false ? ", broken" : "";
  const [unit, factor] = [measured?.shown ?? measured?.unit, measured?.factor ?? 1];
  return element("td", {}, measured && measured.value !== null ? `${shown(measured.value * factor, 5)} ${unit}${broken}` : "-");
}

/** A picture as it is now. */
function copied(figure) {
  const copy = /** @type {HTMLElement} */ (figure.cloneNode(true));
  copy.removeAttribute("data-figure");
  copy.querySelectorAll("[id]").forEach((inner) => inner.removeAttribute("id"));
  return copy;
}
