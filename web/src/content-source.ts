// The source of the contents of a scene: files are fetched, decoded by workers, and uploaded by the representation's
// drawer.
import type * as THREE from 'three';
import type { DecodePool } from './decode-pool';
import type { ContentPlace, DrawnContent, SceneDrawer } from './draw/scene-drawer';
import { kBlockExtension } from './draw/sliced-textures';
import { drawsOnCpu } from './draw/software-renderer';
import { getCodec, type KnownRepresentation } from './representations/codecs';
import type { ContentFile, SceneFiles } from './scene-files';
import type { ResourceSource } from './stream/shared-resources';
import type { TileSource, UploadStep } from './stream/tile-streamer';
import { coarsestTiles, type TileTree } from './stream/tile-tree';
import type { Content, ContentCodec, Resource } from './tiles/content-codec';
import { kContentLimits, type ContentLimits } from './tiles/content-limits';
import type { TileContent, Tileset } from './tiles/tileset';

// Background blocks are drawn for a long time, and so are the coarsest tiles if there are at most this many.
const kMaxDrawnForLong = 4;
const kBytesOfBlocks = 2; // of a texture in bytes, relative to the same in blocks

// What contents pass through on their way from file to GPU.
export interface ContentPath {
  tileset: Pick<Tileset<KnownRepresentation>, 'representation' | 'resources'>;
  tree: TileTree;
  files: SceneFiles;
  pool: Pick<DecodePool, 'decode' | 'decodeResource'>;
  drawer: SceneDrawer;
  gpuBytes: number; // budget for contents, when the scene is opened
}

export class ContentSource implements TileSource<ContentFile, Content, DrawnContent, Resource> {
  readonly resources?: ResourceSource<Resource>;
  private readonly limits: ContentLimits;
  private readonly drawnForLong: Set<number>;

  constructor(
    private readonly path: ContentPath, renderer: THREE.WebGLRenderer,
    private readonly codec: ContentCodec = getCodec(path.tileset.representation),
  ) {
    const { tileset, tree } = path;
    const backgroundBlocks = [...tree.tiles.keys()].filter((tile) => tree.tiles[tile].isBackgroundBlock);
    const coarsest = coarsestTiles(tree);
    this.drawnForLong = new Set([...backgroundBlocks, ...(coarsest.length <= kMaxDrawnForLong ? coarsest : [])]);
    const gl = renderer.getContext() as WebGL2RenderingContext;
    this.limits = {
      ...kContentLimits,
      edge2D: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number,
      edge3D: gl.getParameter(gl.MAX_3D_TEXTURE_SIZE) as number,
      layers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number,
      uniformBytes: gl.getParameter(gl.MAX_UNIFORM_BLOCK_SIZE) as number,
      blockTextures: renderer.extensions.has(kBlockExtension) && !(drawsOnCpu(gl) && fitsInBytes(path)),
    };
    if (tileset.resources.length === 0) return;
    this.resources = {
      tileResources: (tile) => this.tileContent(tile).resources,
      declaredBytes: (id) => tileset.resources[id].bytes,
      load: (id, signal) => this.loadResource(id, signal),
    };
  }

  declaredBytes(tile: number): number {
    return this.tileContent(tile).bytes;
  }

  async fetch(tile: number, signal: AbortSignal) {
    const { files, drawer } = this.path;
    const content = this.tileContent(tile);
    const file = await files.read(content.uri, this.limits.fileBytes, signal);
    const header = this.codec.readHeader(file, content.uri, content, this.limits);
    drawer.prepare(header, this.contentPlace(tile));
    return { file, fileBytes: file.length, gpuBytes: drawer.residentBytes(header) };
  }

  decode(tile: number, file: ContentFile, resources: readonly Resource[]): Promise<Content> {
    const { uri, backgroundBlock, box } = this.tileContent(tile);
    const { tileset: { representation }, pool } = this.path;
    return pool.decode({ representation, file, name: uri, declared: { backgroundBlock, box }, limits: this.limits, resources });
  }

  allocate(tile: number, decoded: Content, resources: readonly Resource[]): DrawnContent {
    return this.path.drawer.allocate(decoded, this.contentPlace(tile), resources);
  }

  upload(resident: DrawnContent): UploadStep {
    return this.path.drawer.upload(resident);
  }

  free(resident: DrawnContent): void {
    this.path.drawer.free(resident);
  }

  private async loadResource(id: number, signal: AbortSignal) {
    const { tileset: { representation, resources }, files, pool, drawer } = this.path;
    const from = resources[id];
    const file = await files.read(from.uri, this.limits.fileBytes, signal);
    const fileBytes = file.length; // before the buffer is transferred
    const resource = await pool.decodeResource({ representation, file, from, limits: this.limits });
    const gpuBytes = drawer.residentBytesOfResource?.(resource) ?? resource.memoryBytes;
    return { resource, fileBytes, pageBytes: resource.memoryBytes, gpuBytes };
  }

  private tileContent(tile: number): TileContent {
    return this.path.tree.tiles[tile].content!;
  }

  private contentPlace(tile: number): ContentPlace {
    const { box, backgroundBlock } = this.tileContent(tile);
    return { box, backgroundBlock, number: tile, level: this.path.tree.tiles[tile].level, isDrawnForLong: this.drawnForLong.has(tile) };
  }
}

// Returns whether the whole scene surely fits into the budget with textures of bytes. Drivers for the CPU decode blocks each
// time that they sample them, which takes longer than it saves.
function fitsInBytes({ tree, gpuBytes }: Pick<ContentPath, 'tree' | 'gpuBytes'>): boolean {
  const files = tree.tiles.flatMap(({ content }) => (content ? [content.bytes] : []));
  return files.every((bytes) => bytes > 0) && kBytesOfBlocks * files.reduce((sum, bytes) => sum + bytes, 0) <= gpuBytes;
}
