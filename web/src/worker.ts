// Reads contents away from the page's own thread.
import decoderUrl from '@jsquash/webp/codec/dec/webp_dec.wasm?url';
import { codecOf, type KnownRepresentation } from './representations/codecs';
import { SceneError } from './scene-error';
import type { Content, PromisedContent } from './tiles/content-codec';
import type { ContentLimits } from './tiles/content-limits';
import { isDecoderPrepared, prepareDecoder } from './tiles/lossless-image';

export interface DecodeRequest {
  representation: KnownRepresentation;
  file: Uint8Array<ArrayBuffer>;
  name: string;
  promised: PromisedContent;
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

self.onmessage = async ({ data }: MessageEvent<DecodeRequest & { id: number }>) => {
  const { id, representation, file, name, promised, limits } = data;
  try {
    await ready();
    if (!isDecoderPrepared()) {
      prepared = undefined; // it gave up meanwhile
      await ready();
    }
    const codec = codecOf(representation);
    const content = codec.decode(codec.readHeader(file, name, promised, limits), name, []);
    self.postMessage({ id, content } satisfies DecodeAnswer, { transfer: codec.buffersOf(content) });
  } catch (error) {
    const { what, place, reason, remedy } =
      error instanceof SceneError ? error : new SceneError(name, '', String(error), 'reload the page');
    self.postMessage({ id, error: { what, place, reason, remedy } } satisfies DecodeAnswer);
  }
};
