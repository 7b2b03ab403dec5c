// Pictures side by side: any two methods with a divider or next to each other, or all of them, all moved as one.

const MODES = [
  ["slider", "Divider", "Two pictures with a divider between them"],
  ["pair", "Pair", "Two pictures side by side"],
  ["grid", "All", "All methods"],
];
/** Largest zoom: this many pixels of the page for one of a picture; small pictures, which begin there, this many times. */
const MAX_ZOOM = 16;
const LEAST_MAX_ZOOM = 4;

/** What is shown. The view is in parts of the picture: zoom 1 is the whole, (x, y) the middle. */
const show = {
  case: 0,
  frame: 0,
  view: "beauty",
  mode: "slider",
  a: TRUTH,
  b: 0,
  split: 0.5,
  flip: null,
  zoom: 1,
  x: 0.5,
  y: 0.5,
};

/** Elements of the viewer. */
const ui = { panes: [] };

function frameCount(caseIndex = show.case) {
  const found = cases[caseIndex];
  return Math.max(found.time_s.length, 0, ...found.rows.map((row) => row.pictures.beauty.length));
}

/** The time that the viewer shows of a case; null if it shows another case. */
function viewerTime(caseIndex) {
  return ui.stage && caseIndex === show.case ? (cases[caseIndex].time_s[show.frame] ?? null) : null;
}

/** Brings something into the viewer, and the viewer into the window. */
function showInViewer(changes) {
  if (!ui.stage) return;
  change(changes);
  document.getElementById("pictures").scrollIntoView({ behavior: calm() ? "auto" : "smooth", block: "start" });
  ui.stage.focus({ preventScroll: true });
}

function calm() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

/** Changes what is shown; what does not exist is brought to what does. */
function change(changes) {
  const before = { ...show };
  Object.assign(show, changes);
  show.case = Math.min(Math.max(0, show.case), cases.length - 1);
  const { rows } = cases[show.case];
  show.frame = Math.min(Math.max(0, show.frame), Math.max(0, frameCount() - 1));
  if (show.case !== before.case) {
    // The same methods of the other case, if it has them.
    const same = (index) => {
      const old = cases[before.case].rows[index];
      const found = old ? rows.findIndex((row) => rowName(row) === rowName(old)) : TRUTH;
      return found >= 0 ? found : rows.findIndex((row) => row.method === old?.method);
    };
    if (!("a" in changes)) show.a = same(before.a);
    if (!("b" in changes)) show.b = Math.max(0, same(before.b));
    Object.assign(show, { zoom: 1, x: 0.5, y: 0.5 }, changes.zoom ? changes : {});
  }
  const inside = (index) => Math.min(Math.max(TRUTH, index), rows.length - 1);
  [show.a, show.b] = [inside(show.a), inside(show.b)];
  if ("view" in changes || "case" in changes || "frame" in changes || "a" in changes || "b" in changes) show.flip = changes.flip ?? show.flip;
  renderViewer(before);
}

function renderViewer(before = null) {
  const differs = (...keys) => !before || keys.some((key) => before[key] !== show[key]);
  if (differs("case")) fillCase();
  if (differs("case", "mode", "a", "b")) layOutPanes();
  if (differs("case", "frame", "view", "mode", "a", "b")) {
    showPictures();
    showFilm();
  }
  if (differs("view")) showScale();
  ui.modes.show(show.mode);
  ui.views.show(show.view);
  ui.a.field.value = String(show.a);
  ui.b.field.value = String(show.b);
  ui.viewer.dataset.mode = show.mode;
  showFacts();
  sizeStage();
  placeViews();
  if (differs("case", "frame") && timeState.plot) redrawPlots();
  rememberPlace();
}

