// Plots of studies: lines over a number, with their points.

const STUDY_SLOTS = Object.keys(SLOTS);

/** How the line of a number looks: the same in the plot and in its legend. */
function studyLook(number) {
  const round = Math.floor(number / STUDY_SLOTS.length);
  return {
    color: () => SLOTS[STUDY_SLOTS[number % STUDY_SLOTS.length]][isDark() ? "dark" : "light"],
    // A lone point shows no dashes: where a colour comes again, it has another mark.
    mark: MARKS[(number + 3 * round) % MARKS.length],
    dash: DASHES[round % DASHES.length],
  };
}

function studySwatch(look) {
  const canvas = make("canvas", { className: "swatch", "aria-hidden": "true" });
  canvas.draw = () => {
    const scale = Math.max(1, devicePixelRatio);
    Object.assign(canvas, { width: 30 * scale, height: 14 * scale });
    Object.assign(canvas.style, { width: "30px", height: "14px" });
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.fillStyle = pen.strokeStyle = look.color();
    pen.lineWidth = 2;
    pen.setLineDash(look.dash);
    pen.beginPath();
    pen.moveTo(0, 7);
    pen.lineTo(30, 7);
    pen.stroke();
    pen.fill(markPath(look.mark, 15, 7, 4.5));
  };
  canvas.draw();
  return canvas;
}

const titleOf = (one) => (one.unit ? `${one.title}, ${one.unit}` : one.title);

/** From the least to the greatest with some room; from nothing where that is near. */
function studyRange(values, isLog) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  if (isLog) {
    const room = high / low < 1.3 ? 1.6 : (high / low) ** 0.06;
    return [low / room, high * room];
  }
  const room = Math.max((high - low) * 0.06, Math.abs(high) * 0.02, 1e-6);
  return [low >= 0 && low < 0.6 * high ? 0 : low - room, high + room];
}

function studyPlot(place, plot) {
  const lines = plot.lines.filter((line) => line.points.length);
  if (!lines.length) {
    place.append(make("p", { className: "empty" }, "Nothing to draw."));
    return;
  }
  const looksOf = new Map(lines.map((line, number) => [line, studyLook(number)]));
  const points = lines.flatMap((line) => line.points);
  const ranges = [0, 1].map((k) => studyRange(points.map((point) => point[k]), [plot.x, plot.y][k].is_log));
  const xs = [...new Set(points.map(([x]) => x))].sort((a, b) => a - b);
  const at = (line) => {
    const values = new Map(line.points.map(([x, y]) => [x, y]));
    return xs.map((x) => values.get(x) ?? null);
  };
  const scale = (one, range) => ({ time: false, distr: one.is_log ? 3 : 1, log: 10, range: () => range });
  const ticks = (one, k) => (_, __, ___, ____, room) => {
    const count = k ? 6 : 8;
    return (one.is_log ? logTicks : roundTicks)(ranges[k][0], ranges[k][1], count, room);
  };
  let near = null;
  const drawn = plotIn(
    place,
    {
      padding: [12, 14, 0, 0],
      scales: { x: scale(plot.x, ranges[0]), y: scale(plot.y, ranges[1]) },
      axes: [plot.x, plot.y].map((one, k) =>
        axis({
          label: k ? null : titleOf(one),
          labelSize: 18,
          size: k ? 52 : 30,
          splits: ticks(one, k),
          values: (_, list) => list.map(short),
          filter: (_, list) => list,
        }),
      ),
      series: [
        {},
        ...lines.map((line) => ({
          stroke: () => looksOf.get(line).color(),
          width: 2,
          dash: looksOf.get(line).dash,
          spanGaps: true,
          points: { show: false },
        })),
      ],
      hooks: {
        draw: [
          (shown) =>
            withPen(shown, (pen) => {
              for (const line of lines) {
                const look = looksOf.get(line);
                for (const point of line.points) {
                  const [x, y] = [shown.valToPos(point[0], "x", true), shown.valToPos(point[1], "y", true)];
                  pen.fillStyle = look.color();
                  pen.fill(markPath(look.mark, x, y, (near === point ? 6 : 4) * devicePixelRatio));
                }
              }
            }),
        ],
        setCursor: [
          (shown) => {
            let best = 24;
            let found = null;
            for (const line of lines) {
              for (const point of line.points) {
                const [x, y] = [shown.valToPos(point[0], "x"), shown.valToPos(point[1], "y")];
                const far = Math.hypot(x - shown.cursor.left, y - shown.cursor.top);
                if (far < best) [best, found] = [far, { line, point, x, y }];
              }
            }
            if ((found?.point ?? null) !== near) {
              near = found?.point ?? null;
              shown.redraw(false);
            }
            if (!found) return hint.hide();
            const box = shown.over.getBoundingClientRect();
            const pairs = [
              [titleOf(plot.x), short(found.point[0])],
              [titleOf(plot.y), short(found.point[1])],
            ];
            hint.show(box.left + found.x, box.top + found.y, make("b", {}, found.line.name), hintLines(pairs));
          },
        ],
      },
      cursor: { x: false, y: false },
    },
    [xs, ...lines.map(at)],
    (width) => Math.min(360, Math.max(220, width * 0.6)),
  );
  drawn.over.addEventListener("mouseleave", () => {
    near = null;
    drawn.redraw(false);
    hint.hide();
  });
  drawn.root.setAttribute("role", "img");
  drawn.root.setAttribute("aria-label", `${plot.title}: ${titleOf(plot.y)} by ${titleOf(plot.x)}`);
  const legend = make("div", { className: "legend" });
  for (const line of lines) legend.append(make("span", {}, studySwatch(looksOf.get(line)), " ", line.name));
  place.after(legend);
}

function startStudies() {
  for (const [number, plots] of data.studies.entries()) {
    const places = document.getElementById(`study-${number}`);
    for (const plot of plots) {
      const place = make("div", { className: "plot-place" });
      const caption = make("figcaption", {}, `${plot.title}: ${titleOf(plot.y)}`);
      const figure = make("figure", { className: "plot" }, caption, place);
      places.append(figure);
      studyPlot(place, plot);
    }
  }
}
