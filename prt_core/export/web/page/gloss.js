// Gloss: the light of a page as a tree of blocks, and the passes that make views of it.
const BRIGHTER = 8, MOST_GLINTS = 48;

// Where each block of a tree lies, row by row: `levels` sizes, of which the largest is `top` along an
// edge.
function treeOrder(top, levels) {
  const order = new Int32Array(6 * (top << levels - 1) ** 2), side = top << levels - 1;
  for (let i = 0; i < order.length; i++) {
    const largest = i >> 2 * (levels - 1), inside = largest % (top * top);
    let row = inside / top | 0, column = inside % top;
    for (let l = levels - 2; l >= 0; l--) {
      row = 2 * row + (i >> 2 * l + 1 & 1);
      column = 2 * column + (i >> 2 * l & 1);
    }
    order[i] = ((largest / (top * top) | 0) * side + row) * side + column;
  }
  return order;
}

// Sums of fours of numbers, `width` each.
function fours(values, width) {
  const out = new Float64Array(values.length / 4);
  for (let i = 0; i < values.length; i++) out[(i / (4 * width) | 0) * width + i % width] += values[i];
  return out;
}

// Nodes of a row of a tree of so many sizes.
const nodesOf = (top, sizes) => 2 * top ** 2 * (4 ** sizes - 1);

// A light as lobes of one width take it, on texels along `fine` of an edge: nodes of the tree, each
// where its light is; parts of the smallest; the brightest texels; what bits of blocks let through.
class GlossLight {
  constructor({top, levels, cells, n, blocks, side}, met, open, fine, sizes, parts) {
    Object.assign(this, {top, levels, cells, n, met, open, blocks, side, fine, sizes, parts});
    this.lay();
  }

  // What belongs to no light: where blocks and their parts are.
  lay() {
    const {top, levels, cells, sizes, parts, fine} = this, more = max(Math.log2(cells), parts ? 1 + Math.log2(parts) : 0);
    const all = nodesOf(top, sizes), details = parts ? 4 * this.blocks * parts * parts : 0;
    this.details = 2 * all;
    this.brights = this.details + 2 * details;
    this.tables = this.brights + 2 * MOST_GLINTS;
    this.deep = levels + more;
    this.table = floats(4 * (this.tables + this.blocks * max(1, cells * cells / 4) * 16));
    const fill = (at, levels, step) => {
      const order = treeOrder(top, levels), side = top << levels - 1, ways = directions(side), angles = solidAngles(side);
      order.forEach((block, i) => {
        const to = 4 * (at + step * i);
        this.table.set(ways.subarray(3 * block, 3 * block + 3), to);
        this.table[to + 3] = angles[block % (side * side)];
      });
    };
    for (let l = 0, at = 1; l < sizes; at += 2 * 6 * top * top * 4 ** l++) fill(at, l + 1, 2);
    if (parts) fill(this.details, levels + 1 + Math.log2(parts), 2);
    // The smallest part that each texel of the light is in.
    const order = treeOrder(top, this.deep), place = new Int32Array(order.length), side = top << this.deep - 1, step = fine / side;
    order.forEach((block, i) => place[block] = i);
    this.place = new Int32Array(6 * fine * fine);
    for (let i = 0; i < this.place.length; i++) {
      const face = i / (fine * fine) | 0, row = i / fine % fine / step | 0, column = i % fine / step | 0;
      this.place[i] = place[(face * side + row) * side + column];
    }
    this.ways = directions(fine);
    this.angles = solidAngles(fine);
  }

  // The brightest texels, each with what it has more than the mean of the others of its block.
  glints(light) {
    const {fine, angles, place, deep, sizes} = this, n = light.length / 3, value = floats(n), far = 2 * (deep - sizes);
    let mean = 0;
    for (let i = 0; i < n; i++) {
      value[i] = max(light[3 * i], light[3 * i + 1], light[3 * i + 2]);
      mean += value[i] * angles[i % (fine * fine)] / (4 * PI);
    }
    const power = i => value[i] * angles[i % (fine * fine)], chosen = [];
    for (let i = 0; i < n; i++) if (value[i] > BRIGHTER * mean) chosen.push(i);
    chosen.sort((a, b) => power(b) - power(a)).splice(MOST_GLINTS);
    const is = new Set(chosen), sums = new Map(chosen.map(i => [place[i] >> far, [0, 0, 0, 0]]));
    if (chosen.length) for (let i = 0; i < n; i++) {
      const sum = sums.get(place[i] >> far);
      if (sum && !is.has(i)) { for (let c = 0; c < 3; c++) sum[c] += light[3 * i + c]; sum[3]++; }
    }
    return {mean, glints: chosen.map(i => {
      const sum = sums.get(place[i] >> far);
      return [i, [0, 1, 2].map(c => max(0, light[3 * i + c] - sum[c] / max(1, sum[3])))];
    })};
  }

