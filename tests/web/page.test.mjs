// The page in a browser: Debian's Chromium without a window, by playwright-core.
// EXMAT_PAGE is the folder of the page; EXMAT_PICTURES, where it is set, one for screenshots.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { mkdirSync, readFileSync } from "node:fs";
import { extname, join, normalize } from "node:path";
import { after, before, test } from "node:test";
import { Hand } from "exmat";
import { chromium } from "playwright-core";

const folder = process.env.EXMAT_PAGE, pictures = process.env.EXMAT_PICTURES;
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json", ".wasm": "application/wasm" };
const { worldOf, step, free } = await import(join(folder, "scene.js"));

let server, browser, address;
before(async () => {
  server = createServer((request, response) => {
    if (request.url === "/favicon.ico") return response.writeHead(204).end();
    try {
      const file = join(folder, normalize(new URL(request.url, "http://page").pathname).replace(/\/$/, "/index.html"));
      const bytes = readFileSync(file);
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}/`;
  browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-precise-memory-info"],
  });
});
after(async () => {
  await browser?.close();
  server?.close();
});

/** Opens the page, hands it to `use`, and fails on errors, warnings and requests to another host. */
async function visit(options, use, hash = "") {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage(), complaints = [];
  page.on("console", (message) => { if (["error", "warning"].includes(message.type()) && !/GPU stall|WebGL.*ReadPixels/.test(message.text())) complaints.push(message.text()); });
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("request", (request) => { if (!/^(data|blob):/.test(request.url()) && !request.url().startsWith(address)) complaints.push(request.url()); });
  try {
    await page.goto(address + hash);
    await loaded(page);
    await use(page, context);
    assert.deepEqual(complaints, []);
  } catch (error) {
    error.message += `; the page: ${complaints.join(" ")} ${await page.evaluate(() => document.getElementById("message")?.textContent ?? "")}`;
    throw error;
  } finally {
    await context.close();
  }
}

const loaded = (page, name) => page.waitForFunction((wanted) => {
  const { state } = window.exmat ?? {};
  return state?.current && (wanted === undefined || state.name === wanted) && state.current.world.time > 0 && document.getElementById("message").textContent === "";
}, name, { timeout: 60000 });

/** Waits until the scene has gone on by so much [s]. */
const goOn = async (page, seconds) => {
  const end = await page.evaluate((length) => window.exmat.state.current.world.time + length, seconds);
  await page.waitForFunction((time) => window.exmat.state.current.world.time >= time, end, { timeout: 60000 });
};

const picture = async (page, name) => {
  if (!pictures) return;
  mkdirSync(pictures, { recursive: true });
  await page.screenshot({ path: join(pictures, `${name}.png`) });
};

/** A pixel of the view where a body is, the lowest but one of those on a grid that are. */
const pixelOnBody = (page, where = "low") => page.evaluate((part) => {
  const { dragger } = window.exmat, { left, top, width, height } = dragger.element.getBoundingClientRect();
  const hits = [];
  for (let y = 0.02; y < 1; y += 0.02)
    for (let x = 0.02; x < 1; x += 0.02)
      if (dragger.pick({ x: 2 * x - 1, y: 1 - 2 * y })) hits.push({ x: left + x * width, y: top + y * height });
  return hits[part === "low" ? Math.floor(0.9 * hits.length) : Math.floor(0.15 * hits.length)];
}, where);

/** What the library does with the hands that the page logged, in Node. */
async function replay(name, log) {
  const file = (path) => new Uint8Array(readFileSync(join(folder, "scenes", path)));
  const current = await worldOf(JSON.parse(readFileSync(join(folder, "scenes", `${name}.json`))), file);
  for (const kind of current.models) kind.surface = kind.model.surface();
  const hands = new Map();
  for (const now of log) {
    for (const [number, hand] of hands)
      if (!now.some((other) => other.number === number)) {
        hand.free();
        hands.delete(number);
      }
    for (const { number, body, triangle, shares } of now)
      if (!hands.has(number)) hands.set(number, new Hand(current.world.bodies[body], current.models.find(({ model }) => model === current.world.bodies[body].model).surface, triangle, shares));
    for (const { number, target } of now) hands.get(number).target = target;
    step(current, { pull: () => {
      for (const { body } of hands.values()) body.clearForces();
      for (const hand of hands.values()) hand.pull();
    } });
  }
  const bodies = current.world.bodies.map((body) => {
    const { surface } = current.models.find(({ model }) => model === body.model);
    return { points: body.readPositions(surface.points), triangles: surface.triangles };
  });
  return { bodies, hash: current.world.hash, free: () => free(current) };
}

/** Begins the scene again and logs, for each step, what the hands were told. */
const beginLog = (page) => page.evaluate(async () => {
  const { state, dragger } = window.exmat, before = state.current;
  state.paused = true;
  document.getElementById("reset").click();
  while (state.current === before || state.current === null) await new Promise((resolve) => setTimeout(resolve, 10));
  const { world } = state.current, log = window.log = [], places = new Map();
  let count = 0;
  const hold = dragger.hold.bind(dragger), taken = world.step.bind(world);
  dragger.hold = (id, place) => {
    const hand = hold(id, place);
    places.set(hand, { number: count++, body: world.bodies.indexOf(place.object.body), triangle: place.faceIndex, shares: place.barycoord.toArray() });
    return hand;
  };
  world.step = (steps = 1) => {
    for (let i = 0; i < steps; ++i) log.push(dragger.hands.map((hand) => ({ ...places.get(hand), target: [...hand.target] })));
    return taken(steps);
  };
  state.paused = false;
});

const bounds = (pairs) => pairs.reduce(([a, b, c, d], [x, y]) => [Math.min(a, x), Math.min(b, y), Math.max(c, x), Math.max(d, y)], [Infinity, Infinity, -Infinity, -Infinity]);

/** Where the camera of the page draws points [3k], in pixels of the view: by its matrices, written out. */
function projected(points, { projection, inverse, width, height }) {
  const apply = (m, [x, y, z, w]) => [0, 1, 2, 3].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row] * w);
  const pairs = [];
  for (let i = 0; i < points.length; i += 3) {
    const [x, y, , w] = apply(projection, apply(inverse, [points[i], points[i + 1], points[i + 2], 1]));
    pairs.push([(0.5 + 0.5 * x / w) * width, (0.5 - 0.5 * y / w) * height]);
  }
  return pairs;
}

/** Bounds of what is drawn in the colour of bodies, or brightly, in pixels of the view. */
async function drawn(page, how = "coloured") {
  await page.addStyleTag({ content: "#stage p { display: none }" });
  const shot = (await page.locator("#view").screenshot({ scale: "css" })).toString("base64");
  return page.evaluate(async ([data, wanted]) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
    const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const { data: pixels, width } = context.getImageData(0, 0, image.width, image.height);
    let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < pixels.length; i += 4)
      if (wanted === "bright" ? pixels[i] > 60 : pixels[i] > pixels[i + 2] + 40) {
        const x = (i / 4) % width, y = Math.floor(i / 4 / width);
        [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x + 1), Math.max(bottom, y + 1)];
      }
    return [left, top, right, bottom];
  }, [shot, how]);
}

async function compareWithLibrary(page, t) {
  const told = await page.evaluate(async () => {
    const { state, camera, dragger } = window.exmat;
    state.paused = true;
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    const { width, height } = dragger.element.getBoundingClientRect();
    return { log: window.log, hash: state.current.world.hash, projection: camera.projectionMatrix.elements, inverse: camera.matrixWorldInverse.elements, width, height };
  });
  const ours = await replay("teddy", told.log), bodies = ours.bodies.map(({ points }) => projected(points, told));
  assert.equal(told.hash, ours.hash);
  const [seen, expected] = [await drawn(page), bounds(bodies.flat())];
  t.diagnostic(`${told.log.length} steps; drawn ${seen}; the library ${expected.map((x) => x.toFixed(1))}`);
  seen.forEach((x, i) => assert.ok(Math.abs(x - expected[i]) <= 2, `drawn ${seen}, the library ${expected}`));
  ours.free();
  return { told, expected };
}

test("loads, and a drag moves the body as the library says", (t) => visit({}, async (page) => {
  await picture(page, "desktop_rest");
  await beginLog(page);
  const rest = await drawn(page), { x, y } = await pixelOnBody(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 150, y - 60, { steps: 10 });
  await goOn(page, 1);
  await picture(page, "desktop_drag");
  const held = await page.evaluate(() => ({ hands: window.exmat.dragger.hands.length, space: document.getElementById("space").textContent }));
  assert.deepEqual(held, { hands: 1, space: "full" });
  const { expected } = await compareWithLibrary(page, t);
  assert.ok(expected.some((edge, i) => Math.abs(edge - rest[i]) > 20), "the drag moved nothing");
  await page.mouse.up();
  assert.equal(await page.evaluate(() => window.exmat.dragger.hands.length), 0);
}));

test("starts", (t) => {
  const begun = performance.now();
  return visit({}, async (page) => {
    const bytes = await page.evaluate(() => performance.getEntriesByType("resource").reduce((sum, { transferSize }) => sum + transferSize, 0));
    t.diagnostic(`first step after ${Math.round(performance.now() - begun)} ms and ${bytes} bytes, of which none are compressed`);
  });
});

test("the page of docs/web.md", () => visit({}, async (page) => {
  await page.goto(`${address}own/index.html`);
  await page.waitForTimeout(3000);
  const { x, y, width, height } = await page.locator("#view").boundingBox();
  const before = await drawn(page, "bright");
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(x + width / 2 + 200, y + height / 2, { steps: 5 });
  await page.waitForTimeout(1500);
  await picture(page, "own");
  const now = await drawn(page, "bright");
  assert.ok(before[0] > 0 && now[2] > before[2] + 20, `${before}, then ${now}`);
}));

test("every scene is stepped", (t) => visit({}, async (page) => {
  for (const name of await page.locator("#scenes button").allTextContents()) {
    await page.getByRole("button", { name, exact: true }).click();
    await loaded(page, name);
    await page.waitForTimeout(2500);
    await goOn(page, 0.02);
    await picture(page, `scene_${name}`);
    const told = await page.evaluate(() => {
      const { current, paused } = window.exmat.state;
      return { time: document.getElementById("time").textContent, speed: document.getElementById("speed").textContent, paused, steps: Math.round(current.world.time / current.timeStep),
               finite: current.world.bodies.every((body) => body.displacement.every(Number.isFinite)) };
    });
    t.diagnostic(`${name}: ${told.steps} steps, ${told.time} a step, ${told.speed} of real time`);
    assert.ok(told.finite && !told.paused);
  }
}));

test("sliders and keys", () => visit({}, async (page) => {
  const hug = page.getByRole("slider", { name: "hug" });
  await hug.focus();
  await page.keyboard.press("End");
  assert.equal(await page.getByRole("checkbox").isChecked(), true);
  await page.waitForFunction(() => window.exmat.state.current.world.bodies[0].weights[1] === 1);
  assert.match(await page.locator("label", { hasText: "rest" }).textContent(), /0\.00/);
  const elastic = () => page.evaluate(() => window.exmat.state.current.world.bodies[0].energies.elastic);
  await goOn(page, 2);
  const pulled = await elastic();
  await page.getByRole("slider", { name: "κ" }).focus();
  await page.keyboard.press("Home");
  await goOn(page, 2);
  assert.ok(await elastic() < 0.5 * pulled, "without kappa the body goes back");
  await page.getByRole("radio", { name: "full" }).check();
  await page.waitForFunction(() => document.getElementById("space").textContent === "full");
  await page.getByRole("radio", { name: "reduced" }).check();
  await page.waitForFunction(() => document.getElementById("space").textContent === "reduced");
  await page.locator("#view").focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowRight");
  const hands = () => page.evaluate(() => window.exmat.dragger.hands.length);
  assert.equal(await hands(), 1);
  await picture(page, "keyboard");
  await page.keyboard.press("Escape");
  assert.equal(await hands(), 0);
  // All controls are reached by Tab.
  await page.evaluate(() => document.activeElement.blur());
  const reached = new Set();
  for (let i = 0; i < 25; ++i) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => { const { activeElement: at } = document; return at.id || at.name || at.textContent; }));
  }
  for (const name of ["view", "file", "pause", "reset", "space", "given", "pile"]) assert.ok(reached.has(name), `${name} is not reached: ${[...reached]}`);
}));

test("fingers: two hands, on 360 pixels", (t) => visit({ viewport: { width: 360, height: 740 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 }, async (page, context) => {
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 360);
  await picture(page, "phone");
  await beginLog(page);
  const client = await context.newCDPSession(page), [a, b] = [await pixelOnBody(page, "low"), await pixelOnBody(page, "high")];
  const touch = (type, points) => client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map((point, id) => ({ ...point, id })) });
  await touch("touchStart", [a]);
  await touch("touchStart", [a, b]);
  for (let i = 1; i <= 10; ++i) await touch("touchMove", [{ x: a.x + 4 * i, y: a.y }, { x: b.x - 4 * i, y: b.y }]);
  await goOn(page, 0.3);
  assert.equal(await page.evaluate(() => window.exmat.dragger.hands.length), 2);
  await picture(page, "phone_drag");
  await compareWithLibrary(page, t);
  await touch("touchEnd", []);
  assert.equal(await page.evaluate(() => window.exmat.dragger.hands.length), 0);
}));

test("from 360 pixels to 4k", () => visit({}, async (page) => {
  for (const [width, height] of [[360, 640], [768, 1024], [1280, 800], [3840, 2160]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(600);
    const told = await page.evaluate(() => {
      const view = document.getElementById("view"), { camera } = window.exmat;
      return { overflow: document.documentElement.scrollWidth - innerWidth, share: view.clientWidth / innerWidth, aspect: camera.aspect * view.clientHeight / view.clientWidth,
               pixels: view.width / view.clientWidth };
    });
    assert.ok(told.overflow <= 0 && told.share > 0.7 && Math.abs(told.aspect - 1) < 0.01 && told.pixels === 1, `${width}: ${JSON.stringify(told)}`);
    await picture(page, `width_${width}`);
  }
}));

test("text has contrast in light and dark", async () => {
  for (const colorScheme of ["light", "dark"])
    await visit({ colorScheme }, async (page) => {
      await picture(page, colorScheme);
      const contrasts = await page.evaluate(() => {
        const luminance = (name) => {
          const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
          const [r, g, b] = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255).map((x) => (x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const contrast = (a, b) => (Math.max(luminance(a), luminance(b)) + 0.05) / (Math.min(luminance(a), luminance(b)) + 0.05);
        return { ink: contrast("--ink", "--panel"), faint: contrast("--faint", "--ground"), button: contrast("--accent", "--on-accent"),
                 curves: Math.min(...[0, 1, 2, 3].map((i) => contrast(`--curve-${i}`, "--panel"))) };
      });
      assert.ok(contrasts.ink >= 4.5 && contrasts.faint >= 4.5 && contrasts.button >= 4.5 && contrasts.curves >= 3, `${colorScheme}: ${JSON.stringify(contrasts)}`);
    });
});

test("memory is flat over 10,000 frames", (t) => visit({}, async (page, context) => {
  const client = await context.newCDPSession(page);
  const frames = (count) => page.evaluate((number) => {
    const { state, dragger } = window.exmat, { current } = state, [mesh] = dragger.meshes;
    state.paused = true;
    for (let i = 0; i < number; ++i) {
      if (i % 50 === 0) dragger.hold("test", { object: mesh, faceIndex: i % 100, barycoord: { toArray: () => [0.2, 0.3, 0.5] }, point: mesh.position });
      if (i % 50 === 10) dragger.release("test");
      dragger.pull();
      current.world.step();
      mesh.update();
    }
    return mesh.body.module.memory.buffer.byteLength;
  }, count);
  const heap = async () => {
    await client.send("HeapProfiler.collectGarbage");
    return (await client.send("Runtime.getHeapUsage")).usedSize;
  };
  const memory = await frames(200), used = await heap();
  assert.equal(await frames(10000), memory);
  const grown = await heap() - used;
  t.diagnostic(`${memory / 2 ** 20} MiB of the module, heap grown by ${grown} bytes`);
  assert.ok(grown < 1e6);
}));

const dropOn = (page, files) => page.evaluate((given) => {
  const transfer = new DataTransfer();
  for (const [name, data] of given) transfer.items.add(new File([Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0))], name));
  dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, files.map(([name, bytes]) => [name, Buffer.from(bytes).toString("base64")]));

test("a motion is dropped, and a scene follows it", () => visit({}, async (page) => {
  await dropOn(page, [["run.glb", readFileSync(process.env.EXMAT_PACKS + "/character.glb")]]);
  await page.waitForFunction(() => window.exmat.state.motion?.mixer.time > 0.5);
  const weights = () => page.evaluate(() => {
    const found = [];
    window.exmat.state.motion.scene.traverse((node) => found.push(...(node.morphTargetInfluences ?? [])));
    return found;
  });
  const before = await weights();
  await page.waitForFunction((from) => window.exmat.state.motion.mixer.time > from, await page.evaluate(() => window.exmat.state.motion.mixer.time + 0.3));
  const after = await weights();
  assert.ok(before.length > 1 && before.some((weight, i) => weight !== after[i]), "the flesh moves on its bones");
  assert.equal(await page.locator("#weights-plot").isVisible(), false);
  await picture(page, "motion");
  await page.click("#pause");
  await page.click("#reset");
  assert.equal(await page.evaluate(() => window.exmat.state.motion.mixer.time), 0);
  await page.click("#pause");
  await page.click("text=teddy");
  await loaded(page, "teddy");
  assert.equal(await page.evaluate(() => window.exmat.state.motion), null);
  assert.ok(await page.locator("#weights-plot").isVisible());
  await dropOn(page, [["hero.h5", "bytes"]]);
  await page.waitForFunction(() => /exmat-runtime pack hero\.h5 -o hero\.exmat/.test(document.getElementById("message").textContent));
}));

test("a pack is dropped, and a scene with its pack", () => visit({}, async (page) => {
  const drop = (files) => dropOn(page, files);
  const bar = readFileSync(process.env.EXMAT_PACKS + "/falling.exmat");
  await drop([["falling.exmat", bar]]);
  await loaded(page, "falling.exmat");
  await goOn(page, 1.5);
  await picture(page, "dropped");
  const landed = await page.evaluate(() => {
    const [body] = window.exmat.state.current.world.bodies, xyz = body.readPositions(window.exmat.state.current.models[0].surface.points);
    return { lowest: xyz.filter((_, i) => i % 3 === 1).reduce((a, b) => Math.min(a, b)), floor: window.exmat.state.current.obstacles[0].point[1] };
  });
  assert.ok(landed.lowest > landed.floor - 0.05 && landed.lowest < landed.floor + 1, JSON.stringify(landed));
  const scene = { bundle: "falling.exmat", time_step: 0.01, gravity: [0, 0, -1] };
  await drop([["falling.exmat", bar], ["own.json", JSON.stringify(scene)]]);
  await loaded(page, "own.json");
  assert.equal(await page.evaluate(() => window.exmat.state.current.timeStep), 0.01);
  await drop([["broken.exmat", bar.subarray(0, 500)]]);
  await page.waitForFunction(() => /cut short/.test(document.getElementById("message").textContent));
  assert.equal(await page.evaluate(() => window.exmat.state.name), "own.json");
}));
