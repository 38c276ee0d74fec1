// Cross-fades between levels of detail: where successive cuts of the tree draw different contents, both are drawn for
// some frames, each in a share of the pixels that moves from the old content to the new one. Counterpart of
// src/render/level_fades.h.
import type { SelectedTile } from './tile-selector';
import type { TileTree } from './tile-tree';

const kFrames = 12; // in which both contents are drawn

// A content in the cells of a tile, in those pixels whose threshold lies in [low, high).
export interface FadedTile {
  tile: number;
  content: number;
  low: number;
  high: number;
}

interface Fade {
  from: number; // content
  to: number;
  passed: number; // frames
}

export class LevelFades {
  private shown = new Map<number, number>(); // the visible tiles of the last cut, and their contents
  private fades = new Map<number, Fade>(); // by tile, none of which lies within another one

  constructor(private readonly tree: TileTree, private readonly frames = kFrames) {}

  get isFading(): boolean {
    return this.fades.size > 0;
  }

  // The next cut is drawn as it is.
  reset(): void {
    this.shown.clear();
    this.fades.clear();
  }

  // Returns what to draw in each visible tile of the cut. `holds` says which contents are resident: a fade from a content
  // that has been evicted ends at once.
  next(cut: readonly SelectedTile[], holds: (tile: number) => boolean): Map<number, FadedTile[]> {
    const visible = cut.filter((tile) => tile.visible);
    const fades = new Map<number, Fade>();
    for (const { tile, content } of visible) {
      for (const [region, before] of this.contentsBefore(tile)) this.change(region, before, content!, holds, fades);
    }
    this.shown = new Map(visible.map(({ tile, content }) => [tile, content!]));
    this.fades = fades;
    const split = new Set([...fades.keys()].flatMap((region) => this.upwards(region).slice(1))); // contents fade in parts of them
    const pieces = (tile: number, content: number): FadedTile[] => {
      const fade = fades.get(tile);
      if (fade) {
        const share = (fade.passed + 1) / (this.frames + 1);
        return [{ tile, content: fade.to, low: 0, high: share }, { tile, content: fade.from, low: share, high: 1 }];
      }
      if (split.has(tile)) return this.tree.tiles[tile].children.flatMap((child) => pieces(child, content));
      return [{ tile, content, low: 0, high: 1 }];
    };
    return new Map(visible.map(({ tile, content }) => [tile, pieces(tile, content!)]));
  }

  // Returns a tile and those above it.
  private upwards(tile: number): number[] {
    const all: number[] = [];
    for (let above = tile; above >= 0; above = this.tree.tiles[above].parent) all.push(above);
    return all;
  }

  // Returns the tiles within one, or that one itself, and which content the last cut showed in each.
  private contentsBefore(tile: number): [number, number][] {
    const above = this.upwards(tile).find((one) => this.shown.has(one));
    if (above !== undefined) return [[tile, this.shown.get(above)!]];
    return [...this.shown].filter(([region]) => this.upwards(region).includes(tile));
  }

  // Returns the fades in a tile: those of tiles within it, or else that of a tile around it.
  private fadesWithin(region: number): [number, Fade][] {
    const within = [...this.fades].filter(([tile]) => this.upwards(tile).includes(region));
    if (within.length > 0) return within;
    const around = this.upwards(region).find((one) => this.fades.has(one));
    return around === undefined ? [] : [[region, this.fades.get(around)!]];
  }

  private change(region: number, before: number, content: number, holds: (tile: number) => boolean, fades: Map<number, Fade>): void {
    const isChanged = before !== content;
    const add = (tile: number, fade: Fade) => {
      if (fade.passed < this.frames && holds(fade.from)) fades.set(tile, fade);
    };
    const running = this.fadesWithin(region);
    if (running.length === 0 && isChanged) add(region, { from: before, to: content, passed: 0 });
    for (const [tile, { from, to, passed }] of running) {
      if (!isChanged && to === content) add(tile, { from, to, passed: passed + 1 });
      else if (isChanged && from === content && to === before) add(tile, { from: to, to: from, passed: this.frames - 1 - passed }); // back again
      else if (isChanged) add(tile, { from: before, to: content, passed: 0 });
    }
  }
}
