// Tangents of npm's mikktspace (wasm) for unindexed triangles.  usage: node mikktspace.mjs IN.f32 OUT.f32
// IN: float32 positions (3 c), normals (3 c), uv (2 c) of c corners, one after the other.  OUT: tangents (4 c).
import { readFile, writeFile } from "node:fs/promises";
import { createRequire } from "node:module";

const { generateTangents } = createRequire(import.meta.url)("mikktspace");
const bytes = await readFile(process.argv[2]);
const data = new Float32Array(bytes.buffer, bytes.byteOffset, bytes.byteLength / 4);
const corners = data.length / 8;
const tangents = generateTangents(
    data.slice(0, 3 * corners), data.slice(3 * corners, 6 * corners), data.slice(6 * corners));
await writeFile(process.argv[3], Buffer.from(tangents.buffer, tangents.byteOffset, tangents.byteLength));
