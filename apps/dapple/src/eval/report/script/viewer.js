// Pictures side by side: any two methods with a divider or next to each other, or all of them, all moved as one.

const MODES = [
  ["slider", "Divider", "Two pictures with a divider between them"],
  ["pair", "Pair", "Two pictures side by side"],
  ["grid", "All", "All methods"],
];
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
  if (differs("case", "frame")) redrawMoments();
  rememberPlace();
}

/** Selects and the film strip of a case. */
function fillCase() {
  const found = cases[show.case];
  const options = [TRUTH, ...found.rows.keys()].map((index) =>
    make("option", { value: index }, nameOf(show.case, index)),
  );
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
  ui.film.replaceChildren(
    ...frames.map((frame) => {
      const image = make("img", { alt: "", decoding: "async" });
      image.onerror = () => image.removeAttribute("src");
      const time = found.time_s[frame];
      const button = make(
        "button",
        { type: "button", "aria-label": `Picture ${frame + 1}` },
        image,
        make("span", {}, time === undefined ? `${frame + 1}` : `${text(time, 2)} s`),
      );
      button.dataset.frame = frame;
      button.addEventListener("click", () => change({ frame }));
      whenNear(button, () => {
        const url = pictureUrl(pictureNumber(show.case, TRUTH, frame, "beauty"));
        if (url) image.src = url;
      });
      return button;
    }),
  );
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

function button(words, title, onClick, className = "") {
  const element = make("button", { type: "button", title, className, "aria-label": title }, words);
  element.addEventListener("click", onClick);
  return element;
}

function startViewer() {
  const place = document.getElementById("viewer");
  if (!cases.some((_, index) => hasPictures(index))) {
    place.append(
      make(
        "p",
        { className: "empty" },
        "No picture could be found: they lie beside results.json when an evaluation has run.",
      ),
    );
    return;
  }
  ui.viewer = place;
  const methods = (label, name) => select(label, [], "", (value) => change({ [name]: Number(value), flip: null }));
  ui.a = methods("A", "a");
  ui.b = methods("B", "b");
  const swap = button("⇄", "Swap A and B (X)", () => change({ a: show.b, b: show.a }), "icon");
  ui.views = segments(
    "What is shown",
    VIEWS.map((view, i) => [view.key, view.title, `${view.title} (${i + 1})`]),
    show.view,
    (view) => change({ view }),
  );
  ui.modes = segments("How it is shown", MODES, show.mode, (mode) => change({ mode, flip: null }));
  if (cases.length > 1) {
    ui.cases = select(
      "case",
      cases.map((one, i) => [String(i), one.name]),
      "0",
      (value) => change({ case: Number(value), flip: null }),
    );
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
    className: "divider",
    role: "slider",
    tabIndex: 0,
    "aria-label": "Divider between A and B",
    "aria-valuemin": "0",
    "aria-valuemax": "100",
    "aria-orientation": "horizontal",
  });
  ui.tagA = make("span", { className: "tag first" });
  ui.tagB = make("span", { className: "tag second" });
  ui.tags = make("div", { className: "tags" }, ui.tagA, ui.tagB);
  ui.stage = make("div", {
    className: "stage",
    tabIndex: 0,
    role: "group",
    "aria-label": "Pictures compared; arrow keys change the moment, F flips, plus and minus zoom",
  });
  ui.wheelHint = make(
    "p",
    { className: "wheel-hint", hidden: true, "aria-hidden": "true" },
    "Click the picture to zoom with the wheel, or hold Ctrl",
  );
  ui.facts = make("div", { className: "facts-below" });
  ui.scale = make("div", { className: "scale" });
  ui.readout = make("div", { className: "readout" }, "Point at a pixel to read its values");
  ui.frames = make("input", { type: "range", min: 0, step: 1, "aria-label": "Moment along the path" });
  ui.frames.addEventListener("input", () => change({ frame: Number(ui.frames.value) }));
  ui.moment = make("output", { className: "moment" });
  ui.moments = make(
    "div",
    { className: "moments" },
    button("‹", "Earlier (←)", () => change({ frame: show.frame - 1 }), "icon"),
    ui.frames,
    button("›", "Later (→)", () => change({ frame: show.frame + 1 }), "icon"),
    ui.moment,
  );
  ui.film = make("div", { className: "film", "aria-label": "Moments along the path", role: "group" });
  const keys = [
    ["← →", "moment"],
    ["F", "flip between A and B"],
    ["X", "swap A and B"],
    ["[ ]", "another B"],
    ["1 – 4", "what is shown"],
    ["D P G", "divider, pair, all"],
    ["+ − 0", "zoom, fit"],
    ["drag", "divider; the picture when zoomed"],
    ["double click", "zoom there, or fit"],
  ];
  place.append(
    make(
      "div",
      { className: "controls" },
      ui.cases,
      ui.views,
      ui.modes,
      make("div", { className: "tools" }, zoom, ui.flip, full),
    ),
    make("div", { className: "choice" }, ui.a, swap, ui.b),
    make("div", { className: "stage-box" }, ui.stage, ui.wheelHint),
    make("div", { className: "under" }, ui.facts, ui.readout, ui.scale),
    ui.moments,
    ui.film,
    make(
      "details",
      {},
      make("summary", {}, "Keys"),
      make(
        "dl",
        { className: "keys" },
        ...keys.flatMap(([key, words]) => [
          make("dt", {}, ...key.split(" ").map((k) => make("kbd", {}, k))),
          make("dd", {}, words),
        ]),
      ),
    ),
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
