import { describe, expect, it } from 'vitest';
import { addSurrounds, madeTree, madeView, randomNumbers } from '../testing/made-tree';
import { TileSelector, type SelectedTile } from './tile-selector';
import { childrenFrontToBack, coarsestTiles, cutFrontToBack, type TileTree } from './tile-tree';
import { jointView } from './tile-view';

// How many tiles of a cut stand for each cell.
function timesCovered(tree: TileTree, cut: SelectedTile[]): number[] {
  const times = new Array<number>(tree.columns * tree.rows).fill(0);
  for (const { tile } of cut) {
    const { i0, i1, j0, j1 } = tree.tiles[tile].cells;
    for (let j = j0; j < j1; ++j) for (let i = i0; i < i1; ++i) ++times[i + tree.columns * j];
  }
  return times;
}

const high = madeView([0, 0, 40], 0, -1.5);
const low = madeView([-3.5, -3.5, 1], 0.8, -0.4);

describe('a selection', () => {
  it('stands for each place once, whatever the view and whatever is loaded', () => {
    const random = randomNumbers(7);
    for (const edge of [1, 3, 4, 8]) {
      const tree = madeTree(edge);
      const selector = new TileSelector(tree);
      for (let round = 0; round < 300; ++round) {
        const spread = () => (random() - 0.5) * 3 * edge;
        const view = madeView([spread(), spread(), random() * 8], random() * 7, -random() * 1.5);
        const there = tree.tiles.map((_, index) => index === 0 || random() < 0.7);
        const { cut, requests } = selector.select(view, (tile) => there[tile]);
        expect(timesCovered(tree, cut).every((times) => times === 1)).toBe(true);
        for (const { tile, visible } of cut) expect(!visible || there[tile]).toBe(true);
        for (const { tiles, beside } of requests) {
          expect(tiles.length).toBeGreaterThan(0);
          expect(tiles.some((tile) => there[tile])).toBe(false);
          expect(beside.every((tile) => there[tile])).toBe(true);
        }
      }
    }
  });

  it('has for two eyes all that either of them sees, as fine as either needs it', () => {
    const tree = madeTree(8);
    const eyes = [madeView([-0.1, -3.5, 1], 0.8, -0.4), madeView([0.1, -3.5, 1], 2.4, -0.4)];
    const both = new TileSelector(tree).select(jointView(eyes), () => true).cut;
    expect(timesCovered(tree, both).every((times) => times === 1)).toBe(true);
    const levels = (cut: SelectedTile[]) => {
      const found = new Array<number>(64).fill(9);
      for (const { tile, visible } of cut) {
        const { level, cells: { i0, j0, i1, j1 } } = tree.tiles[tile];
        for (let j = j0; visible && j < j1; ++j) for (let i = i0; i < i1; ++i) found[i + 8 * j] = level;
      }
      return found;
    };
    const together = levels(both);
    for (const eye of eyes) {
      const alone = new TileSelector(tree).select(eye, () => true).cut;
      levels(alone).forEach((level, cell) => expect(together[cell]).toBeLessThanOrEqual(level));
    }
    expect(both.some(({ visible }) => !visible)).toBe(true);
  });

  it('comes in the order of each eye', () => {
    const random = randomNumbers(5);
    const tree = madeTree(8);
    for (let round = 0; round < 100; ++round) {
      const view = madeView([random() * 16 - 8, random() * 16 - 8, random() * 4], random() * 7, -random());
      const cut = new TileSelector(tree).select(view, () => true).cut.map(({ tile }) => tile);
      expect(cutFrontToBack(tree, new Set([...cut].reverse()), view.eye)).toEqual(cut);
    }
  });

  it('shows the root from far away and asks for nothing', () => {
    const { cut, requests } = new TileSelector(madeTree(4)).select(madeView([0, 0, 400], 0, -1.5), () => true);
    expect(cut).toEqual([{ tile: 0, visible: true }]);
    expect(requests).toEqual([]);
  });

  it('asks for all children in view at once, and goes on with the tile until they are there', () => {
    const tree = madeTree(2);
    const { cut, requests } = new TileSelector(tree).select(low, (tile) => tile === 0);
    expect(cut).toEqual([{ tile: 0, visible: true }]);
    expect(requests).toHaveLength(1);
    expect([...requests[0].tiles].sort()).toEqual(tree.tiles[0].children.filter((child) => low.sees(tree.tiles[child])));
  });

  it('draws finer tiles where they are there and the coarser one is not', () => {
    const tree = madeTree(2);
    const there = new Set(tree.tiles[0].children);
    const far = madeView([0, 0, 400], 0, -1.5);
    const { cut, requests } = new TileSelector(tree).select(far, (tile) => there.has(tile));
    expect(cut.map(({ tile }) => tile).sort()).toEqual([...there].sort());
    expect(requests.map(({ tiles }) => tiles)).toEqual([[0]]);
  });

  it('does not flicker where the error is about the threshold', () => {
    const tree = madeTree(2);
    const selector = new TileSelector(tree);
    const height = (2 / 128) * (300 / 1.5) + 0.5; // where the root's error is the threshold
    const cutAt = (z: number) => selector.select(madeView([0, 0, z], 0, -1.5), () => true).cut.length;
    expect(cutAt(height * 1.05)).toBe(1);
    expect(cutAt(height * 0.95)).toBe(4);
    expect(cutAt(height * 1.05)).toBe(4);
    expect(cutAt(height * 1.3)).toBe(1);
  });

  it('lets nothing be finer than asked for', () => {
    const tree = madeTree(4);
    const selector = new TileSelector(tree, { mostPixels: 0, hysteresis: 1.2, finestLevel: 1 });
    const { cut } = selector.select(high, () => true);
    expect(new Set(cut.map(({ tile }) => tree.tiles[tile].level))).toEqual(new Set([1]));
  });

  it('is front to back for every ray of the view', () => {
    const random = randomNumbers(3);
    const tree = madeTree(8);
    for (let round = 0; round < 200; ++round) {
      const eye = [(random() - 0.5) * 20, (random() - 0.5) * 20, random() * 3] as const;
      const selector = new TileSelector(tree, { mostPixels: random() * 20, hysteresis: 1, finestLevel: 0 });
      const everywhere = madeView(eye, 0, 0);
      const view = Object.assign(Object.create(everywhere), { sees: () => true }) as typeof everywhere;
      const cut = selector.select(view, () => true).cut.map(({ tile }) => tree.tiles[tile]);
      const angle = random() * 7;
      let before = -Infinity;
      for (const { low: from, high: to } of cut) {
        let [near, far] = [0, Infinity];
        for (const [a, d] of [Math.cos(angle), Math.sin(angle)].entries()) {
          const [s, t] = [(from[a] - eye[a]) / d, (to[a] - eye[a]) / d];
          near = Math.max(near, Math.min(s, t));
          far = Math.min(far, Math.max(s, t));
        }
        if (far - near < 1e-9) continue;
        expect(near).toBeGreaterThanOrEqual(before - 1e-9);
        before = near;
      }
    }
  });
});

