// Validates numbers and names of world.json. `fail` is called with the place, such as '.scale', and what is wrong.
import { getField, numberFrom, getNumbers, getString, type Json } from '../../tiles/json-fields';

export type Fail = (place: string, reason: string) => never;
export type Three = [number, number, number];
export type Four = [number, number, number, number];

export const kNameLength = 1000;
export const kFarthest = 1e7; // metres
const kScales = { minimum: 1e-6, maximum: 1e6 };

// Returns the nearest scale or size that a world may contain.
export function scaleWithin(x: number): number {
  return Math.min(Math.max(x, kScales.minimum), kScales.maximum);
}

// Returns the scale times `factor`, or the nearest scale with the same proportions that a world may contain.
export function scaledWithin(scales: readonly number[], factor: number): number[] {
  const nearest = Math.min(Math.max(factor, kScales.minimum / Math.min(...scales)), kScales.maximum / Math.max(...scales));
  return scales.map((x) => scaleWithin(x * nearest));
}

export function numbersWithin(object: Json, key: string, count: number, maximum: number, fail: Fail): number[] {
  const read = getNumbers(object, key, count) ?? fail(`.${key}`, `is not ${count} numbers`);
  return read.every((x) => Math.abs(x) <= maximum) ? read : fail(`.${key}`, `has a number beyond ${maximum}`);
}

export function numberWithin(object: Json, key: string, maximum: number, fail: Fail): number {
  const read = numberFrom(getField(object, key)) ?? fail(`.${key}`, 'is not a number');
  return Math.abs(read) <= maximum ? read : fail(`.${key}`, `is beyond ${maximum}`);
}

export function readScales(values: Json[], place: string, fail: Fail): number[] {
  const read = values.map(numberFrom).filter((x) => x !== undefined);
  if (read.length !== values.length) fail(place, 'is not a number');
  if (!read.every((x) => x >= kScales.minimum)) fail(place, `is not above ${kScales.minimum}`);
  return read.every((x) => x <= kScales.maximum) ? read : fail(place, `has a number beyond ${kScales.maximum}`);
}

// x, y, z, w of a unit quaternion.
export function readQuaternion(object: Json, fail: Fail): Four {
  const read = numbersWithin(object, 'rotation', 4, 1.01, fail);
  const length = Math.hypot(...read);
  if (Math.abs(length - 1) > 0.01) fail('.rotation', 'is not a rotation');
  return read.map((x) => x / length) as Four;
}

export function checkedName(object: Json, fail: Fail): string {
  const name = getString(object, 'name');
  return name !== undefined && name !== '' && name.length <= kNameLength ? name : fail('.name', 'is missing, or too long');
}
