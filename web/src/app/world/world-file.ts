// world.json: the scenes, models, hidden parts and views of a world (docs/world-format.md). The text is untrusted.
import { kMaxHiddenBoxes } from '../../draw/hidden-boxes';
import { SceneError } from '../../scene-error';
import { getArray, getField, getBoolean, getString, type Json } from '../../tiles/json-fields';
import { parseView } from '../views/view-address';
import { isAddress, isFileAddress } from './world-address';
import { checkedName, kFarthest, kNameLength, numberWithin, numbersWithin, readQuaternion, readScales, type Fail, type Four, type Three } from './world-fields';

export const kWorldName = 'world.json';
export const kEmbeddedBytes = 128 * 1000 * 1000; // limit on all embedded models of a file
export const kWorldBytes = 1.4 * kEmbeddedBytes; // limit on the file itself
const kKind = 'tessera world';
const kVersion = 2;
export const kMax = { scenes: 16, models: 1000, hidden: kMaxHiddenBoxes, bookmarks: 200 };
const kMaxFiles = 1000; // limit per model
export const kMaxFilesHeld = 4000; // limit for all models

export interface WorldScene {
  name: string;
  url: string; // address of its tileset.json or of its folder, possibly relative; '' if unknown
  place?: { position: Three; rotation: Four; scale: number }; // undefined: this scene defines the world's frame
  visible: boolean;
}

export interface WorldModel {
  name: string;
  files: string[]; // the model's own file first, then those that it needs
  contents: string[]; // digest of each file (file-content.ts); empty if unknown
  position: Three;
  rotation: Four; // quaternion x, y, z, w
  scale: Three;
  visible: boolean;
  plays: boolean;
}

export interface HiddenPart {
  name: string;
  middle: Three;
  size: Three;
  turn: number; // radians about the vertical axis, anticlockwise as seen from above
  hides: boolean; // false: the part is temporarily shown
}

export interface World {
  scenes: WorldScene[]; // the first scene without a place defines the world's frame
  models: WorldModel[];
  hidden: HiddenPart[];
  bookmarks: { name: string; view: string }[]; // `view` has the form of the page's address
  files: Map<string, Uint8Array<ArrayBuffer>>; // embedded files
}

export function mainScene({ scenes }: Pick<World, 'scenes'>): WorldScene {
  return scenes.find(({ place }) => !place)!;
}

// Writes one scene, model, part or view per line. `files` contains base64 by name.
export function encodeWorld({ scenes, models, hidden, bookmarks }: Omit<World, 'files'>, files: ReadonlyMap<string, string>): string {
  const lines = (all: string[]) => (all.length > 0 ? `\n${all.join(',\n')}\n` : '');
  const list = (name: string, all: unknown[]) => `"${name}":[${lines(all.map((one) => JSON.stringify(one)))}]`;
  const embedded = [...files].map(([name, base64]) => `${JSON.stringify(name)}:"${base64}"`);
  const fields = [
    `"kind":${JSON.stringify(kKind)},"version":${kVersion}`,
    list('scenes', scenes.map(({ name, url, place, visible }) => ({ name, url, ...place, visible }))),
    list('models', models),
    list('hidden', hidden),
    list('bookmarks', bookmarks),
    ...(embedded.length > 0 ? [`"files":{${lines(embedded)}}`] : []),
  ];
  return `{${fields.join(',\n')}}\n`;
}

// Returns the text of world.json. Throws SceneError if it could not be opened again.
export function savedWorld(world: Omit<World, 'files'>, files: ReadonlyMap<string, string>): Blob {
  try {
    decodeWorld(encodeWorld(world, new Map([...files.keys()].map((name) => [name, '']))), kWorldName);
  } catch (error) {
    if (!(error instanceof SceneError)) throw error;
    throw new SceneError(kWorldName, error.place, `${error.reason}, so that it could not be opened again`, 'change that, and save again');
  }
  const blob = new Blob([encodeWorld(world, files)], { type: 'application/json' });
  if (blob.size <= kWorldBytes) return blob;
  throw new SceneError(kWorldName, '', `would be larger than ${kWorldBytes / 1e6} MB`, 'save it without its models');
}

// Throws SceneError that names `file`, and the first invalid place in it.
export function decodeWorld(text: string, file: string): World {
  const fail = (place: string, reason: string, remedy = 'correct it, or save it again'): never => {
    throw new SceneError(file, place, reason, remedy);
  };
  if (text.length > kWorldBytes) fail('', `is larger than ${kWorldBytes / 1e6} MB`, 'save it without its models');
  let world: Json;
  try {
    world = JSON.parse(text);
  } catch (error) {
    return fail('', `is not JSON: ${(error as Error).message.slice(0, 200)}`); // most browsers include the position
  }
  if (getString(world, 'kind') !== kKind) fail('', 'is not a world of this viewer', 'choose one that was saved here');
  const version = getField(world, 'version');
  if (version !== 1 && version !== kVersion) fail('version', `is neither 1 nor ${kVersion}`, 'open it with a newer viewer');
  const readList = <T>(key: 'scenes' | 'models' | 'hidden' | 'bookmarks', isNeeded: boolean, read: (one: Json, fail: Fail) => T): T[] => {
    if (getField(world, key) === undefined && !isNeeded) return [];
    const list = getArray(world, key) ?? fail(key, 'is not a list');
    if (list.length > kMax[key]) fail(key, `are more than ${kMax[key]}`, 'keep fewer');
    return list.map((one, i) => read(one, (place, reason) => fail(`${key}[${i}]${place}`, reason)));
  };
  const scenes = version === 1 ? [firstScene(getField(world, 'scene'))] : readList('scenes', true, readWorldScene);
  if (!scenes.some(({ place }) => !place)) fail('scenes', 'contains no scene without a placement, which would define the frame of the world', 'leave out position, rotation and scale of one');
  return {
    scenes,
    models: readList('models', version === 1, readWorldModel),
    hidden: readList('hidden', false, readHiddenPart),
    bookmarks: readList('bookmarks', false, readBookmark),
    files: readFiles(getField(world, 'files'), fail),
  };
}

