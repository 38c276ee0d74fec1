// Tests that the content readers of all representations share.
import { expect, it } from 'vitest';
import type { MarchedContent, MarchedHeader } from '../raymarch/content';
import { kCodecs, type KnownRepresentation } from '../representations/codecs';
import { SceneError } from '../scene-error';
import type { Content, ContentCodec, DeclaredContent } from '../tiles/content-codec';
import { kContentLimits } from '../tiles/content-limits';
import { decodeTileset } from '../tiles/decode-tileset';
import { goldenFile, goldenText } from './golden';

type MarchedCodec = ContentCodec<MarchedHeader, MarchedContent>;
// The representations whose contents are drawn by ray marching.
type MarchedRepresentation = {
  [R in KnownRepresentation]: (typeof kCodecs)[R] extends MarchedCodec ? R : never;
}[KnownRepresentation];

function getCodec(representation: MarchedRepresentation): MarchedCodec {
  return kCodecs[representation];
}

export function decodeGolden(representation: MarchedRepresentation, file: Uint8Array, limits = kContentLimits): MarchedContent {
  return decodeAny(representation, file, limits) as MarchedContent;
}

export function decodeAny(representation: KnownRepresentation, file: Uint8Array, limits = kContentLimits): Content {
  const codec: ContentCodec = kCodecs[representation];
  return codec.decode(codec.readHeader(file, 'a.glb', undefined, limits), 'a.glb', []);
}

// Computes the checksums in the form of the golden scenes' sums.
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

// Tests the contents of the golden scene of a representation; `small` lists those that are fast to test.
export function testContentReader(representation: KnownRepresentation, uris: string[], small = uris): void {
  const codec: ContentCodec = kCodecs[representation];

  it('knows the size of textures before it decodes them', () => {
    for (const uri of uris) {
      const parsedHeader = codec.readHeader(goldenFile(uri, representation), 'a');
      const bytes = codec.listBuffers(codec.decode(parsedHeader, uri, [])).reduce((sum, buffer) => sum + buffer.byteLength, 0);
      expect(parsedHeader.memoryBytes).toBe(bytes);
    }
  });

  it('rejects a content of another representation', () => {
    for (const other of Object.keys(kCodecs) as KnownRepresentation[]) {
      const read = () => kCodecs[other].readHeader(goldenFile(uris[0], representation), 'a');
      if (other !== representation) expect(read).toThrow(`representation ${other}`);
    }
  });

  it('rejects every truncated file', () => {
    const file = goldenFile(small[0], representation);
    for (let length = 0; length < file.length; length += 97) {
      expect(() => decodeAny(representation, file.subarray(0, length))).toThrow(SceneError);
    }
  });

  it('either decodes a mutated file or names what is wrong', () => {
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
        // Half of the mutations are in the JSON, which contains all the numbers.
        const at = random(2) === 0 ? 20 + random(json) : random(file.length);
        file[at] = random(2) === 0 ? 48 + random(10) : random(256);
      }
      try {
        decodeAny(representation, file);
      } catch (error) {
        expect(error).toBeInstanceOf(SceneError);
        ++refused;
      }
    }
    expect(refused).toBeGreaterThan(300);
  }, 60000);
}

// Tests what readers of ray-marched contents check besides.
export function testMarchedReader(representation: MarchedRepresentation, uris: string[]): void {
  const codec = getCodec(representation);
  const header = (file: Uint8Array, limits = kContentLimits, declared?: DeclaredContent) => codec.readHeader(file, 'a', declared, limits);

  it("rejects contents that exceed the memory limit or a texture's size", () => {
    const file = goldenFile(uris[0], representation);
    const { memoryBytes: bytes } = header(file);
    expect(() => header(file, { ...kContentLimits, bytes: bytes - 1 })).toThrow('bytes of memory');
    expect(() => header(file, { ...kContentLimits, layers: 0 })).toThrow('in one texture');
    expect(() => header(file, { ...kContentLimits, edge3D: 8 })).toThrow('in one texture');
    expect(() => header(file, { ...kContentLimits, uniformBytes: 16 })).toThrow('than this GPU takes');
  });

  it('rejects a content that differs from what tileset.json declares', () => {
    const tileset = decodeTileset(goldenText('tileset.json', representation), 'tileset.json', kCodecs);
    const contents = tileset.tiles.flatMap((tile) => tile.contents);
    for (const declared of contents) {
      const file = goldenFile(declared.uri, representation);
      expect(() => header(file, kContentLimits, declared)).not.toThrow();
      expect(() => header(file, kContentLimits, { ...declared, backgroundBlock: !declared.backgroundBlock })).toThrow('background block');
      const small = { low: declared.box.low, high: declared.box.low };
      expect(() => header(file, kContentLimits, { ...declared, box: small })).toThrow('owns what lies outside');
    }
  });
}

// Returns the place in the atlas of each stored macroblock, in the order of their indices.
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
