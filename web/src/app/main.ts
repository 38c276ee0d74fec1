// The viewer: a page that shows the scene which its address names (?scene=, else the folder scene beside it).
import { TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { addNavigationTools } from './navigation-tools';
import { ErrorPanel, LoadingPanel, StatisticsPanel } from './panels';
import { Shortcuts } from './shortcuts';
import { Toolbar } from './toolbar';
import { makeRenderer, Viewer } from './viewer';
import './style.css';

const canvas = document.querySelector<HTMLCanvasElement>('#view')!;
const loading = new LoadingPanel(document.body);
const errors = new ErrorPanel(document.body);
const statistics = new StatisticsPanel(document.body);

function fail(error: unknown): void {
  loading.hide();
  errors.show(error instanceof SceneError ? error : new SceneError('viewer', '', String(error), 'reload the page'));
}

async function start(): Promise<void> {
  const renderer = makeRenderer(canvas);
  const url = new URLSearchParams(location.search).get('scene') ?? 'scene/tileset.json';
  const city = await TesseraScene.load(url);
  city.onError = fail;
  document.title = city.name === '' ? 'tessera' : `${city.name} · tessera`;
  const viewer = new Viewer(canvas, renderer, city);
  const shortcuts = new Shortcuts();
  const toolbar = new Toolbar(document.body, shortcuts);
  addNavigationTools(viewer, toolbar, shortcuts);
  toolbar.add({ name: 'Numbers', key: 'i', icon: 'chart', opened: () => {
    statistics.toggle();
    viewer.needPicture();
  } });
  viewer.onFrame.add(({ milliseconds, resolutionScale }) => {
    const numbers = city.statistics;
    if (!numbers) return;
    loading.show(city.name, numbers, city.idle);
    statistics.show(numbers, milliseconds, resolutionScale);
  });
}

start().catch(fail);
