// Reads contents away from the page's own thread.
import decoderUrl from '@jsquash/webp/codec/dec/webp_dec.wasm?url';
import { SceneError } from './scene-error';
import type { ContentLimits } from './tiles/content';
import { buffersOf, decodeContent, readContentHeader, type Content, type KnownRepresentation } from './tiles/decode-content';
import { isDecoderPrepared, prepareDecoder } from './tiles/lossless-image';
import type { TileContent } from './tiles/tileset';

export interface DecodeRequest {
  id: number;
  representation: KnownRepresentation;
  file: Uint8Array<ArrayBuffer>;
  name: string;
  promised: Pick<TileContent, 'surround' | 'box'>;
  limits: ContentLimits;
}

export type DecodeAnswer =
  | { id: number; content: Content }
  | { id: number; error: { what: string; place: string; reason: string; remedy: string } };

let prepared: Promise<void> | undefined;

async function prepare(): Promise<void> {
  const file = await fetch(decoderUrl);
  if (!file.ok) throw new SceneError('viewer', '', `lacks a file: the server answered ${file.status}`, 'reload the page');
  return prepareDecoder(await WebAssembly.compile(await file.arrayBuffer()));
}

function ready(): Promise<void> {
  return (prepared ??= prepare().catch((error: unknown) => {
    prepared = undefined; // the next content tries again
    throw error;
  }));
}

ready().catch(() => {}); // while the first files are fetched

self.onmessage = async ({ data }: MessageEvent<DecodeRequest>) => {
  const { id, representation, file, name, promised, limits } = data;
  try {
    await ready();
    if (!isDecoderPrepared()) {
      prepared = undefined; // it gave up meanwhile
      await ready();
    }
    const content = decodeContent(readContentHeader(representation, file, name, promised, limits), name);
    self.postMessage({ id, content } satisfies DecodeAnswer, { transfer: buffersOf(content) });
  } catch (error) {
    const { what, place, reason, remedy } =
      error instanceof SceneError ? error : new SceneError(name, '', String(error), 'reload the page');
    self.postMessage({ id, error: { what, place, reason, remedy } } satisfies DecodeAnswer);
  }
};
