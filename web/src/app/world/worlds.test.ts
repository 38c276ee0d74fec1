import * as THREE from 'three';
import { beforeEach, describe, expect, it, vi } from 'vitest';
import { testGlb } from '../../testing/test-glb';
import type { HiddenParts } from '../hiding/hidden-parts';
import { loadModel } from '../models/load-model';
import type { ModelFile } from '../models/model-files';
import { Models, type ModelSource } from '../models/models';
import type { Bookmarks } from '../views/bookmarks';
import type { Viewer } from '../viewer';
import { computeContentId } from './file-content';
import { decodeWorld } from './world-file';
import { Worlds } from './worlds';

vi.stubGlobal('location', { href: 'https://a/' });
// Mocks what needs a GPU.
vi.mock('../../scene', () => ({ TesseraScene: {} }));
vi.mock('../models/model-light', () => ({ addLight: () => {} }));

const file = (path: string, content: BlobPart) => ({ path, file: new Blob([content]) });
const place = { position: [0, 0, 0], rotation: [0, 0, 0, 1], scale: [1, 1, 1] };
const model = (path: string, contents: string[] = []) => ({ name: path, files: [path], contents, ...place });
const makeWorldFile = (models: unknown[], more = {}) =>
  file('world.json', JSON.stringify({ kind: 'tessera world', version: 2, scenes: [{ name: 'city', url: 'city.scene' }], models, ...more }));

describe('Worlds', () => {
  let models: Models;
  let worlds: Worlds;
  let changes: number;
  let city: THREE.Object3D;

  beforeEach(() => {
    city = Object.assign(new THREE.Object3D(), {
      name: 'city', files: { name: 'https://a/city.scene/tileset.json' }, tileset: {}, bounds: new THREE.Box3().setFromCenterAndSize(new THREE.Vector3(), new THREE.Vector3(9, 9, 9)),
    });
    const viewer = { city, scenes: [city], world: new THREE.Scene(), onFrame: new Set(), needPicture: () => {}, changedScenes: () => {} } as unknown as Viewer;
    models = new Models(viewer);
    changes = told.length = 0;
    models.onChange.add(() => ++changes);
    worlds = new Worlds(viewer, models, { list: [], show: () => {} } as unknown as HiddenParts, { list: [], showWorld: () => {} } as unknown as Bookmarks);
  });

  const told: string[] = [];
  const open = (world: ModelFile, files: ModelFile[]) => worlds.openFile(world, files, (error) => told.push(String(error)));
  const widths = () => models.list.map(({ source }: { source: ModelSource }) => source.size.x);

  it("show each model's own file if several have one name", async () => {
    const cubes = [1, 2].map((edge) => file('cube.glb', testGlb({ edge })));
    const contents = await Promise.all(cubes.map((cube) => computeContentId(cube.file)));
    await open(makeWorldFile(contents.map((content) => model('cube.glb', [content]))), cubes);
    expect(widths()).toEqual([1, 2]);
    expect(changes).toBe(1);
    await open(makeWorldFile(contents.map((content) => model('cube.glb', [content]))), []);
    expect(changes).toBe(2);
  });

  it('are opened one after the other', async () => {
    const cube = (edge: number) => file('cube.glb', testGlb({ edge }));
    const slow = cube(1);
    let read = () => {};
    const reading = new Promise<void>((resolve) => (read = resolve));
    slow.file.arrayBuffer = async () => {
      await reading;
      return Blob.prototype.arrayBuffer.call(slow.file);
    };
    const first = open(makeWorldFile([model('cube.glb')]), [slow]);
    const lacking = open(makeWorldFile([model('lost.glb')]), []);
    const last = open(makeWorldFile([model('cube.glb')], { bookmarks: [] }), [cube(2)]);
    await new Promise((resolve) => setTimeout(resolve, 50));
    expect(widths()).toEqual([]);
    read();
    await first;
    expect(widths()).toEqual([1]);
    await lacking;
    expect(told).toHaveLength(1);
    expect(widths()).toEqual([]);
    await last;
    expect(widths()).toEqual([2]);
  });

  it('are shown without missing items, which are reported and saved all the same', async () => {
    const cube = file('cube.glb', testGlb({ edge: 2 }));
    await open(makeWorldFile([model('lost.glb'), model('cube.glb')]), [cube]);
    expect(widths()).toEqual([2]);
    expect(told).toEqual(['SceneError: world.json: models[0]: needs lost.glb; drop it together with world.json']);
    const { models: saved } = decodeWorld(await (await worlds.save(false)).text(), 'a');
    expect(saved.map(({ name }) => name)).toEqual(['cube.glb', 'lost.glb']);
  });

  it('are saved so that they can be opened again', async () => {
    const [nameless, other] = ['.glb', 'x.glb'].map((path) => file(path, testGlb({ edge: 2 })));
    for (const main of [nameless, nameless, other]) models.add(Models.makeSource(await loadModel(main, [main])));
    expect(models.list.map(({ name }) => name)).toEqual(['Model', 'Model 2', 'x']);
    expect(models.freeName('x'.repeat(1000)).length).toBeLessThan(1000);
    const { models: saved } = decodeWorld(await (await worlds.save(false)).text(), 'a');
    expect(saved.map(({ name }) => name)).toEqual(['Model', 'Model 2', 'x']);
  });

  it('are not saved where they could not be opened again', async () => {
    const cube = file('cube.glb', testGlb({ edge: 2 }));
    const model = models.add(Models.makeSource(await loadModel(cube, [cube])));
    model.scale.x = 2e6;
    await expect(worlds.save(false)).rejects.toThrow(
      'world.json: models[0].scale: has a number beyond 1000000, so that it could not be opened again; change that, and save again');
    model.scale.x = 1;
    await worlds.save(false);
    for (let i = 0; i < 1000; ++i) models.list.push(model);
    await expect(worlds.save(false)).rejects.toThrow('world.json: models: are more than 1000, so that');
  });
});
