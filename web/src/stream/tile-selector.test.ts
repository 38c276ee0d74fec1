import { describe, expect, it } from 'vitest';
import { addBackgroundBlocks, testTree, testView, randomNumbers } from '../testing/test-tree';
import { TileSelector, type SelectedTile } from './tile-selector';
import { childrenFrontToBack, coarsestTiles, cutFrontToBack, type TileTree } from './tile-tree';
import { jointView } from './tile-view';

// Returns how many tiles of a cut cover each cell.
function timesCovered(tree: TileTree, cut: SelectedTile[]): number[] {
  const times = new Array<number>(tree.columns * tree.rows).fill(0);
  for (const { tile } of cut) {
    const { i0, i1, j0, j1 } = tree.tiles[tile].cells;
    for (let j = j0; j < j1; ++j) for (let i = i0; i < i1; ++i) ++times[i + tree.columns * j];
  }
  return times;
}

// Returns whether a content belongs to a tile or to one of its ancestors.
function isWithin(tree: TileTree, tile: number, content: number): boolean {
  return tile === content || (tile >= 0 && isWithin(tree, tree.tiles[tile].parent, content));
}

const high = testView([0, 0, 40], 0, -1.5);
const low = testView([-3.5, -3.5, 1], 0.8, -0.4);

const everything = {
  budget: Infinity, holds: () => false, estimateBytes: () => 1, canBeHad: () => true, hasFailed: () => false, tileResources: (): number[] => [], bytesOfResource: () => 0,
};

