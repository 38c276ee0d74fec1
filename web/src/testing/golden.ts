// The golden scenes (docs/tile-format.md, section 11), for tests in Node.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { prepareDecoder } from '../tiles/lossless-image';

export type Golden = 'volume' | 'hash';

function placeOf(path: string, scene: Golden): URL {
  return new URL(`../../../tests/golden/${scene}/${path}`, import.meta.url);
}

export function goldenFile(path: string, scene: Golden = 'volume'): Uint8Array {
  return new Uint8Array(readFileSync(placeOf(path, scene)));
}

export function goldenText(path: string, scene: Golden = 'volume'): string {
  return readFileSync(placeOf(path, scene), 'utf8');
}

export async function prepareDecoderInNode(): Promise<void> {
  const wasm = createRequire(import.meta.url).resolve('@jsquash/webp/codec/dec/webp_dec.wasm');
  await prepareDecoder(await WebAssembly.compile(readFileSync(wasm)));
}