/** Selects and the film strip of a case. */
function fillCase() {
  const found = cases[show.case];
  const options = [TRUTH, ...found.rows.keys()].map((index) => make("option", { value: index }, nameOf(show.case, index)));
  ui.a.field.replaceChildren(...options.map((option) => option.cloneNode(true)));
  ui.b.field.replaceChildren(...options);
  if (ui.cases) ui.cases.field.value = String(show.case);
  ui.viewer.style.setProperty("--aspect", found.width / found.height);
  ui.frames.max = Math.max(0, frameCount() - 1);
  ui.moments.hidden = frameCount() < 2;
  fillFilm();
}

function fillFilm() {
  const found = cases[show.case];
  const inPage = data.embedded[show.case] ?? [];
  // A strip of a thousand would be no strip: those in the page stand for all.
  const frames = frameCount() <= 60 ? [...Array(frameCount()).keys()] : inPage.slice(0, 120);
  ui.film.replaceChildren(...frames.map((frame) => {
    const image = make("img", { alt: "", decoding: "async" });
    image.onerror = () => image.removeAttribute("src");
    const time = found.time_s[frame];
    const button = make("button", { type: "button", "aria-label": `Picture ${frame + 1}` }, image, make("span", {}, time === undefined ? `${frame + 1}` : `${text(time, 2)} s`));
    button.dataset.frame = frame;
    button.addEventListener("click", () => change({ frame }));
    whenNear(button, () => {
      const url = pictureUrl(pictureNumber(show.case, TRUTH, frame, "beauty"));
      if (url) image.src = url;
    });
    return button;
  }));
  ui.film.hidden = frames.length < 2;
}

function showFilm() {
  for (const button of ui.film.children) {
    const current = Number(button.dataset.frame) === show.frame;
    button.setAttribute("aria-current", String(current));
    if (!current) continue;
    const { offsetLeft, offsetWidth } = button;
    const { scrollLeft, clientWidth } = ui.film;
    if (offsetLeft < scrollLeft || offsetLeft + offsetWidth > scrollLeft + clientWidth) {
      ui.film.scrollTo({ left: offsetLeft - (clientWidth - offsetWidth) / 2, behavior: calm() ? "auto" : "smooth" });
    }
  }
  const time = cases[show.case].time_s[show.frame];
  ui.frames.value = show.frame;
  const words = `${show.frame + 1} of ${frameCount()}${time === undefined ? "" : `, ${text(time, 2)} s`}`;
  ui.frames.setAttribute("aria-valuetext", words);
  ui.moment.textContent = words;
}

/** One picture of a method, and what stands over it. */
function pane(index, className) {
  const image = make("img", { className: "picture", alt: "", draggable: false });
  const empty = make("p", { className: "no-picture", hidden: true });
  const element = make("div", { className: `pane ${className}` }, image, empty);
  return { index, image, empty, element };
}

/** The panes that the mode asks for. */
function layOutPanes() {
  const { mode, a, b } = show;
  const indices = mode === "grid" ? [TRUTH, ...cases[show.case].rows.keys()] : [a, b];
  if (mode === "slider") {
    ui.panes = [pane(a, "first"), pane(b, "second")];
    ui.stage.replaceChildren(...ui.panes.map((one) => one.element), ui.tags, ui.divider);
    return;
  }
  ui.panes = indices.map((index) => pane(index, ""));
  ui.stage.replaceChildren(...ui.panes.map((one) => {
    const caption = make("figcaption", {});
    one.caption = caption;
    return make("figure", { className: "tile" }, caption, one.element);
  }));
}

/** Puts the pictures of the moment into the panes; the old ones stay until the new ones are decoded. */
function showPictures() {
  for (const one of ui.panes) {
    const number = pictureNumber(show.case, one.index, show.frame, show.view);
    const url = pictureUrl(number);
    const name = nameOf(show.case, one.index);
    one.number = number;
    one.image.alt = `${name}: ${shownBy(one.index)}, ${ui.moment.textContent}`;
    const none = (words) => {
      one.image.removeAttribute("src");
      one.empty.textContent = words;
      one.empty.hidden = false;
    };
    if (url === null) {
      none(missing.has(number) ? `${data.names[number]} could not be read` : "no picture");
      continue;
    }
    one.image.onerror = () => none(`not in this page: ${data.names[number]}`);
    one.image.onload = () => {
      one.empty.hidden = true;
      readAgain();
    };
    one.image.src = url;
  }
}

