// State hashes in WebAssembly are those of the native portable build, which the program EXMAT_PACK_HASH prints.
// The runs are those of scenes.json (tests/ports). EXMAT_PACKS is the folder of their packs; EXMAT_STEPS the steps of each.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { load } from "exmat";

const packs = process.env.EXMAT_PACKS;
const steps = Number(process.env.EXMAT_STEPS ?? 10000), parts = 10;
const scenes = JSON.parse(readFileSync(new URL("scenes.json", import.meta.url)));
const camelCase = (name) => name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase());

for (const { name, pack, floor, settings, steps: own } of scenes)
  test(`${name}: as native to the last bit`, async () => {
    const every = (own ?? steps) / parts, file = join(packs, `${pack}.exmat`);
    const words = Object.entries(settings).map(([member, value]) => `${member}=${value}`);
    const native = execFileSync(process.env.EXMAT_PACK_HASH, [file, every, parts, ...words, ...(floor === undefined ? [] : [`floor=${floor}`])],
                                { encoding: "utf8" }).trim().split("\n");
    const { gravityZ, space, ...others } = Object.fromEntries(Object.entries(settings).map(([member, value]) => [camelCase(member), value]));
    const model = await load(file, { gravity: [0, 0, gravityZ], ...(space === 1 ? { space: "full" } : {}), ...others });
    const body = new model.Body();
    if (floor !== undefined) body.addObstacle({ point: [0, 0, floor], stiffness: 1e7, damping: 2e4, friction: 0.5 });
    const ours = native.map(() => body.step(every).hash);
    assert.deepEqual(ours, native);
    body.free();
    model.free();
  });
