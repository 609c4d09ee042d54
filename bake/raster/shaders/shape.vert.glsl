// Corners of faces, not indexed: position, normal, uv and colour each.

in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec3 in_color;

uniform mat4 view;  // world → clip, orthographic: its upper 3 × 3 part is a rotation times scales

out vec3 normal;
out vec2 uv;
flat out vec3 color;

void main() {
    gl_Position = view * vec4(in_position, 1.0);
    normal = in_normal;
    uv = in_uv;
    color = in_color;
}
