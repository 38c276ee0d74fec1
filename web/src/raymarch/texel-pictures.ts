// Where the texels of pictures go: docs/tile-format.md, section 6. Pixels have 4 bytes.
import type { Vec3 } from '../tiles/tileset';
import { kAttributes, kStoredEdge, type TexelTextures } from './content';

const kSlicesBeside = 3;
const kTile = kStoredEdge * kSlicesBeside;

// The three pictures of the same texels, in order: the attributes that red, green and blue are. What is none must be 0.
const kAttributesOf: readonly (readonly [number, number, number | undefined])[] = [[1, 2, 3], [4, 5, 6], [0, 7, undefined]];
export const kTexelPictures = kAttributesOf.length;

export interface PictureSize {
  width: number;
  height: number;
}

export function sizeOfMacroblocks(stored: number): PictureSize {
  const columns = Math.ceil(Math.sqrt(stored));
  return { width: kTile * columns, height: columns === 0 ? 0 : kTile * Math.ceil(stored / columns) };
}

// Of so many pixels one after another.
export function sizeOfList(pixels: number): PictureSize {
  let width = 256;
  while (Math.ceil(pixels / width) > 16383) width *= 2;
  return { width, height: Math.ceil(pixels / width) };
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

// Texels one after another, all attributes of one together: [texels][8], from number `begin` on.
export function takeList(pixels: Uint8ClampedArray, which: number, texels: number, attributes: Uint8Array, begin: number): boolean {
  const [r, g, b] = kAttributesOf[which];
  for (let n = 0; n < texels; ++n) {
    const at = kAttributes * (begin + n);
    attributes[at + r] = pixels[4 * n];
    attributes[at + g] = pixels[4 * n + 1];
    if (b !== undefined) attributes[at + b] = pixels[4 * n + 2];
    else if (pixels[4 * n + 2] !== 0) return false;
  }
  for (let at = 4 * texels; at < pixels.length; at += 4) {
    if (pixels[at] !== 0 || pixels[at + 1] !== 0 || pixels[at + 2] !== 0) return false;
  }
  return true;
}

// Of macroblock number n, in macroblocks.
export function placeInAtlas(n: number, atlas: Vec3): Vec3 {
  return [n % atlas[0], Math.floor(n / atlas[0]) % atlas[1], Math.floor(n / (atlas[0] * atlas[1]))];
}

// Which byte of which texture an attribute is.
function placeOf(textures: TexelTextures, attribute: number): [Uint8Array, number] {
  if (attribute >= 4) return [textures.second, attribute - 4];
  return [textures.first, attribute === 0 ? 3 : attribute - 1];
}

function takeTexels(
  pixels: Uint8ClampedArray, which: number, textures: TexelTextures,
  visit: (put: (pixel: number, texel: number) => void) => void,
): boolean {
  const [red, green, blue] = kAttributesOf[which];
  const [reds, r] = placeOf(textures, red);
  const [greens, g] = placeOf(textures, green);
  const [blues, b] = blue === undefined ? [undefined, 0] : placeOf(textures, blue);
  let left = 0; // what stands where nothing may
  visit((pixel, texel) => {
    reds[4 * texel + r] = pixels[4 * pixel];
    greens[4 * texel + g] = pixels[4 * pixel + 1];
    if (blues) blues[4 * texel + b] = pixels[4 * pixel + 2];
    else left |= pixels[4 * pixel + 2];
  });
  return left === 0;
}
