// Contents of either representation, from outside.
import { kContentLimits } from './content';
import { decodeHash, readHashHeader, type HashHeader } from './decode-hash';
import { decodeVolume, readVolumeHeader, type VolumeHeader } from './decode-volume';
import type { HashContent } from './hash-content';
import type { Representation, TileContent } from './tileset';
import type { VolumeContent } from './volume-content';

export type ContentHeader = VolumeHeader | HashHeader;
export type Content = VolumeContent | HashContent;
export type KnownRepresentation = Content['representation'];

export function isKnown(representation: Representation): representation is KnownRepresentation {
  return representation !== 'mesh';
}

// Both as readVolumeHeader and decodeVolume.
export function readContentHeader(
  representation: KnownRepresentation, file: Uint8Array, name: string, promised?: Pick<TileContent, 'surround' | 'box'>, limits = kContentLimits,
): ContentHeader {
  return (representation === 'hash' ? readHashHeader : readVolumeHeader)(file, name, promised, limits);
}

export function decodeContent(header: ContentHeader, name: string): Content {
  return header.representation === 'hash' ? decodeHash(header, name) : decodeVolume(header, name);
}

// The memory of a content's texels, which may be handed over to another thread.
export function buffersOf(content: Content): ArrayBuffer[] {
  const { macroblocks, distances } = content;
  const atlases = content.representation === 'hash' ? content.corners : [content.planes, content.voxels];
  const lists = content.representation === 'hash' ? [content.nearDistances.words, content.tables.words] : [];
  const arrays = [...atlases.flatMap(({ first, second }) => [first, second]), macroblocks.texels, distances.texels, ...lists];
  return arrays.map(({ buffer }) => buffer as ArrayBuffer);
}
