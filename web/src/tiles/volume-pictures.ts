// Where the texels of pictures go: docs/tile-format.md, section 6. Pixels have 4 bytes.
import type { Vec3 } from './tileset';
import { kStoredEdge, type TexelTextures } from './volume-content';

const kSlicesBeside = 3;
const kTile = kStoredEdge * kSlicesBeside;

// The three pictures of the same texels, in order: which byte of which texture red, green and blue become. What has no
// place must be 0.
const kPlaces: readonly (readonly (readonly ['first' | 'second', number] | undefined)[])[] = [
  [['first', 0], ['first', 1], ['first', 2]],
  [['second', 0], ['second', 1], ['second', 2]],
  [['first', 3], ['second', 3], undefined],
];
export const kTexelPictures = kPlaces.length;

export function sizeOfMacroblocks(stored: number): { width: number; height: number } {
  const columns = Math.ceil(Math.sqrt(stored));
  return { width: kTile * columns, height: columns === 0 ? 0 : kTile * Math.ceil(stored / columns) };
}

// `edge` texels along both sides, into the corner of a layer. False where a byte that means nothing is not 0.
export function takePlane(
  pixels: Uint8ClampedArray, which: number, edge: number, textures: TexelTextures, layer: number,
): boolean {
  const [width, height] = textures.size;
  return takeTexels(pixels, which, textures, (put) => {
    for (let y = 0; y < edge; ++y) {
      const row = width * (y + height * layer);
      for (let x = 0; x < edge; ++x) put(y * edge + x, row + x);
    }
  });
}

// `stored` macroblocks, into the places of an atlas from number `begin` on.
export function takeMacroblocks(
  pixels: Uint8ClampedArray, which: number, stored: number, textures: TexelTextures, atlas: Vec3, begin: number,
): boolean {
  const columns = Math.ceil(Math.sqrt(stored));
  const pictureWidth = kTile * columns;
  const [width, height] = textures.size;
  return takeTexels(pixels, which, textures, (put) => {
    for (let block = 0; block < stored; ++block) {
      const [x0, y0, z0] = placeInAtlas(begin + block, atlas);
      for (let z = 0; z < kStoredEdge; ++z) {
        const left = (block % columns) * kTile + (z % kSlicesBeside) * kStoredEdge;
        const top = Math.floor(block / columns) * kTile + Math.floor(z / kSlicesBeside) * kStoredEdge;
        for (let y = 0; y < kStoredEdge; ++y) {
          const from = (top + y) * pictureWidth + left;
          const to = kStoredEdge * x0 + width * (kStoredEdge * y0 + y + height * (kStoredEdge * z0 + z));
          for (let x = 0; x < kStoredEdge; ++x) put(from + x, to + x);
        }
      }
    }
  });
}

// Of macroblock number n, in macroblocks.
export function placeInAtlas(n: number, atlas: Vec3): Vec3 {
  return [n % atlas[0], Math.floor(n / atlas[0]) % atlas[1], Math.floor(n / (atlas[0] * atlas[1]))];
}

function takeTexels(
  pixels: Uint8ClampedArray, which: number, textures: TexelTextures,
  visit: (put: (pixel: number, texel: number) => void) => void,
): boolean {
  const [red, green, blue] = kPlaces[which];
  const bytesOf = (place: typeof red) => (place ? textures[place[0]] : undefined);
  const reds = bytesOf(red)!;
  const greens = bytesOf(green)!;
  const blues = bytesOf(blue);
  const [r, g, b] = [red![1], green![1], blue?.[1] ?? 0];
  let left = 0; // what stands where nothing may
  visit((pixel, texel) => {
    reds[4 * texel + r] = pixels[4 * pixel];
    greens[4 * texel + g] = pixels[4 * pixel + 1];
    if (blues) blues[4 * texel + b] = pixels[4 * pixel + 2];
    else left |= pixels[4 * pixel + 2];
  });
  return left === 0;
}
