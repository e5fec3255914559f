import type { BufferGeometry, Camera, Intersection, Material, Mesh, Vector2 } from "three";
import type { Body, Hand, Surface } from "./index.js";

/** The drawn surface of a body, in the body's world. */
export class BodyMesh extends Mesh<BufferGeometry, Material> {
  /** `surface`: one that bodies of a model share; else one of its own. Of a material with flat shading no normals are computed. */
  constructor(body: Body, options?: { surface?: Surface; material?: Material });
  readonly body: Body;
  readonly surface: Surface;
  /** Takes positions and normals from the body: before each frame. */
  update(): void;
  /** Frees the geometry and a surface of its own; not the material, not the body. */
  dispose(): void;
}

/** Drags meshes of bodies by mouse, pen and fingers. A pointer that hits none is left to other listeners. */
export class Dragger {
  /** `meshes` may change. */
  constructor(element: HTMLElement, camera: Camera, meshes: BodyMesh[]);
  readonly element: HTMLElement;
  camera: Camera;
  meshes: BodyMesh[];
  readonly hands: Hand[];
  /** The one of this id: of a pointer, or of hold(). */
  hand(id: number | string): Hand | undefined;
  /** Of a pointer in [-1, 1] across the element, with the nearest mesh. */
  pick(pointer: Vector2): Intersection<BodyMesh> | undefined;
  /** A hand of this id holds a place; it moves in the plane that faces the camera there. */
  hold(id: number | string, place: Intersection<BodyMesh>): Hand;
  move(id: number | string, pointer: Vector2): void;
  release(id: number | string): void;
  releaseAll(): void;
  /** Pulls at what is held: before each step. */
  pull(): void;
  dispose(): void;
}
