// Pointing: which face lies under the pointer, where in it, and what is said of it.
import * as THREE from "three";
import { FLIPPED, OVERLAPPING, cornersOf } from "data";

/** The spot under a pixel of a pane: face and the weights of its corners; null beside the surface. */
export function spotAt(stage, pane, x, y) {
  const face = stage.faceAt(pane, x, y);
  if (face < 0) return null;
  const corners = cornersOf(pane.result, face, pane.flat), ray = pane.ray(x + 0.5, y + 0.5);
  const plane = new THREE.Plane().setFromCoplanarPoints(...corners);
  const point = ray.intersectPlane(plane, new THREE.Vector3()) ?? corners[0];
  const weights = THREE.Triangle.getBarycoord(point, ...corners, new THREE.Vector3()) ?? new THREE.Vector3(1, 0, 0);
  return { face, weights: weights.toArray().map((weight) => THREE.MathUtils.clamp(weight, 0, 1)) };
}

/** The normal of a face, outwards. */
export function normalOf(result, face) {
  return new THREE.Triangle(...cornersOf(result, face, false)).getNormal(new THREE.Vector3());
}

/** A sentence about a spot. */
export function described(result, { face }, fineness) {
  const [large, small] = [result.stretch[2 * face], result.stretch[2 * face + 1]].map((value) => value / fineness);
  const inverse = (value) => 1 / Math.max(value, 1e-3) ** 2;
  const energy = (large ** 2 + small ** 2 + inverse(large) + inverse(small)) / 4;
  const said = [
    `${result.title}: chart ${result.charts[face] + 1} of ${result.colors.length / 3}`,
    `triangle ${face}`,
    `stretch ${large.toFixed(3)} × and ${small.toFixed(3)} × across`,
    `area ${(large * small).toFixed(3)} ×`,
    `distortion ${(100 * (energy - 1)).toFixed(2)} %`,
  ];
  if (result.size) said.push(`${densityOf(result, face).toPrecision(4)} texels per unit`);
  if (result.flags[face] & FLIPPED) said.push("flipped");
  if (result.flags[face] & OVERLAPPING) said.push("overlaps another");
  return `${said.join(" · ")}.`;
}

function densityOf(result, face) {
  const area = (flat) => new THREE.Triangle(...cornersOf(result, face, flat)).getArea();
  return result.size * Math.sqrt(area(true) / Math.max(area(false), 1e-30)) * result.unit;
}
