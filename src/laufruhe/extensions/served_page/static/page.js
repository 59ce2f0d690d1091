// The page of a problem: what is asked, when, and where answers are shown.
import { address, addressed, ask, enter, Gone, listen, recalled, Refusal } from "./link.js";
import { Comparison } from "./compare.js";
import { Controls } from "./controls.js";
import { offerObjectives } from "./objectives.js";
import { Crank } from "./crank.js";
import { EngineView } from "./engine.js";
import { Pictures } from "./pictures.js";
import { Trade } from "./trade.js";
import { byId, download, element } from "./parts.js";
import { latencies, state } from "./state.js";
import { busy, complain, tellClaim, tellFile, tellGone, tellMark, tellPending } from "./words.js";

/** Milliseconds of rest after which the whole problem is solved, and before something is asked again. */
const [REST, RETRY, MOST_RETRIES] = [350, 100, 3];
/** Milliseconds beyond which a model is opened when sliders rest. */
const SLOW = 40;
const CRANK = ["star", "crank"];

/** @typedef {import("./controls.js").Edit} Edit */

let inputAt = 0;

const controls = new Controls(byId("controls"), (edit, control) => {
  // loads that take long to open are drawn when the slider rests
  state.isLater = control.group !== "Limits" && state.opening > SLOW;
  changed(control.name, edit);
}, complain);
const crank = new Crank(byId("controls"), (edit) => {
  CRANK.forEach((name) => state.edits.delete(name));
  state.held = [];
  changed(edit ? edit[1] : "star", edit);
});
const engine = new EngineView(byId("engine"));
const comparison = new Comparison();
const trade = new Trade(picked);
const pictures = new Pictures();

/**
 * A number has another value, or that of the file again.
 * @param {string} name
 * @param {Edit | null} edit
 */
function changed(name, edit) {
  if (!inputAt) inputAt = performance.now();
  if (edit) state.edits.set(name, edit);
  else state.edits.delete(name);
  // what is held by hand is held no other way
  state.held = state.held.filter((held) => held[1] !== name);
  moved();
  remember();
  follow();
}

/** Other settings stand from now on: what is claimed is about earlier ones. */
function moved() {
  state.position += 1;
  state.refused = false;
  complain("");
  pictures.offer(false);
  trade.withdraw();
  crank.check(ranked());
  mark();
}

/** Say of all that is claimed which settings it is about, where that are not those that stand now. */
function mark() {
  const isOld = state.claim !== null && state.claim.position !== state.position;
  const [words, why] = state.refused ? ["Last valid settings", "the new ones are refused"] : ["Earlier settings", "the new ones are being computed"];
  tellMark(isOld ? words : "");
  if (isOld) state.handle?.withdraw(`${words}; ${why}.`);
}

/** What a ranking of cranks is about: all settings but the crank. */
const ranked = () => JSON.stringify([state.version, [...state.edits.values()].filter((edit) => !CRANK.includes(edit[1]))]);

/** The state in the address once nothing moves, so that a link shows it. */
function remember() {
  clearTimeout(state.writing);
  state.writing = setTimeout(written, REST);
}

function written() {
  address("e", state.edits.size ? JSON.stringify([...state.edits.values()]) : null);
  const star = state.edits.get("star");
  crank.choose(star ? JSON.stringify(star[2]) : "");
}

/** @returns {{edits: Edit[], held: Edit[], has: string, position: number}} */
const asked = () => ({ edits: [...state.edits.values()], held: state.held, has: state.isLater ? "later" : state.key,
  position: state.position });

/** Ask for the optimum that follows; while an answer is on its way only the newest state waits. */
async function follow() {
  clearTimeout(state.resting);
  if (state.asking) {
    state.again = true;
    return;
  }
  state.asking = true;
  const [from, mine] = [inputAt, state.position];
  inputAt = 0;
  state.dropped = 0;
  try {
    const answer = await ask("follow", asked());
    const answered = performance.now() - from;
    if (!answer.dropped) await show(answer);
    // another page of this server was faster
    else setTimeout(follow, RETRY);
    const mark = () => latencies.push([performance.now() - from, answered, 1e3 * answer.seconds.processor]);
    if (from && answer.seconds) requestAnimationFrame(() => setTimeout(mark));
    rest();
  } catch (error) {
    failed(error);
    if (error instanceof Refusal && state.held.length) {
      // what was held may be what no longer fits
      state.held = [];
      state.again = true;
    } else if (error instanceof Refusal && mine === state.position) {
      state.refused = true;
      mark();
    }
  }
  state.asking = false;
  if (state.again) {
    state.again = false;
    follow();
  }
}

