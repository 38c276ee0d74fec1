import { describe, expect, it } from 'vitest';
import { kCodecs } from '../../representations/codecs';
import { decodeTileset } from '../../tiles/decode-tileset';
import { goldenText } from '../../testing/golden';
import type { Vec3 } from '../../tiles/tileset';
import { degrees, earthFromEastNorthUp, earthFromGeodetic, geodeticFromEarth, GroundFrame } from './geodesy';

function expectClose(actual: Vec3, expected: readonly number[], maximum: number): void {
  actual.forEach((value, axis) => expect(Math.abs(value - expected[axis])).toBeLessThan(maximum));
}

// The writer of the golden scene computed this georeference, the pose of the tangent plane, with GeographicLib.
const { root, extensions } = JSON.parse(goldenText('tileset.json')) as {
  root: { transform: number[] };
  extensions: { TESSERA_scene: { georeference: { latitude: number; longitude: number; altitude: number } } };
};
const { latitude, longitude, altitude } = extensions.TESSERA_scene.georeference;
const brighton = { latitude, longitude, height: altitude };

describe('the Earth', () => {
  it('converts places on the ellipsoid', () => {
    expectClose(earthFromGeodetic({ latitude: 0, longitude: 0, height: 0 }), [6378137, 0, 0], 1e-6);
    expectClose(earthFromGeodetic({ latitude: 0, longitude: 90, height: 10 }), [0, 6378147, 0], 1e-6);
    expectClose(earthFromGeodetic({ latitude: 90, longitude: 0, height: 5 }), [0, 0, 6356752.314245 + 5], 1e-5);
    expectClose(earthFromGeodetic(brighton), root.transform.slice(12, 15), 1e-6);
  });

  it('agrees with GeographicLib on east, north and up', () => {
    const t = root.transform;
    const expected = [0, 1, 2].map((row) => t[row] * 300 + t[4 + row] * -200 + t[8 + row] * 50 + t[12 + row]);
    expectClose(earthFromEastNorthUp(brighton, [300, -200, 50]), expected, 1e-6);
  });

  it('converts every place back to itself', () => {
    for (const lat of [-90, -89.9999, -45, -0.001, 0, 12.3, 46.4531, 60, 89.9, 90]) {
      for (const lon of [-179.5, -90, 0, 6.5412, 135]) {
        for (const height of [-400, 0, 372, 8848, 50000]) {
          const back = geodeticFromEarth(earthFromGeodetic({ latitude: lat, longitude: lon, height }));
          expect(Math.abs(back.latitude - lat)).toBeLessThan(1e-9);
          if (Math.abs(lat) < 90) expect(Math.abs(back.longitude - lon)).toBeLessThan(1e-9);
          expect(Math.abs(back.height - height)).toBeLessThan(1e-6);
        }
      }
    }
  });
});

// Rotated by 30° about the vertical axis, with two units per metre.
const [cos, sin] = [0.5 * Math.cos(Math.PI / 6), 0.5 * Math.sin(Math.PI / 6)];
const turned = new GroundFrame({
  latitude: 46.4531, longitude: 6.5412, altitude: 372,
  enuFromWorld: [cos, sin, 0, 0, -sin, cos, 0, 0, 0, 0, 0.5, 0, 100, 200, 3, 1],
});

describe('the frame of the ground', () => {
  it("is the capture's own, z up, in its units, without a georeference", () => {
    const frame = new GroundFrame();
    expect(frame.isGeoreferenced).toBe(false);
    expect(frame.inGround([1, 2, 3])).toEqual([1, -3, 2]);
    expect(frame.onEarth([1, 2, 3])).toBeUndefined();
    expect(frame.height([1, 2, 3])).toBe(2);
    expect(frame.length(12.3456)).toBe('12.35 units');
    expect(frame.length(0.0123456)).toBe('0.01235 units');
    expect(frame.area(1234.56)).toBe('1235 units²');
  });

  it('is in metres east, north and up with a georeference', () => {
    expectClose(turned.inGround([10, 8, 0]), [100 + 10 * cos, 200 + 10 * sin, 7], 1e-12);
    expect(turned.unitsPerMetre).toBeCloseTo(2, 12);
    expectClose(turned.up, [0, 2, 0], 1e-12);
    const tilted = new GroundFrame({ latitude: 0, longitude: 0, altitude: 0, enuFromWorld: [1.6, 0, 1.2, 0, 0, 2, 0, 0, -1.2, 0, 1.6, 0, 1, 2, 3, 1] });
    expectClose(tilted.inGround(tilted.up), [1, 2, 4], 1e-12);
  });

  it('converts places of the viewer', () => {
    const frame = new GroundFrame(decodeTileset(goldenText('tileset.json'), 'tileset.json', kCodecs).georeference);
    // Two steps of a hundred metres; the radii of curvature at 50.8225° N are computed by hand.
    const e2 = 0.00669437999014;
    const w = Math.sqrt(1 - e2 * Math.sin((latitude * Math.PI) / 180) ** 2);
    const northRadius = (6378137 * (1 - e2)) / w ** 3 + altitude;
    const eastRadius = (6378137 / w + altitude) * Math.cos((latitude * Math.PI) / 180);
    const north = frame.onEarth([0, 0, -100])!;
    expect(north.latitude).toBeCloseTo(latitude + ((100 / northRadius) * 180) / Math.PI, 8);
    expect(north.longitude).toBeCloseTo(longitude, 9);
    const east = frame.onEarth([100, 0, 0])!;
    expect(east.longitude).toBeCloseTo(longitude + ((100 / eastRadius) * 180) / Math.PI, 8);
    // The tangent plane departs from the ellipsoid by d² / 2R.
    expect(east.height - altitude).toBeCloseTo(100 ** 2 / (2 * 6378137), 4);
  });

  it('formats lengths, areas and degrees', () => {
    expect(turned.length(12.344)).toBe('12.34 m');
    expect(turned.length(999.99)).toBe('999.99 m');
    expect(turned.length(999.996)).toBe('1.000 km');
    expect(turned.length(1204.2)).toBe('1.204 km');
    expect(turned.area(350.24)).toBe('350.2 m²');
    expect(turned.area(9999.96)).toBe('1.00 ha');
    expect(turned.area(13200)).toBe('1.32 ha');
    expect(turned.area(2.5e6)).toBe('2.500 km²');
    expect(degrees(6.54120001)).toBe('6.5412000');
  });
});
