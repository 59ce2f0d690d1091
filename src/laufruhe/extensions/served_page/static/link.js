// Communication between page and server.

const KEPT = "laufruhe-token";

/** An error answer. */
export class Refusal extends Error {}
/** The server has ended. */
export class Gone extends Error {}

let token = "";

/** Keys of the address behind #. */
export function addressed() {
  return new URLSearchParams(location.hash.slice(1));
}

/** Write one key of the address; the others stay. */
export function address(key, value) {
  const keys = addressed();
  if (value === null) keys.delete(key);
  else keys.set(key, value);
  history.replaceState(null, "", `#${keys}`);
}

/** Edits of a stored state or of a link. */
export function recalled() {
  try {
    return JSON.parse(addressed().get("e") || "[]");
  } catch {
    return [];
  }
}

/** Move the token from the address into the tab's storage, so that shared links contain none. */
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
 * Send one request.
 * @returns {Promise<any>} the answer; `dropped` if a newer request came
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

/** Request lines that arrive as they are made. */
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
