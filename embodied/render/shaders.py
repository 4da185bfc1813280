"""The shaders of embodied.render.raster: what runs for every corner and every pixel of a lit house."""

CORNERS = """#version 330
layout(location = 0) in vec3 xyz;
layout(location = 1) in vec2 at;
layout(location = 2) in uvec2 of;
uniform mat4 camera;
out vec2 texel;
flat out uint id, opacity;
void main() { gl_Position = camera * vec4(xyz, 1.0); texel = at; id = of.x; opacity = of.y; }
"""
_PLACE = """#version 330
uniform vec2 pages;  // size of the atlas without its smaller copies, texels
in vec2 texel;
vec2 place_of() {
    vec2 wide = max(abs(dFdx(texel)), abs(dFdy(texel)));
    float rho = max(max(wide.x, wide.y), 1.0) * 1.4142136;  // the copy is log2(rho), rounded down: its exponent
    float shrink = intBitsToFloat((127 - min((floatBitsToInt(rho) >> 23) - 127, LEVELS)) << 23);
    return texel * shrink + (shrink < 1.0 ? pages * vec2(1.0, 1.0 - 2.0 * shrink) : vec2(0.0));
}
"""
PLACES = (
    _PLACE
    + """
layout(location = 0) out float column;
layout(location = 1) out float row;
void main() { vec2 place = place_of() - 0.5; column = place.x; row = place.y; }
"""
)
ALL = (
    _PLACE
    + """
uniform vec3 drawn;  // as many pixels, along a side, as show one fewer of the wanted picture; 1 over that; their ratio
flat in uint id;
layout(location = 0) out float column;
layout(location = 1) out float row;
layout(location = 2) out uint number;
layout(location = 3) out float near;
void main() {
    vec2 place = place_of() - 0.5;
    column = place.x; row = place.y; number = id;
    vec2 mine = gl_FragCoord.xy - drawn.x * floor(gl_FragCoord.xy * drawn.y);
    vec2 wanted = floor(mine) - vec2(greaterThan(mine, vec2(0.5 * drawn.x))) + 0.5;
    vec2 aside = wanted * drawn.z - mine;  // to the middle of the wanted pixel
    float w = gl_FragCoord.w + aside.x * dFdx(gl_FragCoord.w) + aside.y * dFdy(gl_FragCoord.w);
    near = id == 0u ? 0.0 : w;
}
"""
)
THROUGH = (
    _PLACE
    + """
flat in uint opacity;
uniform sampler2D atlas;
out vec4 colour;
void main() {
    colour = vec4(textureLod(atlas, place_of() / vec2(textureSize(atlas, 0)), 0.0).rgb, float(opacity) / 255.0);
}
"""
)
NUMBERS = """#version 330
flat in uint id;
layout(location = 0) out uint number;
layout(location = 1) out float near;
void main() { number = id; near = id == 0u ? 0.0 : gl_FragCoord.w; }
"""
