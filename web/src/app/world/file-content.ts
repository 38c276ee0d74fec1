// Short digests of files, by which each model finds its own among several files of one name. They are not secure
// against forgery.
const kChunk = 1 << 22;
const known = new WeakMap<Blob, Promise<string>>();

// Returns the size in bytes and a digest, such as '684-0c9f1d2e7a5b3344'.
export function computeContentId(file: Blob): Promise<string> {
  const digest = known.get(file) ?? computeDigest(file);
  known.set(file, digest);
  digest.catch(() => known.delete(file));
  return digest;
}

// Two lanes of FNV-1a, the second of which processes mixed words.
async function computeDigest(file: Blob): Promise<string> {
  let [a, b] = [0x811c9dc5, 0x9e3779b9];
  for (let at = 0; at < file.size; at += kChunk) {
    const bytes = new Uint8Array(await file.slice(at, at + kChunk).arrayBuffer());
    for (const byte of bytes) {
      a = Math.imul(a ^ byte, 0x01000193);
      b = Math.imul(b ^ byte ^ (b >>> 15), 0x85ebca6b);
    }
  }
  const hex = (x: number) => (x >>> 0).toString(16).padStart(8, '0');
  return `${file.size}-${hex(a)}${hex(b)}`;
}
