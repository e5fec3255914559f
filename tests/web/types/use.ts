// Compiled by tsc alone: what is right compiles, and each line below @ts-expect-error does not.
import { Batch, Body, Hand, InvalidArgument, Model, Points, RayHit, Surface, World, load } from "exmat";
import { load as loadInside } from "exmat/compat";
import { BodyMesh, Dragger } from "exmat/three";
import { PerspectiveCamera } from "three";

export async function use(element: HTMLElement): Promise<number> {
  const hero: Model = await load("hero.exmat", { gravity: [0, -9.81, 0], useExamples: true, space: "auto", integrator: "bdf2" });
  const inside: Model = await loadInside(new Uint8Array(8));
  const body: Body = new hero.Body();
  const world = new World({ friction: 0.5, self: true });
  world.add(body).step(16).motion = { linearVelocity: [1, 0, 0] };
  const id: number = body.attach([1, 2], new Float64Array(12), { kind: "spring", stiffness: 1e3 });
  const tie: number = body.attachTo([1], body, [2], { kind: "ball", breakForce: 10 + id });
  body.detach(tie);
  const push: number = body.addForces(hero.points([1]), [0, 0, 1]);
  body.setForces(push, hero.points([1]), new Float64Array(3));
  body.removeForces(push);
  const { force, broken }: { force: number[]; broken: boolean } = body.attachmentLoad(id);
  body.setBones(hero.animatedBones(0, 0.5), { teleport: !broken });
  const surface: Surface = hero.surface("render"), hand = new Hand(body, surface, 0, [1, 0, 0]);
  hand.target = force;
  const hit: RayHit | null = world.castRay([surface], [0, 0, 9], [0, 0, -1], { within: 20 });
  if (hit !== null) hand.target = hit.normal;
  for (const touch of world.touches) if (touch.change === "begins" && touch.other !== null) touch.other.reset();
  const mesh = new BodyMesh(body, { surface }), camera = new PerspectiveCamera();
  const dragger = new Dragger(element, camera, [mesh]);
  dragger.pull();
  mesh.update();
  const batch: Batch = new hero.Batch(8), all: Float64Array = batch.displacements;
  // @ts-expect-error there is no such space
  await load("hero.exmat", { space: "half" });
  // @ts-expect-error there is no such setting
  await load("hero.exmat", { colour: 1 });
  // @ts-expect-error a view, which is not set
  body.displacement = new Float64Array(3);
  // @ts-expect-error there is no such kind
  body.attach([1], [], { kind: "glue" });
  // @ts-expect-error touches have words
  world.touches.filter(({ change }) => change === 0);
  // @ts-expect-error points are made by models
  new Points();
  // @ts-expect-error a mesh is of a body
  new BodyMesh(hero);
  const name: string = inside.exampleName(0) + hero.bones[0].name, error: Error = new InvalidArgument(name);
  return all.length + error.message.length;
}