/** What a pane shows in words. */
function shownBy(index) {
  const view = VIEWS.find((one) => one.key === show.view);
  const key = index === TRUTH ? view.truth : view.key;
  return VIEWS.find((one) => one.key === key).title.toLowerCase();
}

/** Names and figures over the pictures. */
function showFacts() {
  const facts = (index) => {
    if (index === TRUTH) {
      // Where the truth has no such picture, what it shows instead.
      const view = VIEWS.find((one) => one.key === show.view);
      return view.truth === view.key ? null : make("small", {}, `its ${shownBy(TRUTH)}`);
    }
    const { frames } = cases[show.case].rows[index];
    const shown = qualityColumns.filter((column) => ["visibility_psnr_db", "flip"].includes(column.key) && frames[column.key]);
    const words = shown.map((column) => {
      const value = frames[column.key][show.frame];
      return value === null || value === undefined ? `${column.title} –` : `${column.title} ${text(value, column.key === "flip" ? 4 : 1)}${column.unit ? ` ${column.unit}` : ""}`;
    });
    return make("small", {}, words.join(" · "));
  };
  const head = (index) => [index === TRUTH ? null : swatch(cases[show.case].rows[index].method), make("b", {}, nameOf(show.case, index)), facts(index)];
  if (show.mode === "slider") {
    ui.tagA.replaceChildren(...head(show.a).filter(Boolean));
    ui.tagB.replaceChildren(...head(show.b).filter(Boolean));
    ui.facts.replaceChildren(...[["A", show.a], ["B", show.b]].filter(([, index]) => index !== TRUTH).map(([side, index]) => make("span", {}, make("b", {}, `${side} `), facts(index))));
  } else {
    for (const one of ui.panes) one.caption.replaceChildren(...head(one.index).filter(Boolean));
  }
}

/**
 * How wide two pictures on each other are: no larger than lets the whole viewer be seen, and a whole number of times
 * their own size if that wastes little, so that all pixels are equally large.
 */
function sizeStage() {
  const { width, height } = cases[show.case];
  const controls = 335;
  const room = ui.stage.parentElement.clientWidth;
  const most = Math.min(room, (Math.max(320, innerHeight - controls) * width) / height);
  const times = Math.floor((most * devicePixelRatio) / width);
  const whole = (times * width) / devicePixelRatio;
  ui.stage.style.width = show.mode === "slider" ? `${whole > 0.7 * most ? whole : most}px` : "";
}

/** Moves all pictures to the view, and the divider to its place. */
function placeViews() {
  const half = 0.5 / show.zoom;
  show.x = Math.min(Math.max(half, show.x), 1 - half);
  show.y = Math.min(Math.max(half, show.y), 1 - half);
  const found = cases[show.case];
  for (const one of ui.panes) {
    const { style } = one.image;
    style.width = style.height = `${show.zoom * 100}%`;
    style.left = `${(0.5 - show.x * show.zoom) * 100}%`;
    style.top = `${(0.5 - show.y * show.zoom) * 100}%`;
    const scale = (one.element.clientWidth * show.zoom) / found.width;
    // Pixels are what is judged here: once they are large enough to be seen they stay sharp.
    style.imageRendering = scale * devicePixelRatio >= 1.5 ? "pixelated" : "auto";
  }
  const split = show.flip === "a" ? 1 : show.flip === "b" ? 0 : show.split;
  ui.stage.style.setProperty("--split", split);
  ui.divider.setAttribute("aria-valuenow", String(Math.round(split * 100)));
  ui.divider.hidden = show.flip !== null;
  ui.tagA.hidden = show.flip === "b";
  ui.tagB.hidden = show.flip === "a";
  ui.flip.setAttribute("aria-pressed", String(show.flip !== null));
  const first = ui.panes[0]?.element.clientWidth ?? 0;
  ui.percent.textContent = `${Math.round(((first * show.zoom) / found.width) * 100)} %`;
  ui.stage.classList.toggle("zoomed", show.zoom > 1.001);
}

