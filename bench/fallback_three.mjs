// node fallback_three.mjs SCENE FOLDER: draws the views of FOLDER/views.json with three.js in Debian's Chromium, through the
// ordinary meshes of all contents of the scene's finest level, into FOLDER/VIEW-three.png, which are transparent where there is
// no triangle. Prints the number of triangles in each content as JSON. See mesh.sh.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const { chromium } = createRequire(new URL('../web/package.json', import.meta.url))('playwright-core');
const [scene, folder] = process.argv.slice(2);
const { contents, views, near, far } = JSON.parse(readFileSync(join(folder, 'views.json'), 'utf8'));
const roots = { three: fileURLToPath(new URL('../web/node_modules/three', import.meta.url)), scene };
const page = `<!doctype html><script type="importmap">
  {"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}
</script><script type="module">
  import * as THREE from 'three';
  import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
  Object.assign(window, { THREE, GLTFLoader });
</script>`;
const types = { js: 'text/javascript', png: 'image/png', glb: 'model/gltf-binary' };

const browser = await chromium.launch({
  executablePath: process.env.TESSERA_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const tab = await browser.newPage();
const said = [];
tab.on('console', (message) => message.type() === 'error' && said.push(message.text()));
tab.on('pageerror', (error) => said.push(error.message));
await tab.route('http://bench.test/**', (route) => {
  const path = normalize(new URL(route.request().url()).pathname);
  if (path === '/') return route.fulfill({ contentType: 'text/html', body: page });
  const [, root, ...rest] = path.split('/');
  if (!(root in roots)) return route.fulfill({ status: 404 });
  return route.fulfill({ contentType: types[path.split('.').pop()], body: readFileSync(join(roots[root], ...rest)) });
});
await tab.goto('http://bench.test/');
await tab.waitForFunction(() => 'GLTFLoader' in window);

const triangles = await tab.evaluate(async (uris) => {
  window.world = new THREE.Scene();
  const counts = [];
  for (const uri of uris) {
    const { scene } = await new GLTFLoader().loadAsync(`/scene/${uri}`);
    let count = 0;
    scene.traverse((node) => (count += node.isMesh ? node.geometry.index.count / 3 : 0));
    counts.push(count);
    world.add(scene);
  }
  window.renderer = new THREE.WebGLRenderer({ alpha: true, preserveDrawingBuffer: true });
  renderer.setClearColor(0, 0);
  return counts;
}, contents.map(({ uri }) => uri));

for (const view of views) {
  const url = await tab.evaluate(({ view, near, far }) => {
    const { width, height, focal, centre } = view;
    renderer.setSize(width, height);
    const camera = new THREE.PerspectiveCamera();
    const left = (-near * centre[0]) / focal[0];
    const top = (near * centre[1]) / focal[1];
    const matrix = new THREE.Matrix4().fromArray(view.matrix);
    matrix.decompose(camera.position, camera.quaternion, camera.scale);
    camera.projectionMatrix.makePerspective(
      left, left + (near * width) / focal[0], top, top - (near * height) / focal[1], near, far);
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    renderer.render(world, camera);
    return renderer.domElement.toDataURL();
  }, { view, near, far });
  writeFileSync(join(folder, `${view.name}-three.png`), Buffer.from(url.slice(url.indexOf(',') + 1), 'base64'));
}
await browser.close();
if (said.length > 0) throw new Error(said.join('\n'));
console.log(JSON.stringify(triangles));
