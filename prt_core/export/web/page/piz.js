// PIZ, of OpenEXR: values that occur are numbered, numbers go through wavelets, those through
// Huffman codes.
function piz(packed, channels, width, height) {
  const view = new DataView(packed.buffer, packed.byteOffset, packed.byteLength);
  const first = view.getUint16(0, true), last = view.getUint16(2, true), values = new Uint16Array(65536);
  let at = 4, count = 1;
  for (let i = first; i <= last; i++, at++)
    for (let bit = i ? 0 : 1; bit < 8; bit++) if (packed[at] >> bit & 1) values[count++] = 8 * i + bit;
  const planes = channels.map(c => c.kind === 1 ? 1 : 2), words = width * height * planes.reduce((a, b) => a + b);
  const size = view.getUint32(at, true), data = huffman(packed.subarray(at + 4, at + 4 + size), words);
  const starts = [];
  for (let k = 0, from = 0; k < planes.length; k++) {
    starts.push(from);
    for (let part = 0; part < planes[k]; part++)
      unwoven(data, from + part, width, planes[k], height, width * planes[k], count - 1 < 1 << 14);
    from += width * height * planes[k];
  }
  const out = new Uint16Array(words);
  for (let y = 0, to = 0; y < height; y++) planes.forEach((plane, k) => {
    for (let x = 0, from = starts[k] + y * width * plane; x < width * plane; x++) out[to++] = values[data[from++]];
  });
  return new Uint8Array(out.buffer);
}

// Two numbers of their mean and difference.
function pair14(low, high) {
  const h = high << 16 >> 16, a = (low << 16 >> 16) + (h & 1) + (h >> 1);
  return [a & 65535, a - h & 65535];
}

function pair16(low, high) {
  const b = low - (high >> 1) & 65535;
  return [high + b - 32768 & 65535, b];
}

// Wavelets undone in place, the coarsest first.
function unwoven(data, start, nx, ox, ny, oy, few) {
  const pair = few ? pair14 : pair16;
  const both = (i, k) => { [data[i], data[k]] = pair(data[i], data[k]); };
  let step = 1;
  while (step <= min(nx, ny)) step *= 2;
  for (step /= 4; step >= 1; step /= 2) {
    const right = ox * step, below = oy * step;
    let y = 0;
    for (; y + 2 * step <= ny; y += 2 * step) {
      let x = 0;
      for (; x + 2 * step <= nx; x += 2 * step) {
        const i = start + y * oy + x * ox;
        both(i, i + below); both(i + right, i + right + below);
        both(i, i + right); both(i + below, i + right + below);
      }
      if (nx & step) both(start + y * oy + x * ox, start + y * oy + x * ox + below);
    }
    if (ny & step) for (let x = 0; x + 2 * step <= nx; x += 2 * step) {
      const i = start + y * oy + x * ox;
      both(i, i + right);
    }
  }
}

// Numbers of their canonical codes, the last of which says how often the one before comes again.
function huffman(bytes, count) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), out = new Uint16Array(count);
  if (bytes.length < 20) return out;
  const first = view.getUint32(0, true), again = view.getUint32(4, true), lengths = new Uint8Array(65537);
  let at = 20, held = 0, kept = 0;
  const bits = n => {
    while (kept < n) { held = (held * 256 + bytes[at++]) % 2 ** 40; kept += 8; }
    kept -= n;
    return floor(held / 2 ** kept) % 2 ** n;
  };
  for (let i = first; i <= again; i++) {
    const length = bits(6);
    if (length < 59) lengths[i] = length;
    else i += (length === 63 ? bits(8) + 6 : length - 57) - 1;
  }
  // Symbols by length, in order; the first code of each length.
  const symbols = [], codes = new Float64Array(59), counts = new Uint32Array(59), starts = new Uint32Array(60);
  for (let i = first; i <= again; i++) counts[lengths[i]]++;
  for (let n = 58, code = 0; n > 0; n--) { codes[n] = code; code = floor((code + counts[n]) / 2); }
  for (let n = 1; n < 59; n++) {
    starts[n] = symbols.length;
    if (counts[n]) for (let i = first; i <= again; i++) if (lengths[i] === n) symbols.push(i);
  }
  held = kept = 0;
  for (let to = 0; to < count;) {
    let code = 0, n = 0, place = -1;
    while (place < 0 || place >= counts[n]) {
      if (++n > 58) throw new RangeError();
      code = 2 * code + bits(1);
      place = code - codes[n];
    }
    const symbol = symbols[starts[n] + place];
    if (symbol === again) for (let k = bits(8), value = out[to - 1]; k--;) out[to++] = value;
    else out[to++] = symbol;
    if (at > bytes.length + 8) throw new RangeError();
  }
  return out;
}
