// The representations whose contents are read, a row each. The decoding worker loads this table, and therefore no three.js.
import { hashCodec } from '../tiles/decode-hash';
import { volumeCodec } from '../tiles/decode-volume';
import type { ContentCodec } from '../tiles/content-codec';

export const kCodecs = { volume: volumeCodec, hash: hashCodec };

export type KnownRepresentation = keyof typeof kCodecs;

// Its headers and contents must be given to no other.
export function codecOf(representation: KnownRepresentation): ContentCodec {
  return kCodecs[representation];
}
