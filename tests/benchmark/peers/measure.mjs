// Times and errors of all engines over all scenes, in turns: tables between the marks of a page. `run` calls it:
//   measure.mjs FOLDER_OF_PROGRAMS FOLDER PAGE
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { cpus } from "node:os";
import { SCENES, block } from "./blocks.mjs";
import * as exmat from "./exmat.mjs";
import * as jolt from "./jolt.mjs";
import * as mujoco from "./mujoco.mjs";
import * as rapier from "./rapier.mjs";

const page = process.argv[4], ENGINES = [...exmat.natives, ...exmat.engines, ...jolt.engines, ...rapier.engines, ...mujoco.engines];
const BLOCKS = [{ cells: [4, 2, 2], scenes: Object.keys(SCENES) }, { cells: [8, 3, 3], scenes: Object.keys(SCENES).filter((name) => !/apart|50|100/.test(name)) }];
const FINE = block(16, 8, 8), ROUNDS = 3;

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
const point = (xyz, i) => [...xyz.slice(3 * i, 3 * i + 3)];
const middle = (xyz, points) => [0, 1, 2].map((k) => mean(points.map((i) => xyz[3 * i + k])));
const TIP = middle(FINE.points, FINE.tip);

/** Rotation that brings `from` [3n] nearest to `to`, by Newton's iteration for the polar factor, rows. */
function rotation(from, to) {
  const n = from.length / 3, centre = (xyz) => [0, 1, 2].map((k) => mean([...Array(n).keys()].map((i) => xyz[3 * i + k])));
  const a = centre(from), b = centre(to);
  let m = [0, 1, 2].map((row) => [0, 1, 2].map((column) => mean([...Array(n).keys()].map((i) => (to[3 * i + row] - b[row]) * (from[3 * i + column] - a[column])))));
  for (let iteration = 0; iteration < 50; ++iteration) {
    const cofactors = [0, 1, 2].map((r) => [0, 1, 2].map((c) => m[(r + 1) % 3][(c + 1) % 3] * m[(r + 2) % 3][(c + 2) % 3] - m[(r + 1) % 3][(c + 2) % 3] * m[(r + 2) % 3][(c + 1) % 3]));
    const determinant = m[0].reduce((sum, value, c) => sum + value * cofactors[0][c], 0);
    m = m.map((row, r) => row.map((value, c) => (value + cofactors[r][c] / determinant) / 2));
  }
  return m;
}
/** Angle between two rotations [degrees]. */
const angle = (a, b) => (180 / Math.PI) * Math.acos(Math.min(1, (a.flat().reduce((sum, value, i) => sum + value * b.flat()[i], 0) - 1) / 2));

/** The processor's seconds of each frame, where a single body's vertices are after each, and the mean height of all at the end. */
async function run(engine, what) {
  if (engine.run) return engine.run(what);
  const world = await engine.create(what), { bodies, frames } = what.scene, seconds = [], ways = [];
  for (let frame = 0; frame < frames; ++frame) {
    const start = process.cpuUsage();
    world.frame();
    const { user, system } = process.cpuUsage(start);
    seconds.push(1e-6 * (user + system));
    if (bodies.length === 1) ways.push([...world.positions(0)]);
  }
  const height = mean(bodies.map((_, i) => mean([...world.positions(i)].filter((_, k) => k % 3 === 2))));
  world.free();
  return { seconds, ways, height };
}

/** Microseconds of a body in a frame. */
const micros = (seconds, [first, last], { bodies }) => (1e6 * mean(seconds.slice(first, last))) / bodies.length;

/** The tip's way in the truth, which has the points of the surface alone. */
function tipOf(frames) {
  const first = frames[0], indices = [...Array(first.length / 3).keys()];
  const tip = FINE.tip.map((v) => indices.find((i) => distance(point(first, i), point(FINE.points, v)) < 1e-6));
  return frames.map((frame) => middle(frame, tip));
}
const truths = (mesh, formulation) => ({ swing: tipOf(exmat.truth(mesh, { ...SCENES.swing, frames: 60 }, formulation)), sag: tipOf(exmat.truth(mesh, SCENES.sag, formulation)) });
const sagOf = (tips) => tips.at(-1)[2] - TIP[2];
const percent = (value) => `${value > 0 ? "+" : ""}${value.toFixed(Math.abs(value) < 10 ? 1 : 0)}`;
/** Distance of a tip's way from the true one over the true one's from rest, RMS [%]. */
const offWay = (tips, real) => 100 * Math.sqrt(mean(tips.map((tip, i) => distance(tip, real[i + 1]) ** 2)) / mean(tips.map((tip, i) => distance(real[i + 1], TIP) ** 2)));

const fine = truths(FINE, "smoothed"), flight = exmat.truth(FINE, SCENES.flight, "smoothed"), turn = rotation(flight[0], flight.at(-1));

