// Drives the graphics card: for a new light, colours of points, by transform feedback; for a new
// view, triangles between them.

// Rows of bits, of which those below others in a face were stored as differences.
function down(bits, n) {
  const width = bits.shape[1] * n;
  for (let row = 1; row < 6 * n; row++) if (row % n)
    for (let i = row * width, end = i + width; i < end; i++) bits[i] ^= bits[i - width];
  return bits;
}

// What textures hold, how it is handed over, and numbers a texel.
const FORMATS = {
  i8x4: "RGBA8I RGBA_INTEGER BYTE 4", u8: "R8UI RED_INTEGER UNSIGNED_BYTE 1", u16: "R16UI RED_INTEGER UNSIGNED_SHORT 1",
  u16x2: "RG16UI RG_INTEGER UNSIGNED_SHORT 2", u16x3: "RGB16UI RGB_INTEGER UNSIGNED_SHORT 3",
  u32: "R32UI RED_INTEGER UNSIGNED_INT 1", f32: "R32F RED FLOAT 1", f32x2: "RG32F RG FLOAT 2", f32x4: "RGBA32F RGBA FLOAT 4",
  shared: "RGB9_E5 RGB UNSIGNED_INT_5_9_9_9_REV 1",
};

class Gpu {
  constructor(gl, arrays, facts) {
    Object.assign(this, {gl, facts, n: facts.n_points, many: max(facts.sources.length, 1)});
    const lines = [`#define MANY ${this.many}`, `#define CURVE ${FILMIC.curve.length}`];
    if (facts.through) lines.push("#define THROUGH");
    if (facts.emission_factor) lines.push("#define EMISSION");
    this.head = HEAD + lines.join("\n") + "\n";
    this.surface = this.program(SURFACE, PAINTED);
    this.sky = this.program(CORNERS, SKY);
    this.feedback = gl.createTransformFeedback();
    this.nothing = gl.createVertexArray();
    this.data = {};
    this.geometry(arrays);
    if (facts.field) this.viewer = new LightField(this, arrays);
    else this.tables(arrays);
    if (facts.gloss) this.viewer = this.gloss = new Gloss(this, arrays);
  }

