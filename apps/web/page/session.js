// What a live session adds to the page: how it stands, who else is there, and moving things.

const byId = (id) => document.getElementById(id);
const [link, text, hint, reload, tools, picked, toast] = [
  "link",
  "link-text",
  "link-hint",
  "link-reload",
  "tools",
  "picked",
  "toast",
].map(byId);
const [across, upright, another, remove, reset] = ["across", "upright", "another", "remove", "reset"].map(byId);

// How long what went wrong stays to be read, milliseconds.
const READ = 6000;

// What the reader can do about a no.
const HINTS = {
  token: "Open this page with ?token=… at the end of its address, as whoever runs the server gave it to you.",
  scene: "The server lights another scene now. Reload the page to fetch it.",
  version: "The server is of another version than this page. Reload the page.",
  full: "The page tries again by itself.",
  replaced: "Reload the page to go on here.",
};
const RELOADS = ["scene", "version", "replaced", "malformed", "failed"];

/** Bits a second, as in `500k` or `2M`; undefined for anything else. */
export function parseBits(word) {
  const [, number, unit] = /^(\d+(?:\.\d+)?)\s*([kM]?)$/.exec(word ?? "") ?? [];
  return number === undefined ? undefined : Math.round(Number(number) * { "": 1, k: 1e3, M: 1e6 }[unit]);
}

/** Shows and steers the session of a viewer, once there is one. */
export class SessionPanel {
  #viewer = null;
  #hide;
  #moving = null;

  /** Functions for the viewer's options. */
  get callbacks() {
    return {
      onLive: (status) => this.show(status),
      onRejected: (message) => this.say(message),
      onPicked: () => this.#show(),
    };
  }

  attach(viewer) {
    this.#viewer = viewer;
    reload.onclick = () => location.reload();
    across.onclick = () => this.#move("across");
    upright.onclick = () => this.#move("upright");
    another.onclick = () => this.#try(() => viewer.addInstance(viewer.picked.instance));
    remove.onclick = () => this.#remove();
    reset.onclick = () => this.#try(() => viewer.reset());
    addEventListener("keydown", (event) => {
      const typing = event.target.closest("select, input, dialog");
      if (!typing && (event.key === "Delete" || event.key === "Backspace") && this.#mayChange() && viewer.picked) {
        event.preventDefault();
        this.#remove();
      }
    });
    this.#show();
  }

  /** Does what may be refused, and says so. */
  try(act) {
    this.#try(act);
  }

  say(message) {
    toast.textContent = message;
    toast.hidden = false;
    clearTimeout(this.#hide);
    this.#hide = setTimeout(() => (toast.hidden = true), READ);
  }

  /** Called with every new status, and twice a second. */
  show(live) {
    link.hidden = !live;
    if (!live) return;
    const words = sentence(live);
    // What a screen reader would say again need not be set again.
    if (text.textContent !== words) text.textContent = words;
    link.dataset.state = live.state === "live" && !live.hasLight ? "connecting" : live.state;
    const help = live.state === "refused" || live.reason === "full" ? (HINTS[live.reason] ?? "") : "";
    hint.textContent = help;
    hint.hidden = help === "";
    reload.hidden = !(live.state === "refused" && RELOADS.includes(live.reason));
    byId("viewers").textContent = live.connected ? String(live.viewers) : "–";
    byId("light-age").textContent = live.age === null ? "–" : milliseconds(1000 * live.age);
    const stages = { step: live.stepMs, queue: live.queueMs, network: live.networkMs, apply: live.applyMs };
    for (const [name, value] of Object.entries(stages)) byId(name).textContent = milliseconds(value);
    byId("transport").textContent = live.transport;
    byId("behind").textContent = live.behind.toLocaleString("en");
    for (const row of document.querySelectorAll("#figures .live")) row.hidden = false;
    byId("age-row").hidden = true;
    this.#show(live);
  }

  #show(live = this.#viewer?.live) {
    const mayChange = live?.role === "interact";
    tools.hidden = !mayChange || !this.#viewer;
    document.body.classList.toggle("has-tools", !tools.hidden);
    if (tools.hidden) return;
    const held = this.#viewer.picked;
    picked.textContent = held ? held.name : "";
    another.disabled = !(held && this.#viewer.canAdd(held.instance));
    remove.disabled = !held;
    reset.disabled = !this.#viewer.isEdited;
  }

  #mayChange() {
    return this.#viewer?.live?.role === "interact";
  }

  #move(way) {
    this.#moving = this.#moving === way ? null : way;
    this.#viewer.setMoving(this.#moving);
    across.setAttribute("aria-pressed", String(this.#moving === "across"));
    upright.setAttribute("aria-pressed", String(this.#moving === "upright"));
  }

  #remove() {
    this.#try(() => this.#viewer.removeInstance(this.#viewer.picked.instance));
  }

  #try(act) {
    try {
      act();
    } catch (error) {
      this.say(error.message);
    }
  }
}

function sentence(live) {
  // Of scenes the server tells hashes, which say nothing to people.
  const after = live.message && live.reason !== "scene" ? `: ${live.message}` : "";
  if (live.state === "connecting") return "connecting";
  if (live.state === "refused") return `not live${after}`;
  if (live.state === "reconnecting") {
    const wait = live.retryIn === null ? "now" : `in ${Math.ceil(live.retryIn)} s`;
    // A server that is full is there; one that says nothing may not be.
    return live.reason === "full" ? `the server is full: trying again ${wait}` : `reconnecting ${wait}`;
  }
  if (!live.hasLight && live.started > 0 && live.started < 1) {
    return `connected; the server makes its light: ${Math.floor(100 * live.started)} %`;
  }
  if (!live.hasLight) return "connected, waiting for the first light";
  const others = live.viewers > 1 ? ` · ${live.viewers} viewers` : "";
  return `live${live.role === "view" ? " · view only" : ""}${others}`;
}

function milliseconds(value) {
  return value < 999.5 ? `${value.toFixed(value < 9.95 ? 1 : 0)} ms` : `${(value / 1000).toFixed(1)} s`;
}
