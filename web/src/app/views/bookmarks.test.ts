import * as THREE from 'three';
import { describe, expect, it, vi } from 'vitest';
import { Bookmarks, readBookmarks, writeBookmarks } from './bookmarks';

const makeView = (x: number) => ({ eye: new THREE.Vector3(x, 2, 3), target: new THREE.Vector3(), fov: 40 });

describe('bookmarks', () => {
  it('are read as they were written', () => {
    const one = { name: 'Square', view: makeView(1) };
    const again = readBookmarks(writeBookmarks([one]));
    expect(again).toHaveLength(1);
    expect(again[0].name).toBe('Square');
    expect(again[0].view.eye.distanceTo(one.view.eye)).toBeLessThan(1e-3);
  });

  it.each([null, '', 'x', '{}', '[1, null, {}, {"name": 3}, {"view": "eye=1"}]', '[{"name": "a", "view": 7}]'])(
    'are none in %j', (text) => {
      expect(readBookmarks(text)).toEqual([]);
    });

  it("keep new names in the browser's storage", () => {
    const texts = new Map<string, string>();
    vi.stubGlobal('localStorage', { getItem: (key: string) => texts.get(key) ?? null, setItem: (key: string, text: string) => texts.set(key, text) });
    const bookmarks = new Bookmarks('a');
    bookmarks.keep(makeView(1));
    bookmarks.keep(makeView(2));
    expect(bookmarks.selected?.name).toBe('View 2');
    bookmarks.select(bookmarks.list[0]);
    bookmarks.rename('Square');
    const names = () => bookmarks.list.map(({ name }) => name);
    expect(names()).toEqual(['Square', 'View 2']);
    bookmarks.rename('x'.repeat(100));
    expect(bookmarks.selected?.name).toBe('x'.repeat(80));
    bookmarks.rename('View 2'); // temporarily equal to another name
    bookmarks.rename('View 2 again');
    bookmarks.keep(makeView(3));
    expect(names()).toEqual(['View 2 again', 'View 2', 'View 3']);
    expect(new Bookmarks('a').list.map(({ name }) => name)).toEqual(names());
    vi.unstubAllGlobals();
  });

  it('of a world are renamed together with equal ones of this browser', () => {
    const bookmarks = new Bookmarks('a');
    bookmarks.keep(makeView(1));
    bookmarks.showWorld([{ name: 'View 1', view: makeView(1) }, { name: 'Harbour', view: makeView(2) }]);
    bookmarks.select(bookmarks.list[0]);
    bookmarks.rename('Square');
    expect(bookmarks.list.map(({ name }) => name)).toEqual(['Square', 'Harbour']);
    bookmarks.showWorld([]);
    expect(bookmarks.list.map(({ name }) => name)).toEqual(['Square']);
    expect(bookmarks.selected).toBe(bookmarks.list[0]);
  });
});
