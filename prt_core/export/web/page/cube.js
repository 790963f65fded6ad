// Directions of light: the texels of a cube map, faces +x, -x, +y, -y, +z, -z, z up.

// The texel that a direction of any length falls into.
function texelAlong(x, y, z, n) {
  const ax = abs(x), ay = abs(y), az = abs(z);
  let face, column, row, scale;
  if (ax >= ay && ax >= az) {
    scale = n / 2 / x; face = x < 0 ? 1 : 0; column = y * scale; row = z * abs(scale);
  } else if (az > ax && az > ay) {
    scale = n / 2 / z; face = z < 0 ? 5 : 4; column = x * abs(scale); row = y * scale;
  } else {
    scale = n / 2 / y; face = y < 0 ? 3 : 2; column = -x * scale; row = z * abs(scale);
  }
  column = min(max(column + n / 2 | 0, 0), n - 1);
  row = min(max(row + n / 2 | 0, 0), n - 1);
  return (face * n + row) * n + column;
}

// A place (1, u, v) of each face in the world.
const FACES = [
  (u, v) => [1, u, v], (u, v) => [-1, -u, v], (u, v) => [-u, 1, v],
  (u, v) => [u, -1, v], (u, v) => [u, v, 1], (u, v) => [u, -v, -1]];

// Middles of the texels, unit vectors.
function directions(n) {
  const out = floats(18 * n * n);
  let at = 0;
  for (const place of FACES) for (let row = 0; row < n; row++) for (let column = 0; column < n; column++) {
    const p = place((column + 0.5) / n * 2 - 1, (row + 0.5) / n * 2 - 1), length = hypot(...p);
    for (const x of p) out[at++] = x / length;
  }
  return out;
}

// Exact solid angles of texels, of one face: all are alike.
function solidAngles(n) {
  const corner = (u, v) => atan2(u * v, sqrt(u * u + v * v + 1)), out = new Float64Array(n * n);
  for (let row = 0; row < n; row++) for (let column = 0; column < n; column++) {
    const [u, v] = [column / n * 2 - 1, row / n * 2 - 1], [s, t] = [u + 2 / n, v + 2 / n];
    out[row * n + column] = corner(s, t) - corner(u, t) - corner(s, v) + corner(u, v);
  }
  return out;
}