/** The whole problem is solved when nothing has moved for a while. */
function rest() {
  clearTimeout(state.resting);
  state.resting = setTimeout(rested, REST);
}

/** Nothing has moved for a while: pictures that wait are drawn, then all of it is solved. */
function rested() {
  if (!state.isLater) return settle();
  state.isLater = false;
  return follow();
}

async function settle() {
  const mine = state.position;
  const stop = busy();
  try {
    const answer = await ask("settle", { edits: [...state.edits.values()], position: mine });
    if (mine !== state.position) return;
    if (!answer.dropped) await settled(answer);
    else if (state.dropped++ < MOST_RETRIES) state.resting = setTimeout(settle, RETRY * 10 ** state.dropped);
  } catch (error) {
    if (mine !== state.position) return;
    failed(error);
    tellPending("; the whole problem could not be solved");
  } finally {
    stop();
  }
}

/**
 * The whole problem was solved: its claim, with the model of what was decided beside weights.
 * @param {any} answer
 */
async function settled(answer) {
  crank.tell(answer.ranking, JSON.stringify(state.edits.get("star")?.[2] ?? answer.ranking[0]?.orders[0]?.star ?? ""), ranked());
  const isOther = JSON.stringify(answer.holds) !== JSON.stringify(state.held);
  if (answer.design && isOther) {
    state.held = answer.holds;
    const mine = state.position;
    const model = await ask("follow", asked());
    if (mine !== state.position) return;
    if (!model.dropped) await draw(model);
  }
  answer.holds.filter((/** @type {Edit} */ edit) => edit[0] === "fix").forEach((/** @type {Edit} */ edit) => controls.place(edit[1], parseFloat(edit[2])));
  tell(answer);
  pictures.offer(Boolean(answer.design));
  // where nothing slides they are all that there is to see
  if (answer.design && !state.handle) pictures.draw(asked().edits).catch(failed);
}

/**
 * @param {any} answer
 */
async function show(answer) {
  if (answer.claim.position === state.position) complain("");
  const isDrawn = answer.engine !== undefined || answer.key === state.key;
  byId("live").classList.toggle("stale", !isDrawn);
  await draw(answer);
  tell(answer, isDrawn);
}

/**
 * Take over another model, where an answer has one.
 * @param {any} answer
 */
async function draw(answer) {
  if (answer.engine === undefined) return;
  const began = performance.now();
  state.key = answer.key;
  if (answer.model && state.handle) await state.handle.setModel(answer.model);
  else if (answer.model) await first(answer.model);
  else unshown(answer.unshown);
  engine.load(answer.engine);
  trade.offer(answer.partners);
  state.opening = performance.now() - began;
}

/** @param {any} model */
async function first(model) {
  state.handle = await window.laufruheLive.show(model, byId("live"));
  state.handle.onDesign(designed);
  const design = addressed().get("d");
  if (design) byId("follows").checked = false;
}

/** @param {string} why nothing slides */
function unshown(why) {
  state.handle?.end();
  state.handle = null;
  byId("live").replaceChildren(element("p", {}, why));
}

/**
 * @param {any} answer a claim, and the design that it is about
 * @param {boolean} [isDrawn] whether the loads on the page are those of the answer
 */
function tell(answer, isDrawn = true) {
  const { claim, design, limits } = answer;
  Object.assign(state, { claim, design });
  tellClaim(claim);
  controls.tell(limits, answer.conflict);
  byId("keep").disabled = !state.handle;
  if (state.handle && isDrawn) {
    const isCompared = Boolean(claim.reference) && claim.value !== null;
    const reference = isCompared ? { value: claim.value, name: claim.reference, isProven: claim.kind === "proven" } : null;
    state.setting = true;
    state.handle.update({ limits, reference, decided: design, follows: byId("follows").checked });
    state.setting = false;
    drawDesign();
  } else state.handle?.withdraw("The loads are drawn when the slider rests.");
  mark();
}

/** The user has moved a weight. */
function designed() {
  if (!state.setting) byId("follows").checked = false;
  drawDesign();
}

