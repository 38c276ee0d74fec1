// The help: what keys and gestures do.
import { element } from './element';
import type { Shortcuts } from './shortcuts';
import type { Toolbar } from './toolbar';

export function addHelp(toolbar: Toolbar, shortcuts: Shortcuts): void {
  const list = element('dl', 'keys');
  toolbar.add({
    name: 'Help', key: '?', icon: 'help', panel: list,
    opened: () =>
      list.replaceChildren(...shortcuts.list.flatMap(({ keys, what }) => [element('dt', '', keys), element('dd', '', what)])),
  });
}
