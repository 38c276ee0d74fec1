// Trees of tiles without files, for tests.
import type { Vec3 } from '../tiles/tileset';
import type { TileNode, TileTree } from '../stream/tile-tree';
import { TileView } from '../stream/tile-view';

// Builds a city of edge × edge blocks with coarser levels that merge 2 × 2 tiles each, up to one root.
export function testTree(edge: number): TileTree {
  const tiles: TileNode[] = [];
  const levels = Math.ceil(Math.log2(edge));
  const add = (i0: number, j0: number, size: number, level: number, parent: number): number => {
    const i1 = Math.min(i0 + size, edge);
    const j1 = Math.min(j0 + size, edge);
    const number = tiles.length;
    const node: TileNode = {
      parent, children: [], cells: { i0, j0, i1, j1 }, low: [2 * i0 - edge, 2 * j0 - edge, -1],
      high: [2 * i1 - edge, 2 * j1 - edge, 0.5], geometricError: 2 ** level / 128, level, isBackgroundBlock: false,
      content: {
        uri: `tiles/${number}.glb`, cells: { i0, j0, i1, j1 }, box: { low: [0, 0, 0], high: [1, 1, 1] }, backgroundBlock: false,
        resources: [], bytes: 0, level: 0, geometricError: 0,
      },
    };
    tiles.push(node);
    const half = size / 2;
    for (let j = j0; level > 0 && j < j1; j += half) {
      for (let i = i0; i < i1; i += half) node.children.push(add(i, j, half, level - 1, number));
    }
    return number;
  };
  add(0, 0, 2 ** levels, levels, -1);
  return { columns: edge, rows: edge, tiles, backgroundBlock: -1 };
}

// Adds a coarse and a fine background block as the last two tiles.
export function addBackgroundBlocks(tree: TileTree): { coarse: number; fine: number } {
  const { columns, rows, tiles } = tree;
  const coarse = tiles.length;
  const fine = coarse + 1;
  const node: TileNode = {
    ...tiles[0], parent: -1, children: [fine], low: [-columns, -rows, -1], high: [columns, rows, 1],
    geometricError: (4 * columns) / 256, level: 1, isBackgroundBlock: true,
  };
  tiles.push(node, { ...node, parent: coarse, children: [], geometricError: node.geometricError / 2, level: 0 });
  tree.backgroundBlock = coarse;
  return { coarse, fine };
}

// Returns a generator of numbers in [0, 1), which repeats for the same seed.
export function randomNumbers(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

// Returns a view along a direction with a square field of view of 90°.
export function testView(eye: Vec3, yaw: number, pitch: number, focal = 300): TileView {
  const forward: Vec3 = [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)];
  const right: Vec3 = [Math.sin(yaw), -Math.cos(yaw), 0];
  const up: Vec3 = [-Math.cos(yaw) * Math.sin(pitch), -Math.sin(yaw) * Math.sin(pitch), Math.cos(pitch)];
  const plane = (n: Vec3) => [...n, -(n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2])] as unknown as [number, number, number, number];
  const sum = (a: Vec3, b: Vec3, sign: number): Vec3 => [a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]];
  const planes = [plane(forward), ...[right, up].flatMap((side) => [plane(sum(forward, side, 1)), plane(sum(forward, side, -1))])];
  return new TileView(eye, planes, focal, 600 * 600, 0.05);
}
