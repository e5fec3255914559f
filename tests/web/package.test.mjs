// The package as a program uses it. EXMAT_PACKS is the folder of bar.exmat.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { test } from "node:test";
import * as files from "exmat";
import * as inside from "exmat/compat";

const pack = join(process.env.EXMAT_PACKS, "bar.exmat");
const settings = { gravity: [0, 0, -1], useExamples: true, exampleStiffness: 4000, exampleBias: 0.2, useContact: true };

test("both entries step the same", async () => {
  const hashes = [];
  for (const { load } of [files, inside]) {
    const model = await load(await readFile(pack), settings);
    const body = new model.Body();
    hashes.push(body.step(100).hash);
    body.free();
    model.free();
  }
  assert.equal(hashes[0], hashes[1]);
});

test("positions are rest + U q, and triangles are a closed surface", async () => {
  const model = await files.load(pack, settings);
  const points = model.allVertices(), body = new model.Body();
  const rest = body.readPositions(points);
  assert.equal(rest.length, 3 * model.vertices);
  body.step(300);
  assert.ok(body.displacement.some((q) => q !== 0));
  assert.ok(body.readPositions(points).some((x, i) => Math.abs(x - rest[i]) > 1e-3));
  const edges = new Map(), triangles = model.triangles();
  for (let i = 0; i < triangles.length; i += 3)
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [triangles[i + k], triangles[i + (k + 1) % 3]];
      edges.set(`${a} ${b}`, (edges.get(`${a} ${b}`) ?? 0) + 1);
    }
  for (const edge of edges.keys()) assert.equal(edges.get(edge.split(" ").reverse().join(" ")), 1);
  points.free();
  body.free();
  model.free();
});

test("a snapshot leads to the same bits", async () => {
  const model = await files.load(pack, settings);
  const a = new model.Body(), b = new model.Body();
  a.step(50);
  b.state = a.state;
  assert.equal(a.step(50).hash, b.step(50).hash);
  model.free();
});

test("forces, weights and energies", async () => {
  const model = await files.load(pack, { ...settings, gravity: [0, 0, 0] });
  const body = new model.Body();
  body.setExampleWeights([1, 0]);  // the rest pose alone
  assert.ok(body.step(10).energies.elastic < 1e-9);
  body.setExampleWeights([0, 1]);
  body.step(500);
  assert.deepEqual([...body.weights], [0, 1]);
  assert.ok(body.energies.elastic > 0);
  body.setExampleWeights(null);
  const tip = model.points([model.vertices - 1]);
  body.applyForces(tip, [0, 0, 5]);
  body.step(5);
  body.clearForces();
  model.free();
});

test("a batch steps as its bodies do", async () => {
  const model = await files.load(pack, settings);
  const batch = new model.Batch(16), body = new model.Body();
  batch.step(50);
  body.step(50);
  const all = batch.displacements;
  for (let i = 0; i < all.length; ++i) assert.ok(Math.abs(all[i] - body.displacement[i % model.modes]) < 1e-9);
  batch.free();
});

test("errors are of classes and have words", async () => {
  const bytes = new Uint8Array(await readFile(pack));
  await assert.rejects(files.load(bytes.subarray(0, 1000), settings), (error) => error instanceof files.BadInput && /cut short/.test(error.message));
  await assert.rejects(files.load("none.exmat"), files.BadInput);
  await assert.rejects(files.load(bytes, { timeStep: -1 }), (error) => error instanceof files.InvalidArgument && /time_step/.test(error.message));
  await assert.rejects(files.load(bytes, { space: "half" }), files.InvalidArgument);
  await assert.rejects(files.load(bytes, { colour: 1 }), files.InvalidArgument);
  // The module goes on after a refusal.
  const model = await files.load(bytes, settings);
  assert.equal(new model.Body().step(1).time, model.timeStep);
});

test("many refusals leave the stack as it was", async () => {
  const bytes = new Uint8Array(await readFile(pack));
  bytes[200] ^= 1;
  for (let i = 0; i < 300; ++i) await assert.rejects(files.load(bytes, settings), files.BadInput);
  const model = await files.load(pack, settings);
  new model.Body().step(10);
});
