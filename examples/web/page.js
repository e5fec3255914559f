// The page: a scene of a few, or a dropped one, is stepped, drawn and dragged.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { BodyMesh, Dragger } from "exmat/three";
import { Plot } from "./plot.js";
import { free, sceneOf, step, worldOf } from "./scene.js";

const SCENES = ["teddy", "car", "figure", "pile", "character"];
const BUDGET = 12;  // [ms] of a frame for steps; what does not fit makes the motion slower than real time
const KEYBOARD = "keyboard";

const element = (id) => document.getElementById(id);
const view = element("view");
const renderer = new THREE.WebGLRenderer({ canvas: view, antialias: true });
const picture = new THREE.Scene(), camera = new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
const sky = new THREE.HemisphereLight(0xffffff, 0x888888, 1.9), sun = new THREE.DirectionalLight(0xffffff, 2.2);
picture.add(sky, camera);
camera.add(sun);
sun.position.set(-0.4, 0.6, 1);
const dragger = new Dragger(view, camera, []);
const plots = { weights: new Plot(element("weights-plot"), element("weights-key")), energies: new Plot(element("energies-plot"), element("energies-key")) };
const rods = [];  // from held places to hands

const state = { current: null, motion: null, name: null, scene: null, read: null, orbit: null, size: 1, weights: [], paused: false, owed: 0, stepTime: 0, speed: 1 };
/** For the console, and for tests. */
window.exmat = { state, dragger, camera, renderer };

