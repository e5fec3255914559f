// The block that all engines have, and what is done with it.

/** A block [0, 1] x [0, 1/4] x [0, 1/4] m in cells of six tets. Vertices at x = 0 are what is clamped, the corners at x = 1 the tip. */
export function block(nx, ny, nz) {
  const points = [], tets = [], at = (i, j, k) => (i * (ny + 1) + j) * (nz + 1) + k;
  for (let i = 0; i <= nx; ++i) for (let j = 0; j <= ny; ++j) for (let k = 0; k <= nz; ++k) points.push(i / nx, j / ny / 4, k / nz / 4);
  for (let i = 0; i < nx; ++i) for (let j = 0; j < ny; ++j) for (let k = 0; k < nz; ++k)
    for (const axes of [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]]) {  // a path of edges from corner to corner
      const corner = [i, j, k], tet = [at(i, j, k)];
      for (const axis of axes) {
        ++corner[axis];
        tet.push(at(...corner));
      }
      if (axes[1] !== (axes[0] + 1) % 3) [tet[2], tet[3]] = [tet[3], tet[2]];
      tets.push(tet);
    }
  const mesh = { points: Float64Array.from(points), tets, vertices: points.length / 3, clamped: [...Array((ny + 1) * (nz + 1)).keys()] };
  return { ...mesh, tip: [at(nx, 0, 0), at(nx, 0, nz), at(nx, ny, 0), at(nx, ny, nz)], masses: masses(mesh), triangles: boundary(tets) };
}

export const MATERIAL = { youngs: 1e6, poisson: 0.3, density: 1000 }, FRICTION = 0.5, GRAVITY = -9.81, FRAME = 1 / 60;

export function volume(points, [a, b, c, d]) {
  const u = [b, c, d].map((v) => [0, 1, 2].map((x) => points[3 * v + x] - points[3 * a + x]));
  return (u[0][0] * (u[1][1] * u[2][2] - u[1][2] * u[2][1]) + u[0][1] * (u[1][2] * u[2][0] - u[1][0] * u[2][2]) + u[0][2] * (u[1][0] * u[2][1] - u[1][1] * u[2][0])) / 6;
}

/** A quarter of each tet at each of its vertices [kg]. */
function masses({ points, tets, vertices }) {
  const result = new Float64Array(vertices);
  for (const tet of tets) for (const v of tet) result[v] += (MATERIAL.density * volume(points, tet)) / 4;
  return result;
}

/** Triangles of one tet alone, outward. */
function boundary(tets) {
  const faces = new Map();
  for (const [a, b, c, d] of tets)
    for (const face of [[a, c, b], [a, b, d], [a, d, c], [b, c, d]]) {
      const key = face.toSorted((x, y) => x - y).join();
      if (!faces.delete(key)) faces.set(key, face);
    }
  return [...faces.values()];
}

/** Each edge once, with the volume of the tets about it [m^3]. */
export function edges({ points, tets }) {
  const found = new Map();
  for (const tet of tets)
    for (let i = 0; i < 4; ++i) for (let j = 0; j < i; ++j) {
      const ends = [tet[i], tet[j]].sort((x, y) => x - y), key = ends.join();
      if (!found.has(key)) found.set(key, { ends, volume: 0, length: Math.hypot(...[0, 1, 2].map((x) => points[3 * ends[0] + x] - points[3 * ends[1] + x])) });
      found.get(key).volume += volume(points, tet);
    }
  return [...found.values()];
}

export const CENTRE = [0.5, 0.125, 0.125];

export function turned([w, x, y, z], v) {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
}

/** Vertices of a body in the world, [3n], and their velocities. `position` is the way of its centre from where it was meshed. */
export function placed({ points }, { position = [0, 0, 0], orientation = [1, 0, 0, 0], spin = [0, 0, 0] }) {
  const places = new Float64Array(points.length), velocities = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    const r = turned(orientation, [points[i] - CENTRE[0], points[i + 1] - CENTRE[1], points[i + 2] - CENTRE[2]]);
    for (let x = 0; x < 3; ++x) places[i + x] = r[x] + CENTRE[x] + position[x];
    velocities.set([spin[1] * r[2] - spin[2] * r[1], spin[2] * r[0] - spin[0] * r[2], spin[0] * r[1] - spin[1] * r[0]], i);
  }
  return { places, velocities };
}

/** Numbers in [0, 1), the same in each run. */
function numbers(seed) {
  return () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
  };
}

/** `count` bodies that fall on each other, turned at random: four in a layer. */
function heap(count) {
  const random = numbers(7), bodies = [];
  for (let i = 0; i < count; ++i) {
    const layer = i >> 2, q = [0, 0, 0, 0].map(() => random() + random() + random() - 1.5), length = Math.hypot(...q);
    bodies.push({ position: [1.2 * (i & 1) + 0.1 * random(), 1.2 * ((i >> 1) & 1) + 0.1 * random(), 0.6 + 1.15 * layer], orientation: q.map((x) => x / length) });
  }
  return bodies;
}

/** Planes about a pile. */
const WALLS = [[[-0.2, 0, 0], [1, 0, 0]], [[2.6, 0, 0], [-1, 0, 0]], [[0, -0.6, 0], [0, 1, 0]], [[0, 2.1, 0], [0, -1, 0]]].map(([point, normal]) => ({ point, normal }));
const FLOOR = [{ point: [0, 0, 0], normal: [0, 0, 1] }];

const grid = (count) => [...Array(count).keys()].map((i) => ({ position: [1.5 * (i % 20), 0.75 * Math.floor(i / 20), 0] }));

/** What is stepped: bodies, planes that they touch, for how many frames, and the frames that are timed. */
export const SCENES = {
  swing: { bodies: [{}], clamped: true, frames: 180, timed: [60, 180] },
  flight: { bodies: [{ spin: [1, 3, 2] }], frames: 60, weightless: true },
  sag: { bodies: [{}], clamped: true, frames: 360, damping: 4 },
  floor: { bodies: grid(1), planes: FLOOR, damping: 4, frames: 180, timed: [60, 180] },
  apart: { bodies: grid(200), planes: FLOOR, damping: 4, frames: 90, timed: [60, 90] },
  ...Object.fromEntries([20, 50, 100].map((count) => [`pile ${count}`, { bodies: heap(count), planes: [...FLOOR, ...WALLS], damping: 0.5, frames: 240, timed: [0, 120], rest: [210, 240] }])),
};
