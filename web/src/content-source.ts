// Where the contents of a scene come from: files, read by workers, drawn by a compositor.
import type * as THREE from 'three';
import type { DecodePool } from './decode-pool';
import type { Compositor, DrawnContent } from './draw/compositor';
import type { ContentFile, SceneFiles } from './scene-files';
import type { TileSource, UploadStep } from './stream/tile-streamer';
import { coarsestTiles, type TileTree } from './stream/tile-tree';
import { kContentLimits, type ContentLimits } from './tiles/content';
import { readContentHeader, type Content, type KnownRepresentation } from './tiles/decode-content';
import type { TileContent } from './tiles/tileset';

// What of a `volume` scene is drawn for long, the coarsest tiles and surrounds, has its network written into a program of its own,
// which is faster than to read it from a buffer. What comes and goes shares programs, as compiling takes long.
const kOwnPrograms = 4; // of tiles

export class ContentSource implements TileSource<ContentFile, Content, DrawnContent> {
  private readonly limits: ContentLimits;
  private readonly ownProgram: Set<number>;

  constructor(
    private readonly representation: KnownRepresentation,
    private readonly tree: TileTree,
    private readonly files: SceneFiles,
    private readonly pool: DecodePool,
    private readonly compositor: Compositor,
    private readonly renderer: THREE.WebGLRenderer,
  ) {
    const surrounds = [...tree.tiles.keys()].filter((tile) => tree.tiles[tile].isSurround);
    const coarsest = coarsestTiles(tree);
    this.ownProgram = new Set([...surrounds, ...(coarsest.length <= kOwnPrograms ? coarsest : [])]);
    const gl = renderer.getContext() as WebGL2RenderingContext;
    this.limits = {
      ...kContentLimits,
      edge2D: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number,
      edge3D: gl.getParameter(gl.MAX_3D_TEXTURE_SIZE) as number,
      layers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number,
      uniformBytes: gl.getParameter(gl.MAX_UNIFORM_BLOCK_SIZE) as number,
    };
  }

  promisedBytes(tile: number): number {
    return this.contentOf(tile).bytes;
  }

  async fetch(tile: number, signal: AbortSignal) {
    const content = this.contentOf(tile);
    const file = await this.files.read(content.uri, this.limits.fileBytes, signal);
    const header = readContentHeader(this.representation, file, content.uri, content, this.limits);
    this.compositor.prepare(this.renderer, header, content.surround, this.ownProgram.has(tile));
    return { file, fileBytes: file.length, cardBytes: header.cardBytes };
  }

  decode(tile: number, file: ContentFile): Promise<Content> {
    const { uri, surround, box } = this.contentOf(tile);
    return this.pool.decode(this.representation, file, uri, { surround, box }, this.limits);
  }

  allocate(tile: number, decoded: Content): DrawnContent {
    const made = this.compositor.make(
      decoded, this.contentOf(tile), tile, this.tree.tiles[tile].level, this.ownProgram.has(tile));
    this.compositor.compile(this.renderer, made);
    return made;
  }

  upload(resident: DrawnContent): UploadStep {
    if (!resident.textures.upload(this.renderer)) return 'more';
    return this.compositor.isCompiled(this.renderer, resident) ? 'done' : 'wait';
  }

  free(resident: DrawnContent): void {
    this.compositor.remove(resident);
  }

  private contentOf(tile: number): TileContent {
    return this.tree.tiles[tile].content!;
  }
}
