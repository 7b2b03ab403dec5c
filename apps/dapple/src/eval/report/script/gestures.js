// Hands on the viewer: pointers, wheel and keys; the values under the pointer; the place in the page's address.

/** How near to the divider a drag takes it, pixels. */
const GRIP = 22;

/** Where an event is in the pane it is over, in parts of that pane; null outside of all. */
function placeInPane(event) {
  for (const one of ui.panes) {
    const box = one.element.getBoundingClientRect();
    const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    if (x >= 0 && x < 1 && y >= 0 && y < 1) return { one, x, y, box };
  }
  return null;
}

function startGestures() {
  const { stage, divider } = ui;
  const pointers = new Map();
  let drag = null;

  const setSplit = (clientX) => {
    const box = stage.getBoundingClientRect();
    show.split = Math.min(Math.max(0, (clientX - box.left) / box.width), 1);
    placeViews();
  };
  const spread = () => {
    const [p, q] = [...pointers.values()];
    return { distance: Math.hypot(p.x - q.x, p.y - q.y), x: (p.x + q.x) / 2, y: (p.y + q.y) / 2 };
  };

  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    const place = placeInPane(event);
    if (!place) return;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    stage.setPointerCapture(event.pointerId);
    if (pointers.size === 2) {
      drag = { kind: "pinch", ...spread() };
      return;
    }
    const box = stage.getBoundingClientRect();
    const onDivider =
      show.mode === "slider" &&
      show.flip === null &&
      Math.abs(event.clientX - box.left - show.split * box.width) < GRIP;
    const whole = show.zoom <= 1.001;
    if (show.mode === "slider" && show.flip === null && (onDivider || whole)) {
      drag = { kind: "split" };
      // A touch may be the beginning of a scroll; a mouse is not.
      if (event.pointerType === "mouse" || onDivider) setSplit(event.clientX);
    } else {
      drag = { kind: "pan", x: event.clientX, y: event.clientY, width: place.box.width, height: place.box.height };
    }
    stage.classList.toggle("panning", drag.kind === "pan" && !whole);
  });
  stage.addEventListener("pointermove", (event) => {
    if (event.pointerType === "mouse") readOut(event);
    if (!pointers.has(event.pointerId) || !drag) return;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (drag.kind === "split") {
      setSplit(event.clientX);
    } else if (drag.kind === "pan") {
      show.x -= (event.clientX - drag.x) / drag.width / show.zoom;
      show.y -= (event.clientY - drag.y) / drag.height / show.zoom;
      Object.assign(drag, { x: event.clientX, y: event.clientY });
      placeViews();
    } else if (pointers.size === 2) {
      const now = spread();
      const place = placeInPane({ clientX: now.x, clientY: now.y });
      if (place) {
        show.x -= (now.x - drag.x) / place.box.width / show.zoom;
        show.y -= (now.y - drag.y) / place.box.height / show.zoom;
        zoomBy(now.distance / Math.max(1, drag.distance), place.x, place.y);
      }
      Object.assign(drag, now);
    }
  });
  const end = (event) => {
    if (event.type === "pointerup" && event.pointerType !== "mouse") readOut(event);
    pointers.delete(event.pointerId);
    if (pointers.size) return;
    drag = null;
    stage.classList.remove("panning");
    rememberPlace();
  };
  stage.addEventListener("pointerup", end);
  stage.addEventListener("pointercancel", end);
  stage.addEventListener("pointerleave", () => {
    if (!drag) readOut(null);
  });
  stage.addEventListener("dblclick", (event) => {
    const place = placeInPane(event);
    if (show.zoom > 1.001) fit();
    else if (place) zoomBy(4, place.x, place.y);
  });

  let hintTimer = 0;
  stage.addEventListener(
    "wheel",
    (event) => {
      const place = placeInPane(event);
      if (!place) return;
      const active =
        event.ctrlKey || event.metaKey || stage.contains(document.activeElement) || document.fullscreenElement;
      if (!active) {
        // The page scrolls on; only where someone seems to want something else a word is said.
        ui.wheelHint.hidden = false;
        clearTimeout(hintTimer);
        hintTimer = setTimeout(() => (ui.wheelHint.hidden = true), 1200);
        return;
      }
      const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1);
      if (pixels > 0 && show.zoom <= 1.001 && !event.ctrlKey) return;
      event.preventDefault();
      zoomBy(2 ** (-pixels / 240), place.x, place.y);
      readOut(event);
    },
    { passive: false },
  );

  divider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    show.split = Math.min(Math.max(0, show.split + step), 1);
    placeViews();
  });

  // Keys work while the viewer is what fills the window.
  let near = false;
  new IntersectionObserver(([entry]) => (near = entry.isIntersecting), { rootMargin: "-35% 0px -35% 0px" }).observe(
    ui.viewer,
  );
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input, select, textarea, [contenteditable]");
    const inside = ui.viewer.contains(event.target);
    if (typing || event.ctrlKey || event.metaKey || event.altKey || !(near || inside)) return;
    const count = cases[show.case].rows.length;
    const next = (by) => change({ b: ((show.b + 1 + by + count + 1) % (count + 1)) - 1, flip: null });
    const actions = {
      ArrowLeft: () => change({ frame: show.frame - 1 }),
      ArrowRight: () => change({ frame: show.frame + 1 }),
      f: flip,
      x: () => change({ a: show.b, b: show.a }),
      "[": () => next(-1),
      "]": () => next(1),
      d: () => change({ mode: "slider", flip: null }),
      p: () => change({ mode: "pair", flip: null }),
      g: () => change({ mode: "grid", flip: null }),
      "+": () => zoomBy(2),
      "=": () => zoomBy(2),
      "-": () => zoomBy(0.5),
      0: fit,
      Escape: () => change({ flip: null }),
    };
    VIEWS.forEach((view, i) => (actions[i + 1] = () => change({ view: view.key })));
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    if (event.key !== "Escape") event.preventDefault();
    action();
  });
}

