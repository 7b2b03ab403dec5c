// What plots share: their axes, their size, what is said of the place under the pointer, labels that keep apart.

const FONT = "12px system-ui, sans-serif";
/** Narrower plots have no labels at their lines: the legend is near. */
const LABEL_WIDTH = 520;

const ink = { text: "", faint: "", line: "", ground: "" };

function mixInk() {
  for (const name of Object.keys(ink)) ink[name] = styleColor(`--${name}`);
}

const plots = new Set();

/** Redraws every plot whose place is still on the page. */
function redrawPlots() {
  mixInk();
  for (const plot of plots) {
    if (plot.root.isConnected) plot.redraw(true);
    else plots.delete(plot);
  }
}

/** Options of an axis, in the colours of the page. */
function axis(options) {
  return {
    font: FONT,
    labelFont: FONT,
    stroke: () => ink.faint,
    grid: { stroke: () => ink.line, width: 1 },
    ticks: { stroke: () => ink.line, width: 1, size: 5 },
    gap: 4,
    labelGap: 2,
    ...options,
  };
}

/** A plot in `place` that follows the width of it. */
function plotIn(place, options, values, height) {
  const widthOf = () => Math.max(200, Math.floor(place.clientWidth));
  const plot = new uPlot(
    {
      width: widthOf(),
      height: height(widthOf()),
      legend: { show: false },
      ...options,
      cursor: { drag: { x: false, y: false }, points: { show: false }, ...options.cursor },
    },
    values,
    place,
  );
  plots.add(plot);
  let width = widthOf();
  new ResizeObserver(() => {
    if (!place.isConnected || widthOf() === width) return;
    width = widthOf();
    plot.setSize({ width, height: height(width) });
  }).observe(place);
  return plot;
}

/** Numbers at round places, about `count` of them. */
function roundTicks(low, high, count) {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const ticks = [];
  for (let i = Math.ceil(low / step); i * step <= high * (1 + 1e-9); i += 1) ticks.push(+(i * step).toPrecision(12));
  return ticks;
}

/** Places of a logarithmic axis: 1, 2, 5, or finer where the range is short. */
function logTicks(low, high, count) {
  if (high / low < 2.5) return roundTicks(low, high, count).filter((tick) => tick >= low);
  const decades = Math.log10(high / low);
  const finer = [[1, 1.5, 2, 3, 4, 5, 6, 8], [1, 2, 3, 5], [1, 2, 5], [1, 3], [1]];
  const steps = finer.find((list) => list.length * decades <= count) ?? [1];
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) {
    for (const step of steps) {
      const tick = +(step * 10 ** power).toPrecision(12);
      if (tick >= low && tick <= high) ticks.push(tick);
    }
  }
  return ticks;
}

/** The box beside the pointer. One serves all plots. */
const hint = (() => {
  let box = null;
  return {
    show(x, y, ...content) {
      box ??= document.body.appendChild(make("div", { className: "hint", "aria-hidden": "true" }));
      box.replaceChildren(...content);
      box.hidden = false;
      const { offsetWidth: width, offsetHeight: height } = box;
      const left = x + 16 + width > innerWidth - 8 ? x - 16 - width : x + 16;
      const top = Math.min(Math.max(8, y - height / 2), innerHeight - height - 8);
      box.style.transform = `translate(${Math.max(8, left)}px, ${top}px)`;
    },
    hide() {
      if (box) box.hidden = true;
    },
  };
})();

/** Lines of a hint: names and values. */
function hintLines(pairs) {
  return make("dl", {}, ...pairs.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
}

/** Writes with a rim in the colour of the ground, so that lines below do not disturb. */
function writeClear(pen, words, x, y, color) {
  pen.lineJoin = "round";
  pen.lineWidth = 4 * devicePixelRatio;
  pen.strokeStyle = ink.ground;
  pen.strokeText(words, x, y);
  pen.fillStyle = color;
  pen.fillText(words, x, y);
}

/** Moves labels that would lie on each other apart, up and down, within bounds; all in pixels of the canvas. */
function keepApart(labels, lineHeight, top, bottom) {
  const overlap = (a, b) => a.x < b.x + b.width && b.x < a.x + a.width && Math.abs(a.y - b.y) < lineHeight;
  const sorted = [...labels].sort((a, b) => a.y - b.y);
  // So many rounds settle some twenty labels on a heap; most heaps take a few.
  for (let round = 0; round < 200; round += 1) {
    let moved = false;
    for (let i = 1; i < sorted.length; i += 1) {
      for (let j = 0; j < i; j += 1) {
        const [a, b] = [sorted[j], sorted[i]];
        if (!overlap(a, b)) continue;
        const push = (lineHeight - (b.y - a.y)) / 2 + 0.5;
        a.y -= push;
        b.y += push;
        moved = true;
      }
    }
    for (const label of sorted) label.y = Math.min(Math.max(label.y, top), bottom);
    if (!moved) break;
  }
}

/** Runs `draw` with the canvas's pen, which is put back afterwards. */
function withPen(plot, draw) {
  const pen = plot.ctx;
  pen.save();
  // The library leaves the dashes of its last line behind.
  pen.setLineDash([]);
  pen.font = FONT.replace(/\d+/, (size) => size * devicePixelRatio);
  pen.textBaseline = "middle";
  pen.textAlign = "left";
  draw(pen);
  pen.restore();
}

/** How wide words are in CSS pixels. */
const widthOfWords = (() => {
  const pen = document.createElement("canvas").getContext("2d");
  pen.font = FONT;
  return (words) => pen.measureText(words).width;
})();
