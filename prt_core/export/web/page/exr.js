// OpenEXR: scan lines or tiles of half, float or uint channels, of one part, without compression or
// by RLE, ZIPS, ZIP or PIZ. Red, green and blue, or luminance alone.
const EXR_NAMES = ["none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"];
const EXR_LINES = [1, 1, 1, 16, 32];

async function readExr(name, bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  try {
    return await decodedExr(name, bytes, view);
  } catch (error) {
    if (error instanceof RangeError || error instanceof TypeError)
      fail(`${name}: not a readable OpenEXR image; ${DAMAGED}`);
    throw error;
  }
}

async function decodedExr(name, bytes, view) {
  const flags = view.getUint32(4, true);
  if (flags & 0x1800) fail(`${name}: has several parts or deep pixels; save it as one flat image`);
  let at = 8;
  const text = () => { const from = at; while (view.getUint8(at)) at++; return String.fromCharCode(...bytes.subarray(from, at++)); };
  const attributes = {};
  for (let key = text(); key; key = text()) {
    text();
    const size = view.getInt32(at, true);
    attributes[key] = at += 4;
    at += size;
  }
  const method = view.getUint8(attributes.compression);
  if (method > 4) fail(`${name}: is compressed by ${EXR_NAMES[method] || "an unknown method"}, which is not read here; save it with ZIP or PIZ, or as .hdr`);
  const box = key => [0, 4, 8, 12].map(k => view.getInt32(attributes[key] + k, true));
  const [x0, y0, x1, y1] = box("dataWindow"), [u0, v0, u1, v1] = box("displayWindow");
  const width = u1 - u0 + 1, height = v1 - v0 + 1, after = at;
  if (!(width > 0 && height > 0 && width * height < 1 << 28)) fail(`${name}: the image has no pixels, or too many`);
  // Channels, in the order in which they are stored.
  const channels = [];
  for (at = attributes.channels; view.getUint8(at); at += 16) {
    const channel = text();
    channels.push({channel, kind: view.getInt32(at, true)});
    if (view.getInt32(at + 8, true) !== 1 || view.getInt32(at + 12, true) !== 1)
      fail(`${name}: its channels have fewer pixels than others; save it as RGB`);
  }
  const wanted = chosenChannels(channels);
  if (!wanted) fail(`${name}: has no channels R, G and B, and no Y`);
  for (const c of channels) c.to = [0, 1, 2].filter(k => wanted[k] === c.channel);
  const pixels = floats(3 * width * height), tiled = flags & 0x200;
  const inside = {width, height, x: x0 - u0, y: y0 - v0, pixels};
  const wide = x1 - x0 + 1, high = y1 - y0 + 1;
  const [tileWide, tileHigh, mode] = tiled ? [view.getUint32(attributes.tiles, true), view.getUint32(attributes.tiles + 4, true), view.getUint8(attributes.tiles + 8) & 15] : [wide, EXR_LINES[method], 0];
  if (mode > 1 || !(tileWide > 0 && tileHigh > 0)) fail(`${name}: its tiles have ripmap levels, which are not read here`);
  const across = ceil(wide / tileWide), down = ceil(high / tileHigh), work = [];
  // Of mipmaps the finest level comes first.
  for (let block = 0; block < across * down; block++) {
    let from = Number(view.getBigUint64(after + 8 * block, true)), column = 0, row;
    if (tiled) {
      column = view.getInt32(from, true) * tileWide; row = view.getInt32(from + 4, true) * tileHigh;
      from += 16;
    } else { row = view.getInt32(from, true) - y0; from += 4; }
    const size = view.getInt32(from, true), w = min(tileWide, wide - column), h = min(tileHigh, high - row);
    if (from + 4 + size > bytes.length || w <= 0 || h <= 0) throw new RangeError();
    work.push(() => exrBlock(method, bytes.subarray(from + 4, from + 4 + size), channels, w, h)
      .then(data => place(inside, data, channels, column, row, w, h)));
  }
  for (let k = 0; k < work.length; k += 64) await Promise.all(work.slice(k, k + 64).map(run => run()));
  const places = attributes.chromaticities && [0, 1, 2, 3, 4, 5, 6, 7].map(k => view.getFloat32(attributes.chromaticities + 4 * k, true));
  return toRec709({width, height, pixels}, places);
}

