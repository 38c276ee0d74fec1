import { describe, expect, it } from 'vitest';
import { LevelFades, type FadedTile } from './level-fades';
import type { TileTree } from './tile-tree';

// Tile 0 above 1 to 4, and 1 above 5 and 6.
const tree = {
  tiles: [-1, 0, 0, 0, 0, 1, 1].map((parent, tile, parents) => (
    { parent, children: parents.flatMap((above, child) => (above === tile ? [child] : [])) })),
} as unknown as TileTree;
const kFrames = 3;

function makeFades() {
  const fades = new LevelFades(tree, kFrames);
  const next = (cut: [number, number][], holds = (_: number) => true): FadedTile[] =>
    [...fades.next(cut.map(([tile, content]) => ({ tile, content, visible: content >= 0 })), holds).values()].flat();
  return { fades, next };
}
const whole = (tile: number, content = tile): FadedTile => ({ tile, content, low: 0, high: 1 });

describe('fades between levels', () => {
  it('draw the first cut and what is newly visible at once', () => {
    const { fades, next } = makeFades();
    expect(next([[1, 1], [2, -1]])).toEqual([whole(1)]);
    expect(next([[1, 1], [2, 2]])).toEqual([whole(1), whole(2)]);
    expect(fades.isFading).toBe(false);
  });

  it('move from the coarse content to the fine one and end', () => {
    const { fades, next } = makeFades();
    next([[0, 0]]);
    for (let frame = 1; frame <= kFrames; ++frame) {
      const share = frame / (kFrames + 1);
      expect(next([[1, 1], [2, 0]])).toEqual(
        [{ tile: 1, content: 1, low: 0, high: share }, { tile: 1, content: 0, low: share, high: 1 }, whole(2, 0)]);
      expect(fades.isFading).toBe(true);
    }
    expect(next([[1, 1], [2, 0]])).toEqual([whole(1), whole(2, 0)]);
    expect(fades.isFading).toBe(false);
  });

  it('move from fine contents to the coarse one in their cells', () => {
    const { next } = makeFades();
    next([[5, 5], [3, 3]]);
    expect(next([[0, 0]])).toEqual([
      { tile: 5, content: 0, low: 0, high: 0.25 }, { tile: 5, content: 5, low: 0.25, high: 1 }, whole(6, 0), whole(2, 0),
      { tile: 3, content: 0, low: 0, high: 0.25 }, { tile: 3, content: 3, low: 0.25, high: 1 }, whole(4, 0),
    ]);
  });

  it('turn back from where they are, and end when the old content is evicted', () => {
    const { next } = makeFades();
    next([[0, 0]]);
    next([[1, 1]]);
    next([[1, 1]]);
    expect(next([[0, 0]])[0]).toEqual({ tile: 1, content: 0, low: 0, high: 0.5 });
    expect(next([[1, 1]])[0]).toEqual({ tile: 1, content: 1, low: 0, high: 0.5 });
    expect(next([[1, 1]], (tile) => tile !== 0)).toEqual([whole(1)]);
  });
});
