// Along the path: each picture's figures, the bits of each second, and how errors settle after a move.

const timeState = { one: 0, metric: null, bits: "second", settling: "behind", rows: new Map() };
/** More rows than this are not shown unless asked for. */
const ROWS_AT_FIRST = 4;

/** The rows shown of a case: at first the best of each method, those without any occlusion left out. */
function rowsShown(caseIndex) {
  if (!timeState.rows.has(caseIndex)) {
    const best = bestRows(caseIndex);
    const wanted = best.filter((index) => cases[caseIndex].rows[index].method !== "none");
    timeState.rows.set(caseIndex, new Set((wanted.length ? wanted : best).slice(0, ROWS_AT_FIRST)));
  }
  return timeState.rows.get(caseIndex);
}

/** Dashes of a row: those shown of one colour differ. */
function dashOf(caseIndex, index) {
  const { rows } = cases[caseIndex];
  const before = [...rowsShown(caseIndex)].filter(
    (other) => other < index && colorOf(rows[other].method) === colorOf(rows[index].method),
  );
  return DASHES[before.length % DASHES.length];
}

/** A row's bits: of each step, or of the second before it; times in seconds, values in kbit/s or bytes. */
function bitsOf(row, kind) {
  const { hz } = row.params;
  const times = row.step_bytes.map((_, k) => (k + 1) / hz);
  if (kind === "step") return { times, values: row.step_bytes };
  const steps = Math.max(1, Math.round(hz));
  const values = [];
  let sum = 0;
  row.step_bytes.forEach((bytes, k) => {
    sum += bytes - (k >= steps ? row.step_bytes[k - steps] : 0);
    // The first second is not full yet.
    values.push((sum * 8) / 1000 / (Math.min(k + 1, steps) / hz));
  });
  const full = values.length > steps ? steps - 1 : 0;
  return { times: times.slice(full), values: values.slice(full) };
}

/** Lines with the same numbers, as methods on the same points have the same bits, become one. */
function mergeEqual(lines) {
  const merged = new Map();
  for (const line of lines) {
    const key = JSON.stringify([line.times, line.values]);
    const found = merged.get(key);
    if (found) found.rows.push(line.rows[0]);
    else merged.set(key, line);
  }
  return [...merged.values()];
}

function linesName(caseIndex, rows) {
  if (rows.length === 1) return rowName(cases[caseIndex].rows[rows[0]]);
  const own = rows.map((index) => cases[caseIndex].rows[index]);
  const settings = [...new Set(own.map((row) => settingOf(row)))];
  const methods = own.map((row) => row.method).join(", ");
  return settings.length === 1 && settings[0] ? `${methods} · ${settings[0]}` : methods;
}

/** A plot of lines that each have times of their own. */
function linePlot(place, caseIndex, lines, { unit, digits, xUnit, xDigits, tall, rangeX, zero, onPick, sync, mark }) {
  const tables = lines.map((line) => [line.times, line.values]);
  const values = uPlot.join(
    tables,
    tables.map((table) => table.map(() => 1)),
  );
  const few = values[0].length <= 80;
  const options = {
    padding: [10, 26, 0, 0],
    cursor: {
      y: false,
      points: { show: true, size: 8 },
      focus: { prox: 24 },
      // Each line answers with its own nearest value.
      dataIdx: (plot, series, index) => nearestFilled(plot.data[series], index),
      ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
    },
    focus: { alpha: 0.3 },
    scales: {
      x: { time: false, ...(rangeX ? { range: () => rangeX } : {}) },
      y: { range: (_, low, high) => rangeOfLines(low, high, zero) },
    },
    axes: [
      axis({
        size: 30,
        space: 60,
        values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : `${short(tick)} ${xUnit}`)),
      }),
      axis({ size: 52, space: 34, values: (_, ticks) => ticks.map(short) }),
    ],
    series: [
      {},
      ...lines.map((line) => {
        const row = cases[caseIndex].rows[line.rows[0]];
        return {
          stroke: () => colorOf(row.method),
          width: 2,
          dash: dashOf(caseIndex, line.rows[0]),
          spanGaps: true,
          points: { show: few, size: 5, fill: () => colorOf(row.method) },
        };
      }),
    ],
    hooks: {
      draw: [(plot) => mark && drawMoment(plot, mark())],
      setCursor: [(plot) => showValues(plot, lines, caseIndex, { unit, digits, xUnit, xDigits, onPick })],
    },
  };
  const plot = plotIn(place, options, values, (width) => (tall ? 300 : width < LABEL_WIDTH ? 190 : 220));
  plot.showsMoment = Boolean(mark);
  plot.over.addEventListener("mouseleave", () => hint.hide());
  if (onPick) {
    plot.over.classList.add("pick");
    plot.over.addEventListener("click", () => {
      const { idx } = plot.cursor;
      if (idx !== null && idx !== undefined) onPick(values[0][idx]);
    });
  }
  return plot;
}

/** The whole path, so that plots below each other agree. */
function wholePath(found) {
  return [0, Math.max(found.seconds, ...found.time_s)];
}

