// Serves the page on this machine, opens it in a browser, and reports what each page showed.
//
// node driver.mjs PLAN.json, where the plan is
//   { browser, page, data, out, flags,
//     pages: [{ name, query, width, height, phone?, light?, scripts?: [{ name, script }], window?, expectMessage? }] }
// `page` and `data` are folders served as / and /data/. Each page is opened with its query and waited for; then its
// scripts are run, one after the other: each is the body of an async function of the viewer, after which the viewer's
// picture goes to out/SCRIPT.png. The whole window goes to out/PAGE.png where `window` is set. A JSON array of
// { name, errors, message, done: [{ name, stats, result }] } is printed.

import { createServer } from "node:http";
import { readFile, writeFile } from "node:fs/promises";
import { join, normalize } from "node:path";

import { launch } from "./launch.mjs";

const TYPES = {
  html: "text/html",
  js: "text/javascript",
  css: "text/css",
  json: "application/json",
  wasm: "application/wasm",
};
const PATIENCE_MS = 120_000;

const plan = JSON.parse(await readFile(process.argv[2], "utf8"));

const server = createServer(async (request, response) => {
  let path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
  if (path.endsWith("/")) path += "index.html";
  const file = path.startsWith("/data/") ? join(plan.data, path.slice(6)) : join(plan.page, path);
  try {
    const bytes = await readFile(file);
    const type = TYPES[file.split(".").pop()] ?? "application/octet-stream";
    response.writeHead(200, { "content-type": type, "content-length": bytes.length }).end(bytes);
  } catch {
    response.writeHead(404, { "content-type": "text/plain" }).end("not here");
  }
});
await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
const origin = `http://127.0.0.1:${server.address().port}`;

const browser = await launch(plan.browser, plan.flags);
const report = [];
try {
  for (const page of plan.pages) report.push(await open(page));
} finally {
  await browser.close();
  server.close();
}
console.log(JSON.stringify(report));

async function open({ name, query, width, height, phone, light, scripts, window, expectMessage }) {
  const errors = [];
  const context = await browser.newContext({
    viewport: { width, height },
    deviceScaleFactor: 1,
    hasTouch: Boolean(phone),
    colorScheme: light ? "light" : "dark",
  });
  const tab = await context.newPage();
  tab.on("console", (line) => {
    if (line.type() === "error") errors.push(`console: ${line.text()}`);
  });
  tab.on("pageerror", (error) => errors.push(`page: ${error.message}`));
  const result = { name, errors, message: null, done: [] };
  const said = async () => ((await tab.isVisible("#message")) ? (await tab.innerText("#message")).trim() : null);
  try {
    await tab.goto(`${origin}/${query}`);
    await tab.waitForFunction(
      (expectMessage) => (globalThis.dapple && !expectMessage) || !document.getElementById("message").hidden,
      expectMessage,
      { timeout: PATIENCE_MS },
    );
    result.message = await said();
    if (result.message === null) {
      await tab.evaluate(async (patience) => {
        const late = new Promise((_, reject) => setTimeout(() => reject(new Error("not ready in time")), patience));
        await Promise.race([globalThis.dapple.ready, late]);
      }, PATIENCE_MS);
      for (const { name, script } of scripts ?? []) {
        const { png, ...outcome } = await tab.evaluate(run, script);
        await writeFile(join(plan.out, `${name}.png`), Buffer.from(png, "base64"));
        result.done.push({ name, ...outcome });
      }
      result.message = await said();
    }
    if (window) {
      // Figures are renewed twice a second.
      if (result.message === null) await tab.waitForTimeout(1200);
      await tab.screenshot({ path: join(plan.out, `${name}.png`) });
    }
  } catch (error) {
    errors.push(`driver: ${error.message}`);
  } finally {
    await context.close();
  }
  return result;
}

// In the page: a script, and the picture after it.
async function run(script) {
  const body = Object.getPrototypeOf(async () => {}).constructor("viewer", script);
  const result = await body(globalThis.dapple);
  const blob = await globalThis.dapple.screenshot();
  const bytes = new Uint8Array(await blob.arrayBuffer());
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return { result: result ?? null, stats: globalThis.dapple.stats, png: btoa(text) };
}
