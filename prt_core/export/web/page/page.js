// The page itself: what its controls say, what is dropped on it, how it is touched.
const $ = id => document.getElementById(id);
const say = (text, bad) => { $("said").textContent = text; $("said").className = bad ? "bad" : ""; };

class Page {
  constructor(gl, facts, arrays, field) {
    Object.assign(this, {gl, facts, arrays, images: new Map(), strengths: []});
    if (arrays) {
      this.evaluator = new Evaluator(arrays, facts);
      this.gpu = this.own = new Gpu(gl, arrays, facts);
    }
    if (field) this.field = new Gpu(gl, field, window.PRT_FIELD).viewer;
    this.orbit = new Orbit(facts.start);
    $("look").value = facts.look;
    this.strength = this.exposure = 0;
    this.turn = 0;
    this.wanted = {};
    facts.images.forEach((name, k) => this.add(name, () => fromRGBE(arrays["image" + k])));
    if (facts.world_factor) this.add("The scene's world", null, sharedExponent(arrays.world, facts.world_factor));
    if (arrays) this.add("None", null, null);
  }

  // A light from far away: an image, which is read when it is first asked for, or one on texels.
  add(name, read, texels) {
    while (this.images.has(name)) name += " again";
    this.images.set(name, {read, texels});
    const option = document.createElement("option");
    option.textContent = option.value = name;
    $("light").append(option);
    return name;
  }

  // Make a light the one that shines.
  choose(name) {
    const light = this.light = this.images.get(name), {n} = this.evaluator || {};
    $("light").value = name;
    this.gpu = light.field ? light.field.gpu : this.own;
    $("of-scene").hidden = light.field || !this.facts.sources.some(({kind}) => kind !== "world");
    if (this.field) this.field.show(!!light.field);
    if (light.read && !light.turning) {
      light.image = light.read();
      light.turning = new TurningLight(light.image, n);
    } else if (light.texels) light.image = imageOfTexels(light.texels, n);
    if (light.image) this.gpu.setSky(light.image);
    $("turn").disabled = !light.turning;
    $("turn").title = light.turning ? "" : "Only images can be turned";
    this.relight(true);
  }

  // The colours under the chosen light, as it is turned; milliseconds that this took the processor.
  relight(anew) {
    const start = performance.now(), {light} = this;
    if (light.field) { this.expose(); this.draw(); return 0; }
    const texels = light.turning ? light.turning.at(this.turn) : light.texels;
    this.gpu.setDistant(texels ? this.evaluator.under(texels) : null);
    if (this.gpu.gloss) this.gpu.gloss.setLight(texels, light, this.turn);
    this.mix();
    const spent = performance.now() - start;
    if (anew) this.expose();
    this.draw();
    return spent;
  }

  // Strengths of all that shines.
  mix() {
    if (this.light.field) return;
    const world = !!this.light.texels, env = 2 ** this.strength, {sources} = this.facts;
    const values = sources.map(({kind, in_world}, k) => kind === "world" ? world * env : in_world && world ? 0 : this.strengths[k]);
    this.gpu.setStrengths(env, values);
  }

  // An exposure that brings the brighter points near white.
  expose() {
    if (this.gpu.viewer) this.gpu.viewer.look(this.orbit.matrices(1).eye);
    const radiance = this.gpu.radiance(), n = this.gpu.n, step = ceil(n / 20000), values = [];
    for (let i = 0; i < n; i += step) values.push(max(radiance[4 * i], radiance[4 * i + 1], radiance[4 * i + 2]));
    values.sort((a, b) => a - b);
    this.bright = values[floor(values.length * 0.95)] || values[values.length - 1] || 1;
    this.exposed();
  }

  exposed() {
    const auto = $("auto").checked ? 0.8 / this.bright : 1;
    this.look = {filmic: $("look").value === "agx", exposure: auto * 2 ** this.exposure};
  }

  draw() {
    const {width, height} = this.gl.canvas, {light} = this;
    if (!light) return;
    const sky = $("sky").checked && light.image ? {turn: light.turning ? this.turn : 0, strength: 2 ** this.strength} : null;
    this.gpu.draw(this.orbit.matrices(width / height), this.look, sky);
  }

  // At the next picture, and not more often than there are pictures.
  later(what) {
    if (!Object.keys(this.wanted).length) requestAnimationFrame(() => {
      const {relight, mix} = this.wanted;
      this.wanted = {};
      if (relight) this.relight();
      else { if (mix) this.mix(); this.draw(); }
    });
    this.wanted[what] = true;
  }

  async read(file) {
    if (!this.own) return say("A light field has lights of its own; images do not light it.", true);
    say(`Reading ${file.name} …`);
    await new Promise(done => setTimeout(done, 20));
    try {
      const image = await readImage(file.name, new Uint8Array(await file.arrayBuffer()));
      this.choose(this.add(file.name, () => image));
      say("");
    } catch (error) { say(told(error, `${file.name}: cannot be read`), true); }
  }

