// Bodies in three.js: meshes that follow them, and hands that drag them.
import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh, MeshStandardMaterial, Plane, Raycaster, Vector2, Vector3 } from "three";
import { Hand } from "./runtime.js";

/** The drawn surface of a body. Bodies of one model may share a surface. */
export class BodyMesh extends Mesh {
  #ownSurface;
  constructor(body, { surface, material = new MeshStandardMaterial() } = {}) {
    super(new BufferGeometry(), material);
    this.body = body;
    this.surface = surface ?? body.model.surface();
    this.#ownSurface = surface === undefined;
    this.geometry.setIndex(new BufferAttribute(this.surface.triangles, 1));
    const positions = new BufferAttribute(new Float32Array(3 * this.surface.points.length), 3);
    this.geometry.setAttribute("position", positions.setUsage(DynamicDrawUsage));
    this.frustumCulled = false;  // the bounds of the geometry are computed for picking alone
    this.update();
  }
  /** Takes positions and normals from the body: before each frame. */
  update() {
    const { position } = this.geometry.attributes;
    this.body.readPositions(this.surface.points, position.array);
    position.needsUpdate = true;
    if (!this.material.flatShading) this.geometry.computeVertexNormals();
  }
  raycast(raycaster, hits) {
    this.geometry.computeBoundingSphere();
    super.raycast(raycaster, hits);
  }
  dispose() {
    this.geometry.dispose();
    if (this.#ownSurface) this.surface.free();
  }
}

/** Drags meshes of bodies by mouse, pen and fingers. A pointer that hits none is left to other listeners. */
export class Dragger {
  #holds = new Map();
  #raycaster = new Raycaster();
  #listeners = {
    pointerdown: (event) => {
      const hit = this.pick(this.#pointer(event));
      if (hit === undefined) return;
      this.hold(event.pointerId, hit);
      this.element.setPointerCapture(event.pointerId);
      event.stopImmediatePropagation();
    },
    pointermove: (event) => this.move(event.pointerId, this.#pointer(event)),
    pointerup: (event) => this.release(event.pointerId),
    pointercancel: (event) => this.release(event.pointerId),
  };
  /** `meshes`: an array of BodyMesh, which may change. */
  constructor(element, camera, meshes) {
    this.element = element;
    this.camera = camera;
    this.meshes = meshes;
    element.style.touchAction = "none";
    for (const [name, listener] of Object.entries(this.#listeners)) element.addEventListener(name, listener, true);
  }
  #pointer(event) {
    const { left, top, width, height } = this.element.getBoundingClientRect();
    return new Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
  }
  #ray(pointer) {
    this.camera.updateMatrixWorld();
    this.#raycaster.setFromCamera(pointer, this.camera);
    return this.#raycaster;
  }
  /** The hands that hold something. */
  get hands() { return [...this.#holds.values()].map(({ hand }) => hand); }
  hand(id) { return this.#holds.get(id)?.hand; }
  /** The intersection of a pointer, in [-1, 1] across the element, with the nearest of the meshes; undefined where there is none. */
  pick(pointer) { return this.#ray(pointer).intersectObjects(this.meshes, false)[0]; }
  /** Has a hand of this id hold a place of a mesh; it moves in the plane that faces the camera there. */
  hold(id, { object, faceIndex, barycoord, point }) {
    this.release(id);
    const hand = new Hand(object.body, object.surface, faceIndex, barycoord.toArray());
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Vector3()), point);
    this.#holds.set(id, { hand, plane });
    return hand;
  }
  move(id, pointer) {
    const hold = this.#holds.get(id);
    const target = hold && this.#ray(pointer).ray.intersectPlane(hold.plane, new Vector3());
    if (target) hold.hand.target = target.toArray();
  }
  release(id) {
    this.#holds.get(id)?.hand.free();
    this.#holds.delete(id);
  }
  /** Pulls at what is held: before each step. */
  pull() {
    const { hands } = this;
    for (const { body } of hands) body.clearForces();
    for (const hand of hands) hand.pull();
  }
  releaseAll() {
    for (const id of [...this.#holds.keys()]) this.release(id);
  }
  dispose() {
    this.releaseAll();
    for (const [name, listener] of Object.entries(this.#listeners)) this.element.removeEventListener(name, listener, true);
  }
}
