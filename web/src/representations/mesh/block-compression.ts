// BC4 (unsigned), the block compression of one channel: 4×4 texels of 8 bits in 8 bytes. BC5 is two such blocks.
// Source: Khronos Data Format Specification 1.3, section 19; src/tiles/bc4.h.

export const kBc4Bytes = 8; // of a block
export const kBc5Bytes = 16;

const palette = new Uint8Array(8);

// Decodes the block that begins at `at` to bytes, `stride` bytes apart in a row and `rowStride` apart in a column.
function decodeBlock(blocks: Uint8Array, at: number, texels: Uint8Array, to: number, stride: number, rowStride: number): void {
  const e0 = blocks[at];
  const e1 = blocks[at + 1];
  palette[0] = e0;
  palette[1] = e1;
  const steps = e0 > e1 ? 7 : 5;
  for (let k = 1; k < steps; ++k) palette[1 + k] = ((steps - k) * e0 + k * e1) / steps + 0.5;
  if (steps === 5) {
    palette[6] = 0;
    palette[7] = 255;
  }
  for (let half = 0; half < 2; ++half) {
    // Three bytes hold eight indices.
    const first = at + 2 + 3 * half;
    let indices = blocks[first] | (blocks[first + 1] << 8) | (blocks[first + 2] << 16);
    for (let texel = 0; texel < 8; ++texel, indices >>= 3) {
      texels[to + rowStride * (2 * half + (texel >> 2)) + stride * (texel & 3)] = palette[indices & 7];
    }
  }
}

// Decodes a texture of `width` × `height` texels, both multiples of 4, with `channels` BC4 blocks after one another, to
// the bytes `first`, `first` + 1 … of texels of `stride` bytes.
export function decodeTexture(
  blocks: Uint8Array, width: number, height: number, channels: number, texels: Uint8Array, first: number, stride: number,
): void {
  const across = width / 4;
  for (let block = 0; block < across * (height / 4); ++block) {
    const to = stride * (4 * (block % across) + 4 * width * Math.floor(block / across));
    for (let channel = 0; channel < channels; ++channel) {
      decodeBlock(blocks, kBc4Bytes * (channels * block + channel), texels, to + first + channel, stride, stride * width);
    }
  }
}
