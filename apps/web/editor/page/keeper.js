// Where corrections are kept: at the server that the page came from, or in the browser for a page
// that is a file.

/** @typedef {import("./types.js").Corrections} Corrections */
/** @typedef {import("./types.js").Scene} Scene */

/**
 * @typedef {object} News
 * @property {Scene} [scene] where it is new
 * @property {Corrections} corrections
 * @property {boolean} busy cameras and palette do not follow yet
 * @property {string} error why they cannot
 * @property {boolean} [other] the corrections are of another tab
 */

/**
 * @typedef {object} Keeper
 * @property {boolean} fits whether cameras and palette follow
 * @property {(corrections: Corrections) => void} save
 */

const TOKEN = "toonset-token";

/**
 * @param {{scene: Scene, corrections: Corrections} | null} data of a page that is a file
 * @param {(news: News) => void} tell the first news come before this returns
 * @param {(trouble: string) => void} warn
 * @returns {Promise<Keeper>}
 */
export async function createKeeper(data, tell, warn) {
  return data ? keptHere(data, tell) : keptThere(tell, warn);
}

/**
 * @param {{scene: Scene, corrections: Corrections}} data
 * @param {(news: News) => void} tell
 * @returns {Keeper}
 */
function keptHere({ scene, corrections }, tell) {
  const key = `toonset-corrections-${scene.sheet.sha256}`;
  const base = JSON.stringify(corrections);
  const kept = stored(localStorage, key);
  const newest = kept?.base === base ? kept.corrections : corrections;
  tell({ scene, corrections: newest, busy: false, error: "" });
  return {
    fits: false,
    save: (changed) => store(localStorage, key, { base, corrections: changed }),
  };
}

/**
 * @param {(news: News) => void} tell
 * @param {(trouble: string) => void} warn
 * @returns {Promise<Keeper>}
 */
async function keptThere(tell, warn) {
  const token = await enter();
  const headers = { "X-Toonset-Token": token };
  let [revision, number, sceneNumber] = [-1, -1, -1];
  /** @type {Corrections | null} */
  let waiting = null;
  let sending = false;

  /** @param {string} path @param {any} [body] @returns {Promise<Response>} */
  function ask(path, body) {
    if (body === undefined) return fetch(path, { headers });
    const kind = { "Content-Type": "application/json" };
    return fetch(path, { method: "POST", headers: { ...headers, ...kind }, body: JSON.stringify(body) });
  }

  async function look() {
    const answer = await ask(`/api/state?after=${number}&scene=${sceneNumber}`);
    if (!answer.ok) throw new Error("the server does not know this page any more");
    const state = await answer.json();
    number = state.number;
    if (sending || state.revision < revision) return; // its own corrections are newer
    if (state.scene) state.scene.sheet.picture = picture;
    sceneNumber = state.sceneNumber;
    const other = revision >= 0 && state.revision > revision;
    if (state.revision > revision) revision = state.revision;
    tell({ ...state, other });
  }

  async function follow() {
    try {
      for (;;) await look();
    } catch {
      warn("The server has stopped. What you did is kept; run toonset edit again to go on.");
    }
  }

  async function send() {
    sending = true;
    while (waiting) {
      const body = { revision, corrections: waiting };
      waiting = null;
      const answer = await ask("/api/corrections", body);
      if (answer.status === 409) {
        [revision, number, waiting, sending] = [-1, -1, null, false];
        warn("Another tab was faster: this one now shows what is there.");
        return look();
      }
      const said = await answer.json();
      if (answer.status === 503) throw new Error(said.error); // it is about to stop
      if (!answer.ok) warn(`Not kept: ${said.error}`);
      else revision = said.revision;
    }
    sending = false;
  }

  const sheet = await ask("/api/sheet");
  const picture = await sheet.text();
  if (!sheet.ok) throw new Error("This address was used already. Open the one that the terminal shows.");
  await look();
  follow();
  return {
    fits: true,
    save(corrections) {
      waiting = corrections;
      if (!sending) send().catch(() => ((sending = false), warn("Not kept: the server has stopped. Save corrections.json, and lay it into the bundle.")));
    },
  };
}

/** @returns {Promise<string>} the server's token, for the key in the address or as kept by this tab */
async function enter() {
  const key = location.hash.slice(1);
  const kept = sessionStorage.getItem(TOKEN) ?? "";
  if (!key) return kept;
  history.replaceState(null, "", location.pathname);
  const headers = { "Content-Type": "application/json" };
  const answer = await fetch("/api/open", { method: "POST", headers, body: JSON.stringify({ key }) });
  if (!answer.ok) return kept;
  const { token } = await answer.json();
  sessionStorage.setItem(TOKEN, token);
  return token;
}

/** @param {Storage} storage @param {string} key @returns {any} */
export function stored(storage, key) {
  try {
    return JSON.parse(storage.getItem(key) ?? "null");
  } catch {
    return null;
  }
}

/** @param {Storage} storage @param {string} key @param {any} value */
export function store(storage, key, value) {
  try {
    storage.setItem(key, JSON.stringify(value));
  } catch {
    // it is full, or the browser keeps nothing for files: the page works on
  }
}
