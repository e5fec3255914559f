/** Base of all errors of the library. */
export class ExmatError extends Error {}
/** An argument that the caller got wrong. */
export class InvalidArgument extends ExmatError {}
/** A pack that is damaged, or lacks what the settings ask for. */
export class BadInput extends ExmatError {}
/** A step that met NaN or infinity: the bodies are as they were before it. */
export class NonFinite extends ExmatError {}

/** Numbers, as an array of any kind. */
export type Numbers = ArrayLike<number>;

/** Members of a scene that belong to a model, with the same defaults and ranges. */
export interface Settings {
  /** > 0 [s]; 0.001 */
  timeStep?: number;
  /** [m/s^2]; 0 0 0 */
  gravity?: Numbers;
  /** alpha >= 0 [1/s]; 0 */
  massDamping?: number;
  /** beta >= 0 [s]; 0 */
  stiffnessDamping?: number;
  newtonTolerance?: number;
  newtonIterations?: number;
  integrator?: "bdf2" | "backward_euler" | "newmark";
  internalForce?: "auto" | "cubature" | "polynomial";
  /** True: the example force acts; false. */
  useExamples?: boolean | number;
  /** kappa >= 0 [1/s^2]; 0 */
  exampleStiffness?: number;
  /** c_kappa >= 0 [1/s]; 0 */
  exampleDamping?: number;
  /** Factor in [0, 1] on the weight of the rest pose; 1 */
  exampleBias?: number;
  exampleTarget?: "auto" | "table" | "solve";
  targetIterations?: number;
  energyReference?: "example" | "rest";
  /** True: bodies can touch obstacles and each other; false. */
  useContact?: boolean | number;
  sleepEnergy?: number;
  sleepTime?: number;
  precision?: "double" | "mixed";
  space?: "reduced" | "full" | "auto";
  spaceRelease?: number;
}

export interface Obstacle {
  shape?: "plane" | "sphere" | "box" | "capsule";
  /** Of the plane; centre of sphere and box; where the capsule's axis begins [m] */
  point?: Numbers;
  /** Away from the solid of a plane; along the capsule's axis [m] */
  direction?: Numbers;
  halfExtents?: Numbers;
  /** Quaternion, w first */
  orientation?: Numbers;
  radius?: number;
  /** Pressure per depth [N/m^3] */
  stiffness?: number;
  damping?: number;
  /** Coulomb's coefficient */
  friction?: number;
  group?: number;
  mask?: number;
}

/** Law of contact between bodies. */
export interface ContactLaw {
  stiffness?: number;
  damping?: number;
  friction?: number;
  /** True: a body also touches itself. */
  self?: boolean | number;
  /** True: bodies touch obstacles alone. */
  apart?: boolean | number;
  release?: number;
}

/** Rigid motion of a free body; what is left out stays. */
export interface Motion {
  /** [m] */
  position: Numbers;
  /** Quaternion, w first */
  orientation: Numbers;
  /** [m/s] */
  linearVelocity: Numbers;
  /** [rad/s] */
  angularVelocity: Numbers;
}

/** [J] */
export interface Energies {
  kinetic: number;
  elastic: number;
  potential: number;
  contact: number;
}

/** How an attachment holds its vertices. */
export interface Attachment {
  /** Each vertex, their mean, or their mean by a spring; "fixed" */
  kind?: "fixed" | "ball" | "spring";
  /** Of a spring, > 0 [N/m]; 1e4 */
  stiffness?: number;
  /** Of a spring, >= 0 [N s/m]; 0 */
  damping?: number;
  /** Beyond which it holds no longer, > 0 [N]; Infinity */
  breakForce?: number;
}

/** Load of the body on the frame of an attachment. */
export interface AttachmentLoad {
  /** [N] */
  force: number[];
  /** About the frame's origin [N m] */
  torque: number[];
  /** True where that was more than the attachment bears. */
  broken: boolean;
}

/** Memory of the module, which free() gives back; `using` calls it where the host has Symbol.dispose. */
interface Owner {
  free(): void;
}

/** k material points of a model's bodies. */
export class Points implements Owner {
  private constructor();
  /** k */
  readonly length: number;
  /** Places at rest [3k] [m], a copy; not of allVertices(). */
  readonly rest: Float64Array;
  free(): void;
}

