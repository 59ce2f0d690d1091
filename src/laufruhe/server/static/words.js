// What the page says of the optimum: what is proven, what is being computed, and why there is none.
import { byId, element } from "./parts.js";

/** Gap from which a bound says nothing that a user can act on. */
const USELESS = 0.99;

/**
 * @param {any} answer
 */
export function tellOptimum(answer) {
  const place = byId("optimum");
  place.dataset.stage = answer.stage;
  place.dataset.value = answer.optimum ? String(answer.optimum.value) : "";
  place.dataset.bound = answer.optimum ? String(answer.optimum.bound) : "";
  place.dataset.proof = answer.optimum ? answer.optimum.proof : "";
  place.replaceChildren(...words(answer));
}

/** @param {any} answer */
function words(answer) {
  const but = answer.but?.length ? `, with ${answer.but.join(", ")}` : "";
  if (answer.conflict?.length) return [conflict(answer.conflict, but)];
  const own = answer.optimum;
  if (!own) return [answer.message || given(answer)];
  const lead = [element("strong", {}, `Optimum ${own.text}`), ` ${own.name}, `];
  const share = `${(100 * own.gap).toPrecision(2)} %`;
  const useful = own.gap < USELESS;
  const bound = useful ? `no design has less than ${own.boundText}` : "no useful bound yet";
  if (answer.status === "optimal") return [...lead, element("span", { class: "proven" }, `proven: ${bound}`)];
  const local = own.proof === "local" ? ", a local optimum" : "";
  const found = answer.stage === "settled" ? `found; ${bound} (${useful ? `gap ${share}${local}` : "a local optimum"})` : useful ? `at ${share} from its bound so far${but}: ${bound}; being proven` : `${bound}${but}; being proven`;
  return [...lead, element("span", { class: "pending" }, found)];
}

/** @param {any} answer */
function given(answer) {
  return answer.given ? `${answer.given.name} ${answer.given.text} as given; the optimum is being computed` : "The optimum is being computed";
}

/**
 * @param {string[]} names of limits
 * @param {string} but what was left out of the question
 */
function conflict(names, but) {
  const told = names.map((name) => `'${name}'`).join(" and ");
  const why = names.length > 1 ? `${told} contradict each other` : `${told} cannot be met within the bounds`;
  const whole = but ? "; the whole problem is being solved" : "";
  return element("strong", { class: "infeasible" }, `No design exists${but}: ${why}. Move one of the limits${whole}.`);
}

/**
 * Say how long the whole problem is being solved.
 * @param {any} optimum
 * @returns {() => void} what ends it
 */
export function busy(optimum) {
  const place = byId("optimum");
  const said = element("span", { class: "pending", id: "busy" });
  const began = performance.now();
  const timer = setInterval(() => {
    const seconds = (performance.now() - began) / 1000;
    said.textContent = seconds < 1 ? "" : optimum ? ` for ${seconds.toFixed(0)} s` : `: ${seconds.toFixed(0)} s`;
    if (!said.isConnected) place.append(said);
  }, 250);
  return () => {
    clearInterval(timer);
    said.remove();
  };
}

/** @param {string} text one line, or nothing where all is well */
export function complain(text) {
  const place = byId("complaint");
  if (place.textContent === text) return;
  place.hidden = !text;
  place.textContent = text;
}

/** @param {string | null} file */
export function tellGone(file) {
  const banner = byId("banner");
  banner.hidden = false;
  banner.dataset.gone = "true";
  banner.textContent = "The server of this page has ended. Sliders of weights still move the forces; limits, speed, load, crank and " +
    `mounts do not. Start it again with: laufruhe page ${file || ""}`;
}

/** @param {string} complaint of the file as it is on the disk */
export function tellFile(complaint) {
  const banner = byId("banner");
  banner.hidden = !complaint;
  banner.textContent = complaint ? `The file has changed and cannot be used; the page shows its last good state. ${complaint}` : "";
}
