// The library on a WebAssembly module of it. index.js and compat.js say where the bytes of the module come from.

const STATUS_BAD_INPUT = 2, STATUS_INVALID_ARGUMENT = 3, STATUS_NON_FINITE = 4;

/** Base of all errors of the library. */
export class ExmatError extends Error {
  constructor(message) {
    super(message);
    this.name = new.target.name;
  }
}
/** An argument that the caller got wrong. */
export class InvalidArgument extends ExmatError {}
/** A pack that is damaged, or lacks what the settings ask for. */
export class BadInput extends ExmatError {}
/** A step that met NaN or infinity: the bodies are as they were before it. */
export class NonFinite extends ExmatError {}

function errorOf(status, message) {
  const kinds = { [STATUS_INVALID_ARGUMENT]: InvalidArgument, [STATUS_BAD_INPUT]: BadInput, [STATUS_NON_FINITE]: NonFinite };
  return new (kinds[status] ?? ExmatError)(message);
}

const INTEGRATORS = ["bdf2", "backward_euler", "newmark"];
const CHOICES = {
  integrator: INTEGRATORS,
  internalForce: ["auto", "cubature", "polynomial"],
  exampleTarget: ["auto", "table", "solve"],
  energyReference: ["example", "rest"],
  precision: ["double", "mixed"],
  space: ["reduced", "full", "auto"],
};
const SHAPES = ["plane", "sphere", "box", "capsule", "mesh", "heightField"];
const SURFACES = ["auto", "object", "render"];
const ATTACHMENTS = ["fixed", "ball", "spring"];
const TOUCHES = ["begins", "stays", "ends"];

const snakeCase = (name) => name.replace(/[A-Z]/g, (letter) => "_" + letter.toLowerCase());

/** A module that runs: its memory, its functions, the places of members of its structs. */
class Module {
  constructor(instance, holder) {
    this.exports = instance.exports;
    this.memory = instance.exports.memory;
    holder.module = this;
    this.exports._initialize?.();
    this.structs = {};
    for (const line of this.text(this.exports.exmat_web_layouts()).trim().split("\n")) {
      const [struct, member, offset, type, count] = line.split(" ");
      if (member === ".") this.structs[struct] = { bytes: Number(offset), members: {} };
      else this.structs[struct].members[member] = { offset: Number(offset), type, count: Number(count) };
    }
  }

  text(address) {
    const bytes = new Uint8Array(this.memory.buffer);
    return new TextDecoder().decode(bytes.slice(address, bytes.indexOf(0, address)));
  }

  /** Calls a function that returns a status; throws where it is not 0. */
  call(name, ...values) {
    const stack = this.exports.__stack_pointer.value;
    let status;
    try {
      status = this.exports["exmat_" + name](...values);
    } finally {
      this.exports.__stack_pointer.value = stack;  // what throws leaves it where it was
    }
    if (status !== 0) throw errorOf(status, this.text(this.exports.exmat_last_error()));
  }

  /** Calls `use` with the address of `bytes` bytes, which are freed afterwards. */
  borrow(bytes, use) {
    const address = this.exports.malloc(Math.max(bytes, 8));
    if (address === 0) throw new ExmatError("out of memory");
    try {
      return use(address);
    } finally {
      this.exports.free(address);
    }
  }

