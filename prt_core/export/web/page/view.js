// From where the scene is looked at: a turntable about a point, z up, in the scene's own frame.
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const mixed = (a, x, b, y) => a.map((v, i) => x * v + y * b[i]);

class Orbit {
  constructor(start) { this.start = start; this.reset(); }

  reset() {
    const {eye, target, up} = this.start, away = mixed(eye, 1, target, -1);
    this.distance = hypot(...away);
    this.azimuth = atan2(away[1], away[0]);
    this.elevation = asin(min(1, max(-1, away[2] / this.distance)));
    this.target = target.slice();
    this.roll = 0;
    const {right, upright} = this.axes();
    this.roll = atan2(-dot(up, right), dot(up, upright));
  }

  axes() {
    const [ca, sa] = [cos(this.azimuth), sin(this.azimuth)], ce = cos(this.elevation);
    const back = [ce * ca, ce * sa, sin(this.elevation)], level = [-sa, ca, 0], above = cross(back, level);
    const [c, s] = [cos(this.roll), sin(this.roll)];
    return {back, right: mixed(level, c, above, s), upright: mixed(above, c, level, -s)};
  }

  turn(x, y) {
    this.azimuth -= x;
    this.elevation = min(1.56, max(-1.56, this.elevation + y));
  }

  // By shares of the picture's height.
  pan(x, y) {
    const {right, upright} = this.axes(), size = 2 * this.start.tangents[1] * this.distance;
    this.target = mixed(mixed(this.target, 1, right, -x * size), 1, upright, y * size);
  }

  zoom(factor) { this.distance = min(1e3, max(1e-6, this.distance * factor)); }

  // Matrices of a picture of this shape, which holds all that the scene's camera shows.
  matrices(aspect) {
    const {back, right, upright} = this.axes(), [tx, ty] = this.start.tangents, [sx, sy] = this.start.shift;
    const y = max(ty, tx / aspect), x = y * aspect, eye = mixed(this.target, 1, back, this.distance);
    const reach = hypot(...eye) + 1, near = min(max(this.distance * 0.01, reach * 1e-4), this.distance * 0.3);
    const rows = [mixed(right, 1 / x, back, sx / x), mixed(upright, 1 / y, back, sy / y),
      back.map(v => -v * (reach + near) / (reach - near)), back.map(v => -v)];
    const shift = [0, 0, -2 * reach * near / (reach - near), 0];
    const matrix = floats(16), rays = floats(9);
    rows.forEach((row, i) => {
      for (let k = 0; k < 3; k++) matrix[4 * k + i] = row[k];
      matrix[12 + i] = shift[i] - dot(row, eye);
    });
    for (let k = 0; k < 3; k++) {
      rays[k] = right[k] * x;
      rays[3 + k] = upright[k] * y;
      rays[6 + k] = -back[k] + right[k] * sx + upright[k] * sy;
    }
    return {matrix, rays, eye};
  }
}
