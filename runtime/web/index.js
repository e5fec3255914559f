import { hasSimd, packageOf } from "./runtime.js";

export { Batch, BadInput, Body, ExmatError, Hand, InvalidArgument, NonFinite, Points, Surface } from "./runtime.js";

async function moduleBytes() {
  const url = hasSimd() ? new URL("./exmat.wasm", import.meta.url) : new URL("./exmat_plain.wasm", import.meta.url);
  if (url.protocol === "file:") return (await import("node:fs/promises")).readFile(url);
  return (await fetch(url)).arrayBuffer();
}

export const { init, load, World } = packageOf(moduleBytes);
