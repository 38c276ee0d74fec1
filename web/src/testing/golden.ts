// The golden scene (docs/tile-format.md, section 11), for tests in Node.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { prepareDecoder } from '../tiles/lossless-image';

const folder = new URL('../../../tests/golden/volume/', import.meta.url);

export function goldenFile(path: string): Uint8Array {
  return new Uint8Array(readFileSync(new URL(path, folder)));
}

export function goldenText(path: string): string {
  return readFileSync(new URL(path, folder), 'utf8');
}

export async function prepareDecoderInNode(): Promise<void> {
  const wasm = createRequire(import.meta.url).resolve('@jsquash/webp/codec/dec/webp_dec.wasm');
  await prepareDecoder(await WebAssembly.compile(readFileSync(wasm)));
}
