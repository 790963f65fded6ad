// Gloss on the graphics card. Blocks of directions are a tree, as are the nodes of the field: TOP of
// the largest, LEVELS sizes, each node's four quarters one after the other in the next size; narrow
// lobes have one size more. See prt_core/transport/incoming_field.py and glossy_view.py.
const TREE = `
precision highp int;
#define first(level) (TOP * ((1 << 2 * (level)) - 1) / 3)
#define DEEP (LEVELS - 1)
#define BLOCKS (TOP << 2 * DEEP)
#define NODES first(LEVELS)
#define NARROW first(LEVELS + 1)
// Lobes are wide (0) or narrow (1), and each have a light of their own.
uniform ivec2 bases, tables, details, brights, nBright;
int W;
#define OWN(each) (W == 1 ? each.y : each.x)
#define NODE(node) (OWN(bases) + 2 * (node))
int startOf(int row) { return row < WIDE_ROWS ? row * NODES : WIDE_ROWS * NODES + (row - WIDE_ROWS) * NARROW; }
`;

// A colour in 32 bits, as RGB9_E5 has it.
const SHARED = `
uint coded(vec3 c) {
  float most = max(max(c.r, c.g), max(c.b, 1e-9));
  int e = clamp(int(floor(log2(most))) + 16, 0, 31);
  if (floor(most * exp2(float(24 - e)) + 0.5) > 511.) e++;
  uvec3 m = uvec3(min(floor(c * exp2(float(24 - e)) + 0.5), 511.));
  return m.r | m.g << 9 | m.b << 18 | uint(e) << 27;
}
vec3 whole(uint c) { return vec3(c & 511u, c >> 9 & 511u, c >> 18 & 511u) * exp2(float(c >> 27) - 24.); }
`;

// The mean of what the points of a patch send.
const PATCH = `uniform sampler2D radiance; uniform usampler2D patches; out vec4 value;
void main() {
  int i = int(get(patches, ID).r), end = int(get(patches, ID + 1).r);
  vec3 sum = vec3(0);
  for (int k = i; k < end; k++) sum += get(radiance, k).rgb;
  value = vec4(sum / float(end - i), 0);
}`;

// The field: of each node of a row the mean of the light from there, of the sky by the bits of four
// texels or cells of a block at once, and of what is in the way.
const CORNER = `void main() { gl_Position = vec4(ID == 1 ? 3 : -1, ID == 2 ? 3 : -1, 0, 1); }`;
const FIELD = TREE + SHARED + `uniform usampler2D codes, near; uniform sampler2D light, sends, glimpsed;
uniform float environment, scale; out uint value;
vec3 sky(int block, int quad, uint bits) { return get(light, OWN(tables) + (block * QUADS + quad) * 16 + int(bits)).rgb * environment; }
// What is in the way of a block, or of a quarter of it, in parts of what is not open.
vec3 behind(int block, int k, int row) {
  int narrow = ROWS - WIDE_ROWS;
  uint code = get(near, W == 0 ? block * WIDE_ROWS + row : BLOCKS * WIDE_ROWS + (4 * block + k) * narrow + row - WIDE_ROWS).r;
  int i = int(code & 0x3fffffffu) - 1;
  vec3 from = i < 0 ? vec3(0) : i < PATCHES ? get(sends, i).rgb : get(glimpsed, i - PATCHES).rgb;
  return from * float(code >> 30) / 3.;
}
float open(uint bits) { return float((bits & 1u) + (bits >> 1 & 1u) + (bits >> 2 & 1u) + (bits >> 3 & 1u)) / 4.; }
// The bits of a quarter: four of its own, or one of the block's four.
uint quarter(uint code, int k) { return QUADS == 4 ? code >> uint(4 * k) & 15u : (code >> uint(k) & 1u) * 15u; }
float solid(int node) { return get(light, NODE(node) + 1).w; }
void main() {
  int e = int(gl_FragCoord.y) * ${WIDE} + int(gl_FragCoord.x), wide = WIDE_ROWS * NODES, row, node;
  value = 0u;
  if (e < wide) { row = e / NODES; node = e % NODES; }
  else { row = WIDE_ROWS + (e - wide) / NARROW; node = (e - wide) % NARROW; }
  if (row >= ROWS) return;
  W = row < WIDE_ROWS ? 0 : 1;
  vec3 sum = vec3(0);
  int level = 0;
  if (node >= NODES) {
    int q = node - NODES, block = q >> 2, k = q & 3;
    uint bits = quarter(get(codes, block * ROWS + row).r, k);
    // The table has the light of a block's part over the area of the block.
    sum = sky(block, QUADS == 4 ? k : 0, QUADS == 4 ? bits : bits & uint(1 << k)) * solid(first(DEEP) + block) / solid(node)
      + (1. - open(bits)) * behind(block, k, row);
    value = coded(sum * scale);
    return;
  }
  while (node >= first(level + 1)) level++;
  int shift = 2 * (DEEP - level), block = (node - first(level)) << shift, n = 1 << shift;
  float area = 0.;
  for (int b = block; b < block + n; b++) {
    uint code = get(codes, b * ROWS + row).r;
    float angle = solid(first(DEEP) + b), seen = 0.;
    vec3 here = vec3(0), hid = vec3(0);
    for (int q = 0; q < QUADS; q++) {
      uint bits = code >> uint(4 * q) & 15u;
      here += sky(b, q, bits);
      seen += CELLS == 1 ? float(bits & 1u) : open(bits) / float(QUADS);
    }
    if (seen < 1.) {
      if (W == 0) here += (1. - seen) * behind(b, 0, row);
      else for (int k = 0; k < 4; k++) hid += (1. - open(quarter(code, k))) * solid(NODES + 4 * b + k) * behind(b, k, row);
    }
    sum += angle * here + hid;
    area += angle;
  }
  value = coded(sum / area * scale);
}`;

