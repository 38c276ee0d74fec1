// The same choices as the renderer on the processor makes: tests/golden/selection.json, which its selector wrote.
import { readFileSync } from 'node:fs';
import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { picturesOf } from './draw/picture';
import { tileView } from './picture-view';
import { TileSelector } from './stream/tile-selector';
import type { TileNode, TileTree } from './stream/tile-tree';
import { madeTree } from './testing/made-tree';
import type { Vec3 } from './tiles/tileset';

interface GoldenTile extends Omit<TileNode, 'cells' | 'content'> {
  cells: [number, number, number, number];
  hasContent: boolean;
}

interface GoldenView {
  camera: { focal: number; width: number; height: number; eye: Vec3; right: Vec3; down: Vec3; forward: Vec3 };
  held: number[];
  budget: number;
  wanted: number[];
  refused: number;
  sharing: { wanted: number[]; refused: number }; // where tiles share resources
  cut: [number, number][];
  surround: number;
}

const golden = JSON.parse(readFileSync(new URL('../../tests/golden/selection.json', import.meta.url), 'utf8')) as {
  frame: { near: number; low: Vec3; high: Vec3 };
  tree: Omit<TileTree, 'tiles'> & { tiles: GoldenTile[] };
  bytes: number[];
  resources: number[][];
  bytesOfResources: number[];
  views: GoldenView[];
};

function treeOf({ tiles, ...rest }: typeof golden.tree): TileTree {
  const { content } = madeTree(1).tiles[0];
  return {
    ...rest,
    tiles: tiles.map(({ cells: [i0, j0, i1, j1], hasContent, ...tile }) => (
      { ...tile, cells: { i0, j0, i1, j1 }, content: hasContent ? content : undefined })),
  };
}

function viewOf({ focal, width, height, eye, right, down, forward }: GoldenView['camera']) {
  const camera = new THREE.PerspectiveCamera();
  const axis = (a: Vec3, sign: number) => new THREE.Vector3(...a).multiplyScalar(sign);
  camera.matrixWorld.makeBasis(axis(right, 1), axis(down, -1), axis(forward, -1)).setPosition(...eye);
  camera.matrixWorldInverse.copy(camera.matrixWorld).invert();
  const [x, y] = [width / 2 / focal, height / 2 / focal];
  camera.projectionMatrix.makePerspective(-0.1 * x, 0.1 * x, 0.1 * y, -0.1 * y, 0.1, 1e4);
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  const renderer = { xr: { enabled: false }, getDrawingBufferSize: (size: THREE.Vector2) => size.set(width, height) };
  const { near, low, high } = golden.frame;
  const inScene = new THREE.Matrix4();
  const { pictures } = picturesOf(camera, renderer as unknown as THREE.WebGLRenderer, inScene, 1);
  return tileView({ near, box: { low, high } }, pictures[0], inScene);
}

describe('the view of a camera', () => {
  it('has the selector choose as the renderer on the processor does, view after view', () => {
    const selector = new TileSelector(treeOf(golden.tree));
    expect(golden.views.length).toBeGreaterThan(100);
    golden.views.forEach(({ camera, held, budget, wanted, refused, cut, surround }, i) => {
      const holds = (tile: number) => held.includes(tile);
      const view = viewOf(camera);
      const choice = selector.choose(view, {
        budget, holds, bytesOf: (tile) => golden.bytes[tile], canBeHad: () => true, resourcesOf: () => [], bytesOfResource: () => 0,
      });
      const drawn = selector.cut(view, holds);
      expect({ i, ...choice }).toEqual({ i, wanted, refused });
      const visible = drawn.tiles.filter((one) => one.visible).map((one) => [one.tile, one.content]);
      expect({ i, surround: drawn.surround, cut: visible }).toEqual({ i, surround, cut });
    });
  });

  it('has the selector charge what tiles share as the renderer on the processor does', () => {
    const selector = new TileSelector(treeOf(golden.tree));
    golden.views.forEach(({ camera, held, budget, sharing }, i) => {
      const choice = selector.choose(viewOf(camera), {
        budget,
        holds: (tile) => held.includes(tile),
        bytesOf: (tile) => golden.bytes[tile],
        canBeHad: () => true,
        resourcesOf: (tile) => golden.resources[tile],
        bytesOfResource: (id) => golden.bytesOfResources[id],
      });
      expect({ i, ...choice }).toEqual({ i, ...sharing });
    });
  });
});