const colour = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());
const materials = {
  body: new THREE.MeshStandardMaterial({ roughness: 0.65 }),
  faceted: new THREE.MeshStandardMaterial({ roughness: 0.65, flatShading: true }),
  floor: new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, transparent: true, opacity: 0.55, depthWrite: false }),
  hand: new THREE.LineBasicMaterial({ depthTest: false }),
};
function takeColours() {
  renderer.setClearColor(colour("--ground"));
  materials.body.color = materials.faceted.color = colour("--body");
  materials.floor.color = colour("--floor");
  materials.hand.color = colour("--hand");
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", takeColours);
takeColours();

// ---- scenes ----

function say(text) { element("message").textContent = text; }

function announce(name) {
  state.name = name;
  for (const button of element("scenes").children) button.setAttribute("aria-current", String(button.textContent === name));
  say("loading ...");
}

async function show(name, scene, read) {
  announce(name);
  try {
    const next = await worldOf(scene, read);
    if (state.name !== name) return free(next);
    end();
    Object.assign(state, { current: next, scene, read, owed: 0, stepTime: 0 });
    begin();
    say(next.ignored.length > 0 ? `The page leaves out: ${next.ignored.join(", ")}` : "");
  } catch (error) {
    if (state.name === name) say(`${name}: ${error.message}`);
    console.warn(error);
  }
}

async function read(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: HTTP status ${response.status}`);
  return response;
}
const showByName = async (name) => show(name, await (await read(`scenes/${name}.json`)).json(), (file) => read(`scenes/${file}`));

/** Plays the motion of a .glb that `exmat-runtime export` has written: what is in it is drawn, and nothing steps. */
async function play(name, bytes) {
  announce(name);
  const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
  const { scene, animations } = await new GLTFLoader().parseAsync(bytes, "");
  if (state.name !== name) return;
  end();
  const mixer = new THREE.AnimationMixer(scene);
  for (const clip of animations) mixer.clipAction(clip).play();
  state.motion = { scene, mixer };
  picture.add(scene);
  frame(new THREE.Box3().setFromObject(scene), [0, -9.81, 0]);
  showPanels();
  say(animations.length > 0 ? "" : `${name} has no motion`);
}

function end() {
  if (state.motion !== null) state.motion.scene.traverse((node) => node.geometry?.dispose());
  state.motion = null;
  picture.clear().add(sky, camera);
  if (state.current === null) return;
  dragger.releaseAll();
  for (const mesh of dragger.meshes) mesh.dispose();
  for (const { surface } of state.current.models) surface.free();
  dragger.meshes = [];
  rods.length = 0;
  free(state.current);
  state.current = null;
}

function begin() {
  const { world, models, obstacles, gravity } = state.current;
  for (const kind of models) kind.surface = kind.model.surface();
  dragger.meshes = world.bodies.map((body) => {
    const { surface } = models.find(({ model }) => model === body.model);
    return new BodyMesh(body, { surface, material: surface.kind === "render" ? materials.body : materials.faceted });
  });
  picture.add(...dragger.meshes);
  const box = new THREE.Box3();
  for (const mesh of dragger.meshes) box.union(new THREE.Box3().setFromBufferAttribute(mesh.geometry.attributes.position));
  const size = box.getSize(new THREE.Vector3()).length();
  for (const obstacle of obstacles) picture.add(obstacleMesh(obstacle, size));
  frame(box, gravity);
  showPanels();
  showControls();
}

/** A motion has no settings, and nothing to drag. */
function showPanels() {
  for (const panel of document.querySelectorAll("aside > :not(.buttons), #hint")) panel.hidden = state.current === null;
}

function obstacleMesh({ shape, point = [0, 0, 0], direction = [0, 0, 1], halfExtents, radius, orientation = [1, 0, 0, 0] }, size) {
  const along = new THREE.Vector3(...direction), place = new THREE.Vector3(...point), [w, x, y, z] = orientation;
  const geometry = shape === "plane" ? new THREE.PlaneGeometry(4 * size, 4 * size)
    : shape === "sphere" ? new THREE.SphereGeometry(radius, 48, 24)
    : shape === "box" ? new THREE.BoxGeometry(...halfExtents.map((length) => 2 * length)) : new THREE.CapsuleGeometry(radius, along.length());
  const mesh = new THREE.Mesh(geometry, materials.floor);
  if (shape === "plane") mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), along.clone().normalize());
  if (shape === "capsule") mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.clone().normalize());
  if (shape === "box") mesh.quaternion.set(x, y, z, w);
  mesh.position.copy(shape === "capsule" ? place.addScaledVector(along, 0.5) : place);
  return mesh;
}

/** Looks at what there is, of a high stack at its foot; up is against gravity. */
function frame(box, gravity) {
  const up = new THREE.Vector3(...gravity).negate();
  if (up.length() === 0) up.set(0, 1, 0);
  camera.up.copy(up.normalize());
  const axis = Math.abs(up.y) > 0.5 ? "y" : "z", extent = box.getSize(new THREE.Vector3());
  const width = Math.max(extent.x, axis === "y" ? extent.z : extent.y);
  if (extent[axis] > 4 * width) box.max[axis] = box.min[axis] + 4 * width;
  const size = state.size = box.getSize(new THREE.Vector3()).length(), centre = box.getCenter(new THREE.Vector3());
  const front = axis === "y" ? new THREE.Vector3(0.5, 0.3, 1) : new THREE.Vector3(0.5, -1, 0.45);
  camera.position.copy(centre).addScaledVector(front.normalize(), 1.9 * size / Math.min(1, view.clientWidth / view.clientHeight) ** 0.6);
  camera.near = size / 100;
  camera.far = 100 * size;
  camera.updateProjectionMatrix();
  state.orbit?.dispose();
  state.orbit = new OrbitControls(camera, view);  // it takes camera.up when it is made
  state.orbit.target.copy(centre);
  state.orbit.update();
}

// ---- controls ----

for (const name of SCENES) {
  const button = document.createElement("button");
  button.textContent = name;
  button.addEventListener("click", () => showByName(name));
  element("scenes").append(button);
}

element("pause").addEventListener("click", () => {
  state.paused = !state.paused;
  element("pause").setAttribute("aria-pressed", String(state.paused));
});
element("reset").addEventListener("click", () => {
  if (state.motion === null) show(state.name, state.scene, state.read);
  else state.motion.mixer.setTime(0);
});

for (const radio of document.querySelectorAll("[name=space]"))
  radio.addEventListener("change", () => { for (const body of state.current.world.bodies) body.space = radio.value; });

function slider(name, { min = 0, max = 1, step = 0.01, value, format = (x) => x.toFixed(2) }, change) {
  const label = document.createElement("label"), input = document.createElement("input"), output = document.createElement("output");
  label.className = "slider";
  Object.assign(input, { type: "range", min, max, step, value, name });
  input.setAttribute("aria-label", name);
  const tell = () => {
    output.textContent = format(Number(input.value));
    input.setAttribute("aria-valuetext", output.textContent);
  };
  input.addEventListener("input", () => {
    tell();
    change(Number(input.value));
  });
  label.append(name, output, input);
  label.set = (number) => {
    input.value = number;
    tell();
  };
  tell();
  return label;
}

const logarithmic = (kappa) => Math.log10(1 + kappa);

function showControls() {
  const { models, world } = state.current, posed = models.filter(({ model }) => model.examples > 0);
  element("examples").hidden = posed.length === 0;
  element("kappas").replaceChildren(...posed.map(({ model, name, examples }) => slider(
    posed.length > 1 ? `κ of ${name} [1/s²]` : "κ [1/s²]",
    { max: 5, value: logarithmic(examples.stiffness), format: (x) => String(Number((10 ** x - 1).toPrecision(3))) },
    (x) => { for (const body of bodiesOf(model)) body.setExampleStiffness(10 ** x - 1); })));
  const kind = posed[0];
  element("given").checked = Array.isArray(kind?.examples.weights);
  const count = kind?.model.examples ?? 0;
  state.weights = Array.isArray(kind?.examples.weights) ? [...kind.examples.weights] : Array.from({ length: count }, (_, i) => Number(i === 0));
  element("weights").replaceChildren(...state.weights.map((value, i) => slider((posed.length > 1 ? `${kind.name}: ` : "") + kind.model.exampleName(i), { value }, (x) => setWeight(i, x))));
  const { space } = models[0], fixed = models.some(({ model }) => model.bones.length > 0);
  for (const radio of document.querySelectorAll("[name=space]")) Object.assign(radio, { checked: radio.value === space, disabled: fixed });
  plots.weights.begin(state.weights.map((_, i) => kind.model.exampleName(i)));
  plots.energies.begin(["kinetic", "elastic", "potential", ...(world.bodies.length > 1 ? ["contact"] : [])]);
}

const posedKind = () => state.current.models.find(({ model }) => model.examples > 0);
const bodiesOf = (model) => state.current.world.bodies.filter((body) => body.model === model);

/** Weights sum to 1: the others share what one leaves. */
function setWeight(changed, value) {
  const others = state.weights.reduce((sum, weight, i) => sum + (i === changed ? 0 : weight), 0), count = state.weights.length - 1;
  state.weights = state.weights.map((weight, i) => (i === changed ? value : others > 0 ? weight * (1 - value) / others : (1 - value) / count));
  if (count === 0) state.weights = [1];
  element("given").checked = true;
  giveWeights();
}
function showWeights(weights) {
  state.weights = Array.from(weights);
  [...element("weights").children].forEach((label, i) => label.set(state.weights[i]));
}
function giveWeights() {
  const { model } = posedKind();
  showWeights(state.weights);
  const sum = state.weights.reduce((a, b) => a + b, 0), given = element("given").checked ? state.weights.map((weight) => weight / sum) : null;
  for (const body of bodiesOf(model)) body.setExampleWeights(given);
}
element("given").addEventListener("change", giveWeights);

// ---- keys ----

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

view.addEventListener("keydown", (event) => {
  if (event.key === "Escape") return dragger.release(KEYBOARD);
  const arrow = ARROWS[event.key];
  if (arrow === undefined || state.current === null) return;
  event.preventDefault();
  const [right, up] = arrow;
  if (event.shiftKey) {
    const offset = camera.position.clone().sub(state.orbit.target), side = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 0);
    offset.applyAxisAngle(camera.up, -0.1 * right).applyAxisAngle(side, -0.1 * up);
    camera.position.copy(state.orbit.target).add(offset);
    return void state.orbit.update();
  }
  const hand = dragger.hand(KEYBOARD) ?? holdMiddle();
  if (hand === null) return;
  const axis = (column) => new THREE.Vector3().setFromMatrixColumn(camera.matrix, column);
  hand.target = new THREE.Vector3(...hand.target).addScaledVector(axis(0), 0.04 * right * state.size).addScaledVector(axis(1), 0.04 * up * state.size).toArray();
});

/** A hand at the place of a body that is nearest to the middle of the picture. */
function holdMiddle() {
  for (let radius = 0; radius <= 1; radius += 0.04)
    for (let turn = 0; turn < 16; ++turn) {
      const angle = turn * Math.PI / 8, hit = dragger.pick(new THREE.Vector2(radius * Math.cos(angle), radius * Math.sin(angle)));
      if (hit !== undefined) return dragger.hold(KEYBOARD, hit);
    }
  return null;
}
view.addEventListener("blur", () => dragger.release(KEYBOARD));

// ---- files ----

/** Shows a scene file with its packs, one pack by itself, or a motion. */
async function open(files) {
  const byName = new Map([...files].map((file) => [file.name, file])), names = [...byName.keys()];
  const bytesOf = async (name) => {
    if (!byName.has(name)) throw new Error(`${name}: drop it together with its scene`);
    return new Uint8Array(await byName.get(name).arrayBuffer());
  };
  const ending = (end) => names.find((name) => name.toLowerCase().endsWith(end));
  const sceneFile = ending(".json"), pack = ending(".exmat"), motion = ending(".glb"), bundle = ending(".h5");
  try {
    if (sceneFile) return await show(sceneFile, JSON.parse(await byName.get(sceneFile).text()), bytesOf);
    if (pack) return await show(pack, await sceneOf(pack, bytesOf), bytesOf);
    if (motion) return await play(motion, await byName.get(motion).arrayBuffer());
    if (bundle) return say(`${bundle}: a page reads packs; exmat-runtime pack ${bundle} -o ${bundle.slice(0, -3)}.exmat makes one`);
    say(`${names.join(", ")}: expected a pack (.exmat), a scene (.json) with its packs, or a motion (.glb)`);
  } catch (error) {
    say(error.message);
  }
}
element("file").addEventListener("change", (event) => open(event.target.files));
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
});
addEventListener("dragleave", () => document.body.classList.remove("dropping"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("dropping");
  open(event.dataTransfer.files);
});

// ---- frames ----

function fit() {
  const { clientWidth, clientHeight } = view, ratio = Math.min(devicePixelRatio, 2), size = renderer.getSize(new THREE.Vector2());
  if (size.x === clientWidth && size.y === clientHeight && renderer.getPixelRatio() === ratio) return;
  renderer.setPixelRatio(ratio);
  renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = clientWidth / Math.max(1, clientHeight);
  camera.updateProjectionMatrix();
}

function drawHands() {
  const { hands } = dragger;
  while (rods.length < hands.length) {
    const rod = new THREE.Line(new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)), materials.hand);
    Object.assign(rod, { frustumCulled: false, renderOrder: 1 });
    rods.push(rod);
    picture.add(rod);
  }
  rods.forEach((rod, i) => {
    rod.visible = i < hands.length;
    if (!rod.visible) return;
    const { position } = rod.geometry.attributes;
    position.array.set([...hands[i].point, ...hands[i].target]);
    position.needsUpdate = true;
  });
}

/** Takes the steps of a frame of `elapsed` ms, as many as the budget has room for. */
function advance(elapsed) {
  const { current } = state, length = 1000 * current.timeStep, begun = performance.now();
  state.owed = Math.min(state.owed + elapsed, 100);
  let steps = 0, spent = 0;
  while (state.owed >= length && spent < BUDGET) {
    step(current, dragger);
    state.owed -= length;
    ++steps;
    spent = performance.now() - begun;
  }
  if (steps === 0) return;
  if (state.owed >= length) state.owed = 0;
  state.stepTime += 0.1 * (spent / steps - state.stepTime);
  state.speed += 0.1 * (steps * length / Math.max(elapsed, length) - state.speed);
  const { world } = current, posed = posedKind();
  if (posed) plots.weights.add(world.time, bodiesOf(posed.model)[0].weights);
  const { kinetic, elastic, potential, contact } = world.energies;
  plots.energies.add(world.time, [kinetic, elastic, potential, contact]);
}

function tell() {
  const spaces = state.current.world.bodies.map(({ space }) => space), full = spaces.filter((space) => space === "full").length;
  element("space").textContent = spaces.length === 1 ? spaces[0] : `full ${full}, reduced ${spaces.length - full}`;
  element("time").textContent = state.stepTime < 1 ? `${Math.round(1000 * state.stepTime)} µs` : `${state.stepTime.toFixed(1)} ms`;
  element("speed").textContent = state.paused ? "paused" : `${Math.min(100, Math.round(100 * state.speed))} %`;
  if (state.weights.length > 0 && !element("given").checked) showWeights(bodiesOf(posedKind().model)[0].weights);
  for (const plot of Object.values(plots)) plot.draw();
}

let before = performance.now(), frames = 0;
function drawFrame(now) {
  const elapsed = Math.min(now - before, 100);
  before = now;
  fit();
  if (state.current !== null) {
    try {
      if (!state.paused) advance(elapsed);
    } catch (error) {
      say(error.message);
      state.paused = true;
      element("pause").setAttribute("aria-pressed", "true");
    }
    for (const mesh of dragger.meshes) mesh.update();
    drawHands();
    if (frames++ % 6 === 0) tell();
  }
  if (state.motion !== null && !state.paused) state.motion.mixer.update(elapsed / 1000);
  renderer.render(picture, camera);
  requestAnimationFrame(drawFrame);
}
requestAnimationFrame(drawFrame);
showByName(SCENES.includes(location.hash.slice(1)) ? location.hash.slice(1) : SCENES[0]);
