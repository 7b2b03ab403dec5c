// What the page knows: figures and their columns, rows and their names, numbers as text, pictures.

const data = JSON.parse(document.getElementById("data").textContent);
const cases = data.cases;
const columns = new Map(data.columns.map((column) => [column.key, column]));
const qualityColumns = data.columns.filter((column) => column.kind === "quality");
const costColumns = data.columns.filter((column) => column.kind === "cost");

/** The truth, where a row is asked for. */
const TRUTH = -1;

/** What a picture can show: its list in a row, its name, and what the truth shows beside it. */
const VIEWS = [
  { key: "beauty", title: "Picture", truth: "beauty" },
  { key: "visibility", title: "Visibility", truth: "visibility" },
  { key: "error", title: "Error", truth: "visibility" },
  { key: "flip", title: "FLIP", truth: "beauty" },
];

/** A new element: properties, or attributes where the name has a dash or starts a role; then what is in it. */
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null) continue;
    if (name === "role" || name === "for" || name.includes("-")) element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** A select over [value, text] pairs, with a label. */
function select(label, options, value, onChange) {
  const field = make("select", {}, ...options.map(([key, text]) => make("option", { value: key }, text)));
  field.value = value;
  field.addEventListener("change", () => onChange(field.value));
  const whole = make("label", { className: "field" }, make("span", {}, label), field);
  whole.field = field;
  return whole;
}

/** Buttons of which one is pressed. */
function segments(label, options, value, onChange) {
  const whole = make("div", { className: "segments", role: "group", "aria-label": label });
  const buttons = options.map(([key, text, title]) => {
    const button = make("button", { type: "button", title }, text);
    button.addEventListener("click", () => {
      whole.show(key);
      onChange(key);
    });
    whole.append(button);
    return [key, button];
  });
  whole.show = (key) => {
    for (const [other, button] of buttons) button.setAttribute("aria-pressed", String(other === key));
  };
  whole.show(value);
  return whole;
}

/** Says something to those who hear the page. */
function announce(text) {
  let place = document.getElementById("said");
  if (!place) {
    place = make("div", { id: "said", className: "hidden", role: "status", "aria-live": "polite" });
    document.body.append(place);
  }
  place.textContent = text;
}

/** A number with a true minus sign and with thousands apart; a dash where there is none. */
function text(value, digits) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return "∞";
  const fixed = Math.abs(value).toFixed(digits);
  const sign = value < 0 && /[1-9]/.test(fixed) ? "−" : "";
  const [whole, rest] = fixed.split(".");
  const apart = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, ",") : whole;
  return sign + apart + (rest ? `.${rest}` : "");
}

/** A number as short as its size allows, for axes. */
function short(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`.replace("-", "−");
  if (size >= 1e4) return `${+(value / 1e3).toPrecision(3)}k`.replace("-", "−");
  return String(+value.toPrecision(4)).replace("-", "−");
}

/** A figure of a column in words, with its unit and interval. */
function figureText(column, [value, ci95]) {
  if (value === null) return "equal to the truth";
  const unit = column.unit ? ` ${column.unit}` : "";
  const interval = ci95 === null ? "" : ` ± ${text(ci95, column.digits)}`;
  return text(value, column.digits) + interval + unit;
}

/** What tells a row from others of its method in words, but for some parameters. */
function settingOf(row, ...without) {
  return row.setting
    .filter(([key]) => !without.includes(key))
    .map(([, words]) => words)
    .join(", ");
}

/** A row's name in one line. A method's own name may say its rays, as `rtao-16` does. */
function rowName(row) {
  const rays = row.params.rays_per_pixel;
  const said = rays !== undefined && row.method.endsWith(`-${rays}`) ? "rays_per_pixel" : null;
  return [row.method, settingOf(row, said)].filter(Boolean).join(" · ");
}

/** The name of a row of a case, or of the truth. */
function nameOf(caseIndex, rowIndex) {
  return rowIndex === TRUTH ? "truth" : rowName(cases[caseIndex].rows[rowIndex]);
}

/** What ranks figures: the larger the better; equal to the truth above all. */
function rank(column, figure) {
  if (!figure) return -Infinity;
  if (figure[0] === null) return Infinity;
  return column.more_is_better ? figure[0] : -figure[0];
}

/** For each method of a case, in their order, the index of its best row by the first metric. */
function bestRows(caseIndex) {
  const column = qualityColumns[0];
  const best = new Map();
  cases[caseIndex].rows.forEach((row, index) => {
    const other = best.get(row.method);
    const better = (a, b) => rank(column, a.figures[column.key]) > rank(column, b.figures[column.key]);
    if (other === undefined || better(row, cases[caseIndex].rows[other])) best.set(row.method, index);
  });
  return [...best.values()];
}

const twins = new Map(data.same);
const missing = new Set(data.missing);
const urls = new Map();

/**
 * The number of a picture of a row (or the truth) at a moment; null if there is none. The truth has no errors: beside
 * them it shows what they are errors of.
 */
function pictureNumber(caseIndex, rowIndex, frame, view) {
  const found = cases[caseIndex];
  const lists = rowIndex === TRUTH ? found.truth : found.rows[rowIndex].pictures;
  const key = rowIndex === TRUTH ? VIEWS.find((v) => v.key === view).truth : view;
  return lists[key]?.[frame] ?? null;
}

/** An address of a picture: in this page, or of its file beside it; null if there is none. */
function pictureUrl(number) {
  if (number === null || missing.has(number)) return null;
  const own = twins.get(number) ?? number;
  if (urls.has(own)) return urls.get(own);
  const element = document.getElementById(`p${own}`);
  let url = data.names[number].split("/").map(encodeURIComponent).join("/");
  if (element) {
    const [head, body] = element.textContent.split(",", 2);
    const bytes = Uint8Array.from(atob(body), (letter) => letter.charCodeAt(0));
    const type = head.slice("data:".length, head.indexOf(";"));
    url = URL.createObjectURL(new Blob([bytes], { type }));
    // From here on the browser keeps the bytes.
    element.remove();
    urls.set(own, url);
  }
  return url;
}

/** Whether a case has any picture to show. */
function hasPictures(caseIndex) {
  const found = cases[caseIndex];
  const any = (lists) => Object.values(lists).some((list) => list.some((n) => n !== null && !missing.has(n)));
  return any(found.truth) || found.rows.some((row) => any(row.pictures));
}

/** Runs `show` once the element comes near the window. */
const whenNear = (() => {
  const waiting = new WeakMap();
  const observer = new IntersectionObserver(
    (entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        observer.unobserve(entry.target);
        waiting.get(entry.target)?.();
      }
    },
    { rootMargin: "400px" },
  );
  return (element, show) => {
    waiting.set(element, show);
    observer.observe(element);
  };
})();
