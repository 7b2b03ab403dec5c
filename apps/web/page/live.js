// The connection of a live session: WebTransport where there is such, else a WebSocket; it comes back by itself. What is said over it is the
// program's (liveText, liveBytes, liveNext of Core).

import { MoqSocket, hasWebTransport } from "./moq.js";

// How often it is asked whether there is anything to say, milliseconds.
const ASK_EVERY = 50;
// A server from which nothing is heard for so long is gone, and so is one that does not answer a knock, milliseconds.
const SILENCE = 10_000;

/** The address of a session: `ws:` beside a page of `http:`, `wss:` beside one of `https:`. */
export function liveUrl(address) {
  const url = new URL(address, document.baseURI);
  if (url.protocol === "http:") url.protocol = "ws:";
  if (url.protocol === "https:") url.protocol = "wss:";
  return url;
}

export class LiveLink {
  #url;
  #core;
  #on;
  #socket = null;
  #timer;
  #retry = null;
  #heardAt = 0;
  #wasOpen = false;
  #applySeconds = 0;
  // Finds where it is over WebTransport; null for a WebSocket.
  #findMoq;
  #bits;
  #isMoq = false;
  // Whether it ever carried this session, and how often in a row it then could not be opened.
  #moqWorks = false;
  #moqFailures = 0;
  #isLost = false;
  #detach = [];
  // connecting, live, reconnecting, refused, closed
  #state = "connecting";
  #retryAt = 0;
  #reason = null;
  #message = null;

  // `moq` says where the session is over WebTransport, or is asked for it before each connection (null for a WebSocket alone), `bits` the most a second that is wanted. `core()` gives the program's side, null once it is gone. `on` has functions: status(), light(), progress(loaded,
  // total), rejected(message).
  constructor(url, { moq = null, bits = 0 }, core, on) {
    this.#url = url;
    const find = typeof moq === "function" ? moq : () => moq;
    this.#findMoq = moq && hasWebTransport() ? find : null;
    this.#bits = bits;
    this.#core = core;
    this.#on = on;
    this.#timer = setInterval(() => this.#pump(), ASK_EVERY);
    this.#listen(document, "visibilitychange", () => document.visibilityState === "visible" && this.#now());
    this.#listen(window, "online", () => this.#now());
    this.#listen(window, "pagehide", () => this.#leave());
    // A page that comes out of the browser's cache goes on.
    this.#listen(window, "pageshow", (event) => event.persisted && this.#now());
    this.#connect();
  }