// Version 1 had a single scene and no scene address.
function firstScene(scene: Json): WorldScene {
  const url = getString(scene, 'url') ?? '';
  return { name: (getString(scene, 'name') ?? '').slice(0, kNameLength), url: isAddress(url) ? url : '', visible: true };
}

function readWorldScene(scene: Json, fail: Fail): WorldScene {
  if (typeof scene !== 'object' || scene === null || Array.isArray(scene)) return fail('', 'is not an object');
  const url = getString(scene, 'url') ?? '';
  if (url.length > kNameLength || (url !== '' && !isAddress(url))) return fail('.url', 'is neither an address of http or https nor a relative one');
  const name = getString(scene, 'name') ?? '';
  if (name.length > kNameLength) return fail('.name', 'is too long');
  const isPlaced = ['position', 'rotation', 'scale'].some((key) => getField(scene, key) !== undefined);
  const has = (key: string) => getField(scene, key) !== undefined;
  return {
    name, url, visible: getBoolean(scene, 'visible') ?? true,
    ...(isPlaced && {
      place: {
        position: has('position') ? numbersWithin(scene, 'position', 3, kFarthest, fail) as Three : [0, 0, 0],
        rotation: has('rotation') ? readQuaternion(scene, fail) : [0, 0, 0, 1],
        scale: has('scale') ? readScales([getField(scene, 'scale')], '.scale', fail)[0] : 1,
      },
    }),
  };
}

function readWorldModel(model: Json, fail: Fail): WorldModel {
  const files = getArray(model, 'files');
  if (!files || files.length === 0 || files.length > kMaxFiles) return fail('.files', 'names no files, or too many');
  const isFile = (one: Json): one is string => typeof one === 'string' && one !== '' && one.length <= kNameLength && isFileAddress(one);
  if (!files.every(isFile)) return fail('.files', 'has an invalid name');
  const contents = getArray(model, 'contents') ?? [];
  if (contents.length > files.length || !contents.every((one) => typeof one === 'string')) return fail('.contents', 'is not one text for each file');
  return {
    files, contents: contents as string[], name: checkedName(model, fail),
    position: numbersWithin(model, 'position', 3, kFarthest, fail) as Three,
    rotation: readQuaternion(model, fail),
    scale: readScales(numbersWithin(model, 'scale', 3, Infinity, fail), '.scale', fail) as Three,
    visible: getBoolean(model, 'visible') ?? true,
    plays: getBoolean(model, 'plays') ?? true,
  };
}

function readHiddenPart(part: Json, fail: Fail): HiddenPart {
  return {
    name: checkedName(part, fail),
    middle: numbersWithin(part, 'middle', 3, kFarthest, fail) as Three,
    size: readScales(numbersWithin(part, 'size', 3, Infinity, fail), '.size', fail) as Three,
    turn: getField(part, 'turn') === undefined ? 0 : numberWithin(part, 'turn', 1000, fail),
    hides: getBoolean(part, 'hides') ?? true,
  };
}

function readBookmark(bookmark: Json, fail: Fail): World['bookmarks'][number] {
  const view = getString(bookmark, 'view') ?? '';
  if (view.length > kNameLength || !parseView(view)) return fail('.view', 'is not a view such as eye=x,y,z&target=x,y,z');
  return { name: checkedName(bookmark, fail), view };
}

function readFiles(files: Json, fail: (place: string, reason: string) => never): World['files'] {
  const read: World['files'] = new Map();
  if (files === undefined) return read;
  if (typeof files !== 'object' || files === null || Array.isArray(files)) return fail('files', 'is not an object');
  let bytes = 0;
  for (const [name, text] of Object.entries(files)) {
    const place = `files[${JSON.stringify(name.slice(0, 100))}]`;
    if (name === '' || name.length > kNameLength || read.size === kMaxFilesHeld) fail(place, 'is one file too many, or has no name');
    if (typeof text !== 'string') return fail(place, 'is not text');
    const content = bytesOfBase64(text) ?? fail(place, 'is not base64');
    bytes += content.length;
    if (bytes > kEmbeddedBytes) fail(place, `is beyond ${kEmbeddedBytes / 1e6} MB of models`);
    read.set(name, content);
  }
  return read;
}

function bytesOfBase64(base64: string): Uint8Array<ArrayBuffer> | undefined {
  try {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < bytes.length; ++i) bytes[i] = text.charCodeAt(i);
    return bytes;
  } catch {
    return undefined;
  }
}
