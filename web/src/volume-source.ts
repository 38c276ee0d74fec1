// Where the contents of a `volume` scene come from: files of a server, read by workers, drawn by a compositor.
import type * as THREE from 'three';
import type { DecodePool } from './decode-pool';
import type { Compositor, DrawnContent } from './draw/compositor';
import { ContentTextures } from './draw/content-textures';
import { SceneError } from './scene-error';
import type { TileSource, UploadStep } from './stream/tile-streamer';
import type { TileTree } from './stream/tile-tree';
import { kVolumeLimits, readVolumeHeader, type VolumeLimits } from './tiles/decode-volume';
import type { TileContent } from './tiles/tileset';
import type { VolumeContent } from './tiles/volume-content';

export type ContentFile = Uint8Array<ArrayBuffer>;

export class VolumeSource implements TileSource<ContentFile, VolumeContent, DrawnContent> {
  private readonly limits: VolumeLimits;

  constructor(
    private readonly tree: TileTree,
    private readonly base: string, // url of the folder
    private readonly pool: DecodePool,
    private readonly compositor: Compositor,
    private readonly renderer: THREE.WebGLRenderer,
  ) {
    const gl = renderer.getContext() as WebGL2RenderingContext;
    this.limits = {
      ...kVolumeLimits,
      edge2D: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number,
      edge3D: gl.getParameter(gl.MAX_3D_TEXTURE_SIZE) as number,
      layers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number,
      uniformBytes: gl.getParameter(gl.MAX_UNIFORM_BLOCK_SIZE) as number,
    };
  }

  async fetch(tile: number, signal: AbortSignal) {
    const content = this.contentOf(tile);
    const file = await fetchFile(new URL(content.uri, this.base).href, content.uri, this.limits.fileBytes, signal);
    const { layout, parts, network } = readVolumeHeader(file, content.uri, content, this.limits);
    this.compositor.prepare(this.renderer, parts, network, content.surround);
    return { file, fileBytes: file.length, cardBytes: layout.bytes };
  }

  decode(tile: number, file: ContentFile): Promise<VolumeContent> {
    const { uri, surround, box } = this.contentOf(tile);
    return this.pool.decode(file, uri, { surround, box }, this.limits);
  }

  allocate(tile: number, decoded: VolumeContent): DrawnContent {
    const made = this.compositor.make(new ContentTextures(decoded), this.contentOf(tile), tile, this.tree.tiles[tile].level);
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

// Throws SceneError that names the file and says what the server, or the network, said; or that it is larger than `most`
// bytes, before more than that has been kept.
export async function fetchFile(url: string, name: string, most: number, signal?: AbortSignal): Promise<ContentFile> {
  const tooLarge = new SceneError(name, '', 'is larger than any such file should be', 'copy the scene again, or bake it again');
  try {
    const answer = await fetch(url, { signal });
    if (!answer.ok) {
      const remedy = answer.status === 404 ? 'reload the page, as the scene may have been baked again' : 'try again later';
      throw new SceneError(name, '', `the server answered ${answer.status} ${answer.statusText}`.trim(), remedy);
    }
    const pieces: Uint8Array[] = [];
    let bytes = 0;
    const reader = answer.body!.getReader();
    for (let next = await reader.read(); !next.done; next = await reader.read()) {
      bytes += next.value.length;
      if (bytes > most) {
        await reader.cancel();
        throw tooLarge;
      }
      pieces.push(next.value);
    }
    const file = new Uint8Array(bytes);
    let at = 0;
    for (const piece of pieces) {
      file.set(piece, at);
      at += piece.length;
    }
    return file;
  } catch (error) {
    if (error instanceof SceneError || signal?.aborted) throw error;
    throw new SceneError(name, '', 'could not be fetched', 'see that the server runs and the network is there');
  }
}
