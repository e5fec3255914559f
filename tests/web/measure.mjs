// Sizes and speeds of the package, as docs/web.md has them: tests/web/run first, then
//   node build/web/tests/measure.mjs [FOLDER_OF_PROGRAMS]
// Microseconds are those of a body: medians over the first 1,500 steps of the page's scenes, in Node and by exmat-runtime, which reads the same files.
import { execFileSync } from "node:child_process";
import { readFileSync, readdirSync, unlinkSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url)), programs = resolve(process.argv[2] ?? join(here, "../../release/bin"));
const scenes = join(here, "page/scenes"), STEPS = 1500;
const median = (values) => values.sort((a, b) => a - b)[Math.floor(values.length / 2)];

if (process.argv[2] === "--one") {
  const [, , , name, space, plain] = process.argv;
  if (plain === "plain") WebAssembly.validate = () => false;
  const { worldOf, step } = await import("./page/scene.js");
  const begun = performance.now(), scene = JSON.parse(readFileSync(join(scenes, `${name}.json`)));
  const current = await worldOf(scene, (file) => new Uint8Array(readFileSync(join(scenes, file))));
  if (current.models[0].model.bones.length === 0) for (const body of current.world.bodies) body.space = space;
  step(current, { pull() {} });
  const first = performance.now() - begun, times = [];
  for (let i = 1; i < STEPS; ++i) {
    const start = performance.now();
    step(current, { pull() {} });
    times.push(1000 * (performance.now() - start));
  }
  console.log(JSON.stringify({ first, us: median(times) / current.world.bodies.length }));
} else {
  const installed = join(here, "node_modules/exmat");
  console.log("| file | bytes | gzip -9 | brotli |\n| --- | ---: | ---: | ---: |");
  for (const file of ["exmat.wasm", "exmat_plain.wasm", "runtime.js", "three.js", "bytes.js"]) {
    const bytes = readFileSync(join(installed, file));
    console.log(`| ${file} | ${bytes.length} | ${gzipSync(bytes, { level: 9 }).length} | ${brotliCompressSync(bytes).length} |`);
  }
  const ours = (...words) => JSON.parse(execFileSync(process.execPath, [fileURLToPath(import.meta.url), "--one", ...words], { encoding: "utf8" }));
  const native = (name, space, simd) => {
    const scene = { ...JSON.parse(readFileSync(join(scenes, `${name}.json`))), space, steps: STEPS }, file = join(scenes, `native_${name}.json`);
    writeFileSync(file, JSON.stringify(scene));
    const told = execFileSync(join(programs, "exmat-runtime"), ["run", file, "--threads", "1", "--log-level", "error", "--progress", "none"], { env: { ...process.env, EXMAT_SIMD: simd }, encoding: "utf8" });
    unlinkSync(file);
    return Number(/median step time +([\d.]+) us/.exec(told)[1]);
  };
  const simds = ["portable", "avx2"];
  console.log(`\n| scene | space | first step [ms] | simd128 [us] | plain [us] | native ${simds.join(" [us] | native ")} [us] |\n| --- | --- | ---: | ---: | ---: | ---: | ---: |`);
  for (const name of readdirSync(scenes).filter((file) => file.endsWith(".json")).map((file) => file.slice(0, -5)))
    for (const space of { character: ["full"], pile: ["reduced"] }[name] ?? ["reduced", "full"]) {
      const [simd, plain] = ["simd", "plain"].map((module) => ours(name, space, module)), others = simds.map((kind) => native(name, space, kind));
      console.log(`| ${name} | ${space} | ${simd.first.toFixed(0)} | ${[simd.us, plain.us, ...others].map((us) => us.toFixed(0)).join(" | ")} |`);
    }
}