  /** Calls `use` with the address of a copy of a typed array. */
  lend(array, use) {
    return this.borrow(array.byteLength, (address) => {
      new Uint8Array(this.memory.buffer).set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), address);
      return use(address);
    });
  }

  /** Fills a typed array with what `use` writes at an address. */
  fill(array, use) {
    return this.borrow(array.byteLength, (address) => {
      use(address);
      array.set(new array.constructor(this.memory.buffer, address, array.length));
      return array;
    });
  }

  /** The handle that a function creates. */
  create(name, ...values) {
    return this.borrow(4, (address) => {
      this.call(name, ...values, address);
      return new DataView(this.memory.buffer).getUint32(address, true);
    });
  }

  integer64(name, ...values) {
    return this.borrow(8, (address) => {
      this.call(name, ...values, address);
      return new DataView(this.memory.buffer).getBigInt64(address, true);
    });
  }

  writeMember(struct, address, name, value) {
    const member = this.structs[struct].members[name];
    if (member === undefined || name === "size") throw new InvalidArgument(`${struct}: there is no ${name}`);
    const values = member.count > 1 ? Array.from(value) : [value];
    if (values.length !== member.count || !values.every((number) => typeof number === "number" || typeof number === "boolean"))
      throw new InvalidArgument(`${name} = ${value}: expected ${member.count} number(s)`);
    const view = new DataView(this.memory.buffer, address + member.offset);
    values.forEach((number, i) => {
      if (member.type === "d") view.setFloat64(8 * i, Number(number), true);
      else if (member.type === "i") view.setInt32(4 * i, Number(number), true);
      else view.setUint32(4 * i, Number(number), true);
    });
  }

  readStruct(struct, address) {
    const { members } = this.structs[struct];
    const result = {};
    for (const [name, { offset, type, count }] of Object.entries(members)) {
      if (name === "size") continue;
      const view = new DataView(this.memory.buffer, address + offset);
      const read = { d: (i) => view.getFloat64(8 * i, true), l: (i) => Number(view.getBigInt64(8 * i, true)) }[type] ?? ((i) => view.getInt32(4 * i, true));
      const numbers = Array.from({ length: count }, (_, i) => read(i));
      result[name.replace(/_([a-z])/g, (_, letter) => letter.toUpperCase())] = count > 1 ? numbers : numbers[0];
    }
    return result;
  }

  /** Calls `use` with the address of a struct that has its defaults and these members. */
  struct(name, given, use) {
    const { bytes } = this.structs[name];
    return this.borrow(bytes, (address) => {
      this.call(`${name}_default`, address, bytes);
      for (const [member, value] of Object.entries(given ?? {})) {
        const names = { shape: SHAPES, kind: ATTACHMENTS }[member] ?? CHOICES[member];
        const number = names === undefined ? value : names.indexOf(value);
        if (number === -1 && names !== undefined) throw new InvalidArgument(`${member} = "${value}": expected one of ${names.join(", ")}`);
        this.writeMember(name, address, snakeCase(member), number);
      }
      return use(address);
    });
  }

  /** Reads a struct that a function fills. */
  read(struct, name, ...values) {
    const { bytes, members } = this.structs[struct];
    return this.borrow(bytes, (address) => {
      new DataView(this.memory.buffer).setUint32(address + members.size.offset, bytes, true);
      this.call(name, ...values, address);
      return this.readStruct(struct, address);
    });
  }
}

/** Base of what has memory in the module, which free() gives back. */
class Owner {
  #free;
  constructor(module, handle, free) {
    this.module = module;
    this.handle = handle;
    this.#free = free;
  }
  free() {
    if (this.handle === 0) return;
    this.#free(this.handle);
    this.handle = 0;
  }
}
if (Symbol.dispose !== undefined)
  Object.defineProperty(Owner.prototype, Symbol.dispose, { value() { this.free(); } });

const whole = (value, name) => {
  if (!Number.isInteger(value)) throw new InvalidArgument(`${name} = ${value}: expected a whole number`);
  return BigInt(value);
};
const doubles = (values) => (values instanceof Float64Array ? values : Float64Array.from(values));

export class Points extends Owner {
  constructor(module, handle, free = (freed) => module.exports.exmat_points_destroy(freed)) {
    super(module, handle, free);
    this.length = Number(module.exports.exmat_points_count(handle));
  }
  /** Places of the points at rest [3k] [m]. */
  get rest() {
    return this.module.fill(new Float64Array(3 * this.length), (address) => this.module.call("points_read_rest", this.handle, address, BigInt(3 * this.length)));
  }
}

