// Compares the choices with those of the CPU renderer's selector, which wrote tests/golden/selection.json.
import { readFileSync } from 'node:fs';
import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { makePictures } from './draw/picture';
import { tileView } from './picture-view';
import { TileSelector } from './stream/tile-selector';
import type { TileNode, TileTree } from './stream/tile-tree';
import { testTree } from './testing/test-tree';
import type { Vec3 } from './tiles/tileset';

interface GoldenTile extends Omit<TileNode, 'cells' | 'content'> {
  cells: [number, number, number, number];
  hasContent: boolean;
}

interface GoldenView {
  camera: { focal: number; width: number; height: number; eye: Vec3; right: Vec3; down: Vec3; forward: Vec3 };
  resident: number[]; // tiles in memory
  budget: number;
  requested: number[];
  refused: number;
  sharing: { requested: number[]; refused: number }; // when tiles share resources
  cut: [number, number][];
  backgroundBlock: number;
}

const golden = JSON.parse(readFileSync(new URL('../../tests/golden/selection.json', import.meta.url), 'utf8')) as {
  frame: { near: number; low: Vec3; high: Vec3 };
  tree: Omit<TileTree, 'tiles'> & { tiles: GoldenTile[] };
  bytes: number[];
  resources: number[][];
  bytesOfResources: number[];
  views: GoldenView[];
};

function makeTree({ tiles, ...rest }: typeof golden.tree): TileTree {
  const { content } = testTree(1).tiles[0];
  return {
    ...rest,
    tiles: tiles.map(({ cells: [i0, j0, i1, j1], hasContent, ...tile }) => (
      { ...tile, cells: { i0, j0, i1, j1 }, content: hasContent ? content : undefined })),
  };
}

function makeView({ focal, width, height, eye, right, down, forward }: GoldenView['camera']) {
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
  const { pictures } = makePictures(camera, renderer as unknown as THREE.WebGLRenderer, inScene, 1);
  return tileView({ near, box: { low, high } }, pictures[0], inScene);
}

describe('the view of a camera', () => {
  it('makes the selector choose as the CPU renderer does, view after view', () => {
    const selector = new TileSelector(makeTree(golden.tree));
    expect(golden.views.length).toBeGreaterThan(100);
    golden.views.forEach(({ camera, resident, budget, requested, refused, cut, backgroundBlock }, i) => {
      const holds = (tile: number) => resident.includes(tile);
      const view = makeView(camera);
      const choice = selector.choose(view, {
        budget, holds, estimateBytes: (tile) => golden.bytes[tile], canBeHad: () => true, hasFailed: () => false, tileResources: () => [], bytesOfResource: () => 0,
      });
      const drawn = selector.cut(view, holds);
      expect({ i, ...choice }).toEqual({ i, requested, refused });
      const visible = drawn.tiles.filter((one) => one.visible).map((one) => [one.tile, one.content]);
      expect({ i, backgroundBlock: drawn.backgroundBlock, cut: visible }).toEqual({ i, backgroundBlock, cut });
    });
  });

  it('makes the selector charge shared resources as the CPU renderer does', () => {
    const selector = new TileSelector(makeTree(golden.tree));
    golden.views.forEach(({ camera, resident, budget, sharing }, i) => {
      const choice = selector.choose(makeView(camera), {
        budget,
        holds: (tile) => resident.includes(tile),
        estimateBytes: (tile) => golden.bytes[tile],
        canBeHad: () => true,
        hasFailed: () => false,
        tileResources: (tile) => golden.resources[tile],
        bytesOfResource: (id) => golden.bytesOfResources[id],
      });
      expect({ i, ...choice }).toEqual({ i, ...sharing });
    });
  });
});
