// Readers of fields of untrusted JSON: each returns undefined if the field is missing, has another type, or is not a
// finite number.

export type Json = unknown;

export function getField(object: Json, key: string): Json {
  if (typeof object !== 'object' || object === null || Array.isArray(object)) return undefined;
  return Object.hasOwn(object, key) ? (object as Record<string, Json>)[key] : undefined;
}

export function getArray(object: Json, key: string): Json[] | undefined {
  const field = getField(object, key);
  return Array.isArray(field) ? field : undefined;
}

export function getString(object: Json, key: string): string | undefined {
  const field = getField(object, key);
  return typeof field === 'string' ? field : undefined;
}

export function getBoolean(object: Json, key: string): boolean | undefined {
  const field = getField(object, key);
  return typeof field === 'boolean' ? field : undefined;
}

export function numberFrom(value: Json): number | undefined {
  return typeof value === 'number' && Number.isFinite(value) ? value : undefined;
}

export function getNumber(object: Json, key: string): number | undefined {
  return numberFrom(getField(object, key));
}

// Returns an integer from 0 to `maximum`.
export function wholeFrom(value: Json, maximum = 0xffffffff): number | undefined {
  return typeof value === 'number' && Number.isInteger(value) && value >= 0 && value <= maximum ? value : undefined;
}

export function getInteger(object: Json, key: string, maximum?: number): number | undefined {
  return wholeFrom(getField(object, key), maximum);
}

// Returns exactly `count` finite numbers.
export function getNumbers(object: Json, key: string, count: number): number[] | undefined {
  const field = getArray(object, key);
  if (field === undefined || field.length !== count) return undefined;
  return field.every((value) => numberFrom(value) !== undefined) ? (field as number[]) : undefined;
}