async function errors(engine, mesh) {
  const same = truths(mesh, engine.name.startsWith("exmat") ? "smoothed" : "linear"), tips = {};
  for (const [name, scene] of [["swing", { ...SCENES.swing, frames: 60 }], ["sag", SCENES.sag]]) tips[name] = (await run(engine, { mesh, scene })).ways.map((xyz) => middle(xyz, mesh.tip));
  const turned = rotation(mesh.points, (await run(engine, { mesh, scene: SCENES.flight })).ways.at(-1));
  const off = (kind, real) => kind === "sag" ? percent(100 * (sagOf(tips.sag) / sagOf(real.sag) - 1)) : offWay(tips.swing, real.swing).toFixed(1);
  return [...["sag", "swing"].map((kind) => `${off(kind, fine)} (${off(kind, same)})`), angle(turned, turn).toFixed(1)];
}

function number(value) {
  return value >= 1000 ? Math.round(value).toLocaleString("en-US") : value.toPrecision(value < 100 ? 2 : 3);
}

const table = (header, rows) => [header, header.map(() => "---"), ...rows].map((row) => `| ${row.join(" | ")} |`).join("\n");
const version = (name) => JSON.parse(readFileSync(new URL(`node_modules/${name}/package.json`, import.meta.url))).version;
const title = (name) => ({ floor: "alone on a floor", apart: "200 on a floor" })[name] ?? `${name.replace("pile", "pile of")}: falling, at rest`;
const wrapped = (text) => text.replace(/(?![^\n]{1,120}$)([^\n]{1,120})\s/g, "$1\n");
const millimetres = (sag) => `${(-1000 * sag).toFixed(0)} mm`;

/** Puts what there is into the page. */
function write(measured) {
  const parts = [wrapped(`${cpus()[0].model}, Node ${process.versions.node}; Jolt ${version("jolt-physics")}, Rapier ${version("@dimforge/rapier3d-compat")}, MuJoCo ${version("@mujoco/mujoco")}. ` +
                 `The fine mesh has ${FINE.tets.length.toLocaleString("en-US")} tets. Its tip sags by ${millimetres(sagOf(fine.sag))}, and it turns by ${angle(turn, rotation(flight[0], flight[0])).toFixed(0)} degrees in the second.`)];
  for (const { mesh, scenes, rows } of measured) {
    const columns = scenes.filter((name) => SCENES[name].timed && name !== "swing");
    const cell = ({ engine, found }, name) => found[name]?.map(number).join(", ") ?? (SCENES[name].rest && engine.apart ? "none" : "");
    parts.push(table([`${mesh.tets.length} tets`, "clamped, swinging", "sag off [%]", "swing off [%]", "turn off [degrees]", ...columns.map(title)],
                     rows.map((row) => [row.engine.name, cell(row, "swing"), ...row.off, ...columns.map((name) => cell(row, name))])));
    const [linear, smoothed] = ["linear", "smoothed"].map((formulation) => millimetres(sagOf(truths(mesh, formulation).sag)));
    const heights = rows.filter(({ height }) => height).map(({ engine, height }) => `${height.toFixed(2)} m (${engine.name})`);
    parts.push(wrapped(`In full space this mesh sags by ${linear} with tets of constant strain and by ${smoothed} with exmat's smoothed ones.` +
               (heights.length > 0 ? ` Mean height of a pile of 20 at the end: ${heights.join(", ")}.` : "")));
  }
  const [begin, end] = ["<!-- peers: begin -->", "<!-- peers: end -->"], text = readFileSync(page, "utf8");
  writeFileSync(page, `${text.slice(0, text.indexOf(begin) + begin.length)}\n${parts.join("\n\n")}\n${text.slice(text.indexOf(end))}`);
}

const measured = [];
for (const { cells, scenes } of BLOCKS) {
  const mesh = block(...cells), rows = [];
  for (const engine of ENGINES) rows.push({ engine, off: await errors(engine, mesh), found: {} });
  measured.push({ mesh, scenes, rows });
  for (const name of scenes.filter((name) => SCENES[name].timed)) {
    const scene = SCENES[name];
    for (let round = 0; round < (scene.bodies.length === 1 ? ROUNDS : 1); ++round)
      for (const row of rows) {
        const { engine, found } = row;
        if ((scene.rest && engine.apart) || scene.bodies.length > engine.most) continue;
        const { seconds, height } = await run(engine, { mesh, scene });
        const own = [scene.timed, scene.rest].filter(Boolean).map((frames) => micros(seconds, frames, scene));
        found[name] = found[name] ? own.map((time, i) => Math.min(time, found[name][i])) : own;
        if (name === "pile 20") row.height = height;
        console.error(mesh.tets.length, name, engine.name, own.map(number).join(" "), height);
      }
    write(measured);
  }
}
