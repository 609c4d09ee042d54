// What a fragment of a face writes: position, normal and barycentric coordinates of one point of the face.

flat in vec3 position0, position1, position2;
flat in vec3 normal0, normal1, normal2;
flat in vec2 texel0, texel1, texel2;
flat in int face;

uniform ivec2 origin;

layout(location = 0) out vec4 out_position;  // xyz, second barycentric coordinate
layout(location = 1) out vec4 out_normal;    // xyz unit, third barycentric coordinate
layout(location = 2) out int out_face;

// The texel of the whole image that this fragment is.
ivec2 image_texel() {
    return ivec2(gl_FragCoord.xy) + origin;
}

vec3 weighted_normal(vec3 weight) {
    vec3 normal = weight.x * normal0 + weight.y * normal1 + weight.z * normal2;
    float len = length(normal);
    return len > 1e-12 ? normal / len : normal0;
}

void write_surface(vec3 weight, vec2 second_and_third) {
    out_position = vec4(weight.x * position0 + weight.y * position1 + weight.z * position2, second_and_third.x);
    out_normal = vec4(weighted_normal(weight), second_and_third.y);
    out_face = face;
}
