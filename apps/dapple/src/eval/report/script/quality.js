// Quality against bits: each method a line over what it costs, what has no bits a level across.

const ALL = "all";
const qualityState = {
  metric: qualityColumns[0]?.key,
  cost: null,
  grouping: "points_per_m2",
  one: cases.length > 1 ? ALL : "0",
  hidden: new Set(),
};

/** Costs that some row has. Bits that are all nothing say nothing: then what it takes to join is first. */
function usefulCosts() {
  const values = (column) => cases.flatMap((one) => one.rows.map((row) => row.figures[column.key]?.[0] ?? null));
  const useful = costColumns.filter((column) => values(column).some((value) => value > 0));
  return useful.length ? useful : costColumns.filter((column) => values(column).some((value) => value !== null));
}

/** Lines, levels and what cannot be drawn of one case. */
function qualityOf(caseIndex, metric, cost, grouping) {
  const lines = new Map();
  const levels = [];
  const equal = [];
  cases[caseIndex].rows.forEach((row, index) => {
    const [figure, price] = [row.figures[metric.key], row.figures[cost.key]];
    if (!figure || qualityState.hidden.has(row.method)) return;
    if (figure[0] === null) {
      equal.push(rowName(row));
    } else if (!price || price[0] === null) {
      levels.push({ row, index, y: figure[0], ci95: figure[1], name: rowName(row) });
    } else {
      const others = Object.entries(row.params).filter(([key]) => key !== grouping);
      const key = JSON.stringify([row.method, others.sort()]);
      const line = lines.get(key) ?? { method: row.method, extra: extraOf(row), points: [] };
      lines.set(key, line);
      line.points.push({ row, index, x: price[0], xCi95: price[1], y: figure[0], ci95: figure[1] });
    }
  });
  for (const line of lines.values()) line.points.sort((a, b) => a.x - b.x);
  return { lines: [...lines.values()], levels, equal };
}

/** Where nothing costs nothing: a place left of all else, since a logarithmic axis has none. */
function placeOfNothing(lines) {
  const positive = lines.flatMap((line) => line.points.map((point) => point.x)).filter((x) => x > 0);
  return positive.length ? Math.min(...positive) / 2.5 : 1;
}

