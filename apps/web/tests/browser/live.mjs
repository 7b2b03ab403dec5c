// Starts a program that serves a live scene, joins it with several pages, and reports what each saw.
//
// node live.mjs PLAN.json, where the plan is
//   { browser, program, serve, other, token, out }
// `serve` are the arguments that serve a scene with the token for changes, for two viewers at most, `other` those that
// serve another scene; a port is added. Pictures go to out/NAME.png. A JSON object of facts is printed.

import { spawn } from "node:child_process";
import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";

import { launch } from "./launch.mjs";
import { isLive, open as openPage, until } from "./pages.mjs";

// Time of the scene at which things are moved, seconds: boulders lie in view.
const TIME = 14.6;
const COARSE = "shadowResolution=128&samples=1&maxPixelRatio=0.5&fade=0";

const plan = JSON.parse(await readFile(process.argv[2], "utf8"));
const facts = { errors: [] };
let server = null;

const browser = await launch(plan.browser);
try {
  await run();
} catch (error) {
  facts.errors.push(`driver: ${error.stack}`);
} finally {
  await browser.close();
  await stop();
}
console.log(JSON.stringify(facts));

async function run() {
  const url = await start(plan.serve, 0);
  const port = Number(new URL(url).port);
  const mover = await open("mover", `${url}?token=${plan.token}&${COARSE}`, { width: 1280, height: 720 });
  const looker = await open("looker", `${url}?bits=500k&${COARSE}`, { width: 1280, height: 720 });
  const both = [mover, looker];
  for (const tab of both) await isLive(tab);
  facts.roles = await Promise.all(both.map((tab) => tab.evaluate(() => dapple.live.role)));
  await until(looker, () => dapple.live.viewers === 2);
  facts.bits = await looker.evaluate(() => dapple.live.bitsPerSecond);

  // What one pauses stands still for all.
  await mover.evaluate((time) => {
    dapple.pause();
    dapple.seek(time);
  }, TIME);
  for (const tab of both) await until(tab, (time) => dapple.paused && Math.abs(dapple.time - time) < 1e-3, TIME);
  facts.times = await Promise.all(both.map((tab) => tab.evaluate(() => dapple.time)));
  await looker.waitForTimeout(300);
  facts.timesLater = await Promise.all(both.map((tab) => tab.evaluate(() => dapple.time)));

  // Something that lies in the hall, seen from near by. What is picked is what was drawn last.
  await mover.evaluate(() => dapple.screenshot());
  const boulder = await mover.evaluate(findBoulder);
  facts.boulder = boulder;
  const camera = { eye: boulder.eye, target: boulder.position, yfovDegrees: 50 };
  for (const tab of both) await tab.evaluate((camera) => dapple.setCamera(camera), camera);
  await picture(looker, "before");

  const start0 = await mover.evaluate((node) => dapple.getPlacement(node), boulder.node);
  const goal = [start0.translation[0] + 0.6, start0.translation[1], start0.translation[2] - 0.4];
  await mover.evaluate(([node, translation]) => dapple.moveNode(node, { translation }), [boulder.node, goal]);
  await until(looker, (node) => dapple.edits.placed.some((placed) => placed.node === node), boulder.node);
  facts.goal = goal;
  facts.placed = await looker.evaluate(() => dapple.edits.placed);
  await until(mover, () => !dapple.live.pending && dapple.live.behind === 0);
  await looker.waitForTimeout(1500);
  await picture(looker, "after");
  await picture(mover, "after-mover");
  facts.refusedChange = await looker.evaluate((node) => {
    try {
      dapple.removeInstance(node);
      return null;
    } catch (error) {
      return error.message;
    }
  }, boulder.instance);
  facts.lookerTools = await looker.isVisible("#tools");
  facts.lookerPlay = await looker.isEnabled("#play");
  facts.looker = await looker.innerText("#link");

  // The same by hand: the pointer takes hold of the thing where it is now.
  await mover.evaluate(() => dapple.reset());
  await until(mover, () => !dapple.isEdited);
  const at = await mover.evaluate(whereIs, boulder.instance);
  await mover.keyboard.down("Alt");
  await drag(mover, at, [at[0] + 60, at[1] + 20]);
  await mover.keyboard.up("Alt");
  await until(looker, () => dapple.edits.placed.length === 1);
  facts.dragged = await looker.evaluate(() => dapple.edits.placed[0]);
  facts.tools = await mover.innerText("#tools");
  await settle(mover);
  await mover.screenshot({ path: join(plan.out, "window-mover.png") });
  await looker.screenshot({ path: join(plan.out, "window-looker.png") });
  await mover.click("#upright");
  const again = await mover.evaluate(whereIs, boulder.instance);
  await drag(mover, again, [again[0], again[1] - 60]);
  await until(looker, (y) => dapple.edits.placed[0]?.placement.translation[1] > y + 0.1, start0.translation[1]);
  facts.lifted = await looker.evaluate(() => dapple.edits.placed[0]);
  await mover.click("#upright");
  const count = await looker.evaluate(() => dapple.edits.removed.length);
  await mover.click("#another");
  await until(looker, (count) => dapple.edits.removed.length === count - 1, count);
  await mover.focus("#view");
  await mover.keyboard.press("Delete");
  await until(looker, (instance) => dapple.edits.removed.includes(instance), boulder.instance);
  await mover.click("#reset");
  await until(looker, () => !dapple.isEdited);
  facts.byHand = true;

  // One viewer too many, and one with a wrong token.
  const third = await open("third", `${url}?${COARSE}`, { width: 1280, height: 720 });
  await until(third, () => dapple.live.reason === "full");
  facts.full = await shot(third, "full");
  await third.context().close();
  const stranger = await open("stranger", `${url}?token=wrong&${COARSE}`, { width: 390, height: 844, phone: true });
  await until(stranger, () => dapple.live.state === "refused");
  facts.stranger = await shot(stranger, "stranger");
  facts.strangerReload = await stranger.isVisible("#link-reload");
  await stranger.context().close();

  // The server goes and comes again.
  await mover.evaluate((node) => dapple.moveNode(node, { translation: [0, 5, 0] }), boulder.node);
  await until(looker, () => dapple.isEdited);
  await stop();
  for (const tab of both) await until(tab, () => dapple.live.state === "reconnecting");
  facts.gone = await shot(looker, "gone");
  facts.goneMessage = await looker.isVisible("#message");
  facts.goneChange = await mover.evaluate(() => {
    try {
      dapple.play();
      return null;
    } catch (error) {
      return error.message;
    }
  });
  await picture(looker, "picture-gone");
  await start(plan.serve, port);
  for (const tab of both) await isLive(tab);
  await until(looker, () => !dapple.isEdited);
  facts.back = await shot(looker, "back");
  facts.roleBack = await mover.evaluate(() => dapple.live.role);

  // On a telephone, in the place of the one who looks.
  await looker.context().close();
  const phone = await open("phone", `${url}?token=${plan.token}&${COARSE}`, { width: 390, height: 844, phone: true });
  await isLive(phone);
  await phone.evaluate((camera) => dapple.setCamera(camera), camera);
  // To the time at which the boulder lay there.
  await phone.evaluate((time) => {
    dapple.pause();
    dapple.seek(time);
  }, TIME);
  await until(phone, (time) => dapple.paused && Math.abs(dapple.time - time) < 1e-3, TIME);
  await phone.evaluate(() => dapple.screenshot());
  await phone.tap("#across");
  await settle(phone);
  const there = await phone.evaluate(whereIs, boulder.instance);
  await phone.touchscreen.tap(there[0], there[1]);
  await until(phone, () => dapple.picked !== null);
  await settle(phone);
  facts.phone = await shot(phone, "phone");
  facts.phoneTools = await phone.innerText("#tools");
  await phone.tap("#menu");
  await shot(phone, "phone-menu");

  // Another scene in the place of this one.
  await stop();
  await start(plan.other, port);
  await until(mover, () => dapple.live.state === "refused");
  facts.otherScene = await shot(mover, "other-scene");
  facts.otherReload = await mover.isVisible("#link-reload");
  await mover.click("#link-reload");
  await mover.waitForLoadState();
  await isLive(mover);
  facts.reloaded = true;
}

