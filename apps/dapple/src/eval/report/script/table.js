// The table that came with the page: sorted, filtered and copied.

function startTable() {
  const table = document.getElementById("figures");
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  const rows = [...body.rows];
  for (const row of rows) {
    const { method } = cases[row.dataset.case].rows[row.dataset.row];
    row.querySelector("th").prepend(swatch(method));
  }
  const valueOf = (row, index) => {
    const cell = row.cells[index];
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    return heads[index].classList.contains("n") ? null : cell.textContent;
  };
  let sorted = null;
  const sortBy = (index) => {
    const column = columns.get(heads[index].dataset.key);
    // A click more turns it round, a third one brings the first order back.
    const first = column?.more_is_better ? "descending" : "ascending";
    const second = first === "ascending" ? "descending" : "ascending";
    const was = sorted?.index === index ? sorted.order : null;
    const order = was === null ? first : was === first ? second : null;
    sorted = order && { index, order };
    heads.forEach((head, i) => {
      if (order && i === index) head.setAttribute("aria-sort", order);
      else head.removeAttribute("aria-sort");
    });
    const sign = order === "descending" ? -1 : 1;
    const compare = (a, b) => {
      const [x, y] = [valueOf(a, index), valueOf(b, index)];
      // What does not apply comes last either way.
      if (x === null || y === null) return (x === null) - (y === null);
      const words = typeof x === "string";
      return sign * (words ? x.localeCompare(y, "en", { numeric: true }) : x === y ? 0 : x - y);
    };
    body.append(...(order ? [...rows].sort(compare) : rows));
  };
  heads.forEach((head, index) => {
    const button = make("button", { type: "button", title: head.title }, ...head.childNodes);
    head.replaceChildren(button);
    button.addEventListener("click", () => sortBy(index));
  });

  const wanted = { one: "all", method: "all" };
  const filter = () => {
    for (const row of rows) {
      const { method } = cases[row.dataset.case].rows[row.dataset.row];
      row.hidden =
        (wanted.one !== "all" && wanted.one !== row.dataset.case) ||
        (wanted.method !== "all" && wanted.method !== method);
    }
  };
  const choose = (name) => (value) => {
    wanted[name] = value;
    filter();
  };
  const controls = document.getElementById("table-controls");
  if (cases.length > 1) {
    controls.append(
      select("case", [["all", "all cases"], ...cases.map((one, i) => [String(i), one.name])], "all", choose("one")),
    );
  }
  const methods = [...looks.keys()];
  if (methods.length > 1) {
    controls.append(select("method", [["all", "all methods"], ...methods.map((m) => [m, m])], "all", choose("method")));
  }
  // What is copied has a column of its own for each interval.
  const cells = () => {
    const intervals = heads.map(
      (head, i) => head.classList.contains("n") && rows.some((row) => row.cells[i].querySelector("i")),
    );
    const head = heads.flatMap((cell, i) => {
      const name = cell.textContent.trim().replace(/\s+/g, " ");
      return intervals[i] ? [name, `± ${name}`] : [name];
    });
    const lines = [...body.rows]
      .filter((row) => !row.hidden)
      .map((row) =>
        heads.flatMap((_, i) => {
          const cell = row.cells[i];
          const value = (cell.querySelector("span") ?? cell).textContent.trim();
          const interval = cell.querySelector("i")?.textContent.replace("± ", "") ?? "";
          return intervals[i] ? [value, interval] : [value];
        }),
      );
    return [head, ...lines];
  };
  const plain = (value) => (value === "–" ? "" : value.replace(/^−/, "-").replace(/(\d),(?=\d{3})/g, "$1"));
  const csv = () =>
    cells()
      .map((line) =>
        line
          .map((value) => {
            const bare = plain(value);
            return /[",\n]/.test(bare) ? `"${bare.replaceAll('"', '""')}"` : bare;
          })
          .join(","),
      )
      .join("\n");
  const markdown = () => {
    const [head, ...lines] = cells().map((line) => line.map((value) => value.replaceAll("|", "\\|")));
    const line = (values) => `| ${values.join(" | ")} |`;
    return [line(head), line(head.map(() => "---")), ...lines.map(line)].join("\n");
  };
  const tools = make("div", { className: "tools" });
  for (const [name, write] of [
    ["Copy CSV", csv],
    ["Copy Markdown", markdown],
  ]) {
    tools.append(copyButton(name, () => `${write()}\n`));
  }
  const save = make("button", { type: "button" }, "Save CSV");
  save.addEventListener("click", () => {
    const url = URL.createObjectURL(new Blob([`${csv()}\n`], { type: "text/csv" }));
    make("a", { href: url, download: "figures.csv" }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  });
  tools.append(save);
  controls.append(tools);
}

/** A button that copies; where a browser forbids that to files, by the old way. */
function copyButton(name, write) {
  const button = make("button", { type: "button" }, name);
  const say = (words) => {
    button.textContent = words;
    announce(words);
    setTimeout(() => (button.textContent = name), 1500);
  };
  button.addEventListener("click", async () => {
    const words = write();
    try {
      await navigator.clipboard.writeText(words);
      say("Copied");
    } catch {
      const field = make("textarea", { value: words, className: "hidden" });
      document.body.append(field);
      field.select();
      say(document.execCommand("copy") ? "Copied" : "Cannot copy");
      field.remove();
    }
  });
  return button;
}
