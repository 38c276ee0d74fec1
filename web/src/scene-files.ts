// The files of a scene: from a server, or from a folder that the user has chosen.
import { SceneError } from './scene-error';

const kLongestSilence = 60_000; // ms without a byte, after which a file is given up, to be asked for again

export type ContentFile = Uint8Array<ArrayBuffer>;

export interface SceneFiles {
  readonly name: string; // identifies the scene
  // Reads a file. `uri` is relative to the folder of tileset.json. Throws SceneError that names the file, also as soon
  // as the file turns out to be larger than `maximum` bytes.
  read(uri: string, maximum: number, signal?: AbortSignal): Promise<ContentFile>;
}

// Thrown for a file that is larger than the `maximum` that `read` was given.
export class TooLarge extends SceneError {
  constructor(name: string, remedy = 'copy the scene again, or bake it again') {
    super(name, '', 'is larger than any such file should be', remedy);
  }
}

// The files of a scene on a server.
export class ServedFiles implements SceneFiles {
  readonly name: string; // the address of tileset.json

  // `url` is the address of the folder, or of the tileset.json in it, relative to the page. Throws TypeError if it is
  // not a valid URL.
  constructor(url: string) {
    const absolute = new URL(url, location.href);
    if (!absolute.pathname.endsWith('.json')) absolute.pathname = `${absolute.pathname.replace(/\/$/, '')}/tileset.json`;
    this.name = absolute.href;
  }

  read(uri: string, maximum: number, signal?: AbortSignal): Promise<ContentFile> {
    // The file is called tileset.json here, whatever its name on the server.
    const url = uri === 'tileset.json' ? this.name : new URL(uri, this.name).href;
    return uri === 'tileset.json'
      ? fetchFile(url, url, maximum, signal, 'check that the address is that of a scene')
      : fetchFile(url, uri, maximum, signal);
  }
}

// The files of an <input webkitdirectory>; the scene is the folder of the topmost tileset.json.
export class ChosenFiles implements SceneFiles {
  readonly name: string;
  private readonly files = new Map<string, File>();

  // Throws SceneError if there is no tileset.json.
  constructor(files: Iterable<File>) {
    const all = [...files].map((file) => [file.webkitRelativePath || file.name, file] as const);
    const depth = (path: string) => path.split('/').length;
    const tilesets = all.map(([path]) => path).filter((path) => /(^|\/)tileset\.json$/.test(path));
    const tilesetPath = tilesets.sort((a, b) => depth(a) - depth(b))[0];
    if (tilesetPath === undefined) {
      throw new SceneError('folder', '', 'holds no tileset.json', 'choose the folder of a scene, as tessera bake has written it');
    }
    const folder = tilesetPath.slice(0, tilesetPath.length - 'tileset.json'.length);
    for (const [path, file] of all) if (path.startsWith(folder)) this.files.set(path.slice(folder.length), file);
    this.name = `folder ${folder}`;
  }

  async read(uri: string, maximum: number, signal?: AbortSignal): Promise<ContentFile> {
    const file = this.files.get(uri);
    if (!file) throw new SceneError(uri, '', 'is not in the folder', 'copy the scene again');
    if (file.size > maximum) throw new TooLarge(uri);
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

// Fetches a file. Throws SceneError that names the file and contains the error of the server or the network, also as
// soon as more than `maximum` bytes arrive. `ifMissing` is the remedy in the error for a file that does not exist.
export async function fetchFile(
  url: string, name: string, maximum: number, signal?: AbortSignal, ifMissing = 'reload the page, as the scene may have been baked again',
): Promise<ContentFile> {
  // A connection may end without a word, as on a change of networks.
  const stopped = new AbortController();
  const stop = () => stopped.abort(signal?.reason);
  let timer: ReturnType<typeof setTimeout> | undefined;
  const wait = () => {
    clearTimeout(timer);
    timer = setTimeout(() => stopped.abort(), kLongestSilence);
  };
  try {
    signal?.throwIfAborted();
    signal?.addEventListener('abort', stop);
    wait();
    const answer = await fetch(url, { signal: stopped.signal });
    if (!answer.ok) {
      const remedy = answer.status === 404 ? ifMissing : 'try again later';
      throw new SceneError(name, '', `the server answered ${answer.status} ${answer.statusText}`.trim(), remedy);
    }
    const pieces: Uint8Array[] = [];
    let bytes = 0;
    const reader = answer.body!.getReader();
    for (let next = await reader.read(); !next.done; next = await reader.read()) {
      wait();
      bytes += next.value.length;
      if (bytes > maximum) {
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
    throw new SceneError(name, '', 'could not be fetched', 'check that the server is running and the network is available');
  } finally {
    clearTimeout(timer);
    signal?.removeEventListener('abort', stop);
  }
}
