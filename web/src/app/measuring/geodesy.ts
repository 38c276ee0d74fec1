// Converts places of the viewer to geographic coordinates, and formats lengths. The viewer's world is the capture's, y
// up.
import type { Georeference, Vec3 } from '../../tiles/tileset';

export interface Geodetic {
  latitude: number; // degrees, WGS 84
  longitude: number;
  height: number; // metres above the ellipsoid
}

// WGS 84 (NIMA TR8350.2, table 3.1).
const kEquator = 6378137; // metres
const kFlattening = 1 / 298.257223563;
const kPole = kEquator * (1 - kFlattening);
const kEccentricity2 = kFlattening * (2 - kFlattening);
const kSecondEccentricity2 = kEccentricity2 / (1 - kEccentricity2);
const kDegree = Math.PI / 180;

// Converts to Earth-centred, Earth-fixed metres (EPSG 4978).
export function earthFromGeodetic({ latitude, longitude, height }: Geodetic): Vec3 {
  const [sin, cos] = [Math.sin(latitude * kDegree), Math.cos(latitude * kDegree)];
  const normal = kEquator / Math.sqrt(1 - kEccentricity2 * sin * sin);
  const fromAxis = (normal + height) * cos;
  return [
    fromAxis * Math.cos(longitude * kDegree),
    fromAxis * Math.sin(longitude * kDegree),
    (normal * (1 - kEccentricity2) + height) * sin,
  ];
}

// Bowring, "Transformation from spatial to geographical coordinates", Survey Review 23 (1976), with one more iteration
// than in the paper; the height follows Bowring, "The accuracy of geodetic latitude and height equations", Survey
// Review 28 (1985).
export function geodeticFromEarth([x, y, z]: Vec3): Geodetic {
  const fromAxis = Math.hypot(x, y);
  let reduced = Math.atan2(z * kEquator, fromAxis * kPole);
  let latitude = 0;
  for (let i = 0; i < 2; ++i) {
    latitude = Math.atan2(
      z + kSecondEccentricity2 * kPole * Math.sin(reduced) ** 3,
      fromAxis - kEccentricity2 * kEquator * Math.cos(reduced) ** 3);
    reduced = Math.atan2((1 - kFlattening) * Math.sin(latitude), Math.cos(latitude));
  }
  const sin = Math.sin(latitude);
  const height = fromAxis * Math.cos(latitude) + z * sin - kEquator * Math.sqrt(1 - kEccentricity2 * sin * sin);
  return { latitude: latitude / kDegree, longitude: Math.atan2(y, x) / kDegree, height };
}

// Converts from metres east, north and up of a place.
export function earthFromEastNorthUp(origin: Geodetic, [east, north, up]: Vec3): Vec3 {
  const [sinLat, cosLat] = [Math.sin(origin.latitude * kDegree), Math.cos(origin.latitude * kDegree)];
  const [sinLon, cosLon] = [Math.sin(origin.longitude * kDegree), Math.cos(origin.longitude * kDegree)];
  const [x, y, z] = earthFromGeodetic(origin);
  const outward = cosLat * up - sinLat * north; // away from the Earth's axis
  return [x + cosLon * outward - sinLon * east, y + sinLon * outward + cosLon * east, z + sinLat * up + cosLat * north];
}

// The frame in which measurements are given: metres east, north and up of the georeference; without one, the capture's
// own axes, z up, in units of unknown length.
export class GroundFrame {
  readonly unitsPerMetre: number; // units of the viewer's world; 1 without a georeference
  private readonly origin?: Geodetic;
  private readonly fromWorld: readonly number[];

  constructor(georeference?: Georeference) {
    if (georeference) {
      const { latitude, longitude, altitude } = georeference;
      this.origin = { latitude, longitude, height: altitude };
    }
    this.fromWorld = georeference?.enuFromWorld ?? [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    this.unitsPerMetre = 1 / Math.hypot(this.fromWorld[0], this.fromWorld[1], this.fromWorld[2]);
  }

  get isGeoreferenced(): boolean {
    return this.origin !== undefined;
  }

  inGround([x, y, z]: Vec3): Vec3 {
    const m = this.fromWorld;
    const row = (i: number) => m[i] * x - m[4 + i] * z + m[8 + i] * y + m[12 + i];
    return [row(0), row(1), row(2)];
  }

  // One metre (or unit) upwards, in the viewer's world.
  get up(): Vec3 {
    const m = this.fromWorld;
    const squared = this.unitsPerMetre ** 2;
    return [m[2] * squared, m[10] * squared, -m[6] * squared];
  }

  // Returns undefined if the capture is not georeferenced.
  onEarth(place: Vec3): Geodetic | undefined {
    return this.origin && geodeticFromEarth(earthFromEastNorthUp(this.origin, this.inGround(place)));
  }

  // Returns the height above the ellipsoid, which takes the Earth's curvature into account; without a georeference, the
  // height along the capture's z axis.
  height(place: Vec3): number {
    return this.onEarth(place)?.height ?? this.inGround(place)[2];
  }

  length(value: number): string {
    const size = Math.abs(value);
    if (!this.isGeoreferenced) return `${fourDigits(value)} units`;
    return size < 999.995 ? `${value.toFixed(2)} m` : `${(value / 1e3).toFixed(3)} km`;
  }

  area(value: number): string {
    if (!this.isGeoreferenced) return `${fourDigits(value)} units²`;
    if (value < 9999.95) return `${value.toFixed(1)} m²`;
    return value < 999950 ? `${(value / 1e4).toFixed(2)} ha` : `${(value / 1e6).toFixed(3)} km²`;
  }
}

// 7 decimals resolve a centimetre.
export function degrees(value: number): string {
  return value.toFixed(7);
}

export function fourDigits(value: number): string {
  const before = value === 0 ? 1 : Math.floor(Math.log10(Math.abs(value))) + 1;
  return value.toFixed(Math.min(Math.max(4 - before, 0), 8));
}
