// The texts of measurements: in the panel, as labels, and in exported files.
import type { Vec3 } from '../../tiles/tileset';
import { degrees, fourDigits, type GroundFrame } from './geodesy';
import { areaFigures, corner, lineFigures, middle, type Kind, type Measurement } from './measurement';

export const kKindNames: Record<Kind, string> = { place: 'Place', distance: 'Distance', height: 'Height', area: 'Area' };

// Returns the instruction for the next step.
export function hintText(kind: Kind, isTouch: boolean): string {
  const click = isTouch ? 'Tap' : 'Click';
  const end = isTouch ? 'Done ends' : 'double click ends';
  const hints: Record<Kind, string> = {
    place: `${click} on a place.`,
    distance: `${click} along it; ${end}.`,
    height: `${click} below, then above.`,
    area: `${click} around it; ${end}.`,
  };
  return hints[kind];
}

export type Row = [name: string, value: string];

// A label in the world.
export interface Label {
  at: Vec3;
  text: string;
  isMinor?: boolean;
  stands?: 'above' | 'beside'; // relative to the place, so that a dot or a short line remains visible
}

export function placeRows(place: Vec3, frame: GroundFrame): Row[] {
  const earth = frame.onEarth(place);
  if (!earth) return frame.inGround(place).map((value, axis): Row => ['xyz'[axis], fourDigits(value)]);
  return [
    ['Latitude', `${degrees(earth.latitude)}°`],
    ['Longitude', `${degrees(earth.longitude)}°`],
    ['Height, ellipsoid', frame.length(earth.height)],
  ];
}

// Returns text for the clipboard: latitude, longitude and height, or x, y and z without a georeference.
export function placeNumbers(place: Vec3, frame: GroundFrame): string {
  const earth = frame.onEarth(place);
  if (!earth) return frame.inGround(place).map(fourDigits).join(', ');
  return `${degrees(earth.latitude)}, ${degrees(earth.longitude)}, ${earth.height.toFixed(2)}`;
}

export function measurementRows({ kind, places }: Measurement, frame: GroundFrame): Row[] {
  if (kind === 'place' || places.length < 2) return [];
  if (kind === 'area' && places.length > 2) {
    const { plan, plane, perimeter, crosses } = areaFigures(places, frame);
    if (crosses) return [['Area', 'its edges cross'], ['Perimeter', frame.length(perimeter)]];
    return [['In plan', frame.area(plan)], ['On its plane', frame.area(plane)], ['Perimeter', frame.length(perimeter)]];
  }
  const { length, horizontal, rise } = lineFigures(places, frame);
  if (kind === 'height') {
    return [['Height', frame.length(Math.abs(rise))], ['Horizontal', frame.length(horizontal)], ['Straight', frame.length(length)]];
  }
  const sign = rise < 0 ? '−' : '+';
  return [['Length', frame.length(length)], ['Horizontal', frame.length(horizontal)], ['Rise', `${sign}${frame.length(Math.abs(rise))}`]];
}

// Returns the one figure that represents a measurement.
export function headline(measurement: Measurement, frame: GroundFrame): string {
  const { kind, places } = measurement;
  if (kind === 'place') {
    const earth = frame.onEarth(places[0]);
    return earth ? `${earth.latitude.toFixed(5)}°, ${earth.longitude.toFixed(5)}°` : placeNumbers(places[0], frame);
  }
  const rows = measurementRows(measurement, frame);
  // The plan area of a wall is meaningless.
  if (kind === 'area' && rows.length === 3) {
    const { plan, plane } = areaFigures(places, frame);
    return plan < 0.5 * plane ? rows[1][1] : rows[0][1];
  }
  return rows[0]?.[1] ?? '';
}

export function measurementLabels(measurement: Measurement, frame: GroundFrame): Label[] {
  const { kind, places } = measurement;
  const text = headline(measurement, frame);
  if (text === '') return [];
  if (kind === 'place') return [{ at: places[0], text, stands: 'above' }];
  if (kind === 'area') return [{ at: middle(places), text }];
  if (kind === 'height') {
    const foot = corner(places, frame);
    const top = frame.height(places[1]) > frame.height(places[0]) ? places[1] : places[0];
    return [{ at: middle([foot, top]), text, stands: 'beside' }];
  }
  if (places.length === 2) return [{ at: middle(places), text }];
  const { segments } = lineFigures(places, frame);
  const minor = segments.map((value, i) => ({ at: middle([places[i], places[i + 1]]), text: frame.length(value), isMinor: true }));
  return [...minor, { at: places[places.length - 1], text: `Σ ${text}`, stands: 'above' }];
}

// Exports GeoJSON (RFC 7946) if the capture is georeferenced, otherwise coordinates in the capture's own axes and
// units.
export function exportMeasurements(measurements: readonly Measurement[], frame: GroundFrame): { extension: string; text: string } {
  const isOnEarth = frame.isGeoreferenced;
  const content = isOnEarth
    ? { type: 'FeatureCollection', features: measurements.map((one) => feature(one, frame)) }
    : {
        axes: 'z up', unit: 'of the capture, length not known',
        measurements: measurements.map((one) => ({ ...properties(one, frame), places: one.places.map((place) => frame.inGround(place)) })),
      };
  return { extension: isOnEarth ? 'geojson' : 'json', text: `${JSON.stringify(content, null, 1)}\n` };
}

function feature(measurement: Measurement, frame: GroundFrame) {
  const { kind, places } = measurement;
  const positions = places.map((place) => {
    const { latitude, longitude, height } = frame.onEarth(place)!;
    return [round(longitude, 9), round(latitude, 9), round(height, 4)];
  });
  let geometry: { type: string; coordinates: unknown } = { type: 'LineString', coordinates: positions };
  if (kind === 'place') geometry = { type: 'Point', coordinates: positions[0] };
  if (kind === 'area') {
    if (isClockwise(positions)) positions.reverse(); // outer rings must be counterclockwise
    geometry = { type: 'Polygon', coordinates: [[...positions, positions[0]]] };
  }
  return { type: 'Feature', geometry, properties: properties(measurement, frame) };
}

// Metres and square metres, or the capture's units.
function properties({ kind, places }: Measurement, frame: GroundFrame): Record<string, string | number | number[] | boolean> {
  if (kind === 'place') return { kind };
  if (kind === 'area') {
    const { plan, plane, perimeter, crosses } = areaFigures(places, frame);
    return { kind, areaInPlan: round(plan, 4), areaOnPlane: round(plane, 4), perimeter: round(perimeter, 4), edgesCross: crosses };
  }
  const { segments, length, horizontal, rise } = lineFigures(places, frame);
  const figures = { length: round(length, 4), horizontal: round(horizontal, 4), rise: round(rise, 4) };
  return kind === 'height' ? { kind, ...figures } : { kind, ...figures, segments: segments.map((one) => round(one, 4)) };
}

function isClockwise(ring: readonly number[][]): boolean {
  return ring.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = ring[(i + 1) % ring.length];
    return sum + (x - ring[0][0]) * (nextY - ring[0][1]) - (nextX - ring[0][0]) * (y - ring[0][1]);
  }, 0) < 0;
}

function round(value: number, digits: number): number {
  return Number(value.toFixed(digits));
}
