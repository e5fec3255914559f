// The .glb that `exmat-runtime export` writes of a character is drawn by three.js where the run had it: its bones, its skin and the flesh
// on top. EXMAT_PACKS is the folder of character.glb and of character.pc2, the positions of the same run.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const read = (name) => {
  const bytes = readFileSync(join(process.env.EXMAT_PACKS, name));
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};

test("a skin and the flesh on it are where the run had them", async () => {
  const gltf = await new GLTFLoader().parseAsync(read("character.glb"), "");
  const meshes = [];
  gltf.scene.traverse((node) => node.isSkinnedMesh && meshes.push(node));
  assert.equal(meshes.length, 1);
  const [mesh] = meshes, cache = read("character.pc2"), points = new DataView(cache).getInt32(16, true);
  assert.equal(mesh.geometry.attributes.position.count, points);
  assert.equal(mesh.skeleton.bones.length, 13);
  const size = new THREE.Box3().setFromBufferAttribute(mesh.geometry.attributes.position).getSize(new THREE.Vector3()).length();
  const mixer = new THREE.AnimationMixer(gltf.scene);
  mixer.clipAction(gltf.animations[0]).play();
  const { times } = gltf.animations[0].tracks[0], place = new THREE.Vector3(), expected = new THREE.Vector3();
  let farthest = 0, way = 0;
  for (let frame = 0; frame < times.length; frame += 9) {
    mixer.setTime(times[frame]);
    gltf.scene.updateMatrixWorld(true);
    mesh.skeleton.update();
    const run = new Float32Array(cache, 32 + 12 * points * frame, 3 * points);
    for (let k = 0; k < points; ++k) {
      mesh.getVertexPosition(k, place).applyMatrix4(mesh.matrixWorld);
      farthest = Math.max(farthest, place.distanceTo(expected.fromArray(run, 3 * k)));
      way = Math.max(way, expected.distanceTo(place.fromArray(new Float32Array(cache, 32, 3 * points), 3 * k)));
    }
  }
  assert.ok(farthest < 1e-5 * size, `${farthest} m of ${size} m`);
  assert.ok(way > 0.1 * size, "it moves");
});
