// The page around the viewer: what is shown comes from the address (?scene=…&stream=…&backend=…) or from viewer.json.

import { NoGraphicsError, createViewer } from "./dapple.js";
import { SessionPanel, parseBits } from "./session.js";

const byId = (id) => document.getElementById(id);
const [canvas, ui, loading, stage, bar, message] = ["view", "ui", "loading", "stage", "progress", "message"].map(byId);
const [play, slider, clock, menu, divider] = ["play", "time", "clock", "menu", "divider"].map(byId);
const [method, other, what, camera] = ["method", "other", "what", "camera"].map(byId);
const areaLights = byId("lit");
// What can be shown can be compared with.
other.append(...[...method.options].map((option) => option.cloneNode(true)));
const narrow = matchMedia("(max-width: 640px)");

const STAGES = {
  program: "Fetching the program",
  scene: "Fetching the scene",
  stream: "Fetching the light",
  light: "Laying out the light",
};
const NUMBERS = ["time", "shadowResolution", "samples", "fade", "radius", "guardBand", "secondCamera", "maxPixelRatio", "animation"];
const FLAGS = ["paused", "loop", "halfResolution", "areaLights"];
const WORDS = ["scene", "stream", "live", "token", "transport", "backend", "method", "fallback", "aoPreset", "view", "camera"];

const session = new SessionPanel();
let viewer = null;
let scrubbing = false;

function show(title, text) {
  viewer = null;
  byId("message-title").textContent = title;
  byId("message-text").textContent = text;
  for (const element of [ui, loading, divider, byId("link"), byId("toast")]) element.hidden = true;
  message.hidden = false;
}

async function settings() {
  const query = new URLSearchParams(location.search);
  let result = {};
  if (!query.has("scene")) {
    const response = await fetch("viewer.json").catch(() => null);
    if (!response?.ok) {
      throw new Error(
        "Nothing to show was named. Open this page with\n?scene=FILE.glb&stream=FILE.dapple\n" +
          'or put a viewer.json with those two names beside it:\n{"scene": "FILE.glb", "stream": "FILE.dapple"}',
      );
    }
    try {
      result = await response.json();
    } catch (error) {
      throw new Error(`viewer.json is not JSON: ${error.message}`);
    }
  }
  for (const name of WORDS) if (query.has(name)) result[name] = query.get(name);
  for (const name of NUMBERS) if (query.has(name)) result[name] = Number(query.get(name));
  for (const name of FLAGS) if (query.has(name)) result[name] = query.get(name) !== "0";
  if (query.has("bits")) {
    result.bits = parseBits(query.get("bits"));
    if (!result.bits) throw new Error(`?bits=${query.get("bits")} is no number of bits a second: write 500k or 2M.`);
  }
  if (result.moq) result.moq = moqNow(result.moq);
  if (query.has("split")) result.split = { position: Number(query.get("split")), method: query.get("other") ?? "none" };
  return result;
}

// Where the session is over WebTransport: as was just read, and from then on as the server says.
function moqNow(first) {
  let known = first;
  return async () => {
    const place = known ?? (await (await fetch("viewer.json", { cache: "no-store" })).json()).moq ?? null;
    known = null;
    return place;
  };
}

function onProgress({ stage: name, loaded, total }) {
  const done = total !== null && loaded >= total;
  // The light comes in while the scene is already shown.
  loading.classList.toggle("light", viewer !== null);
  loading.hidden = viewer !== null && done;
  stage.textContent = STAGES[name] + (total === null && loaded > 0 ? ` (${size(loaded)})` : "");
  if (total) bar.value = loaded / total;
  else bar.removeAttribute("value");
}

