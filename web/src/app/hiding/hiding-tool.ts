// The tool for hiding parts of the city: a click places a box, and handles move it.
import { ModelGizmo } from '../models/model-gizmo';
import { isTyping, type Shortcuts } from '../page/shortcuts';
import type { Toolbar } from '../page/toolbar';
import type { Viewer } from '../viewer';
import type { HiddenParts } from './hidden-parts';
import { HidingPanel } from './hiding-panel';

export function addHiding(viewer: Viewer, parts: HiddenParts, toolbar: Toolbar, shortcuts: Shortcuts): void {
  const gizmo = new ModelGizmo(viewer, () => parts.changed(), true);
  let isAsking = false; // waiting for a click on a place
  const ask = (asks: boolean) => {
    isAsking = asks;
    viewer.canvas.style.cursor = asks ? 'crosshair' : '';
    viewer.navigation.isPointing = asks;
    panel.asks(asks);
  };
  const panel = new HidingPanel(parts, gizmo, () => ask(!isAsking));
  parts.onChange.add(() => gizmo.attach(parts.selected));
  toolbar.add({
    name: 'Hide parts', key: 'x', icon: 'hide', panel: panel.body,
    closed: () => {
      ask(false);
      parts.select(undefined);
    },
  });
  shortcuts.describe('Delete', 'Delete the selected hidden part');
  addEventListener('keydown', ({ key, target }) => {
    if (key === 'Delete' && parts.selected && !viewer.isPaused && !isTyping(target)) parts.remove(parts.selected);
  });
  // Precedes the selection of models by clicks.
  viewer.onClick.unshift((event) => {
    if (isAsking) {
      const place = viewer.pickAt(event);
      if (!place) return true;
      ask(false);
      parts.addAt(place);
      return true;
    }
    return parts.selected !== undefined && gizmo.takesClick();
  });
}
