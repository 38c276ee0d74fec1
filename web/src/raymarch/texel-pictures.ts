// Copies the pixels of images to the texels that they encode: docs/tile-format.md, section 6. Pixels have 4 bytes.
import type { Vec3 } from '../tiles/tileset';
import { kAttributes, kStoredEdge, type TexelTextures } from './content';

const kSlicesBeside = 3;
const kTile = kStoredEdge * kSlicesBeside;

// The three images of the same texels, in order: the attributes in red, green and blue. An unused channel must be 0.
const kPictureAttributes: readonly (readonly [number, number, number | undefined])[] = [[1, 2, 3], [4, 5, 6], [0, 7, undefined]];
export const kTexelPictures = kPictureAttributes.length;

export interface PictureSize {
  width: number;
  height: number;
}

export function sizeOfMacroblocks(stored: number): PictureSize {
  const columns = Math.ceil(Math.sqrt(stored));
  return { width: kTile * columns, height: columns === 0 ? 0 : kTile * Math.ceil(stored / columns) };
}

// Returns the size of an image that holds this number of pixels one after another.
export function sizeOfList(pixels: number): PictureSize {
  let width = 256;
  while (Math.ceil(pixels / width) > 16383) width *= 2;
  return { width, height: Math.ceil(pixels / width) };
}

// Copies `edge` × `edge` texels to the corner of a layer. Returns false if an unused byte is not 0.
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

// Copies `stored` macroblocks to the places of an atlas from index `begin` on.
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

// Copies texels one after another, with all attributes of a texel together: [texels][8], from index `begin` on.
export function takeList(pixels: Uint8ClampedArray, which: number, texels: number, attributes: Uint8Array, begin: number): boolean {
  const [r, g, b] = kPictureAttributes[which];
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

// Returns the place of macroblock n in the atlas, in macroblocks.
export function placeInAtlas(n: number, atlas: Vec3): Vec3 {
  return [n % atlas[0], Math.floor(n / atlas[0]) % atlas[1], Math.floor(n / (atlas[0] * atlas[1]))];
}

// Returns the texture and the byte of the texel that hold an attribute.
function locateAttribute(textures: TexelTextures, attribute: number): [Uint8Array, number] {
  if (attribute >= 4) return [textures.second, attribute - 4];
  return [textures.first, attribute === 0 ? 3 : attribute - 1];
}

function takeTexels(
  pixels: Uint8ClampedArray, which: number, textures: TexelTextures,
  visit: (put: (pixel: number, texel: number) => void) => void,
): boolean {
  const [red, green, blue] = kPictureAttributes[which];
  const [reds, r] = locateAttribute(textures, red);
  const [greens, g] = locateAttribute(textures, green);
  const [blues, b] = blue === undefined ? [undefined, 0] : locateAttribute(textures, blue);
  let left = 0; // nonzero if an unused channel is not 0
  visit((pixel, texel) => {
    reds[4 * texel + r] = pixels[4 * pixel];
    greens[4 * texel + g] = pixels[4 * pixel + 1];
    if (blues) blues[4 * texel + b] = pixels[4 * pixel + 2];
    else left |= pixels[4 * pixel + 2];
  });
  return left === 0;
}
