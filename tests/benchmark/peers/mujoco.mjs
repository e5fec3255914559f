// MuJoCo's flexes.
import load from "@mujoco/mujoco";
import { FRAME, FRICTION, GRAVITY, MATERIAL, placed } from "./blocks.mjs";

const mujoco = await load();

function create(integrator, steps, { mesh, scene }) {
  const bodies = scene.bodies.map((pose) => placed(mesh, pose));
  const flexes = bodies.map(({ places }, i) => `
    <flexcomp name="body${i}" type="direct" dim="3" mass="1" radius="0.001" point="${places.join(" ")}" element="${mesh.tets.flat().join(" ")}">
      <elasticity young="${MATERIAL.youngs}" poisson="${MATERIAL.poisson}" />
      <contact selfcollide="none" internal="false" friction="${FRICTION}" ${scene.planes ? "" : `contype="0" conaffinity="0"`} />
      ${scene.clamped ? `<pin id="${mesh.clamped.join(" ")}" />` : ""}
    </flexcomp>`);
  const planes = (scene.planes ?? []).map(({ point, normal }) => `<geom type="plane" size="50 50 1" pos="${point.join(" ")}" zaxis="${normal.join(" ")}" friction="${FRICTION}" />`);
  const model = mujoco.MjModel.from_xml_string(`<mujoco>
    <option timestep="${FRAME / steps}" gravity="0 0 ${scene.weightless ? 0 : GRAVITY}" integrator="${integrator}" />
    <size memory="1500M" />
    <worldbody>${planes.join("")}${flexes.join("")}</worldbody>
  </mujoco>`);
  const data = new mujoco.MjData(model), owners = model.flex_vertbodyid, masses = model.body_mass, damping = model.dof_damping, firsts = model.body_dofadr;
  for (const [i, { velocities }] of bodies.entries())
    for (let v = 0; v < mesh.vertices; ++v) {
      const owner = owners[i * mesh.vertices + v];
      if (owner === 0) continue;  // pinned
      masses[owner] = mesh.masses[v];
      for (let k = 0; k < 3; ++k) {
        damping[firsts[owner] + k] = (scene.damping ?? 0) * mesh.masses[v];
        data.qvel[firsts[owner] + k] = velocities[3 * v + k];
      }
    }
  const start = data.qvel.slice();
  mujoco.mj_setConst(model, data);
  data.qvel.set(start);
  return {
    frame() {
      for (let i = 0; i < steps; ++i) mujoco.mj_step(model, data);
    },
    positions: (i) => data.flexvert_xpos.slice(3 * i * mesh.vertices, 3 * (i + 1) * mesh.vertices),
    free() {
      data.delete();
      model.delete();
    },
  };
}

export const engines = [["discrete", 1], ["discrete", 4], ["Euler", 16]].map(([integrator, steps]) => ({
  name: `MuJoCo, ${integrator}, ${steps === 1 ? "a step" : `${steps} steps`}`, most: steps === 1 ? Infinity : 1, create: (what) => create(integrator, steps, what) }));