// Lobes over the field, GGX as Cycles has it. N, O, H: normal, way to the viewer, their cosine.
const LOBES_OVER = TREE + SHARED + `uniform usampler2D codes, field, glossRow, normals, brightBits, surfaces;
uniform sampler2D light, matter, radiance, received; uniform float environment, scale;
uniform int rowBytes;
vec3 N, O, P[4]; float H, own, A;
// Of the cosine between light and facet.
vec3 fresnel(float facet) {
  float rest = max(1. - facet, 0.), square = rest * rest, fifth = square * square * rest;
  return P[0] + fifth * P[1] + square * P[2] + facet * rest * fifth * P[3];
}
vec3 lobe(vec3 way, float spread) {
  float c = dot(N, way);
  if (c <= 0.) return vec3(0);
  float s = max(2. * dot(O, way) + 2., 1e-6), sum = c + H, q = max(sum * sum * (A - 1.) + s, 1e-12) / s;
  float reach = min(spread * (1. + 4. / s), A);
  return fresnel(0.5 * sqrt(s)) * c * A / (6.2831853 * (q * (q - reach) + 1.5 * A * reach) * (c * own + H * sqrt(c * c * (1. - A) + A)));
}
void widen(float alpha) {
  A = alpha * alpha;
  own = sqrt(A + (1. - A) * H * H);
}
// Of the brightest texels.
vec3 glints(int i) {
  vec3 sum = vec3(0);
  for (int b = 0; b < OWN(nBright); b++) {
    uint byte = get(brightBits, (MOST_GLINTS * W + b) * rowBytes + i / 8).r;
    if ((byte >> uint(i & 7) & 1u) == 1u)
      sum += lobe(get(light, OWN(brights) + 2 * b).xyz, 0.) * get(light, OWN(brights) + 2 * b + 1).rgb * environment;
  }
  return sum;
}
vec3 over(int i, int row, float alpha) {
  widen(alpha);
  vec3 mirror = 2. * H * N - O, sum = vec3(0);
  float width = min(2. * alpha, 0.5) * (H < 0.2 ? 0.35 : H < 0.45 ? 0.7 : 1.), square = width * width;
  bool narrow = row >= WIDE_ROWS;
  W = narrow ? 1 : 0;
  int deepest = narrow ? LEVELS : DEEP, count = TOP << 2 * deepest, start = startOf(row);
  for (int k = 0; k < count;) {
    int level = deepest, node;
    while (level > 0 && (k & ((4 << 2 * (deepest - level)) - 1)) == 0) level--;
    vec4 middle;
    float away;
    for (;; level++) {
      node = first(level) + (k >> 2 * (deepest - level));
      middle = get(light, NODE(node) + 1);
      away = max(acos(clamp(dot(middle.xyz, mirror), -1., 1.)) - 0.1, 0.);
      if (level == deepest || middle.w <= 0.16 * (square + away * away)) break;
    }
    k += 1 << 2 * (deepest - level);
    vec3 here = whole(get(field, start + node).r) / scale;
#if PARTS > 1
    if (narrow && level == deepest && middle.w > 0.25 * (square + away * away)) {
      int q = node - first(level), block = q >> 2;
      uint code = get(codes, block * ROWS + row).r;
      uint bits = QUADS == 4 ? code >> uint(4 * (q & 3)) & 15u : (code >> uint(q & 3) & 1u) * 15u;
      float open = float((bits & 1u) + (bits >> 1 & 1u) + (bits >> 2 & 1u) + (bits >> 3 & 1u)) / 4. * environment;
      for (int j = OWN(details) + 2 * q * PARTS * PARTS, end = j + 2 * PARTS * PARTS; j < end; j += 2) {
        vec4 way = get(light, j);
        sum += lobe(way.xyz, way.w / 12.) * way.w * (here + open * get(light, j + 1).rgb);
      }
      continue;
    }
#endif
    vec4 way = get(light, NODE(node));
    sum += lobe(way.xyz, way.w) * middle.w * here;
  }
  return max(sum + glints(i), 0.);
}
#define SURFACE (2 + 4 * LOBES)
const int GROUP[LOBES] = int[](GROUPS);
// What a point reflects, and what is left of its diffuse light.
int surface, factors; float share;
vec3 factor(int l) { return mix(get(matter, factors + l).rgb, get(matter, factors + l + LOBES + 1).rgb, share); }
void prepare(int i) {
  N = unfolded(get(normals, i).rg);
  surface = int(get(surfaces, i).r) * SURFACE;
}
void look(vec3 outgoing) {
  O = outgoing;
  H = dot(N, O);
  float place = sqrt(clamp(H, 0., 1.)) * float(KNOTS - 1);
  int low = min(int(place), KNOTS - 2);
  share = place - float(low);
  factors = SURFACES * SURFACE + (int(get(matter, surface).z) * KNOTS + low) * (LOBES + 1);
}
void powers(int group) {
  for (int k = 0; k < 4; k++) P[k] = vec3(0);
  for (int l = 0; l < LOBES; l++) if (GROUP[l] == group) {
    vec3 f = factor(l);
    for (int k = 0; k < 4; k++) P[k] += f * get(matter, surface + 2 + 4 * l + k).rgb;
  }
}
bool has(int group) {
  powers(group);
  return P[0] + P[1] + P[2] + P[3] != vec3(0);
}
// What is sent evenly to all sides, without the colour that stands in for gloss.
vec3 even(int i) { return get(radiance, i).rgb - get(matter, surface + 1).rgb * get(received, i).rgb; }
`;

