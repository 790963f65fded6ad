// What blendLights shows of a .glb: the colours of all vertices, mesh by mesh, by their objects.
import { readFileSync } from "node:fs";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { blendLights } from "./prt_three.mjs";

const file = readFileSync(process.argv[2]);
const buffer = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
const gltf = await new GLTFLoader().parseAsync(buffer, "");
blendLights(gltf, JSON.parse(process.argv[3]));
const shown = [];
gltf.scene.traverse((mesh) => {
  if (mesh.isMesh) shown.push(Array.from(mesh.geometry.attributes.color.array));
});
console.log(JSON.stringify(shown));