/** Triangles to draw, and their points. */
export class Surface extends Owner {
  constructor(model, kind = "auto") {
    const { module } = model, number = SURFACES.indexOf(kind);
    if (number === -1) throw new InvalidArgument(`kind = "${kind}": expected one of ${SURFACES.join(", ")}`);
    super(module, module.create("surface_create", model.handle, number), (handle) => module.exports.exmat_surface_destroy(handle));
    this.model = model;
    this.kind = SURFACES[module.exports.exmat_surface_kind(this.handle)];
    this.points = new Points(module, module.exports.exmat_surface_points(this.handle), () => {});
    const count = 3 * Number(module.exports.exmat_surface_triangles(this.handle));
    this.triangles = module.fill(new Uint32Array(count), (address) => module.call("surface_read_triangles", this.handle, address, BigInt(count)));
  }
  /** The vertex of the object at each of the points, of a render mesh the nearest one. */
  get vertices() {
    const count = this.points.length;
    const numbers = this.module.fill(new BigInt64Array(count), (address) => this.module.call("surface_read_vertices", this.handle, address, BigInt(count)));
    return Uint32Array.from(numbers, Number);
  }
  /** One point on each of `triangles` [k], at the corners' `shares` [3k]. */
  pointsOn(triangles, shares) {
    const { module } = this, numbers = BigInt64Array.from(triangles, (id) => whole(id, "triangle")), given = doubles(shares);
    if (given.length !== 3 * numbers.length) throw new InvalidArgument(`shares: expected 3 for each of ${numbers.length} triangles, found ${given.length}`);
    return new Points(module, module.lend(numbers, (ids) => module.lend(given, (address) =>
      module.create("points_create_on_surface", this.handle, ids, address, BigInt(numbers.length)))));
  }
  free() {
    super.free();
    this.points.handle = 0;
  }
}

