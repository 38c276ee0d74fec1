import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { readBookmarks, writeBookmarks } from './bookmarks';

describe('bookmarks', () => {
  it('are read as they were written', () => {
    const one = { name: 'Square', view: { eye: new THREE.Vector3(1, 2, 3), target: new THREE.Vector3(), fov: 40 } };
    const again = readBookmarks(writeBookmarks([one]));
    expect(again).toHaveLength(1);
    expect(again[0].name).toBe('Square');
    expect(again[0].view.eye.distanceTo(one.view.eye)).toBeLessThan(1e-3);
  });

  it.each([null, '', 'x', '{}', '[1, null, {}, {"name": 3}, {"view": "eye=1"}]', '[{"name": "a", "view": 7}]'])(
    'are none in %j', (text) => {
      expect(readBookmarks(text)).toEqual([]);
    });
});
