// The viewer application: shows the world or scene that the page's address names (?world= or ?scene=, otherwise the
// folder `scene` beside the page).
import { TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { ChosenFiles } from '../scene-files';
import { addHiding } from './hiding/hiding-tool';
import { HiddenParts } from './hiding/hidden-parts';
import { addBookmarks, makeBookmarks } from './views/bookmarks';
import { element } from './page/element';
import { addHelp } from './page/help';
import { addHeadset } from './headset/headset-tool';
import { addMeasuring } from './measuring/measuring';
import { Models } from './models/models';
import { addModels } from './models/models-tool';
import { kModes } from './moving/navigation';
import { addNavigationTools } from './moving/navigation-tools';
import { ErrorPanel, LoadingPanel, StatisticsPanel } from './page/panels';
import { addScreenshot } from './views/screenshot';
import { addSettings } from './settings';
import { Shortcuts } from './page/shortcuts';
import { Toolbar } from './page/toolbar';
import { formatView, parseView } from './views/view-address';
import { makeRenderer, Viewer } from './viewer';
import { addressOfMain, fetchWorld, Worlds } from './world/worlds';
import './page/style.css';

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
  const asked = new URLSearchParams(location.search).get('world');
  const world = asked === null || location.protocol === 'file:' ? undefined : await fetchWorld(asked);
  const address = world ? addressOfMain(world) : sceneOfAddress();
  const city = location.protocol === 'file:' ? await chooseScene() : await TesseraScene.load(address);
  city.onError = fail;
  document.title = city.name === '' ? 'tessera' : `${city.name} · tessera`;
  const viewer = new Viewer(canvas, renderer, city);
  const shortcuts = new Shortcuts();
  shortcuts.areSuspended = () => viewer.isPaused;
  const toolbar = new Toolbar(document.body, shortcuts);
  addNavigationTools(viewer, toolbar, shortcuts);
  addMeasuring(viewer, toolbar, shortcuts);
  const [models, hidden, bookmarks] = [new Models(viewer), new HiddenParts(viewer), makeBookmarks(viewer)];
  const worlds = new Worlds(viewer, models, hidden, bookmarks);
  addModels(viewer, models, worlds, toolbar, shortcuts, fail);
  addHiding(viewer, hidden, toolbar, shortcuts);
  addBookmarks(viewer, bookmarks, toolbar);
  addScreenshot(viewer, toolbar);
  addSettings(viewer, toolbar);
  toolbar.add({ name: 'Numbers', key: 'i', icon: 'chart', opened: () => {
    statistics.toggle();
    viewer.needPicture();
  } });
  addHelp(toolbar, shortcuts);
  void addHeadset(viewer, toolbar, shortcuts, fail); // not awaited, as it may take long
  keepViewInAddress(viewer);
  viewer.onFrame.add((frame) => {
    const numbers = viewer.statistics;
    if (!viewer.scenes.some(({ visible }) => visible)) loading.hide();
    if (!numbers) return;
    loading.show(city.name, numbers, viewer.idle);
    statistics.show(numbers, frame);
  });
  if (world) await worlds.open(world, fail);
}

function sceneOfAddress(): string {
  return new URLSearchParams(location.search).get('scene') ?? 'scene/tileset.json';
}

// A page that was not served can only read files that the user chooses.
async function chooseScene(): Promise<TesseraScene> {
  loading.hide();
  const input = element('input');
  Object.assign(input, { type: 'file', webkitdirectory: true, multiple: true });
  const panel = element(
    'div', 'glass choose', element('h1', '', 'tessera'), element('p', '', 'Choose the folder of a scene. Nothing leaves this computer.'),
    element('label', 'button', 'Choose folder', input));
  document.body.append(panel);
  for (;;) {
    const files = await new Promise<File[]>((resolve) => (input.onchange = () => resolve([...input.files!])));
    input.value = ''; // so that the same folder can be chosen again
    try {
      const city = await TesseraScene.load(new ChosenFiles(files));
      panel.remove();
      errors.hide();
      return city;
    } catch (error) {
      fail(error);
    }
  }
}

// The address always contains the current view, so that it can be shared, and a view in the address is shown.
function keepViewInAddress(viewer: Viewer): void {
  const show = () => {
    const view = parseView(location.hash);
    if (!view) return;
    const mode = kModes.find((one) => one === new URLSearchParams(location.hash.slice(1)).get('mode'));
    if (mode) viewer.navigation.mode = mode;
    viewer.view = view;
  };
  const address = () => `${formatView(viewer.view)}&mode=${viewer.navigation.mode}`;
  show();
  addEventListener('hashchange', show);
  let waiting: ReturnType<typeof setTimeout> | undefined;
  let written = '';
  viewer.onFrame.add(() => {
    const now = address();
    if (now === written) return;
    written = now;
    clearTimeout(waiting);
    waiting = setTimeout(() => history.replaceState(null, '', `#${now}`), 400); // browsers limit how often the address changes
  });
}

start().catch(fail);
