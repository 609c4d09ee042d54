// One surface triangle as the rasterizing shaders see it, fetched by face number from the texture `corners`.
//
// corners: RGBA32F, two texels a corner, three corners a face, faces in reading order:
//          (position.xyz, u) and (normal.xyz, v).
// Texel coordinates: x = u size, y = (1 - v) size, so that row 0 of the target is the top of the image.

struct Triangle {
    vec3 position[3];
    vec3 normal[3];
    vec2 texel[3];
};

uniform sampler2D corners;
uniform float size;

vec4 corner_texel(int index) {
    int width = textureSize(corners, 0).x;
    return texelFetch(corners, ivec2(index % width, index / width), 0);
}

Triangle fetch_triangle(int face) {
    Triangle triangle;
    for (int i = 0; i < 3; i++) {
        vec4 first = corner_texel(6 * face + 2 * i);
        vec4 second = corner_texel(6 * face + 2 * i + 1);
        triangle.position[i] = first.xyz;
        triangle.normal[i] = second.xyz;
        triangle.texel[i] = vec2(first.w, 1.0 - second.w) * size;
    }
    return triangle;
}

vec4 clip_position(vec2 texel) {
    return vec4(texel / size * 2.0 - 1.0, 0.0, 1.0);
}