  program(vertex, fragment) {
    const {gl} = this, program = gl.createProgram();
    const add = (kind, text) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, this.head + text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    };
    const both = [add(gl.VERTEX_SHADER, vertex), add(gl.FRAGMENT_SHADER, fragment || "void main() {}")];
    if (!fragment) gl.transformFeedbackVaryings(program, ["value"], gl.INTERLEAVED_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program) + both.map(s => gl.getShaderInfoLog(s)).join(""));
    const places = {};
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i--;) {
      const {name} = gl.getActiveUniform(program, i);
      places[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
    }
    return {program, places};
  }

  bind(texture, target = this.gl.TEXTURE_2D, unit = 0) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(target, texture);
    this.gl.pixelStorei(this.gl.UNPACK_ALIGNMENT, 1);
  }

  filter(target, kind) {
    for (const name of ["MIN", "MAG"]) this.gl.texParameteri(target, this.gl[`TEXTURE_${name}_FILTER`], kind);
  }

  // A texture of `count` texels a layer, of WIDE a row.
  table(format, data, count, layers = 0) {
    const {gl} = this, [internal, layout, type, size] = FORMATS[format].split(" ").map(name => gl[name] || +name), high = max(1, ceil(count / WIDE));
    const target = layers ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D, texture = gl.createTexture();
    const padded = data && new data.constructor(WIDE * high * size * (layers || 1));
    if (data && layers) for (let k = 0; k < layers; k++) padded.set(data.subarray(k * count, (k + 1) * count), k * WIDE * high);
    else if (data) padded.set(data);
    this.bind(texture, target);
    if (layers) gl.texImage3D(target, 0, internal, WIDE, high, layers, 0, layout, type, padded);
    else gl.texImage2D(target, 0, internal, WIDE, high, 0, layout, type, padded);
    this.filter(target, gl.NEAREST);
    return {texture, target, high, layout, type};
  }

  tables(a) {
    if (ceil(a.weight.length / 4 / WIDE) > this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE))
      fail("This device's graphics hold no tables as large as this bake needs.");
    this.slots = this.program(SLOTS, null);
    this.received = this.program(RECEIVED, null);
    this.sent = this.program(SENT, null);
    this.bits = a.bits && down(a.bits, this.facts.resolution);
    const {facts, n} = this, rank = facts.rank, nSlots = a.cluster.length, quads = ceil(rank / 4);
    const weights = new Int8Array(4 * quads * nSlots), firsts = new Uint32Array(a.rank.length);
    for (let k = 0; k < rank; k++) for (let i = 0; i < nSlots; i++) weights[4 * quads * i + k] = a.weight[k * nSlots + i];
    for (let c = 1; c < firsts.length; c++) firsts[c] = firsts[c - 1] + 1 + a.rank[c - 1];
    const seconds = floats(2 * n), count = facts.sources.length;
    a.border.forEach((point, k) => { seconds[2 * point] = n + k; seconds[2 * point + 1] = a.border_share[k] / 510; });
    const sources = new Uint32Array(max(1, count) * n);
    for (let k = 0; k < count; k++) sources.set(a["source" + k], k * n);
    this.nSlots = nSlots;
    this.quads = quads;
    this.nRows = a.row_step.shape[0];
    Object.assign(this.data, {
      weights: this.table("i8x4", weights, quads * nSlots), clusters: this.table("u16", a.cluster, nSlots),
      firsts: this.table("u32", firsts, firsts.length), products: this.table("f32x4", null, this.nRows),
      seconds: this.table("f32x2", seconds, n), normals: this.table("u16x2", a.normal, n),
      sources: this.table("shared", sources, n, max(1, count)), albedo: this.table("u16x3", a.albedo, n),
      slots: this.target(nSlots), received: this.target(n), radiance: this.target(n),
      bits: this.table("u8", null, facts.bits ? 16 * a.bits.shape[1] : 1),
    });
    this.data.shown = this.data.radiance;
    if (facts.through) Object.assign(this.data, {through: this.table("u16x3", a.through, n), opposite: this.table("u32", a.opposite, n)});
    if (facts.emission_factor) Object.assign(this.data, {emission: this.table("shared", a.emission, n), emitter: this.table("u8", a.emitter, n)});
  }

  // A table that a pass writes, by way of a buffer.
  target(count) {
    const {gl} = this, table = this.table("f32x4", null, count), buffer = gl.createBuffer();
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, buffer);
    gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 16 * WIDE * table.high, gl.DYNAMIC_COPY);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
    return Object.assign(table, {buffer, count});
  }

  geometry(a) {
    const {gl, n, facts} = this, more = facts.n_between, positions = floats(3 * (n + more));
    for (let b = 0, i = 0; b < a.box_start.length; b++)
      for (const end = a.box_start[b + 1] ?? n; i < end; i++) for (let c = 0; c < 3; c++)
        positions[3 * i + c] = a.box[6 * b + c] + a.box[6 * b + 3 + c] * a.position[3 * i + c];
    const between = floats(8 * more);
    for (let i = 0; i < more; i++) for (let c = 0; c < 3; c++) {
      positions[3 * (n + i) + c] = a.between_box[c] + a.between_box[3 + c] * a.between_position[3 * i + c];
      between[8 * i + c] = a.between[3 * i + c];
      between[8 * i + 4 + c] = a.between_weight[3 * i + c] / 65535;
      between[8 * i + 3] = a.between_opacity[i] / 255;
    }
    this.data.between = this.table("f32x4", between, 2 * more);
    const m = facts.n_triangles, indices = new Uint32Array(3 * m);
    for (let t = 0; t < m; t++) {
      indices[3 * t] = a.triangle[t];
      indices[3 * t + 1] = a.triangle[t] + a.corner[t];
      indices[3 * t + 2] = a.triangle[t] + a.corner[m + t];
    }
    this.mesh = gl.createVertexArray();
    gl.bindVertexArray(this.mesh);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.positions = positions;
  }

  // Give a program its tables and numbers.
  use({program, places}, tables, numbers) {
    const {gl} = this;
    gl.useProgram(program);
    let unit = 0;
    for (const name of tables) if (places[name] && this.data[name]) {
      this.bind(this.data[name].texture, this.data[name].target, unit);
      gl.uniform1i(places[name], unit++);
    }
    for (const [name, [kind, ...value]] of Object.entries(numbers)) if (places[name]) {
      if (kind.startsWith("Matrix")) gl["uniform" + kind](places[name], false, value[0]);
      else gl["uniform" + kind](places[name], value[0]);
    }
  }

  run(program, tables, numbers, name, mesh = this.nothing) {
    const {gl} = this, {texture, buffer, count, high} = this.data[name], kind = gl.TRANSFORM_FEEDBACK, to = gl.TRANSFORM_FEEDBACK_BUFFER;
    this.use(program, tables, numbers);
    gl.bindVertexArray(mesh);
    gl.bindTransformFeedback(kind, this.feedback);
    gl.bindBufferBase(to, 0, buffer);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, count);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(to, 0, null);
    gl.bindTransformFeedback(kind, null);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, buffer);
    this.bind(texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDE, high, gl.RGBA, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
  }

  // Put some values into a table, from its first texel on.
  fill(name, data, size) {
    const {gl} = this, {texture, high, layout, type} = this.data[name];
    const whole = this.data[name].whole ||= new data.constructor(WIDE * high * size);
    whole.set(data);
    this.bind(texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDE, high, layout, type, whole);
  }

  // A new light from far away: what `Evaluator.under` gives; null: none.
  setDistant(distant) {
    this.ways = floats(48);
    this.suns = floats(48);
    this.nBright = distant ? distant.bright.length : 0;
    this.fill("products", distant ? distant.products : floats(4 * this.nRows), 4);
    if (this.nBright) {
      const width = this.bits.shape[1], rows = new Uint8Array(16 * width);
      distant.bright.forEach(({texel, radiance}, k) => {
        rows.set(this.bits.subarray(texel * width, (texel + 1) * width), k * width);
        this.ways.set(texelVector(texel, this.facts.resolution).map(x => x / PI), 3 * k);
        this.suns.set(radiance, 3 * k);
      });
      this.fill("bits", rows, 1);
    }
    this.run(this.slots, ["weights", "clusters", "firsts", "products"], {quads: ["1i", this.quads]}, "slots");
  }

  // Strengths of the environment and of the scene's own lights.
  setStrengths(environment, strengths) {
    const scaled = floats(this.many), own = floats(this.many);
    strengths.forEach((s, k) => {
      scaled[k] = s / this.facts.sources[k].factor;
      own[k] = s / this.facts.emission_factor;
    });
    this.run(this.received, ["slots", "seconds", "normals", "bits", "sources"], {
      strengths: ["1fv", scaled], many: ["1i", strengths.length], bright: ["1i", this.nBright],
      rowBytes: ["1i", this.bits ? this.bits.shape[1] : 1], ways: ["3fv", this.ways], suns: ["3fv", this.suns],
      environment: ["1f", environment],
    }, "received");
    this.run(this.sent, ["received", "albedo", "through", "opposite", "emission", "emitter"], {
      most: ["1f", this.facts.albedo], mostThrough: ["1f", this.facts.through || 0],
      strengths: ["1fv", own], n: ["1i", this.n],
    }, "radiance");
    if (this.gloss) this.gloss.settle(environment, strengths);
  }

  // Radiance of all points, four numbers each, read back.
  radiance() {
    const {gl} = this, out = floats(4 * this.n);
    gl.bindBuffer(gl.COPY_READ_BUFFER, this.data.shown.buffer);
    gl.getBufferSubData(gl.COPY_READ_BUFFER, 0, out);
    gl.bindBuffer(gl.COPY_READ_BUFFER, null);
    return out;
  }

  // The image that is seen behind the scene.
  setSky(image) {
    const {gl} = this, most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const step = ceil(image.width / min(most, WIDE)), width = floor(image.width / step), height = floor(image.height / step);
    const data = floats(3 * width * height);
    for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) for (let c = 0; c < 3; c++)
      data[3 * (y * width + x) + c] = min(image.pixels[3 * (y * step * image.width + x * step) + c], 6e4);
    if (this.data.image) gl.deleteTexture(this.data.image.texture);
    const texture = gl.createTexture();
    this.bind(texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB16F, width, height, 0, gl.RGB, gl.FLOAT, data);
    this.filter(gl.TEXTURE_2D, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.data.image = {texture, target: gl.TEXTURE_2D};
  }

  // One picture. `look`: exposure as a factor, filmic; `sky`: turn in degrees and strength, or null.
  draw({matrix, rays, eye}, look, sky) {
    const {gl, facts} = this, {width, height} = gl.canvas, {inset, outset, curve} = FILMIC;
    const shown = {exposure: ["1f", look.exposure], filmic: ["1i", look.filmic ? 1 : 0], inset: ["Matrix3fv", inset],
      outset: ["Matrix3fv", outset], curve: ["1fv", curve]};
    if (this.viewer) this.viewer.look(eye);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.CULL_FACE);
    if (sky && this.data.image) {
      gl.disable(gl.DEPTH_TEST);
      this.use(this.sky, ["image"], {...shown, rays: ["Matrix3fv", rays], turn: ["1f", sky.turn * PI / 180], strength: ["1f", sky.strength]});
      gl.bindVertexArray(this.nothing);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.mesh);
    const values = {...shown, view: ["Matrix4fv", matrix], n: ["1i", this.n]};
    gl.enable(gl.CULL_FACE);
    gl.cullFace(gl.BACK);
    this.use(this.surface, ["shown", "between"], {...values, back: ["1i", 0]});
    gl.drawElements(gl.TRIANGLES, 3 * facts.n_triangles, gl.UNSIGNED_INT, 0);
    // Backs without points, a little behind the fronts that they meet at an outline.
    gl.cullFace(gl.FRONT);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(2, 8);
    this.use(this.surface, ["shown", "between"], {...values, back: ["1i", 1]});
    gl.drawElements(gl.TRIANGLES, 3 * facts.n_single, gl.UNSIGNED_INT, 0);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.bindVertexArray(null);
  }
}
