// What the graphics card does, in its own language. Tables are textures, WIDE texels a row, looked up
// by number; points have no attributes but their number.
const WIDE = 4096;

const HEAD = `#version 300 es
precision highp float; precision highp sampler2D; precision highp isampler2D;
precision highp usampler2D; precision highp sampler2DArray;
ivec2 at(int i) { return ivec2(i & ${WIDE - 1}, i / ${WIDE}); }
#define ID gl_VertexID
#define get(table, i) texelFetch(table, at(i), 0)
vec3 unfolded(uvec2 code) {
  vec2 p = vec2(code) / 16383. * 2. - 1.;
  vec3 n = vec3(p, 1. - abs(p.x) - abs(p.y));
  if (n.z < 0.) n.xy = (1. - abs(n.yx)) * vec2(n.x < 0. ? -1. : 1., n.y < 0. ? -1. : 1.);
  return normalize(n);
}
`;

// What a cluster gives to a slot: its mean and weighted components, under the light.
const SLOTS = `uniform isampler2D weights; uniform usampler2D clusters, firsts; uniform sampler2D products;
uniform int quads; out vec4 value;
vec3 row(int i) { return get(products, i).rgb; }
void main() {
  int cluster = int(get(clusters, ID).r);
  int i = int(get(firsts, cluster).r);
  vec3 sum = row(i++);
  for (int k = 0; k < quads; k++, i += 4) {
    vec4 w = vec4(get(weights, ID * quads + k));
    sum += w.x * row(i) + w.y * row(i + 1) + w.z * row(i + 2) + w.w * row(i + 3);
  }
  value = vec4(sum, 0);
}`;

// What points receive: of their cluster and the next one, the brightest texels, the scene's lights.
const RECEIVED = `uniform sampler2D slots, seconds; uniform usampler2D normals, bits;
uniform sampler2DArray sources; uniform float strengths[MANY]; uniform int many;
uniform int bright, rowBytes; uniform vec3 ways[16], suns[16]; uniform float environment;
out vec4 value;
void main() {
  int i = ID;
  vec3 sum = get(slots, i).rgb, normal = unfolded(get(normals, i).rg);
  vec2 second = get(seconds, i).rg;
  if (second.y > 0.) sum = mix(sum, get(slots, int(second.x)).rgb, second.y);
  for (int k = 0; k < bright; k++) {
    uint byte = get(bits, k * rowBytes + i / 8).r;
    if ((byte >> uint(i & 7) & 1u) == 1u) sum += dot(normal, ways[k]) * suns[k];
  }
  sum *= environment;
  for (int k = 0; k < many; k++)
    if (strengths[k] != 0.) sum += strengths[k] * texelFetch(sources, ivec3(at(i), k), 0).rgb;
  value = vec4(sum, 0);
}`;

// What points send of what they and their backs receive, and of their own.
const SENT = `uniform sampler2D received, emission; uniform usampler2D albedo, through, opposite, emitter;
uniform float most, mostThrough, strengths[MANY]; uniform int n; out vec4 value;
vec3 share(usampler2D table, float most) {
  vec3 root = vec3(texelFetch(table, at(ID), 0).rgb) / 4095.;
  return root * root * most;
}
void main() {
  vec3 sum = share(albedo, most) * get(received, ID).rgb;
#ifdef THROUGH
  int behind = int(get(opposite, ID).r);
  if (behind < n) sum += share(through, mostThrough) * get(received, behind).rgb;
#endif
#ifdef EMISSION
  int source = int(get(emitter, ID).r);
  if (source < MANY) sum += strengths[source] * get(emission, ID).rgb;
#endif
  value = vec4(sum, 1);
}`;

// Linear colours as a screen shows them. `curve`: what a channel becomes, by its logarithm.
const SHOWN = `uniform float exposure, curve[CURVE]; uniform bool filmic; uniform mat3 inset, outset;
float along(float x) {
  float place = clamp((log2(max(x, 1e-10)) + 12.) / 18., 0., 1.) * float(CURVE - 1);
  int i = min(int(place), CURVE - 2);
  return mix(curve[i], curve[i + 1], place - float(i));
}
vec3 shown(vec3 linear) {
  vec3 c = max(linear, 0.) * exposure;
  if (filmic) {
    c = inset * c;
    return clamp(outset * vec3(along(c.x), along(c.y), along(c.z)), 0., 1.);
  }
  c = min(c, 1.);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1. / 2.4)) - 0.055, step(0.0031308, c));
}
`;

// Corners that lie between points, of pieces of what lets light pass, take from three of them.
const SURFACE = `layout(location = 0) in vec3 position; uniform mat4 view; uniform sampler2D shown, between;
uniform int n; centroid out vec3 colour; centroid out float opacity;
void main() {
  gl_Position = view * vec4(position, 1);
  opacity = 1.;
  if (ID < n) { colour = get(shown, ID).rgb; return; }
  int i = 2 * (ID - n);
  vec4 around = get(between, i), w = get(between, i + 1);
  colour = w.x * get(shown, int(around.x)).rgb
    + w.y * get(shown, int(around.y)).rgb
    + w.z * get(shown, int(around.z)).rgb;
  opacity = around.w;
}`;
const PAINTED = SHOWN + `centroid in vec3 colour; centroid in float opacity; uniform bool back; out vec4 pixel;
void main() {
  ivec2 p = ivec2(gl_FragCoord.xy) & 3;
  int a = p.x ^ p.y, order = (a & 1) << 3 | (p.y & 1) << 2 | (a & 2) | (p.y & 2) >> 1;
  if (opacity <= (float(order) + 0.5) / 16.) discard;
  pixel = vec4(back ? vec3(0) : shown(colour), 1);
}`;

const CORNERS = `uniform mat3 rays; out vec3 way;
void main() {
  vec2 p = vec2(ID == 1 ? 3 : -1, ID == 2 ? 3 : -1);
  way = rays * vec3(p, 1);
  gl_Position = vec4(p, 1, 1);
}`;
const SKY = SHOWN + `in vec3 way; uniform sampler2D image; uniform float turn, strength; out vec4 pixel;
void main() {
  vec3 w = normalize(way);
  vec2 place = vec2(0.5 - (atan(w.y, w.x) - turn) / 6.2831853, 0.5 - asin(clamp(w.z, -1., 1.)) / 3.1415927);
  pixel = vec4(shown(textureLod(image, place, 0.).rgb * strength), 1);
}`;
