// What a camera sees of a scene, in scene units. Counterpart of TileView in src/render/tile_selection.h.
import type { Box, Vec3 } from '../tiles/tileset';
import type { TileNode } from './tile-tree';

// A plane (a, b, c, d) whose visible side is a x + b y + c z + d >= 0.
export type Plane = readonly [number, number, number, number];

type Place = Pick<TileNode, 'low' | 'high' | 'isBackgroundBlock'>;

export class TileView {
  // `planes` bound the view volume; `focal` is the focal length in pixels and `pixels` the pixel count of the whole
  // view; distances below `nearest` are clamped to it. For a parallel projection the projected error is the same
  // everywhere, with `focal` pixels per scene unit. `backgroundBlockPixels` is the number of pixels that show the
  // background block.
  constructor(
    readonly eye: Vec3,
    readonly planes: readonly Plane[],
    readonly focal: number,
    readonly pixels: number,
    readonly nearest: number,
    readonly parallel = false,
    readonly backgroundBlockPixels = pixels,
  ) {}

  // Returns whether a tile may be visible: true for every visible tile, and for few others.
  sees({ low, high, isBackgroundBlock }: Place): boolean {
    return isBackgroundBlock || this.planes.every(([a, b, c, d]) => {
      const farthest = a * (a > 0 ? high[0] : low[0]) + b * (b > 0 ? high[1] : low[1]) + c * (c > 0 ? high[2] : low[2]) + d;
      return farthest >= 0;
    });
  }

  // Returns the distance of the background block: to the nearest place of it beyond the sides of the scene's box, as
  // what lies above is sky and what lies below is hidden by the ground.
  distance({ low, high, isBackgroundBlock }: Place): number {
    if (isBackgroundBlock) {
      const inside = (a: number) => Math.min(this.eye[a] - low[a], high[a] - this.eye[a]);
      return Math.max(this.nearest, Math.min(inside(0), inside(1)));
    }
    const outside = (a: number) => Math.max(low[a] - this.eye[a], 0, this.eye[a] - high[a]);
    return Math.max(this.nearest, Math.hypot(outside(0), outside(1), outside(2)));
  }

  errorInPixels(tile: TileNode): number {
    return (tile.geometricError * this.focal) / (this.parallel ? 1 : this.distance(tile));
  }

  // Returns an upper bound of the pixels that a tile covers.
  areaInPixels({ low, high, isBackgroundBlock }: Place): number {
    if (isBackgroundBlock) return this.backgroundBlockPixels;
    const radius = 0.5 * Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    const onScreen = (radius * this.focal) / (this.parallel ? 1 : Math.max(radius, this.distance({ low, high, isBackgroundBlock })));
    return Math.min(this.pixels, Math.PI * onScreen ** 2);
  }
}

// Returns whether a ray shows a relevant part of the background block: it misses the scene's box or leaves it through a
// side. What lies above is sky, and the ground hides what lies below.
export function showsBackgroundBlock(eye: Vec3, direction: Vec3, { low, high }: Box): boolean {
  const near = [0, 1, 2].map((a) => ((direction[a] > 0 ? low[a] : high[a]) - eye[a]) / direction[a]);
  const far = [0, 1, 2].map((a) => ((direction[a] > 0 ? high[a] : low[a]) - eye[a]) / direction[a]);
  const exit = Math.min(...far.map((t) => (Number.isNaN(t) ? Infinity : t)));
  const entry = Math.max(0, ...near.map((t) => (Number.isNaN(t) ? 0 : t)));
  return exit <= entry || far[2] > exit;
}

// What the selection needs to know about a view.
export type SelectionView = Pick<TileView, 'eye' | 'sees' | 'distance' | 'errorInPixels' | 'areaInPixels'>;

// Combines several views, such as those of a headset's two eyes: a tile is visible if any view sees it, and is as
// urgent as in the view that needs it most.
export function jointView(views: readonly TileView[]): SelectionView {
  const maximum = (of: (view: TileView) => number) => Math.max(...views.map(of));
  return {
    eye: views[0].eye,
    sees: (place) => views.some((view) => view.sees(place)),
    distance: (place) => -maximum((view) => -view.distance(place)),
    errorInPixels: (tile) => maximum((view) => view.errorInPixels(tile)),
    areaInPixels: (place) => maximum((view) => view.areaInPixels(place)),
  };
}
