import { beforeEach, describe, expect, it, vi } from 'vitest';
import { prepareDecoderInNode } from '../testing/golden';
import { decodeLossless, DecoderFailure } from './lossless-image';

// Decoders of which one traps, as at the end of memory.
const decoders = vi.hoisted(() => ({ made: 0, traps: false }));
vi.mock('@jsquash/webp/codec/dec/webp_dec.js', () => ({
  default: async () => {
    ++decoders.made;
    return {
      decode: () => {
        if (decoders.traps) throw new WebAssembly.RuntimeError('unreachable');
        return null;
      },
    };
  },
}));

// A picture whose header says that it is so large, with little behind it.
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

  it('takes nothing that is broken', () => {
    expect(decodeLossless(header(8, 8), 8, 8)).toBeUndefined();
    expect(decodeLossless(header(8, 8), 8, 9)).toBeUndefined();
  });

  it('says that the decoder gave up, and takes the next picture with another one', async () => {
    decoders.traps = true;
    const { made } = decoders;
    expect(() => decodeLossless(header(8, 8), 8, 8)).toThrow(DecoderFailure);
    decoders.traps = false;
    await prepareDecoderInNode();
    expect(decoders.made).toBe(made + 1);
    expect(decodeLossless(header(8, 8), 8, 8)).toBeUndefined();
  });
});