  resize() {
    const {canvas} = this.gl, ratio = min(window.devicePixelRatio || 1, 2);
    const width = max(1, round(canvas.clientWidth * ratio)), height = max(1, round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      [canvas.width, canvas.height] = [width, height];
      this.draw();
    }
  }

  slider(box, name, value, change) {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, {type: "range", min: 0, max: 3, step: 0.01, value});
    label.append(name, input);
    box.append(label);
    input.oninput = () => change(+input.value);
    return input;
  }

  controls() {
    const {facts, gl: {canvas}, orbit} = this, {sources, start} = facts;
    sources.forEach(({name, kind}, k) => {
      this.strengths[k] = kind === "emitter" || (kind === "lamp" && start.lamps) ? 1 : 0;
      if (kind !== "world") this.slider($("sources"), name, this.strengths[k], value => { this.strengths[k] = value; this.later("mix"); });
    });
    if (this.field) this.field.controls(this);
    const range = (id, change, what) => $(id).oninput = () => { change(+$(id).value); this.later(what); };
    range("turn", value => this.turn = value, "relight");
    range("strength", value => this.strength = value, "mix");
    range("exposure", value => { this.exposure = value; this.exposed(); }, "draw");
    $("light").onchange = () => this.choose($("light").value);
    for (const id of ["look", "auto"]) $(id).onchange = () => { this.exposed(); this.later("draw"); };
    $("sky").onchange = () => this.later("draw");
    $("file").onchange = () => { if ($("file").files.length) this.read($("file").files[0]); $("file").value = ""; };
    $("reset").onclick = canvas.ondblclick = () => { orbit.reset(); this.later("draw"); };
    $("fold").onclick = () => $("fold").setAttribute("aria-expanded", document.body.classList.toggle("folded") ? "false" : "true");
    window.ondragover = e => e.preventDefault();
    window.ondrop = e => { e.preventDefault(); if (e.dataTransfer.files.length) this.read(e.dataTransfer.files[0]); };
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", e => { e.preventDefault(); say("The graphics were reset; reload the page.", true); });
    this.touch(canvas, orbit);
  }

  touch(canvas, orbit) {
    const fingers = new Map();
    canvas.oncontextmenu = e => e.preventDefault();
    canvas.onpointerdown = e => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, e); };
    canvas.onpointerup = canvas.onpointercancel = e => fingers.delete(e.pointerId);
    canvas.onpointermove = e => {
      const before = fingers.get(e.pointerId), size = canvas.clientHeight;
      if (!before) return;
      const x = (e.clientX - before.clientX) / size, y = (e.clientY - before.clientY) / size;
      if (fingers.size > 1) {
        const other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
        const apart = f => hypot(f.clientX - other.clientX, f.clientY - other.clientY) || 1;
        orbit.zoom(apart(before) / apart(e));
        orbit.pan(x / 2, y / 2);
      } else if (e.shiftKey) this.shine(this.turn + 180 * x);
      else if (e.buttons & 6 || e.ctrlKey) orbit.pan(x, y);
      else orbit.turn(4 * x, 4 * y);
      fingers.set(e.pointerId, e);
      this.later("draw");
    };
    canvas.onwheel = e => { e.preventDefault(); orbit.zoom(exp(Math.sign(e.deltaY) * 0.1)); this.later("draw"); };
    canvas.onkeydown = e => {
      const move = {ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]}[e.key];
      if (move) { if (e.shiftKey) this.shine(this.turn + 50 * move[0]); else orbit.turn(...move); }
      else if (e.key === "+" || e.key === "-") orbit.zoom(e.key === "+" ? 0.9 : 1.1);
      else return;
      e.preventDefault();
      this.later("draw");
    };
  }

  // Turn the light to so many degrees, where it can be turned.
  shine(degrees) {
    if (!this.light.turning) return;
    this.turn = degrees - 360 * floor((degrees + 180) / 360);
    $("turn").value = this.turn;
    this.later("relight");
  }
}

async function begin() {
  const {PRT_DATA: own, PRT_FIELD: field} = window, data = own || field, canvas = $("canvas");
  if (!data) fail("The bake's data are missing: data.js must lie beside this page.");
  const gl = canvas.getContext("webgl2", {antialias: true, alpha: false, preserveDrawingBuffer: true});
  if (!gl) fail("This page needs WebGL 2: use a newer browser, or turn hardware acceleration on.");
  const page = PRT.page = new Page(gl, data, own && await unpack(own.arrays), field && await unpack(field.arrays));
  page.controls();
  page.resize();
  const {light} = data.start, names = [...page.images.keys()];
  page.choose(light === "image" || !own ? names[0] : light === "world" && data.world_factor ? "The scene's world" : "None");
  $("about").textContent = data.about + (own && field ? " " + field.about : "");
  document.body.classList.remove("loading");
  say("");
}

PRT.ready = new Promise(done => addEventListener("DOMContentLoaded", done)).then(begin).catch(error => {
  say(told(error, "The page cannot be shown"), true);
});