/** Triangles to draw, and their points. */
export class Surface implements Owner {
  constructor(model: Model, kind?: "auto" | "object" | "render");
  readonly model: Model;
  /** The boundary of the object's tets, or the render mesh. */
  readonly kind: "object" | "render";
  /** Its points, to be read and pushed; they go with the surface. */
  readonly points: Points;
  /** Three of its points of each triangle, outward [3f]. */
  readonly triangles: Uint32Array;
  /** The vertex of the object at each point, of a render mesh the nearest one at rest [k], a copy. */
  readonly vertices: Uint32Array;
  /** One point on each of `triangles` [k], at the corners' `shares` [3k], which add up to 1. */
  pointsOn(triangles: Numbers, shares: Numbers): Points;
  free(): void;
}

/**
 * A damped spring from a place of a body's surface to a target: the hand of the viewer. Before each step:
 * body.clearForces(), then pull().
 */
export class Hand implements Owner {
  /** At the corners' `shares` [3] of a triangle of the surface. */
  constructor(body: Body, surface: Surface, triangle: number, shares: Numbers);
  readonly body: Body;
  /** Where the hand pulls to [3], world [m]. */
  target: number[];
  /** Where the held place was before the last step [3] [m]. */
  readonly point: number[];
  /** On the body in the last step [3] [N]. */
  readonly force: number[];
  pull(): void;
  /** Lets go: clears the forces on the body. */
  free(): void;
}

export class Body implements Owner {
  constructor(model: Model);
  readonly model: Model;
  /** The world that it was added to. */
  readonly world: World | null;
  step(count?: number): this;
  reset(): void;
  /** [s] */
  readonly time: number;
  space: "reduced" | "full" | "auto";
  /** q [r], a view: read it anew after calls that allocate. */
  readonly displacement: Float64Array;
  /** v [r], a view */
  readonly velocity: Float64Array;
  /** w [K], a view; empty without an example force */
  readonly weights: Float64Array;
  readonly energies: Energies;
  get motion(): Motion;
  set motion(motion: Partial<Motion>);
  /** World positions [3k] [m], written to `xyz`. */
  readPositions(points: Points, xyz?: Float32Array): Float32Array;
  /** Adds forces [3k] [N] that stay until they are cleared. */
  applyForces(points: Points, forces: Numbers): void;
  clearForces(): void;
  /** Adds forces [3k] [N] that can be changed and removed while all others stay to the last bit. Returns their id. */
  addForces(points: Points, forces: Numbers): number;
  /** Puts forces [3k] [N] in place of those that had the id. */
  setForces(id: number, points: Points, forces: Numbers): void;
  /** Ends the forces of this id: the body then is as if it had never got them. */
  removeForces(id: number): void;
  restartIntegrator(): void;
  setGravity(gravity: Numbers): void;
  setDamping(mass: number, stiffness: number): void;
  setExampleStiffness(kappa: number, region?: number): void;
  setExampleBias(bias: number, region?: number): void;
  /** Weights [K], none negative, of sum 1; null: those of the shape again. */
  setExampleWeights(weights: Numbers | null, region?: number): void;
  /** All that the body carries from step to step: a snapshot. */
  state: Float64Array;
  /** Hash of the bits of its state, 16 hexadecimal digits. */
  readonly hash: string;
  /** Adds an obstacle to the body's own world; its id. */
  addObstacle(obstacle: Obstacle): number;
  /** Way of the points' mean by 1 N that they share, in one step [m/N]; 0 unless the last step was in all vertices. */
  pointCompliance(points: Points): number;
  /** Bones [12b] at the end of the last step: of each a 3 x 4 matrix by rows, to the world. */
  readonly bones: Float64Array;
  /**
   * Where the bones [12b] are at the end of the next step, and of those after it until the next call. `teleport`: the
   * body is there at once, without a motion that led there.
   */
  setBones(transforms: Numbers, options?: { teleport?: boolean }): void;
  /**
   * Holds vertices of the object by a frame [12] of the host from the next step on; the attachment's id. The model's
   * space is "full" or "auto".
   */
  attach(vertices: Numbers, frame: Numbers, attachment?: Attachment): number;
  /**
   * Holds vertices of the object by those of another body of the same world from the next step on, as they go and turn;
   * the attachment's id. Both bodies step in their modes.
   */
  attachTo(vertices: Numbers, other: Body, otherVertices: Numbers, attachment?: Attachment): number;
  /** Where the frame [12] is at the end of the next step, and of those after it until the next call. */
  moveAttachment(id: number, frame: Numbers): void;
  detach(id: number): void;
  /** In the last step. */
  attachmentLoad(id: number): AttachmentLoad;
  free(): void;
}

