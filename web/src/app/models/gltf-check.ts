// Rejects glTF files that would make the glTF loader of three.js fetch addresses, wait forever, or fail without a
// message.
import { SceneError } from '../../scene-error';
import { getArray, getField, getString, wholeFrom, getInteger, type Json } from '../../tiles/json-fields';
import { findFile, isOfNetwork, baseName, type ModelFile } from './model-files';

const kMagic = 0x46546c67; // "glTF"
const kJsonChunk = 0x4e4f534a; // "JSON"
// Limit on numbers that need more memory than they occupy in the file: accessors without data, or compressed ones.
const kMaxNumbers = 1 << 26;
const kComponents: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT2: 4, MAT3: 9, MAT4: 16 };

const kRemedies: Record<string, string> = {
  KHR_draco_mesh_compression: 'export it without Draco compression',
  KHR_texture_basisu: 'export it with PNG, JPEG or WebP textures',
};

// Throws SceneError that names the file. Returns true if its buffers are compressed with meshopt.
export function checkGltf(bytes: Uint8Array, main: ModelFile, files: readonly ModelFile[]): { needsMeshopt: boolean } {
  const name = baseName(main.path);
  const fail = (reason: string, remedy = 'export it again', place = ''): never => {
    throw new SceneError(name, place, reason, remedy);
  };
  const text = isBinary(bytes) ? jsonChunk(bytes) : bytes;
  if (!text) return fail('is cut off');
  let gltf: Json;
  try {
    gltf = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(text));
  } catch {
    return fail('is not a glTF file');
  }
  if (!/^2\./.test(getString(getField(gltf, 'asset'), 'version') ?? '')) fail('is not glTF 2.0', 'export it as glTF 2.0');
  const required = getStrings(gltf, 'extensionsRequired');
  const used = [...getStrings(gltf, 'extensionsUsed'), ...required];
  const draco = 'KHR_draco_mesh_compression';
  const cannot = used.includes(draco) ? draco : required.find((one) => one in kRemedies);
  if (cannot) fail(`uses ${cannot}, which is not read here`, kRemedies[cannot]);
  for (const kind of ['buffers', 'images']) {
    (getArray(gltf, kind) ?? []).forEach((one, i) => {
      const uri = getString(one, 'uri');
      if (uri === undefined || /^(data|blob):/i.test(uri)) return;
      const place = `${kind}[${i}]`;
      if (isOfNetwork(uri)) fail(`asks for ${uri.slice(0, 200)}, and nothing is fetched for a model`, 'export it with all it needs, as GLB', place);
      if (kind === 'buffers' && !findFile(uri, main.path, files)) {
        fail(`needs ${uri.slice(0, 200)}`, 'drop the files together, or their folder', place);
      }
    });
  }
  if (hasCycle(gltf)) fail('has a node that is its own ancestor', 'export it again', 'nodes');
  const claimed = (getArray(gltf, 'accessors') ?? [])
    .filter((one) => getField(one, 'bufferView') === undefined)
    .reduce((sum: number, one) => sum + (getInteger(one, 'count') ?? 0) * (kComponents[getString(one, 'type') ?? ''] ?? 16), 0);
  const unpacked = (getArray(gltf, 'bufferViews') ?? [])
    .map((one) => getField(getField(one, 'extensions'), 'EXT_meshopt_compression'))
    .reduce((sum: number, one) => sum + (getInteger(one, 'count') ?? 0) * (getInteger(one, 'byteStride') ?? 0), 0);
  if (claimed + unpacked / 4 > kMaxNumbers) fail('claims more numbers than it has', 'export it again', 'accessors');
  return { needsMeshopt: used.some((one) => one.endsWith('_meshopt_compression')) };
}

function isBinary(bytes: Uint8Array): boolean {
  return bytes.length >= 12 && new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true) === kMagic;
}

function jsonChunk(bytes: Uint8Array): Uint8Array | undefined {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 20 || view.getUint32(16, true) !== kJsonChunk) return undefined;
  const length = view.getUint32(12, true);
  if (view.getUint32(8, true) > bytes.length || length > bytes.length - 20) return undefined;
  return bytes.subarray(20, 20 + length);
}

function getStrings(gltf: Json, key: string): string[] {
  return (getArray(gltf, key) ?? []).filter((one) => typeof one === 'string');
}

// A node with two parents, or a node that is its own ancestor, is rejected.
function hasCycle(gltf: Json): boolean {
  const nodes = getArray(gltf, 'nodes') ?? [];
  const parents = new Map<number, number>();
  for (const [parent, node] of nodes.entries()) {
    for (const child of getArray(node, 'children') ?? []) {
      const index = wholeFrom(child);
      if (index === undefined || parents.has(index)) return true;
      parents.set(index, parent);
    }
  }
  // Each node has at most one parent here, so the first walk upwards that does not end is a cycle.
  const good = new Set<number>();
  for (let start = 0; start < nodes.length; ++start) {
    const way = new Set<number>();
    for (let at: number | undefined = start; at !== undefined && !good.has(at); at = parents.get(at)) {
      if (way.has(at)) return true;
      way.add(at);
    }
    for (const one of way) good.add(one);
  }
  return false;
}
