// The representations whose contents are read, a row each. The decoding worker loads this table, and therefore no three.js.
import type { ContentCodec } from '../tiles/content-codec';
import { hashCodec } from './hash/decode-hash';
import { volumeCodec } from './volume/decode-volume';

export const kCodecs = { volume: volumeCodec, hash: hashCodec };

export type KnownRepresentation = keyof typeof kCodecs;

// Its headers and contents must be given to no other.
export function codecOf(representation: KnownRepresentation): ContentCodec {
  return kCodecs[representation];
}
