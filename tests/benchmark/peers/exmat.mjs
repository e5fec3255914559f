// exmat: its package of WebAssembly in this process, its native library beside it, and its full space as the truth.
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { FRAME, FRICTION, GRAVITY, MATERIAL } from "./blocks.mjs";
import { free, worldOf } from "./scene.js";

const [programs, folder] = process.argv.slice(2);
const run = (program, ...words) => execFileSync(join(programs, program), words, { encoding: "utf8", stdio: ["ignore", "pipe", "inherit"], maxBuffer: 2 ** 28 });

/** Gmsh's file of a mesh. */
function msh({ points, tets, vertices }) {
  const nodes = [...Array(vertices).keys()].map((v) => `${v + 1} ${points.slice(3 * v, 3 * v + 3).join(" ")}`);
  const elements = tets.map((tet, i) => `${i + 1} 4 2 0 0 ${tet.map((v) => v + 1).join(" ")}`);
  return `$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n${vertices}\n${nodes.join("\n")}\n$EndNodes\n$Elements\n${tets.length}\n${elements.join("\n")}\n$EndElements\n`;
}

/** The bundle of a block, which is made where it is missing. Those that only the truth is made of are not trained. */
function bundle(mesh, clamped, formulation, trained) {
  const name = `${clamped ? "clamped" : "free"}_${mesh.tets.length}_${formulation}`, bundle = join(folder, `${name}.h5`);
  if (existsSync(bundle)) return bundle;
  mkdirSync(folder, { recursive: true });
  writeFileSync(join(folder, `${mesh.tets.length}.msh`), msh(mesh));
  const asset = {
    name, object: {
      mesh: `${mesh.tets.length}.msh`, formulation, ...(clamped ? { fixed: { ids: mesh.clamped } } : {}),
      material: { youngs_modulus: MATERIAL.youngs, poisson_ratio: MATERIAL.poisson, density: MATERIAL.density },
    },
    basis: trained ? { size: 20, loads: { gravity: [0, 0, GRAVITY], ...(clamped ? {} : { speed: 4 }) } } : { size: 12, training: "none" },
  };
  writeFileSync(join(folder, `${name}.json`), JSON.stringify(asset));
  run("exmat-precompute", "bundle", join(folder, `${name}.json`), "-o", bundle, "--progress", "none", "--log-level", "error");
  run("exmat-runtime", "pack", bundle, "-o", bundle.replace(".h5", ".exmat"));
  return bundle;
}

const LAW = { stiffness: 1e7, damping: 3e4 };

function sceneOf(scene, bundle, space, steps) {
  const { bodies } = scene, alone = bodies.length === 1;
  if (!alone) writeFileSync(join(folder, "poses.txt"), bodies.map(({ position, orientation = [1, 0, 0, 0] }) => [...position, ...orientation].join(" ")).join("\n"));
  return {
    ...(alone ? { bundle, body: bodyOf(bodies[0]) } : { bodies: [{ name: "block", bundle, poses: "poses.txt" }], contact: { ...LAW, friction: FRICTION } }),
    ...(scene.planes ? { obstacles: scene.planes.map((plane) => ({ plane, ...LAW, friction: FRICTION })) } : {}),
    time_step: FRAME / steps, steps: steps * scene.frames, gravity: [0, 0, scene.weightless ? 0 : GRAVITY], space, damping: { mass: scene.damping ?? 0 },
  };
}
const bodyOf = ({ position, spin }) => ({ ...(position ? { position } : {}), ...(spin ? { angular_velocity: spin } : {}) });

async function create(space, steps, { mesh, scene }) {
  const file = bundle(mesh, scene.clamped, "smoothed", true).replace(".h5", ".exmat");
  const current = await worldOf(sceneOf(scene, file, space, steps), (name) => new Uint8Array(readFileSync(name.endsWith(".txt") ? join(folder, name) : name)));
  const { world, models: [{ model }] } = current, points = model.allVertices(), xyz = new Float32Array(3 * mesh.vertices);
  return { frame: () => world.step(steps), positions: (i) => world.bodies[i].readPositions(points, xyz), free: () => free(current) };
}

const OURS = [["reduced", 4], ["reduced", 1], ["full", 4]];
const named = (space, steps) => `${space === "full" ? "all vertices" : "r = 20"}, ${steps === 1 ? "a step" : `${steps} steps`}`;
export const engines = OURS.map(([space, steps]) => ({ name: `exmat, ${named(space, steps)}`, create: (what) => create(space, steps, what) }));

/** The same by the native library. */
export const natives = OURS.map(([space, steps]) => ({
  name: `exmat native, ${named(space, steps)}`,
  run({ mesh, scene }) {
    const file = join(folder, "native.json");
    writeFileSync(file, JSON.stringify(sceneOf(scene, bundle(mesh, scene.clamped, "smoothed", true), space, steps)));
    return JSON.parse(run("exmat-peers-benchmark", file, String(scene.frames), String(steps)));
  },
}));

/** Frames of a scene in full space, of points of the surface, by steps of 1/480 s: a point cache. */
export function truth(mesh, scene, formulation) {
  const name = join(folder, `truth_${mesh.tets.length}_${formulation}_${scene.damping ?? 0}_${scene.weightless ?? ""}`), steps = 8;
  if (!existsSync(`${name}.pc2`)) {
    const own = { ...sceneOf(scene, bundle(mesh, scene.clamped, formulation, false), "full", steps), output: { every: steps }, newton: { tolerance: 1e-8 } };
    writeFileSync(`${name}.json`, JSON.stringify(own));
    run("exmat-precompute", "full-space", `${name}.json`, "-o", `${name}.h5`, "--progress", "none", "--log-level", "error");
    run("exmat-runtime", "export", `${name}.h5`, "-o", `${name}.pc2`, "--mesh");
  }
  const file = readFileSync(`${name}.pc2`), points = file.readInt32LE(16), frames = file.readInt32LE(28);
  const numbers = new Float32Array(file.buffer.slice(file.byteOffset + 32, file.byteOffset + 32 + 12 * points * frames));
  return [...Array(frames).keys()].map((i) => numbers.subarray(3 * points * i, 3 * points * (i + 1)));
}
