// The viewer: a page that shows the scene which its address names (?scene=, else the folder scene beside it).
import * as THREE from 'three';
import { MapControls } from 'three/addons/controls/MapControls.js';
import { TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { ErrorPanel, LoadingPanel, StatisticsPanel } from './panels';
import { Resolution } from './resolution';
import './style.css';

const canvas = document.querySelector<HTMLCanvasElement>('#view')!;
const loading = new LoadingPanel(document.body);
const errors = new ErrorPanel(document.body);
const statistics = new StatisticsPanel(document.body);

function fail(error: unknown): void {
  loading.hide();
  errors.show(error instanceof SceneError ? error : new SceneError('viewer', '', String(error), 'reload the page'));
}

function makeRenderer(): THREE.WebGLRenderer {
  try {
    return new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' });
  } catch {
    throw new SceneError('browser', '', 'has no WebGL 2', 'allow hardware acceleration in its settings, or use another');
  }
}

// Above and beside the middle, so that all of the scene is in view.
function lookAtAll(camera: THREE.PerspectiveCamera, controls: MapControls, bounds: THREE.Box3): void {
  const size = bounds.getSize(new THREE.Vector3());
  const radius = 0.5 * Math.hypot(size.x, size.z);
  bounds.getCenter(controls.target);
  controls.target.y = bounds.min.y;
  camera.position.copy(controls.target).add(new THREE.Vector3(0, 0.75, 0.8).multiplyScalar(radius));
  camera.near = radius / 1e4;
  camera.far = radius * 100;
  camera.updateProjectionMatrix();
  controls.maxDistance = 6 * radius;
  controls.minDistance = radius / 200;
  controls.update();
}

async function start(): Promise<void> {
  const renderer = makeRenderer();
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  const url = new URLSearchParams(location.search).get('scene') ?? 'scene/tileset.json';
  const city = await TesseraScene.load(url);
  city.onError = fail;
  document.title = city.name === '' ? 'tessera' : `${city.name} · tessera`;
  const world = new THREE.Scene();
  world.background = city.background;
  world.add(city);
  const camera = new THREE.PerspectiveCamera(50);
  const controls = new MapControls(camera, canvas);
  controls.enableDamping = true;
  controls.maxPolarAngle = 0.495 * Math.PI;
  lookAtAll(camera, controls, city.bounds);
  const resolution = new Resolution();
  const resize = () => {
    renderer.setSize(innerWidth, innerHeight, false);
    camera.aspect = innerWidth / innerHeight;
    camera.updateProjectionMatrix();
    needed = true;
  };
  let needed = true; // a picture, though nothing moves
  let wasWhole = false; // the last picture was
  let wasMoving = false; // when it was drawn
  let before = performance.now();
  addEventListener('resize', resize);
  addEventListener('keydown', ({ key }) => {
    if (key === 'i') statistics.toggle();
    needed = true;
  });
  controls.addEventListener('change', () => resolution.moved(performance.now()));
  resize();
  renderer.setAnimationLoop(() => {
    const now = performance.now();
    const isMoving = !resolution.isResting(now);
    const took = now - before;
    before = now;
    controls.update();
    if (!isMoving && wasWhole && city.idle && !needed) return;
    if (isMoving && wasMoving) resolution.took(took);
    wasMoving = isMoving;
    city.resolutionScale = resolution.scale(now);
    city.update(camera, renderer);
    renderer.render(world, camera);
    needed = false;
    wasWhole = city.resolutionScale === 1;
    const numbers = city.statistics!;
    loading.show(city.name, numbers, city.idle);
    statistics.show(numbers, took, city.resolutionScale);
  });
}

start().catch(fail);