function qualityPlot(place, caseIndex, small) {
  const metric = columns.get(qualityState.metric);
  const cost = columns.get(qualityState.cost);
  const { lines, levels, equal } = qualityOf(caseIndex, metric, cost, qualityState.grouping);
  const name = cases[caseIndex].name;
  if (!lines.length && !levels.length) {
    place.append(make("p", { className: "empty" }, equal.length ? "Equal to the truth." : "Nothing to draw."));
    return equal;
  }
  const nothing = placeOfNothing(lines);
  const points = lines.flatMap((line) => line.points);
  for (const point of points) point.at = point.x > 0 ? point.x : nothing;
  const hasNothing = points.some((point) => point.x <= 0);
  const range = rangeX(points.map((point) => point.at));
  const rangeOfY = rangeY(points, levels);
  const off = levels.filter((level) => level.y < rangeOfY[0] || level.y > rangeOfY[1]);
  const on = levels.filter((level) => !off.includes(level));
  const extras = extrasOf();
  const xs = [...new Set(points.map((point) => point.at))].sort((a, b) => a - b);
  // Without any point there is no axis to speak of; levels need one still.
  const values = [xs.length ? xs : [range[0], range[1]]];
  for (const line of lines) {
    values.push(values[0].map((x) => line.points.find((point) => point.at === x)?.y ?? null));
  }
  if (!lines.length) values.push(values[0].map(() => null));
  const labels = [
    ...lines.map((line) => ({ line, words: lineLabel(line, lines) })),
    ...on.map((level) => ({ level, words: level.name })),
  ];
  const widest = Math.max(0, ...labels.map((label) => widthOfWords(label.words)));
  const roomy = () => place.clientWidth >= LABEL_WIDTH;
  let near = null;
  const options = {
    padding: [12, () => (roomy() ? Math.min(190, widest + 16) : 14), 0, 0],
    scales: {
      x: { time: false, distr: 3, log: 10, range: () => range },
      y: { range: () => rangeOfY },
    },
    axes: [
      axis({
        label: small ? null : axisLabel(cost, !points.length),
        labelSize: 18,
        size: 30,
        splits: (plot) => {
          const ticks = logTicks(hasNothing ? nothing * 1.8 : range[0], range[1], plot.width / 90);
          return hasNothing ? [nothing, ...ticks] : ticks;
        },
        values: (_, ticks) => ticks.map((tick) => (!points.length ? "" : hasNothing && tick === nothing ? "0" : short(tick))),
        filter: (_, ticks) => ticks,
      }),
      axis({ size: 46, space: 34, values: (_, ticks) => ticks.map(short) }),
    ],
    series: [
      {},
      ...(lines.length ? lines : [{ method: null }]).map((line) => ({
        stroke: () => colorOf(line.method),
        width: 2,
        dash: DASHES[extras.indexOf(line.extra) % DASHES.length],
        spanGaps: true,
        points: { show: false },
      })),
    ],
    hooks: {
      draw: [
        (plot) => withPen(plot, (pen) => drawQuality(plot, pen, { lines, on, off, labels, roomy: roomy(), near, metric, nothing: hasNothing ? nothing : null })),
      ],
      setCursor: [
        (plot) => {
          const found = nearest(plot, lines, on);
          if (found !== near) {
            near = found;
            plot.redraw(false);
          }
          plot.over.classList.toggle("pick", Boolean(near));
          if (!near) return hint.hide();
          const box = plot.over.getBoundingClientRect();
          const { row } = near.point;
          hint.show(box.left + near.x, box.top + near.y, ...rowHint(row));
        },
      ],
    },
    cursor: { x: false, y: false },
  };
  const plot = plotIn(place, options, values, (width) => Math.min(small ? 320 : 460, Math.max(small ? 220 : 260, width * 0.5)));
  plot.over.addEventListener("mouseleave", () => {
    near = null;
    plot.redraw(false);
    hint.hide();
  });
  plot.over.addEventListener("click", () => {
    if (near) showInViewer({ case: caseIndex, a: TRUTH, b: near.point.index });
  });
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `${metric.title} of ${name} against ${cost.title}; the table below has the values`);
  return equal;
}

function axisLabel(column, empty) {
  if (empty) return "no method here has updates";
  return column.unit ? `${column.title}, ${column.unit}` : column.title;
}

/** From the least to the greatest with some room, never a point. */
function rangeX(xs) {
  if (!xs.length) return [1, 10];
  const [low, high] = [Math.min(...xs), Math.max(...xs)];
  const room = high / low < 1.3 ? 1.6 : (high / low) ** 0.09;
  return [low / room, high * room];
}

/** All points and their intervals, and such levels as would not squeeze them. */
function rangeY(points, levels) {
  const ends = (list) => list.flatMap(({ y, ci95 }) => [y - (ci95 ?? 0), y + (ci95 ?? 0)]);
  const base = ends(points.length ? points : levels);
  let [low, high] = [Math.min(...base), Math.max(...base)];
  const size = Math.max(high - low, Math.abs(high) * 0.04, 1e-4);
  for (const { y } of levels) {
    if (y > low - size && y < high + size) [low, high] = [Math.min(low, y), Math.max(high, y)];
  }
  const room = Math.max((high - low) * 0.09, (size - (high - low)) / 2);
  return [low - room, high + room];
}

/** What tells a row's line from others of its method, in words. */
function extraOf(row) {
  return settingOf(row, qualityState.grouping, "rays_per_pixel");
}

/** What tells lines of one method apart, over all cases, so that dashes mean the same everywhere. */
function extrasOf() {
  const rows = cases.flatMap((one) => one.rows).filter((row) => row.figures[qualityState.cost]);
  const found = [...new Set(rows.map(extraOf))];
  // The most points or the highest rate, which is what most look at, has a line without dashes; so has what has no such.
  return found.sort((a, b) => (a === "" ? -1 : b === "" ? 1 : b.localeCompare(a, "en", { numeric: true })));
}

