// State of the page.

export const state = {
  /** @type {Map<string, Edit>} by the name of the number */
  edits: new Map(),
  held: [],
  key: "",
  handle: null,
  /** Number of the current settings; every change increments it. */
  position: 1,
  /** True if these settings were refused. */
  refused: false,
  /** @type {import("./words.js").Claim | null} displayed claim, possibly about earlier settings */
  claim: null,
  /** @type {Record<string, number> | null} design of the claim */
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
  /** Duration of the last model [ms]. */
  opening: 0,
  /** True if the page set the design, not the user. */
  setting: false,
};
/** Measured durations: from input to picture, to answer, and of the server's processor [ms]. */
export const latencies = /** @type {number[][]} */ ([]);
