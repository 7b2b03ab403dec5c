// Pages that take part in a live session over WebTransport, and one beside them over a WebSocket.
//
// node moq.mjs PLAN.json, where the plan is
//   { browser, url, port, relay, out, server, again: [program, arguments] }
// `url` is a server's, `port` one at which nobody answers UDP, `relay` the address of a relay that has the session, or null; `server` is the server's process, and `again` starts another at its address. Pictures of the windows go to out/NAME.png. A JSON object of facts is printed.

import { spawn } from "node:child_process";
import { readFile } from "node:fs/promises";
import { join } from "node:path";

import { launch } from "./launch.mjs";
import { isLive, open as openPage, until } from "./pages.mjs";

const COARSE = "shadowResolution=128&samples=1&maxPixelRatio=0.5&fade=0";

const plan = JSON.parse(await readFile(process.argv[2], "utf8"));
const facts = { errors: [] };
const browser = await launch(plan.browser);
try {
  await run();
} catch (error) {
  facts.errors.push(`driver: ${error.stack}`);
} finally {
  await browser.close();
}
console.log(JSON.stringify(facts));

async function run() {
  const mover = await open("mover", `${plan.url}?${COARSE}`);
  const looker = await open("looker", `${plan.url}?${COARSE}`);
  for (const tab of [mover, looker]) await isLive(tab);
  await until(mover, () => dapple.live.role === "interact");
  // Time stands still for all, so that pages which draw in software come to rest.
  await mover.evaluate(() => dapple.pause());
  for (const tab of [mover, looker]) await until(tab, () => dapple.paused);
  const other = await open("other", `${plan.url}?transport=websocket&${COARSE}`);
  const all = [mover, looker, other];
  await isLive(other);
  facts.transports = await Promise.all(all.map((tab) => tab.evaluate(() => dapple.live.transport)));
  const node = await mover.evaluate(() => dapple.instances?.[1]?.node ?? 1);
  const goal = [0.1, 0.4, 0.2];
  await mover.evaluate(([node, translation]) => dapple.moveNode(node, { translation }), [node, goal]);
  for (const tab of [looker, other]) {
    await until(tab, (node) => dapple.edits.placed.some((placed) => placed.node === node), node);
  }
  facts.placed = await Promise.all(all.map((tab) => tab.evaluate(() => dapple.edits.placed[0])));
  facts.goal = goal;
  await until(mover, () => !dapple.live.pending);
  // What is said over a WebSocket is heard over WebTransport.
  await other.evaluate(() => dapple.seek(1.25));
  for (const tab of all) await until(tab, () => Math.abs(dapple.time - 1.25) < 1e-3);
  await mover.waitForTimeout(1500);
  for (const [tab, name] of [[mover, "mover"], [looker, "looker"]]) {
    await tab.screenshot({ path: join(plan.out, `window-${name}.png`) });
  }
  facts.text = await looker.innerText("#link");
  facts.figures = await looker.evaluate(() => document.getElementById("transport").textContent);
  facts.light = await Promise.all(all.map((tab) => tab.evaluate(() => dapple.stats.points)));

  // UDP that leads nowhere: the page's own way is taken.
  const walled = await open("walled", `${plan.url}?${COARSE}`, (json) => {
    json.moq.url = `https://127.0.0.1:${plan.port}/{viewer}`;
    return json;
  });
  await isLive(walled);
  facts.walled = await walled.evaluate(() => dapple.live.transport);
  await walled.context().close();

  if (plan.relay) await byRelay();

  // The server starts again, under another name and with another certificate.
  process.kill(plan.server, "SIGKILL");
  await until(looker, () => dapple.live.state !== "live");
  const [program, parameters] = plan.again;
  const server = spawn(program, parameters, { stdio: "ignore", cwd: plan.out });
  try {
    await isLive(looker);
    await until(looker, () => dapple.edits.placed.length === 0);
    facts.again = await looker.evaluate(() => dapple.live.transport);
  } finally {
    server.kill("SIGKILL");
  }
}

async function byRelay() {
  const relayed = await open("relayed", `${plan.url}?${COARSE}`, (json) => {
    json.moq = { url: plan.relay, name: json.moq.name };
    return json;
  });
  await isLive(relayed);
  facts.relayed = await relayed.evaluate(() => [dapple.live.transport, dapple.stats.points]);
}

function open(name, url, change) {
  // That a connection cannot be made is said by the browser itself.
  const options = { width: 960, height: 540, expected: /WebTransport|WebSocket|QUIC|ERR_CONNECTION/, change };
  return openPage(browser, facts.errors, name, url, options);
}
