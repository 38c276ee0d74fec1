// world.json: which scenes, models, hidden parts and views make a world (docs/world-format.md). Untrusted text.
import { kMostHiddenBoxes } from '../../draw/hidden-boxes';
import { SceneError } from '../../scene-error';
import { arrayOf, fieldOf, flagOf, stringOf, type Json } from '../../tiles/json-fields';
import { parseView } from '../views/view-address';
import { isAddress, isFileAddress } from './world-address';
import { checkedName, kFarthest, kNameLength, numberWithin, numbersWithin, quaternionOf, scalesOf, type Fail, type Four, type Three } from './world-fields';

export const kWorldName = 'world.json';
export const kEmbeddedBytes = 128 * 1000 * 1000; // of all models that one file may hold
export const kWorldBytes = 1.4 * kEmbeddedBytes; // of the file itself
const kKind = 'tessera world';
const kVersion = 2;
export const kMost = { scenes: 16, models: 1000, hidden: kMostHiddenBoxes, bookmarks: 200 };
const kMostFiles = 1000; // of a model
export const kMostFilesHeld = 4000; // of all models

export interface WorldScene {
  name: string;
  url: string; // of its tileset.json or the folder of that, maybe relative; '' where nobody knows
  place?: { position: Three; rotation: Four; scale: number }; // without: its world is this one
  visible: boolean;
}

export interface WorldModel {
  name: string;
  files: string[]; // the model's own first, then those it needs
  contents: string[]; // of each of them (file-content.ts); empty where nobody knows
  position: Three;
  rotation: Four; // a quaternion: x, y, z, w
  scale: Three;
  visible: boolean;
  plays: boolean;
}

export interface HiddenPart {
  name: string;
  middle: Three;
  size: Three;
  turn: number; // about the vertical, radians, anticlockwise from above
  hides: boolean; // false: it is shown for now
}

export interface World {
  scenes: WorldScene[]; // the first without a place is the one in whose world all stands
  models: WorldModel[];
  hidden: HiddenPart[];
  bookmarks: { name: string; view: string }[]; // as the page's address has views
  files: Map<string, Uint8Array<ArrayBuffer>>; // those that are in it
}

export function mainScene({ scenes }: Pick<World, 'scenes'>): WorldScene {
  return scenes.find(({ place }) => !place)!;
}

// A scene, a model, a part, a view a line. `files`: base64, by name.
export function encodeWorld({ scenes, models, hidden, bookmarks }: Omit<World, 'files'>, files: ReadonlyMap<string, string>): string {
  const lines = (all: string[]) => (all.length > 0 ? `\n${all.join(',\n')}\n` : '');
  const list = (name: string, all: unknown[]) => `"${name}":[${lines(all.map((one) => JSON.stringify(one)))}]`;
  const held = [...files].map(([name, base64]) => `${JSON.stringify(name)}:"${base64}"`);
  const fields = [
    `"kind":${JSON.stringify(kKind)},"version":${kVersion}`,
    list('scenes', scenes.map(({ name, url, place, visible }) => ({ name, url, ...place, visible }))),
    list('models', models),
    list('hidden', hidden),
    list('bookmarks', bookmarks),
    ...(held.length > 0 ? [`"files":{${lines(held)}}`] : []),
  ];
  return `{${fields.join(',\n')}}\n`;
}

// world.json. Throws SceneError where it could not be opened again.
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

// Throws SceneError that names `file`, and where in it the first thing is wrong.
export function decodeWorld(text: string, file: string): World {
  const fail = (place: string, reason: string, remedy = 'correct it, or save it again'): never => {
    throw new SceneError(file, place, reason, remedy);
  };
  if (text.length > kWorldBytes) fail('', `is larger than ${kWorldBytes / 1e6} MB`, 'save it without its models');
  let world: Json;
  try {
    world = JSON.parse(text);
  } catch (error) {
    return fail('', `is not JSON: ${(error as Error).message.slice(0, 200)}`); // with the place, in most browsers
  }
  if (stringOf(world, 'kind') !== kKind) fail('', 'is no world of this viewer', 'choose one that was saved here');
  const version = fieldOf(world, 'version');
  if (version !== 1 && version !== kVersion) fail('version', `is not ${kVersion}, nor 1`, 'open it with a newer viewer');
  const listOf = <T>(key: 'scenes' | 'models' | 'hidden' | 'bookmarks', isNeeded: boolean, read: (one: Json, fail: Fail) => T): T[] => {
    if (fieldOf(world, key) === undefined && !isNeeded) return [];
    const list = arrayOf(world, key) ?? fail(key, 'is no list');
    if (list.length > kMost[key]) fail(key, `are more than ${kMost[key]}`, 'keep fewer');
    return list.map((one, i) => read(one, (place, reason) => fail(`${key}[${i}]${place}`, reason)));
  };
  const scenes = version === 1 ? [firstScene(fieldOf(world, 'scene'))] : listOf('scenes', true, sceneOf);
  if (!scenes.some(({ place }) => !place)) fail('scenes', 'has none in whose world the others stand', 'leave out position, rotation and scale of one');
  return {
    scenes,
    models: listOf('models', version === 1, modelOf),
    hidden: listOf('hidden', false, hiddenOf),
    bookmarks: listOf('bookmarks', false, bookmarkOf),
    files: filesOf(fieldOf(world, 'files'), fail),
  };
}