// What metal sends to each block of directions from which others see it: four facets of each lobe
// mirror what they face, and the brightest texels. See prt_core/transport/glimpse.py.
const FACETS = LOBES_OVER + `uniform usampler2D middles, glimpses, dice, metals; uniform sampler2D sends; uniform int sweep;
out vec4 value;
vec3 middleOf(int block, int side) {
  vec2 p = (vec2(block % side, block / side % side) + 0.5) / float(side) * 2. - 1.;
  int face = block / (side * side);
  float s = (face & 1) == 0 ? 1. : -1.;
  return normalize(face < 2 ? vec3(s, s * p.x, p.y) : face < 4 ? vec3(-s * p.x, s, p.y) : vec3(p.x, s * p.y, s));
}
// The smallest node of a row in a direction.
int nodeAlong(vec3 d) {
  vec3 a = abs(d);
  int deep = DEEP + W, side = SIDE << W, face, node;
  vec2 p;
  if (a.x >= a.y && a.x >= a.z) { face = d.x < 0. ? 1 : 0; p = vec2(d.y / d.x, d.z / a.x); }
  else if (a.z > a.x && a.z > a.y) { face = d.z < 0. ? 5 : 4; p = vec2(d.x / a.z, d.y / d.z); }
  else { face = d.y < 0. ? 3 : 2; p = vec2(-d.x / d.y, d.z / a.y); }
  ivec2 place = clamp(ivec2((p * 0.5 + 0.5) * float(side)), 0, side - 1);
  node = (face * TOPS + (place.y >> deep)) * TOPS + (place.x >> deep);
  for (int l = deep - 1; l >= 0; l--) node = 4 * node + 2 * (place.y >> l & 1) + (place.x >> l & 1);
  return first(deep) + node;
}
const vec2 PLACES[4] = vec2[](vec2(0), vec2(0.5), vec2(0.75, 0.25), vec2(0.25, 0.75));
// What a lobe reflects of a field by facets that are seen from `view`, in the frame of the point.
vec3 mirrored(int row, mat3 frame, vec3 view, vec2 shift) {
  float a = sqrt(A);
  vec3 sum = vec3(0), wide = normalize(view * vec3(a, a, 1));
  for (int k = 0; k < 4; k++) {
    float up = 1. - fract(PLACES[k].x + shift.x) * (1. + wide.z), turn = 6.2831853 * (PLACES[k].y + shift.y);
    vec3 facet = vec3(a * (wide.xy + sqrt(max(1. - up * up, 0.)) * vec2(cos(turn), sin(turn))), max(up + wide.z, 1e-6));
    facet = normalize(facet);
    vec3 way = 2. * dot(view, facet) * facet - view;
    if (way.z <= 0.) continue;
    vec2 z = max(vec2(view.z, way.z), 1e-3), masked = sqrt(1. - A + A / (z * z));
    float weight = (1. + masked.x) / (masked.x + masked.y) / 4.;
    sum += weight * fresnel(dot(view, facet)) * whole(get(field, startOf(row) + nodeAlong(frame * way)).r) / scale;
  }
  return sum;
}
void main() {
  int code = int(get(glimpses, ID).r), metal = code / (5 * BLOCKS), block = code % (5 * BLOCKS);
  if (sweep == 0) {
    value = get(sends, int(get(metals, metal).r));
    return;
  }
  int i = int(get(middles, metal).r), row = int(get(glossRow, i).r) - 1;
  prepare(i);
  W = row < WIDE_ROWS ? 0 : 1;
  vec3 way = -(block < BLOCKS ? middleOf(block, SIDE) : middleOf(block - BLOCKS, 2 * SIDE));
  look(way);
  O = normalize(way + max(0.05 - H, 0.) * N);
  H = dot(N, O);
  float s = N.z >= 0. ? 1. : -1., a = -1. / (s + N.z), b = N.x * N.y * a;
  mat3 frame = mat3(1. + s * N.x * N.x * a, s * b, -s * N.x, b, s + N.y * N.y * a, -N.y, N);
  // Steps of the golden ratio's kin, one for each.
  vec2 shift = vec2(get(dice, ID).r * uvec2(3242174889u, 2447445414u) >> 8) / 16777216.;
  vec3 sum = even(i);
  for (int g = 0; g < 2; g++) if (has(g)) {
    widen(max(get(matter, surface)[g], 0.1));
    sum += mirrored(row, frame, O * frame, shift) + glints(i);
  }
  value = vec4(max(sum, 0.), 0);
}`;

