// What three.js makes of a .glb: each mesh with its corners in the world, and their attributes.
import { readFileSync } from "node:fs";
import { Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const file = readFileSync(process.argv[2]);
const buffer = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
const gltf = await new GLTFLoader().parseAsync(buffer, "");
gltf.scene.updateMatrixWorld(true);
const meshes = [];
gltf.scene.traverse((mesh) => {
  if (!mesh.isMesh) return;
  const { attributes, index } = mesh.geometry;
  const corners = Array.from(index.array);
  const place = new Vector3();
  const rows = (attribute, width) =>
    corners.map((i) => Array.from({ length: width }, (_, k) => attribute.getComponent(i, k)));
  meshes.push({
    // Meshes of several materials are groups, which have the object's own name.
    object: (mesh.parent.isGroup && mesh.parent.userData.prt_object) || mesh.userData.prt_object,
    material: mesh.material.name,
    kind: mesh.material.type,
    coloured: mesh.material.vertexColors,
    mirrored: mesh.matrixWorld.determinant() < 0,
    places: corners.map((i) =>
      place.fromBufferAttribute(attributes.position, i).applyMatrix4(mesh.matrixWorld).toArray()),
    colours: rows(attributes.color, 3),
    radiance: rows(attributes._prt_radiance, 3),
    uv: attributes.uv ? rows(attributes.uv, 2) : null,
  });
});
console.log(JSON.stringify({ meshes, extras: gltf.parser.json.extras }));