  // Take a light in; `rows` are set to the bits of the brightest texels, `width` bytes each.
  take(light, bits, rows, width) {
    const {table, fine, n, side, top, levels, sizes, parts, cells, place, angles, ways, deep, open, met} = this;
    const {mean, glints} = this.glints(light), rest = light.slice(), step = fine / n;
    table.fill(0, 4 * this.brights, 4 * this.tables);
    glints.forEach(([i, more], k) => {
      const face = i / (fine * fine) | 0, texel = (face * n + (i / fine % fine / step | 0)) * n + (i % fine / step | 0);
      rows.set(bits.subarray(texel * width, (texel + 1) * width), k * width);
      const at = 4 * (this.brights + 2 * k);
      table.set(ways.subarray(3 * i, 3 * i + 3), at);
      for (let c = 0; c < 3; c++) {
        rest[3 * i + c] -= more[c];
        table[at + 4 + c] = more[c] * angles[i % (fine * fine)];
      }
    });
    this.nBright = glints.length;
    this.mean = mean;
    // Of every part: its light, how much of it is met in the mean and where that comes from.
    let sums = new Float64Array(8 * 6 * (top << deep - 1) ** 2);
    const far = 2 * (deep - sizes);
    for (let i = 0; i < place.length; i++) {
      const at = 8 * place[i], angle = angles[i % (fine * fine)], face = i / (fine * fine) | 0;
      const texel = (face * n + (i / fine % fine / step | 0)) * n + (i % fine / step | 0);
      const sky = (rest[3 * i] + rest[3 * i + 1] + rest[3 * i + 2]) / 3 * open[texel] / 255;
      const weight = (sky + met[place[i] >> far] * mean + 1e-6 * mean + 1e-30) * angle;
      for (let c = 0; c < 3; c++) {
        sums[at + c] += rest[3 * i + c] * angle;
        sums[at + 4 + c] += weight * ways[3 * i + c];
      }
      sums[at + 3] += angle;
      sums[at + 7] += weight;
    }
    const of = {};
    for (let l = deep; l > 0; l--) {
      of[l] = sums;
      sums = fours(sums, 8);
    }
    for (let l = 1, node = 0; l <= sizes; l++) for (let i = 0; i < of[l].length; i += 8, node++) {
      const [x, y, z, weight] = of[l].subarray(i + 4, i + 8), length = hypot(x, y, z);
      table.set([x / length, y / length, z / length, max(0, 1 - length / weight)], 8 * node);
    }
    this.fillTables(of[levels + Math.log2(cells)], of[levels]);
    if (parts) {
      const each = of[levels + 1 + Math.log2(parts)], whole = of[levels + 1];
      for (let i = 0; i < each.length / 8; i++) {
        const w = 8 * (i / (parts * parts) | 0), to = 4 * (this.details + 2 * i + 1);
        for (let c = 0; c < 3; c++) table[to + c] = each[8 * i + c] / each[8 * i + 3] - whole[w + c] / whole[w + 3];
      }
    }
  }

  // What each four bits of a block let through, over the area of the block.
  fillTables(cells, blocks) {
    const many = this.cells ** 2, quad = min(4, many);
    for (let q = 0, to = 4 * this.tables; q < cells.length / 8 / quad; q++) for (let bits = 0; bits < 16; bits++, to += 4) {
      const area = blocks[8 * (q * quad / many | 0) + 3];
      for (let c = 0; c < 3; c++) {
        let sum = 0;
        for (let k = 0; k < quad; k++) if (bits >> k & 1) sum += cells[8 * (q * quad + k) + c];
        this.table[to + c] = sum / area;
      }
    }
  }
}

