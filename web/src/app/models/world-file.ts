// world.json: which models stand where in a scene. Untrusted text.
//
// Places are in the capture's world: z up, right-handed. A model is in metres, turned from y up to z up, so that without a
// rotation it stands upright. `files` may hold the models' files themselves, in base64.
import { SceneError } from '../../scene-error';
import { arrayOf, fieldOf, flagOf, numbersOf, stringOf, type Json } from '../../tiles/json-fields';

export const kWorldName = 'world.json';
export const kEmbeddedBytes = 128 * 1000 * 1000; // of all models that one file may hold
export const kWorldBytes = 1.4 * kEmbeddedBytes; // of the file itself
const kKind = 'tessera world';
const kVersion = 1;
const kMostModels = 1000;
const kMostFiles = 1000;
const kNameLength = 1000;
const kFarthest = 1e7; // metres
const kScales = { least: 1e-6, most: 1e6 };

type Three = [number, number, number];

export interface WorldModel {
  name: string;
  files: string[]; // the model's own first, then those it needs
  position: Three;
  rotation: [number, number, number, number]; // a quaternion: x, y, z, w
  scale: Three;
  visible: boolean;
}

export interface World {
  scene: { name: string; url: string };
  models: WorldModel[];
  files: Map<string, Uint8Array<ArrayBuffer>>; // those that are in it
}

// A model a line. `files`: base64, by name.
export function encodeWorld({ scene, models }: Omit<World, 'files'>, files: ReadonlyMap<string, string>): string {
  const lines = (all: string[]) => (all.length > 0 ? `\n${all.join(',\n')}\n` : '');
  const held = [...files].map(([name, base64]) => `${JSON.stringify(name)}:"${base64}"`);
  const fields = [
    `"kind":${JSON.stringify(kKind)},"version":${kVersion}`,
    `"scene":${JSON.stringify(scene)}`,
    `"models":[${lines(models.map((model) => JSON.stringify(model)))}]`,
    ...(held.length > 0 ? [`"files":{${lines(held)}}`] : []),
  ];
  return `{${fields.join(',\n')}}\n`;
}

// Throws SceneError that names `file`, and where in it the first thing is wrong.
export function decodeWorld(text: string, file: string): World {
  const fail = (place: string, reason: string, remedy = 'save it again'): never => {
    throw new SceneError(file, place, reason, remedy);
  };
  if (text.length > kWorldBytes) fail('', `is larger than ${kWorldBytes / 1e6} MB`, 'save it without its models');
  let world: Json;
  try {
    world = JSON.parse(text);
  } catch {
    return fail('', 'is not JSON');
  }
  if (stringOf(world, 'kind') !== kKind) fail('', 'is no world of this viewer', 'choose one that was saved here');
  if (fieldOf(world, 'version') !== kVersion) fail('version', `is not ${kVersion}`, 'open it with a newer viewer');
  const scene = fieldOf(world, 'scene');
  const models = arrayOf(world, 'models') ?? fail('models', 'is no list');
  if (models.length > kMostModels) fail('models', `are more than ${kMostModels}`, 'keep fewer');
  return {
    scene: { name: stringOf(scene, 'name') ?? '', url: stringOf(scene, 'url') ?? '' },
    models: models.map((model, i) => modelOf(model, (key, reason) => fail(`models[${i}]${key}`, reason))),
    files: filesOf(fieldOf(world, 'files'), fail),
  };
}

function modelOf(model: Json, fail: (key: string, reason: string) => never): WorldModel {
  const numbers = (key: string, count: number, most: number): number[] => {
    const read = numbersOf(model, key, count) ?? fail(`.${key}`, `is not ${count} numbers`);
    return read.every((x) => Math.abs(x) <= most) ? read : fail(`.${key}`, `has a number beyond ${most}`);
  };
  const files = arrayOf(model, 'files');
  if (!files || files.length === 0 || files.length > kMostFiles) return fail('.files', 'names no files, or too many');
  if (!files.every((one): one is string => isName(one))) return fail('.files', 'has a name that is none');
  const name = stringOf(model, 'name');
  if (!isName(name)) return fail('.name', 'is missing, or too long');
  const rotation = numbers('rotation', 4, 1.01);
  const length = Math.hypot(...rotation);
  if (Math.abs(length - 1) > 0.01) fail('.rotation', 'is no rotation');
  const scale = numbers('scale', 3, kScales.most);
  if (!scale.every((x) => x >= kScales.least)) fail('.scale', `is not above ${kScales.least}`);
  return {
    name, files, scale: scale as Three,
    position: numbers('position', 3, kFarthest) as Three,
    rotation: rotation.map((x) => x / length) as WorldModel['rotation'],
    visible: flagOf(model, 'visible') ?? true,
  };
}

function isName(name: Json): name is string {
  return typeof name === 'string' && name !== '' && name.length <= kNameLength;
}

function filesOf(files: Json, fail: (place: string, reason: string) => never): World['files'] {
  const read: World['files'] = new Map();
  if (files === undefined) return read;
  if (typeof files !== 'object' || files === null || Array.isArray(files)) return fail('files', 'is no object');
  let bytes = 0;
  for (const [name, text] of Object.entries(files)) {
    const place = `files[${JSON.stringify(name.slice(0, 100))}]`;
    if (!isName(name) || read.size === kMostModels * 4) fail(place, 'is one file too many, or has no name');
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
