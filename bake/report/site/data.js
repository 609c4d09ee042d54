// The results of the page, unpacked: typed arrays, one vertex for each corner of a face, and facts of faces.
// f faces.  Positions lie in the unit ball; uv have v up and are in sides of the page, whose longer one is 1.
import * as THREE from "three";

const TYPES = {
  float32: Float32Array, int8: Int8Array, uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array,
};
const WIDTH = 4096; // of textures that hold a texel for each face

export const FLIPPED = 1, OVERLAPPING = 2;

/** The data of the page, its arrays inflated. */
export async function readData() {
  const data = JSON.parse(document.getElementById("data").textContent);
  data.heat = await unpacked(data.heat);
  data.results = await Promise.all(data.results.map((result) => readResult(result, data.heat)));
  return data;
}

async function unpacked({ type, bytes }) {
  const deflated = Uint8Array.from(atob(bytes), (letter) => letter.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new TYPES[type](await new Response(stream).arrayBuffer());
}

async function readResult(result, heat) {
  const names = Object.keys(result.arrays);
  const arrays = await Promise.all(names.map((name) => unpacked(result.arrays[name])));
  const found = { ...result, ...Object.fromEntries(names.map((name, place) => [name, arrays[place]])) };
  delete found.arrays;
  found.faceCount = found.faces.length / 3;
  found.geometry = geometryOf(found);
  found.seamLines = { surface: linesOf(found, found.positions, 3), flat: linesOf(found, found.uv, 2) };
  found.chartColors = faceTexture(found, (face) => [...found.colors.subarray(3 * found.charts[face], 3 * found.charts[face] + 3), 0]);
  found.heatColors = faceTexture(found, (face) => [...heat.subarray(3 * found.heat[face], 3 * found.heat[face] + 3), found.flags[face]]);
  return found;
}

/** A vertex for each corner: the shaders tell faces and corners by the number of the vertex. */
function geometryOf(result) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(spread(result, result.positions, 3), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(spread(result, result.normals, 3), 3, true));
  geometry.setAttribute("uv", new THREE.BufferAttribute(spread(result, result.uv, 2), 2));
  return geometry;
}

function spread({ faces }, values, width) {
  const corners = new values.constructor(faces.length * width);
  for (let corner = 0; corner < faces.length; corner++)
    for (let axis = 0; axis < width; axis++) corners[corner * width + axis] = values[faces[corner] * width + axis];
  return corners;
}

function linesOf({ seams }, values, width) {
  const points = new Float32Array(seams.length * 3);
  seams.forEach((vertex, end) => {
    for (let axis = 0; axis < width; axis++) points[3 * end + axis] = values[width * vertex + axis];
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
  return geometry;
}

function faceTexture({ faceCount }, colorOf) {
  const height = Math.max(1, Math.ceil(faceCount / WIDTH));
  const texels = new Uint8Array(4 * WIDTH * height);
  for (let face = 0; face < faceCount; face++) texels.set(colorOf(face), 4 * face);
  const texture = new THREE.DataTexture(texels, WIDTH, height);
  texture.needsUpdate = true;
  return texture;
}

/** The corners of a face, as vectors: on the surface, or in uv with z = 0. */
export function cornersOf(result, face, flat) {
  return [0, 1, 2].map((corner) => {
    const vertex = result.faces[3 * face + corner];
    return flat
      ? new THREE.Vector3(result.uv[2 * vertex], result.uv[2 * vertex + 1], 0)
      : new THREE.Vector3().fromArray(result.positions, 3 * vertex);
  });
}

/** The point of a face at three weights. */
export function pointOf(result, { face, weights }, flat) {
  const point = new THREE.Vector3();
  cornersOf(result, face, flat).forEach((corner, number) => point.addScaledVector(corner, weights[number]));
  return point;
}