/** Two that touched before the last call that stepped their world, or after it. */
export interface Touch {
  body: Body;
  /** Another body, or the same where it touches itself; null of an obstacle. */
  other: Body | null;
  /** Id of an obstacle; null of another body. */
  obstacle: number | null;
  /** "begins": after the call, not before it. */
  change: "begins" | "stays" | "ends";
}

/** A place of a surface of a body that a ray meets. */
export interface BodyHit extends Place {
  body: Body;
  obstacle: null;
  surface: Surface;
  /** Number of the triangle in the surface. */
  triangle: number;
  /** Shares of its corners [3], sum 1, as Surface.pointsOn() and Hand take them. */
  shares: number[];
}

/** A place of an obstacle that a ray enters. */
export interface ObstacleHit extends Place {
  body: null;
  /** Its id. */
  obstacle: number;
}

interface Place {
  /** Distance from the origin of the ray [m]. */
  distance: number;
  /** Unit normal, outward [3]. */
  normal: number[];
}

/** The first place that a ray through a world meets: `hit.body` tells which of the two. */
export type RayHit = BodyHit | ObstacleHit;

/** Bodies that may touch each other, and obstacles. */
export class World implements Owner {
  constructor(law?: ContactLaw);
  readonly bodies: readonly Body[];
  add<T extends Body>(body: T): T;
  addObstacle(obstacle: Obstacle): number;
  removeObstacle(id: number): void;
  /** Touches of the last call that stepped the world, a copy. Those shorter than a call are not told. */
  readonly touches: Touch[];
  /**
   * The first triangle of all bodies, as they are now, that a ray from `origin` [3] [m] along `direction` [3] meets
   * within so many metres, from either side, or the obstacle that it enters before; null: none. Bodies have those of
   * `surfaces` that are of their models.
   */
  castRay(surfaces: readonly Surface[], origin: Numbers, direction: Numbers, options?: { within?: number }): RayHit | null;
  step(count?: number): this;
  reset(): void;
  readonly time: number;
  readonly energies: Energies;
  state: Float64Array;
  readonly hash: string;
  /** Frees its bodies, too. */
  free(): void;
}

/** Bodies of one model that touch obstacles alone, stepped side by side. */
export class Batch extends World {
  constructor(model: Model, count: number);
  readonly length: number;
  /** [length x r], a copy */
  readonly displacements: Float64Array;
}

/** A pack prepared for stepping. */
export interface Model extends Owner {
  /** r */
  readonly modes: number;
  /** n */
  readonly vertices: number;
  /** K; 0 without an example force */
  readonly examples: number;
  /** [s] */
  readonly timeStep: number;
  /** Of a free body [kg]; 0 of one with fixed vertices. */
  readonly mass: number;
  /** b; parents come before their children, -1 is that of a root. */
  readonly bones: readonly { name: string; parent: number }[];
  /** Of the bones; duration [s] */
  readonly animations: readonly { name: string; duration: number }[];
  readonly Body: new () => Body;
  readonly Batch: new (count: number) => Batch;
  allVertices(): Points;
  points(ids: Numbers): Points;
  /** Points of the rest shape [3k] [m]. */
  pointsAt(xyz: Numbers): Points;
  /** Triangles to draw: "auto" is the render mesh where the pack has one. */
  surface(kind?: "auto" | "object" | "render"): Surface;
  /** Bones [12b] where the mesh is at rest, as Body.bones. */
  boundBones(): Float64Array;
  /** Bones [12b] at a time [s] of an animation, which is held at its ends. */
  animatedBones(animation: number, time: number): Float64Array;
  exampleName(example: number, region?: number): string;
  /** Corners [3f] of the triangles of the object's boundary, numbers of vertices. */
  triangles(): Uint32Array;
}

/** Loads a pack: a URL, in Node also a path, or its bytes. */
export function load(source: string | URL | ArrayBuffer | Uint8Array | Response, settings?: Settings): Promise<Model>;
/** Starts the module, which load() does by itself. */
export function init(): Promise<void>;
