// Lossless WebP without alpha, from outside. Decoded by libwebp compiled to WebAssembly, not by the browser: a picture
// drawn on a canvas and read back is altered by browsers that resist fingerprinting, and Node has no canvas.
import createDecoder, { type WebPModule } from '@jsquash/webp/codec/dec/webp_dec.js';

let module: WebPModule | undefined;

// It has no word for memory that ran out but to trap.
export class DecoderFailure extends Error {}

// Must have been awaited once before decodeLossless. `wasm`: the compiled decoder (its file is found beside the module
// where none is given, in browsers).
export async function prepareDecoder(wasm?: WebAssembly.Module): Promise<void> {
  module ??= await makeDecoder(wasm);
}

export function isDecoderPrepared(): boolean {
  return module !== undefined;
}

async function makeDecoder(wasm?: WebAssembly.Module): Promise<WebPModule> {
  // The decoder hands its pixels over in one of these, which Node lacks.
  const scope = globalThis as { ImageData?: unknown };
  scope.ImageData ??= class {
    constructor(
      readonly data: Uint8ClampedArray,
      readonly width: number,
      readonly height: number,
    ) {}
  };
  return createDecoder({
    noInitialRun: true,
    ...(wasm && {
      instantiateWasm(imports: WebAssembly.Imports, done: (instance: WebAssembly.Instance) => void) {
        const instance = new WebAssembly.Instance(wasm, imports);
        done(instance);
        return instance.exports;
      },
    }),
  });
}

const kRiff = 0x46464952; // "RIFF"
const kWebP = 0x50424557; // "WEBP"
const kExtended = 0x58385056; // "VP8X"
const kLossy = 0x20385056; // "VP8 "
const kLossless = 0x4c385056; // "VP8L"
const kAlphaOrAnimation = 0x12;
const kSignature = 0x2f;

// What the header of a still lossless picture without alpha says: undefined for all others.
export function losslessSize(file: Uint8Array): { width: number; height: number } | undefined {
  if (file.length < 25) return undefined;
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  if (view.getUint32(0, true) !== kRiff || view.getUint32(8, true) !== kWebP) return undefined;
  const end = Math.min(file.length, view.getUint32(4, true) + 8);
  for (let at = 12; at + 13 <= end;) {
    const type = view.getUint32(at, true);
    const length = view.getUint32(at + 4, true);
    // Decoders take the first picture; only an extended header may stand before it, and what comes with that.
    if (type === kLossy || (at === 12 && type !== kLossless && type !== kExtended)) return undefined;
    if (type === kLossless) {
      if (length < 5 || length > end - at - 8 || view.getUint8(at + 8) !== kSignature) return undefined;
      const bits = view.getUint32(at + 9, true); // 14 width - 1, 14 height - 1, alpha, 3 version
      if (bits >>> 28 !== 0) return undefined;
      return { width: (bits & 0x3fff) + 1, height: ((bits >>> 14) & 0x3fff) + 1 };
    }
    if (type === kExtended && (view.getUint8(at + 8) & kAlphaOrAnimation) !== 0) return undefined;
    at += 8 + length + (length & 1);
  }
  return undefined;
}

// Pixels of 4 bytes, the fourth 255, row after row; undefined where the file is no such picture of exactly this size,
// which is seen before pixels are allocated. Throws DecoderFailure where the decoder itself gives up, and must then be
// prepared again.
export function decodeLossless(file: Uint8Array, width: number, height: number): Uint8ClampedArray | undefined {
  if (module === undefined) throw new Error('prepareDecoder has not been awaited');
  const size = losslessSize(file);
  if (size?.width !== width || size.height !== height) return undefined;
  try {
    const picture = module.decode(file as Uint8Array<ArrayBuffer>);
    return picture?.width === width && picture.height === height ? picture.data : undefined;
  } catch {
    module = undefined; // whose memory may be in any state
    throw new DecoderFailure();
  }
}