  /** How it stands: see LiveStatus in dapple.d.ts. */
  get status() {
    const waits = this.#state === "reconnecting" && this.#retry !== null;
    return {
      state: this.#state,
      retryIn: waits ? Math.max(0, (this.#retryAt - performance.now()) / 1000) : null,
      reason: this.#reason,
      message: this.#message,
      transport: this.#isMoq ? "WebTransport" : "WebSocket",
    };
  }

  /** Milliseconds that a message of light takes to be applied, smoothed. */
  get applyMs() {
    return 1000 * this.#applySeconds;
  }

  /** Says what there is to say now. */
  pump() {
    this.#pump();
  }

  dispose() {
    this.#leave();
    this.#state = "closed";
    clearInterval(this.#timer);
    for (const detach of this.#detach.splice(0)) detach();
  }

  #listen(target, type, handler) {
    target.addEventListener(type, handler);
    this.#detach.push(() => target.removeEventListener(type, handler));
  }

  #connect() {
    clearTimeout(this.#retry);
    this.#retry = null;
    this.#wasOpen = false;
    this.#heardAt = performance.now();
    let socket;
    try {
      const scene = this.#core()?.liveScene();
      this.#isMoq = this.#findMoq !== null && scene !== undefined;
      socket = this.#isMoq ? new MoqSocket(this.#place(), scene, this.#bits) : new WebSocket(this.#url);
    } catch (error) {
      const message = `${this.#url} is no address of a live session: ${error.message}`;
      // Whoever makes this knows it only once it is made.
      queueMicrotask(() => this.#refuse({ reason: "address", message }));
      return;
    }
    this.#socket = socket;
    socket.binaryType = "arraybuffer";
    // What an old socket still says is not listened to.
    const ours = (act) => (event) => this.#socket === socket && act(event);
    socket.onopen = ours(() => {
      this.#wasOpen = true;
      if (this.#isMoq) [this.#moqWorks, this.#moqFailures] = [true, 0];
      this.#heardAt = performance.now();
      this.#core()?.liveConnected(performance.now() / 1000);
      this.#pump();
    });
    socket.onmessage = ours((event) => this.#take(event.data));
    socket.onclose = ours(() => {
      if (this.#isMoq && !this.#wasOpen && this.#givesUpMoq()) {
        this.#drop();
        this.#connect();
        return;
      }
      this.#broke();
    });
  }

  #take(data) {
    const core = this.#core();
    if (!core) return;
    const start = performance.now();
    this.#heardAt = start;
    try {
      if (typeof data === "string") {
        const news = core.liveText(data);
        if (news === "welcome") this.#become("live", null, null);
        else if (news === "state") this.#on.status();
        else if (news) this.#on.rejected(news.slice("rejected: ".length));
      } else {
        const isWhole = core.liveBytes(new Uint8Array(data), start / 1000);
        if (isWhole) {
          const took = (performance.now() - start) / 1000;
          this.#applySeconds += 0.1 * (took - this.#applySeconds);
          this.#on.light();
        } else {
          const { loaded, total } = core.liveProgress();
          if (total > 0) this.#on.progress(loaded, total);
        }
      }
    } catch (error) {
      if (error.retry) this.#broke(error);
      else this.#refuse(error);
      return;
    }
    this.#pump();
  }

  #pump() {
    const core = this.#core();
    if (!core || !this.#socket) return;
    if (performance.now() - this.#heardAt > SILENCE && this.#mayBeGone(core)) {
      if (this.#isMoq && !this.#wasOpen) this.#givesUpMoq();
      this.#broke();
      return;
    }
    if (this.#socket.readyState !== WebSocket.OPEN) return;
    for (;;) {
      const message = core.liveNext(performance.now() / 1000);
      if (message === undefined) return;
      this.#socket.send(message);
    }
  }

  // A server that starts again has another name.
  async #place() {
    this.#isLost = true;
    const place = await this.#findMoq();
    this.#isLost = false;
    if (!place) this.#moqWorks = false;
    return place;
  }

  // UDP may be closed to this viewer and the page's own way open; what worked before is tried some times more. While nobody says where it is, the server is
  // gone, whichever the way.
  #givesUpMoq() {
    if (this.#isLost && this.#moqWorks) return false;
    this.#moqFailures += 1;
    if (this.#moqWorks && this.#moqFailures < 4) return false;
    this.#findMoq = null;
    return true;
  }

  // A server that is still making its first light says nothing: that is no silence.
  #mayBeGone(core) {
    return !this.#wasOpen || core.liveHears();
  }

  // The connection is no more; the next is tried after a while.
  #broke(error = null) {
    this.#drop();
    const core = this.#core();
    if (!core) return;
    const wait = 1000 * core.liveDisconnected();
    this.#retryAt = performance.now() + wait;
    this.#retry = setTimeout(() => this.#connect(), wait);
    this.#become("reconnecting", error?.reason ?? null, error?.message ?? null);
  }

  #refuse(error) {
    this.#drop();
    this.#core()?.liveDisconnected();
    this.#become("refused", error.reason ?? "failed", error.message ?? String(error));
  }

  #drop() {
    clearTimeout(this.#retry);
    this.#retry = null;
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  #leave() {
    const core = this.#core();
    if (core && this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(core.liveBye());
    if (this.#socket) core?.liveDisconnected();
    this.#drop();
    if (this.#state !== "refused") this.#state = "reconnecting";
  }

  // There is reason to think that it works now.
  #now() {
    if (this.#state === "reconnecting" && !this.#socket) this.#connect();
  }

  #become(state, reason, message) {
    [this.#state, this.#reason, this.#message] = [state, reason, message];
    this.#on.status();
  }
}