function nearestFilled(list, index) {
  for (let away = 0; away < list.length; away += 1) {
    if (list[index - away] !== null && list[index - away] !== undefined) return index - away;
    if (list[index + away] !== null && list[index + away] !== undefined) return index + away;
  }
  return index;
}

function rangeOfLines(low, high, zero) {
  if (low === null || high === null) return [0, 1];
  const bottom = zero ? 0 : low;
  const room = Math.max(high - bottom, Math.abs(high) * 0.02, 1e-6) * 0.08;
  return [zero ? 0 : bottom - room, high + room];
}

/** Redraws what shows the moment of the viewer. */
function redrawMoments() {
  for (const plot of plots) if (plot.showsMoment && plot.root.isConnected) plot.redraw(false);
}

/** Where the picture that the viewer shows lies. */
function drawMoment(plot, time) {
  if (time === null || time < plot.scales.x.min || time > plot.scales.x.max) return;
  withPen(plot, (pen) => {
    const { top, height } = plot.bbox;
    const x = plot.valToPos(time, "x", true);
    pen.strokeStyle = ink.text;
    pen.globalAlpha = 0.45;
    pen.lineWidth = devicePixelRatio;
    pen.beginPath();
    pen.moveTo(x, top);
    pen.lineTo(x, top + height);
    pen.stroke();
  });
}

function showValues(plot, lines, caseIndex, { unit, digits, xUnit, xDigits, onPick }) {
  const { left, top, idx, idxs } = plot.cursor;
  // A cursor that follows another plot's says nothing.
  if (left === undefined || left < 0 || idx === null || idx === undefined || !plot.over.matches(":hover")) return;
  const box = plot.over.getBoundingClientRect();
  const values = lines.map((line, i) => ({ line, value: plot.data[i + 1][idxs[i + 1]] }));
  const filled = values.filter(({ value }) => value !== null && value !== undefined).sort((a, b) => b.value - a.value);
  const list = make(
    "dl",
    {},
    ...filled.flatMap(({ line, value }) => {
      const { method } = cases[caseIndex].rows[line.rows[0]];
      return [
        make("dt", {}, swatch(method, dashOf(caseIndex, line.rows[0])), ` ${linesName(caseIndex, line.rows)}`),
        make("dd", {}, `${text(value, digits)}${unit ? ` ${unit}` : ""}`),
      ];
    }),
  );
  const head = make("strong", {}, `${text(plot.data[0][idx], xDigits)} ${xUnit}`);
  hint.show(
    box.left + left,
    box.top + top,
    head,
    list,
    ...(onPick ? [make("small", {}, "click to see the pictures")] : []),
  );
}

function drawTimeSection() {
  const caseIndex = timeState.one;
  const found = cases[caseIndex];
  const shown = [...rowsShown(caseIndex)].sort((a, b) => a - b);
  const place = document.getElementById("time-plots");
  place.replaceChildren();
  // What has the path's time below each other, what has a time of its own beside it.
  const along = make("div", { className: "along" });
  place.append(along);
  const add = (title, content, beside = false) => {
    const inside = make("div", { className: "plot-place" });
    const figure = make("figure", { className: "plot" }, make("figcaption", {}, ...[title].flat()), inside);
    (beside ? place : along).append(figure);
    if (typeof content === "string") inside.append(make("p", { className: "empty" }, content));
    else content(inside);
  };
  const column = columns.get(timeState.metric);
  if (column) drawMetric(add, caseIndex, shown, column);
  drawBits(add, caseIndex, shown);
  drawSettling(add, caseIndex, shown);
  if (!found.rows.length) place.replaceChildren(make("p", { className: "empty" }, "There is no row to draw."));
}

function drawMetric(add, caseIndex, shown, column) {
  const found = cases[caseIndex];
  const title = [`${column.title}${column.unit ? `, ${column.unit}` : ""}, of each picture`, betterHint(column)];
  const lines = shown
    .filter((index) => found.rows[index].frames[column.key])
    .map((index) => ({
      rows: [index],
      times: found.time_s,
      values: found.time_s.map((_, i) => found.rows[index].frames[column.key][i] ?? null),
    }));
  if (found.time_s.length < 2) {
    const count = found.time_s.length ? "one picture only" : "no picture";
    add(title, `There is ${count} along the path: no line in time. Ask for more with --frames.`);
  } else if (!lines.length) {
    add(title, shown.length ? "None of the rows shown has such values." : "No row is chosen.");
  } else {
    add(title, (inside) => {
      linePlot(inside, caseIndex, lines, {
        unit: column.unit,
        digits: column.digits,
        xUnit: "s",
        xDigits: 2,
        rangeX: wholePath(found),
        sync: "path",
        mark: () => viewerTime(caseIndex),
        onPick: hasPictures(caseIndex)
          ? (time) => {
              const frame = found.time_s.indexOf(time);
              if (frame >= 0) showInViewer({ case: caseIndex, frame });
            }
          : null,
      });
    });
  }
}