/** Zooms by a factor around a place, in parts of the pane. */
function zoomBy(factor, atX = 0.5, atY = 0.5) {
  const pane = ui.panes[0]?.element;
  if (!pane) return;
  const most = Math.max(LEAST_MAX_ZOOM, (MAX_ZOOM * cases[show.case].width) / pane.clientWidth);
  const zoom = Math.min(Math.max(1, show.zoom * factor), most);
  // What is under the place stays there.
  const x = show.x + (atX - 0.5) * (1 / show.zoom - 1 / zoom);
  const y = show.y + (atY - 0.5) * (1 / show.zoom - 1 / zoom);
  Object.assign(show, { zoom, x, y });
  placeViews();
  rememberPlace();
}

/** Zooms so that one pixel of a picture is `pixels` of the page. */
function zoomTo(pixels) {
  const pane = ui.panes[0]?.element;
  if (pane) zoomBy((pixels * cases[show.case].width) / pane.clientWidth / show.zoom);
}

function fit() {
  Object.assign(show, { zoom: 1, x: 0.5, y: 0.5 });
  placeViews();
  rememberPlace();
}

/** Shows one of the two whole, then the other. */
function flip() {
  if (show.mode !== "slider") change({ mode: "slider" });
  show.flip = show.flip === "a" ? "b" : "a";
  placeViews();
  announce(nameOf(show.case, show.flip === "a" ? show.a : show.b));
}

/** The colours of what is shown, with their numbers. */
function showScale() {
  const gradient = (hex) => `linear-gradient(to right, ${hex.match(/.{6}/g).map((color) => `#${color}`).join(", ")})`;
  const range = data.scales.error_range;
  const scale = {
    visibility: ["000000ffffff", "blocked 0", "1 open"],
    error: [data.scales.error, `−${range} too dark`, `too bright +${range}`],
    flip: [data.scales.flip, "FLIP 0 equal", "1"],
  }[show.view];
  ui.scale.hidden = !scale;
  if (!scale) return;
  const bar = make("span", { className: "bar-of-colors" });
  bar.style.background = gradient(scale[0]);
  const ground = make("span", { className: "dot" });
  ground.style.background = `#${data.scales.background}`;
  const nothing = show.view === "flip" ? [] : [make("span", { className: "nothing" }, ground, "no geometry")];
  ui.scale.replaceChildren(make("span", {}, scale[1]), bar, make("span", {}, scale[2]), ...nothing);
}

function button(words, title, onClick, className = "") {
  const element = make("button", { type: "button", title, className, "aria-label": title }, words);
  element.addEventListener("click", onClick);
  return element;
}

