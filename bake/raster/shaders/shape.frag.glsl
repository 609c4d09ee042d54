// Colour (linear light), checkered along uv if cells > 0, lit from the viewer's upper left if lit > 0.

in vec3 normal;
in vec2 uv;
flat in vec3 color;

uniform float cells;  // squares per uv unit
uniform float lit;
uniform vec3 eye;     // unit vectors in world space: to the viewer, to the lamp, up
uniform vec3 lamp;
uniform vec3 up;

out vec4 out_color;

void main() {
    vec3 base = color;
    if (cells > 0.0) {
        vec2 cell = floor(uv * cells);
        bool dark = mod(cell.x + cell.y, 2.0) > 0.5;
        base = dark ? color * 0.55 : mix(color, vec3(1.0), 0.6);
    }
    vec3 n = normalize(normal);
    n = dot(n, eye) < 0.0 ? -n : n;
    float key = max(dot(n, lamp), 0.0);
    float sky = 0.5 + 0.5 * dot(n, up);
    float rim = pow(1.0 - max(dot(n, eye), 0.0), 3.0);
    vec3 shaded = base * (0.22 + 0.28 * sky + 0.62 * key) + 0.05 * rim;
    out_color = vec4(mix(base, shaded, lit), 1.0);
}
