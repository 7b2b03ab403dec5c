// Opens report pages as files in a browser and reports what each showed.
//
// node driver.mjs PLAN.json, where the plan is
//   { browser, modules, views: [{ file, hash?, width, height, dark?, touch?, script }] }
// `modules` is the folder of node modules with playwright-core. `script` is the body of an async function that is run
// in the page. A JSON array of { width, errors, requests, result } is printed: errors and warnings of the console, and
// requests for anything that is not a file or in the page.

import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const plan = JSON.parse(await readFile(process.argv[2], "utf8"));
const { chromium } = createRequire(join(plan.modules, "none.js"))("playwright-core");

const browser = await chromium.launch({ executablePath: plan.browser, headless: true, args: ["--no-sandbox"] });
const reports = [];
try {
  for (const view of plan.views) reports.push(await open(view));
} finally {
  await browser.close();
}
console.log(JSON.stringify(reports));

async function open({ file, hash, width, height, dark, touch, script }) {
  const report = { width, errors: [], requests: [], result: null };
  const context = await browser.newContext({
    viewport: { width, height },
    deviceScaleFactor: 1,
    hasTouch: Boolean(touch),
    colorScheme: dark ? "dark" : "light",
    reducedMotion: "reduce",
  });
  const tab = await context.newPage();
  tab.on("console", (line) => {
    if (["error", "warning"].includes(line.type())) report.errors.push(`console: ${line.text()}`);
  });
  tab.on("pageerror", (error) => report.errors.push(`page: ${error.message}`));
  tab.on("request", (request) => {
    if (!/^(file|data|blob):/.test(request.url())) report.requests.push(request.url());
  });
  try {
    await tab.goto(pathToFileURL(file).href + (hash ?? ""));
    await tab.waitForFunction(() => document.documentElement.classList.contains("scripts"), null, { timeout: 15_000 });
    report.result = await tab.evaluate((script) => Object.getPrototypeOf(async () => {}).constructor(script)(), script);
  } catch (error) {
    report.errors.push(`driver: ${error.message}`);
  } finally {
    await context.close();
  }
  return report;
}
