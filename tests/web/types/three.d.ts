// As much of the types of three.js as those of exmat/three name: three itself has none.
declare module "three" {
  export class Vector2 { constructor(x?: number, y?: number); }
  export class Camera { readonly isCamera: true; }
  export class PerspectiveCamera extends Camera {}
  export class BufferGeometry { readonly isBufferGeometry: true; }
  export class Material { readonly isMaterial: true; }
  export class Mesh<G, M> { geometry: G; material: M; }
  export interface Intersection<T> { object: T; }
}
