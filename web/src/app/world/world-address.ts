// Addresses in world.json: of http, of https, or relative to its own.

const kAny = 'http://any.invalid/';

// Of a scene.
export function isAddress(text: string): boolean {
  return resolved(text, kAny) !== undefined;
}

// Undefined where it is none of http or https. `base`: of what names it.
export function resolved(text: string, base: string): string | undefined {
  try {
    const { protocol, href } = new URL(text, base);
    return protocol === 'http:' || protocol === 'https:' ? href : undefined;
  } catch {
    return undefined;
  }
}

// Names of files of models are paths, as they are called on a disk, or whole addresses.
export function isFileAddress(name: string): boolean {
  return /^https?:\/\//i.test(name) ? isAddress(name) : !/^([a-z][a-z0-9+.-]+:|[\\/]{2})/i.test(name);
}

export function addressOfFile(name: string, base: string): string | undefined {
  if (/^https?:\/\//i.test(name)) return resolved(name, base);
  return resolved(name.split('/').map(encodeURIComponent).join('/'), base);
}

// Of `url` seen from `base`, where both are of one server; else as it is. Empty where it is no address.
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
