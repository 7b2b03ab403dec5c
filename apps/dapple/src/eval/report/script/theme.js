// Colours, marks and dashes of methods: the same everywhere on the page, told apart by everyone, by day and by night.

/** Wong's palette, darker or lighter where its own colour would drown in the background. */
const SLOTS = {
  blue: { light: "#0072b2", dark: "#56b4e9" },
  vermilion: { light: "#d55e00", dark: "#ff8b4a" },
  green: { light: "#008a64", dark: "#2fc79a" },
  purple: { light: "#b04f8f", dark: "#e59cc9" },
  orange: { light: "#c07f00", dark: "#f0b63c" },
  sky: { light: "#3f8fc4", dark: "#9cc9f5" },
  olive: { light: "#857a00", dark: "#e6dc4e" },
  gray: { light: "#6b7280", dark: "#a3acb8" },
};
const MARKS = ["circle", "square", "triangle", "diamond", "cross", "down", "star", "bar"];
/** Methods that are met often keep their colour from page to page. */
const KNOWN = [
  [/^psao$/, "blue", "circle"],
  [/^psao-mls/, "green", "diamond"],
  [/^psao-hat/, "vermilion", "square"],
  [/^psao-paper|^paper/, "orange", "down"],
  [/^sd-/, "vermilion", "square"],
  [/-peeled$/, "gray", "diamond"],
  [/^(ssao|sao|alchemy)/, "olive", "bar"],
  [/^hbao/, "sky", "star"],
  [/^gtao/, "green", "diamond"],
  [/^rtao/, "purple", "triangle"],
  [/^none$/, "gray", "cross"],
];
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

/** Each method's colour and mark. Variants of one method, as `rtao-4` and `rtao-16` are, share a colour, not a mark. */
const looks = (() => {
  const found = new Map();
  const methods = [...new Set(cases.flatMap((one) => one.rows.map((row) => row.method)))];
  const knownOf = (method) => KNOWN.find(([pattern]) => pattern.test(method));
  const marks = new Set(methods.map((method) => knownOf(method)?.[2]).filter(Boolean));
  const taken = new Set();
  const markFor = (wanted) => {
    const mark =
      wanted && !taken.has(wanted)
        ? wanted
        : (MARKS.find((one) => !marks.has(one)) ?? MARKS[found.size % MARKS.length]);
    marks.add(mark);
    taken.add(mark);
    return mark;
  };
  for (const method of methods) {
    const known = knownOf(method);
    if (known) found.set(method, { color: known[1], mark: markFor(known[2]) });
  }
  const free = Object.keys(SLOTS).filter((slot) => ![...found.values()].some((look) => look.color === slot));
  for (const method of methods) {
    if (found.has(method)) continue;
    const color = free.shift() ?? Object.keys(SLOTS)[found.size % Object.keys(SLOTS).length];
    found.set(method, { color, mark: markFor() });
  }
  return new Map(methods.map((method) => [method, found.get(method)]));
})();

const prefersDark = matchMedia("(prefers-color-scheme: dark)");
const redraws = [];

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : prefersDark.matches;
}

function colorOf(method) {
  return SLOTS[looks.get(method)?.color ?? "gray"][isDark() ? "dark" : "light"];
}

/** A colour of the style sheet as a canvas takes it. */
function styleColor(variable) {
  const probe = make("span", { hidden: true });
  probe.style.color = `var(${variable})`;
  document.body.append(probe);
  const color = getComputedStyle(probe).color;
  probe.remove();
  return color;
}

/** Runs `redraw` whenever colours change. */
function onTheme(redraw) {
  redraws.push(redraw);
}

function startTheme() {
  const changed = () => {
    document.querySelectorAll("canvas.swatch").forEach((canvas) => canvas.draw());
    redraws.forEach((redraw) => redraw());
  };
  prefersDark.addEventListener("change", changed);
  document.getElementById("theme").addEventListener("click", () => {
    const dark = !isDark();
    // What the system prefers is no choice to keep.
    if (dark === prefersDark.matches) delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = dark ? "dark" : "light";
    announce(dark ? "dark" : "light");
    changed();
  });
}

/** The outline of a mark around a place, `radius` to each side. */
function markPath(mark, x, y, radius) {
  const path = new Path2D();
  const polygon = (points) => {
    points.forEach(([dx, dy], i) => path[i ? "lineTo" : "moveTo"](x + dx * radius, y + dy * radius));
    path.closePath();
  };
  const third = Math.PI / 3;
  switch (mark) {
    case "square":
      polygon([
        [-0.9, -0.9],
        [0.9, -0.9],
        [0.9, 0.9],
        [-0.9, 0.9],
      ]);
      break;
    case "triangle":
      polygon([
        [0, -1.15],
        [1.1, 0.85],
        [-1.1, 0.85],
      ]);
      break;
    case "down":
      polygon([
        [0, 1.15],
        [1.1, -0.85],
        [-1.1, -0.85],
      ]);
      break;
    case "diamond":
      polygon([
        [0, -1.25],
        [1.25, 0],
        [0, 1.25],
        [-1.25, 0],
      ]);
      break;
    case "cross":
      polygon([
        [-1, -0.55],
        [-0.55, -1],
        [0, -0.45],
        [0.55, -1],
        [1, -0.55],
        [0.45, 0],
        [1, 0.55],
        [0.55, 1],
        [0, 0.45],
        [-0.55, 1],
        [-1, 0.55],
        [-0.45, 0],
      ]);
      break;
    case "bar":
      polygon([
        [-1.2, -0.5],
        [1.2, -0.5],
        [1.2, 0.5],
        [-1.2, 0.5],
      ]);
      break;
    case "star":
      polygon(
        [...Array(6)].flatMap((_, i) => [
          [1.3 * Math.sin(i * third), -1.3 * Math.cos(i * third)],
          [0.6 * Math.sin((i + 0.5) * third), -0.6 * Math.cos((i + 0.5) * third)],
        ]),
      );
      break;
    default:
      path.arc(x, y, radius, 0, 2 * Math.PI);
  }
  return path;
}

/** A method's mark, on a piece of its line if that has dashes; without a method the line alone. */
function swatch(method, dash = null) {
  const canvas = make("canvas", { className: "swatch", "aria-hidden": "true" });
  const draw = () => {
    const scale = Math.max(1, devicePixelRatio);
    const [width, height] = dash ? [30, 14] : [14, 14];
    Object.assign(canvas, { width: width * scale, height: height * scale });
    Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.fillStyle = pen.strokeStyle = method === null ? styleColor("--text") : colorOf(method);
    if (dash) {
      pen.lineWidth = 2;
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(0, height / 2);
      pen.lineTo(width, height / 2);
      pen.stroke();
    }
    if (method !== null) pen.fill(markPath(looks.get(method)?.mark, width / 2, height / 2, 4.5));
  };
  canvas.draw = draw;
  draw();
  return canvas;
}
