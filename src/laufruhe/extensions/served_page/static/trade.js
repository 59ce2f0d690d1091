// The Pareto front, drawn point by point.
import { drawFront } from "./front.js";
import { listen, Refusal } from "./link.js";
import { byId, element } from "./parts.js";

const counted = (points) => `${points.length} point${points.length === 1 ? "" : "s"}`;

/** The other measure, and the points so far. */
export class Trade {
  constructor(picked) {
    this.picked = picked;
    this.asking = null;
  }

  /** @param {string[]} names of other measures */
  offer(names) {
    const select = byId("across");
    // a front in the making stays: it is cleared when settings change
    if (names.join("\n") === [...select.options].map((option) => option.value).join("\n")) return;
    const before = select.value;
    byId("trade").hidden = !names.length;
    select.replaceChildren(...names.map((name) => element("option", { value: name }, name)));
    if (names.includes(before)) select.value = before;
    this.clear("");
  }

  /** @param {string} why reason for discarding the drawn front */
  clear(why) {
    this.asking?.abort();
    byId("front").replaceChildren();
    byId("front-state").textContent = why;
  }

  /** Mark the front as being about earlier settings. */
  withdraw() {
    const has = byId("front").childElementCount > 0 || byId("front-state").textContent !== "";
    this.clear(has ? "The settings have changed: draw it again." : "");
  }

  /** @param {{edits: any[], held: any[]}} asked the state that it is drawn for */
  async draw(asked) {
    this.clear("The first point is being computed.");
    const mine = new AbortController();
    this.asking = mine;
    const points = [];
    const across = byId("across").value;
    try {
      await listen("front", { ...asked, across }, (told) => this.add(told, points, across), mine.signal);
      byId("front-state").textContent = `${counted(points)}${points[0]?.simpler ?? ""}, done`;
    } catch (error) {
      if (error.name !== "AbortError") throw error;
    }
  }

  add(told, points, across) {
    if (told.error) throw new Refusal(told.error);
    if (!told.words) return;
    points.push(told);
    byId("front-state").textContent = counted(points);
    drawFront(byId("front"), points, across, this.picked);
  }
}