function lineLabel(line, lines) {
  const alone = lines.filter((other) => other.method === line.method).length === 1;
  return alone || !line.extra ? line.method : `${line.method} · ${line.extra}`;
}

/** What is nearest to the pointer: a point, or else a level. */
function nearest(plot, lines, levels) {
  const { left, top } = plot.cursor;
  if (left === undefined || left < 0) return null;
  let best = null;
  for (const point of lines.flatMap((line) => line.points)) {
    const [x, y] = [plot.valToPos(point.at, "x"), plot.valToPos(point.y, "y")];
    const distance = Math.hypot(x - left, y - top);
    if (distance < 28 && distance < (best?.distance ?? Infinity)) best = { point, x, y, distance };
  }
  if (best) return keepOne(plot, best);
  for (const level of levels) {
    const y = plot.valToPos(level.y, "y");
    const distance = Math.abs(y - top);
    if (distance < 8 && distance < (best?.distance ?? Infinity)) best = { point: level, x: left, y, distance };
  }
  return best && keepOne(plot, best);
}

/** The same object for the same point, so that a plot is redrawn only when another is met. */
function keepOne(plot, found) {
  const last = plot.lastNear;
  plot.lastNear = last?.point === found.point ? Object.assign(last, found) : found;
  return plot.lastNear;
}

function rowHint(row) {
  const shown = [...qualityColumns, ...costColumns].filter((column) => row.figures[column.key] && column.kind !== "other");
  return [
    make("strong", {}, swatch(row.method), ` ${rowName(row)}`),
    hintLines(shown.map((column) => [column.title, figureText(column, row.figures[column.key])])),
  ];
}

function drawQuality(plot, pen, { lines, on, off, labels, roomy, near, metric, nothing }) {
  const { left, top, width, height } = plot.bbox;
  const scale = devicePixelRatio;
  const x = (value) => plot.valToPos(value, "x", true);
  const y = (value) => plot.valToPos(value, "y", true);
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, height);
  pen.clip();
  if (nothing !== null) {
    pen.strokeStyle = ink.faint;
    pen.setLineDash([2 * scale, 3 * scale]);
    pen.lineWidth = scale;
    pen.beginPath();
    const at = x(nothing * 1.6);
    pen.moveTo(at, top);
    pen.lineTo(at, top + height);
    pen.stroke();
    pen.setLineDash([]);
  }
  for (const level of on) {
    pen.strokeStyle = colorOf(level.row.method);
    if (level.ci95) {
      pen.globalAlpha = 0.1;
      pen.fillStyle = pen.strokeStyle;
      pen.fillRect(left, y(level.y + level.ci95), width, y(level.y - level.ci95) - y(level.y + level.ci95));
      pen.globalAlpha = 1;
    }
    pen.lineWidth = (near?.point === level ? 2.5 : 1.5) * scale;
    pen.setLineDash([6 * scale, 4 * scale]);
    pen.beginPath();
    pen.moveTo(left, y(level.y));
    pen.lineTo(left + width, y(level.y));
    pen.stroke();
    pen.setLineDash([]);
  }
  pen.restore();
  for (const line of lines) {
    pen.strokeStyle = pen.fillStyle = colorOf(line.method);
    pen.lineWidth = scale;
    pen.globalAlpha = 0.75;
    for (const point of line.points) drawInterval(pen, point, x, y, scale);
    pen.globalAlpha = 1;
    for (const point of line.points) {
      const mark = markPath(looks.get(line.method).mark, x(point.at), y(point.y), (near?.point === point ? 7 : 5) * scale);
      pen.lineWidth = 3 * scale;
      pen.strokeStyle = ink.ground;
      pen.stroke(mark);
      pen.fill(mark);
    }
  }
  if (roomy) drawLabels(pen, labels, lines, { x, y, left, top, width, height, scale });
  drawOff(pen, off, metric, { right: left + width, top, height, scale, y });
}

