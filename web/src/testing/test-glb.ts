// Builds a glTF file of a cube that is red on all sides.

export interface TestCube {
  edge: number;
  change?: (gltf: any) => void; // changes the JSON before it is written
}

// The cube is centred at the origin.
export function testGlb({ edge, change }: TestCube): Uint8Array<ArrayBuffer> {
  const h = edge / 2;
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [i & 1 ? h : -h, i & 2 ? h : -h, i & 4 ? h : -h]);
  const indices = [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5];
  const buffer = new Uint8Array(96 + 72);
  new Float32Array(buffer.buffer, 0, 24).set(corners);
  new Uint16Array(buffer.buffer, 96, 36).set(indices);
  const gltf = {
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_materials_unlit'],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, name: 'cube' }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorFactor: [1, 0, 0, 1] }, extensions: { KHR_materials_unlit: {} } }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 8, type: 'VEC3', min: [-h, -h, -h], max: [h, h, h] },
      { bufferView: 1, componentType: 5123, count: 36, type: 'SCALAR' },
    ],
    bufferViews: [{ buffer: 0, byteLength: 96 }, { buffer: 0, byteOffset: 96, byteLength: 72 }],
    buffers: [{ byteLength: buffer.length }],
  };
  change?.(gltf);
  return encodeGlb(gltf, buffer);
}

export function encodeGlb(gltf: object, buffer: Uint8Array): Uint8Array<ArrayBuffer> {
  const json = new TextEncoder().encode(JSON.stringify(gltf));
  const jsonLength = 4 * Math.ceil(json.length / 4);
  const file = new Uint8Array(12 + 8 + jsonLength + 8 + buffer.length);
  const view = new DataView(file.buffer);
  [0x46546c67, 2, file.length, jsonLength, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  file.fill(0x20, 20, 20 + jsonLength);
  file.set(json, 20);
  view.setUint32(20 + jsonLength, buffer.length, true);
  view.setUint32(24 + jsonLength, 0x004e4942, true);
  file.set(buffer, 28 + jsonLength);
  return file;
}
