// Which tiles to draw, and which to have in memory for it (City-on-Web, section 4.5). Twin of src/render/tile_selection.h.
//
// The picture is a cut through the tree: tiles that together cover what the root covers, each place once. A tile is
// replaced by its children while its error, projected, is above a number of pixels; once it is, it stays so until the error
// is smaller by `hysteresis`. Where a tile of the cut is not in memory, what is above it is drawn, in that tile's cells.
//
// What is wanted in memory is chosen anew for each view: the most urgent first, as far as the budget goes. What is above
// a wanted tile is wanted too, so that whatever comes into view is drawn by that at once.
import { childrenFrontToBack, coarsestTiles, type TileNode, type TileTree } from './tile-tree';
import type { SelectionView } from './tile-view';

export interface SelectionSettings {
  mostPixels: number; // of geometric error; 0: the finest everywhere
  hysteresis: number; // also what is in memory is so much more urgent
  finestLevel: number; // tiles of this level and finer are never replaced
}

export const kSelectionSettings: SelectionSettings = { mostPixels: 1.5, hysteresis: 1.2, finestLevel: 0 };

// What there is to choose from.
export interface TileMemory {
  budget: number; // bytes
  holds(tile: number): boolean;
  bytesOf(tile: number): number; // that it takes, as far as is known; of itself, without what it shares with others
  canBeHad(tile: number): boolean;
  resourcesOf(tile: number): readonly number[]; // what it shares with others, and cannot be drawn without
  bytesOfResource(id: number): number; // as bytesOf; counted once, for the first tile that needs it
}

export interface SelectedTile {
  tile: number; // in whose cells is drawn
  content: number; // the tile's, or of one above it; -1 where there is none
  visible: boolean;
}

export interface Cut {
  tiles: SelectedTile[]; // front to back for every ray of the view
  surround: number; // the one to draw behind them, -1 where there is none
}

export interface Choice {
  wanted: number[]; // to be in memory, beside the coarsest; the most urgent first
  refused: number; // tiles for which the budget has no room
}

export class TileSelector {
  readonly pinned: readonly number[]; // the coarsest, of the surround too: are to be in memory always
  private readonly replaced: boolean[]; // tiles that were to be replaced when last seen

  constructor(
    private readonly tree: TileTree,
    public settings: SelectionSettings = { ...kSelectionSettings },
  ) {
    this.replaced = tree.tiles.map(() => false);
    this.pinned = [...coarsestTiles(tree), ...(tree.surround >= 0 ? [tree.surround] : [])];
  }

  // `holds`: which contents can be drawn. The coarsest must be for the cut to cover everything.
  cut(view: SelectionView, holds: (tile: number) => boolean): Cut {
    const tiles: SelectedTile[] = [];
    const behind: SelectedTile[] = [];
    this.cover({ view, holds, tiles }, 0, -1);
    if (this.tree.surround >= 0) this.cover({ view, holds, tiles: behind }, this.tree.surround, -1);
    return { tiles, surround: behind[0]?.content ?? -1 };
  }

  // What to have in memory for a view.
  choose(view: SelectionView, memory: TileMemory): Choice {
    const open: Candidate[] = [];
    // Urgent is what covers much of the picture and is far coarser there than asked for.
    const addBelow = (tile: number, instead: TileNode) => {
      for (const child of this.tree.tiles[tile].children) {
        const node = this.tree.tiles[child];
        if (!view.sees(node)) continue;
        if (!node.content) {
          addBelow(child, instead);
          continue;
        }
        const error = view.errorInPixels(instead) / Math.max(this.settings.mostPixels, 1e-3);
        const held = memory.holds(child) ? this.settings.hysteresis ** 2 : 1;
        open.push({ tile: child, instead, priority: view.areaInPixels(node) * error * held, distance: view.distance(node) });
      }
    };
    let bytes = 0;
    const brought = new Set<number>(); // resources of tiles that are to be in memory
    const bytesWith = (tile: number) => memory.resourcesOf(tile)
      .filter((id) => !brought.has(id))
      .reduce((sum, id) => sum + memory.bytesOfResource(id), memory.bytesOf(tile));
    const bring = (tile: number) => {
      bytes += bytesWith(tile);
      for (const id of memory.resourcesOf(tile)) brought.add(id);
    };
    for (const tile of this.pinned) {
      const node = this.tree.tiles[tile];
      bring(tile);
      if (view.sees(node) && this.isReplaced(view, tile)) addBelow(tile, node);
    }
    const wanted: number[] = [];
    let refused = 0;
    while (open.length > 0) {
      const next = open.reduce((first, one, i) => (isBefore(one, open[first]) ? i : first), 0);
      const { tile, instead } = open[next];
      open[next] = open[open.length - 1];
      open.pop();
      const isReplaced = this.isReplaced(view, tile);
      if (!memory.canBeHad(tile)) {
        if (isReplaced) addBelow(tile, instead);
        continue;
      }
      if (bytes + bytesWith(tile) > memory.budget) {
        ++refused;
        if (isReplaced) this.lookBelow(view, tile);
        continue;
      }
      bring(tile);
      wanted.push(tile);
      if (isReplaced) addBelow(tile, this.tree.tiles[tile]);
    }
    return { wanted, refused };
  }

  // So that what was to be replaced does not depend on the budget.
  private lookBelow(view: SelectionView, tile: number): void {
    for (const child of this.tree.tiles[tile].children) {
      const node = this.tree.tiles[child];
      if (view.sees(node) && (!node.content || this.isReplaced(view, child))) this.lookBelow(view, child);
    }
  }

  // Adds tiles to the cut that cover this one; `above` is the next content above it that can be drawn.
  private cover(pass: Pass, tile: number, above: number): void {
    const { view, holds, tiles } = pass;
    const node = this.tree.tiles[tile];
    if (!view.sees(node) || (!node.content && node.children.length === 0)) {
      tiles.push({ tile, content: -1, visible: false });
      return;
    }
    const isHeld = node.content !== undefined && holds(tile);
    const content = isHeld ? tile : above;
    if (node.children.length > 0 && (!isHeld || this.isReplaced(view, tile))) {
      const before = tiles.length;
      for (const child of childrenFrontToBack(this.tree, tile, view.eye)) this.cover(pass, child, content);
      const drawn = tiles.slice(before).filter(({ visible }) => visible);
      if (drawn.length === 0 || drawn.some((one) => one.content !== content)) return;
      tiles.length = before; // nothing finer is there
    }
    tiles.push({ tile, content, visible: content >= 0 });
  }

  private isReplaced(view: SelectionView, tile: number): boolean {
    const { settings } = this;
    const node = this.tree.tiles[tile];
    if (node.children.length === 0 || node.level <= settings.finestLevel) return (this.replaced[tile] = false);
    const threshold = settings.mostPixels / (this.replaced[tile] ? settings.hysteresis : 1);
    return (this.replaced[tile] = view.errorInPixels(node) > threshold);
  }
}

interface Candidate {
  tile: number;
  instead: TileNode; // the content above it
  priority: number;
  distance: number;
}

function isBefore(a: Candidate, b: Candidate): boolean {
  return a.priority !== b.priority ? a.priority > b.priority : a.distance !== b.distance ? a.distance < b.distance : a.tile < b.tile;
}

interface Pass {
  view: SelectionView;
  holds: (tile: number) => boolean;
  tiles: SelectedTile[];
}