// Of version 1, which knew one scene, and did not look where it is.
function firstScene(scene: Json): WorldScene {
  const url = stringOf(scene, 'url') ?? '';
  return { name: (stringOf(scene, 'name') ?? '').slice(0, kNameLength), url: isAddress(url) ? url : '', visible: true };
}

function sceneOf(scene: Json, fail: Fail): WorldScene {
  if (typeof scene !== 'object' || scene === null || Array.isArray(scene)) return fail('', 'is no object');
  const url = stringOf(scene, 'url') ?? '';
  if (url.length > kNameLength || (url !== '' && !isAddress(url))) return fail('.url', 'is no address of http or https, nor a relative one');
  const name = stringOf(scene, 'name') ?? '';
  if (name.length > kNameLength) return fail('.name', 'is too long');
  const isPlaced = ['position', 'rotation', 'scale'].some((key) => fieldOf(scene, key) !== undefined);
  const has = (key: string) => fieldOf(scene, key) !== undefined;
  return {
    name, url, visible: flagOf(scene, 'visible') ?? true,
    ...(isPlaced && {
      place: {
        position: has('position') ? numbersWithin(scene, 'position', 3, kFarthest, fail) as Three : [0, 0, 0],
        rotation: has('rotation') ? quaternionOf(scene, fail) : [0, 0, 0, 1],
        scale: has('scale') ? scalesOf([fieldOf(scene, 'scale')], '.scale', fail)[0] : 1,
      },
    }),
  };
}

function modelOf(model: Json, fail: Fail): WorldModel {
  const files = arrayOf(model, 'files');
  if (!files || files.length === 0 || files.length > kMostFiles) return fail('.files', 'names no files, or too many');
  const isFile = (one: Json): one is string => typeof one === 'string' && one !== '' && one.length <= kNameLength && isFileAddress(one);
  if (!files.every(isFile)) return fail('.files', 'has a name that is none');
  const contents = arrayOf(model, 'contents') ?? [];
  if (contents.length > files.length || !contents.every((one) => typeof one === 'string')) return fail('.contents', 'is not one text for each file');
  return {
    files, contents: contents as string[], name: checkedName(model, fail),
    position: numbersWithin(model, 'position', 3, kFarthest, fail) as Three,
    rotation: quaternionOf(model, fail),
    scale: scalesOf(numbersWithin(model, 'scale', 3, Infinity, fail), '.scale', fail) as Three,
    visible: flagOf(model, 'visible') ?? true,
    plays: flagOf(model, 'plays') ?? true,
  };
}

function hiddenOf(part: Json, fail: Fail): HiddenPart {
  return {
    name: checkedName(part, fail),
    middle: numbersWithin(part, 'middle', 3, kFarthest, fail) as Three,
    size: scalesOf(numbersWithin(part, 'size', 3, Infinity, fail), '.size', fail) as Three,
    turn: fieldOf(part, 'turn') === undefined ? 0 : numberWithin(part, 'turn', 1000, fail),
    hides: flagOf(part, 'hides') ?? true,
  };
}

function bookmarkOf(bookmark: Json, fail: Fail): World['bookmarks'][number] {
  const view = stringOf(bookmark, 'view') ?? '';
  if (view.length > kNameLength || !parseView(view)) return fail('.view', 'is no view, as eye=x,y,z&target=x,y,z');
  return { name: checkedName(bookmark, fail), view };
}

function filesOf(files: Json, fail: (place: string, reason: string) => never): World['files'] {
  const read: World['files'] = new Map();
  if (files === undefined) return read;
  if (typeof files !== 'object' || files === null || Array.isArray(files)) return fail('files', 'is no object');
  let bytes = 0;
  for (const [name, text] of Object.entries(files)) {
    const place = `files[${JSON.stringify(name.slice(0, 100))}]`;
    if (name === '' || name.length > kNameLength || read.size === kMostFilesHeld) fail(place, 'is one file too many, or has no name');
    if (typeof text !== 'string') return fail(place, 'is no text');
    const content = bytesOfBase64(text) ?? fail(place, 'is no base64');
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
