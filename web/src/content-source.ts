// Where the contents of a scene come from: files, read by workers, drawn by the representation's drawer.
import type * as THREE from 'three';
import type { DecodePool } from './decode-pool';
import type { ContentPlace, DrawnContent, SceneDrawer } from './draw/scene-drawer';
import { codecOf, type KnownRepresentation } from './representations/codecs';
import type { ContentFile, SceneFiles } from './scene-files';
import type { TileSource, UploadStep } from './stream/tile-streamer';
import { coarsestTiles, type TileTree } from './stream/tile-tree';
import type { Content, ContentCodec } from './tiles/content-codec';
import { kContentLimits, type ContentLimits } from './tiles/content-limits';
import type { TileContent } from './tiles/tileset';

// Surrounds are drawn for long, and so are the coarsest tiles where there are no more.
const kMostDrawnForLong = 4;

export class ContentSource implements TileSource<ContentFile, Content, DrawnContent> {
  private readonly limits: ContentLimits;
  private readonly codec: ContentCodec;
  private readonly drawnForLong: Set<number>;

  constructor(
    private readonly representation: KnownRepresentation,
    private readonly tree: TileTree,
    private readonly files: SceneFiles,
    private readonly pool: DecodePool,
    private readonly drawer: SceneDrawer,
    renderer: THREE.WebGLRenderer,
  ) {
    this.codec = codecOf(representation);
    const surrounds = [...tree.tiles.keys()].filter((tile) => tree.tiles[tile].isSurround);
    const coarsest = coarsestTiles(tree);
    this.drawnForLong = new Set([...surrounds, ...(coarsest.length <= kMostDrawnForLong ? coarsest : [])]);
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
    const header = this.codec.readHeader(file, content.uri, content, this.limits);
    this.drawer.prepare(header, this.placeOf(tile));
    return { file, fileBytes: file.length, cardBytes: this.drawer.residentBytes(header) };
  }

  decode(tile: number, file: ContentFile): Promise<Content> {
    const { uri, surround, box } = this.contentOf(tile);
    return this.pool.decode({ representation: this.representation, file, name: uri, promised: { surround, box }, limits: this.limits });
  }

  allocate(tile: number, decoded: Content): DrawnContent {
    return this.drawer.allocate(decoded, this.placeOf(tile), []);
  }

  upload(resident: DrawnContent): UploadStep {
    return this.drawer.upload(resident);
  }

  free(resident: DrawnContent): void {
    this.drawer.free(resident);
  }

  private contentOf(tile: number): TileContent {
    return this.tree.tiles[tile].content!;
  }

  private placeOf(tile: number): ContentPlace {
    const { box, surround } = this.contentOf(tile);
    return { box, surround, number: tile, level: this.tree.tiles[tile].level, isDrawnForLong: this.drawnForLong.has(tile) };
  }
}