/** Pixels of pictures that were read, the last ones only. */
const readPixels = new Map();

/** The colour of a picture at a place in parts of it, 0 … 255; null where a browser does not give it away. */
function pixelAt(image, x, y) {
  if (!image.complete || !image.naturalWidth) return null;
  let found = readPixels.get(image.src);
  if (!found) {
    try {
      const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
      const pen = canvas.getContext("2d", { willReadFrequently: true });
      pen.drawImage(image, 0, 0);
      found = pen.getImageData(0, 0, canvas.width, canvas.height);
    } catch {
      // A file beside the page is another's to a browser: it is shown, but not read.
      return null;
    }
    readPixels.set(image.src, found);
    if (readPixels.size > 16) readPixels.delete(readPixels.keys().next().value);
  }
  const at = (Math.floor(y * found.height) * found.width + Math.floor(x * found.width)) * 4;
  return [...found.data.slice(at, at + 3)];
}

/** The place on a scale of colours that is nearest to one, 0 … 1, and how far from it. */
function onScale(hex, color) {
  const colors = hex.match(/.{6}/g).map((one) => [0, 2, 4].map((i) => parseInt(one.slice(i, i + 2), 16)));
  let best = { at: 0, distance: Infinity };
  for (let i = 0; i + 1 < colors.length; i += 1) {
    // Between two colours, on the straight line that joins them.
    const side = colors[i].map((c, k) => colors[i + 1][k] - c);
    const length = side.reduce((sum, s) => sum + s * s, 0);
    const along = length ? side.reduce((sum, s, k) => sum + s * (color[k] - colors[i][k]), 0) / length : 0;
    const t = Math.min(Math.max(0, along), 1);
    const distance = Math.hypot(...color.map((c, k) => c - colors[i][k] - t * side[k]));
    if (distance < best.distance) best = { at: (i + t) / (colors.length - 1), distance };
  }
  return best;
}

/** A pixel in words, in the unit of what is shown. */
function pixelText(color, index) {
  const hex = `#${color.map((c) => c.toString(16).padStart(2, "0")).join("")}`;
  const view = index === TRUTH ? VIEWS.find((one) => one.key === show.view).truth : show.view;
  if (view === "beauty") return { hex, words: color.join(" ") };
  if (view === "visibility") {
    const gray = color[0] === color[1] && color[1] === color[2];
    return gray
      ? { hex, words: text(color[0] / 255, 3), value: color[0] / 255 }
      : { hex, words: "edge or no geometry" };
  }
  if (view === "error") {
    const { at, distance } = onScale(data.scales.error, color);
    const value = (at * 2 - 1) * data.scales.error_range;
    const end = at < 0.001 || at > 0.999;
    return distance > 6
      ? { hex, words: "edge or no geometry" }
      : { hex, words: `${end ? "beyond " : ""}${value > 0 ? "+" : ""}${text(value, 3)}` };
  }
  const { at } = onScale(data.scales.flip, color);
  return { hex, words: text(at, 3) };
}

