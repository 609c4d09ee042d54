// Line segments as rectangles of constant width on the screen; six vertices a segment, one segment an instance.

in vec3 in_start;
in vec3 in_end;

uniform mat4 view;
uniform float half_width;  // in clip units (the screen is 2 high)
uniform float lift;        // towards the viewer, in depth units, so that lines lie on the surface

const vec2 RECTANGLE[6] = vec2[](vec2(0, -1), vec2(1, -1), vec2(1, 1), vec2(0, -1), vec2(1, 1), vec2(0, 1));

void main() {
    vec4 start = view * vec4(in_start, 1.0), end = view * vec4(in_end, 1.0);
    vec2 along = end.xy - start.xy;
    along = dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
    vec2 place = RECTANGLE[gl_VertexID];
    vec4 point = place.x > 0.5 ? end : start;
    point.xy += half_width * ((place.x * 2.0 - 1.0) * along + place.y * vec2(-along.y, along.x));
    point.z -= lift;
    gl_Position = point;
}