function drawBits(add, caseIndex, shown) {
  const found = cases[caseIndex];
  const streamed = shown.filter((index) => found.rows[index].step_bytes.length && found.rows[index].params.hz > 0);
  const byStep = timeState.bits === "step";
  const title = byStep ? "bytes of each server step" : "kbit/s of updates, over the second before";
  if (!streamed.length) {
    add(title, shown.length ? "None of the rows shown has updates." : "No row is chosen.");
    return;
  }
  const lines = mergeEqual(streamed.map((index) => ({ rows: [index], ...bitsOf(found.rows[index], timeState.bits) })));
  if (lines.every((line) => line.values.every((value) => value === 0))) {
    add(title, "Nothing was sent after the start: nothing changed along this path.");
  } else if (lines.every((line) => line.values.length < 2)) {
    add(title, "The path has one server step only: no line in time.");
  } else {
    add(title, (inside) =>
      linePlot(inside, caseIndex, lines, {
        unit: byStep ? "bytes" : "kbit/s",
        digits: byStep ? 0 : 1,
        xUnit: "s",
        xDigits: 2,
        rangeX: wholePath(found),
        zero: true,
        sync: "path",
        mark: () => viewerTime(caseIndex),
      }),
    );
  }
}

/** What is shown after a move: how far it is from what is shown in the end, or from the truth. */
const SETTLING = {
  behind: {
    words: "behind what is shown in the end",
    title: "RMS of visibility behind what is shown in the end, after a move of everything",
    values: (settling) => settling.behind_rms,
    format: { unit: "", digits: 4, zero: true },
  },
  truth: {
    words: "visibility against the truth",
    title: "visibility, dB, after a move of everything",
    values: (settling) => settling.visibility_psnr_db,
    format: { unit: "dB", digits: 2 },
  },
};

function drawSettling(add, caseIndex, shown) {
  const found = cases[caseIndex];
  if (!found.rows.some((row) => row.settling)) return;
  const { title, values, format } = SETTLING[timeState.settling];
  const lines = shown
    .filter((index) => found.rows[index].settling?.after_s.length)
    .map((index) => {
      const { settling } = found.rows[index];
      return { rows: [index], times: settling.after_s.map((s) => s * 1000), values: values(settling) };
    });
  const stayed = timeState.settling === "behind" && lines.every((line) => line.values.every((value) => value === 0));
  if (!lines.length) {
    add(title, "None of the rows shown was looked at after a move.", true);
  } else if (stayed) {
    add(title, "The move changed nothing in view.", true);
  } else {
    const draw = (inside) => linePlot(inside, caseIndex, lines, { ...format, xUnit: "ms", xDigits: 0, tall: true });
    add(title, draw, true);
  }
}

function drawTimeLegend() {
  const caseIndex = timeState.one;
  const shown = rowsShown(caseIndex);
  const legend = document.getElementById("time-legend");
  legend.replaceChildren(
    ...cases[caseIndex].rows.map((row, index) => {
      const button = make(
        "button",
        { type: "button", "aria-pressed": String(shown.has(index)) },
        swatch(row.method, dashOf(caseIndex, index)),
        rowName(row),
      );
      button.addEventListener("click", () => {
        if (!shown.delete(index)) shown.add(index);
        drawTimeLegend();
        drawTimeSection();
        // The button is a new one, since dashes may have changed.
        legend.children[index].focus();
      });
      return button;
    }),
  );
}

function startTimelines() {
  const metrics = qualityColumns.filter((column) =>
    cases.some((one) => one.rows.some((row) => row.frames[column.key])),
  );
  timeState.metric = metrics[0]?.key ?? null;
  const controls = document.getElementById("time-controls");
  const all = () => {
    drawTimeLegend();
    drawTimeSection();
  };
  if (cases.length > 1) {
    controls.append(
      select(
        "case",
        cases.map((one, i) => [String(i), one.name]),
        "0",
        (value) => {
          timeState.one = Number(value);
          all();
        },
      ),
    );
  }
  if (metrics.length > 1) {
    const options = metrics.map((column) => [
      column.key,
      column.unit ? `${column.title}, ${column.unit}` : column.title,
    ]);
    controls.append(
      select("quality", options, timeState.metric, (value) => {
        timeState.metric = value;
        drawTimeSection();
      }),
    );
  }
  if (cases.some((one) => one.rows.some((row) => row.step_bytes.length))) {
    controls.append(
      select(
        "bits",
        [
          ["second", "kbit/s, sliding second"],
          ["step", "bytes a step"],
        ],
        timeState.bits,
        (value) => {
          timeState.bits = value;
          drawTimeSection();
        },
      ),
    );
  }
  if (cases.some((one) => one.rows.some((row) => row.settling))) {
    const options = Object.entries(SETTLING).map(([key, { words }]) => [key, words]);
    controls.append(
      select("after a move", options, timeState.settling, (value) => {
        timeState.settling = value;
        drawTimeSection();
      }),
    );
  }
  if (cases.length) all();
}
