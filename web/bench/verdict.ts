// Prints the verdict of a browser measurement, like bench/setup.sh.
import { expect } from 'vitest';

export const needed = (name: string) => process.env[name] ?? expect.fail(`${name} is missing`);

export function verdict(what: string, value: number, how: '>=' | '<=', bound: number): void {
  const holds = how === '>=' ? value >= bound : value <= bound;
  console.log(`${what}: ${Number(value.toPrecision(5))} (wanted ${how} ${bound}) ${holds ? 'ok' : 'FAILED'}`);
  expect.soft(holds, what).toBe(true);
}
