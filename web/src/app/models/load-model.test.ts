import * as THREE from 'three';
import { describe, expect, it, vi } from 'vitest';
import { SceneError } from '../../scene-error';
import { testGlb } from '../../testing/test-glb';
import { kModelBytes, loadModel } from './load-model';
import { prepareModel } from './model-materials';
import { Models, PlacedModel } from './models';

const given = (path: string, content: BlobPart) => ({ path, file: new Blob([content]) });

async function said(path: string, content: BlobPart | Blob): Promise<string> {
  const main = { path, file: content instanceof Blob ? content : new Blob([content]) };
  const error = await loadModel(main, [main]).then(() => undefined, (one: unknown) => one);
  expect(error).toBeInstanceOf(SceneError);
  return (error as SceneError).message;
}

describe('loadModel', () => {
  it('reads a cube in its own size', async () => {
    const main = given('a/cube.glb', testGlb({ edge: 3 }));
    const { box, files, lacking } = await loadModel(main, [main, given('a/other.txt', '')]);
    expect([box.min.toArray(), box.max.toArray()]).toEqual([[-1.5, -1.5, -1.5], [1.5, 1.5, 1.5]]);
    expect([files, lacking]).toEqual([[main], []]);
  });

  it('reports missing materials', async () => {
    const triangle = 'mtllib red.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n';
    const [main, library] = [given('a/x.obj', triangle), given('a/red.mtl', 'newmtl red\nKd 1 0 0\n')];
    expect((await loadModel(main, [main])).lacking).toEqual(['red.mtl']);
    expect((await loadModel(main, [main, library])).lacking).toEqual([]);
    expect((await loadModel(main, [main, { ...library, path: 'a/other.mtl' }])).lacking).toEqual([]);
  });

  it('names the file that is broken, and what is wrong', async () => {
    vi.spyOn(console, 'error').mockImplementation(() => {});
    expect(await said('a/x.fbx', 'garbage')).toBe('x.fbx: cannot be read: Unknown format; export it again, as GLB if you can');
    expect(await said('x.obj', 'garbage')).toContain('x.obj: holds nothing to draw');
    expect(await said('x.obj', 'v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n')).toContain('x.obj: has no size that makes sense');
    expect(await said('x.obj', 'v 1e30 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n')).toContain('x.obj: has no size that makes sense');
    expect(await said('x.glb', testGlb({ edge: 1, change: (gltf) => (gltf.meshes[0].primitives[0].attributes.POSITION = 77) }))).toContain('x.glb: cannot be read');
    expect(await said('x.glb', testGlb({ edge: 1, change: (gltf) => (gltf.accessors[0].count = 1e6) }))).toContain('x.glb: cannot be read');
    vi.restoreAllMocks();
  });

  it('rejects files that are too large, nested too deep, or gone', async () => {
    const large = Object.assign(new Blob(), {});
    Object.defineProperty(large, 'size', { value: kModelBytes + 1 });
    expect(await said('x.glb', large)).toContain('x.glb: is larger than 512 MB');
    const nodes = Array.from({ length: 500 }, (_, i) => (i < 499 ? { children: [i + 1] } : { mesh: 0 }));
    expect(await said('x.glb', testGlb({ edge: 1, change: (gltf) => (gltf.nodes = nodes) }))).toContain('is nested too deep');
    const gone = Object.assign(new Blob(['a']), { arrayBuffer: () => Promise.reject(new Error('gone')) });
    expect(await said('x.glb', gone)).toContain('x.glb: could not be read');
  });
});

it('animates copies of unnamed objects', () => {
  const arm = new THREE.Mesh(new THREE.BoxGeometry(), new THREE.MeshPhongMaterial());
  const object = new THREE.Group().add(arm);
  const track = new THREE.VectorKeyframeTrack(`${arm.uuid}.position`, [0, 1], [0, 0, 0, 4, 0, 0]);
  const source = Models.makeSource({ object, box: prepareModel(object), clips: [new THREE.AnimationClip('', 1, [track])], files: [], lacking: [] });
  const model = new PlacedModel(source, 'a');
  model.mixer!.update(0.5);
  let copy: THREE.Mesh | undefined;
  model.traverse((one) => (one as THREE.Mesh).isMesh && (copy = one as THREE.Mesh));
  expect(copy).not.toBe(arm);
  expect(copy!.position.x).toBeCloseTo(2);
  expect(copy!.material).toBeInstanceOf(THREE.MeshStandardMaterial);
});
