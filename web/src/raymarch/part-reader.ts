// The common part of the readers of ray-marched contents. The bytes are untrusted. docs/tile-format.md, sections 6, 7
// and 11.
import { ContentReader } from '../tiles/content-reader';
import { getArray, getField, getBoolean, getNumbers, getInteger, type Json } from '../tiles/json-fields';
import type { Vec3 } from '../tiles/tileset';
import { kMacroblock, putCube, type ContentPart, type Cubes, type TexelTextures } from './content';
import { kMaxStored } from './content-rules';
import { isSet, takeBits, type OccupancyBits } from './occupancy';
import { kTexelPictures, placeInAtlas, sizeOfList, sizeOfMacroblocks, takeMacroblocks, type PictureSize } from './texel-pictures';

export class PartReader extends ContentReader {
  // Returns the JSON of the parts, unless there are too many.
  protected readPartSources(ours: Json): Json[] {
    const sources = getArray(ours, 'parts') ?? [];
    if (sources.length < 1 || sources.length > this.limits.parts) this.fail('has no parts, or too many');
    return sources;
  }

  // Returns undefined if a field is missing.
  protected readPlace(source: Json): ContentPart | undefined {
    const triple = (key: string) => getNumbers(source, key, 3)?.map(Math.fround) as Vec3 | undefined;
    const fields = {
      centre: triple('centre'), scale: triple('scale'), low: triple('low'), high: triple('high'),
      contracted: getBoolean(source, 'contracted'), backgroundBlock: getBoolean(source, 'background_block'),
      stored: getInteger(getField(source, 'macroblocks'), 'stored', kMaxStored),
    };
    return Object.values(fields).includes(undefined) ? undefined : (fields as ContentPart);
  }

  // Returns the layout if the GPU supports it and the vectors for its shaders.
  protected laidOut<Layout extends { bytes: number }>(layout: Layout | undefined, uniformBytes: number): Layout {
    if (uniformBytes > this.limits.uniformBytes) {
      this.refuse('has more parts, or a larger network, than this GPU takes', 'draw it on another machine');
    }
    if (!layout) {
      this.refuse('is more than this GPU takes in one texture', 'draw a coarser level, or bake smaller blocks');
    }
    if (layout.bytes > this.limits.bytes) this.refuse(`takes more than ${this.limits.bytes} bytes of memory`, 'bake smaller blocks');
    return layout;
  }

  // Reads the macroblocks of part n, with `texels` along an axis, which are those of the atlas from index `begin` on:
  // first their places, then for each three images their texels, into one of `textures`.
  protected readMacroblocks(
    views: Uint8Array[], source: Json, texels: number, stored: number, atlas: Vec3, begin: number,
    macroblocks: Cubes<Uint8Array>, n: number, textures: TexelTextures[],
  ): boolean {
    const ours = getField(source, 'macroblocks');
    const alive = this.readBits(views, getField(ours, 'alive'), texels / kMacroblock);
    if (!alive) return false;
    const places = new Uint8Array(4 * alive.edge ** 3);
    let number = 0;
    for (let cell = 0; cell < alive.edge ** 3; ++cell) {
      if (isSet(alive, cell)) places.set([...placeInAtlas(begin + number++, atlas), 1], 4 * cell);
    }
    if (number !== stored) return false;
    putCube(places, alive.edge, macroblocks, n, 4);
    if (stored === 0) return true;
    const pictures = getArray(ours, 'texels');
    return pictures?.length === textures.length * kTexelPictures && textures.every((taken, e) =>
      this.takePictures(views, pictures.slice(e * kTexelPictures, (e + 1) * kTexelPictures), sizeOfMacroblocks(stored),
        (pixels, which) => takeMacroblocks(pixels, which, stored, taken, atlas, begin)));
  }

  // Reads three images of texels.
  protected takePictures(
    views: Uint8Array[], sources: Json, size: PictureSize, take: (pixels: Uint8ClampedArray, which: number) => boolean,
  ): boolean {
    if (!Array.isArray(sources) || sources.length !== kTexelPictures) return false;
    return sources.every((source, which) => {
      const pixels = this.readPicture(views, source, size);
      return pixels !== undefined && take(pixels, which);
    });
  }

  protected readBits(views: Uint8Array[], source: Json, edge: number): OccupancyBits | undefined {
    const pixels = this.readPicture(views, source, sizeOfList(Math.ceil(edge ** 3 / 8)));
    return pixels && takeBits(pixels, edge);
  }
}