function drawInterval(pen, point, x, y, scale) {
  const cap = 4 * scale;
  const segment = (x0, y0, x1, y1) => {
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
  };
  pen.beginPath();
  if (point.ci95) {
    const [at, low, high] = [x(point.at), y(point.y - point.ci95), y(point.y + point.ci95)];
    segment(at, low, at, high);
    segment(at - cap, low, at + cap, low);
    segment(at - cap, high, at + cap, high);
  }
  if (point.xCi95 && point.x - point.xCi95 > 0) {
    const [at, low, high] = [y(point.y), x(point.x - point.xCi95), x(point.x + point.xCi95)];
    segment(low, at, high, at);
  }
  pen.stroke();
}

/** Names of levels right of the plot, names of lines at their last points, where they hide least. */
function drawLabels(pen, labels, lines, { x, y, left, top, width, height, scale }) {
  const line = 15 * scale;
  const levels = labels.filter(({ level }) => level).map(({ level, words }) => ({
    words,
    x: left + width + 6 * scale,
    y: y(level.y),
    width: pen.measureText(words).width,
    color: colorOf(level.row.method),
  }));
  keepApart(levels, line, top, top + height);
  // What labels should not hide: other labels, and lines, of which a point every few pixels is enough.
  const taken = [...levels];
  const dots = lines.flatMap(({ points }) => points.flatMap((point, i) => {
    const [x0, y0] = [x(point.at), y(point.y)];
    const next = points[i + 1];
    const marks = [-8, 0, 8].map((d) => [x0 + d * scale, y0]);
    if (!next) return marks;
    const [x1, y1] = [x(next.at), y(next.y)];
    const count = Math.ceil(Math.hypot(x1 - x0, y1 - y0) / (8 * scale));
    return [...marks, ...[...Array(count)].map((_, k) => [x0 + ((x1 - x0) * k) / count, y0 + ((y1 - y0) * k) / count])];
  }));
  for (const { line: own, words } of labels.filter((label) => label.line)) {
    const last = own.points.at(-1);
    const size = pen.measureText(words).width;
    const [px, py] = [x(last.at), y(last.y)];
    const bar = last.xCi95 && last.x > 0 ? x((last.at * (last.x + last.xCi95)) / last.x) - px : 0;
    const right = Math.max(9 * scale, bar) + 5 * scale;
    const [near, up, down] = [8 * scale, -13 * scale, 14 * scale];
    const sites = [[right, 0], [near, up], [near, down], [-size - right, 0], [-size - near, up], [-size - near, down]];
    const candidates = sites.map(([dx, dy], i) => {
      const label = { words, x: px + dx, y: py + dy, width: size, color: colorOf(own.method) };
      const [from, to] = [label.x - 3 * scale, label.x + size + 3 * scale];
      const hidden = dots.filter(([dotX, dotY]) => dotX > from && dotX < to && Math.abs(dotY - label.y) < line * 0.6);
      const met = taken.filter((other) => other.x < to && from < other.x + other.width && Math.abs(other.y - label.y) < line);
      const outside = label.x < left || label.y < top || label.y > top + height;
      return { label, cost: i * 0.1 + hidden.length + 20 * met.length + (outside ? 50 : 0) };
    });
    taken.push(candidates.reduce((best, one) => (one.cost < best.cost ? one : best)).label);
  }
  for (const label of taken) writeClear(pen, label.words, label.x, label.y, label.color);
}

/** Levels that are too far away to be drawn are named at the edge they lie behind. */
function drawOff(pen, off, metric, { right, top, height, scale, y }) {
  let [below, above] = [0, 0];
  for (const level of off) {
    const under = y(level.y) > top + height;
    const words = `${under ? "↓" : "↑"} ${level.name} ${text(level.y, Math.min(metric.digits, 3))}`;
    const at = under ? top + height - (12 + 16 * below++) * scale : top + (12 + 16 * above++) * scale;
    // On the right: what costs more is seldom as bad.
    writeClear(pen, words, right - 6 * scale - pen.measureText(words).width, at, colorOf(level.row.method));
  }
}

