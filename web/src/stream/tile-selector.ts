// Which tiles to draw (City-on-Web, section 4.5): a cut through the tree, whose tiles together cover what the root
// covers, each place once. Twin of src/render/tile_selection.h.
//
// A tile is replaced by its children while its error, projected, is above a number of pixels, and all of them that can
// be seen are in memory. Once it is to be replaced, it stays so until the error is smaller by `hysteresis`.
import { childrenFrontToBack, type TileNode, type TileTree } from './tile-tree';
import type { SelectionView } from './tile-view';

export interface SelectionSettings {
  mostPixels: number; // of geometric error; 0: the finest everywhere
  hysteresis: number;
  finestLevel: number; // tiles of this level and finer are never replaced
}

export const kSelectionSettings: SelectionSettings = { mostPixels: 1.5, hysteresis: 1.2, finestLevel: 0 };

export interface SelectedTile {
  tile: number;
  visible: boolean; // what is not, or has no content, need not be in memory
}

// Tiles that must be loaded together for the cut to change.
export interface TileRequest {
  tiles: number[];
  beside: number[]; // in memory, and drawn with them: not to be evicted for them
  priority: number; // the area on the screen of what they would replace × its error in units of mostPixels
  distance: number;
}

export interface Selection {
  cut: SelectedTile[]; // front to back for every ray of the view
  surround: number; // the one to draw behind them, -1 where there is none
  requests: TileRequest[]; // the most urgent first
}

export class TileSelector {
  private readonly replaced: boolean[]; // tiles that were to be replaced when last seen

  constructor(
    private readonly tree: TileTree,
    public settings: SelectionSettings = { ...kSelectionSettings },
  ) {
    this.replaced = tree.tiles.map(() => false);
  }

  // `loaded` says which contents are in memory; the coarsest must be for the cut to cover everything.
  select(view: SelectionView, loaded: (tile: number) => boolean): Selection {
    const pass = { view, loaded, cut: [], requests: [] } satisfies Pass;
    this.cover(pass, 0, []);
    const { cut, requests } = pass as Pass;
    let surround = -1;
    if (this.tree.surround >= 0 && this.cover(pass, this.tree.surround, [])) surround = cut.pop()!.tile;
    requests.sort((a, b) => b.priority - a.priority || a.distance - b.distance);
    return { cut, surround, requests };
  }

  // Adds tiles to the cut that cover this one. Where there are none in memory: false, and adds those that would do.
  private cover(pass: Pass, tile: number, missing: number[]): boolean {
    const { tree, settings } = this;
    const node = tree.tiles[tile];
    if (!pass.view.sees(node) || (!node.content && node.children.length === 0)) {
      pass.cut.push({ tile, visible: false });
      return true;
    }
    if (!node.content) {
      this.replaced[tile] = true;
    } else if (node.children.length === 0 || node.level <= settings.finestLevel) {
      this.replaced[tile] = false;
    } else {
      const threshold = settings.mostPixels / (this.replaced[tile] ? settings.hysteresis : 1);
      this.replaced[tile] = pass.view.errorInPixels(node) > threshold;
    }
    const replaced = this.replaced[tile];
    const loaded = node.content !== undefined && pass.loaded(tile);
    if (node.children.length > 0 && (replaced || !loaded)) {
      const cutBefore = pass.cut.length;
      const requestsBefore = pass.requests.length;
      const missingBelow: number[] = [];
      let covered = true;
      for (const child of childrenFrontToBack(tree, tile, pass.view.eye)) {
        covered = this.cover(pass, child, missingBelow) && covered;
      }
      if (covered) {
        if (!replaced) this.request(pass, [tile], [], node); // finer than need be
        return true;
      }
      if (!node.content) {
        missing.push(...missingBelow);
        return false; // what covers other children stays in the cut for whoever asks what to keep
      }
      const beside = pass.cut.slice(cutBefore).filter(({ visible }) => visible).map((one) => one.tile);
      pass.cut.length = cutBefore;
      pass.requests.length = requestsBefore;
      if (loaded) this.request(pass, missingBelow, beside, node);
    }
    if (loaded) pass.cut.push({ tile, visible: true });
    else missing.push(tile);
    return loaded;
  }

  private request({ view, requests }: Pass, tiles: number[], beside: number[], instead: TileNode): void {
    const error = view.errorInPixels(instead) / Math.max(this.settings.mostPixels, 1e-3);
    requests.push({ tiles, beside, priority: view.areaInPixels(instead) * error, distance: view.distance(instead) });
  }
}

interface Pass {
  view: SelectionView;
  loaded: (tile: number) => boolean;
  cut: SelectedTile[];
  requests: TileRequest[];
}
