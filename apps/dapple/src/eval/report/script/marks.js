// What is drawn over a plot of quality: marks, intervals, levels and names; and what is found under the pointer.

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
  const shown = [...qualityColumns, ...costColumns].filter(
    (column) => row.figures[column.key] && column.kind !== "other",
  );
  return [
    make("strong", {}, swatch(row.method), ` ${rowName(row)}`),
    hintLines(shown.map((column) => [column.title, figureText(column, row.figures[column.key])])),
  ];
}

/** Of more levels than this bands would hide each other: only the one under the pointer has one. */
const MOST_BANDS = 4;

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
    if (level.ci95 && (on.length <= MOST_BANDS || near?.point === level)) {
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
      const mark = markPath(
        looks.get(line.method).mark,
        x(point.at),
        y(point.y),
        (near?.point === point ? 7 : 5) * scale,
      );
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
  const levels = labels
    .filter(({ level }) => level)
    .map(({ level, words }) => ({
      words,
      x: left + width + 6 * scale,
      y: y(level.y),
      width: pen.measureText(words).width,
      color: colorOf(level.row.method),
    }));
  keepApart(levels, line, top, top + height);
  // What labels should not hide: other labels, and lines, of which a point every few pixels is enough.
  const taken = [...levels];
  const dots = lines.flatMap(({ points }) =>
    points.flatMap((point, i) => {
      const [x0, y0] = [x(point.at), y(point.y)];
      const next = points[i + 1];
      const marks = [-8, 0, 8].map((d) => [x0 + d * scale, y0]);
      if (!next) return marks;
      const [x1, y1] = [x(next.at), y(next.y)];
      const count = Math.ceil(Math.hypot(x1 - x0, y1 - y0) / (8 * scale));
      return [
        ...marks,
        ...[...Array(count)].map((_, k) => [x0 + ((x1 - x0) * k) / count, y0 + ((y1 - y0) * k) / count]),
      ];
    }),
  );
  for (const { line: own, words } of labels.filter((label) => label.line)) {
    const last = own.points.at(-1);
    const size = pen.measureText(words).width;
    const [px, py] = [x(last.at), y(last.y)];
    const bar = last.xCi95 && last.x > 0 ? x((last.at * (last.x + last.xCi95)) / last.x) - px : 0;
    const right = Math.max(9 * scale, bar) + 5 * scale;
    const [near, up, down] = [8 * scale, -13 * scale, 14 * scale];
    const sites = [
      [right, 0],
      [near, up],
      [near, down],
      [-size - right, 0],
      [-size - near, up],
      [-size - near, down],
    ];
    const candidates = sites.map(([dx, dy], i) => {
      const label = { words, x: px + dx, y: py + dy, width: size, color: colorOf(own.method) };
      const [from, to] = [label.x - 3 * scale, label.x + size + 3 * scale];
      const hidden = dots.filter(([dotX, dotY]) => dotX > from && dotX < to && Math.abs(dotY - label.y) < line * 0.6);
      const met = taken.filter(
        (other) => other.x < to && from < other.x + other.width && Math.abs(other.y - label.y) < line,
      );
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
