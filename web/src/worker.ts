// Reads contents away from the page's own thread.
import decoderUrl from '@jsquash/webp/codec/dec/webp_dec.wasm?url';
import { SceneError } from './scene-error';
import { decodeVolume, readVolumeHeader, type VolumeLimits } from './tiles/decode-volume';
import { isDecoderPrepared, prepareDecoder } from './tiles/lossless-image';
import type { TileContent } from './tiles/tileset';
import type { VolumeContent } from './tiles/volume-content';

export interface DecodeRequest {
  id: number;
  file: Uint8Array<ArrayBuffer>;
  name: string;
  promised: Pick<TileContent, 'surround' | 'box'>;
  limits: VolumeLimits;
}

export type DecodeAnswer =
  | { id: number; content: VolumeContent }
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
  const { id, file, name, promised, limits } = data;
  try {
    await ready();
    if (!isDecoderPrepared()) {
      prepared = undefined; // it gave up meanwhile
      await ready();
    }
    const content = decodeVolume(readVolumeHeader(file, name, promised, limits), name);
    const { planes, voxels, macroblocks, distances } = content;
    const buffers = [planes.first, planes.second, voxels.first, voxels.second, macroblocks.texels, distances.texels];
    self.postMessage({ id, content } satisfies DecodeAnswer, { transfer: buffers.map((bytes) => bytes.buffer as ArrayBuffer) });
  } catch (error) {
    const { what, place, reason, remedy } =
      error instanceof SceneError ? error : new SceneError(name, '', String(error), 'reload the page');
    self.postMessage({ id, error: { what, place, reason, remedy } } satisfies DecodeAnswer);
  }
};
