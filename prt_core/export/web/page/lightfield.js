// A light field: what leaves each point to each cell of its hemisphere, of each light, in eight bits.
const TOWARD = `layout(location = 0) in vec3 position; uniform vec3 eye, weights[LAMPS]; uniform usampler2D fieldRow, fieldFrames;
uniform sampler2D most; uniform highp usampler2DArray sums, shares; out vec4 value;
#define QUARTERS ((ROWS + 1) / 2 * ((COLUMNS + 1) / 2))
vec3 cell(int row, ivec2 p, int l) {
  float root = float(texelFetch(sums, ivec3(at((p.x * COLUMNS + p.y) * POINTS + row), l), 0).r) / 255.;
  int quarter = p.x / 2 * ((COLUMNS + 1) / 2) + p.y / 2;
  float red = float(texelFetch(shares, ivec3(at(2 * quarter * POINTS + row), l), 0).r) / 255.;
  float blue = float(texelFetch(shares, ivec3(at((2 * quarter + 1) * POINTS + row), l), 0).r) / 255.;
  return root * root * root * vec3(red, 1. - red - blue, blue);
}
void main() {
  int row = int(get(fieldRow, ID).r) - 1;
  value = vec4(vec3(0.05), 1);
  if (row < 0) return;
  vec3 z = unfolded(get(fieldFrames, 2 * row).rg), x = unfolded(get(fieldFrames, 2 * row + 1).rg), o = normalize(eye - position);
  o = vec3(dot(o, x), dot(o, cross(z, x)), dot(o, z));
  // The concentric map of the hemisphere to the square.
  vec2 a = abs(o.yx);
  float high = max(a.x, a.y), radius = sqrt(clamp(1. - o.z, 0., 1.));
  float share = high > 0. ? atan(min(a.x, a.y), high) * 1.2732395 * radius : 0.;
  vec2 p = a.y == high ? vec2(share, radius) : vec2(radius, share);
  p *= vec2(o.y < 0. ? -1. : 1., o.x < 0. ? -1. : 1.);
  vec2 size = vec2(ROWS, COLUMNS);
  p = clamp((p * size + size - 1.) / 2., vec2(0), size - 1.);
  ivec2 low = min(ivec2(p), max(ivec2(size) - 2, 0)), next = min(low + 1, ivec2(size) - 1);
  vec2 f = p - vec2(low);
  vec3 sum = vec3(0);
  for (int l = 0; l < LAMPS; l++) if (weights[l] != vec3(0)) {
    vec3 mean = mix(mix(cell(row, low, l), cell(row, ivec2(low.x, next.y), l), f.y),
      mix(cell(row, ivec2(next.x, low.y), l), cell(row, next, l), f.y), f.x);
    sum += weights[l] * get(most, l * POINTS + row).r * mean;
  }
  value = vec4(sum, 1);
}`;

class LightField {
  constructor(gpu, arrays) {
    const {rows, columns, points, lights} = gpu.facts.field, n = gpu.n, many = lights.length, {head} = gpu;
    const quarters = ceil(rows / 2) * ceil(columns / 2), cells = rows * columns * points, most = gpu.gl.getParameter(gpu.gl.MAX_TEXTURE_SIZE);
    if (cells / WIDE > most) fail("This device's graphics hold no tables as large as this light field needs.");
    const joined = (name, size) => {
      const all = new Uint8Array(many * size);
      for (let l = 0; l < many; l++) all.set(arrays[name + l], l * size);
      return gpu.table("u8", all, size, many);
    };
    gpu.head += `#define ROWS ${rows}\n#define COLUMNS ${columns}\n#define POINTS ${points}\n#define LAMPS ${many}\n`;
    this.toward = gpu.program(TOWARD, null);
    gpu.head = head;
    this.gpu = gpu;
    this.weights = floats(3 * many).fill(1);
    Object.assign(gpu.data, {fieldRow: gpu.table("u32", arrays.field_row, n), fieldFrames: gpu.table("u16x2", arrays.field_frame, 2 * points),
      most: gpu.table("f32", arrays.field_most, many * points), sums: joined("field_sum", cells), shares: joined("field_share", 2 * quarters * points),
      shown: gpu.target(n)});
  }

  look(eye) {
    this.gpu.run(this.toward, ["fieldRow", "fieldFrames", "most", "sums", "shares"],
      {eye: ["3fv", eye], weights: ["3fv", this.weights]}, "shown", this.gpu.mesh);
  }

  // A slider and a colour of each light.
  controls(page) {
    const box = document.createElement("fieldset"), {lights} = this.gpu.facts.field;
    box.append(Object.assign(document.createElement("legend"), {textContent: "Lights of the light field"}));
    lights.forEach((name, l) => {
      const colour = Object.assign(document.createElement("input"), {type: "color", value: "#ffffff", title: `Colour of ${name}`});
      const change = () => {
        const codes = [1, 3, 5].map(c => parseInt(colour.value.slice(c, c + 2), 16) / 255);
        codes.forEach((c, k) => this.weights[3 * l + k] = slider.value * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
        page.later("draw");
      };
      const slider = page.slider(box, name === "all" ? "All lights" : name, 1, change);
      colour.oninput = change;
      slider.parentNode.append(colour);
    });
    $("of-scene").after(box);
    page.images.get(page.add("Light field", null, null)).field = this;
    this.show = is => {
      box.hidden = !is;
      for (const id of ["turn", "strength", "file", "sky"]) $(id).closest("label").hidden = is;
    };
  }
}