function startViewer() {
  const place = document.getElementById("viewer");
  if (!cases.some((_, index) => hasPictures(index))) {
    place.append(make("p", { className: "empty" }, "No picture could be found: they lie beside results.json when an evaluation has run."));
    return;
  }
  ui.viewer = place;
  const methods = (label, name) => select(label, [], "", (value) => change({ [name]: Number(value), flip: null }));
  ui.a = methods("A", "a");
  ui.b = methods("B", "b");
  const swap = button("⇄", "Swap A and B (X)", () => change({ a: show.b, b: show.a }), "icon");
  ui.views = segments("What is shown", VIEWS.map((view, i) => [view.key, view.title, `${view.title} (${i + 1})`]), show.view, (view) => change({ view }));
  ui.modes = segments("How it is shown", MODES, show.mode, (mode) => change({ mode, flip: null }));
  if (cases.length > 1) {
    ui.cases = select("case", cases.map((one, i) => [String(i), one.name]), "0", (value) => change({ case: Number(value), flip: null }));
  }
  ui.flip = button("Flip", "Show A, then B, in the same place (F)", flip);
  ui.percent = make("output", { className: "percent", "aria-label": "Zoom" });
  const zoom = make(
    "div",
    { className: "segments", role: "group", "aria-label": "Zoom" },
    button("−", "Smaller (−)", () => zoomBy(0.5)),
    ui.percent,
    button("+", "Larger (+)", () => zoomBy(2)),
    button("Fit", "The whole picture (0)", fit),
  );
  const full = button("Full screen", "The viewer alone (Escape leaves)", () => {
    if (document.fullscreenElement) document.exitFullscreen();
    else place.requestFullscreen?.();
  });
  ui.divider = make("div", {
    className: "divider", role: "slider", tabIndex: 0, "aria-label": "Divider between A and B",
    "aria-valuemin": "0", "aria-valuemax": "100", "aria-orientation": "horizontal",
  });
  ui.tagA = make("span", { className: "tag first" });
  ui.tagB = make("span", { className: "tag second" });
  ui.tags = make("div", { className: "tags" }, ui.tagA, ui.tagB);
  ui.stage = make("div", { className: "stage", tabIndex: 0, role: "group", "aria-label": "Pictures compared; arrow keys change the moment, F flips, plus and minus zoom" });
  ui.wheelHint = make("p", { className: "wheel-hint", hidden: true, "aria-hidden": "true" }, "Click the picture to zoom with the wheel, or hold Ctrl");
  ui.facts = make("div", { className: "facts-below" });
  ui.scale = make("div", { className: "scale" });
  ui.readout = make("div", { className: "readout" }, "Point at a pixel to read its values");
  ui.frames = make("input", { type: "range", min: 0, step: 1, "aria-label": "Moment along the path" });
  ui.frames.addEventListener("input", () => change({ frame: Number(ui.frames.value) }));
  ui.moment = make("output", { className: "moment" });
  ui.moments = make("div", { className: "moments" }, button("‹", "Earlier (←)", () => change({ frame: show.frame - 1 }), "icon"), ui.frames, button("›", "Later (→)", () => change({ frame: show.frame + 1 }), "icon"), ui.moment);
  ui.film = make("div", { className: "film", "aria-label": "Moments along the path", role: "group" });
  const keys = [
    ["← →", "moment"], ["F", "flip between A and B"], ["X", "swap A and B"], ["[ ]", "another B"], ["1 – 4", "what is shown"],
    ["D P G", "divider, pair, all"], ["+ − 0", "zoom, fit"], ["drag", "divider; the picture when zoomed"], ["double click", "zoom there, or fit"],
  ];
  place.append(
    make("div", { className: "controls" }, ui.cases, ui.views, ui.modes, make("div", { className: "tools" }, zoom, ui.flip, full)),
    make("div", { className: "choice" }, ui.a, swap, ui.b),
    make("div", { className: "stage-box" }, ui.stage, ui.wheelHint),
    make("div", { className: "under" }, ui.facts, ui.readout, ui.scale),
    ui.moments,
    ui.film,
    make("details", {}, make("summary", {}, "Keys"), make("dl", { className: "keys" }, ...keys.flatMap(([key, words]) => [make("dt", {}, ...key.split(" ").map((k) => make("kbd", {}, k))), make("dd", {}, words)]))),
  );
  const best = bestRows(show.case).find((index) => cases[show.case].rows[index].figures.kbit_per_s);
  show.b = best ?? 0;
  if (!cases[show.case].rows.length) show.b = TRUTH;
  recallPlace();
  startGestures();
  renderViewer();
  const resize = () => {
    sizeStage();
    placeViews();
  };
  new ResizeObserver(resize).observe(ui.stage.parentElement);
  addEventListener("resize", resize);
}
