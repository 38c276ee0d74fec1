// Reads the golden scenes (docs/tile-format.md, section 12) for tests in Node.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { KnownRepresentation } from '../representations/codecs';
import { prepareDecoder } from '../tiles/lossless-image';

function goldenUrl(path: string, scene: KnownRepresentation): URL {
  return new URL(`../../../tests/golden/${scene}/${path}`, import.meta.url);
}

export function goldenFile(path: string, scene: KnownRepresentation = 'volume'): Uint8Array {
  return new Uint8Array(readFileSync(goldenUrl(path, scene)));
}

export function goldenText(path: string, scene: KnownRepresentation = 'volume'): string {
  return readFileSync(goldenUrl(path, scene), 'utf8');
}

export async function prepareDecoderInNode(): Promise<void> {
  const wasm = createRequire(import.meta.url).resolve('@jsquash/webp/codec/dec/webp_dec.wasm');
  await prepareDecoder(await WebAssembly.compile(readFileSync(wasm)));
}