// What each point shows to the eye. Lamps: where they are and how wide, their axis.
const GLOSSED = LOBES_OVER + `layout(location = 0) in vec3 position; uniform vec3 eye;
uniform sampler2D emission; uniform usampler2D emitter; uniform sampler2DArray direct;
uniform float strengths[MANY], lit[MANY]; uniform vec4 lamps[2 * MANY]; uniform int nLamps;
out vec4 value;
vec3 highlight(int i, int l) {
  vec3 light = lit[l] * texelFetch(direct, ivec3(at(i), l), 0).rgb;
  if (light == vec3(0)) return light;
  vec4 place = lamps[2 * l], axis = lamps[2 * l + 1];
  vec3 way = axis.w < 0. ? place.xyz : place.xyz - position;
  float far = max(length(way), 1e-9), angle = place.w;
  way /= far;
  if (axis.w >= 0.) angle = atan(axis.w > 0. ? sqrt(place.w * abs(dot(way, axis.xyz)) / 3.1415927) : place.w, far);
  float c = dot(N, way);
  vec3 sum = vec3(0);
  if (c <= 0.) return sum;
  for (int g = 0; g < 2; g++) {
    powers(g);
    A = min(get(matter, surface)[g], 1.);
    A = min(A * A + angle * angle / 8., 1.);
    own = sqrt(A + (1. - A) * H * H);
    sum += max(lobe(way, 0.), 0.) / c;
  }
  return 3.1415927 * light * sum;
}
void main() {
  int i = ID, row = int(get(glossRow, i).r) - 1;
  value = vec4(get(radiance, i).rgb, 1);
  if (row < 0) return;
  prepare(i);
  look(normalize(eye - position));
  vec3 shining = vec3(0), plain = even(i);
#ifdef EMISSION
  int source = int(get(emitter, i).r);
  if (source < MANY) shining = strengths[source] * get(emission, i).rgb;
#endif
  value.rgb = plain;
  if (H <= 0.) return;
  value.rgb = (plain - shining) * factor(LOBES) + shining;
  for (int g = 0; g < 2; g++) if (has(g)) value.rgb += over(i, row, get(matter, surface)[g]);
  for (int l = 0; l < nLamps; l++) value.rgb += highlight(i, l);
}`;
