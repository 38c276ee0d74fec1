// What the readers of every representation's contents are tested for alike.
import { expect, it } from 'vitest';
import type { MarchedContent, MarchedHeader } from '../raymarch/content';
import { kCodecs, type KnownRepresentation } from '../representations/codecs';
import { SceneError } from '../scene-error';
import type { ContentCodec, PromisedContent } from '../tiles/content-codec';
import { kContentLimits } from '../tiles/content-limits';
import { decodeTileset } from '../tiles/decode-tileset';
import { goldenFile, goldenText } from './golden';

type MarchedCodec = ContentCodec<MarchedHeader, MarchedContent>;
// Those of the representations whose contents rays are marched through.
type MarchedRepresentation = {
  [R in KnownRepresentation]: (typeof kCodecs)[R] extends MarchedCodec ? R : never;
}[KnownRepresentation];

function codecOf(representation: MarchedRepresentation): MarchedCodec {
  return kCodecs[representation];
}

export function decodeGolden(representation: MarchedRepresentation, file: Uint8Array, limits = kContentLimits): MarchedContent {
  const codec = codecOf(representation);
  return codec.decode(codec.readHeader(file, 'a.glb', undefined, limits), 'a.glb', []);
}

// Bytes as the golden scenes' sums have them.
export class Sum {
  plain = 0;
  ordered = 0;
  private next = 0;
  add(bytes: Iterable<number>): void {
    for (const byte of bytes) {
      this.plain += byte;
      this.ordered += ((this.next++ % 251) + 1) * byte;
    }
  }
}

// Of the contents of the golden scene of that representation; `small`: those that do not take long.
export function testContentReader(representation: MarchedRepresentation, uris: string[], small = uris): void {
  const codec = codecOf(representation);
  const header = (file: Uint8Array, limits = kContentLimits, promised?: PromisedContent) => codec.readHeader(file, 'a', promised, limits);

  it('knows what textures will take before it decodes them', () => {
    for (const uri of uris) {
      const found = header(goldenFile(uri, representation));
      const bytes = codec.buffersOf(codec.decode(found, uri, [])).reduce((sum, buffer) => sum + buffer.byteLength, 0);
      expect(found.memoryBytes).toBe(bytes);
    }
  });

  it('refuses what would take more memory than allowed, or more than a texture holds', () => {
    const file = goldenFile(uris[0], representation);
    const { memoryBytes: bytes } = header(file);
    expect(() => header(file, { ...kContentLimits, bytes: bytes - 1 })).toThrow('bytes of memory');
    expect(() => header(file, { ...kContentLimits, layers: 0 })).toThrow('in one texture');
    expect(() => header(file, { ...kContentLimits, edge3D: 8 })).toThrow('in one texture');
    expect(() => header(file, { ...kContentLimits, uniformBytes: 16 })).toThrow('than this graphics card takes');
  });

  it('refuses a content that is not the one that tileset.json speaks of', () => {
    const tileset = decodeTileset(goldenText('tileset.json', representation), 'tileset.json', kCodecs);
    const contents = tileset.tiles.flatMap((tile) => tile.contents);
    for (const promised of contents) {
      const file = goldenFile(promised.uri, representation);
      expect(() => header(file, kContentLimits, promised)).not.toThrow();
      expect(() => header(file, kContentLimits, { ...promised, surround: !promised.surround })).toThrow('surround');
      const small = { low: promised.box.low, high: promised.box.low };
      expect(() => header(file, kContentLimits, { ...promised, box: small })).toThrow('owns what lies outside');
    }
  });

  it('refuses a content of another representation', () => {
    for (const other of Object.keys(kCodecs) as KnownRepresentation[]) {
      const read = () => kCodecs[other].readHeader(goldenFile(uris[0], representation), 'a');
      if (other !== representation) expect(read).toThrow(`representation ${other}`);
    }
  });

  it('refuses every file that is cut off', () => {
    const file = goldenFile(small[0], representation);
    for (let length = 0; length < file.length; length += 97) {
      expect(() => decodeGolden(representation, file.subarray(0, length))).toThrow(SceneError);
    }
  });

  it('decodes mutated files or names what is wrong, and nothing else happens', () => {
    let seed = 1;
    const random = (below: number) => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return Math.floor((seed / 2 ** 32) * below);
    };
    let refused = 0;
    for (let round = 0; round < 800; ++round) {
      const file = goldenFile(small[round % small.length], representation);
      const json = new DataView(file.buffer).getUint32(12, true);
      for (let i = 0; i <= random(4); ++i) {
        // Half of them in the JSON, where all the numbers stand.
        const at = random(2) === 0 ? 20 + random(json) : random(file.length);
        file[at] = random(2) === 0 ? 48 + random(10) : random(256);
      }
      try {
        decodeGolden(representation, file);
      } catch (error) {
        expect(error).toBeInstanceOf(SceneError);
        ++refused;
      }
    }
    expect(refused).toBeGreaterThan(300);
  }, 60000);
}

// Of each macroblock that is stored, in the order of their numbers, its place in the atlas.
export function storedIn({ macroblocks }: MarchedContent, n: number, edge: number): { number: number; place: [number, number, number] }[] {
  const [mx, my, mz] = macroblocks.origins[n];
  const { size, texels } = macroblocks;
  const stored: ReturnType<typeof storedIn> = [];
  for (let number = 0; number < edge ** 3; ++number) {
    const x = mx + (number % edge);
    const y = my + (Math.floor(number / edge) % edge);
    const z = mz + Math.floor(number / edge ** 2);
    const at = 4 * (x + size[0] * (y + size[1] * z));
    if (texels[at + 3]) stored.push({ number, place: [texels[at], texels[at + 1], texels[at + 2]] });
  }
  return stored;
}
