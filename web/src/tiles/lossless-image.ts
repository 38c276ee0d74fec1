// Decodes untrusted lossless WebP without alpha. It uses libwebp compiled to WebAssembly rather than the browser's
// decoder: an image that is drawn on a canvas and read back is altered by browsers that resist fingerprinting, and Node
// has no canvas.
import createDecoder, { type WebPModule } from '@jsquash/webp/codec/dec/webp_dec.js';

let module: WebPModule | undefined;

// Thrown when the decoder traps, which is how it reports that memory ran out.
export class DecoderFailure extends Error {}

// Must be awaited once before decodeLossless is called. `wasm` is the compiled decoder; if omitted, its file is located
// beside the module (in browsers).
export async function prepareDecoder(wasm?: WebAssembly.Module): Promise<void> {
  module ??= await makeDecoder(wasm);
}

export function isDecoderPrepared(): boolean {
  return module !== undefined;
}

async function makeDecoder(wasm?: WebAssembly.Module): Promise<WebPModule> {
  // The decoder returns its pixels as an ImageData, which Node lacks.
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

// Returns the size that the header of a still lossless image without alpha declares, and undefined for all others.
export function losslessSize(file: Uint8Array): { width: number; height: number } | undefined {
  if (file.length < 25) return undefined;
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  if (view.getUint32(0, true) !== kRiff || view.getUint32(8, true) !== kWebP) return undefined;
  const end = Math.min(file.length, view.getUint32(4, true) + 8);
  for (let at = 12; at + 13 <= end;) {
    const type = view.getUint32(at, true);
    const length = view.getUint32(at + 4, true);
    // Decoders take the first image; only an extended header and the chunks that belong to it may precede it.
    if (type === kLossy || (at === 12 && type !== kLossless && type !== kExtended)) return undefined;
    if (type === kLossless) {
      if (length < 5 || length > end - at - 8 || view.getUint8(at + 8) !== kSignature) return undefined;
      const bits = view.getUint32(at + 9, true); // 14 bits width - 1, 14 bits height - 1, 1 bit alpha, 3 bits version
      if (bits >>> 28 !== 0) return undefined;
      return { width: (bits & 0x3fff) + 1, height: ((bits >>> 14) & 0x3fff) + 1 };
    }
    if (type === kExtended && (view.getUint8(at + 8) & kAlphaOrAnimation) !== 0) return undefined;
    at += 8 + length + (length & 1);
  }
  return undefined;
}

// Returns RGBA pixels with alpha 255, row after row, or undefined if the file is not a valid image of exactly this
// size, which is checked before pixels are allocated. Throws DecoderFailure if the decoder itself fails; it must then
// be prepared again.
export function decodeLossless(file: Uint8Array, width: number, height: number): Uint8ClampedArray | undefined {
  if (module === undefined) throw new Error('prepareDecoder has not been awaited');
  const size = losslessSize(file);
  if (size?.width !== width || size.height !== height) return undefined;
  try {
    const picture = module.decode(file as Uint8Array<ArrayBuffer>);
    return picture?.width === width && picture.height === height ? picture.data : undefined;
  } catch {
    module = undefined; // its memory may be in any state
    throw new DecoderFailure();
  }
}
