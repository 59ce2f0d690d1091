// Crank stars and firing orders, ranked, to be clicked.
import { element } from "./parts.js";

/**
 * @typedef {{throws: string, bank: string, text: string, bound: string, proven: boolean,
 *   orders: {text: string, star: object}[]}} Star
 */

/** The list of cranks. */
export class Crank {
  constructor(root, moved) {
    this.moved = moved;
    /** @type {string | null} what the ranking is about */
    this.about = null;
    this.said = element("p", { class: "said" });
    this.list = element("ol", { id: "ranking", "aria-label": "Cranks, best first" });
    this.all = element("button", { type: "button", id: "rank-all" }, "Rank all cranks");
    this.free = element("button", { type: "button", id: "crank-free" }, "As in the file");
    this.all.addEventListener("click", () => moved(["open crank", "crank", 1]));
    this.free.addEventListener("click", () => moved(null));
    this.box = element("fieldset", { hidden: true }, element("legend", {}, "Crank and firing order"),
      element("p", { class: "tools" }, this.all, this.free), this.said, this.list);
    root.append(this.box);
  }

  /**
   * @param {boolean} has whether the layout has a crank to choose
   * @param {boolean} open whether the file leaves it open
   */
  offer(has, open) {
    this.box.hidden = !has && !open;
    this.all.hidden = open;
  }

  /**
   * @param {string} chosen the star of the state, as JSON
   * @param {string} about what they were ranked for
   */
  tell(ranking, chosen, about) {
    if (!ranking.length) return;
    this.about = about;
    this.check(about);
    this.list.replaceChildren(...ranking.map((star) => this.entry(star)));
    this.choose(chosen);
  }

  /** Say whether the ranking is about the settings that stand now. */
  check(about) {
    if (this.about === null) return;
    const isOld = about !== this.about;
    this.box.classList.toggle("outdated", isOld);
    this.said.textContent = isOld ? "Ranked for earlier settings:" : "Best cranks found, each with its best values of all other open numbers:";
  }

  choose(chosen) {
    this.list.querySelectorAll("button").forEach((button) => {
      button.setAttribute("aria-pressed", String(button.dataset.star === chosen));
    });
  }

  entry(star) {
    const bank = star.bank ? `, banks at ${star.bank}°` : "";
    const told = `${star.throws}°${bank}: ${star.text}${star.proven ? "" : `, at least ${star.bound}`} `;
    const buttons = star.orders.map((order) => {
      const button = element("button", { type: "button", "data-star": JSON.stringify(order.star),
        "aria-label": `throws ${star.throws}${bank}, ${order.text || "this crank"}` }, order.text || "take it");
      button.addEventListener("click", () => this.moved(["star", "star", order.star]));
      return button;
    });
    return element("li", {}, told, ...buttons);
  }
}
