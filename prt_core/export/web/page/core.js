"use strict";
// Relights a bake in a browser. All scripts of the page are one classic script: from disk no other
// can be loaded. Arrays are flat; points, rows and texels are numbered as the bake does.
const PRT = {}, {abs, min, max, sqrt, floor, ceil, round, hypot, atan2, asin, exp, cos, sin, PI} = Math;

// What can be said to the person at the page.
class Trouble extends Error {};
const told = (error, what) => error instanceof Trouble ? error.message : `${what}: ${error.message}`;
const fail = text => { throw new Trouble(text); };

const floats = count => new Float32Array(count);
const KINDS = {u1: Uint8Array, i1: Int8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array};

async function inflate(bytes) {
  if (!window.DecompressionStream)
    fail("This page needs Chrome 80, Firefox 113, Safari 16.4 or newer.");
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Arrays by name, as they were before they were packed.
async function unpack(packed) {
  const arrays = {};
  await Promise.all(Object.entries(packed).map(async ([name, a]) => {
    const text = atob(a.data), bytes = new Uint8Array(text.length);
    a.data = null;
    for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
    arrays[name] = restored(a, await inflate(bytes));
    arrays[name].shape = a.shape;
  }));
  return arrays;
}

function restored({kind, shape, differences}, bytes) {
  const Kind = KINDS[kind], size = Kind.BYTES_PER_ELEMENT, count = bytes.length / size;
  let values;
  if (size === 1) values = new Kind(bytes.buffer);
  else {
    // Bytes came in planes, the lowest first.
    const whole = new Uint8Array(bytes.length);
    for (let b = 0, from = 0; b < size; b++)
      for (let i = 0, to = b; i < count; i++, to += size) whole[to] = bytes[from++];
    values = new Kind(whole.buffer);
  }
  if (differences) {
    const width = shape.slice(1).reduce((a, b) => a * b, 1);
    for (let i = width; i < count; i++) values[i] += values[i - width];
  }
  return values;
}

// Colours of RGB9_E5, times 1 / factor: three numbers each.
function sharedExponent(codes, factor) {
  const out = floats(3 * codes.length);
  for (let i = 0; i < codes.length; i++) {
    const c = codes[i], step = 2 ** ((c >>> 27) - 24) / factor;
    out[3 * i] = (c & 511) * step;
    out[3 * i + 1] = (c >>> 9 & 511) * step;
    out[3 * i + 2] = (c >>> 18 & 511) * step;
  }
  return out;
}

// Pixels of planes of RGBE, (4, height, width).
function fromRGBE(codes) {
  const [, height, width] = codes.shape, n = height * width, pixels = floats(3 * n);
  for (let i = 0; i < n; i++) {
    const e = codes[3 * n + i], step = e ? 2 ** (e - 136) : 0;
    for (let c = 0; c < 3; c++) pixels[3 * i + c] = codes[c * n + i] * step;
  }
  return {width, height, pixels};
}
