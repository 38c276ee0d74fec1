// The kinds of measurements and their mathematics. Places are in the viewer's world, in the order of the clicks.
import type { Vec3 } from '../../tiles/tileset';
import type { GroundFrame } from './geodesy';

export const kKinds = ['place', 'distance', 'height', 'area'] as const;
export type Kind = (typeof kKinds)[number];

export interface Measurement {
  kind: Kind;
  places: readonly Vec3[];
}

export const kMinPlaces: Record<Kind, number> = { place: 1, distance: 2, height: 2, area: 3 };
export const kMaxPlaces: Record<Kind, number> = { place: 1, distance: Infinity, height: 2, area: Infinity };

// Lengths in the units of the frame.
export interface LineFigures {
  segments: number[];
  length: number;
  horizontal: number; // of the segments, in plan
  rise: number; // from the first place to the last
}

export interface AreaFigures {
  plan: number; // of the horizontal projection
  plane: number; // on the best-fitting plane
  perimeter: number;
  crosses: boolean; // edges intersect, so the areas are meaningless
}

export function lineFigures(places: readonly Vec3[], frame: GroundFrame): LineFigures {
  const ground = places.map((place) => frame.inGround(place));
  const heights = places.map((place) => frame.height(place));
  const segments = ground.slice(1).map((place, i) => length(minus(place, ground[i])));
  // The horizontal length follows from the straight length and the rise, so that the Earth's curvature affects neither.
  const flat = segments.map((straight, i) => Math.sqrt(Math.max(straight ** 2 - (heights[i + 1] - heights[i]) ** 2, 0)));
  return { segments, length: sum(segments), horizontal: sum(flat), rise: (heights.at(-1) ?? 0) - (heights[0] ?? 0) };
}

export function areaFigures(places: readonly Vec3[], frame: GroundFrame): AreaFigures {
  const ring = places.map((place) => frame.inGround(place));
  const normal = areaVector(ring);
  const edges = ring.map((place, i) => length(minus(ring[(i + 1) % ring.length], place)));
  return { plan: Math.abs(normal[2]), plane: length(normal), perimeter: sum(edges), crosses: crossesItself(onPlane(ring)) };
}

// Returns the normal of the best-fitting plane, whose length is the polygon's area on it; its z is the plan area by the
// shoelace formula. Newell's method (Sutherland, Sproull, Schumacker, "A characterization of ten hidden-surface
// algorithms", 1974).
export function areaVector(ring: readonly Vec3[]): Vec3 {
  let total: Vec3 = [0, 0, 0];
  for (let i = 1; i + 1 < ring.length; ++i) total = plus(total, cross(minus(ring[i], ring[0]), minus(ring[i + 1], ring[0])));
  return times(total, 0.5);
}

// Projects along the normal of the best-fitting plane; counterclockwise.
export function onPlane(ring: readonly Vec3[]): [number, number][] {
  const normal = areaVector(ring);
  const size = length(normal);
  if (size === 0) return ring.map(() => [0, 0]);
  const n = times(normal, 1 / size);
  const minimum = [0, 1, 2].reduce((best, axis) => (Math.abs(n[axis]) < Math.abs(n[best]) ? axis : best), 0);
  const beside = cross(n, [0, 1, 2].map((axis) => (axis === minimum ? 1 : 0)) as unknown as Vec3);
  const u = times(beside, 1 / length(beside));
  const v = cross(n, u);
  return ring.map((place) => {
    const from = minus(place, ring[0]);
    return [dot(from, u), dot(from, v)];
  });
}

export function crossesItself(ring: readonly [number, number][]): boolean {
  const side = (a: number[], b: number[], c: number[]) => Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
  const crosses = (a: number[], b: number[], c: number[], d: number[]) =>
    side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
  const edges = ring.map((place, i) => [place, ring[(i + 1) % ring.length]] as const);
  return edges.some(([a, b], i) => edges.slice(i + 1).some(([c, d]) => crosses(a, b, c, d)));
}

// Returns the corner of a height's right angle, in the viewer's world: below the higher place, level with the lower one.
export function corner([a, b]: readonly Vec3[], frame: GroundFrame): Vec3 {
  const rise = frame.height(b) - frame.height(a);
  return rise > 0 ? plus(b, times(frame.up, -rise)) : plus(a, times(frame.up, rise));
}

export function middle(places: readonly Vec3[]): Vec3 {
  return times(places.reduce(plus, [0, 0, 0] as Vec3), 1 / places.length);
}

export const plus = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a: Vec3): number => Math.hypot(...a);
const sum = (values: readonly number[]): number => values.reduce((total, value) => total + value, 0);
