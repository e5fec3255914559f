// Writes bytes.js of the modules in a folder, for compat.js.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const folder = process.argv[2];
const text = (file) => readFileSync(join(folder, file)).toString("base64");
writeFileSync(join(folder, "bytes.js"), `export const SIMD = "${text("exmat.wasm")}";\nexport const PLAIN = "${text("exmat_plain.wasm")}";\n`);
