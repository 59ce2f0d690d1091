// The page of a problem: sends requests and shows answers.
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

/** Rest before the whole problem is solved, and before a repeated request [ms]. */
const [REST, RETRY, MOST_RETRIES] = [350, 100, 3];
/** Duration of a model above which it is opened only when sliders rest [ms]. */
const SLOW = 40;
const CRANK = ["star", "crank"];

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

/** Change a number, or reset it to the file's value. */
function changed(name, edit) {
  if (!inputAt) inputAt = performance.now();
  if (edit) state.edits.set(name, edit);
  else state.edits.delete(name);
  // a number fixed by hand is not fixed otherwise
  state.held = state.held.filter((held) => held[1] !== name);
  moved();
  remember();
  follow();
}

/** Start new settings; existing claims are about earlier ones. */
function moved() {
  state.position += 1;
  state.refused = false;
  complain("");
  pictures.offer(false);
  trade.withdraw();
  crank.check(ranked());
  mark();
}

/** Label claims about earlier settings. */
function mark() {
  const isOld = state.claim !== null && state.claim.position !== state.position;
  const [words, why] = state.refused ? ["Last valid settings", "the new ones are refused"] : ["Earlier settings", "the new ones are being computed"];
  tellMark(isOld ? words : "");
  if (isOld) state.handle?.withdraw(`${words}; ${why}.`);
}

/** Key of a ranking of cranks: all settings but the crank. */
const ranked = () => JSON.stringify([state.version, [...state.edits.values()].filter((edit) => !CRANK.includes(edit[1]))]);

/** Write the state into the address when nothing moves. */
function remember() {
  clearTimeout(state.writing);
  state.writing = setTimeout(written, REST);
}

function written() {
  address("e", state.edits.size ? JSON.stringify([...state.edits.values()]) : null);
  const star = state.edits.get("star");
  crank.choose(star ? JSON.stringify(star[2]) : "");
}

const asked = () => ({ edits: [...state.edits.values()], held: state.held, has: state.isLater ? "later" : state.key,
  position: state.position });

/** Request the fast optimum; during a request only the newest state waits. */
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
      // a fixed value may no longer fit
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

/** Schedule the solution of the whole problem. */
function rest() {
  clearTimeout(state.resting);
  state.resting = setTimeout(rested, REST);
}

/** Draw waiting pictures, then solve the whole problem. */
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

/** Show the solution of the whole problem: its claim, and the model of its fixed numbers. */
async function settled(answer) {
  crank.tell(answer.ranking, JSON.stringify(state.edits.get("star")?.[2] ?? answer.ranking[0]?.orders[0]?.star ?? ""), ranked());
  const isOther = JSON.stringify(answer.holds) !== JSON.stringify(state.held);
  if (answer.design && isOther) {
    state.held = answer.holds;
    trade.withdraw();
    const mine = state.position;
    const model = await ask("follow", asked());
    if (mine !== state.position) return;
    if (!model.dropped) await draw(model);
  }
  answer.holds.filter((/** @type {Edit} */ edit) => edit[0] === "fix").forEach((/** @type {Edit} */ edit) => controls.place(edit[1], parseFloat(edit[2])));
  tell(answer);
  pictures.offer(Boolean(answer.design));
  // without sliders the pictures are all there is
  if (answer.design && !state.handle) pictures.draw(asked().edits).catch(failed);
}

async function show(answer) {
  if (answer.claim.position === state.position) complain("");
  const isDrawn = answer.engine !== undefined || answer.key === state.key;
  byId("live").classList.toggle("stale", !isDrawn);
  await draw(answer);
  tell(answer, isDrawn);
}

/** Replace the model if an answer has one. */
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

/** Request exact values of measures that do not follow sliders. */
async function measure() {
  const [values, mine] = [state.handle.design(), state.position];
  const found = await ask("measure", { edits: [...state.edits.values()], held: state.held, design: values });
  if (found.limits && mine === state.position && !state.gone) state.handle?.setExact({ ...found, values });
}

function failed(error) {
  if (error instanceof Gone) lost();
  else if (error instanceof Refusal) {
    complain(error.message);
  } else throw error;
}

/** Handle the end of the server: the loaded model still works. */
function lost() {
  if (state.gone) return;
  state.gone = true;
  clearTimeout(state.resting);
  controls.disable(true);
  ["back", "draw", "save"].forEach((id) => { byId(id).disabled = true; });
  tellGone(byId("file").textContent);
}

function picked(point) {
  byId("follows").checked = false;
  state.handle.setDesign(point.design, {});
  drawDesign();
}

/** Load the problem, or reload a changed file. */
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

/** Reset to the file. */
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

/** Store the displayed design, or show the stored one. */
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
  // elements below the sticky optimum need its height
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
