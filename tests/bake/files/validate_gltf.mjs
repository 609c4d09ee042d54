// Prints the Khronos validator's report on the file named as JSON.  usage: node validate_gltf.mjs FILE.glb
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const validator = require("gltf-validator");
const report = await validator.validateBytes(new Uint8Array(await readFile(process.argv[2])), { maxIssues: 100 });
console.log(JSON.stringify(report.issues));
