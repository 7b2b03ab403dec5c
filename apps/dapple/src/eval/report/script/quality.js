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
        values: (_, ticks) =>
          ticks.map((tick) => (!points.length ? "" : hasNothing && tick === nothing ? "0" : short(tick))),
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
        (plot) =>
          withPen(plot, (pen) =>
            drawQuality(plot, pen, {
              lines,
              on,
              off,
              labels,
              roomy: roomy(),
              near,
              metric,
              nothing: hasNothing && points.some((point) => point.x > 0) ? nothing : null,
            }),
          ),
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
  // As high as the names of levels are on each other.
  const names = 17 * on.length + 50;
  const plot = plotIn(place, options, values, (width) =>
    Math.max(names, Math.min(small ? 320 : 460, Math.max(small ? 220 : 260, width * 0.5))),
  );
  plot.over.addEventListener("mouseleave", () => {
    near = null;
    plot.redraw(false);
    hint.hide();
  });
  plot.over.addEventListener("click", () => {
    if (near) showInViewer({ case: caseIndex, a: TRUTH, b: near.point.index });
  });
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute(
    "aria-label",
    `${metric.title} of ${name} against ${cost.title}; the table below has the values`,
  );
  return equal;
}

function axisLabel(column, empty) {
  if (empty) return `no method here has ${column.title}`;
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
  [low, high] = [low - room, high + room];
  // Names of levels beyond the edges need a line each.
  const line = (high - low) * 0.07;
  const [below, above] = [levels.filter(({ y }) => y < low).length, levels.filter(({ y }) => y > high).length];
  return [low - below * line, high + above * line];
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
  if (small) {
    const better = metric.more_is_better ? "more" : "less";
    notes.push(`Up: ${title}${metric.unit ? ` in ${metric.unit}` : ""}, ${better} is better.`);
    notes.push(`Right: ${axisLabel(cost, false)}, on a logarithmic axis.`);
  }
  if (equal.length) notes.push(`Not drawn, because equal to the truth: ${equal.join("; ")}.`);
  if (cases.some((one) => one.rows.some((row) => row.figures[metric.key]?.[1])))
    notes.push("Bars and bands are 95 % intervals; of many levels only the one under the pointer has a band.");
  document.getElementById("quality-note").textContent = notes.join(" ");
}

function betterHint(column) {
  return make("span", { className: "better" }, column.more_is_better ? "↑ better" : "↓ better");
}

function drawQualityLegend() {
  const legend = document.getElementById("quality-legend");
  legend.replaceChildren();
  for (const method of looks.keys()) {
    const button = make(
      "button",
      { type: "button", "aria-pressed": String(!qualityState.hidden.has(method)) },
      swatch(method),
      method,
    );
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
  const several = (key) =>
    cases.some((one) => new Set(one.rows.map((row) => row.params[key]).filter((v) => v !== undefined)).size > 1);
  if (several("points_per_m2") && several("hz")) {
    const options = [
      ["points_per_m2", "points"],
      ["hz", "rates"],
    ];
    controls.append(select("lines over", options, qualityState.grouping, choose("grouping")));
  } else if (several("hz")) {
    qualityState.grouping = "hz";
  }
  all();
}