function start(args, port) {
  return new Promise((resolve, reject) => {
    let said = "";
    server = spawn(plan.program, [...args, "--port", String(port)], { cwd: plan.out, stdio: ["ignore", "pipe", "pipe"] });
    const listen = (chunk) => {
      said += chunk;
      const url = /http:\/\/127\.0\.0\.1:\d+\//.exec(said);
      if (url) resolve(url[0]);
    };
    server.stdout.on("data", listen);
    server.stderr.on("data", listen);
    server.once("exit", () => reject(new Error(`the server ended: ${said}`)));
  });
}

function stop() {
  if (!server || server.exitCode !== null || server.signalCode !== null) return undefined;
  const ended = new Promise((resolve) => server.once("exit", resolve));
  server.kill("SIGKILL");
  return ended;
}

function open(name, url, options) {
  // That a server is not there is said by the browser itself.
  return openPage(browser, facts.errors, name, url, { expected: /WebSocket connection to|ERR_CONNECTION/, ...options });
}

// Figures are renewed twice a second.
function settle(tab) {
  return tab.waitForTimeout(1300);
}

async function shot(tab, name) {
  await settle(tab);
  await tab.screenshot({ path: join(plan.out, `window-${name}.png`) });
  return (await tab.innerText("#link")).trim();
}

