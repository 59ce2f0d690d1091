// Selection of the first objective.
import { element } from "./parts.js";

/** @param {string[]} names in order */
export function offerObjectives(root, names, first, moved) {
  root.querySelector("#objectives")?.remove();
  if (names.length < 2) return;
  const select = element("select", { id: "first-objective" }, ...names.map((name, k) => element("option", { value: k }, name)));
  select.value = String(first);
  select.addEventListener("change", () => moved(Number(select.value) ? ["first", "objective", Number(select.value)] : null));
  root.prepend(element("fieldset", { id: "objectives" }, element("legend", {}, "Objective"),
    element("label", {}, "First objective ", select)));
}