// The integral of the direction over one texel: half the sum, over its edges, of the edge's angle
// times the unit normal of the edge's plane.
function texelVector(texel, n) {
  const place = FACES[texel / (n * n) | 0], inside = texel % (n * n);
  const u = inside % n / n * 2 - 1, v = (inside / n | 0) / n * 2 - 1, s = u + 2 / n, t = v + 2 / n;
  const ring = [[u, v], [s, v], [s, t], [u, t]].map(([a, b]) => place(a, b)), sum = [0, 0, 0];
  for (let i = 0; i < 4; i++) {
    const p = ring[i], q = ring[(i + 1) % 4];
    const c = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const length = hypot(...c), angle = atan2(length, p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
    for (let k = 0; k < 3; k++) sum[k] += angle / 2 * c[k] / length;
  }
  return sum;
}

// Haar wavelets of each face of a cube map, orthonormal, in place: (6, n, n).
function haar(faces, n) {
  const work = floats(n * n);
  for (let first = 0; first < 6 * n * n; first += n * n)
    for (let size = n; size % 2 === 0; size /= 2) {
      const half = size / 2;
      for (let r = 0; r < half; r++) for (let c = 0; c < half; c++) {
        const at = first + 2 * r * n + 2 * c;
        const a = faces[at], b = faces[at + 1], d = faces[at + n], e = faces[at + n + 1];
        work[r * n + c] = (a + b + d + e) / 2;
        work[r * n + half + c] = (a - b + d - e) / 2;
        work[(half + r) * n + c] = (a + b - d - e) / 2;
        work[(half + r) * n + half + c] = (a - b - d + e) / 2;
      }
      for (let r = 0; r < size; r++)
        faces.set(work.subarray(r * n, r * n + size), first + r * n);
    }
  return faces;
}

// An image on the texels, turned quickly: cut once into parts finer than the texels, each of which
// any rotation hands to the texel that it falls into. What is brighter than a few times the mean is
// divided by exact solid angles, so that its power is kept; the rest by the area of the parts.
const EVEN_HEIGHT = 256, BRIGHT = 4, HOT = 384, HOT_PARTS = 40000;

class TurningLight {
  constructor(image, n) {
    this.n = n;
    this.solid = solidAngles(n);
    const {width, height, pixels} = image, count = width * height, mean = [0, 0, 0];
    for (let i = 0; i < 3 * count; i++) mean[i % 3] += pixels[i] / count;
    let even = floats(pixels.length);
    const bright = [];
    for (let i = 0; i < count; i++) {
      let small = false;
      for (let c = 0, at = 3 * i; c < 3; c++, at++) {
        const is = pixels[at] > BRIGHT * mean[c];
        even[at] = is ? mean[c] : pixels[at];
        small = small || is;
      }
      if (small) bright.push(i);
    }
    this.even = onFineTexels(shrunk({width, height, pixels: even}), min(3 * n, 1024), 16);
    const above = i => [0, 1, 2].map(c => pixels[3 * i + c] > BRIGHT * mean[c] ? pixels[3 * i + c] - mean[c] : 0);
    this.bright = bright.length ? suns(width, height, bright, above, n) : null;
  }

  // Mean radiance of every texel, three numbers each, turned about z.
  at(degrees) {
    const n = this.n, sums = new Float64Array(24 * n * n), out = floats(18 * n * n);
    const bright = new Float64Array(24 * n * n);
    handOut(this.even, degrees, n, sums);
    if (this.bright) handOut(this.bright, degrees, n, bright);
    for (let i = 0; i < 6 * n * n; i++) {
      const area = max(sums[4 * i + 3], 1e-30), solid = this.solid[i % (n * n)];
      for (let c = 0; c < 3; c++) out[3 * i + c] = sums[4 * i + c] / area + bright[4 * i + c] / solid;
    }
    return out;
  }
}

function handOut({ways, values}, degrees, n, sums) {
  const turn = degrees * PI / 180, cos = Math.cos(turn), sin = Math.sin(turn);
  for (let i = 0, w = 0, v = 0; w < ways.length; i++, w += 3, v += 4) {
    const x = ways[w], y = ways[w + 1];
    const at = 4 * texelAlong(cos * x - sin * y, sin * x + cos * y, ways[w + 2], n);
    sums[at] += values[v];
    sums[at + 1] += values[v + 1];
    sums[at + 2] += values[v + 2];
    sums[at + 3] += values[v + 3];
  }
}

// Means of squares of pixels, by their area: far finer than any cube map in use.
function shrunk(image) {
  let {width, height, pixels} = image;
  while (height % 2 === 0 && width % 2 === 0 && height > EVEN_HEIGHT) {
    const [w, h] = [width / 2, height / 2], out = floats(3 * w * h);
    for (let r = 0; r < h; r++) {
      const upper = rowArea(2 * r, height), lower = rowArea(2 * r + 1, height), all = 2 * (upper + lower);
      for (let k = 0; k < 3 * w; k++) {
        const at = 6 * r * width + 6 * (k / 3 | 0) + k % 3, below = at + 3 * width;
        out[3 * r * w + k] = (upper * (pixels[at] + pixels[at + 3]) + lower * (pixels[below] + pixels[below + 3])) / all;
      }
    }
    [width, height, pixels] = [w, h, out];
  }
  return {width, height, pixels};
}

const edge = (row, height) => sin(PI / 2 - row / height * PI);
const rowArea = (row, height) => edge(row, height) - edge(row + 1, height);
const partsAlong = (count, texels, samples) => max(1, ceil(sqrt(texels * samples / count)));

// Power of pixels and its area on the texels of a finer cube map, those that get some.
function onFineTexels({width, height, pixels}, fine, samples, chosen, value) {
  const sums = new Float64Array(24 * fine * fine), count = chosen ? chosen.length : width * height;
  const parts = partsAlong(width * height, 6 * fine * fine, samples), along = angles(width, parts);
  for (let k = 0; k < count; k++) {
    const i = chosen ? chosen[k] : k, [r, g, b] = chosen ? value(i) : pixels.subarray(3 * i, 3 * i + 3);
    cut(i, width, height, parts, along, (x, y, z, area) => {
      const at = 4 * texelAlong(x, y, z, fine);
      sums[at] += r * area; sums[at + 1] += g * area; sums[at + 2] += b * area; sums[at + 3] += area;
    });
  }
  return used(sums, directions(fine));
}

// Calls tell(x, y, z, area) for each of parts x parts pieces of a pixel, of equal area.
function cut(i, width, height, parts, {cos, sin}, tell) {
  const row = i / width | 0, first = i % width * parts, top = edge(row, height);
  const step = rowArea(row, height) / parts, area = step * 2 * PI / (width * parts);
  for (let a = 0; a < parts; a++) {
    const z = top - step * (a + 0.5), radius = sqrt(max(0, 1 - z * z));
    for (let c = first; c < first + parts; c++) tell(radius * cos[c], radius * sin[c], z, area);
  }
}

function angles(width, parts) {
  const cos = floats(width * parts), sin = floats(width * parts);
  for (let i = 0; i < cos.length; i++) {
    const angle = PI - (i + 0.5) / (width * parts) * 2 * PI;
    cos[i] = Math.cos(angle); sin[i] = Math.sin(angle);
  }
  return {cos, sin};
}

function used(sums, directions) {
  let count = 0;
  for (let i = 3; i < sums.length; i += 4) if (sums[i]) count++;
  const ways = floats(3 * count), values = new Float64Array(4 * count);
  for (let i = 0, k = 0; i < sums.length / 4; i++) if (sums[4 * i + 3]) {
    for (let c = 0; c < 3; c++) ways[3 * k + c] = directions[3 * i + c];
    for (let c = 0; c < 4; c++) values[4 * k + c] = sums[4 * i + c];
    k++;
  }
  return {ways, values};
}

// Parts of the bright pixels: small ones of the brightest, texels of a finer cube map of the rest.
function suns(width, height, bright, above, n) {
  const power = new Map(bright.map(i => {
    const [r, g, b] = above(i);
    return [i, (r + g + b) * rowArea(i / width | 0, height)];
  }));
  bright.sort((a, b) => power.get(b) - power.get(a));
  const hot = bright.slice(0, HOT), ways = [], values = [];
  const most = partsAlong(width * height, 6 * n * n, 4000), all = hot.reduce((sum, i) => sum + power.get(i), 0);
  for (const i of hot) {
    // The stronger a pixel, the more its share of each texel matters.
    const [r, g, b] = above(i), fair = sqrt(HOT_PARTS * power.get(i) / all);
    const parts = min(most, max(2, round(fair)));
    cut(i, width, height, parts, angles(width, parts), (x, y, z, area) => {
      ways.push(x, y, z);
      values.push(r * area, g * area, b * area, area);
    });
  }
  const rest = bright.slice(HOT);
  if (rest.length) {
    const more = onFineTexels({width, height}, min(8 * n, 1024), 16, rest, above);
    for (const x of more.ways) ways.push(x);
    for (const x of more.values) values.push(x);
  }
  return {ways: floats(ways), values: new Float64Array(values)};
}