async function picture(tab, name) {
  const png = await tab.evaluate(async () => {
    const bytes = new Uint8Array(await (await dapple.screenshot()).arrayBuffer());
    let text = "";
    for (const byte of bytes) text += String.fromCharCode(byte);
    return btoa(text);
  });
  await writeFile(join(plan.out, `${name}.png`), Buffer.from(png, "base64"));
}

async function drag(tab, from, to) {
  await tab.mouse.move(...from);
  await tab.mouse.down();
  await tab.mouse.move((from[0] + to[0]) / 2, (from[1] + to[1]) / 2, { steps: 3 });
  await tab.mouse.move(...to, { steps: 3 });
  await tab.mouse.up();
}

// In the page: something that one may take hold of, wherever it is seen.
function findBoulder() {
  for (const camera of dapple.cameras) {
    dapple.setCamera(camera);
    for (let y = 20; y < innerHeight; y += 40) {
      for (let x = 20; x < innerWidth; x += 40) {
        const picked = dapple.pick(x, y);
        if (!picked || !/boulder/.test(picked.name)) continue;
        // Nearer along the way on which nothing stands between.
        const { eye } = dapple.getCamera();
        const part = 3 / Math.max(3, Math.hypot(...eye.map((x, i) => x - picked.position[i])));
        return { ...picked, eye: picked.position.map((x, i) => x + part * (eye[i] - x)) };
      }
    }
  }
  throw new Error("no boulder is in view");
}

// In the page: where an instance is seen, as near to the middle as it is.
function whereIs(instance) {
  const places = [];
  for (let y = 10; y < innerHeight; y += 16) {
    for (let x = 10; x < innerWidth; x += 16) places.push([x, y]);
  }
  const off = ([x, y]) => Math.hypot(x - innerWidth / 2, y - innerHeight / 2);
  const found = places.sort((a, b) => off(a) - off(b)).find(([x, y]) => dapple.pick(x, y)?.instance === instance);
  if (!found) throw new Error(`instance ${instance} is not in view`);
  return found;
}
