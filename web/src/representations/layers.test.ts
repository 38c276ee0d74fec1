// Tests which folders may import which, and that no shared file names a representation: a new one is a folder here and
// a row in each table.
import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join, relative, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';
import { kCodecs } from './codecs';
import { kDisplayModes } from './drawers';

const kRepresentations = Object.keys(kCodecs);
const source = fileURLToPath(new URL('../', import.meta.url));

// The folders that each folder's files may import, besides their own and files outside all folders.
const kMayUse: Record<string, string[]> = {
  tiles: [],
  stream: ['tiles'],
  draw: ['tiles'],
  raymarch: ['tiles', 'draw'],
  ...Object.fromEntries(kRepresentations.map((name) => [`representations/${name}`, ['tiles', 'draw', 'raymarch']])),
};

function listSourceFiles(folder: string): string[] {
  return readdirSync(join(source, folder))
    .filter((name) => name.endsWith('.ts') && !name.endsWith('.test.ts'))
    .map((name) => join(folder, name));
}

function readCode(file: string): string {
  return readFileSync(join(source, file), 'utf8').replace(/(^|\s)\/\/.*$/gm, '');
}

// Returns the imported files, relative to `src`, and packages. `loaded` excludes type-only imports.
function findImports(file: string, loaded = false): string[] {
  const imports = [...readCode(file).matchAll(/(?:import|export) (type )?[^;']*?from '([^']+)'/g)];
  return imports
    .filter(([, isType, path]) => !(loaded && isType) && !path.includes('?'))
    .map(([, , path]) => (path.startsWith('.') ? `${relative(source, resolve(source, dirname(file), path))}.ts` : path));
}

describe('the folders of the source', () => {
  it.each(Object.entries(kMayUse))('import only the allowed ones: %s', (folder, others) => {
    const files = listSourceFiles(folder);
    expect(files.length).toBeGreaterThan(1);
    for (const file of files) {
      for (const used of findImports(file).filter((path) => path.endsWith('.ts'))) {
        const from = dirname(used);
        expect(['.', folder, ...others], `${file} imports ${used}`).toContain(from);
      }
    }
  });

  it('name no representation if they are shared', () => {
    // three.js calls what it draws a mesh, so that this name counts as a string alone.
    const names = kRepresentations.map((name) => (name === 'mesh' ? `'${name}'` : `\\b${name}`));
    const word = new RegExp(names.join('|'), 'i');
    const files = [...['tiles', 'stream', 'draw', 'raymarch', '.'].flatMap(listSourceFiles)];
    expect(files.length).toBeGreaterThan(30);
    for (const file of files) expect(word.exec(readCode(file))?.[0], file).toBeUndefined();
  });

  it('keep three.js out of what the workers load', () => {
    const reached = new Set<string>(['worker.ts']);
    for (const file of reached) {
      for (const path of findImports(file, true)) {
        expect(path, `${file} imports it`).not.toMatch(/^three/);
        if (path.endsWith('.ts') && !path.startsWith('@')) reached.add(path);
      }
    }
    for (const name of kRepresentations) expect([...reached].some((file) => file.startsWith(`representations/${name}/`))).toBe(true);
  });
});

describe('the display modes', () => {
  it('are those of all representations, the shared ones first', () => {
    expect(kDisplayModes.slice(0, 7)).toEqual(['colour', 'diffuse', 'specular', 'features', 'depth', 'blocks', 'levels']);
    expect(new Set(kDisplayModes).size).toBe(kDisplayModes.length);
  });
});
