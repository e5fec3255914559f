// Prints what the validator of glTF finds in files; exit status 1 for errors or warnings.
const fs = require("fs");
const validator = require("gltf-validator");

// Tangents are left to viewers, which compute them from the surface as it is drawn (docs/export.md).
const ignoredIssues = ["MESH_PRIMITIVE_GENERATED_TANGENT_SPACE"];

Promise.all(process.argv.slice(2).map(async (file) => {
  const { issues } = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { ignoredIssues });
  console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos, ${issues.numHints} hints`);
  issues.messages.forEach((message) => console.log(`  ${message.pointer}: ${message.message}`));
  return issues.numErrors + issues.numWarnings;
})).then((found) => process.exit(found.some((count) => count > 0) ? 1 : 0));
