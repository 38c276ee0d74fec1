import { describe, expect, it } from 'vitest';
import { addressFrom, addressOfFile, resolved } from './world-address';

describe('addresses in a world', () => {
  it("are relative to the world's own address", () => {
    expect(resolved('old.scene', 'https://a/worlds/world.json')).toBe('https://a/worlds/old.scene');
    expect(resolved('data:,x', 'https://a/')).toBeUndefined();
    expect(addressOfFile('car parts/50%#1?.glb', 'https://a/w/world.json')).toBe('https://a/w/car%20parts/50%25%231%3F.glb');
    expect(addressOfFile('../x.glb', 'https://a/w/world.json')).toBe('https://a/x.glb');
    expect(addressOfFile('https://b/x y.glb', 'https://a/w/world.json')).toBe('https://b/x%20y.glb');
  });

  it('are written so that they resolve to the same address', () => {
    for (const base of ['https://a/', 'https://a/w/world.json', 'https://a/w/v/', 'https://a/x/y/z?q#h']) {
      for (const url of ['https://a/scene/tileset.json', 'https://a/w/tileset.json', 'https://a/w/v/a:b.json?x=1', 'https://b/t.json', 'https://a/w/']) {
        expect(resolved(addressFrom(base, url), base)).toBe(url);
      }
    }
    expect(addressFrom('https://a/w/world.json', 'https://a/w/old.scene/tileset.json')).toBe('old.scene/tileset.json');
    expect(addressFrom('https://a/', 'folder garden.scene/')).toBe('');
  });
});
