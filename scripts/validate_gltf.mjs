// Runs the validator of the Khronos Group over glTF files: node scripts/validate_gltf.mjs FILE...
// It is the npm package gltf-validator; install it anywhere and name that folder in GLTF_VALIDATOR.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { join, resolve } from "node:path";

const folder = process.env.GLTF_VALIDATOR ?? process.cwd();
const validator = createRequire(join(resolve(folder), "index.js"))("gltf-validator");
let bad = false;
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { uri: path, maxIssues: 0 });
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  bad ||= numErrors > 0 || numWarnings > 0;
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  for (const code of new Set(messages.map((message) => message.code))) {
    const same = messages.filter((message) => message.code === code);
    console.log(`  ${same.length} x ${code}: ${same[0].message} (${same[0].pointer})`);
  }
}
process.exit(bad ? 1 : 0);
