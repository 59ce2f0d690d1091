// Pictures of the report of the last solution.
import { listen, Refusal } from "./link.js";
import { byId, element } from "./parts.js";

/** Pictures of the last solution. */
export class Pictures {
  constructor() {
    this.asking = null;
  }

  /** @param {boolean} has true if there is an optimum to draw */
  offer(has) {
    this.asking?.abort();
    if (!has && byId("pictures").hidden) return;
    byId("pictures").hidden = !has;
    byId("pictures-state").textContent = "";
    byId("drawn").replaceChildren();
  }

  /** @param {any[]} edits of the state that was solved */
  async draw(edits) {
    this.asking?.abort();
    const mine = new AbortController();
    this.asking = mine;
    byId("drawn").replaceChildren();
    byId("pictures-state").textContent = "Drawing the first one.";
    try {
      await listen("pictures", { edits }, (told) => this.add(told), mine.signal);
    } catch (error) {
      if (error.name !== "AbortError") throw error;
    }
  }

  add(told) {
    if (told.error) throw new Refusal(told.error);
    if (!told.image) return;
    const image = element("img", { src: told.image, alt: told.caption });
    const region = { class: "scroll", role: "region", tabindex: "0", "aria-label": `Picture ${byId("drawn").children.length + 1}` };
    byId("drawn").append(element("figure", {}, element("div", region, image), element("figcaption", {}, told.caption)));
    byId("pictures-state").textContent = `${byId("drawn").children.length} of ${told.of}`;
  }
}
