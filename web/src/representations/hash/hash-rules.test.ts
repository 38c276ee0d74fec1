import { describe, expect, it } from 'vitest';
import { goldenFile, goldenText } from '../../testing/golden';
import { readHashHeader } from './decode-hash';

const kUri = Object.keys(JSON.parse(goldenText('sums.json', 'hash')) as object).find((uri) => uri.includes('/0_0-'))!;

// Returns the file with the JSON of its extension changed and everything else unchanged.
function changed(change: (ours: any) => void): Uint8Array {
  const file = Buffer.from(goldenFile(kUri, 'hash'));
  const length = file.readUInt32LE(12);
  const json = JSON.parse(file.toString('utf8', 20, 20 + length)) as any;
  change(json.extensions.TESSERA_content);
  let text = JSON.stringify(json);
  while (Buffer.byteLength(text) % 4 !== 0) text += ' ';
  const head = Buffer.from(file.subarray(0, 20));
  head.writeUInt32LE(file.length - length + text.length, 8);
  head.writeUInt32LE(text.length, 12);
  return new Uint8Array(Buffer.concat([head, Buffer.from(text), file.subarray(20 + length)]));
}

const kHeader = 'part 0: its header is not complete';
const kUnsaid = 'weights, step or learned_background is missing or malformed';
const kRules: [string, (ours: any) => void][] = [
  [kUnsaid, (ours) => (ours.weights = 'some')],
  [kUnsaid, (ours) => delete ours.learned_background],
  ['the key whole is called learned_background now', (ours) => (ours.whole = true)],
  [kUnsaid, (ours) => (ours.step = '1')],
  ['the step is out of bounds', (ours) => (ours.step = 1e-9)],
  ['the step is out of bounds', (ours) => (ours.step = 0.2)],
  ['its logits are not a list, or their number is out of bounds', (ours) => (ours.logits = [])],
  ['its logits are not a list, or their number is out of bounds', (ours) => (ours.logits = new Array(17).fill(0))],
  ['a logit is not a number', (ours) => (ours.logits = ['a'])],
  // Weights that are the same everywhere need no columns.
  [kHeader, (ours) => (ours.logits = [1, 2, 3, 4])],
  ['its logits are not those of its tables', (ours) => Object.assign(ours, { logits: [1, 2, 3] }, ours.parts[0].ranges.splice(8))],
  ['a logit is out of bounds', (ours) => Object.assign(ours, { logits: [1, 2, 3, 2e6] }, ours.parts[0].ranges.splice(8))],
  ['its logits are not those of its tables', ({ parts: [part] }) => part.tables.push(part.tables[1], part.tables[1], part.tables[1])],
  ["the network's layers do not follow", ({ network }) => network.layers.reverse()],
  [kHeader, ({ parts: [part] }) => (part.lattice = 2048)],
  [kHeader, ({ parts: [part] }) => (part.cells = 1024)],
  [kHeader, ({ parts: [part] }) => (part.cells = 136)], // lacks the number of near cells
  [kHeader, ({ parts: [part] }) => Object.assign(part, { cells: 136, nearCells: 68 ** 3 + 1 })],
  [kHeader, ({ parts: [part] }) => part.ranges.pop()],
  [kHeader, ({ parts: [part] }) => (part.ranges[3] = [1])],
  [kHeader, ({ parts: [part] }) => (part.tables = [])],
  [kHeader, ({ parts: [part] }) => (part.tables = new Array(9).fill(part.tables[1]))],
  [kHeader, ({ parts: [part] }) => (part.tables[1].entries = 2 ** 25)],
  [kHeader, ({ parts: [part] }) => (part.tables[1].resolution = 2 ** 17)],
  [kHeader, ({ parts: [part] }) => (part.tables[1].hashed = 1)],
  ['part 0: its lattice is out of bounds', ({ parts: [part] }) => (part.lattice = 12)],
  ['part 0: a range is out of bounds', ({ parts: [part] }) => (part.ranges[3] = [1, 0])],
  ['part 0: a range is out of bounds', ({ parts: [part] }) => (part.tables[1].ranges[3] = [0, 1e7])],
  ['part 0: it stores more macroblocks', ({ parts: [part] }) => (part.lattice = 8)],
  ['part 0: the resolution of a table', ({ parts: [part] }) => (part.tables[1].resolution = 1)],
  ['part 0: a table has no entries', ({ parts: [part] }) => (part.tables[1].entries = 0)],
  ['part 0: the entries of a hashed table are not a power of two', ({ parts: [part] }) => (part.tables[1].entries = 1000)],
  ['part 0: a table that is not hashed has fewer entries than points', ({ parts: [part] }) => (part.tables[0].resolution = 13)],
  ['part 0: its occupancy is out of bounds', ({ parts: [part] }) => (part.cells = 12)],
  ['part 1: parts differ in their number of tables', ({ parts }) => {
    const [first] = parts as any[];
    parts.push({ ...first, tables: first.tables.slice(1), low: first.low.map((x: number) => x + 100), high: first.high.map((x: number) => x + 100), contracted: true });
    first.contracted = true;
  }],
];

describe('a hash content', () => {
  it('is read if it is valid', () => {
    expect(readHashHeader(changed(() => {}), 'a').parts.length).toBe(1);
  });

  it.each(kRules.map(([rule, change], n) => [`${n}: ${rule}`, rule, change] as const))('is rejected with a reason: %s', (_, rule, change) => {
    expect(() => readHashHeader(changed(change), 'a')).toThrow(`a: ${rule}`);
  });
});
