// Files that were provided together, and how they reference one another.

export interface ModelFile {
  path: string; // as provided: the folders, if any, and the name
  file: Blob;
}

const kModelKinds = ['gltf', 'glb', 'obj', 'fbx'];

// Extensions that a file picker offers.
export const kAccepted = '.gltf,.glb,.bin,.obj,.mtl,.fbx,.json,.png,.jpg,.jpeg,.webp,.tga';

export function baseName(path: string): string {
  return path.slice(path.lastIndexOf('/') + 1);
}

// Returns the file extension in lower case.
export function fileExtension(path: string): string {
  const name = baseName(path);
  return name.includes('.') ? name.slice(name.lastIndexOf('.') + 1).toLowerCase() : '';
}

export function isModel({ path }: ModelFile): boolean {
  return kModelKinds.includes(fileExtension(path));
}

// Returns whether a URI refers to a server, by any protocol.
export function isOfNetwork(uri: string): boolean {
  return /^\s*((https?|ftp|wss?):|[\\/]{2})/i.test(uri);
}

// Returns the file that `from` references as `uri`: relative to its folder, or else the first file of that name in any
// folder.
export function findFile<T extends { path: string }>(uri: string, from: string, files: readonly T[]): T | undefined {
  const folders = from.split('/').slice(0, -1);
  for (const plain of [uri, decoded(uri)]) {
    const parts = [...folders];
    const steps = plain.replaceAll('\\', '/').split('/');
    for (const step of steps) {
      if (step === '..') parts.pop();
      else if (step !== '.' && step !== '') parts.push(step);
    }
    const same = (path: string) => path.normalize().toLowerCase();
    const whole = same(parts.join('/'));
    const last = same(steps[steps.length - 1]);
    const match = files.find(({ path }) => same(path) === whole) ?? files.find(({ path }) => same(baseName(path)) === last);
    if (match) return match;
  }
  return undefined;
}

function decoded(uri: string): string {
  try {
    return decodeURIComponent(uri);
  } catch {
    return uri;
  }
}