// Names of three channels: of the main layer, or of the first that has colours.
function chosenChannels(channels) {
  const names = new Set(channels.map(c => c.channel));
  const layers = new Set([""].concat(channels.map(c => c.channel.slice(0, c.channel.lastIndexOf(".") + 1))));
  for (const layer of layers) {
    if (["R", "G", "B"].every(c => names.has(layer + c))) return [layer + "R", layer + "G", layer + "B"];
    if (names.has(layer + "Y") && !names.has(layer + "RY")) return [layer + "Y", layer + "Y", layer + "Y"];
  }
  return null;
}

async function exrBlock(method, packed, channels, width, height) {
  const line = width * channels.reduce((sum, c) => sum + (c.kind === 1 ? 2 : 4), 0), size = line * height;
  // What does not become smaller is stored as it is.
  if (!method || packed.length === size) return packed.slice();
  if (method === 4) return piz(packed, channels, width, height);
  let data;
  if (method === 1) data = exrRuns(packed, size);
  else try { data = await inflate(packed); } catch (error) { throw error instanceof Trouble ? error : new RangeError(); }
  if (data.length !== size) throw new RangeError();
  for (let i = 1; i < size; i++) data[i] = data[i - 1] + data[i] - 128;
  const out = new Uint8Array(size), half = size + 1 >> 1;
  for (let i = 0; i < size; i++) out[i] = data[i & 1 ? half + (i >> 1) : i >> 1];
  return out;
}

function exrRuns(packed, size) {
  const out = new Uint8Array(size);
  for (let at = 0, to = 0; at < packed.length;) {
    const count = packed[at++] << 24 >> 24;
    if (count < 0) { out.set(packed.subarray(at, at - count), to); at -= count; to -= count; }
    else { out.fill(packed[at++], to, to + count + 1); to += count + 1; }
  }
  return out;
}

const HALVES = floats(65536).map((_, code) => {
  const sign = code >> 15 ? -1 : 1, exponent = code >> 10 & 31, fraction = code & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 25) * (1024 + fraction) : 2 ** -24 * fraction);
});

// Put a block, line by line and in a line channel by channel, where it belongs.
function place(inside, data, channels, column, row, width, height) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  let at = 0;
  for (let y = 0; y < height; y++) for (const {kind, to} of channels) {
    const size = kind === 1 ? 2 : 4, v = row + y + inside.y;
    if (to.length && v >= 0 && v < inside.height) for (let x = 0; x < width; x++) {
      const u = column + x + inside.x;
      if (u < 0 || u >= inside.width) continue;
      const from = at + x * size;
      const value = kind === 1 ? HALVES[view.getUint16(from, true)] : kind === 2 ? view.getFloat32(from, true) : view.getUint32(from, true);
      for (const c of to) inside.pixels[3 * (v * inside.width + u) + c] = value;
    }
    at += width * size;
  }
}

// Pixels in the primaries of Rec.709; `places` are x and y of red, green, blue and white.
const REC709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
function toRec709(image, places) {
  if (!places || places.length !== 8 || places.some(Number.isNaN)) return image;
  if (places.every((p, i) => abs(p - REC709[i]) < 2e-3)) return image;
  const from = toXYZ(places), white = toXYZ(REC709), m = times(inverse(white), from), {pixels} = image;
  for (let i = 0; i < pixels.length; i += 3) {
    const [r, g, b] = [pixels[i], pixels[i + 1], pixels[i + 2]];
    for (let c = 0; c < 3; c++) pixels[i + c] = m[3 * c] * r + m[3 * c + 1] * g + m[3 * c + 2] * b;
  }
  return image;
}

// Columns are the primaries, such that all together are white of luminance 1.
function toXYZ(p) {
  const column = i => [p[2 * i] / p[2 * i + 1], 1, (1 - p[2 * i] - p[2 * i + 1]) / p[2 * i + 1]];
  const [r, g, b, w] = [0, 1, 2, 3].map(column), m = [0, 1, 2].flatMap(k => [r[k], g[k], b[k]]), inv = inverse(m);
  const s = [0, 1, 2].map(k => inv[3 * k] * w[0] + inv[3 * k + 1] * w[1] + inv[3 * k + 2] * w[2]);
  return m.map((value, i) => value * s[i % 3]);
}

function inverse([a, b, c, d, e, f, g, h, i]) {
  const det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  return [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g, c * d - a * f,
    d * h - e * g, b * g - a * h, a * e - b * d].map(x => x / det);
}

const times = (a, b) => a.map((_, i) => [0, 1, 2].reduce((sum, k) => sum + a[3 * (i / 3 | 0) + k] * b[3 * k + i % 3], 0));
