// A live session over WebTransport (Media over QUIC), as an object that is used like a WebSocket. Its program is fetched only where it is needed.

let program;

// The page's own program does not need this one, nor does a page without WebTransport.
async function load() {
  program ??= import("./dapple_web_moq.js").then(async (module) => {
    await module.default({ module_or_path: new URL("./dapple_web_moq_bg.wasm", import.meta.url) });
    return module;
  });
  try {
    return await program;
  } catch (error) {
    program = undefined;
    throw error;
  }
}

// A relay at an address of http: tells the hash of its certificate there.
async function certified(place) {
  if (!place) throw new Error("the server serves no MoQ");
  if (!place.url.startsWith("http:")) return place;
  const url = new URL(place.url);
  const response = await fetch(new URL("/certificate.sha256", url));
  if (!response.ok) throw new Error(`${url} does not tell the hash of its certificate`);
  const certificate = (await response.text()).trim();
  url.protocol = "https:";
  return { ...place, url: url.href, certificate };
}

/** Whether this page may and can use it. */
export function hasWebTransport() {
  return isSecureContext && "WebTransport" in globalThis;
}

export class MoqSocket {
  #link = null;
  #state = WebSocket.CONNECTING;
  onopen = null;
  onmessage = null;
  onclose = null;

  /** Joins what `place` names (see MoqPlace in dapple.d.ts; a promise of it will do), with the hash of the scene that was loaded and the most bits a second that are wanted. */
  constructor(place, scene, bits) {
    const viewer = [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
    Promise.all([load(), Promise.resolve(place).then(certified)]).then(
      ([{ MoqLink }, { url, name, certificate }]) => {
        if (this.#state !== WebSocket.CONNECTING) return;
        const address = url.replace("{viewer}", viewer);
        const opened = () => {
          if (this.#state !== WebSocket.CONNECTING) return;
          this.#state = WebSocket.OPEN;
          this.onopen?.(new Event("open"));
        };
        const came = (data) => this.#state === WebSocket.OPEN && this.onmessage?.({ data });
        const closed = (reason) => this.#ended(reason);
        this.#link = new MoqLink(address, name, certificate, scene, viewer, bits || undefined, opened, came, closed);
      },
      (error) => this.#ended(error.message),
    );
  }

  get readyState() {
    return this.#state;
  }

  send(text) {
    this.#link?.send(text);
  }

  close() {
    if (this.#state >= WebSocket.CLOSING) return;
    this.#state = WebSocket.CLOSING;
    this.#link?.close();
  }

  #ended(reason) {
    if (this.#state === WebSocket.CLOSED) return;
    this.#state = WebSocket.CLOSED;
    if (reason) console.info(`WebTransport: ${reason}`);
    this.onclose?.({ reason });
  }
}
