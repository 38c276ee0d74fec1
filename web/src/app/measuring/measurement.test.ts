import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { OpaqueDepth } from '../../draw/opaque-depth';
import type { Vec3 } from '../../tiles/tileset';
import { GroundFrame } from './geodesy';
import { areaFigures, areaVector, corner, lineFigures, onPlane, type Measurement } from './measurement';
import { exportMeasurements, headline, hintText, measurementLabels, measurementRows } from './measurement-text';
import { MeasuringMarks } from './measuring-marks';

const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const lake = new GroundFrame({ latitude: 46.4531, longitude: 6.5412, altitude: 372, enuFromWorld: identity });
const nowhere = new GroundFrame();
// Converts metres east, north and up to the viewer's world.
const at = (east: number, north: number, up: number): Vec3 => [east, up, -north];
const rectangle = [at(0, 0, 5), at(40, 0, 5), at(40, 30, 5), at(0, 30, 5)];

describe('a line', () => {
  it('has the horizontal length and rise of its segments', () => {
    const { segments, length, horizontal, rise } = lineFigures([at(0, 0, 0), at(3, 0, 4), at(3, 5, 4)], nowhere);
    expect(segments).toEqual([5, 5]);
    expect([length, horizontal, rise]).toEqual([10, 8, 4]);
  });

  it('rises by the height above the ellipsoid, not above a plane', () => {
    const far = lineFigures([at(0, 0, 0), at(5000, 0, 0)], lake);
    expect(far.rise).toBeCloseTo(5000 ** 2 / (2 * 6388000), 2);
    expect(far.length).toBeCloseTo(5000, 9);
    const near = lineFigures([at(0, 0, 0), at(30, 0, 40)], lake);
    expect(near.rise).toBeCloseTo(40, 3);
    expect(near.horizontal).toBeCloseTo(30, 3);
  });

  it('has the right angle of a height at the height of the lower place', () => {
    const expected = at(7, 1, 2);
    const [low, high] = [at(3, 1, 2), at(7, 1, 12)];
    for (const places of [[low, high], [high, low]]) {
      corner(places, nowhere).forEach((value, axis) => expect(value).toBeCloseTo(expected[axis], 12));
    }
  });
});

describe('an area', () => {
  it('of a horizontal polygon is the same in plan and on its plane, in either orientation', () => {
    for (const ring of [rectangle, [...rectangle].reverse()]) {
      const { plan, plane, perimeter, crosses } = areaFigures(ring, nowhere);
      expect([plan, plane, perimeter, crosses]).toEqual([1200, 1200, 140, false]);
    }
  });

  it('of a roof is larger than in plan', () => {
    const roof = [at(0, 0, 0), at(10, 0, 0), at(10, 3, 4), at(0, 3, 4)];
    const { plan, plane } = areaFigures(roof, nowhere);
    expect(plan).toBeCloseTo(30, 12);
    expect(plane).toBeCloseTo(50, 12);
  });

  it('of a wall is measured on the wall', () => {
    const wall = [at(0, 0, 0), at(6, 8, 0), at(6, 8, 3), at(0, 0, 3)];
    const { plan, plane, crosses } = areaFigures(wall, nowhere);
    expect(plan).toBeCloseTo(0, 12);
    expect(plane).toBeCloseTo(30, 12);
    expect(crosses).toBe(false);
    expect(headline({ kind: 'area', places: wall }, lake)).toBe('30.0 m²');
    expect(headline({ kind: 'area', places: rectangle }, lake)).toBe('1200.0 m²');
  });

  it('does not change if the last place repeats the first', () => {
    const { plan, plane, perimeter, crosses } = areaFigures([...rectangle, rectangle[0]], nowhere);
    expect([plan, plane, perimeter, crosses]).toEqual([1200, 1200, 140, false]);
  });

  it('of an L shape is exact, also far from the origin', () => {
    const ring = ([[0, 0], [20, 0], [20, 10], [10, 10], [10, 30], [0, 30]] as const).map(([x, y]): Vec3 => [x + 1e6, y - 2e6, 3]);
    expect(areaVector(ring)).toEqual([0, 0, 400]);
    expect(onPlane(ring)).toHaveLength(6);
  });

  it('is not reported if edges intersect', () => {
    const bow = [at(0, 0, 0), at(10, 10, 0), at(12, 0, 0), at(0, 9, 0)];
    expect(areaFigures(bow, nowhere).crosses).toBe(true);
    expect(measurementRows({ kind: 'area', places: bow }, lake)[0]).toEqual(['Area', 'its edges cross']);
  });
});

