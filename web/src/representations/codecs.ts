// The codec of each representation, one per row. The decoding worker loads this table, so it must not import three.js.
import type { ContentCodec } from '../tiles/content-codec';
import { hashCodec } from './hash/decode-hash';
import { meshCodec } from './mesh/decode-mesh';
import { volumeCodec } from './volume/decode-volume';

export const kCodecs = { volume: volumeCodec, hash: hashCodec, mesh: meshCodec };

export type KnownRepresentation = keyof typeof kCodecs;

// Headers and contents of one codec must not be passed to another.
export function getCodec(representation: KnownRepresentation): ContentCodec {
  return kCodecs[representation];
}
