// The handle for pages: createViewer(canvas, options) shows a scene and its light in a canvas.
//
// dapple.d.ts documents every option and method. This file owns requests, the clock and events; the compiled program
// beside it (dapple_web_bg.wasm) owns the canvas.

import init, { Core } from "./dapple_web.js";
import { fetchBytes, fetchChunks } from "./fetch.js";
import { attachControls } from "./input.js";
import { LiveLink, liveUrl } from "./live.js";

// Work between pictures, milliseconds at a stretch.
const SLICE_MS = 8;

// The program is fetched once, however many viewers a page has.
let program;

/** Shows `options.scene`, lit by `options.stream` or `options.live`, in `canvas`. Rejects with a readable Error where that cannot be. */
export async function createViewer(canvas, options = {}) {
  const progress = (stage, loaded, total) => options.onProgress?.({ stage, loaded, total });
  const viewer = new Viewer(canvas, options, progress);
  try {
    await viewer._open();
    return viewer;
  } catch (error) {
    viewer.dispose();
    throw error;
  }
}

class Viewer {
  #canvas;
  #options;
  #progress;
  #core = null;
  #link = null;
  #moving = null;
  #picked = null;
  #abort = new AbortController();
  #texels = 4096;
  #lastStats = 0;
  #ready = Promise.withResolvers?.() ?? withResolvers();
  #streamed = false;
  #detach = [];
  #settled = 0;
  #working = false;
  // A message to itself comes at once, a timer after 4 ms: half as much again as the work before it.
  #later = new MessageChannel();

  constructor(canvas, options, progress) {
    this.#canvas = canvas;
    this.#options = options;
    this.#progress = progress;
    this.#later.port1.onmessage = () => this.#workOn();
    // Whoever does not wait for it still learns of errors by onError.
    this.#ready.promise.catch(() => {});
  }

