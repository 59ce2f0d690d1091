// What the page knows of itself.

/** @typedef {import("./controls.js").Edit} Edit */

export const state = {
  /** @type {Map<string, Edit>} by the name of the number */
  edits: new Map(),
  /** @type {Edit[]} */
  held: [],
  key: "",
  /** @type {any} */
  handle: null,
  /** Number of the settings that stand now: every change makes another one. */
  position: 1,
  /** Whether these settings were refused. */
  refused: false,
  /** @type {import("./words.js").Claim | null} what is claimed on the page, maybe about other settings */
  claim: null,
  /** @type {Record<string, number> | null} the design that it is about */
  design: null,
  version: 0,
  gone: false,
  asking: false,
  again: false,
  resting: 0,
  measuring: 0,
  writing: 0,
  dropped: 0,
  isLater: false,
  /** Milliseconds that the last model took. */
  opening: 0,
  /** Whether a design was set by the page and not by the user. */
  setting: false,
};
/** For who measures: milliseconds from an input to the picture drawn, to the answer, and of the server's processor. */
export const latencies = /** @type {number[][]} */ ([]);
