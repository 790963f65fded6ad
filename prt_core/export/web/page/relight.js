// From a light on texels to what the rows of the compressed form give: all that the processor does
// for a new light. The few brightest texels are taken out of what rows have of direct light, and
// looked up in the visibility bits.
const columns = table => [...Array(table.shape[1]).keys()].map(k => table.filter((_, i) => i % table.shape[1] === k));
const MOST_TERMS = 512, SPARE = 1e-3, MOST_BRIGHT = 16, BRIGHT_SHARE = 2e-3;

class Evaluator {
  constructor(arrays, facts) {
    const {resolution: n, groups, bits} = facts, {row: rows, scale, level, basis, weight_step: weightStep} = arrays;
    Object.assign(this, {n, groups, bits, rows, scale, level, basis, weightStep, nDirections: 6 * n * n, nRows: weightStep.length});
    // Steps of each level's wavelets, and the last of all other features.
    this.steps = columns(arrays.row_step);
    this.basisSteps = arrays.basis_step && columns(arrays.basis_step);
    this.solid = solidAngles(this.n);
    this.importance = this.groups.map((_, g) => this.important(g, arrays.energy));
    this.products = floats(4 * this.nRows);
    this.sums = this.steps.map(() => [0, 1, 2].map(() => floats(this.nRows)));
  }

  // How much each term of a light matters to a group.
  important(g, energy) {
    const {nRows, rows, nDirections: n} = this, out = floats(n);
    const squares = (feature, steps) => {
      let sum = 0;
      for (let r = 0, at = feature * nRows; r < nRows; r++, at++) {
        const value = rows[at] * steps[r];
        sum += energy[r] * value * value;
      }
      return sum;
    };
    if (!g) {
      for (let j = 0; j < n; j++) out[j] = squares(j, this.steps[this.level[j]]);
      return out;
    }
    const [first, count] = this.place(g), width = this.basisSteps[0].length;
    for (let k = 0; k < count; k++) {
      const square = squares(n + first + k, this.steps.at(-1));
      for (let j = 0; j < n; j++) {
        const value = this.basis[j * width + first + k] * this.basisSteps[this.level[j]][first + k];
        out[j] += square * value * value;
      }
    }
    return out;
  }

  // Where an indirect group's features begin among those of all, and how many there are.
  place(g) {
    let first = 0;
    for (let i = 1; i < g; i++) first += this.groups[i].size;
    return [first, this.groups[g].size];
  }

  // The brightest texels of a light (n, 3), each with its radiance, and the light without them.
  split(light) {
    const rest = light.slice(), bright = [], power = floats(this.nDirections);
    if (!this.bits) return {rest, bright};
    let total = 0;
    for (let i = 0; i < power.length; i++) {
      power[i] = (light[3 * i] + light[3 * i + 1] + light[3 * i + 2]) * this.solid[i % this.solid.length];
      total += power[i];
    }
    for (let k = 0; k < MOST_BRIGHT; k++) {
      let best = 0;
      for (let i = 1; i < power.length; i++) if (power[i] > power[best]) best = i;
      if (!(power[best] > BRIGHT_SHARE * total)) break;
      power[best] = 0;
      bright.push({texel: best, radiance: [...light.subarray(3 * best, 3 * best + 3)]});
      rest.fill(0, 3 * best, 3 * best + 3);
    }
    return {rest, bright};
  }

  // Wavelets of a light, channel by channel, over the scale of the rows' features.
  coded(light) {
    const n = this.nDirections, out = floats(3 * n);
    for (let c = 0; c < 3; c++) {
      const channel = out.subarray(c * n, (c + 1) * n);
      for (let i = 0; i < n; i++) channel[i] = light[3 * i + c];
      haar(channel, this.n);
      for (let i = 0; i < n; i++) channel[i] /= this.scale[i];
    }
    return out;
  }

  // The terms of a light that weigh most in a group.
  chosen(g, coded) {
    const n = this.nDirections, shares = this.groups[g].shares, weight = floats(n);
    let total = 0;
    for (let i = 0; i < n; i++) {
      let square = 0;
      for (let c = 0; c < 3; c++) square += (shares[c] * coded[c * n + i]) ** 2;
      total += weight[i] = square * this.importance[g][i];
    }
    const sorted = weight.slice().sort();
    let least = max(0, n - MOST_TERMS);
    // Errors of different terms are as good as independent: their squares add up.
    for (let left = sorted[least]; least < n - 1 && left < SPARE * SPARE * total;) left += sorted[++least];
    const limit = sorted[least], terms = [];
    for (let i = 0; i < n; i++) if (weight[i] >= limit && weight[i] > 0) terms.push(i);
    return terms;
  }

  // What every row gives under a light: (n_rows, 4), weights' steps in it; and the bright texels.
  under(light) {
    const {rest, bright} = this.split(light), {products, nRows} = this;
    const all = this.coded(light), direct = bright.length ? this.coded(rest) : all;
    products.fill(0);
    this.direct(direct, this.groups[0].shares);
    for (let g = 1; g < this.groups.length; g++) if (this.groups[g].size) this.indirect(g, all);
    for (let r = 0; r < nRows; r++) for (let c = 0; c < 3; c++) products[4 * r + c] *= this.weightStep[r];
    return {products, bright};
  }

  direct(coded, shares) {
    const {rows, nRows, products, sums, steps} = this, n = this.nDirections;
    for (const sum of sums.flat()) sum.fill(0);
    for (const j of this.chosen(0, coded)) {
      const [red, green, blue] = sums[this.level[j]];
      const [x, y, z] = [shares[0] * coded[j], shares[1] * coded[n + j], shares[2] * coded[2 * n + j]];
      for (let r = 0, at = j * nRows; r < nRows; r++, at++) {
        const value = rows[at];
        if (value) { red[r] += value * x; green[r] += value * y; blue[r] += value * z; }
      }
    }
    sums.forEach((sum, k) => {
      for (let r = 0; r < nRows; r++) for (let c = 0; c < 3; c++) products[4 * r + c] += steps[k][r] * sum[c][r];
    });
  }

  indirect(g, coded) {
    const {rows, nRows, products, basis, basisSteps} = this, n = this.nDirections;
    const [first, count] = this.place(g), width = basisSteps[0].length, shares = this.groups[g].shares;
    const inner = floats(3 * count);
    for (const j of this.chosen(g, coded)) for (let c = 0; c < 3; c++) {
      const value = shares[c] * coded[c * n + j], steps = basisSteps[this.level[j]];
      if (value) for (let k = 0, at = j * width + first; k < count; k++, at++)
        inner[c * count + k] += basis[at] * steps[first + k] * value;
    }
    for (let k = 0; k < count; k++) {
      const x = inner[k], y = inner[count + k], z = inner[2 * count + k];
      for (let r = 0, at = (n + first + k) * nRows; r < nRows; r++, at++) if (rows[at]) {
        const value = rows[at] * this.steps.at(-1)[r];
        products[4 * r] += value * x;
        products[4 * r + 1] += value * y;
        products[4 * r + 2] += value * z;
      }
    }
  }
}
