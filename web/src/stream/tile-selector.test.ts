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

// Whether a content stands above a tile, or is its own.
function isWithin(tree: TileTree, tile: number, content: number): boolean {
  return tile === content || (tile >= 0 && isWithin(tree, tree.tiles[tile].parent, content));
}

const high = madeView([0, 0, 40], 0, -1.5);
const low = madeView([-3.5, -3.5, 1], 0.8, -0.4);

const everything = {
  budget: Infinity, holds: () => false, bytesOf: () => 1, canBeHad: () => true, resourcesOf: (): number[] => [], bytesOfResource: () => 0,
};

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

  it('has for two eyes all that either of them sees, as fine as either needs it', () => {
    const tree = madeTree(8);
    const eyes = [madeView([-0.1, -3.5, 1], 0.8, -0.4), madeView([0.1, -3.5, 1], 2.4, -0.4)];
    const both = new TileSelector(tree).cut(jointView(eyes), () => true).tiles;
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
      const alone = new TileSelector(tree).cut(eye, () => true).tiles;
      levels(alone).forEach((level, cell) => expect(together[cell]).toBeLessThanOrEqual(level));
    }
    expect(both.some(({ visible }) => !visible)).toBe(true);
  });

  it('comes in the order of each eye', () => {
    const random = randomNumbers(5);
    const tree = madeTree(8);
    for (let round = 0; round < 100; ++round) {
      const view = madeView([random() * 16 - 8, random() * 16 - 8, random() * 4], random() * 7, -random());
      const cut = new TileSelector(tree).cut(view, () => true).tiles.map(({ tile }) => tile);
      expect(cutFrontToBack(tree, new Set([...cut].reverse()), view.eye)).toEqual(cut);
    }
  });

  it('shows the root from far away and wants nothing', () => {
    const selector = new TileSelector(madeTree(4));
    const view = madeView([0, 0, 400], 0, -1.5);
    expect(selector.cut(view, () => true).tiles).toEqual([{ tile: 0, content: 0, visible: true }]);
    expect(selector.choose(view, everything)).toEqual({ wanted: [], refused: 0 });
  });

  it('draws each finer tile as soon as it is there, and the coarser one in the cells of the others', () => {
    const tree = madeTree(2);
    const selector = new TileSelector(tree);
    expect(selector.cut(low, (tile) => tile === 0).tiles).toEqual([{ tile: 0, content: 0, visible: true }]);
    const seen = tree.tiles[0].children.filter((child) => low.sees(tree.tiles[child]));
    expect([...selector.choose(low, everything).wanted].sort()).toEqual(seen);
    const [first, ...others] = seen;
    const { tiles } = selector.cut(low, (tile) => tile === 0 || tile === first);
    const visible = tiles.filter((one) => one.visible);
    expect(visible.find(({ tile }) => tile === first)!.content).toBe(first);
    expect(visible.filter(({ content }) => content === 0).map(({ tile }) => tile).sort()).toEqual(others);
  });

  it('draws finer tiles where they are there and the coarser one is not', () => {
    const tree = madeTree(4);
    const there = new Set([0, ...tree.tiles[0].children, ...tree.tiles[1].children]);
    there.delete(1);
    const far = madeView([0, 0, 60], 0, -1.57);
    const selector = new TileSelector(tree, { mostPixels: 0.1, hysteresis: 1, finestLevel: 0 });
    const { tiles } = selector.cut(far, (tile) => there.has(tile));
    expect(tiles.map(({ tile }) => tile).sort()).toEqual([...there].filter((tile) => tile > 0).sort());
    const { wanted } = selector.choose(far, everything);
    expect([...wanted].sort()).toEqual([...tree.tiles[0].children].sort());
  });

  it('wants with each tile those above it, the most urgent first, and never more than there is room for', () => {
    const random = randomNumbers(5);
    const tree = madeTree(8);
    let refusals = 0;
    for (let round = 0; round < 200; ++round) {
      const selector = new TileSelector(tree);
      const view = madeView([(random() - 0.5) * 16, (random() - 0.5) * 16, random() * 3], random() * 7, -random());
      const bytes = tree.tiles.map(() => 1 + random());
      const budget = 1 + 30 * random();
      const { wanted, refused } = selector.choose(view, { ...everything, budget, bytesOf: (tile) => bytes[tile] });
      expect(wanted.reduce((sum, tile) => sum + bytes[tile], bytes[0])).toBeLessThanOrEqual(Math.max(budget, bytes[0]));
      wanted.forEach((tile, i) => {
        const { parent } = tree.tiles[tile];
        expect(parent === 0 || wanted.slice(0, i).includes(parent)).toBe(true);
      });
      const larger = new TileSelector(tree).choose(view, { ...everything, bytesOf: (tile) => bytes[tile] });
      expect(larger.refused).toBe(0);
      expect(refused === 0).toBe(larger.wanted.length === wanted.length);
      refusals += refused;
    }
    expect(refusals).toBeGreaterThan(100);
  });

  it('prefers what is there already, where another tile is hardly more urgent', () => {
    const tree = madeTree(2);
    const selector = new TileSelector(tree, { mostPixels: 0, hysteresis: 1.2, finestLevel: 0 });
    const choose = (x: number, held: number[]) => {
      const room = { ...everything, budget: 2, holds: (tile: number) => held.includes(tile) };
      return selector.choose(madeView([x, 0.01, 2.5], 0, -1.57), room).wanted;
    };
    const [left] = choose(-0.1, []);
    const [right] = choose(0.1, []);
    expect(left).not.toBe(right);
    expect(choose(0.1, [left])).toEqual([left]);
    expect(choose(1.9, [left])).toEqual([right]);
  });

  it('does not flicker where the error is about the threshold', () => {
    const tree = madeTree(2);
    const selector = new TileSelector(tree);
    const height = (2 / 128) * (300 / 1.5) + 0.5; // where the root's error is the threshold
    const cutAt = (z: number) => selector.cut(madeView([0, 0, z], 0, -1.5), () => true).tiles.length;
    expect(cutAt(height * 1.05)).toBe(1);
    expect(cutAt(height * 0.95)).toBe(4);
    expect(cutAt(height * 1.05)).toBe(4);
    expect(cutAt(height * 1.3)).toBe(1);
  });

  it('lets nothing be finer than asked for', () => {
    const tree = madeTree(4);
    const selector = new TileSelector(tree, { mostPixels: 0, hysteresis: 1.2, finestLevel: 1 });
    const { tiles } = selector.cut(high, () => true);
    expect(new Set(tiles.map(({ tile }) => tree.tiles[tile].level))).toEqual(new Set([1]));
  });

  it('is front to back for every ray of the view', () => {
    const random = randomNumbers(3);
    const tree = madeTree(8);
    for (let round = 0; round < 200; ++round) {
      const eye = [(random() - 0.5) * 20, (random() - 0.5) * 20, random() * 3] as const;
      const selector = new TileSelector(tree, { mostPixels: random() * 20, hysteresis: 1, finestLevel: 0 });
      const everywhere = madeView(eye, 0, 0);
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

describe('what tiles share', () => {
  const tree = madeTree(2);
  const all = [0, ...tree.tiles[0].children];
  const choose = (budget: number, resources: Record<number, number[]>, bytesOfResource = (_: number) => 10) =>
    new TileSelector(tree, { mostPixels: 0, hysteresis: 1, finestLevel: 0 }).choose(
      high, { ...everything, budget, resourcesOf: (tile) => resources[tile] ?? [], bytesOfResource });
  const ofAll = (tiles: number[], id: number) => Object.fromEntries(tiles.map((tile) => [tile, [id]]));

  it('counts once, for the first tile that needs it', () => {
    const resources = ofAll(tree.tiles[0].children, 3);
    expect(choose(1 + 10 + 4, resources)).toMatchObject({ wanted: { length: 4 }, refused: 0 });
    expect(choose(1 + 10 + 3, resources)).toMatchObject({ wanted: { length: 3 }, refused: 1 });
    expect(choose(1 + 10, resources)).toEqual({ wanted: [], refused: 4 });
  });

  it('counts with the coarsest, which are there always', () => {
    expect(choose(10 + 5, ofAll(all, 3)).wanted).toHaveLength(4);
    expect(choose(10 + 4, ofAll(all, 3)).wanted).toHaveLength(3);
  });

  it('does not count for a tile that is refused', () => {
    const [first, ...others] = choose(Infinity, {}).wanted;
    const bytesOfResource = (id: number) => [10, 4][id];
    const { wanted, refused } = choose(1 + 4 + 3, { [first]: [0, 1], ...ofAll(others, 1) }, bytesOfResource);
    expect([wanted, refused]).toEqual([others, 1]);
    expect(choose(1 + 4 + 2, { [first]: [0, 1], ...ofAll(others, 1) }, bytesOfResource).wanted).toEqual(others.slice(0, 2));
  });
});

describe('the surround', () => {
  const atTheWall = madeView([1.9, 0, 0], 0, 0);

  it('is the coarse one until the fine one is there', () => {
    const tree = madeTree(2);
    const { coarse, fine } = addSurrounds(tree);
    const selector = new TileSelector(tree);
    expect(selector.cut(atTheWall, (tile) => tile !== fine).surround).toBe(coarse);
    expect(selector.choose(atTheWall, everything).wanted).toContain(fine);
    expect(selector.cut(atTheWall, () => true).surround).toBe(fine);
  });

  it('is no finer than is seen', () => {
    const tree = madeTree(64);
    const { coarse, fine } = addSurrounds(tree);
    const chosen = (x: number, mostPixels: number, finestLevel = 0) =>
      new TileSelector(tree, { mostPixels, hysteresis: 1.2, finestLevel }).cut(madeView([x, 0, 0], 0, 0), () => true).surround;
    expect([chosen(0, 20), chosen(63.5, 20), chosen(0, 1), chosen(500, 20), chosen(63, 0, 1)]).toEqual(
      [coarse, fine, fine, fine, coarse]);
  });

  it('is none where there is none', () => {
    expect(new TileSelector(madeTree(2)).cut(atTheWall, () => true).surround).toBe(-1);
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
