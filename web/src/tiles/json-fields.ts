// Fields of JSON from outside: undefined where one is missing, of another kind, or no finite number.

export type Json = unknown;

export function fieldOf(object: Json, key: string): Json {
  if (typeof object !== 'object' || object === null || Array.isArray(object)) return undefined;
  return Object.hasOwn(object, key) ? (object as Record<string, Json>)[key] : undefined;
}

export function arrayOf(object: Json, key: string): Json[] | undefined {
  const field = fieldOf(object, key);
  return Array.isArray(field) ? field : undefined;
}

export function stringOf(object: Json, key: string): string | undefined {
  const field = fieldOf(object, key);
  return typeof field === 'string' ? field : undefined;
}

export function flagOf(object: Json, key: string): boolean | undefined {
  const field = fieldOf(object, key);
  return typeof field === 'boolean' ? field : undefined;
}

export function numberFrom(value: Json): number | undefined {
  return typeof value === 'number' && Number.isFinite(value) ? value : undefined;
}

export function numberOf(object: Json, key: string): number | undefined {
  return numberFrom(fieldOf(object, key));
}

// A whole number from 0 to `most`.
export function wholeFrom(value: Json, most = 0xffffffff): number | undefined {
  return typeof value === 'number' && Number.isInteger(value) && value >= 0 && value <= most ? value : undefined;
}

export function wholeOf(object: Json, key: string, most?: number): number | undefined {
  return wholeFrom(fieldOf(object, key), most);
}

// Exactly `count` finite numbers.
export function numbersOf(object: Json, key: string, count: number): number[] | undefined {
  const field = arrayOf(object, key);
  if (field === undefined || field.length !== count) return undefined;
  return field.every((value) => numberFrom(value) !== undefined) ? (field as number[]) : undefined;
}
