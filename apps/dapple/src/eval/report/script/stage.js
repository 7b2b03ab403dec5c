// What the viewer shows: pictures in panes, moved and zoomed as one, with names and figures over them.

/** Largest zoom: this many pixels of the page for one of a picture; or, of small pictures, this many times the whole. */
const MAX_ZOOM = 16;
const LEAST_MAX_ZOOM = 4;

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
  ui.stage.replaceChildren(
    ...ui.panes.map((one) => {
      const caption = make("figcaption", {});
      one.caption = caption;
      return make("figure", { className: "tile" }, caption, one.element);
    }),
  );
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
    const shown = qualityColumns.filter(
      (column) => ["visibility_psnr_db", "flip"].includes(column.key) && frames[column.key],
    );
    const words = shown.map((column) => {
      const value = frames[column.key][show.frame];
      return value === null || value === undefined
        ? `${column.title} –`
        : `${column.title} ${text(value, column.key === "flip" ? 4 : 1)}${column.unit ? ` ${column.unit}` : ""}`;
    });
    return make("small", {}, words.join(" · "));
  };
  const head = (index) => [
    index === TRUTH ? null : swatch(cases[show.case].rows[index].method),
    make("b", {}, nameOf(show.case, index)),
    facts(index),
  ];
  if (show.mode === "slider") {
    ui.tagA.replaceChildren(...head(show.a).filter(Boolean));
    ui.tagB.replaceChildren(...head(show.b).filter(Boolean));
    ui.facts.replaceChildren(
      ...[
        ["A", show.a],
        ["B", show.b],
      ]
        .filter(([, index]) => index !== TRUTH)
        .map(([side, index]) => make("span", {}, make("b", {}, `${side} `), facts(index))),
    );
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
  const gradient = (hex) =>
    `linear-gradient(to right, ${hex
      .match(/.{6}/g)
      .map((color) => `#${color}`)
      .join(", ")})`;
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
