// Khronos' validator on a .glb: its report as JSON.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

const bytes = new Uint8Array(readFileSync(process.argv[2]));
const { issues } = await validator.validateBytes(bytes, { maxIssues: 100 });
console.log(JSON.stringify(issues));