function drawQualitySection() {
  const place = document.getElementById("quality-plots");
  const shown = qualityState.one === ALL ? cases.map((_, i) => i) : [Number(qualityState.one)];
  const small = shown.length > 1;
  place.className = small ? "multiples" : "";
  place.replaceChildren();
  const metric = columns.get(qualityState.metric);
  const equal = [];
  for (const index of shown) {
    const box = make("figure", { className: "plot" });
    const title = small
      ? make("figcaption", {}, cases[index].name)
      : make("figcaption", {}, `${metric.title}${metric.unit ? `, ${metric.unit}` : ""}`, betterHint(metric));
    const inside = make("div", { className: "plot-place" });
    box.append(title, inside);
    place.append(box);
    const found = qualityPlot(inside, index, small);
    if (found.length) equal.push(`${small ? `${cases[index].name}: ` : ""}${found.join(", ")}`);
  }
  const notes = [];
  const [title, cost] = [metric.title, columns.get(qualityState.cost)];
  if (small) notes.push(`Up: ${title}${metric.unit ? ` in ${metric.unit}` : ""}, ${metric.more_is_better ? "more" : "less"} is better. Right: ${axisLabel(cost, false)}, on a logarithmic axis.`);
  if (equal.length) notes.push(`Not drawn, because equal to the truth: ${equal.join("; ")}.`);
  if (cases.some((one) => one.rows.some((row) => row.figures[metric.key]?.[1]))) notes.push("Bars and bands are 95 % intervals.");
  document.getElementById("quality-note").textContent = notes.join(" ");
}

function betterHint(column) {
  return make("span", { className: "better" }, column.more_is_better ? "↑ better" : "↓ better");
}

function drawQualityLegend() {
  const legend = document.getElementById("quality-legend");
  legend.replaceChildren();
  for (const method of looks.keys()) {
    const button = make("button", { type: "button", "aria-pressed": String(!qualityState.hidden.has(method)) }, swatch(method), method);
    button.addEventListener("click", () => {
      const { hidden } = qualityState;
      if (!hidden.delete(method)) hidden.add(method);
      button.setAttribute("aria-pressed", String(!hidden.has(method)));
      drawQualitySection();
    });
    legend.append(button);
  }
  const extras = extrasOf();
  if (extras.filter(Boolean).length > 1) {
    for (const [i, extra] of extras.entries()) {
      if (!extra) continue;
      legend.append(make("span", { className: "dash" }, swatch(null, DASHES[i % DASHES.length]), extra));
    }
  }
}

function startQuality() {
  const costs = usefulCosts();
  const section = document.getElementById("quality");
  if (!qualityColumns.length || !costs.length) {
    section.replaceChildren(section.firstElementChild, make("p", { className: "empty" }, "There is no row to draw."));
    return;
  }
  qualityState.cost = costs[0].key;
  const all = () => {
    drawQualityLegend();
    drawQualitySection();
  };
  const choose = (name) => (value) => {
    qualityState[name] = value;
    all();
  };
  const title = (column) => [column.key, column.unit ? `${column.title}, ${column.unit}` : column.title];
  const controls = document.getElementById("quality-controls");
  if (cases.length > 1) {
    const options = [[ALL, "all cases"], ...cases.map((one, i) => [String(i), one.name])];
    controls.append(select("case", options, qualityState.one, choose("one")));
  }
  controls.append(select("quality", qualityColumns.map(title), qualityState.metric, choose("metric")));
  if (costs.length > 1) controls.append(select("against", costs.map(title), qualityState.cost, choose("cost")));
  const several = (key) => cases.some((one) => new Set(one.rows.map((row) => row.params[key]).filter((v) => v !== undefined)).size > 1);
  if (several("points_per_m2") && several("hz")) {
    const options = [["points_per_m2", "points"], ["hz", "rates"]];
    controls.append(select("lines over", options, qualityState.grouping, choose("grouping")));
  } else if (several("hz")) {
    qualityState.grouping = "hz";
  }
  all();
}
