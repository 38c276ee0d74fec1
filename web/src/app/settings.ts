// The panel for display and quality settings.
import type { ShownMode } from '../draw/display-modes';
import type { DisplayMode } from '../representations/drawers';
import { element } from './page/element';
import type { Toolbar } from './page/toolbar';
import type { Viewer } from './viewer';

const kResolutions: [string, number | undefined][] = [
  ['Automatic', undefined], ['100 %', 1], ['75 %', 0.75], ['50 %', 0.5], ['25 %', 0.25],
];

export function addSettings(viewer: Viewer, toolbar: Toolbar): void {
  const { city, scenes, camera, resolution } = viewer;
  const changed = <T>(change: (value: T) => void) => (value: T) => {
    change(value);
    viewer.needPicture();
  };
  const levels = Array.from({ length: city.tileset.levels }, (_, level): [string, number] => [level === 0 ? 'All' : `Level ${level} and coarser`, level]);
  const { modes } = city.shows;
  const featureLevel = makeFeatureLevelChoice(viewer, changed((level) => scenes.forEach((scene) => (scene.featureLevel = level))));
  const lens = slider('Field of view', 15, 100, camera.fov, 1, (x) => `${x}°`, changed((x) => {
    camera.fov = x;
    camera.updateProjectionMatrix();
  }));
  const mebibytes = (x: number) => `${Math.round(2 ** x)} MiB`;
  const memory = slider('Graphics memory', 6, 13, Math.log2(viewer.gpuBytes / 2 ** 20), 0.5, mebibytes,
    changed((x) => (viewer.gpuBytes = 2 ** x * 2 ** 20)));
  const panel = element(
    'div', '',
    choice('Show', modes.map((mode): [string, ShownMode<DisplayMode>] => [mode.label, mode]),
      changed((mode) => {
        scenes.forEach((scene) => (scene.display = mode.name));
        featureLevel?.show(mode);
      })),
    ...(featureLevel ? [featureLevel.label] : []),
    slider('Screen-space error', 0, 3, Math.log2(2 * city.selection.maximumScreenSpaceError), 0.25, (x) => `${(2 ** x / 2).toPrecision(2)} px`,
      changed((x) => scenes.forEach(({ selection }) => (selection.maximumScreenSpaceError = 2 ** x / 2)))),
    ...(levels.length > 1 ? [choice('Detail', levels, changed((level) => scenes.forEach(({ selection }) => (selection.finestLevel = level))))] : []),
    choice('Outside the captured region', [['Fades into haze', city.visibility], ['Is shown in full', Infinity]],
      changed((visibility) => (city.visibility = visibility))),
    choice('Pixels', kResolutions, changed((share) => (resolution.fixed = share))),
    memory,
    lens,
  );
  // Addresses and bookmarks set the lens, too, and lost GPUs the memory.
  const opened = () => {
    lens.querySelector('input')!.valueAsNumber = camera.fov;
    lens.querySelector('output')!.textContent = `${Math.round(camera.fov)}°`;
    memory.querySelector('input')!.valueAsNumber = Math.log2(viewer.gpuBytes / 2 ** 20);
    memory.querySelector('output')!.textContent = mebibytes(Math.log2(viewer.gpuBytes / 2 ** 20));
  };
  toolbar.add({ name: 'Settings', key: 'c', icon: 'sliders', panel, opened });
}

// The feature level that feature-level modes show.
function makeFeatureLevelChoice({ city }: Viewer, change: (level: number) => void) {
  const { featureLevels } = city.shows;
  if (!featureLevels) return undefined;
  const fine = Array.from({ length: featureLevels.maximum }, (_, i): [string, number] => [`Level ${i + 1}`, i + 1]);
  const label = choice(featureLevels.label, [...fine, [featureLevels.coarse, 0] as [string, number]], change);
  const select = label.querySelector('select')!;
  const options = [...select.options];
  let shown: ShownMode['featureLevel'];
  const offer = () => {
    fine.forEach(([, level], i) => (options[i].hidden = options[i].disabled = level > city.featureLevels));
    options[fine.length].hidden = options[fine.length].disabled = shown !== 'any';
    if (!options[select.selectedIndex].hidden) return;
    select.selectedIndex = 0;
    change(1);
  };
  const show = (mode: ShownMode) => {
    shown = mode.featureLevel;
    label.hidden = shown === undefined;
    if (!label.hidden) offer();
  };
  label.hidden = true;
  select.addEventListener('focus', offer); // updates the choices to the levels loaded so far
  return { label, show };
}

function slider(
  name: string, minimum: number, maximum: number, value: number, step: number, say: (value: number) => string, change: (value: number) => void,
): HTMLLabelElement {
  const input = element('input');
  Object.assign(input, { type: 'range', min: String(minimum), max: String(maximum), step: String(step), value: String(value) });
  const output = element('output', '', say(value));
  input.addEventListener('input', () => {
    output.textContent = say(input.valueAsNumber);
    change(input.valueAsNumber);
  });
  return element('label', '', name, output, input);
}

function choice<T>(name: string, choices: [string, T][], change: (value: T) => void): HTMLLabelElement {
  const select = element('select', '', ...choices.map(([text]) => element('option', '', text)));
  select.addEventListener('change', () => change(choices[select.selectedIndex][1]));
  return element('label', '', name, select);
}
