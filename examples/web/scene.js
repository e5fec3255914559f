// Scenes: the files of exmat-runtime and its viewer, as far as a page has what they name.
import { Body, InvalidArgument, World, init, load } from "exmat";

const KNOWN = {
  scene: ["bundle", "bodies", "contact", "time_step", "gravity", "integrator", "space", "space_release", "internal_force", "precision",
          "damping", "newton", "sleep", "examples", "body", "obstacles", "steps", "output"],
  body: ["name", "bundle", "gravity", "space", "space_release", "internal_force", "examples", "body", "poses"],
  placement: ["position", "orientation", "linear_velocity", "angular_velocity", "animation"],
  examples: ["stiffness", "damping", "bias", "weights", "target", "target_iterations", "energy_reference"],
};

const camelCase = (name) => name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase());
const renamed = (members) => Object.fromEntries(Object.entries(members).map(([name, value]) => [camelCase(name), value]));
const given = (members) => Object.fromEntries(Object.entries(members).filter(([, value]) => value !== undefined));

function settingsOf(scene, own, touches) {
  const { examples, damping = {}, newton = {}, sleep = {} } = { ...scene, ...own };
  const { time_step, gravity, integrator, space, space_release, internal_force, precision } = { ...scene, ...own };
  return given({
    timeStep: time_step, gravity, integrator, space: space === "full" ? "full" : "auto", spaceRelease: space_release,
    internalForce: internal_force, precision, massDamping: damping.mass, stiffnessDamping: damping.stiffness,
    newtonTolerance: newton.tolerance, newtonIterations: newton.max_iterations, sleepEnergy: sleep.energy, sleepTime: sleep.time,
    useExamples: examples !== undefined, exampleStiffness: examples?.stiffness, exampleDamping: examples?.damping,
    exampleBias: examples?.bias, exampleTarget: examples?.target, targetIterations: examples?.target_iterations,
    energyReference: examples?.energy_reference, useContact: touches,
  });
}

function obstacleOf({ plane, sphere, box, capsule, stiffness, damping, friction, group, mask }) {
  const shape = plane ? { shape: "plane", point: plane.point, direction: plane.normal }
    : sphere ? { shape: "sphere", point: sphere.center, radius: sphere.radius }
    : box ? { shape: "box", point: box.center, halfExtents: box.half_extents, orientation: box.orientation }
    : { shape: "capsule", point: capsule.start, radius: capsule.radius, direction: capsule.end.map((x, i) => x - (capsule.start ?? [0, 0, 0])[i]) };
  return given({ ...shape, stiffness, damping, friction, group, mask });
}

/** Rows "x y z  w x y z"; what follows # is a comment. */
function posesOf(text) {
  const rows = text.split("\n").map((line) => line.replace(/#.*/, "").trim()).filter((line) => line !== "");
  return rows.map((row) => row.split(/\s+/).map(Number)).map((row) => ({ position: row.slice(0, 3), orientation: row.slice(3) }));
}

function animationOf(model, { name }) {
  const number = model.animations.findIndex((animation) => animation.name === name);
  if (number === -1) throw new InvalidArgument(`animation = "${name}": expected one of ${model.animations.map((animation) => animation.name).join(", ")}`);
  return number;
}

/**
 * A world of a scene. `read(name)` gives the Response or the bytes of a file beside the scene. What the scene has and
 * a page has not is in `ignored`.
 */
export async function worldOf(scene, read) {
  await init();
  const ignored = [];
  const check = (what, members) => ignored.push(...Object.keys(members ?? {}).filter((name) => !KNOWN[what].includes(name)));
  check("scene", scene);
  const kinds = scene.bodies ?? [{}], alone = scene.bodies === undefined;
  const obstacles = (scene.obstacles ?? []).filter((obstacle) => !obstacle.mesh && !obstacle.height_field);
  if (obstacles.length < (scene.obstacles ?? []).length) ignored.push("obstacles of files");
  const touches = obstacles.length > 0 || !alone;
  const world = new World(touches ? renamed(scene.contact ?? {}) : { apart: true });
  const models = [];
  try {
    for (const obstacle of obstacles) world.addObstacle(obstacleOf(obstacle));
    for (const own of kinds) {
      check("body", own);
      const examples = own.examples ?? scene.examples, placement = own.body ?? scene.body ?? {};
      check("placement", placement);
      check("examples", examples);
      const model = await load(await read(own.bundle ?? scene.bundle), settingsOf(scene, { ...own, examples }, touches));
      const space = own.space ?? scene.space ?? "reduced";
      const { animation, ...motion } = renamed(placement);
      models.push({ model, name: own.name ?? (own.bundle ?? scene.bundle ?? "").replace(/\.\w+$/, ""), examples, space });
      const poses = own.poses === undefined ? [motion] : posesOf(await new Response(await bytes(await read(own.poses))).text());
      for (const pose of poses) {
        const body = world.add(new Body(model));
        if (Object.keys(pose).length > 0) body.motion = pose;
        if (model.bones.length === 0) body.space = space;
        if (Array.isArray(examples?.weights)) body.setExampleWeights(examples.weights);
      }
      if (animation) models.at(-1).animation = { speed: 1, loop: true, start: 0, ...animation, number: animationOf(model, animation) };
    }
  } catch (error) {
    free({ world, models });
    throw error;
  }
  return { world, models, obstacles: obstacles.map(obstacleOf), timeStep: models[0].model.timeStep, gravity: scene.gravity ?? [0, 0, 0], ignored };
}

/** Takes one step; bones go along their animations, hands pull. */
export function step({ world, models, timeStep }, dragger) {
  for (const { model, animation } of models) {
    if (animation === undefined) continue;
    const { duration } = model.animations[animation.number], time = animation.start + animation.speed * (world.time + timeStep);
    const bones = model.animatedBones(animation.number, animation.loop && duration > 0 ? time % duration : time);
    for (const body of world.bodies) if (body.model === model) body.setBones(bones);
  }
  dragger.pull();
  world.step();
}

const bytes = async (source) => (source instanceof Response ? source.arrayBuffer() : source);

export function free({ world, models }) {
  world.free();
  for (const { model } of models) model.free();
}

/** The scene of a pack by itself: a floor below a free body, y up as in glTF. */
export async function sceneOf(name, read) {
  const pack = new Uint8Array(await bytes(await read(name)));
  let touches = true, model;
  try {
    model = await load(pack, { useContact: true });
  } catch (error) {
    if (error instanceof InvalidArgument) throw error;
    touches = false;
    model = await load(pack);
  }
  const surface = model.surface("object"), { rest } = surface.points, isFree = model.mass > 0;
  let least = Infinity, most = -Infinity;
  for (let i = 1; i < rest.length; i += 3) [least, most] = [Math.min(least, rest[i]), Math.max(most, rest[i])];
  const examples = await load(pack, { useExamples: true }).catch(() => null);
  const scene = { bundle: name, time_step: 0.004, gravity: [0, -9.81, 0], space: "auto", damping: { mass: 0.5, stiffness: 0.005 } };
  if (examples !== null && examples.examples > 0) scene.examples = { stiffness: 2000, damping: 2 };
  if (isFree && touches) scene.obstacles = [{ plane: { point: [0, least - 0.3 * (most - least), 0], normal: [0, 1, 0] }, stiffness: 1e7, damping: 3e4, friction: 0.5 }];
  examples?.free();
  surface.free();
  model.free();
  return scene;
}
