// What a representation says of its contents' files (docs/tile-format.md, sections 5 to 7): how they are read. Workers read
// them, so nothing here knows three.js. representations/codecs.ts has one for each representation.
import { SceneError } from '../scene-error';
import type { ContentLimits } from './content-limits';
import type { SharedResource, TileContent } from './tileset';

// What a file says of itself; nothing has been allocated for its texels.
export interface ContentHeader {
  memoryBytes: number; // that the content will take, decoded
}

// A content in memory: its own representation's codec and drawer alone know what stands in it. It is handed from worker to
// page, and so holds nothing but data.
export type Content = object;

// What several contents share (SharedResource), read once and given to the decoding of each; likewise data alone.
export interface Resource {
  memoryBytes: number;
}

// What tileset.json says of a content, which its file has to keep.
export type PromisedContent = Pick<TileContent, 'surround' | 'box'>;

// What a representation changes of the rules that a tileset keeps.
export interface TilesetRules {
  overlappingContents?: boolean; // contents of a tile need no order, and may overlap
}

// Without state. Bytes are untrusted: what reads them throws SceneError that names the file and the first rule that is broken.
export interface ContentCodec<Header extends ContentHeader = ContentHeader, Decoded extends Content = Content> extends TilesetRules {
  readHeader(file: Uint8Array, name: string, promised?: PromisedContent, limits?: ContentLimits): Header;
  // `resources`: those that the tile needs, in its order. The decoder of pictures must be prepared (lossless-image.ts).
  decode(header: Header, name: string, resources: readonly Resource[]): Decoded;
  // The memory of a content's texels, which may be handed over to another thread.
  buffersOf(content: Decoded): ArrayBuffer[];
  // Where there is none, contents share nothing, and a tile that needs a resource is not drawn (decodeResource below).
  decodeResource?(file: Uint8Array, from: SharedResource, limits: ContentLimits): Resource;
  buffersOfResource?(resource: Resource): ArrayBuffer[]; // as buffersOf; where there is none, it is copied
}

export function decodeResource(codec: ContentCodec, file: Uint8Array, from: SharedResource, limits: ContentLimits): Resource {
  if (codec.decodeResource) return codec.decodeResource(file, from, limits);
  throw new SceneError(
    from.uri, '', 'is a shared resource, which contents of this representation do not have', 'copy the scene again, or bake it again');
}
