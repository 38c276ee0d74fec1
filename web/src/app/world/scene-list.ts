// The list of a world's scenes with their visibility, shown if there are several scenes or one is hidden.
import { element } from '../page/element';
import { iconButton, replaceRows } from '../page/fields';
import type { Viewer } from '../viewer';

export function listedScenes<T extends { visible: boolean }>(scenes: readonly T[]): readonly T[] {
  return scenes.length > 1 || scenes.some(({ visible }) => !visible) ? scenes : [];
}

export function sceneList(viewer: Viewer): HTMLElement {
  const list = element('ul', 'scenes');
  const body = element('div', '', element('p', 'faint', 'Scenes'), list);
  const show = () => {
    const listed = listedScenes(viewer.scenes);
    body.hidden = listed.length === 0;
    replaceRows(list, listed.map((scene) => {
      const name = scene.name === '' ? 'Scene' : scene.name;
      const row = element('li', '', element('span', 'name', name), iconButton(scene.visible ? 'Hide' : 'Show', name, 'eye', () => {
        scene.visible = !scene.visible;
        viewer.changedScenes();
      }));
      row.classList.toggle('off', !scene.visible);
      return row;
    }));
  };
  viewer.onScenes.add(show);
  show();
  return body;
}
