// Files that came together, and how they name one another.

export interface ModelFile {
  path: string; // as it came: folders, if it came with any, and the name
  file: Blob;
}

const kModelKinds = ['gltf', 'glb', 'obj', 'fbx'];

// What a file picker may show.
export const kAccepted = '.gltf,.glb,.bin,.obj,.mtl,.fbx,.json,.png,.jpg,.jpeg,.webp,.tga';

export function nameOf(path: string): string {
  return path.slice(path.lastIndexOf('/') + 1);
}

// The ending of its name, in small letters.
export function kindOf(path: string): string {
  const name = nameOf(path);
  return name.includes('.') ? name.slice(name.lastIndexOf('.') + 1).toLowerCase() : '';
}

export function isModel({ path }: ModelFile): boolean {
  return kModelKinds.includes(kindOf(path));
}

// Of a server, by any protocol of the web.
export function isOfNetwork(uri: string): boolean {
  return /^\s*((https?|ftp|wss?):|[\\/]{2})/i.test(uri);
}

// The file that `from` means by `uri`: seen from its folder, else the first of that name wherever it lies.
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
    const found = files.find(({ path }) => same(path) === whole) ?? files.find(({ path }) => same(nameOf(path)) === last);
    if (found) return found;
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
