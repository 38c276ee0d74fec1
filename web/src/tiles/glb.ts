// Reads the container of binary glTF 2.0 files, which are untrusted: docs/tile-format.md, section 5.

export interface Glb {
  json: Uint8Array; // both fields are views of the file
  bytes: Uint8Array; // the binary chunk
}

const kMagic = 0x46546c67; // "glTF"
const kJsonChunk = 0x4e4f534a; // "JSON"
const kBytesChunk = 0x004e4942; // "BIN\0"
const kHeader = 12;
const kChunkHeader = 8;

// Returns undefined unless all lengths match to the byte and the chunks are JSON followed by at most one binary chunk.
export function decodeGlb(file: Uint8Array): Glb | undefined {
  if (file.length < kHeader || file.length % 4 !== 0) return undefined;
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  if (view.getUint32(0, true) !== kMagic || view.getUint32(4, true) !== 2) return undefined;
  if (view.getUint32(8, true) !== file.length) return undefined;
  let json: Uint8Array | undefined;
  let bytes = new Uint8Array(0);
  let chunk = 0;
  for (let at = kHeader; at < file.length; ++chunk) {
    if (file.length - at < kChunkHeader) return undefined;
    const length = view.getUint32(at, true);
    const type = view.getUint32(at + 4, true);
    at += kChunkHeader;
    if (length % 4 !== 0 || length > file.length - at) return undefined;
    const content = file.subarray(at, at + length) as Uint8Array<ArrayBuffer>;
    at += length;
    if ((chunk === 0) !== (type === kJsonChunk)) return undefined;
    if (type === kBytesChunk && chunk !== 1) return undefined;
    if (chunk === 0) json = content;
    if (type === kBytesChunk) bytes = content;
  }
  return json === undefined ? undefined : { json, bytes };
}