describe('the surround', () => {
  const atTheWall = madeView([1.9, 0, 0], 0, 0);

  it('is the coarse one until the fine one is there', () => {
    const tree = madeTree(2);
    const { coarse, fine } = addSurrounds(tree);
    const selector = new TileSelector(tree);
    const before = selector.select(atTheWall, (tile) => tile !== fine);
    expect(before.surround).toBe(coarse);
    expect(before.requests.map(({ tiles }) => tiles)).toEqual([[fine]]);
    const after = selector.select(atTheWall, () => true);
    expect(after.surround).toBe(fine);
    expect(after.requests).toEqual([]);
  });

  it('is no finer than is seen', () => {
    const tree = madeTree(64);
    const { coarse, fine } = addSurrounds(tree);
    const chosen = (x: number, mostPixels: number, finestLevel = 0) =>
      new TileSelector(tree, { mostPixels, hysteresis: 1.2, finestLevel }).select(madeView([x, 0, 0], 0, 0), () => true).surround;
    expect([chosen(0, 20), chosen(63.5, 20), chosen(0, 1), chosen(500, 20), chosen(63, 0, 1)]).toEqual(
      [coarse, fine, fine, fine, coarse]);
  });

  it('is none where there is none', () => {
    expect(new TileSelector(madeTree(2)).select(atTheWall, () => true).surround).toBe(-1);
  });
});

describe('a tile tree', () => {
  it('visits children by how far their columns and rows are from the eye', () => {
    const tree = madeTree(2);
    const [a, b, c, d] = tree.tiles[0].children; // (0,0), (1,0), (0,1), (1,1)
    expect(childrenFrontToBack(tree, 0, [-1, -1, 0])).toEqual([a, b, c, d]);
    expect(childrenFrontToBack(tree, 0, [9, 9, 0])).toEqual([d, b, c, a]);
  });

  it('is covered by its topmost contents', () => {
    const tree = madeTree(4);
    expect(coarsestTiles(tree)).toEqual([0]);
    tree.tiles[0].content = undefined;
    expect(coarsestTiles(tree)).toEqual(tree.tiles[0].children);
  });
});