describe('the texts of measurements', () => {
  const line: Measurement = { kind: 'distance', places: [at(0, 0, 0), at(0, 0, 3), at(4, 0, 0)] };

  it('are in metres with a georeference, and in units without', () => {
    expect(measurementRows(line, lake)).toEqual([['Length', '8.00 m'], ['Horizontal', '4.00 m'], ['Rise', '+0.00 m']]);
    expect(measurementLabels(line, lake).map(({ text }) => text)).toEqual(['3.00 m', '5.00 m', 'Σ 8.00 m']);
    expect(headline(line, nowhere)).toBe('8.000 units');
  });

  it('are exported as GeoJSON with closed counterclockwise rings', () => {
    const { extension, text } = exportMeasurements([line, { kind: 'area', places: [...rectangle].reverse() }, { kind: 'place', places: [at(0, 0, 0)] }], lake);
    expect(extension).toBe('geojson');
    const { type, features } = JSON.parse(text);
    expect(type).toBe('FeatureCollection');
    expect(features.map((one: { geometry: { type: string } }) => one.geometry.type)).toEqual(['LineString', 'Polygon', 'Point']);
    expect(features[0].properties).toMatchObject({ kind: 'distance', length: 8, segments: [3, 5] });
    expect(features[1].properties).toMatchObject({ areaInPlan: 1200, areaOnPlane: 1200, perimeter: 140, edgesCross: false });
    expect(features[2].geometry.coordinates).toEqual([6.5412, 46.4531, 372]);
    const [ring] = features[1].geometry.coordinates as [number, number][][];
    expect(ring).toHaveLength(5);
    expect(ring[4]).toEqual(ring[0]);
    const twice = ring.slice(1).reduce((sum, [x, y], i) => sum + (ring[i][0] - 6) * (y - 46) - (x - 6) * (ring[i][1] - 46), 0);
    expect(twice).toBeGreaterThan(0);
  });

  it("are exported in the capture's axes without a georeference", () => {
    const { extension, text } = exportMeasurements([line], nowhere);
    expect(extension).toBe('json');
    expect(JSON.parse(text).measurements[0]).toMatchObject({ kind: 'distance', length: 8, places: [[0, 0, 0], [0, 0, 3], [4, 0, 0]] });
  });
});

describe('the instruction for the next step', () => {
  it('depends on the pointing device', () => {
    expect(hintText('distance', false)).toBe('Click along it; double click ends.');
    expect(hintText('area', true)).toBe('Tap around it; Done ends.');
    expect(hintText('place', true)).toBe('Tap on a place.');
  });
});

describe('marks in the world', () => {
  const all: Measurement[] = [
    { kind: 'area', places: rectangle }, { kind: 'height', places: [at(0, 0, 0), at(3, 0, 4)] }, { kind: 'place', places: [at(1, 1, 1)] },
  ];

  it('end no ray of the scene', () => {
    const world = new THREE.Scene();
    const city = new THREE.Object3D();
    const marks = new MeasuringMarks();
    marks.show(all, lake);
    expect(marks.group.children.length).toBeGreaterThan(3);
    world.add(city, marks.group);
    const picture = { camera: new THREE.PerspectiveCamera(), part: new THREE.Vector4(0, 0, 8, 8) };
    const noRenderer = undefined as unknown as THREE.WebGLRenderer; // nothing is rendered
    expect(new OpaqueDepth().draw(noRenderer, [picture], city, new THREE.Vector2(8, 8))).toBeNull();
  });

  it('free their GPU memory', () => {
    const marks = new MeasuringMarks();
    marks.show(all, lake);
    const geometries = new Set(marks.group.children.map((child) => (child as THREE.Mesh).geometry));
    let disposed = 0;
    for (const geometry of geometries) geometry.addEventListener('dispose', () => ++disposed);
    marks.show([], lake);
    expect(disposed).toBe(geometries.size);
    expect(marks.group.children).toHaveLength(0);
  });
});
