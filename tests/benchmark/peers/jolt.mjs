// Jolt's soft bodies: points, edges and volumes held by position-based constraints.
import Jolt from "jolt-physics";
import { FRAME, FRICTION, GRAVITY, MATERIAL, edges, placed, volume } from "./blocks.mjs";

const jolt = await Jolt();
const LAYER = 0;

/**
 * Springs of the edges and volumes that are as stiff as the material if edges have all directions alike: energy
 * E V e^2 / 2 of an edge with a sixth of the tets about it, V in all six times; its bulk modulus is 2 E / 3, the rest of
 * the material's is the volumes'.
 */
function settingsOf(mesh, clamped, velocities) {
  const settings = new jolt.SoftBodySharedSettings(), { youngs, poisson } = MATERIAL, held = new Set(clamped ? mesh.clamped : []);
  for (let v = 0; v < mesh.vertices; ++v) {
    const vertex = new jolt.SoftBodySharedSettingsVertex();
    for (const [k, axis] of ["x", "y", "z"].entries()) {
      vertex.mPosition[axis] = mesh.points[3 * v + k];
      vertex.mVelocity[axis] = velocities[3 * v + k];
    }
    vertex.mInvMass = held.has(v) ? 0 : 1 / mesh.masses[v];
    settings.mVertices.push_back(vertex);
    jolt.destroy(vertex);
  }
  for (const corners of mesh.triangles) {
    const face = new jolt.SoftBodySharedSettingsFace(...corners, 0);
    settings.AddFace(face);
    jolt.destroy(face);
  }
  for (const { ends, length, volume } of edges(mesh)) {
    const edge = new jolt.SoftBodySharedSettingsEdge(...ends, length ** 2 / (youngs * volume));
    settings.mEdgeConstraints.push_back(edge);
    jolt.destroy(edge);
  }
  const bulk = youngs / (3 * (1 - 2 * poisson)) - (2 / 3) * youngs;
  for (const tet of mesh.tets) {
    const constraint = new jolt.SoftBodySharedSettingsVolume(...tet, (36 * volume(mesh.points, tet)) / bulk);  // which it takes of six times the volume
    settings.mVolumeConstraints.push_back(constraint);
    jolt.destroy(constraint);
  }
  settings.CalculateEdgeLengths();
  settings.CalculateVolumeConstraintVolumes();
  settings.Optimize();
  return settings;
}

function create(iterations, steps, { mesh, scene }) {
  const wanted = new jolt.JoltSettings(), pairs = new jolt.ObjectLayerPairFilterTable(1), phases = new jolt.BroadPhaseLayerInterfaceTable(1, 1), phase = new jolt.BroadPhaseLayer(0);
  pairs.EnableCollision(LAYER, LAYER);
  phases.MapObjectToBroadPhaseLayer(LAYER, phase);
  wanted.mObjectLayerPairFilter = pairs;
  wanted.mBroadPhaseLayerInterface = phases;
  wanted.mObjectVsBroadPhaseLayerFilter = new jolt.ObjectVsBroadPhaseLayerFilterTable(phases, 1, pairs, 1);
  const world = new jolt.JoltInterface(wanted), system = world.GetPhysicsSystem(), bodies = system.GetBodyInterface();
  jolt.destroy(wanted);
  system.SetGravity(new jolt.Vec3(0, 0, scene.weightless ? 0 : GRAVITY));
  if (scene.planes) {  // the floor
    const box = new jolt.BoxShape(new jolt.Vec3(50, 50, 0.5), 0.05);
    const floor = bodies.CreateBody(new jolt.BodyCreationSettings(box, new jolt.RVec3(0, 0, -0.5), new jolt.Quat(0, 0, 0, 1), jolt.EMotionType_Static, LAYER));
    floor.SetFriction(FRICTION);
    bodies.AddBody(floor.GetID(), jolt.EActivation_DontActivate);
  }
  const made = scene.bodies.map((pose) => {
    const { places, velocities } = placed(mesh, pose);
    const own = settingsOf({ ...mesh, points: places }, scene.clamped, velocities);
    const creation = new jolt.SoftBodyCreationSettings(own, new jolt.RVec3(0, 0, 0), new jolt.Quat(0, 0, 0, 1), LAYER);
    Object.assign(creation, { mNumIterations: iterations, mLinearDamping: scene.damping ?? 0, mFriction: FRICTION, mAllowSleeping: false, mUpdatePosition: !scene.clamped });
    const body = bodies.CreateSoftBody(creation);
    bodies.AddBody(body.GetID(), jolt.EActivation_Activate);
    jolt.destroy(creation);
    return body;
  });
  const places = new Float64Array(3 * mesh.vertices);
  return {
    frame: () => world.Step(FRAME, steps),
    positions(i) {
      const centre = made[i].GetCenterOfMassPosition(), motion = jolt.castObject(made[i].GetMotionProperties(), jolt.SoftBodyMotionProperties);
      for (let v = 0; v < mesh.vertices; ++v) {
        const place = motion.GetVertex(v).mPosition;
        places.set([place.GetX() + centre.GetX(), place.GetY() + centre.GetY(), place.GetZ() + centre.GetZ()], 3 * v);
      }
      return places;
    },
    free: () => jolt.destroy(world),
  };
}

export const engines = [[5, 1], [5, 4], [20, 4]].map(([iterations, steps]) => ({
  name: `Jolt, ${steps === 1 ? "a step" : `${steps} steps`} of ${iterations} iterations`, apart: true, most: iterations === 5 ? Infinity : 1, create: (what) => create(iterations, steps, what) }));
