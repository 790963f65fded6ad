// Images of light that are dropped on the page: Radiance (.hdr), OpenEXR by `exr.js`.
const DAMAGED = "it was cut off or is damaged";

// {width, height, pixels, notes} of the bytes of a file: linear Rec.709, first row on top.
async function readImage(name, bytes) {
  const mark = String.fromCharCode(...bytes.subarray(0, 2));
  const isExr = bytes[0] === 0x76 && bytes[1] === 0x2f && bytes[2] === 0x31 && bytes[3] === 1;
  if (!isExr && mark !== "#?")
    fail(`${name}: expected an .hdr or .exr image of light, this is something else`);
  const image = isExr ? await readExr(name, bytes) : readRadiance(name, bytes);
  const {width, height, pixels} = image;
  if (width !== 2 * height)
    fail(`${name}: an equirectangular image is twice as wide as high, this has ${width} x ${height}`);
  let negative = 0, positive = 0, most = 0;
  for (const value of pixels) {
    if (value < 0) negative -= value; else positive += value;
    if (!(value <= most)) most = value;
  }
  const wrong = !(positive < Infinity) ? "pixels that are NaN or infinite" : negative > 1e-4 * positive ? "negative radiance"
    : most > 1e15 && "radiance above 1e15";
  if (wrong) fail(`${name}: has ${wrong}; repair the image first`);
  if (!most) fail(`${name}: is black`);
  if (negative) for (let i = 0; i < pixels.length; i++) if (pixels[i] < 0) pixels[i] = 0;
  return image;
}

function readRadiance(name, bytes) {
  const head = new TextDecoder("latin1").decode(bytes.subarray(0, 1 << 16));
  const end = head.indexOf("\n\n"), last = head.indexOf("\n", end + 2);
  if (end < 0 || last < 0) fail(`${name}: not a readable Radiance image; ${DAMAGED}`);
  const lines = head.slice(0, end).split("\n").filter(line => line.includes("=") && line[0] !== "#");
  const fields = new Map(lines.map(line => [line.split("=")[0].trim().toUpperCase(), line.slice(line.indexOf("=") + 1).trim()]));
  const form = fields.get("FORMAT") || "32-bit_rle_rgbe";
  if (form !== "32-bit_rle_rgbe")
    fail(`${name}: its format '${form}' is not understood; convert it to RGB with 'ra_xyze -r'`);
  const size = head.slice(end + 2, last).trim().match(/^([-+])Y +(\d+) +([-+])X +(\d+)$/);
  if (!size) fail(`${name}: its orientation is not understood; turn it to '-Y height +X width'`);
  const height = +size[2], width = +size[4];
  const codes = decoded(name, bytes.subarray(last + 1), width, height), pixels = floats(3 * width * height);
  for (let row = 0; row < height; row++) for (let column = 0; column < width; column++) {
    const from = 4 * ((size[1] === "+" ? height - 1 - row : row) * width + (size[3] === "-" ? width - 1 - column : column));
    const step = codes[from + 3] ? 2 ** (codes[from + 3] - 136) : 0;
    for (let c = 0; c < 3; c++) pixels[3 * (row * width + column) + c] = codes[from + c] * step;
  }
  const primaries = (fields.get("PRIMARIES") || "").split(/\s+/).map(Number);
  return toRec709({width, height, pixels}, primaries);
}

// Red, green, blue and exponent of every pixel.
function decoded(name, bytes, width, height) {
  const out = new Uint8Array(4 * width * height), short = () => fail(`${name}: its pixels end too early; ${DAMAGED}`);
  const isCoded = at => bytes[at] === 2 && bytes[at + 1] === 2 && bytes[at + 2] === width >> 8 && bytes[at + 3] === (width & 255);
  let at = 0;
  if (width < 8 || width > 32767 || !isCoded(0)) {
    // Pixels as they are; 1, 1, 1, n repeats the one before, digits of n the lowest first.
    let shift = 0;
    for (let i = 0; i < out.length; at += 4) {
      if (at + 4 > bytes.length) short();
      if (bytes[at] === 1 && bytes[at + 1] === 1 && bytes[at + 2] === 1) {
        if (!i) fail(`${name}: it begins with a repetition; ${DAMAGED}`);
        for (let count = bytes[at + 3] * 2 ** shift; count-- > 0 && i < out.length; i += 4) out.copyWithin(i, i - 4, i);
        shift += 8;
      } else { out.set(bytes.subarray(at, at + 4), i); i += 4; shift = 0; }
    }
    return out;
  }
  for (let row = 0; row < height; row++) {
    if (!isCoded(at)) fail(`${name}: a row is missing; ${DAMAGED}`);
    at += 4;
    for (let part = 0; part < 4; part++) for (let column = 0; column < width;) {
      let count = bytes[at++];
      const run = count > 128;
      if (run) count -= 128;
      if (!count || column + count > width || at + (run ? 1 : count) > bytes.length) short();
      for (let k = 0; k < count; k++, column++) out[4 * (row * width + column) + part] = bytes[run ? at : at + k];
      at += run ? 1 : count;
    }
  }
  return out;
}

// The light of the scene's world, whose texels are all there is, as an image for the background.
function imageOfTexels(texels, n) {
  const height = 4 * n, width = 8 * n, pixels = floats(3 * width * height);
  for (let row = 0; row < height; row++) for (let column = 0; column < width; column++) {
    const up = PI / 2 - (row + 0.5) / height * PI, angle = PI - (column + 0.5) / width * 2 * PI;
    const from = 3 * texelAlong(cos(up) * cos(angle), cos(up) * sin(angle), sin(up), n);
    pixels.set(texels.subarray(from, from + 3), 3 * (row * width + column));
  }
  return {width, height, pixels};
}
