// The rest of the page, and its start.

/** Pictures shown of each row, by each measure. */
const WORST = 3;

const WORST_BY = [
  { key: "flip", view: "flip", words: "by FLIP" },
  { key: "visibility_psnr_db", view: "error", words: "by visibility" },
];

/** Moments of a row with the worst values of a metric, the worst first. */
function worstOf(row, column) {
  const values = row.frames[column.key] ?? [];
  const list = values.map((value, frame) => ({ value, frame })).filter(({ value }) => value !== null);
  const sign = column.more_is_better ? 1 : -1;
  return list.sort((a, b) => sign * (a.value - b.value) || a.frame - b.frame).slice(0, WORST);
}

const worstState = { one: 0, all: false };

function drawWorst() {
  const caseIndex = worstState.one;
  const found = cases[caseIndex];
  const list = document.getElementById("worst-list");
  list.replaceChildren();
  if (!found.rows.length || !frameCount(caseIndex)) {
    list.append(make("p", { className: "empty" }, "There is no picture to choose from."));
    return;
  }
  for (const index of worstState.all ? found.rows.keys() : bestRows(caseIndex)) {
    const row = found.rows[index];
    const groups = WORST_BY.filter(({ key }) => columns.has(key) && row.frames[key]).map(({ key, view, words }) => {
      const column = columns.get(key);
      const thumbs = worstOf(row, column).map(({ value, frame }) => {
        const words = `${text(value, column.key === "flip" ? 4 : 1)}${column.unit ? ` ${column.unit}` : ""}`;
        const time = found.time_s[frame];
        const when = time === undefined ? `picture ${frame + 1}` : `${text(time, 2)} s`;
        const image = make("img", { alt: "", decoding: "async" });
        const thumb = make(
          "button",
          { type: "button", "aria-label": `${rowName(row)} at ${when}: ${column.title} ${words}` },
          image,
          make("span", {}, make("b", {}, words), ` ${when}`),
        );
        thumb.style.setProperty("--aspect", found.width / found.height);
        if (!hasPictures(caseIndex)) {
          image.remove();
          thumb.classList.add("bare");
          thumb.disabled = true;
          return thumb;
        }
        whenNear(thumb, () => {
          const url = pictureUrl(pictureNumber(caseIndex, index, frame, view));
          image.onerror = () => image.remove();
          if (url) image.src = url;
          else image.remove();
        });
        thumb.addEventListener("click", () =>
          showInViewer({ case: caseIndex, frame, view, mode: "slider", a: TRUTH, b: index, flip: null }),
        );
        return thumb;
      });
      return make(
        "div",
        { className: "worst-group" },
        make("h4", {}, words),
        make("div", { className: "thumbs" }, ...thumbs),
      );
    });
    list.append(
      make(
        "div",
        { className: "worst-row" },
        make("h3", {}, swatch(row.method), row.method, " ", make("small", {}, settingOf(row))),
        ...groups,
      ),
    );
  }
}

function startWorst() {
  const anyFrames = cases.some((one) => one.rows.some((row) => Object.keys(row.frames).length));
  if (!anyFrames) {
    document
      .getElementById("worst-list")
      .append(make("p", { className: "empty" }, "There is no picture to choose from."));
    return;
  }
  if (cases.length > 1) {
    const options = cases.map((one, i) => [String(i), one.name]);
    document.getElementById("worst-controls").append(
      select("case", options, "0", (value) => {
        worstState.one = Number(value);
        drawWorst();
      }),
    );
  }
  if (cases.some((one, index) => bestRows(index).length < one.rows.length)) {
    const options = [
      [false, "Best setting of each method"],
      [true, "All settings"],
    ];
    document.getElementById("worst-controls").append(
      segments("Rows", options, worstState.all, (all) => {
        worstState.all = all;
        drawWorst();
      }),
    );
  }
  if (cases.every((_, index) => frameCount(index) < 2)) {
    document
      .getElementById("worst-controls")
      .append(make("p", { className: "note" }, "There is one picture only, which is the best one too."));
  }
  drawWorst();
}

/** Marks the section that fills the window. */
function startContents() {
  const links = new Map([...document.querySelectorAll("#contents a")].map((link) => [link.hash.slice(1), link]));
  const sections = [...links.keys()].map((id) => document.getElementById(id));
  const mark = () => {
    const atEnd = scrollY + innerHeight > document.documentElement.scrollHeight - 4;
    const passed = sections.filter((section) => section.getBoundingClientRect().top < innerHeight * 0.35);
    const current = atEnd ? sections.at(-1) : passed.at(-1);
    for (const [id, link] of links) {
      if (id !== current?.id) {
        link.removeAttribute("aria-current");
      } else if (!link.hasAttribute("aria-current")) {
        link.setAttribute("aria-current", "true");
        // Where the bar is too narrow for all.
        const bar = link.parentElement;
        bar.scrollLeft = link.offsetLeft - bar.offsetLeft - (bar.clientWidth - link.offsetWidth) / 2;
      }
    }
  };
  let waiting = false;
  addEventListener(
    "scroll",
    () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        mark();
      });
    },
    { passive: true },
  );
  mark();
}

function start() {
  document.documentElement.classList.add("scripts");
  mixInk();
  onTheme(redrawPlots);
  startTheme();
  startQuality();
  startStudies();
  startTable();
  startViewer();
  startTimelines();
  startWorst();
  startContents();
  const command = document.getElementById("command");
  command.closest(".command").append(copyButton("Copy", () => command.textContent));
  if (location.hash.startsWith("#see:")) {
    // Plots take their height in microtasks, which were queued before this one.
    queueMicrotask(() => document.getElementById("pictures").scrollIntoView({ behavior: "instant" }));
  }
}

// Pictures come after the scripts: the page stands before they are all there.
if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
else start();