class Gloss {
  constructor(gpu, arrays) {
    const {gl, facts} = gpu, {top, levels, cells, wide, rows, parts, lobes, surfaces, nodes, patches} = facts.gloss;
    Object.assign(this, {gpu, ...facts.gloss, n: facts.resolution});
    this.side = top << levels - 1;
    this.blocks = 6 * this.side ** 2;
    const narrow = rows > wide, {head} = gpu, near = this.near(arrays);
    gpu.head += Object.entries({TOP: 6 * top * top, LEVELS: levels, CELLS: cells, QUADS: max(1, cells * cells / 4), WIDE_ROWS: wide,
      ROWS: rows, PATCHES: patches, SIDE: this.side, TOPS: top, PARTS: parts, MOST_GLINTS, LOBES: lobes.length, GROUPS: lobes.join(), KNOTS: nodes,
      SURFACES: surfaces}).map(([name, value]) => `#define ${name} ${value}\n`).join("");
    this.patchMeans = gpu.program(PATCH, null);
    this.field = gpu.program(CORNER, FIELD);
    this.glimpses = gpu.program(FACETS, null);
    this.glossed = gpu.program(GLOSSED, null);
    gpu.head = head;
    const lights = this.lights = [["wide", facts.resolution, levels, 0], ["narrow", facts.gloss.fine, levels + 1, parts]].slice(0, narrow ? 2 : 1)
      .map(([kind, ...each]) => new GlossLight(this, arrays[kind + "_gathered"] || floats(this.blocks),
        arrays[kind + "_open"] || floats(6 * facts.resolution ** 2), ...each));
    const {data} = gpu, lamps = facts.sources, n = gpu.n, bits = gpu.bits, width = arrays.bits.shape[1];
    const middles = new Uint32Array(max(1, this.metal));
    arrays.metal.forEach((patch, k) => { middles[k] = arrays.patch[patch] + arrays.patch[patch + 1] - 1 >> 1; });
    const direct = new Uint32Array(lamps.length * n || 1), count = (rows - wide) * nodesOf(top, levels + 1) + wide * nodesOf(top, levels);
    lamps.forEach(({lamp}, k) => { if (lamp) direct.set(arrays["direct" + k], k * n); });
    if (ceil(max(count, near.length) / WIDE) > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      fail("This device's graphics hold no tables as large as the gloss of this bake needs.");
    Object.assign(data, {
      codes: gpu.table("u16", this.codes(arrays, bits, width), this.blocks * rows), field: gpu.table("u32", null, count),
      near: gpu.table("u32", near, near.length), patches: gpu.table("u32", arrays.patch, patches + 1),
      metals: gpu.table("u32", Uint32Array.from(arrays.metal), max(1, this.metal)), middles: gpu.table("u32", middles, middles.length), sends: gpu.target(patches), glossed: gpu.target(n),
      glimpses: gpu.table("u32", this.seen, this.seen.length), glimpsed: gpu.target(max(1, this.seen.length)),
      dice: gpu.table("u32", arrays.dice, arrays.dice.length), glossRow: gpu.table("u32", arrays.gloss_row, n),
      surfaces: gpu.table("u32", arrays.surface, n), matter: gpu.table("f32x4", arrays.lobe, arrays.lobe.length / 4),
      light: gpu.table("f32x4", null, lights.reduce((sum, {table}) => sum + table.length / 4, 0)),
      brightBits: gpu.table("u8", null, 2 * MOST_GLINTS * width),
      direct: gpu.table("shared", direct, n, max(1, lamps.length)),
    });
    data.shown = data.glossed;
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, data.field.texture, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.rowBytes = width;
  }

  // Of each row what is in the way of its blocks, or of their quarters where lobes are narrow: how much
  // of that hides light; the number of a patch from 1 on, or beyond those of what metal sends there.
  near({metal, wide_met, wide_hidden, narrow_met, narrow_hidden}) {
    const {blocks, top, levels, patches} = this, all = 5 * blocks, of = new Uint32Array(patches + 1), marks = new Uint32Array(all * metal.length);
    const kinds = [[0, wide_met, wide_hidden], [1, narrow_met, narrow_hidden]].filter(each => each[1]);
    const out = new Uint32Array(kinds.reduce((sum, [, met]) => sum + met.length, 0)), codes = [];
    metal.forEach((patch, k) => { of[patch + 1] = k + 1; });
    const each = todo => kinds.reduce((first, [more, met, hidden]) => {
      const order = treeOrder(top, levels + more), rows = met.length / order.length;
      met.forEach((patch, i) => todo(patch, of[patch] && (of[patch] - 1) * all + more * blocks + order[i / rows | 0], hidden[i], first + i));
      return first + met.length;
    }, 0);
    each((patch, view) => { if (of[patch]) marks[view] = 1; });
    marks.forEach((mark, view) => { if (mark) marks[view] = codes.push(view); });
    each((patch, view, hidden, i) => { out[i] = hidden << 30 | (of[patch] ? patches + marks[view] : patch); });
    this.seen = Uint32Array.from(codes);
    return out;
  }

  // Bits of the cells of each block.
  codes({gloss_point: points}, bits, width) {
    const {top, levels, cells, rows, n, side} = this, many = cells * cells, out = new Uint16Array(this.blocks * rows);
    const order = treeOrder(top, levels + Math.log2(cells)), edge = side * cells, step = n / edge;
    for (let c = 0; c < order.length; c++) {
      const face = order[c] / (edge * edge) | 0, row = order[c] / edge % edge | 0, half = step >> 1;
      const texel = (face * n + row * step + half) * n + order[c] % edge * step + half;
      const first = (c / many | 0) * rows, bit = c % many, from = texel * width;
      for (let r = 0; r < rows; r++) out[first + r] |= (bits[from + (points[r] >> 3)] >> (points[r] & 7) & 1) << bit;
    }
    return out;
  }

  // A new light from far away, on texels; null: none. And where it comes from, and how it is turned.
  setLight(texels, source, turn) {
    const {gpu, lights, rowBytes: width} = this, rows = new Uint8Array(2 * MOST_GLINTS * width);
    this.lit = !!texels;
    lights.forEach((light, k) => {
      const {fine} = light, mine = texels ? k ? this.finer(texels, source, turn) : texels : floats(18 * fine * fine);
      light.take(mine, gpu.bits, rows.subarray(k * MOST_GLINTS * width), width);
    });
    const all = floats(lights.reduce((sum, {table}) => sum + table.length, 0));
    lights.reduce((at, {table}) => { all.set(table, at); return at + table.length; }, 0);
    gpu.fill("brightBits", rows, 1);
    gpu.fill("light", all, 4);
  }

  // The light on as many texels as narrow lobes need.
  finer(texels, source, turn) {
    const {fine, n} = this, step = fine / n;
    if (step === 1) return texels;
    if (source.turning) return (source.finer ||= new TurningLight(source.image, fine)).at(turn);
    const out = floats(18 * fine * fine);
    for (let i = 0; i < out.length / 3; i++) {
      const from = 3 * (((i / (fine * fine) | 0) * n + (i / fine % fine / step | 0)) * n + (i % fine / step | 0));
      out.set(texels.subarray(from, from + 3), 3 * i);
    }
    return out;
  }

  // Fill the field in, of what points send now.
  settle(environment, strengths) {
    const {gpu, lit, lights, rowBytes} = this, {facts} = gpu, env = lit ? environment : 0, {mean} = lights[0];
    // Of wide lobes, and of narrow ones.
    const both = value => ["2iv", [value(lights[0], 0), lights[1] ? value(lights[1], lights[0].table.length / 4) : 0]];
    const of = name => both((light, first) => first + light[name]);
    const numbers = this.numbers = {environment: ["1f", env], scale: ["1f", env * mean > 0 ? 1 / (env * mean) : 1],
      bases: both((light, first) => first), tables: of("tables"), details: of("details"), brights: of("brights"),
      nBright: both(light => light.nBright), rowBytes: ["1i", rowBytes]};
    const own = floats(gpu.many), shine = floats(gpu.many), lamps = floats(8 * gpu.many);
    facts.sources.forEach(({lamp, lamp_factor}, k) => {
      own[k] = strengths[k] / facts.emission_factor;
      if (lamp) { shine[k] = strengths[k] / lamp_factor; lamps.set(lamp, 8 * k); }
    });
    this.more = {strengths: ["1fv", own], lit: ["1fv", shine], lamps: ["4fv", lamps], nLamps: ["1i", strengths.length]};
    gpu.run(this.patchMeans, ["radiance", "patches"], {}, "sends");
    const sweeps = this.seen.length ? 3 : 0, tables = [...LOBE_TABLES, "middles", "glimpses", "dice", "metals", "sends"];
    for (let sweep = 0; sweep <= sweeps; sweep++) {
      if (sweeps) gpu.run(this.glimpses, tables, {...numbers, sweep: ["1i", sweep]}, "glimpsed");
      this.fill();
    }
  }

  fill() {
    const {gpu} = this, {gl, data} = gpu;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, WIDE, data.field.high);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gpu.use(this.field, ["codes", "near", "light", "sends", "glimpsed"], this.numbers);
    gl.bindVertexArray(gpu.nothing);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  // What points show to an eye.
  look(eye) {
    this.gpu.run(this.glossed, [...LOBE_TABLES, "emission", "emitter", "direct"],
      {...this.numbers, ...this.more, eye: ["3fv", eye]}, "glossed", this.gpu.mesh);
  }
}
const LOBE_TABLES = ["codes", "field", "glossRow", "normals", "brightBits", "surfaces", "light", "matter", "radiance", "received"];
