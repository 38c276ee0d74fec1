// Selects which tiles to draw and which to keep in memory for a view (City-on-Web, section 4.5). Counterpart of
// src/render/tile_selection.h.
//
// A view is drawn as a cut through the tree: tiles that together cover what the root covers, each place exactly once. A
// tile is replaced by its children when its projected error exceeds a number of pixels; it then stays replaced until
// the error falls below that number divided by `hysteresis`. Where a tile of the cut is not in memory, the content of
// its nearest resident ancestor is drawn in that tile's cells.
//
// The requested tiles are selected anew for each view: the most urgent first, as far as the budget allows. All
// ancestors of a requested tile are requested too, so that whatever comes into view can be drawn from them at once.
import { childrenFrontToBack, coarsestTiles, type TileNode, type TileTree } from './tile-tree';
import type { SelectionView } from './tile-view';

export interface SelectionSettings {
  maximumScreenSpaceError: number; // maximum projected geometric error in pixels; 0 selects the finest tiles everywhere
  hysteresis: number; // see above; the priority of resident tiles is also multiplied by its square
  finestLevel: number; // tiles of this level and finer levels are never replaced
}

export const kSelectionSettings: SelectionSettings = { maximumScreenSpaceError: 1.5, hysteresis: 1.2, finestLevel: 0 };

// The state of the memory that the selection depends on.
export interface TileMemory {
  budget: number; // bytes
  holds(tile: number): boolean;
  estimateBytes(tile: number): number; // GPU bytes of a tile as far as known, without the resources that it shares with others
  canBeHad(tile: number): boolean;
  hasFailed(tile: number): boolean; // since it was last loaded
  tileResources(tile: number): readonly number[]; // resources that the tile shares with others and cannot be drawn without
  bytesOfResource(id: number): number; // like estimateBytes; counted once, for the first tile that needs it
}

export interface SelectedTile {
  tile: number; // the tile in whose cells the content is drawn
  content: number; // the tile itself or an ancestor; -1 if there is none
  visible: boolean;
}

export interface Cut {
  tiles: SelectedTile[]; // front to back along every ray of the view
  backgroundBlock: number; // the background block to draw behind the tiles; -1 if there is none
}

export interface Choice {
  requested: number[]; // tiles to load besides the pinned ones, the most urgent first
  refused: number; // tiles that do not fit into the budget
}

export class TileSelector {
  readonly pinned: readonly number[]; // the coarsest tiles, including the background block's, which are always resident
  private readonly replaced: boolean[]; // whether each tile was replaced by its children when it was last visible

  constructor(
    private readonly tree: TileTree,
    public settings: SelectionSettings = { ...kSelectionSettings },
  ) {
    this.replaced = tree.tiles.map(() => false);
    this.pinned = [...coarsestTiles(tree), ...(tree.backgroundBlock >= 0 ? [tree.backgroundBlock] : [])];
  }

  // Returns the cut for a view. `holds` returns whether the content of a tile can be drawn. For the cut to cover
  // everything, it must be true for the coarsest tiles.
  cut(view: SelectionView, holds: (tile: number) => boolean): Cut {
    const tiles: SelectedTile[] = [];
    const behind: SelectedTile[] = [];
    this.cover({ view, holds, tiles }, 0, -1);
    if (this.tree.backgroundBlock >= 0) this.cover({ view, holds, tiles: behind }, this.tree.backgroundBlock, -1);
    return { tiles, backgroundBlock: behind[0]?.content ?? -1 };
  }

  // Returns the tiles to load for a view.
  choose(view: SelectionView, memory: TileMemory): Choice {
    const open: Candidate[] = [];
    // A tile is urgent if it covers much of the screen and what is drawn there is much coarser than allowed.
    const addBelow = (tile: number, instead: TileNode) => {
      for (const child of this.tree.tiles[tile].children) {
        const node = this.tree.tiles[child];
        if (!view.sees(node)) continue;
        if (!node.content) {
          addBelow(child, instead);
          continue;
        }
        const error = view.errorInPixels(instead) / Math.max(this.settings.maximumScreenSpaceError, 1e-3);
        const residentBonus = memory.holds(child) ? this.settings.hysteresis ** 2 : 1;
        open.push({ tile: child, instead, priority: view.areaInPixels(node) * error * residentBonus, distance: view.distance(node) });
      }
    };
    let bytes = 0;
    const brought = new Set<number>(); // resources of the tiles that are requested so far
    const bytesWith = (tile: number) => memory.tileResources(tile)
      .filter((id) => !brought.has(id))
      .reduce((sum, id) => sum + memory.bytesOfResource(id), memory.estimateBytes(tile));
    const request = (tile: number) => {
      bytes += bytesWith(tile);
      for (const id of memory.tileResources(tile)) brought.add(id);
    };
    for (const tile of this.pinned) {
      const node = this.tree.tiles[tile];
      request(tile);
      // Finer tiles stand in for one that cannot be loaded, however far it is.
      if (view.sees(node) && (this.isReplaced(view, tile) || memory.hasFailed(tile))) addBelow(tile, node);
    }
    const requested: number[] = [];
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
      request(tile);
      requested.push(tile);
      if (isReplaced) addBelow(tile, this.tree.tiles[tile]);
    }
    return { requested, refused };
  }

  // Updates the hysteresis state of tiles below one that does not fit, so that this state does not depend on the
  // budget.
  private lookBelow(view: SelectionView, tile: number): void {
    for (const child of this.tree.tiles[tile].children) {
      const node = this.tree.tiles[child];
      if (view.sees(node) && (!node.content || this.isReplaced(view, child))) this.lookBelow(view, child);
    }
  }

  // Adds tiles to the cut that cover this one; `above` is the nearest ancestor whose content can be drawn.
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
      tiles.length = before; // no finer content is resident
    }
    tiles.push({ tile, content, visible: content >= 0 });
  }

  private isReplaced(view: SelectionView, tile: number): boolean {
    const { settings } = this;
    const node = this.tree.tiles[tile];
    if (node.children.length === 0 || node.level <= settings.finestLevel) return (this.replaced[tile] = false);
    const threshold = settings.maximumScreenSpaceError / (this.replaced[tile] ? settings.hysteresis : 1);
    return (this.replaced[tile] = view.errorInPixels(node) > threshold);
  }
}

interface Candidate {
  tile: number;
  instead: TileNode; // the nearest ancestor that has a content
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
