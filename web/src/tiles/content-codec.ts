// The interface for reading the content files of a representation (docs/tile-format.md, sections 5 to 7). Workers use
// it, so nothing here depends on three.js. representations/codecs.ts lists the codec of each representation.
import { SceneError } from '../scene-error';
import type { ContentLimits } from './content-limits';
import type { SharedResource, TileContent } from './tileset';

// The header of a file; nothing has been allocated for its texels.
export interface ContentHeader {
  memoryBytes: number; // size of the decoded content
}

// A decoded content, whose structure only the codec and drawer of its representation know. It is transferred from a
// worker to the page, so it consists of plain data.
export type Content = object;

// A decoded resource that several contents share (SharedResource). It is read once, is given to the decoding of each,
// and consists of plain data as well.
export interface Resource {
  memoryBytes: number;
}

// What tileset.json declares about a content; its file must agree with it.
export type DeclaredContent = Pick<TileContent, 'backgroundBlock' | 'box'>;

// How a representation modifies the rules for tilesets.
export interface TilesetRules {
  overlappingContents?: boolean; // the contents of a tile need no order; those of tiles may overlap and cross walls of cells
}

// Codecs are stateless. Bytes are untrusted: methods that read them throw SceneError that names the file and the first
// violated rule.
export interface ContentCodec<Header extends ContentHeader = ContentHeader, Decoded extends Content = Content> extends TilesetRules {
  readHeader(file: Uint8Array, name: string, declared?: DeclaredContent, limits?: ContentLimits): Header;
  // `resources` are those that the tile needs, in its order. The image decoder must be prepared (lossless-image.ts).
  decode(header: Header, name: string, resources: readonly Resource[]): Decoded;
  // Returns the buffers of a content's texels, which may be transferred to another thread.
  listBuffers(content: Decoded): ArrayBuffer[];
  // If undefined, contents share nothing, and a tile that needs a resource is rejected (decodeResource below).
  decodeResource?(file: Uint8Array, from: SharedResource, limits: ContentLimits): Resource;
  buffersOfResource?(resource: Resource): ArrayBuffer[]; // like listBuffers; if undefined, the resource is copied
}

export function decodeResource(codec: ContentCodec, file: Uint8Array, from: SharedResource, limits: ContentLimits): Resource {
  if (codec.decodeResource) return codec.decodeResource(file, from, limits);
  throw new SceneError(
    from.uri, '', 'is a shared resource, which contents of this representation do not have', 'copy the scene again, or bake it again');
}
