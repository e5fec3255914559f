// Rapier's soft bodies.
import RAPIER from "@dimforge/rapier3d-compat";
import { FRAME, FRICTION, GRAVITY, MATERIAL, placed } from "./blocks.mjs";

await RAPIER.init();

function create(solver, substeps, { mesh, scene }) {
  const world = new RAPIER.World({ x: 0, y: 0, z: scene.weightless ? 0 : GRAVITY });
  world.timestep = FRAME;
  world.numSolverIterations = substeps;
  for (const { point, normal } of scene.planes ?? []) {  // boxes behind them
    const box = RAPIER.ColliderDesc.cuboid(...normal.map((x) => (x === 0 ? 50 : 0.5))).setTranslation(...point.map((x, k) => x - 0.5 * normal[k]));
    world.createCollider(box.setFriction(FRICTION));
  }
  const material = new RAPIER.SoftBodyMaterial();
  Object.assign(material, { youngModulus: MATERIAL.youngs, poissonRatio: MATERIAL.poisson, elasticDampingRatio: 0 });
  const bodies = scene.bodies.map((pose) => {
    const { places, velocities } = placed(mesh, pose);
    const desc = new RAPIER.SoftBodyDesc(Float32Array.from(places)).setCells(mesh.tets.flat()).setSurface(mesh.triangles.flat())
      .setMasses(Float32Array.from(mesh.masses)).setMaterial(material).setCellModel(RAPIER.SoftBodyCellModel.Corotational).setSolver(solver)
      .setLinearDamping(scene.damping ?? 0).setCanSleep(false);
    if (scene.planes) desc.setSurfaceCollider(RAPIER.ColliderDesc.ball(0.05).setFriction(FRICTION));
    else desc.setNoSurfaceCollider();
    if (scene.clamped) desc.setPinnedParticles(mesh.clamped);
    const body = world.createSoftBody(desc);
    if (pose.spin) for (let v = 0; v < mesh.vertices; ++v) body.setParticleVelocity(v, { x: velocities[3 * v], y: velocities[3 * v + 1], z: velocities[3 * v + 2] });
    return body;
  });
  return { frame: () => world.step(), positions: (i) => bodies[i].particlePositions(), free: () => world.free() };
}

const { Constraints, Fem } = RAPIER.SoftBodySolver;
export const engines = [["constraints", Constraints], ["finite elements", Fem]].flatMap(([kind, solver]) =>
  [4, 16].map((substeps) => ({ name: `Rapier, ${kind}, ${substeps} substeps`, most: substeps === 4 ? Infinity : 1, create: (what) => create(solver, substeps, what) })));
