// The worker that decodes contents outside the main thread.
import decoderUrl from '@jsquash/webp/codec/dec/webp_dec.wasm?url';
import { getCodec, type KnownRepresentation } from './representations/codecs';
import { SceneError } from './scene-error';
import { decodeResource, type Content, type DeclaredContent, type Resource } from './tiles/content-codec';
import type { ContentLimits } from './tiles/content-limits';
import { isDecoderPrepared, prepareDecoder } from './tiles/lossless-image';
import type { SharedResource } from './tiles/tileset';

interface Request {
  representation: KnownRepresentation;
  file: Uint8Array<ArrayBuffer>;
  limits: ContentLimits;
}

export interface ContentRequest extends Request {
  name: string;
  declared: DeclaredContent;
  resources: readonly Resource[];
}

export interface ResourceRequest extends Request {
  from: SharedResource;
}

export type DecodeRequest = ContentRequest | ResourceRequest;

export type DecodeAnswer =
  | { id: number; decoded: Content | Resource }
  | { id: number; error: { what: string; place: string; reason: string; remedy: string } };

let prepared: Promise<void> | undefined;

async function prepare(): Promise<void> {
  const file = await fetch(decoderUrl);
  if (!file.ok) throw new SceneError('viewer', '', `lacks a file: the server answered ${file.status}`, 'reload the page');
  return prepareDecoder(await WebAssembly.compile(await file.arrayBuffer()));
}

function ready(): Promise<void> {
  return (prepared ??= prepare().catch((error: unknown) => {
    prepared = undefined; // the next request tries again
    throw error;
  }));
}

ready().catch(() => {}); // starts while the first files are fetched

function decode(request: DecodeRequest): { decoded: Content | Resource; buffers: ArrayBuffer[] } {
  const { representation, file, limits } = request;
  const codec = getCodec(representation);
  if ('from' in request) {
    const resource = decodeResource(codec, file, request.from, limits);
    return { decoded: resource, buffers: codec.buffersOfResource?.(resource) ?? [] };
  }
  const { name, declared, resources } = request;
  const content = codec.decode(codec.readHeader(file, name, declared, limits), name, resources);
  return { decoded: content, buffers: codec.listBuffers(content) };
}

self.onmessage = async ({ data }: MessageEvent<DecodeRequest & { id: number }>) => {
  const { id } = data;
  try {
    await ready();
    if (!isDecoderPrepared()) {
      prepared = undefined; // the decoder failed in the meantime
      await ready();
    }
    const { decoded, buffers } = decode(data);
    self.postMessage({ id, decoded } satisfies DecodeAnswer, { transfer: buffers });
  } catch (error) {
    const { what, place, reason, remedy } =
      error instanceof SceneError ? error : new SceneError('name' in data ? data.name : data.from.uri, '', String(error), 'reload the page');
    self.postMessage({ id, error: { what, place, reason, remedy } } satisfies DecodeAnswer);
  }
};
