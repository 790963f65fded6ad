// Relights a .glb of `prt export glb --weights` or `--harmonics` in three.js.
//
//   const gltf = await new GLTFLoader().loadAsync("scene.glb");
//   const prt = await PRTScene.of(gltf);
//   prt.relight((direction, colour) => ...);   // the radiance that comes from there, y up
//
// Lights of `--lights` are blended by their names: blendLights(gltf, { Day: 0.7, Night: 0.3 });
//
// Vertex colours are linear radiance; the renderer's tone mapping and colour space come after them.
import {
  BufferAttribute, DataTexture, FloatType, NearestFilter, RGBAFormat, ShaderMaterial, Vector3,
} from "three";

// The colour of a vertex by its cluster's row of `products`: the mean, then a texel a component.
export const weightsGLSL = (said, albedo) => `
${said.attributes.map((name) => `in vec4 ${name.toLowerCase()};`).join("\n")}
in float _prt_cluster;
${albedo ? "in vec3 _prt_albedo;" : ""}
uniform highp sampler2D products;

vec3 prtRow(int k) {
  return texelFetch(products, ivec2(k, int(_prt_cluster + 0.5)), 0).rgb;
}

vec3 prtColour() {
  vec3 colour = prtRow(0);
${Array.from({ length: said.components }, (_, k) =>
    `  colour += _prt_w${k >> 2}[${k & 3}] * prtRow(${k + 1});`).join("\n")}
  return ${albedo ? "_prt_albedo * colour" : "colour"};
}`;

// The colour of a vertex by the nine coefficients of the light.
export const harmonicsGLSL = (said) => `
${said.attributes.map((name) => `in vec3 ${name.toLowerCase()};`).join("\n")}
uniform vec3 coefficients[9];

vec3 prtColour() {
  return ${said.attributes.map((name, k) =>
    `${name.toLowerCase()} * coefficients[${k}]`).join("\n    + ")};
}`;

// (rows, 3) of a matrix (rows, columns) times light (columns, 3).
function times(matrix, light, rows, columns, scale) {
  const result = new Float32Array(rows * 3);
  for (let row = 0; row < rows; row++) {
    let r = 0, g = 0, b = 0;
    for (let column = 0, at = row * columns; column < columns; column++, at++) {
      const value = matrix[at];
      r += value * light[3 * column];
      g += value * light[3 * column + 1];
      b += value * light[3 * column + 2];
    }
    const factor = scale ? scale[row] : 1;
    result.set([r * factor, g * factor, b * factor], 3 * row);
  }
  return result;
}

// What the rows of all clusters give under light (texels, 3): four numbers a row, for a texture.
export function productsOf(side, light) {
  const rows = side.clusters * (1 + side.components);
  const result = new Float32Array(rows * 4);
  for (const group of side.groups) {
    let each = times(group.rows, light, group.count, side.texels, group.scale);
    if (group.mix) each = times(group.mix, each, rows, group.count, null);
    for (let row = 0; row < rows; row++)
      for (let channel = 0; channel < 3; channel++)
        result[4 * row + channel] += group.shares[channel] * each[3 * row + channel];
  }
  return result;
}

// Nine (3,) coefficients of light: a mean over directions that are spread evenly.
export function coefficientsOf(radiance, count = 4096) {
  const sums = Array.from({ length: 9 }, () => new Vector3());
  const direction = new Vector3(), colour = new Vector3();
  for (let i = 0; i < count; i++) {
    const y = 1 - (2 * i + 1) / count, angle = i * Math.PI * (3 - Math.sqrt(5));
    const side = Math.sqrt(1 - y * y);
    direction.set(side * Math.cos(angle), y, side * Math.sin(angle));
    radiance(direction, colour);
    harmonics(direction).forEach((value, k) =>
      sums[k].addScaledVector(colour, (value * 4 * Math.PI) / count));
  }
  return sums;
}

export function harmonics({ x, y, z }) {
  return [
    0.282094792, 0.488602512 * y, 0.488602512 * z, 0.488602512 * x,
    1.092548431 * x * y, 1.092548431 * y * z, 0.315391565 * (3 * z * z - 1),
    1.092548431 * x * z, 0.546274215 * (x * x - y * y),
  ];
}

// Shows the sum of the lights of a file, each times its weight; those not named keep the file's own.
export function blendLights(gltf, weights = {}) {
  const { lights } = gltf.parser.json.extras.PRT;
  gltf.scene.traverse((mesh) => {
    if (!mesh.isMesh) return;
    const { attributes } = mesh.geometry;
    const total = new Float32Array(3 * attributes.position.count);
    for (const light of lights) {
      const weight = weights[light.name] ?? light.weight;
      const { array } = attributes[light.attribute.toLowerCase()];
      if (weight) for (let i = 0; i < total.length; i++) total[i] += weight * array[i];
    }
    mesh.geometry.setAttribute("color", new BufferAttribute(total, 3));
  });
}

export class PRTScene {
  // Reads the light's side, and gives every mesh a material that is relit.
  static async of(gltf, { low = false } = {}) {
    const said = gltf.parser.json.extras.PRT;
    const array = async (number) => (await gltf.parser.getDependency("accessor", number)).array;
    const scene = new PRTScene();
    if (said.weights && !low) {
      const side = { ...said.weights, groups: [] };
      for (const group of said.weights.groups) {
        const read = { ...group, rows: await array(group.rows) };
        // Whole numbers of 16 bits are shares of the row's largest.
        read.scale = (await array(group.scale)).map((value) => value / 32767);
        if ("mix" in group) read.mix = await array(group.mix);
        side.groups.push(read);
      }
      scene.directions = await array(side.directions);
      scene.side = side;
      scene.texture = new DataTexture(
        new Float32Array(side.clusters * (1 + side.components) * 4),
        1 + side.components, side.clusters, RGBAFormat, FloatType);
      scene.texture.minFilter = scene.texture.magFilter = NearestFilter;
      scene.uniforms = { products: { value: scene.texture } };
      scene.colour = weightsGLSL(said.weights, said.colours === "radiance");
    } else {
      scene.uniforms = { coefficients: { value: Array.from({ length: 9 }, () => new Vector3()) } };
      scene.colour = harmonicsGLSL(said.harmonics);
    }
    gltf.scene.traverse((mesh) => {
      if (mesh.isMesh) mesh.material = scene.material(mesh.material);
    });
    return scene;
  }

  material(own) {
    const material = new ShaderMaterial({
      name: own.name,
      side: own.side,
      transparent: own.transparent,
      uniforms: {
        ...this.uniforms, base: { value: own.color }, opacity: { value: own.opacity },
      },
      vertexShader: `${this.colour}
varying vec3 shown;
void main() {
  shown = prtColour();
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`,
      fragmentShader: `varying vec3 shown;
uniform vec3 base;
uniform float opacity;
void main() {
  gl_FragColor = vec4(base * max(shown, 0.0), opacity);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`,
    });
    return material;
  }

  // `radiance(direction, colour)` sets the colour (Vector3) of the light from a direction, y up.
  relight(radiance) {
    if (!this.side) {
      coefficientsOf(radiance).forEach((sum, k) => this.uniforms.coefficients.value[k].copy(sum));
      return;
    }
    const light = new Float32Array(this.side.texels * 3);
    const direction = new Vector3(), colour = new Vector3();
    for (let texel = 0; texel < this.side.texels; texel++) {
      radiance(direction.fromArray(this.directions, 3 * texel), colour);
      colour.toArray(light, 3 * texel);
    }
    this.texture.image.data.set(productsOf(this.side, light));
    this.texture.needsUpdate = true;
  }
}
