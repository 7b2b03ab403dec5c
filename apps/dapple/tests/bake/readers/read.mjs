// Reads a scene and its baked file: says what the validator finds, and on which nodes triangles differ.
// node read.mjs BEFORE AFTER, both .glb or .gltf; prints JSON.

import { readFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { NodeIO } from "@gltf-transform/core";
import validator from "gltf-validator";

const [before, after] = process.argv.slice(2);

/** Errors and warnings of a file, as `code at pointer`. */
async function validate(path) {
  const options = {
    uri: path,
    maxIssues: 100,
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(join(dirname(path), decodeURIComponent(uri)))),
  };
  const { issues } = await validator.validateBytes(new Uint8Array(await readFile(path)), options);
  const of = (severity) =>
    issues.messages.filter((m) => m.severity === severity).map((m) => `${m.code} at ${m.pointer}: ${m.message}`);
  return { errors: of(0), warnings: of(1), counted: issues.numErrors };
}

/** The corners of a primitive's triangles, in the order they are drawn in. */
function corners(primitive) {
  const indices = primitive.getIndices();
  const count = indices ? indices.getCount() : primitive.getAttribute("POSITION").getCount();
  const at = (i) => (indices ? indices.getScalar(i) : i);
  const mode = primitive.getMode();
  const triangles = [];
  if (mode === 4) for (let i = 0; i + 2 < count; i += 3) triangles.push([at(i), at(i + 1), at(i + 2)]);
  if (mode === 5) {
    for (let i = 0; i + 2 < count; i++) triangles.push(i % 2 ? [at(i + 1), at(i), at(i + 2)] : [at(i), at(i + 1), at(i + 2)]);
  }
  if (mode === 6) for (let i = 1; i + 1 < count; i++) triangles.push([at(0), at(i), at(i + 1)]);
  return triangles;
}

/** All triangles of a mesh by the positions of their corners, sorted: what is drawn, whatever shares vertices. */
function triangles(mesh) {
  const found = [];
  for (const primitive of mesh.listPrimitives()) {
    const positions = primitive.getAttribute("POSITION");
    const place = (i) => positions.getElement(i, []).map(Math.fround).join(" ");
    for (const triangle of corners(primitive)) {
      const places = triangle.map(place);
      // It may begin at any of its corners.
      const first = places.indexOf([...places].sort()[0]);
      found.push([...places.slice(first), ...places.slice(0, first)].join(", "));
    }
  }
  return found.sort();
}

const io = new NodeIO();
const [a, b] = (await Promise.all([io.read(before), io.read(after)])).map((d) => d.getRoot().listNodes());
const differing = [];
let compared = 0;
for (let i = 0; i < Math.max(a.length, b.length); i++) {
  const [from, to] = [a[i], b[i]];
  const moved = !from || !to || String(from.getWorldMatrix()) !== String(to.getWorldMatrix());
  const [mesh, baked] = [from?.getMesh(), to?.getMesh()];
  if (moved || !mesh !== !baked) {
    differing.push(i);
  } else if (mesh) {
    const [is, was] = [triangles(baked), triangles(mesh)];
    compared += was.length;
    if (is.length !== was.length || is.some((t, k) => t !== was[k])) differing.push(i);
  }
}
const counts = { nodes: b.length, triangles: compared };
console.log(JSON.stringify({ ...(await validate(after)), before: await validate(before), differing, ...counts }));
