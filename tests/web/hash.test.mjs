// State hashes in WebAssembly are those of the native portable build, which the program EXMAT_PACK_HASH prints.
// EXMAT_PACKS is the folder of bar.exmat and falling.exmat; EXMAT_STEPS the steps of each run.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";
import { load } from "exmat";

const packs = process.env.EXMAT_PACKS;
const steps = Number(process.env.EXMAT_STEPS ?? 10000), parts = 10;
const cases = [
  { name: "clamped, with examples", pack: "bar.exmat",
    settings: { gravityZ: -1, massDamping: 0.2, stiffnessDamping: 0.01, useExamples: 1, exampleStiffness: 4000, exampleDamping: 10, exampleBias: 0.2 } },
  { name: "free", pack: "falling.exmat", settings: { gravityZ: -9.81, stiffnessDamping: 0.005 } },
  { name: "clamped, on a floor, with examples", pack: "bar.exmat", floor: -0.1,
    settings: { gravityZ: -9.81, stiffnessDamping: 0.005, useContact: 1, useExamples: 1, exampleStiffness: 1000, exampleDamping: 10, exampleBias: 0.6 } },
  // A body that turns takes sin and cos of the C library, which is another one: equal until it touches the floor.
  { name: "free, above a floor, with examples", pack: "falling.exmat", floor: -1, steps: 400,
    settings: { gravityZ: -9.81, stiffnessDamping: 0.005, useContact: 1, useExamples: 1, exampleStiffness: 1000, exampleDamping: 10, exampleBias: 0.6 } },
  { name: "all vertices", pack: "bar.exmat", steps: 200, settings: { gravityZ: -1, massDamping: 0.2, stiffnessDamping: 0.01, space: 1 } },
];

const snakeCase = (name) => name.replace(/[A-Z]/g, (letter) => "_" + letter.toLowerCase());

for (const { name, pack, floor, settings, steps: own } of cases)
  test(`${name}: as native to the last bit`, async () => {
    const every = (own ?? steps) / parts;
    const words = Object.entries(settings).map(([member, value]) => `${snakeCase(member)}=${value}`);
    const native = execFileSync(process.env.EXMAT_PACK_HASH, [join(packs, pack), every, parts, ...words, ...(floor === undefined ? [] : [`floor=${floor}`])],
                                { env: { ...process.env, EXMAT_SIMD: "portable" }, encoding: "utf8" }).trim().split("\n");
    const { gravityZ, space, ...others } = settings;
    const model = await load(join(packs, pack), { gravity: [0, 0, gravityZ], ...(space === 1 ? { space: "full" } : {}), ...others });
    const body = new model.Body();
    if (floor !== undefined) body.addObstacle({ point: [0, 0, floor], stiffness: 1e7, damping: 2e4, friction: 0.5 });
    const ours = native.map(() => body.step(every).hash);
    assert.deepEqual(ours, native);
    body.free();
    model.free();
  });