let lastPoint = null;

/** Reads once more where the pointer is, after what is there has changed. */
function readAgain() {
  if (lastPoint) readOut(lastPoint);
}

/** Says what is under the pointer, in every picture that is compared. */
function readOut(event) {
  const place = event && placeInPane(event);
  lastPoint = event && { clientX: event.clientX, clientY: event.clientY };
  if (!place) {
    ui.readout.textContent = "Point at a pixel to read its values";
    return;
  }
  const found = cases[show.case];
  const x = show.x + (place.x - 0.5) / show.zoom;
  const y = show.y + (place.y - 0.5) / show.zoom;
  if (x < 0 || x >= 1 || y < 0 || y >= 1) return;
  const parts = [
    make("span", { className: "where" }, `${Math.floor(x * found.width)}, ${Math.floor(y * found.height)}`),
  ];
  // In the grid what is pointed at and the truth are enough.
  const panes = show.mode === "grid" ? ui.panes.filter((one) => one === place.one || one.index === TRUTH) : ui.panes;
  const values = [];
  for (const one of panes) {
    const color = pixelAt(one.image, x, y);
    if (!color) continue;
    const { hex, words, value } = pixelText(color, one.index);
    const chip = make("span", { className: "dot" });
    chip.style.background = hex;
    values.push(value);
    const name = one.index === TRUTH ? "truth" : nameOf(show.case, one.index);
    parts.push(make("span", {}, chip, `${name} `, make("b", {}, words)));
  }
  if (values.length === 2 && values.every((value) => value !== undefined)) {
    parts.push(make("span", {}, "B − A ", make("b", {}, text(values[1] - values[0], 3))));
  }
  if (parts.length === 1) parts.push(make("span", {}, "values of files beside the page cannot be read"));
  ui.readout.replaceChildren(...parts);
}

/** What of the viewer stands in the page's address, so that a link leads to the same sight. */
const REMEMBERED = ["case", "frame", "view", "mode", "a", "b", "split", "zoom", "x", "y"];
let rememberTimer = 0;
let remembered = false;

function rememberPlace() {
  clearTimeout(rememberTimer);
  // The first sight is nothing that anyone chose.
  if (!remembered) {
    remembered = true;
    return;
  }
  rememberTimer = setTimeout(() => {
    const parts = REMEMBERED.map((key) => {
      const value = typeof show[key] === "number" ? +show[key].toFixed(4) : show[key];
      return `${key}=${value}`;
    });
    try {
      history.replaceState(null, "", `#see:${parts.join(",")}`);
    } catch {
      // Some browsers allow no address to pages from files; nothing depends on it.
    }
  }, 300);
}

/** The sight that the page's address asks for; true if it asks for one. */
function recallPlace() {
  if (!location.hash.startsWith("#see:")) return false;
  const asked = new Map(
    location.hash
      .slice("#see:".length)
      .split(",")
      .map((part) => part.split("=")),
  );
  for (const key of REMEMBERED) {
    const value = asked.get(key);
    if (value === undefined) continue;
    if (typeof show[key] !== "number") {
      const allowed = key === "mode" ? MODES.map(([mode]) => mode) : VIEWS.map((view) => view.key);
      if (allowed.includes(value)) show[key] = value;
    } else if (Number.isFinite(Number(value))) {
      show[key] = Number(value);
    }
  }
  const whole = (value, low, high) => Math.min(Math.max(low, Math.round(value)), high);
  show.case = whole(show.case, 0, cases.length - 1);
  show.frame = whole(show.frame, 0, Math.max(0, frameCount() - 1));
  show.a = whole(show.a, TRUTH, cases[show.case].rows.length - 1);
  show.b = whole(show.b, TRUTH, cases[show.case].rows.length - 1);
  show.split = Math.min(Math.max(0, show.split), 1);
  show.zoom = Math.min(Math.max(1, show.zoom), 64);
  return true;
}
