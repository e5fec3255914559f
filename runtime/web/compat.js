// The same package with the module inside, for bundlers and hosts that lose files beside the source.
import { PLAIN, SIMD } from "./bytes.js";
import { hasSimd, packageOf } from "./runtime.js";

export { Batch, BadInput, Body, ExmatError, Hand, InvalidArgument, NonFinite, Points, Surface } from "./runtime.js";

const moduleBytes = () => Uint8Array.from(atob(hasSimd() ? SIMD : PLAIN), (letter) => letter.charCodeAt(0));

export const { init, load, World } = packageOf(moduleBytes);
