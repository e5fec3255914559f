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

test("forces that were removed or changed leave the bits of those that were given so", async () => {
  const model = await files.load(pack, settings);
  const body = new model.Body(), given = new model.Body(), never = new model.Body(), tip = model.points([model.vertices - 1]);
  for (const each of [body, given, never]) each.applyForces(tip, [0.1, 0.2, 0.3]);
  const id = body.addForces(tip, [3e5, 1e5, 0]);
  body.setForces(id, tip, [0, 2, 1]);
  given.applyForces(tip, [0, 2, 1]);
  assert.equal(body.step(20).hash, given.step(20).hash);
  body.state = never.state;
  assert.throws(() => body.removeForces(id), files.InvalidArgument);
  body.removeForces(body.addForces(tip, [3e5, 1e5, 0]));
  assert.equal(body.step(20).hash, never.step(20).hash);
  assert.throws(() => body.setForces(0.5, tip, [0, 0, 1]), files.InvalidArgument);
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

const shifted = (x, y, z) => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z];
const near = (a, b, tolerance) => a.length === b.length && a.every((x, i) => Math.abs(x - b[i]) <= tolerance);

test("an attachment holds its vertices where the frame is, and bears the weight of a free body", async () => {
  const model = await files.load(join(process.env.EXMAT_PACKS, "falling.exmat"), { gravity: [0, 0, -9.81], stiffnessDamping: 0.05, massDamping: 2, timeStep: 0.005, space: "auto" });
  const body = new model.Body(), all = model.surface("object"), rest = all.points.rest;
  const highest = rest.filter((_, i) => i % 3 === 2).reduce((a, b) => Math.max(a, b));
  const ids = [...all.vertices].filter((_, i) => rest[3 * i + 2] > highest - 1e-6), held = model.points(ids);
  const before = body.readPositions(held);
  const id = body.attach(ids, shifted(0, 0, 0));
  for (let i = 1; i <= 100; ++i) {
    body.moveAttachment(id, shifted(0, 0, 0.001 * i));
    body.step();
  }
  assert.ok(near(body.readPositions(held), before.map((x, i) => x + (i % 3 === 2 ? 0.1 : 0)), 1e-6));
  body.step(2000);
  const { force, broken } = body.attachmentLoad(id), weight = 9.81 * model.mass;
  assert.ok(near(force, [0, 0, -weight], 1e-3 * weight), `${force} and ${weight}`);
  assert.equal(broken, false);
  body.detach(id);
  assert.throws(() => body.detach(id), files.InvalidArgument);
  assert.throws(() => body.attach(ids, [1, 0, 0]), files.InvalidArgument);
  const weak = body.attach(ids, shifted(0, 0, 0.1), { kind: "ball", breakForce: 0.1 * weight });
  body.step(20);
  assert.equal(body.attachmentLoad(weak).broken, true);
  all.free();
  model.free();
});

test("a body that is tied to another falls with it, and neither leaves the other", async () => {
  const model = await files.load(join(process.env.EXMAT_PACKS, "falling.exmat"), { gravity: [0, 0, -9.81], timeStep: 0.005, useContact: true });
  const world = new files.World(), body = world.add(new model.Body()), other = world.add(new model.Body());
  other.motion = { ...other.motion, position: [0, 0, 3] };
  const all = model.surface("object"), rest = all.points.rest, zs = rest.filter((_, i) => i % 3 === 2);
  const at = (z) => [...all.vertices].filter((_, i) => Math.abs(rest[3 * i + 2] - z) < 1e-6);
  const top = at(zs.reduce((a, b) => Math.max(a, b))), bottom = at(zs.reduce((a, b) => Math.min(a, b)));
  const id = body.attachTo(top, other, bottom, { kind: "ball" });
  const gap = () => {
    const of = (own, vertices) => own.readPositions(model.points(vertices)).reduce((sum, x, i) => sum + (i % 3 === 2 ? x / vertices.length : 0), 0);
    return of(other, bottom) - of(body, top);
  };
  const before = gap(), start = body.readPositions(model.points(top))[2];
  world.step(100);
  assert.ok(Math.abs(gap() - before) <= 1e-6 * Math.abs(before), `${gap()} and ${before}`);
  const fallen = start - body.readPositions(model.points(top))[2];
  assert.ok(Math.abs(fallen - 9.81 * 0.005 ** 2 * 100 * 101 / 2) <= 1e-6, "as bodies in free fall by backward Euler");
  body.detach(id);
  assert.throws(() => body.attachTo([0], body, [1], {}), files.InvalidArgument, "itself");
  world.free();
  model.free();
});

test("touches begin, stay and end where bodies and the floor do", async () => {
  const model = await files.load(join(process.env.EXMAT_PACKS, "falling.exmat"), { gravity: [0, 0, -9.81], timeStep: 0.005, massDamping: 1, useContact: true });
  const world = new files.World({ damping: 1e4 }), lower = world.add(new model.Body()), upper = world.add(new model.Body());
  const all = model.surface("object"), heights = (xyz) => Array.from(xyz).filter((_, i) => i % 3 === 2);
  const rest = heights(all.points.rest), low = Math.min(...rest), high = Math.max(...rest), ground = low - 0.02;
  const floor = world.addObstacle({ point: [0, 0, ground], direction: [0, 0, 1], stiffness: 1e6, damping: 1e4 });
  upper.motion = { position: [0, 0, high - low + 0.01] };
  const above = (body, z) => Math.min(...heights(body.readPositions(all.points))) - z;
  assert.deepEqual(world.touches, []);
  const told = [];
  for (let i = 0; i < 400 && told.length < 2; ++i) {
    world.step();
    for (const { body, other, obstacle, change } of world.touches) {
      if (change !== "begins" || told.includes(other)) continue;
      assert.equal(body, lower);
      assert.equal(obstacle, other === null ? floor : null);
      assert.ok(other === null || other === upper);
      const gap = other === null ? above(lower, ground) : above(upper, Math.max(...heights(lower.readPositions(all.points))));
      assert.ok(Math.abs(gap) < 0.05, `they meet at a distance of ${gap}`);
      told.push(other);
    }
  }
  assert.deepEqual(new Set(told), new Set([null, upper]));
  world.step(200);
  assert.deepEqual(world.step().touches.map(({ change }) => change), ["stays", "stays"]);
  for (const body of [lower, upper]) body.setGravity([0, 0, 30]);
  let ended = false;
  for (let i = 0; i < 400 && !ended; ++i) {
    world.step();
    ended = world.touches.some(({ obstacle, change }) => obstacle === floor && change === "ends");
  }
  assert.ok(ended && above(lower, ground) > -0.01);
  world.free();
  all.free();
  model.free();
});

test("a ray through a world meets the first triangle of all bodies", async () => {
  const model = await files.load(join(process.env.EXMAT_PACKS, "falling.exmat"), { timeStep: 0.005, useContact: true });
  const world = new files.World(), bodies = [0, 1, 2].map(() => world.add(new model.Body())), surface = model.surface("object");
  bodies.forEach((body, i) => { body.motion = { position: [0.3 * i, 0.2 * i, 4 * i], orientation: [Math.cos(i), 0, Math.sin(i), 0] }; });
  const { triangles, points } = surface, places = bodies.map((body) => body.readPositions(points));
  const corner = (body, i) => Array.from(places[body].subarray(3 * triangles[i], 3 * triangles[i] + 3));
  const minus = (a, b) => a.map((x, i) => x - b[i]), dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
  let hits = 0;
  for (let i = 0; i < 40; ++i) {
    const target = corner(i % 3, (7 * i) % triangles.length).map((x) => x + 0.01 * Math.sin(5 * i + x));
    const origin = [6 * Math.sin(i), 6 * Math.cos(i), 4 + 8 * Math.sin(3 * i)], way = minus(target, origin), length = Math.hypot(...way);
    let nearest = Infinity, meets = -1;
    for (let body = 0; body < 3; ++body)
      for (let f = 0; f < triangles.length; f += 3) {
        // The plane of the triangle gives the point, the sides of its edges whether it is inside.
        const [a, b, c] = [0, 1, 2].map((k) => corner(body, f + k)), normal = cross(minus(b, a), minus(c, a));
        const distance = dot(minus(a, origin), normal) / dot(way, normal) * length;
        const at = origin.map((x, k) => x + way[k] / length * distance);
        const inside = [[a, b], [b, c], [c, a]].every(([from, to]) => dot(cross(minus(to, from), minus(at, from)), normal) >= 0);
        if (inside && distance >= 0 && distance < nearest) [nearest, meets] = [distance, body];
      }
    const hit = world.castRay([surface], origin, way);
    assert.equal(hit === null, meets < 0);
    if (hit === null) continue;
    ++hits;
    assert.equal(hit.body, bodies[meets]);
    assert.equal(hit.surface, surface);
    assert.ok(Math.abs(hit.distance - nearest) < 1e-5 * nearest, "positions are of single precision here");
    const picked = surface.pointsOn([hit.triangle], hit.shares);
    assert.ok(near(hit.body.readPositions(picked), origin.map((x, k) => x + way[k] / length * hit.distance), 1e-5));
    assert.ok(Math.abs(Math.hypot(...hit.normal) - 1) < 1e-12);
    assert.equal(world.castRay([surface], origin, way, { within: 0.99 * nearest }), null);
    picked.free();
  }
  assert.ok(hits > 15);
  assert.equal(world.castRay([], [0, 0, 9], [0, 0, -1]), null);
  const ball = world.addObstacle({ shape: "sphere", point: [50, 0, 0], radius: 2 });
  const hit = world.castRay([surface], [50, 0, 9], [0, 0, -1]);
  assert.deepEqual([hit.body, hit.obstacle], [null, ball]);
  assert.ok(near([hit.distance, ...hit.normal], [7, 0, 0, 1], 1e-12));
  assert.throws(() => world.castRay([surface], [0, 0, 9], [0, 0, 0]), files.InvalidArgument);
  assert.throws(() => world.castRay([surface], [0, 9], [0, 0, 1]), files.InvalidArgument);
  world.free();
  surface.free();
  model.free();
});

test("bones carry the body: a translated skeleton translates every vertex", async () => {
  const model = await files.load(join(process.env.EXMAT_PACKS, "character.exmat"), { timeStep: 0.01, massDamping: 1 });
  assert.equal(model.bones.filter(({ parent }) => parent === -1).length, 1);
  assert.deepEqual(model.animations.map(({ name }) => name).sort(), ["walk", "wave"]);
  const body = new model.Body(), points = model.allVertices(), rest = body.readPositions(points), bound = model.boundBones();
  body.setBones(bound.map((x, i) => x + (i % 12 === 3 ? 2 : 0)), { teleport: true });
  body.step();
  assert.ok(near(body.readPositions(points), rest.map((x, i) => x + (i % 3 === 0 ? 2 : 0)), 1e-4));
  const { duration } = model.animations[0];
  assert.deepEqual(model.animatedBones(0, duration), model.animatedBones(0, duration + 1));
  body.setBones(model.animatedBones(0, 0), { teleport: true });
  body.step();
  assert.ok(near(body.bones, model.animatedBones(0, 0), 1e-9));
  assert.throws(() => body.setBones([1, 2]), files.InvalidArgument);
  model.free();
});

test("a hand at rest: its force's work is the elastic energy of a small displacement", async () => {
  const model = await files.load(pack, { timeStep: 0.005, stiffnessDamping: 0.02, massDamping: 2, space: "auto" });
  for (const space of ["reduced", "full"]) {
    const body = new model.Body(), surface = model.surface(), { rest } = surface.points;
    body.space = space;
    let far = 0;
    for (let i = 0; i < surface.points.length; ++i) if (rest[3 * i] > rest[3 * far]) far = i;
    const corner = surface.triangles.indexOf(far), shares = [0, 1, 2].map((c) => Number(corner % 3 === c));
    const hand = new files.Hand(body, surface, Math.floor(corner / 3), shares), begun = hand.point;
    hand.target = [begun[0], begun[1], begun[2] + 0.01];
    for (let i = 0; i < 3000; ++i) {
      body.clearForces();
      hand.pull();
      body.step();
    }
    assert.equal(body.space, space);
    const work = hand.force.reduce((sum, f, i) => sum + 0.5 * f * (hand.point[i] - begun[i]), 0);
    assert.ok(work > 0 && Math.abs(body.energies.elastic / work - 1) < 0.05, `${space}: ${body.energies.elastic} and ${work}`);
    hand.free();
    body.step(3000);
    assert.ok(near(body.readPositions(surface.points), Float32Array.from(rest), 1e-4));
    surface.free();
    body.free();
  }
  model.free();
});