export class Body extends Owner {
  constructor(model) {
    super(model.module, model.module.create("body_create", model.handle), (handle) => model.module.exports.exmat_body_destroy(handle));
    this.model = model;
    this.world = null;
  }
  #view(name, length) {
    const address = this.module.exports["exmat_body_" + name](this.handle);
    return address === 0 ? new Float64Array(0) : new Float64Array(this.module.memory.buffer, address, length);
  }
  step(count = 1) {
    this.module.call("body_step", this.handle, whole(count, "count"), 0);
    return this;
  }
  reset() { this.module.call("body_reset", this.handle); }
  get time() { return this.module.exports.exmat_body_time(this.handle); }
  get space() { return CHOICES.space[this.module.exports.exmat_body_space(this.handle)]; }
  set space(name) { this.module.call("body_set_space", this.handle, CHOICES.space.indexOf(name)); }
  /** q [r], a view into the module's memory: take it anew after any call that allocates. */
  get displacement() { return this.#view("displacement", this.model.modes); }
  get velocity() { return this.#view("velocity", this.model.modes); }
  get weights() { return this.#view("weights", this.model.examples); }
  get energies() { return this.module.read("energies", "body_read_energies", this.handle); }
  get motion() { return this.module.read("motion", "body_read_motion", this.handle); }
  set motion(given) {
    const { bytes, members } = this.module.structs.motion;
    const all = { ...this.motion, ...given };
    this.module.borrow(bytes, (address) => {
      new DataView(this.module.memory.buffer).setUint32(address + members.size.offset, bytes, true);
      for (const [name, value] of Object.entries(all)) this.module.writeMember("motion", address, snakeCase(name), value);
      this.module.call("body_set_motion", this.handle, address);
    });
  }
  readPositions(points, xyz = new Float32Array(3 * points.length)) {
    return this.module.fill(xyz, (address) => this.module.call("body_read_positions", this.handle, points.handle, address, BigInt(xyz.length)));
  }
  applyForces(points, forces) {
    const numbers = doubles(forces);
    this.module.lend(numbers, (address) => this.module.call("body_apply_forces", this.handle, points.handle, address, BigInt(numbers.length)));
  }
  clearForces() { this.module.call("body_clear_forces", this.handle); }
  /** Adds forces that can be changed and removed while all others stay. Returns their id. */
  addForces(points, forces) {
    const numbers = doubles(forces);
    return this.module.lend(numbers, (address) =>
      Number(this.module.integer64("body_add_forces", this.handle, points.handle, address, BigInt(numbers.length))));
  }
  setForces(id, points, forces) {
    const numbers = doubles(forces);
    this.module.lend(numbers, (address) => this.module.call("body_set_forces", this.handle, whole(id, "id"), points.handle, address, BigInt(numbers.length)));
  }
  removeForces(id) { this.module.call("body_remove_forces", this.handle, whole(id, "id")); }
  restartIntegrator() { this.module.call("body_restart_integrator", this.handle); }
  setGravity(gravity) { this.module.lend(doubles(gravity), (address) => this.module.call("body_set_gravity", this.handle, address)); }
  setDamping(mass, stiffness) { this.module.call("body_set_damping", this.handle, mass, stiffness); }
  setExampleStiffness(kappa, region = -1) { this.module.call("body_set_example_stiffness", this.handle, BigInt(region), kappa); }
  setExampleBias(bias, region = -1) { this.module.call("body_set_example_bias", this.handle, BigInt(region), bias); }
  /** Weights [K] in place of those of the shape; null: those of the shape again. */
  setExampleWeights(weights, region = -1) {
    if (weights === null) return this.module.call("body_set_example_weights", this.handle, BigInt(region), 0, 0n);
    const numbers = doubles(weights);
    return this.module.lend(numbers, (address) => this.module.call("body_set_example_weights", this.handle, BigInt(region), address, BigInt(numbers.length)));
  }
  get state() {
    const count = Number(this.module.exports.exmat_body_state_size(this.handle));
    return this.module.fill(new Float64Array(count), (address) => this.module.call("body_read_state", this.handle, address, BigInt(count)));
  }
  set state(numbers) { this.module.lend(numbers, (address) => this.module.call("body_set_state", this.handle, address, BigInt(numbers.length))); }
  /** Hash of the bits of its state, 16 hexadecimal digits: that of `exmat-runtime run`. */
  get hash() { return hashOf(this.module, [this]); }
  addObstacle(obstacle) { return addObstacle(this.module, this.module.exports.exmat_body_world(this.handle), obstacle); }
  /** Compliance of the points in one step [m/N]; 0 unless the last step was in all vertices. */
  pointCompliance(points) {
    return this.module.fill(new Float64Array(1), (address) => this.module.call("body_read_point_compliance", this.handle, points.handle, address))[0];
  }
  /** Transforms [12b] of all bones at the end of the last step. */
  get bones() { return readBones(this.model, "body_read_bones", this.handle); }
  setBones(transforms, { teleport = false } = {}) {
    const numbers = ofLength(transforms, 12 * this.model.bones.length, "transforms");
    this.module.lend(numbers, (address) => this.module.call("body_set_bones", this.handle, address, BigInt(this.model.bones.length), Number(teleport)));
  }
  /** Holds vertices by a frame [12] of the host from the next step on; the attachment's id. */
  attach(vertices, frame, attachment) {
    const { module } = this, numbers = BigInt64Array.from(vertices, (id) => whole(id, "vertex"));
    return module.lend(numbers, (ids) => module.struct("attachment", attachment, (given) => module.lend(ofLength(frame, 12, "frame"), (place) =>
      Number(module.integer64("body_attach", this.handle, ids, BigInt(numbers.length), given, place)))));
  }
  /** Holds vertices by a patch of another body of the same world from the next step on; the attachment's id. */
  attachTo(vertices, other, otherVertices, attachment) {
    const { module } = this, numbers = BigInt64Array.from(vertices, (id) => whole(id, "vertex"));
    const others = BigInt64Array.from(otherVertices, (id) => whole(id, "vertex of the other body"));
    return module.lend(numbers, (ids) => module.lend(others, (otherIds) => module.struct("attachment", attachment, (given) =>
      Number(module.integer64("body_attach_to", this.handle, ids, BigInt(numbers.length), other.handle, otherIds, BigInt(others.length), given)))));
  }
  moveAttachment(id, frame) {
    this.module.lend(ofLength(frame, 12, "frame"), (address) => this.module.call("body_move_attachment", this.handle, whole(id, "id"), address));
  }
  detach(id) { this.module.call("body_detach", this.handle, whole(id, "id")); }
  /** Force [3] [N] and torque [3] [N m] of the body on the frame in the last step. */
  attachmentLoad(id) {
    return this.module.borrow(56, (address) => {
      this.module.call("body_read_attachment_load", this.handle, whole(id, "id"), address, address + 24, address + 48);
      const numbers = Array.from(new Float64Array(this.module.memory.buffer, address, 6));
      const broken = new DataView(this.module.memory.buffer).getInt32(address + 48, true) === 1;
      return { force: numbers.slice(0, 3), torque: numbers.slice(3), broken };
    });
  }
}

function ofLength(numbers, count, name) {
  if (numbers.length !== count) throw new InvalidArgument(`${name}: expected ${count} numbers, found ${numbers.length}`);
  return doubles(numbers);
}

function readBones(model, name, ...values) {
  const count = 12 * model.bones.length;
  return model.module.fill(new Float64Array(count), (address) => model.module.call(name, ...values, address, BigInt(count)));
}

function hashOf(module, bodies) {
  return module.lend(Uint32Array.from(bodies, (body) => body.handle), (address) => {
    const hash = module.integer64("bodies_hash", address, BigInt(bodies.length));
    return BigInt.asUintN(64, hash).toString(16).padStart(16, "0");
  });
}

function addObstacle(module, world, obstacle) {
  return module.struct("obstacle", obstacle, (address) => Number(module.integer64("world_add_obstacle", world, address)));
}

/** Bodies that may touch each other, and obstacles. */
class WorldOfModule extends Owner {
  #ids = new Map();
  constructor(module, law) {
    super(module, module.struct("contact_law", law, (address) => module.create("world_create", address)),
          (handle) => module.exports.exmat_world_destroy(handle));
    this.bodies = [];
  }
  add(body) {
    this.#ids.set(Number(this.module.integer64("world_add_body", this.handle, body.handle)), body);
    body.world = this;
    this.bodies.push(body);
    return body;
  }
  addObstacle(obstacle) { return addObstacle(this.module, this.handle, obstacle); }
  removeObstacle(id) { this.module.call("world_remove_obstacle", this.handle, BigInt(id)); }
  step(count = 1) {
    this.module.call("world_step", this.handle, whole(count, "count"), 1, 0);
    return this;
  }
  reset() { this.module.call("world_reset", this.handle); }
  /** Those that touched before the last call that stepped the world, or after it, and how that changed. */
  get touches() {
    const count = Number(this.module.exports.exmat_world_touches(this.handle)), { bytes } = this.module.structs.touch;
    return this.module.borrow(count * bytes, (address) => {
      this.module.call("world_read_touches", this.handle, address, BigInt(count), bytes);
      return Array.from({ length: count }, (_, i) => {
        const { body, other, obstacle, change } = this.module.readStruct("touch", address + i * bytes);
        return { body: this.#ids.get(body), other: this.#ids.get(other) ?? null, obstacle: obstacle < 0 ? null : obstacle, change: TOUCHES[change] };
      });
    });
  }
  /** The first triangle of all bodies, by those of `surfaces` that are of their models, or obstacle that a ray meets; null: none. */
  castRay(surfaces, origin, direction, { within = Infinity } = {}) {
    const { module } = this, ray = new Float64Array([...ofLength(origin, 3, "origin"), ...ofLength(direction, 3, "direction")]);
    const { body, surface, triangle, shares, distance, normal, obstacle } = module.lend(Uint32Array.from(surfaces, ({ handle }) => handle), (list) =>
      module.lend(ray, (address) => module.read("ray_hit", "world_cast_ray", this.handle, list, BigInt(surfaces.length), address, address + 24, within)));
    if (body < 0 && obstacle < 0) return null;
    const place = { distance, normal, obstacle: obstacle < 0 ? null : obstacle };
    return body < 0 ? { body: null, ...place } : { body: this.#ids.get(body), surface: surfaces[surface], triangle, shares, ...place };
  }
  get time() { return this.module.exports.exmat_world_time(this.handle); }
  get energies() { return this.module.read("energies", "world_read_energies", this.handle); }
  get state() {
    const count = Number(this.module.exports.exmat_world_state_size(this.handle));
    return this.module.fill(new Float64Array(count), (address) => this.module.call("world_read_state", this.handle, address, BigInt(count)));
  }
  set state(numbers) { this.module.lend(numbers, (address) => this.module.call("world_set_state", this.handle, address, BigInt(numbers.length))); }
  get hash() { return hashOf(this.module, this.bodies); }
  /** Frees the bodies, too. */
  free() {
    super.free();
    for (const body of this.bodies) body.handle = 0;
    this.bodies = [];
  }
}

/** `count` bodies of one model that touch obstacles and not each other, stepped side by side. */
export class Batch extends WorldOfModule {
  constructor(model, count) {
    super(model.module, { apart: 1 });
    for (let i = 0; i < count; ++i) this.add(new Body(model));
  }
  get length() { return this.bodies.length; }
  /** [count x r], a copy. */
  get displacements() {
    const modes = this.bodies[0]?.model.modes ?? 0;
    const all = new Float64Array(this.length * modes);
    this.bodies.forEach((body, i) => all.set(body.displacement, i * modes));
    return all;
  }
}

/** A pack prepared for stepping. */
class ModelOfModule extends Owner {
  constructor(module, pack, settings) {
    const handle = module.lend(pack, (data) =>
      module.struct("settings", settings, (address) => module.create("model_create_from_memory", data, pack.length, address)));
    super(module, handle, (freed) => module.exports.exmat_model_destroy(freed));
    const model = this;
    this.modes = Number(module.exports.exmat_model_modes(handle));
    this.vertices = Number(module.exports.exmat_model_vertices(handle));
    this.examples = Number(module.exports.exmat_model_examples(handle));
    this.timeStep = module.exports.exmat_model_time_step(handle);
    this.Body = class extends Body { constructor() { super(model); } };
    this.Batch = class extends Batch { constructor(count) { super(model, count); } };
    const text = (name, ...values) => module.text(module.exports["exmat_model_" + name](handle, ...values));
    const each = (count, make) => Array.from({ length: Number(count) }, (_, i) => make(BigInt(i)));
    this.bones = each(module.exports.exmat_model_bones(handle), (bone) =>
      ({ name: text("bone_name", bone), parent: Number(module.exports.exmat_model_bone_parent(handle, bone)) }));
    this.animations = each(module.exports.exmat_model_animations(handle), (animation) =>
      ({ name: text("animation_name", animation), duration: module.exports.exmat_model_animation_duration(handle, animation) }));
  }
  /** Mass of a free body [kg]; 0 of one with fixed vertices. By the kinetic energy at 1 m/s. */
  get mass() {
    if (this.#mass === null) {
      const body = new Body(this);
      try {
        body.motion = { linearVelocity: [1, 0, 0] };
        this.#mass = 2 * body.energies.kinetic;
      } catch (error) {
        if (!(error instanceof InvalidArgument)) throw error;
        this.#mass = 0;
      }
      body.free();
    }
    return this.#mass;
  }
  #mass = null;
  #points(name, ...values) { return new Points(this.module, this.module.create(name, this.handle, ...values)); }
  allVertices() { return this.#points("points_create_all_vertices"); }
  points(ids) {
    const numbers = BigInt64Array.from(ids, (id) => whole(id, "id"));
    return this.module.lend(numbers, (address) => this.#points("points_create_vertices", address, BigInt(numbers.length)));
  }
  pointsAt(xyz) {
    const numbers = doubles(xyz);
    return this.module.lend(numbers, (address) => this.#points("points_create_at", address, BigInt(numbers.length)));
  }
  surface(kind) { return new Surface(this, kind); }
  /** Transforms [12b] of all bones where the mesh is at rest. */
  boundBones() { return readBones(this, "model_read_bones", this.handle); }
  /** Transforms [12b] of all bones at a time [s] of an animation, which is held at its ends. */
  animatedBones(animation, time) { return readBones(this, "model_read_animation", this.handle, whole(animation, "animation"), time); }
  exampleName(example, region = -1) {
    return this.module.text(this.module.exports.exmat_model_example_name(this.handle, BigInt(region), BigInt(example)));
  }
  /** Corners [3 f] of the triangles of the object's boundary, numbers of vertices. */
  triangles() {
    const surface = this.surface("object"), { vertices } = surface;
    const corners = surface.triangles.map((corner) => vertices[corner]);
    surface.free();
    return corners;
  }
}

// The spring of a hand acts with the force of the step before, which is stable where it is slow against the step and the
// mass that the patch feels at once.
const HAND_SIZE = 0.06;           // radius over the diagonal of the body's bounds
const HAND_DELAY = 0.03;          // [s] of the smoothed target
const STIFFEST = 1e5;             // k / m [1/s^2]
const STIFFEST_PER_STEP = 0.1;    // k dt^2 / m
const HAND_DAMPING_RATIO = 0.6;
const LONGEST = 0.6;              // of the spring, over the same diagonal

const minus = (a, b) => a.map((x, i) => x - b[i]);
const plus = (a, b, factor) => a.map((x, i) => x + factor * b[i]);

/** A damped spring from a place of a body's surface to a target: the hand of the viewer. */
export class Hand {
  #point;
  #patch;
  #mass;
  #longest;
  #smoothed;
  constructor(body, surface, triangle, shares) {
    this.body = body;
    this.#point = surface.pointsOn([triangle], shares);
    const { rest } = surface.points, corners = surface.triangles;
    const place = (point) => Array.from(rest.subarray(3 * point, 3 * point + 3));
    const centre = [0, 1, 2].reduce((sum, c) => plus(sum, place(corners[3 * triangle + c]), shares[c]), [0, 0, 0]);
    const bounds = [0, 1, 2].map((axis) => {
      let least = Infinity, most = -Infinity;
      for (let i = axis; i < rest.length; i += 3) [least, most] = [Math.min(least, rest[i]), Math.max(most, rest[i])];
      return most - least;
    });
    const diagonal = Math.hypot(...bounds);
    this.#longest = LONGEST * diagonal;
    const covered = new Map();
    corners.forEach((corner, i) => {
      if (!covered.has(corner) && Math.hypot(...minus(place(corner), centre)) <= HAND_SIZE * diagonal) covered.set(corner, i);
    });
    const patch = [...covered.values()];
    this.#patch = patch.length === 0 ? this.#point
      : surface.pointsOn(patch.map((i) => Math.floor(i / 3)), patch.flatMap((i) => [0, 1, 2].map((c) => Number(i % 3 === c))));
    this.#mass = this.#effectiveMass();
    this.point = this.#read();
    this.target = [...this.point];
    this.#smoothed = [...this.point];
    this.force = [0, 0, 0];
  }
  #read() { return Array.from(this.body.readPositions(this.#point)); }
  /** Inverse of how far an impulse that the points share moves their mean, by the modes and by rigid motion. */
  #effectiveMass() {
    const { module, length } = this.#patch, columns = 3 * this.body.model.modes, mean = new Float64Array(columns);
    const rows = module.fill(new Float32Array(length * columns), (address) =>
      module.call("points_read_basis", this.#patch.handle, address, BigInt(length * columns)));
    rows.forEach((value, i) => { mean[i % columns] += value / length; });
    const { mass } = this.body.model;
    const inverse = mean.reduce((sum, value) => sum + value * value, 0) / 3 + (mass > 0 ? 3 / mass : 0);
    return inverse > 0 ? 1 / inverse : 0;
  }
  /** Adds the force of the hand for the next step; the caller clears those of the step before. */
  pull() {
    const { body } = this, { timeStep } = body.model, before = this.point, smoothedBefore = this.#smoothed;
    this.point = this.#read();
    this.#smoothed = plus(this.#smoothed, minus(this.target, this.#smoothed), 1 - Math.exp(-timeStep / HAND_DELAY));
    const perMass = Math.min(STIFFEST, STIFFEST_PER_STEP / timeStep ** 2);
    const compliance = body.pointCompliance(this.#patch);
    const mass = compliance > 0 ? timeStep ** 2 / compliance : this.#mass;
    let reach = minus(this.#smoothed, this.point);
    const length = Math.hypot(...reach);
    if (length > this.#longest) reach = reach.map((x) => x * this.#longest / length);
    const velocity = minus(minus(this.#smoothed, smoothedBefore), minus(this.point, before)).map((x) => x / timeStep);
    this.force = plus(reach.map((x) => x * perMass * mass), velocity, 2 * HAND_DAMPING_RATIO * Math.sqrt(perMass) * mass);
    const each = this.force.map((x) => x / this.#patch.length);
    body.applyForces(this.#patch, Float64Array.from({ length: 3 * this.#patch.length }, (_, i) => each[i % 3]));
  }
  /** Lets go: clears the forces on the body. */
  free() {
    if (this.#point.handle === 0) return;
    if (this.body.handle !== 0) {
      this.body.clearForces();
      this.body.restartIntegrator();
    }
    this.#patch.free();
    this.#point.free();
  }
}
if (Symbol.dispose !== undefined)
  Object.defineProperty(Hand.prototype, Symbol.dispose, { value() { this.free(); } });

/** What the module asks of its host: nothing but what libc links for files, clocks and the end of a process. */
function imports(holder) {
  const clock = (_id, _precision, address) => {
    const nanoseconds = BigInt(Math.round(1e6 * performance.now()));
    new DataView(holder.module.memory.buffer).setBigUint64(address, nanoseconds, true);
    return 0;
  };
  const noVariables = (count, bytes) => {
    const view = new DataView(holder.module.memory.buffer);
    view.setUint32(count, 0, true);
    view.setUint32(bytes, 0, true);
    return 0;
  };
  const ended = () => { throw new ExmatError("the module ended"); };
  const known = { clock_time_get: clock, environ_sizes_get: noVariables, environ_get: () => 0, proc_exit: ended };
  const NOT_SUPPORTED = 52;
  const wasi = new Proxy(known, { get: (functions, name) => functions[name] ?? (() => NOT_SUPPORTED) });
  const thrown = (status, message) => { throw errorOf(status, holder.module.text(message)); };
  return { wasi_snapshot_preview1: wasi, exmat: { thrown } };
}

async function instantiate(bytes) {
  const holder = {};
  const compiled = await WebAssembly.compile(bytes);
  const wanted = imports(holder);
  const given = { exmat: wanted.exmat, wasi_snapshot_preview1: {} };
  for (const { module, name } of WebAssembly.Module.imports(compiled)) given[module][name] = wanted[module][name];
  return new Module(await WebAssembly.instantiate(compiled, given), holder);
}

/** True if the host runs instructions of 128 bits. */
export function hasSimd() {
  // A function that returns i8x16.splat(0).
  return WebAssembly.validate(new Uint8Array([0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11]));
}

async function bytesOf(source) {
  if (source instanceof Uint8Array) return source;
  if (source instanceof ArrayBuffer) return new Uint8Array(source);
  if (typeof Response !== "undefined" && source instanceof Response) return new Uint8Array(await source.arrayBuffer());
  if (typeof process !== "undefined" && process.versions?.node && !/^https?:|^data:/.test(String(source))) {
    const { readFile } = await import("node:fs/promises");
    try {
      return new Uint8Array(await readFile(source));
    } catch (error) {
      throw new BadInput(`${source}: expected a pack of a bundle, found no file that can be read (${error.code})`);
    }
  }
  const response = await fetch(source);
  if (!response.ok) throw new BadInput(`${source}: expected a pack of a bundle, found HTTP status ${response.status}`);
  return new Uint8Array(await response.arrayBuffer());
}

/** The functions of the package on a module of which `moduleBytes` gives the bytes. */
export function packageOf(moduleBytes) {
  let started = null;
  let module = null;
  const start = () => (started ??= (async () => (module = await instantiate(await moduleBytes())))());
  return {
    init: async () => void (await start()),
    load: async (source, settings) => {
      const pack = await bytesOf(source);
      return new ModelOfModule(await start(), pack, settings);
    },
    World: class World extends WorldOfModule {
      constructor(law) {
        if (module === null) throw new ExmatError("call load() or init() first");
        super(module, law);
      }
    },
  };
}
