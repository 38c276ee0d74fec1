import { beforeEach, describe, expect, it, vi } from 'vitest';
import { prepareDecoderInNode } from '../testing/golden';
import { decodeLossless, DecoderFailure } from './lossless-image';

// Mock decoders that can be made to trap, as when they run out of memory.
const decoders = vi.hoisted(() => ({ instances: 0, traps: false }));
vi.mock('@jsquash/webp/codec/dec/webp_dec.js', () => ({
  default: async () => {
    ++decoders.instances;
    return {
      decode: () => {
        if (decoders.traps) throw new WebAssembly.RuntimeError('unreachable');
        return null;
      },
    };
  },
}));

// Returns a WebP header of the given size with almost no data behind it.
function header(width: number, height: number): Uint8Array {
  const file = new Uint8Array(64);
  const view = new DataView(file.buffer);
  [[0, 'RIFF'], [8, 'WEBPVP8L']].forEach(([at, text]) => file.set(new TextEncoder().encode(text as string), at as number));
  view.setUint32(4, file.length - 8, true);
  view.setUint32(16, file.length - 20, true);
  view.setUint8(20, 0x2f);
  view.setUint32(21, (width - 1) | ((height - 1) << 14), true);
  return file;
}

describe('decodeLossless', () => {
  beforeEach(prepareDecoderInNode);

  it('rejects broken images', () => {
    expect(decodeLossless(header(8, 8), 8, 8)).toBeUndefined();
    expect(decodeLossless(header(8, 8), 8, 9)).toBeUndefined();
  });

  it('reports a failure of the decoder, and decodes the next image with a new one', async () => {
    decoders.traps = true;
    const { instances } = decoders;
    expect(() => decodeLossless(header(8, 8), 8, 8)).toThrow(DecoderFailure);
    decoders.traps = false;
    await prepareDecoderInNode();
    expect(decoders.instances).toBe(instances + 1);
    expect(decodeLossless(header(8, 8), 8, 8)).toBeUndefined();
  });
});
