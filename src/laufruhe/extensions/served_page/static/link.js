// What the page and its server say to each other.

const KEPT = "laufruhe-token";

/** An answer that says why there is none. */
export class Refusal extends Error {}
/** Nobody answers any more. */
export class Gone extends Error {}

let token = "";

/**
 * Keys of the address behind #.
 * @returns {URLSearchParams}
 */
export function addressed() {
  return new URLSearchParams(location.hash.slice(1));
}

/**
 * Write one key of the address; the others stay.
 * @param {string} key
 * @param {string | null} value
 */
export function address(key, value) {
  const keys = addressed();
  if (value === null) keys.delete(key);
  else keys.set(key, value);
  history.replaceState(null, "", `#${keys}`);
}

/**
 * What was changed in the state of another time, or of a link.
 * @returns {[string, string, any][]}
 */
export function recalled() {
  try {
    return JSON.parse(addressed().get("e") || "[]");
  } catch {
    return [];
  }
}

/** Take the token out of the address, or out of what this tab keeps, so that a link that is handed on has none. */
export async function enter() {
  const keys = addressed();
  const [told, ticket] = [keys.get("t"), keys.get("o")];
  address("t", null);
  address("o", null);
  if (ticket) {
    const answer = await (await sent("token", { ticket })).json();
    if (!answer.token) throw new Refusal(answer.error);
    token = answer.token;
  } else {
    token = told || sessionStorage.getItem(KEPT) || "";
  }
  sessionStorage.setItem(KEPT, token);
}

/**
 * @param {string} path
 * @param {object} body
 * @param {AbortSignal} [signal]
 * @returns {Promise<Response>}
 */
async function sent(path, body, signal) {
  try {
    return await fetch(path, {
      method: "POST", body: JSON.stringify(body), signal, cache: "no-store", credentials: "omit",
      headers: { "Content-Type": "application/json", "X-Laufruhe-Token": token },
    });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Gone("the server does not answer");
  }
}

/**
 * Ask once.
 * @param {string} path
 * @param {object} body
 * @returns {Promise<any>} what is answered; `dropped` where a newer request came
 */
export async function ask(path, body) {
  const response = await sent(path, body);
  let answer;
  try {
    answer = await response.json();
  } catch {
    throw new Gone("the server does not answer");
  }
  if (answer.error) throw new Refusal(answer.error);
  return answer;
}

/**
 * Ask for lines that come as they are made.
 * @param {string} path
 * @param {object} body
 * @param {(line: any) => void} each
 * @param {AbortSignal} [signal]
 */
export async function listen(path, body, each, signal) {
  const response = await sent(path, body, signal);
  if (!response.ok || !response.body) throw new Refusal((await response.json()).error);
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const part = await reader.read().catch((error) => {
      if (error.name === "AbortError") throw error;
      throw new Gone("the server does not answer");
    });
    if (part.done) return;
    const lines = (rest + part.value).split("\n");
    rest = lines.pop() || "";
    lines.filter(Boolean).forEach((line) => each(JSON.parse(line)));
  }
}