function size(bytes) {
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function onStats(stats) {
  byId("fps").textContent = stats.fps > 0 ? stats.fps.toFixed(0) : "still";
  byId("rate").textContent = `${stats.megabitsPerSecond.toFixed(2)} Mbit/s`;
  byId("bytes").textContent = size(stats.bytes);
  byId("points").textContent = stats.points.toLocaleString("en");
  byId("changed").textContent = `${Math.round(stats.changedPerSecond).toLocaleString("en")} /s`;
  byId("age").textContent = stats.age === null ? "–" : age(stats.age);
  byId("backend").textContent = stats.backend === "webgpu" ? "WebGPU" : "WebGL2";
  byId("problem").textContent = stats.problem ?? "";
  byId("problem").hidden = stats.problem === null;
  byId("area-lights").hidden = stats.areaLights === 0;
  showTime(stats);
  session.show(stats.live);
  if (viewer) followCamera();
}

function age(seconds) {
  return seconds < 1 ? `${(1000 * seconds).toFixed(0)} ms` : `${seconds.toFixed(1)} s`;
}

function showTime({ time, duration, playing, live }) {
  const isOurs = !live || live.role === "interact";
  slider.disabled = duration <= 0 || !isOurs;
  play.disabled = !isOurs;
  slider.max = String(duration || 1);
  if (!scrubbing) slider.value = String(time);
  clock.textContent = narrow.matches || !duration ? `${time.toFixed(1)} s` : `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
  slider.setAttribute("aria-valuetext", `${time.toFixed(1)} seconds`);
  play.textContent = playing ? "❚❚" : "▶";
  play.setAttribute("aria-label", playing ? "Pause" : "Play");
  const forWhom = !live ? "" : isOurs ? " for everyone" : ": this viewer may only look";
  play.title = `${playing ? "Pause" : "Play"}${forWhom} (Space)`;
}

const togglePlay = () => {
  session.try(() => {
    if (viewer.paused) viewer.play();
    else viewer.pause();
  });
  showTime(viewer.stats);
};

let splitAt = 0.5;

function applySplit() {
  const name = (select) => select.selectedOptions[0].textContent;
  divider.hidden = other.value === "";
  if (other.value === "") {
    viewer.setSplit(null);
    return;
  }
  viewer.setSplit(splitAt, other.value);
  divider.style.left = `${100 * splitAt}%`;
  divider.setAttribute("aria-valuenow", String(Math.round(100 * splitAt)));
  byId("left-name").textContent = name(method);
  byId("right-name").textContent = name(other);
}

function moveSplit(to) {
  splitAt = Math.min(Math.max(to, 0.02), 0.98);
  applySplit();
}

function listCameras(chosen) {
  const option = (value, text) => new Option(text, value, false, value === chosen);
  camera.replaceChildren(
    ...viewer.cameras.map((name) => option(name, name)),
    option(" orbit", "around, by hand"),
    option(" walk", "on foot, by hand"),
  );
}

function setCamera() {
  if (camera.value.startsWith(" ")) viewer.setWalking(camera.value === " walk");
  else viewer.setCamera(camera.value);
}

// A hand on the picture takes over from a path, and so may another script of the page.
function followCamera() {
  const { path, walking } = viewer.getCamera();
  const now = path ?? (walking ? " walk" : " orbit");
  if (camera.value !== now) camera.value = now;
}

function toggleMenu() {
  const bare = document.body.classList.toggle("bare");
  menu.setAttribute("aria-expanded", String(!bare));
}

async function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await viewer.screenshot());
  link.download = `dapple-${viewer.time.toFixed(2)}s.png`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const step = (select) => {
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  select.dispatchEvent(new Event("change"));
};

function listen() {
  play.onclick = togglePlay;
  menu.onclick = toggleMenu;
  byId("shot").onclick = save;
  byId("help").onclick = () => byId("help-dialog").showModal();
  method.onchange = () => {
    viewer.setMethod(method.value);
    applySplit();
  };
  other.onchange = applySplit;
  areaLights.onchange = () => viewer.setAreaLights(areaLights.checked);
  what.onchange = () => viewer.setView(what.value);
  camera.onchange = setCamera;
  canvas.addEventListener("pointerup", followCamera);
  canvas.addEventListener("keyup", followCamera);
  canvas.addEventListener("wheel", followCamera);
  slider.oninput = () => {
    scrubbing = true;
    session.try(() => viewer.seek(Number(slider.value)));
    showTime(viewer.stats);
  };
  slider.onchange = () => (scrubbing = false);

  divider.onpointerdown = (event) => divider.setPointerCapture(event.pointerId);
  divider.onpointermove = (event) => {
    if (divider.hasPointerCapture(event.pointerId)) moveSplit(event.clientX / innerWidth);
  };
  divider.onkeydown = (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (by) moveSplit(splitAt + by);
  };

  addEventListener("keydown", (event) => {
    const typing = event.target.closest("select, input, button, dialog, #divider");
    if (!viewer || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const action = {
      Space: togglePlay,
      KeyF: toggleMenu,
      KeyP: save,
      KeyH: () => byId("help-dialog").showModal(),
      KeyV: () => step(what),
      KeyL: () => byId("area-lights").hidden || areaLights.click(),
      Digit1: () => step(method),
      Digit2: () => step(other),
    }[event.code];
    if (action) {
      event.preventDefault();
      action();
    }
  });
}

async function start() {
  byId("reload").onclick = () => location.reload();
  const options = await settings();
  const onError = (error) => show("The viewer stopped", error.message);
  const created = await createViewer(canvas, { ...options, ...session.callbacks, onProgress, onStats, onError });
  viewer = created;
  // For tests, and for the curious at the console.
  globalThis.dapple = created;
  // The scene of a session is named after its content, which says nothing to people.
  const name = options.live ? "Live" : new URL(options.scene, document.baseURI).pathname.split("/").pop();
  document.title = `${name} · Dapple`;
  if (options.method) method.value = options.method;
  areaLights.checked = options.areaLights ?? true;
  if (options.view) what.value = options.view;
  if (options.split) {
    splitAt = options.split.position;
    other.value = options.split.method;
  }
  const { path, walking } = created.getCamera();
  listCameras(path ?? (walking ? " walk" : " orbit"));
  listen();
  if (options.live) session.attach(created);
  applySplit();
  showTime(created.stats);
  ui.hidden = false;
  if (!options.stream || options.live) loading.hidden = true;
  if (narrow.matches) toggleMenu();
  // No ring around the whole window before a key asks for one.
  canvas.focus({ preventScroll: true, focusVisible: false });
  await created.ready;
  loading.hidden = true;
}

start().catch((error) => {
  if (!message.hidden) return;
  const title = error instanceof NoGraphicsError ? "No 3D graphics here" : "The scene cannot be shown";
  show(title, error.message ?? String(error));
});