describe('a selection', () => {
  it('covers each place exactly once, whatever the view and the resident tiles', () => {
    const random = randomNumbers(7);
    for (const edge of [1, 3, 4, 8]) {
      const tree = testTree(edge);
      const selector = new TileSelector(tree);
      for (let round = 0; round < 300; ++round) {
        const spread = () => (random() - 0.5) * 3 * edge;
        const view = testView([spread(), spread(), random() * 8], random() * 7, -random() * 1.5);
        const there = tree.tiles.map((_, index) => index === 0 || random() < 0.7);
        const { tiles } = selector.cut(view, (tile) => there[tile]);
        expect(timesCovered(tree, tiles).every((times) => times === 1)).toBe(true);
        for (const { tile, content, visible } of tiles) {
          if (!visible) continue;
          expect(there[content]).toBe(true);
          expect(isWithin(tree, tile, content)).toBe(true);
        }
      }
    }
  });

  it('contains for two eyes what either of them sees, as fine as either needs it', () => {
    const tree = testTree(8);
    const eyes = [testView([-0.1, -3.5, 1], 0.8, -0.4), testView([0.1, -3.5, 1], 2.4, -0.4)];
    const both = new TileSelector(tree).cut(jointView(eyes), () => true).tiles;
    expect(timesCovered(tree, both).every((times) => times === 1)).toBe(true);
    const levels = (cut: SelectedTile[]) => {
      const cellLevels = new Array<number>(64).fill(9);
      for (const { tile, visible } of cut) {
        const { level, cells: { i0, j0, i1, j1 } } = tree.tiles[tile];
        for (let j = j0; visible && j < j1; ++j) for (let i = i0; i < i1; ++i) cellLevels[i + 8 * j] = level;
      }
      return cellLevels;
    };
    const together = levels(both);
    for (const eye of eyes) {
      const alone = new TileSelector(tree).cut(eye, () => true).tiles;
      levels(alone).forEach((level, cell) => expect(together[cell]).toBeLessThanOrEqual(level));
    }
    expect(both.some(({ visible }) => !visible)).toBe(true);
  });

  it('is sorted front to back for each eye', () => {
    const random = randomNumbers(5);
    const tree = testTree(8);
    for (let round = 0; round < 100; ++round) {
      const view = testView([random() * 16 - 8, random() * 16 - 8, random() * 4], random() * 7, -random());
      const cut = new TileSelector(tree).cut(view, () => true).tiles.map(({ tile }) => tile);
      expect(cutFrontToBack(tree, new Set([...cut].reverse()), view.eye)).toEqual(cut);
    }
  });

  it('draws the root from far away and requests nothing', () => {
    const selector = new TileSelector(testTree(4));
    const view = testView([0, 0, 400], 0, -1.5);
    expect(selector.cut(view, () => true).tiles).toEqual([{ tile: 0, content: 0, visible: true }]);
    expect(selector.choose(view, everything)).toEqual({ requested: [], refused: 0 });
  });

  it('draws each finer tile as soon as it is resident, and the coarser one in the other cells', () => {
    const tree = testTree(2);
    const selector = new TileSelector(tree);
    expect(selector.cut(low, (tile) => tile === 0).tiles).toEqual([{ tile: 0, content: 0, visible: true }]);
    const seen = tree.tiles[0].children.filter((child) => low.sees(tree.tiles[child]));
    expect([...selector.choose(low, everything).requested].sort()).toEqual(seen);
    const [first, ...others] = seen;
    const { tiles } = selector.cut(low, (tile) => tile === 0 || tile === first);
    const visible = tiles.filter((one) => one.visible);
    expect(visible.find(({ tile }) => tile === first)!.content).toBe(first);
    expect(visible.filter(({ content }) => content === 0).map(({ tile }) => tile).sort()).toEqual(others);
  });

  it('draws finer tiles if they are resident and the coarser one is not', () => {
    const tree = testTree(4);
    const there = new Set([0, ...tree.tiles[0].children, ...tree.tiles[1].children]);
    there.delete(1);
    const far = testView([0, 0, 60], 0, -1.57);
    const selector = new TileSelector(tree, { maximumScreenSpaceError: 0.1, hysteresis: 1, finestLevel: 0 });
    const { tiles } = selector.cut(far, (tile) => there.has(tile));
    expect(tiles.map(({ tile }) => tile).sort()).toEqual([...there].filter((tile) => tile > 0).sort());
    const { requested } = selector.choose(far, everything);
    expect([...requested].sort()).toEqual([...tree.tiles[0].children].sort());
  });

  it('requests the ancestors of each tile, the most urgent first, within the budget', () => {
    const random = randomNumbers(5);
    const tree = testTree(8);
    let refusals = 0;
    for (let round = 0; round < 200; ++round) {
      const selector = new TileSelector(tree);
      const view = testView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 3], random() * 7, -random());
      const bytes = tree.tiles.map(() => 1 + random());
      const budget = 1 + 30 * random();
      const { requested, refused } = selector.choose(view, { ...everything, budget, estimateBytes: (tile) => bytes[tile] });
      expect(requested.reduce((sum, tile) => sum + bytes[tile], bytes[0])).toBeLessThanOrEqual(Math.max(budget, bytes[0]));
      requested.forEach((tile, i) => {
        const { parent } = tree.tiles[tile];
        expect(parent === 0 || requested.slice(0, i).includes(parent)).toBe(true);
      });
      const larger = new TileSelector(tree).choose(view, { ...everything, estimateBytes: (tile) => bytes[tile] });
      expect(larger.refused).toBe(0);
      expect(refused === 0).toBe(larger.requested.length === requested.length);
      refusals += refused;
    }
    expect(refusals).toBeGreaterThan(100);
  });

  it('prefers a resident tile if another one is hardly more urgent', () => {
    const tree = testTree(2);
    const selector = new TileSelector(tree, { maximumScreenSpaceError: 0, hysteresis: 1.2, finestLevel: 0 });
    const choose = (x: number, residentTiles: number[]) => {
      const memory = { ...everything, budget: 2, holds: (tile: number) => residentTiles.includes(tile) };
      return selector.choose(testView([x, 0.01, 2.5], 0, -1.57), memory).requested;
    };
    const [left] = choose(-0.1, []);
    const [right] = choose(0.1, []);
    expect(left).not.toBe(right);
    expect(choose(0.1, [left])).toEqual([left]);
    expect(choose(1.9, [left])).toEqual([right]);
  });

  it('does not flicker if the error is near the threshold', () => {
    const tree = testTree(2);
    const selector = new TileSelector(tree);
    const height = (2 / 128) * (300 / 1.5) + 0.5; // at this height the root's error equals the threshold
    const cutAt = (z: number) => selector.cut(testView([0, 0, z], 0, -1.5), () => true).tiles.length;
    expect(cutAt(height * 1.05)).toBe(1);
    expect(cutAt(height * 0.95)).toBe(4);
    expect(cutAt(height * 1.05)).toBe(4);
    expect(cutAt(height * 1.3)).toBe(1);
  });

  it('contains nothing finer than finestLevel', () => {
    const tree = testTree(4);
    const selector = new TileSelector(tree, { maximumScreenSpaceError: 0, hysteresis: 1.2, finestLevel: 1 });
    const { tiles } = selector.cut(high, () => true);
    expect(new Set(tiles.map(({ tile }) => tree.tiles[tile].level))).toEqual(new Set([1]));
  });

  it('is sorted front to back for every ray of the view', () => {
    const random = randomNumbers(3);
    const tree = testTree(8);
    for (let round = 0; round < 200; ++round) {
      const eye = [(random() - 0.5) * 20, (random() - 0.5) * 20, random() * 3] as const;
      const selector = new TileSelector(tree, { maximumScreenSpaceError: random() * 20, hysteresis: 1, finestLevel: 0 });
      const everywhere = testView(eye, 0, 0);
      const view = Object.assign(Object.create(everywhere), { sees: () => true }) as typeof everywhere;
      const cut = selector.cut(view, () => true).tiles.map(({ tile }) => tree.tiles[tile]);
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

describe('resources that tiles share', () => {
  const tree = testTree(2);
  const all = [0, ...tree.tiles[0].children];
  const choose = (budget: number, resources: Record<number, number[]>, bytesOfResource = (_: number) => 10) =>
    new TileSelector(tree, { maximumScreenSpaceError: 0, hysteresis: 1, finestLevel: 0 }).choose(
      high, { ...everything, budget, tileResources: (tile) => resources[tile] ?? [], bytesOfResource });
  const ofAll = (tiles: number[], id: number) => Object.fromEntries(tiles.map((tile) => [tile, [id]]));

  it('count once, for the first tile that needs them', () => {
    const resources = ofAll(tree.tiles[0].children, 3);
    expect(choose(1 + 10 + 4, resources)).toMatchObject({ requested: { length: 4 }, refused: 0 });
    expect(choose(1 + 10 + 3, resources)).toMatchObject({ requested: { length: 3 }, refused: 1 });
    expect(choose(1 + 10, resources)).toEqual({ requested: [], refused: 4 });
  });

  it('count with the coarsest tiles, which are always resident', () => {
    expect(choose(10 + 5, ofAll(all, 3)).requested).toHaveLength(4);
    expect(choose(10 + 4, ofAll(all, 3)).requested).toHaveLength(3);
  });

  it('do not count for a tile that is refused', () => {
    const [first, ...others] = choose(Infinity, {}).requested;
    const bytesOfResource = (id: number) => [10, 4][id];
    const { requested, refused } = choose(1 + 4 + 3, { [first]: [0, 1], ...ofAll(others, 1) }, bytesOfResource);
    expect([requested, refused]).toEqual([others, 1]);
    expect(choose(1 + 4 + 2, { [first]: [0, 1], ...ofAll(others, 1) }, bytesOfResource).requested).toEqual(others.slice(0, 2));
  });
});

describe('the background block', () => {
  const atTheWall = testView([1.9, 0, 0], 0, 0);

  it('is the coarse one until the fine one is resident', () => {
    const tree = testTree(2);
    const { coarse, fine } = addBackgroundBlocks(tree);
    const selector = new TileSelector(tree);
    expect(selector.cut(atTheWall, (tile) => tile !== fine).backgroundBlock).toBe(coarse);
    expect(selector.choose(atTheWall, everything).requested).toContain(fine);
    expect(selector.cut(atTheWall, () => true).backgroundBlock).toBe(fine);
  });

  it('is no finer than the view needs', () => {
    const tree = testTree(64);
    const { coarse, fine } = addBackgroundBlocks(tree);
    const chosen = (x: number, maximumScreenSpaceError: number, finestLevel = 0) =>
      new TileSelector(tree, { maximumScreenSpaceError, hysteresis: 1.2, finestLevel }).cut(testView([x, 0, 0], 0, 0), () => true).backgroundBlock;
    expect([chosen(0, 20), chosen(63.5, 20), chosen(0, 1), chosen(500, 20), chosen(63, 0, 1)]).toEqual(
      [coarse, fine, fine, fine, coarse]);
  });

  it('is -1 if there is none', () => {
    expect(new TileSelector(testTree(2)).cut(atTheWall, () => true).backgroundBlock).toBe(-1);
  });
});

describe('a tile tree', () => {
  it('visits children by how far their columns and rows are from the eye', () => {
    const tree = testTree(2);
    const [a, b, c, d] = tree.tiles[0].children; // (0,0), (1,0), (0,1), (1,1)
    expect(childrenFrontToBack(tree, 0, [-1, -1, 0])).toEqual([a, b, c, d]);
    expect(childrenFrontToBack(tree, 0, [9, 9, 0])).toEqual([d, b, c, a]);
  });

  it('is covered by its topmost contents', () => {
    const tree = testTree(4);
    expect(coarsestTiles(tree)).toEqual([0]);
    tree.tiles[0].content = undefined;
    expect(coarsestTiles(tree)).toEqual(tree.tiles[0].children);
  });
});
