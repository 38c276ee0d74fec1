// What a camera sees of a scene, in its units. Twin of TileView in src/render/tile_selection.h.
import type { Box, Vec3 } from '../tiles/tileset';
import type { TileNode } from './tile-tree';

// A plane whose positive side is seen: a x + b y + c z + d >= 0.
export type Plane = readonly [number, number, number, number];

type Place = Pick<TileNode, 'low' | 'high' | 'isSurround'>;

export class TileView {
  // `planes` bound what is seen; `focal` in pixels, `pixels` those of the whole picture; distances below `nearest` count
  // as that. A parallel projection has no eye: the same error everywhere, `focal` pixels for a scene unit.
  // `surroundPixels`: those in which the surround is looked at.
  constructor(
    readonly eye: Vec3,
    readonly planes: readonly Plane[],
    readonly focal: number,
    readonly pixels: number,
    readonly nearest: number,
    readonly parallel = false,
    readonly surroundPixels = pixels,
  ) {}

  // True for all that can be seen, and for little else.
  sees({ low, high, isSurround }: Place): boolean {
    return isSurround || this.planes.every(([a, b, c, d]) => {
      const farthest = a * (a > 0 ? high[0] : low[0]) + b * (b > 0 ? high[1] : low[1]) + c * (c > 0 ? high[2] : low[2]) + d;
      return farthest >= 0;
    });
  }

  // Of the surround, to what is nearest of it beyond the sides of the scene's box: what lies above is sky, and the ground
  // hides what lies below.
  distance({ low, high, isSurround }: Place): number {
    if (isSurround) {
      const inside = (a: number) => Math.min(this.eye[a] - low[a], high[a] - this.eye[a]);
      return Math.max(this.nearest, Math.min(inside(0), inside(1)));
    }
    const outside = (a: number) => Math.max(low[a] - this.eye[a], 0, this.eye[a] - high[a]);
    return Math.max(this.nearest, Math.hypot(outside(0), outside(1), outside(2)));
  }

  errorInPixels(tile: TileNode): number {
    return (tile.geometricError * this.focal) / (this.parallel ? 1 : this.distance(tile));
  }

  // Pixels that a tile may cover.
  areaInPixels({ low, high, isSurround }: Place): number {
    if (isSurround) return this.surroundPixels;
    const radius = 0.5 * Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    const onScreen = (radius * this.focal) / (this.parallel ? 1 : Math.max(radius, this.distance({ low, high, isSurround })));
    return Math.min(this.pixels, Math.PI * onScreen ** 2);
  }
}

// Whether a ray shows what matters of the surround: it misses the scene's box, or leaves it through a side. What lies above
// is sky, and the ground hides what lies below.
export function showsSurround(eye: Vec3, direction: Vec3, { low, high }: Box): boolean {
  const near = [0, 1, 2].map((a) => ((direction[a] > 0 ? low[a] : high[a]) - eye[a]) / direction[a]);
  const far = [0, 1, 2].map((a) => ((direction[a] > 0 ? high[a] : low[a]) - eye[a]) / direction[a]);
  const exit = Math.min(...far.map((t) => (Number.isNaN(t) ? Infinity : t)));
  const entry = Math.max(0, ...near.map((t) => (Number.isNaN(t) ? 0 : t)));
  return exit <= entry || far[2] > exit;
}

// What the selection asks of a view.
export type SelectionView = Pick<TileView, 'eye' | 'sees' | 'distance' | 'errorInPixels' | 'areaInPixels'>;

// Several views at once, of a headset's two eyes say: of all that any of them sees, as much as the one that needs most.
export function jointView(views: readonly TileView[]): SelectionView {
  const most = (of: (view: TileView) => number) => Math.max(...views.map(of));
  return {
    eye: views[0].eye,
    sees: (place) => views.some((view) => view.sees(place)),
    distance: (place) => -most((view) => -view.distance(place)),
    errorInPixels: (tile) => most((view) => view.errorInPixels(tile)),
    areaInPixels: (place) => most((view) => view.areaInPixels(place)),
  };
}
