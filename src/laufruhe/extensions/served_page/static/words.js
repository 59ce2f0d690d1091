// Renders the server's claims about a design; claims.py decides their content and strength.
import { byId, element } from "./parts.js";

/**
 * @typedef {{kind: string, position: number, lead: string, words: string, value: number | null, reference: string,
 *   breaks: string, is_last: boolean}} Claim
 */

export function tellClaim(claim) {
  const place = byId("claim");
  Object.assign(place.dataset, { kind: claim.kind, position: claim.position, value: claim.value ?? "", last: claim.is_last });
  const breaks = claim.breaks ? ["; ", element("strong", { class: "broken" }, claim.breaks)] : [];
  place.replaceChildren(element("span", { id: "mark" }), element("strong", {}, claim.lead), " ",
    element("span", { class: "words" }, claim.words), ...breaks, element("span", { id: "pending" }));
  tellPending(claim.is_last ? "" : "; the whole problem is being solved");
}

/** @param {string} words work in progress */
export function tellPending(words) {
  const place = document.getElementById("pending");
  if (place) place.textContent = words;
}

/**
 * Mark all claims as being about other settings than the current ones.
 * @param {string} words settings that the claim is about; empty for the current ones
 */
export function tellMark(words) {
  document.body.classList.toggle("earlier", Boolean(words));
  const place = document.getElementById("mark");
  if (place) place.textContent = words && `${words}: `;
}

/**
 * Show the time of the running solution.
 * @returns {() => void} what ends it
 */
export function busy() {
  const began = performance.now();
  const timer = setInterval(() => {
    const seconds = (performance.now() - began) / 1000;
    if (seconds >= 1) tellPending(`; the whole problem is being solved for ${seconds.toFixed(0)} s`);
  }, 250);
  return () => clearInterval(timer);
}

/** @param {string} text one line; empty without an error */
export function complain(text) {
  const place = byId("complaint");
  if (place.textContent === text) return;
  place.hidden = !text;
  place.textContent = text;
}

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
