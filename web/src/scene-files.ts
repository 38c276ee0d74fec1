// The files of a scene: of a server, or of a folder that somebody has chosen.
import { SceneError } from './scene-error';

export type ContentFile = Uint8Array<ArrayBuffer>;

export interface SceneFiles {
  readonly name: string; // the same for the same scene
  // `uri` is relative to the folder of tileset.json. Throws SceneError that names the file; also where it is larger than
  // `most` bytes, before more than that has been kept.
  read(uri: string, most: number, signal?: AbortSignal): Promise<ContentFile>;
}

export class TooLarge extends SceneError {
  constructor(name: string, remedy = 'copy the scene again, or bake it again') {
    super(name, '', 'is larger than any such file should be', remedy);
  }
}

export class ServedFiles implements SceneFiles {
  readonly name: string; // the address of tileset.json

  // The address of the folder, or of the tileset.json in it; relative to the page.
  constructor(url: string) {
    const absolute = new URL(url, location.href);
    if (!absolute.pathname.endsWith('.json')) absolute.pathname = `${absolute.pathname.replace(/\/$/, '')}/tileset.json`;
    this.name = absolute.href;
  }

  read(uri: string, most: number, signal?: AbortSignal): Promise<ContentFile> {
    // Whatever the tileset is called on that server.
    const url = uri === 'tileset.json' ? this.name : new URL(uri, this.name).href;
    return uri === 'tileset.json'
      ? fetchFile(url, url, most, signal, 'see that the address is that of a scene')
      : fetchFile(url, uri, most, signal);
  }
}

// Of an input that takes folders; the scene is what lies beside the topmost tileset.json.
export class ChosenFiles implements SceneFiles {
  readonly name: string;
  private readonly files = new Map<string, File>();

  // Throws SceneError where there is no tileset.json.
  constructor(files: Iterable<File>) {
    const all = [...files].map((file) => [file.webkitRelativePath || file.name, file] as const);
    const depth = (path: string) => path.split('/').length;
    const tilesets = all.map(([path]) => path).filter((path) => /(^|\/)tileset\.json$/.test(path));
    const found = tilesets.sort((a, b) => depth(a) - depth(b))[0];
    if (found === undefined) {
      throw new SceneError('folder', '', 'holds no tileset.json', 'choose the folder of a scene, as tessera bake has written it');
    }
    const folder = found.slice(0, found.length - 'tileset.json'.length);
    for (const [path, file] of all) if (path.startsWith(folder)) this.files.set(path.slice(folder.length), file);
    this.name = `folder ${folder}`;
  }

  async read(uri: string, most: number, signal?: AbortSignal): Promise<ContentFile> {
    const file = this.files.get(uri);
    if (!file) throw new SceneError(uri, '', 'is not in the folder', 'copy the scene again');
    if (file.size > most) throw new TooLarge(uri);
    try {
      const bytes = new Uint8Array(await file.arrayBuffer());
      signal?.throwIfAborted();
      return bytes;
    } catch (error) {
      if (signal?.aborted) throw error;
      throw new SceneError(uri, '', 'could not be read', 'choose the folder again');
    }
  }
}

// Throws SceneError that names the file and says what the server, or the network, said; or that it is larger than `most`
// bytes, before more than that has been kept. `ifMissing`: the remedy where there is no such file.
export async function fetchFile(
  url: string, name: string, most: number, signal?: AbortSignal, ifMissing = 'reload the page, as the scene may have been baked again',
): Promise<ContentFile> {
  try {
    const answer = await fetch(url, { signal });
    if (!answer.ok) {
      const remedy = answer.status === 404 ? ifMissing : 'try again later';
      throw new SceneError(name, '', `the server answered ${answer.status} ${answer.statusText}`.trim(), remedy);
    }
    const pieces: Uint8Array[] = [];
    let bytes = 0;
    const reader = answer.body!.getReader();
    for (let next = await reader.read(); !next.done; next = await reader.read()) {
      bytes += next.value.length;
      if (bytes > most) {
        await reader.cancel();
        throw new TooLarge(name);
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