  async _open() {
    const { scene, stream, live, backend = "auto" } = this.#options;
    if (!scene) throw new Error("No scene was named: give options.scene the address of a .glb file.");
    program ??= fetchBytes(new URL("./dapple_web_bg.wasm", import.meta.url), null, (loaded, total) =>
      this.#progress("program", loaded, total),
    ).then((bytes) => init({ module_or_path: bytes }));
    try {
      await program;
    } catch (error) {
      program = undefined;
      throw error;
    }
    this.#fitCanvas();
    try {
      this.#core = await Core.open(this.#canvas, backend);
    } catch (error) {
      throw error.name === "NoGraphics" ? new NoGraphicsError(error.message) : error;
    }
    const url = new URL(scene, document.baseURI);
    const bytes = await fetchBytes(url, this.#abort.signal, (loaded, total) => this.#progress("scene", loaded, total));
    this.#living();
    const name = decodeURIComponent(url.pathname.split("/").pop() || "scene.glb");
    const { shadowResolution = 0, samples = 0, animation, spares = [] } = this.#options;
    try {
      const pairs = Uint32Array.from(spares.flatMap(({ instance, count }) => [instance, count]));
      this.#core.loadScene(name, bytes, shadowResolution, samples, animation, pairs);
    } catch (error) {
      throw new Error(`The scene ${url.href} cannot be shown: ${error.message ?? error}`);
    }
    this.#apply();
    this.#listen();
    requestAnimationFrame(this.#frame);
    if (live) this.#openLive(liveUrl(live));
    else if (stream) this.#fetchStream(new URL(stream, document.baseURI)).catch((error) => this.#fail(error));
    else this.#streamed = true;
  }

  #apply() {
    const { method, view, split, camera, time, loop = true, paused = false, fade, live } = this.#options;
    const { fallback, radius = NaN, guardBand = NaN, aoPreset = "high", halfResolution } = this.#options;
    const { secondCamera = 0, areaLights = true } = this.#options;
    if (method) this.setMethod(method);
    if (fallback) this.#core.setFallback(fallback);
    this.#core.setScreenSpace(radius, guardBand, aoPreset, halfResolution, secondCamera);
    this.setAreaLights(areaLights);
    if (view) this.setView(view);
    if (split) this.setSplit(split.position, split.method);
    if (camera) this.setCamera(camera);
    if (fade !== undefined) this.#core.setFade(fade);
    // In a live session time is everyone's.
    if (live) return;
    this.#core.setLooping(loop);
    this.#core.setPlaying(!paused);
    if (time) this.seek(time);
  }

  #openLive(url) {
    const { token, bits = 0, moq, transport = "auto" } = this.#options;
    this.#core.openLive(token || undefined, bits, Math.floor(Math.random() * 2 ** 32));
    const way = { moq: transport === "websocket" ? null : moq, bits };
    this.#link = new LiveLink(url, way, () => this.#core, {
      status: () => this.#options.onLive?.(this.live),
      light: () => {
        if (!this.#streamed) this.#progress("stream", 1, 1);
        this.#streamed = true;
      },
      progress: (loaded, total) => this.#progress("stream", loaded, total),
      rejected: (message) => this.#options.onRejected?.(message),
    });
  }

  async #fetchStream(url) {
    const { time = 0 } = this.#options;
    let sought = !time;
    await fetchChunks(
      url,
      this.#abort.signal,
      (chunk) => {
        if (!this.#core) return;
        try {
          this.#core.pushStream(chunk);
        } catch (error) {
          throw new Error(`The stream ${url.href} cannot be played: ${error.message ?? error}`);
        }
        if (!sought) {
          // As far as it has come.
          this.seek(time);
          sought = this.time >= time;
        }
      },
      (loaded, total) => this.#progress("stream", loaded, total),
    );
    this.#living();
    try {
      this.#core.finishStream();
    } catch (error) {
      throw new Error(`The stream ${url.href} cannot be played: ${error.message ?? error}`);
    }
    this.#streamed = true;
  }

  #listen() {
    const { controls = true, autoResize = true } = this.#options;
    if (controls) {
      const hand = {
        moving: () => (this.#mayChange() ? this.#moving : null),
        mayMove: () => this.#mayChange(),
        grab: (x, y) => this.#grab(x, y),
        drag: (x, y, upright) => this.#drag(x, y, upright),
        release: () => this.#core?.release(),
      };
      this.#detach.push(attachControls(this.#canvas, this.#core, () => this.#core !== null, hand));
    }
    if (autoResize && globalThis.ResizeObserver) {
      const observer = new ResizeObserver(() => this.#fitCanvas());
      observer.observe(this.#canvas);
      this.#detach.push(() => observer.disconnect());
    }
    const lost = (event) => {
      event.preventDefault();
      this.#fail(new Error("The graphics card was lost (webglcontextlost). Reload the page to go on."));
    };
    this.#canvas.addEventListener("webglcontextlost", lost);
    this.#detach.push(() => this.#canvas.removeEventListener("webglcontextlost", lost));
  }

  #frame = (now) => {
    if (!this.#core) return;
    requestAnimationFrame(this.#frame);
    if (!this.#working) this.#workOn();
    this.#draw();
    if (!this.#core) return;
    // What was fetched last is taken by the first of these, causes work from the second on, and shows in the third.
    this.#settled = this.#streamed && !this.#working ? this.#settled + 1 : 0;
    if (this.#settled === 3) this.#ready.resolve();
    if (this.#options.onStats && now - this.#lastStats > (this.#options.statsInterval ?? 500)) {
      this.#lastStats = now;
      this.#options.onStats(this.stats);
    }
  };

  // Draws what has changed; true if anything had to be drawn.
  #draw() {
    try {
      return this.#core?.frame(performance.now() / 1000) ?? false;
    } catch (error) {
      this.#fail(error instanceof Error ? error : new Error(String(error)));
      return false;
    }
  }

  // Goes on with what a snapshot causes, a few milliseconds at a time, between pictures however long those take.
  #workOn = () => {
    if (!this.#core) return;
    const start = performance.now();
    let before = start;
    try {
      for (;;) {
        const { done, total } = this.#core.work(this.#texels);
        const after = performance.now();
        const complete = done >= total;
        if (this.#working || !complete) this.#progress("light", done, total);
        this.#working = !complete;
        if (complete) return;
        // Pieces of about 2 ms.
        if (after - before < 1) this.#texels = Math.min(this.#texels * 2, 1 << 20);
        else if (after - before > 4) this.#texels = Math.max(this.#texels >> 1, 64);
        if (after - start > SLICE_MS) break;
        before = after;
      }
      this.#later.port2.postMessage(null);
    } catch (error) {
      this.#fail(error instanceof Error ? error : new Error(String(error)));
    }
  };

  #fail(error) {
    if (this.#abort.signal.aborted) return;
    this.#ready.reject(error);
    this.dispose();
    if (this.#options.onError) this.#options.onError(error);
    else console.error(error);
  }

  #living() {
    if (!this.#core) throw new Error("The viewer was disposed of.");
    return this.#core;
  }

  #fitCanvas() {
    if (this.#options.autoResize === false) return;
    const { maxPixelRatio = 2 } = this.#options;
    const ratio = Math.min(globalThis.devicePixelRatio || 1, maxPixelRatio);
    const { clientWidth, clientHeight } = this.#canvas;
    if (clientWidth > 0 && clientHeight > 0) this.resize(Math.round(clientWidth * ratio), Math.round(clientHeight * ratio));
  }

  #mayChange() {
    return this.#core !== null && this.#link !== null && this.#core.liveRole() === "interact";
  }

  // A place in the canvas, in CSS pixels, as pixels of the picture.
  #pixels(x, y) {
    const { width, height, clientWidth, clientHeight } = this.#canvas;
    return [(x * width) / (clientWidth || 1), (y * height) / (clientHeight || 1)];
  }

  #grab(x, y) {
    const picked = this.#living().grab(...this.#pixels(x, y));
    if (picked) this.#pick(picked);
    return picked !== null;
  }

  #pick(picked) {
    this.#picked = picked;
    this.#options.onPicked?.(picked);
  }

  #drag(x, y, upright) {
    try {
      this.#living().drag(...this.#pixels(x, y), upright);
      this.#link?.pump();
    } catch (error) {
      this.#options.onRejected?.(error.message);
    }
  }

  #send(event) {
    this.#living().sendEvent(JSON.stringify(event));
    this.#link?.pump();
  }

  #edit(change) {
    this.#send({ event: "edit", change });
  }

  get ready() {
    return this.#ready.promise;
  }

  get paused() {
    return !this.stats.playing;
  }

  get time() {
    return this.stats.time;
  }

  get duration() {
    return this.stats.duration;
  }

  get stats() {
    const stats = this.#living().stats(performance.now() / 1000);
    stats.live = this.live;
    return stats;
  }

  get live() {
    if (!this.#link) return null;
    const live = this.#living().liveStatus(performance.now() / 1000);
    return Object.assign(live, this.#link.status, { applyMs: this.#link.applyMs });
  }

  get edits() {
    return JSON.parse(this.#living().edits() ?? "null");
  }

  get isEdited() {
    return this.#living().isEdited();
  }

  get picked() {
    return this.#picked && this.#living().isThere(this.#picked.instance) ? this.#picked : null;
  }

  get warnings() {
    return this.#living().warnings();
  }

  get cameras() {
    return this.#living().cameraPaths();
  }

  play() {
    if (this.#link) this.#send({ event: "play" });
    else this.#living().setPlaying(true);
  }

  pause() {
    if (this.#link) this.#send({ event: "pause" });
    else this.#living().setPlaying(false);
  }

  seek(time) {
    if (this.#link) this.#send({ event: "seek", time_s: time });
    else this.#living().seek(time);
  }

  pick(x, y) {
    const picked = this.#living().pick(...this.#pixels(x, y));
    if (picked) this.#pick(picked);
    return picked;
  }

  getPlacement(node) {
    return this.#living().placement(node);
  }

  moveNode(node, placement) {
    const now = this.getPlacement(node);
    if (!now) throw new Error(`There is no node ${node} that could be moved.`);
    this.#edit({ edit: "place", node, placement: { ...now, ...placement } });
  }

  releaseNode(node) {
    this.#edit({ edit: "release", node });
  }

  removeInstance(instance) {
    this.#edit({ edit: "remove", instance });
  }

  restoreInstance(instance) {
    this.#edit({ edit: "restore", instance });
  }

  canAdd(like) {
    return this.#living().canAdd(like);
  }

  addInstance(like, placement) {
    const beside = this.#living().placeBeside(like);
    if (!beside) throw new Error(`There is no instance ${like} that another could be like.`);
    this.#send({ event: "add", like, placement: { ...beside, ...placement } });
  }

  setLight(light, setting) {
    if (setting) this.#edit({ edit: "light", light, color: setting.color, intensity: setting.intensity });
    else this.#edit({ edit: "reset-light", light });
  }

  reset() {
    this.#edit({ edit: "reset" });
  }

  setMoving(way) {
    this.#moving = way;
    this.#canvas.style.cursor = way ? "move" : "";
  }

  setLoop(loop) {
    this.#living().setLooping(loop);
  }

  setMethod(method) {
    this.#living().setMethod(method);
  }

  setAreaLights(on) {
    this.#living().setAreaLights(on);
  }

  setView(view) {
    this.#living().setView(view);
  }

  setSplit(position, method = "none") {
    if (position === null || position === undefined) this.#living().clearSplit();
    else this.#living().setSplit(position, method);
  }

  getCamera() {
    return this.#living().camera();
  }

  setCamera(camera) {
    const core = this.#living();
    if (camera === "fit") core.fit();
    else if (typeof camera === "string") core.followPath(camera);
    else core.lookAt(Float32Array.from(camera.eye), Float32Array.from(camera.target), camera.yfovDegrees ?? 50);
  }

  setWalking(walking) {
    this.#living().setWalking(walking);
  }

  rotate(dx, dy) {
    this.#living().rotate(dx, dy);
  }

  pan(dx, dy) {
    this.#living().pan(dx, dy);
  }

  zoom(factor) {
    this.#living().zoom(factor);
  }

  async screenshot(type = "image/png") {
    this.#living().invalidate();
    // A canvas holds its picture only until the browser has shown it.
    if (!this.#draw()) throw new Error("The browser does not let the page draw now.");
    const blob = await new Promise((resolve) => this.#canvas.toBlob(resolve, type));
    if (!blob) throw new Error("The browser cannot write this picture.");
    return blob;
  }

  resize(width, height) {
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      this.#canvas.width = width;
      this.#canvas.height = height;
    }
    this.#core?.resize(width, height);
    // A canvas that was resized is empty until it is drawn to.
    this.#draw();
  }

  dispose() {
    this.#abort.abort();
    this.#link?.dispose();
    this.#later.port1.close();
    for (const detach of this.#detach.splice(0)) detach();
    const core = this.#core;
    this.#core = null;
    try {
      core?.free();
    } catch {
      // A program that has failed cannot tidy up after itself.
    }
  }
}

/** Neither WebGPU nor WebGL2 is to be had. */
export class NoGraphicsError extends Error {
  constructor(reason) {
    super(
      "This browser shows no 3D graphics: neither WebGPU nor WebGL2 works here. A current browser on a machine with " +
        `graphics drivers has at least one of them; it may be switched off in the browser's settings. (${reason})`,
    );
    this.name = "NoGraphicsError";
  }
}

function withResolvers() {
  const result = {};
  result.promise = new Promise((resolve, reject) => Object.assign(result, { resolve, reject }));
  return result;
}
