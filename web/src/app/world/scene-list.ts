// The scenes of a world, where there are several: which of them are shown.
import { element } from '../page/element';
import { iconButton } from '../page/fields';
import type { Viewer } from '../viewer';

export function sceneList(viewer: Viewer): HTMLElement {
  const list = element('ul', 'scenes');
  const body = element('div', '', element('p', 'faint', 'Scenes'), list);
  const show = () => {
    const several = viewer.scenes.length > 1 ? viewer.scenes : [];
    body.hidden = several.length === 0;
    list.replaceChildren(...several.map((scene) => {
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