function drawDesign() {
  if (!state.handle) return;
  clearTimeout(state.measuring);
  if (state.handle.isAside) state.measuring = setTimeout(() => measure().catch(failed), RETRY);
  engine.follow(state.handle.design());
  comparison.tell(state.handle.measures());
}

/** What of the design that is shown no slider moves in proportion, by the exact model. */
async function measure() {
  const [values, mine] = [state.handle.design(), state.position];
  const found = await ask("measure", { edits: [...state.edits.values()], held: state.held, design: values });
  if (found.limits && mine === state.position && !state.gone) state.handle?.setExact({ ...found, values });
}

/** @param {unknown} error */
function failed(error) {
  if (error instanceof Gone) lost();
  else if (error instanceof Refusal) {
    complain(error.message);
  } else throw error;
}

/** The server has ended: what the page knows still moves. */
function lost() {
  if (state.gone) return;
  state.gone = true;
  clearTimeout(state.resting);
  controls.disable(true);
  ["back", "draw", "save"].forEach((id) => { byId(id).disabled = true; });
  tellGone(byId("file").textContent);
}

/** @param {{design: Record<string, number>}} point */
function picked(point) {
  byId("follows").checked = false;
  state.handle.setDesign(point.design, {});
  drawDesign();
}

/** Begin, or begin again with another file. */
async function begin() {
  const told = await ask("begin", {});
  state.version = told.version;
  byId("title").textContent = told.title;
  byId("file").textContent = told.file;
  document.title = `${told.title} · Laufruhe`;
  controls.build(told.controls, state.edits);
  crank.offer(told.crank, told.openCrank);
  offerObjectives(byId("controls"), told.objectives, state.edits.get("objective")?.[2] ?? 0, (edit) => changed("objective", edit));
  tellFile(told.complaint);
}

/** @param {{version: number, complaint: string}} told that somebody is there, and how the file is */
async function heard(told) {
  tellFile(told.complaint);
  if (told.version === state.version) return;
  state.version = told.version;
  if (told.complaint) return;
  state.held = [];
  moved();
  await begin();
  follow();
}

async function events() {
  try {
    await listen("events", {}, (told) => { heard(told).catch(failed); });
  } catch (error) {
    if (!(error instanceof Gone)) failed(error);
  }
  lost();
}

/** As the file has it. */
function back() {
  state.edits.clear();
  state.held = [];
  moved();
  remember();
  byId("follows").checked = true;
  begin().then(follow).catch(failed);
}

async function save() {
  const { edits, held } = asked();
  const { toml, file } = await ask("save", { edits, held, design: state.handle ? state.handle.design() : {} });
  download(toml, file);
}

/** Keep what is shown, or show what was kept. */
function keep() {
  const kept = { edits: new Map(state.edits), held: [...state.held], design: state.handle.design() };
  comparison.keep(state.handle.measures(), kept, byId("live"));
}

async function showKept() {
  const kept = /** @type {any} */ (comparison.kept?.state);
  if (!kept) return;
  state.edits = new Map(kept.edits);
  state.held = [...kept.held];
  moved();
  remember();
  byId("follows").checked = false;
  await begin();
  await follow();
  state.handle.setDesign(kept.design, {});
  drawDesign();
}

/** @param {string} id @param {() => any} work */
function onClick(id, work) {
  byId(id).addEventListener("click", () => Promise.resolve(work()).catch(failed));
}

async function start() {
  await enter();
  state.edits = new Map(recalled().map((edit) => [edit[1], edit]));
  byId("controls").addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
  onClick("back", back);
  onClick("save", save);
  onClick("keep", keep);
  onClick("show-a", showKept);
  onClick("drop-a", () => comparison.drop());
  onClick("draw", () => trade.draw({ edits: asked().edits, held: state.held }));
  onClick("picture", () => pictures.draw(asked().edits));
  engine.listen();
  // what sticks under the optimum has to know how high that is
  new ResizeObserver(() => document.body.style.setProperty("--status", `${byId("status").offsetHeight}px`)).observe(byId("status"));
  byId("follows").addEventListener("change", () => {
    if (byId("follows").checked && state.design) state.handle?.setDesign(state.design, {});
  });
  await begin();
  events();
  await follow();
}

window.laufruhePage = { state, latencies };
start().catch(failed);
