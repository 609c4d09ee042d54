// The surface at the point of the border edge that is nearest to the texel's centre; the nearest edge wins by depth.

uniform float reach;

flat in int turn;

void main() {
    vec2 along = texel1 - texel0;
    float square = dot(along, along);
    float t = square > 0.0 ? clamp(dot(gl_FragCoord.xy - texel0, along) / square, 0.0, 1.0) : 0.0;
    float away = distance(gl_FragCoord.xy, texel0 + t * along);
    if (away > reach) discard;
    gl_FragDepth = (away + 0.01) / (reach + 0.02);  // above 0: a texel whose centre is inside a face keeps that face
    vec3 weight = vec3(1.0 - t, t, 0.0);
    // weight of corner `turn` is 1 - t and of the next one t: turn back to the face's own order
    write_surface(weight, turn == 0 ? vec2(t, 0.0) : turn == 1 ? vec2(1.0 - t, t) : vec2(0.0, 1.0 - t));
}
