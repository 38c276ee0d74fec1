// Numbers and names of world.json, of which each is looked at. `fail` takes the place, as '.scale', and what is wrong.
import { fieldOf, numberFrom, numbersOf, stringOf, type Json } from '../../tiles/json-fields';

export type Fail = (place: string, reason: string) => never;
export type Three = [number, number, number];
export type Four = [number, number, number, number];

export const kNameLength = 1000;
export const kFarthest = 1e7; // metres
const kScales = { least: 1e-6, most: 1e6 };

// The nearest scale, or size, that a world may hold.
export function scaleWithin(x: number): number {
  return Math.min(Math.max(x, kScales.least), kScales.most);
}

// Times `factor`, or as near to that as a world may hold them in the same proportions.
export function scaledWithin(scales: readonly number[], factor: number): number[] {
  const nearest = Math.min(Math.max(factor, kScales.least / Math.min(...scales)), kScales.most / Math.max(...scales));
  return scales.map((x) => scaleWithin(x * nearest));
}

export function numbersWithin(object: Json, key: string, count: number, most: number, fail: Fail): number[] {
  const read = numbersOf(object, key, count) ?? fail(`.${key}`, `is not ${count} numbers`);
  return read.every((x) => Math.abs(x) <= most) ? read : fail(`.${key}`, `has a number beyond ${most}`);
}

export function numberWithin(object: Json, key: string, most: number, fail: Fail): number {
  const read = numberFrom(fieldOf(object, key)) ?? fail(`.${key}`, 'is no number');
  return Math.abs(read) <= most ? read : fail(`.${key}`, `is beyond ${most}`);
}

export function scalesOf(values: Json[], place: string, fail: Fail): number[] {
  const read = values.map(numberFrom).filter((x) => x !== undefined);
  if (read.length !== values.length) fail(place, 'is no number');
  if (!read.every((x) => x >= kScales.least)) fail(place, `is not above ${kScales.least}`);
  return read.every((x) => x <= kScales.most) ? read : fail(place, `has a number beyond ${kScales.most}`);
}

// x, y, z, w of a rotation, of length 1.
export function quaternionOf(object: Json, fail: Fail): Four {
  const read = numbersWithin(object, 'rotation', 4, 1.01, fail);
  const length = Math.hypot(...read);
  if (Math.abs(length - 1) > 0.01) fail('.rotation', 'is no rotation');
  return read.map((x) => x / length) as Four;
}

export function checkedName(object: Json, fail: Fail): string {
  const name = stringOf(object, 'name');
  return name !== undefined && name !== '' && name.length <= kNameLength ? name : fail('.name', 'is missing, or too long');
}
