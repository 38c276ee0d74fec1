// Addresses in world.json: http, https, or relative to the world's own address.

const kAny = 'http://any.invalid/';

// Returns whether this is a valid address of a scene.
export function isAddress(text: string): boolean {
  return resolved(text, kAny) !== undefined;
}

// Returns undefined unless the result is http or https. `base` is the address of the referencing file.
export function resolved(text: string, base: string): string | undefined {
  try {
    const { protocol, href } = new URL(text, base);
    return protocol === 'http:' || protocol === 'https:' ? href : undefined;
  } catch {
    return undefined;
  }
}

// Names of model files are paths, as on a disk, or absolute addresses.
export function isFileAddress(name: string): boolean {
  return /^https?:\/\//i.test(name) ? isAddress(name) : !/^([a-z][a-z0-9+.-]+:|[\\/]{2})/i.test(name);
}

export function addressOfFile(name: string, base: string): string | undefined {
  if (/^https?:\/\//i.test(name)) return resolved(name, base);
  return resolved(name.split('/').map(encodeURIComponent).join('/'), base);
}

// Returns `url` relative to `base` if both are on the same server, otherwise unchanged; '' if it is not an address.
export function addressFrom(base: string, url: string): string {
  if (!/^https?:\/\//i.test(url)) return '';
  const [from, to] = [new URL(base), new URL(url)];
  if (from.origin !== to.origin) return url;
  const above = from.pathname.split('/').slice(0, -1);
  const steps = to.pathname.split('/');
  let same = 0;
  while (same < above.length && same < steps.length - 1 && above[same] === steps[same]) ++same;
  const path = [...above.slice(same).map(() => '..'), ...steps.slice(same)].join('/');
  return `${path === '' || path.includes(':') ? './' : ''}${path}${to.search}`;
}
