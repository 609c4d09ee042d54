// One program draws the surface, the flat layout, and the numbers of faces for pointing.
// A face is told by the number of its vertex; facts of faces are texels of two textures, 4096 a row.
import * as THREE from "three";

export const LOOKS = { checker: 0, picture: 1, charts: 2, distortion: 3, plain: 4 };

const VERTEX = /* glsl */ `
uniform bool flattened, backdrop;
uniform vec2 extent;
flat out int face;
out vec3 weights;
out vec2 place;
out vec3 seen;
out vec3 smoothNormal;
void main() {
  face = gl_VertexID / 3;
  int corner = gl_VertexID - 3 * face;
  weights = vec3(corner == 0, corner == 1, corner == 2);
  place = backdrop ? uv * extent : uv;
  vec4 view = modelViewMatrix * vec4(flattened ? vec3(place, 0.0) : position, 1.0);
  seen = view.xyz;
  smoothNormal = normalMatrix * normal;
  gl_Position = projectionMatrix * view;
}`;

const FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
uniform sampler2D chartColors, heatColors, picture;
uniform int look, chosenFace, marks;
uniform float cells, level;
uniform vec2 extent;
uniform bool flattened, numbered, edges, backdrop;
flat in int face;
in vec3 weights;
in vec2 place;
in vec3 seen;
in vec3 smoothNormal;
out vec4 color;

const vec3 FLIPPED = vec3(0.0, 0.72, 0.95), OVERLAPPING = vec3(0.98, 0.45, 0.05), CHOSEN = vec3(1.0, 0.85, 0.1);

vec3 hue(float turn) { return 0.5 + 0.5 * cos(6.2832 * (turn + vec3(0.0, 0.33, 0.67))); }

// Squares of the atlas, tinted by their place in it; they fade where they are finer than pixels.
vec3 checker(vec2 spot) {
  vec2 cell = spot * cells;
  float light = mod(floor(cell.x) + floor(cell.y), 2.0);
  vec2 wide = fwidth(cell);
  float fade = smoothstep(0.35, 0.9, max(wide.x, wide.y));
  vec3 tint = mix(vec3(1.0), hue(spot.x * 0.85), 0.45) * mix(0.75, 1.0, spot.y);
  return tint * mix(mix(0.52, 0.98, light), 0.75, fade);
}

vec3 fromPicture(vec2 spot) {
  spot /= extent;
  if (level < 0.5) return texture(picture, spot).rgb;
  vec2 size = vec2(textureSize(picture, int(level)));
  return textureLod(picture, (floor(spot * size) + 0.5) / size, level).rgb;
}

vec3 surfaceColor(ivec2 texel) {
  if (look == 0) return checker(place);
  if (look == 1) return fromPicture(place);
  if (look == 2) return texelFetch(chartColors, texel, 0).rgb;
  if (look == 3) return texelFetch(heatColors, texel, 0).rgb;
  return vec3(0.8);
}

float lit() {
  vec3 facet = normalize(cross(dFdx(seen), dFdy(seen)));
  vec3 normal = normalize(smoothNormal);
  normal *= sign(dot(normal, facet));
  if (dot(normal, facet) < 0.8) normal = facet;
  return 0.5 + 0.55 * max(0.0, dot(normal, normalize(vec3(0.3, 0.5, 0.8)))) + 0.15 * max(0.0, -normal.x);
}

// Flipped faces are blue, overlapping ones striped in orange; what is neither fades.
vec3 marked(vec3 base, int flags) {
  if (marks == 0) return base;
  bool flipped = (flags & marks & 1) != 0, overlapping = (flags & marks & 2) != 0;
  base = flipped ? FLIPPED : mix(vec3(dot(base, vec3(0.3, 0.6, 0.1))), base, 0.35);
  if (!overlapping) return base;
  float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 10.0));
  return mix(OVERLAPPING, flipped ? FLIPPED : vec3(0.3, 0.05, 0.0), stripe);
}

void main() {
  if (backdrop) {
    color = vec4(look == 1 ? fromPicture(place) : checker(place), look <= 1 ? 0.35 : 0.0);
    return;
  }
  if (numbered) {
    int number = face + 1;
    color = vec4(float(number & 255), float((number >> 8) & 255), float((number >> 16) & 255), 255.0) / 255.0;
    return;
  }
  ivec2 texel = ivec2(face % 4096, face / 4096);
  vec4 facts = texelFetch(heatColors, texel, 0);
  vec3 base = marked(surfaceColor(texel), int(facts.a * 255.0 + 0.5));
  if (!flattened) base *= lit();
  float inside = min(min(weights.x / fwidth(weights.x), weights.y / fwidth(weights.y)), weights.z / fwidth(weights.z));
  if (edges) base = mix(base * 0.45, base, smoothstep(0.2, 1.1, inside));
  if (face == chosenFace) base = mix(CHOSEN, base, 0.35 * smoothstep(0.5, 2.0, inside));
  color = vec4(base, 1.0);
}`;

/** The material of one result; uniforms are set before each drawing. */
export function surfaceMaterial(result) {
  const values = {
    chartColors: result.chartColors, heatColors: result.heatColors, picture: null, look: 0, chosenFace: -1, extent: new THREE.Vector2(...result.extent),
    marks: 0, cells: 32, level: 0, flattened: false, numbered: false, edges: false, backdrop: false,
  };
  return new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    uniforms: Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }])),
  });
}
