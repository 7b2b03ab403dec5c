// Pages that join a live session.

const PATIENCE_MS = 150_000;

/** Opens a page and waits until it shows its scene. What goes wrong in it is added to `errors`, unless it is `expected`. */
export async function open(browser, errors, name, url, { width, height, phone, expected, change }) {
  const context = await browser.newContext({
    viewport: { width, height },
    deviceScaleFactor: 1,
    hasTouch: Boolean(phone),
    colorScheme: "dark",
  });
  const tab = await context.newPage();
  if (change) {
    await tab.route("**/viewer.json", async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, json: change(await response.json()) });
    });
  }
  tab.on("console", (line) => {
    if (line.type() === "error" && !expected.test(line.text())) errors.push(`${name}: ${line.text()}`);
  });
  tab.on("pageerror", (error) => errors.push(`${name}: ${error.message}`));
  await tab.goto(url);
  await until(tab, () => globalThis.dapple || !document.getElementById("message").hidden);
  if (await tab.isVisible("#message")) throw new Error(`${name}: ${await tab.innerText("#message")}`);
  return tab;
}

export function until(tab, what, argument) {
  return tab.waitForFunction(what, argument, { timeout: PATIENCE_MS, polling: 100 });
}

export async function isLive(tab) {
  await until(tab, () => globalThis.dapple?.live?.state === "live" && dapple.live.hasLight);
  await tab.evaluate(() => dapple.ready);
}
