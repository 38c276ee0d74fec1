// Buttons for the navigation modes.
import { showPressed } from '../page/fields';
import { kModes, type NavigationMode } from './navigation';
import type { Shortcuts } from '../page/shortcuts';
import type { Toolbar } from '../page/toolbar';
import type { Viewer } from '../viewer';

const kNames: Record<NavigationMode, string> = { map: 'Move over the map', orbit: 'Orbit around a place', fly: 'Fly' };
const kKeys: Record<NavigationMode, string> = { map: '1', orbit: '2', fly: '3' };

export function addNavigationTools({ navigation }: Viewer, toolbar: Toolbar, shortcuts: Shortcuts): void {
  shortcuts.describe('Drag', 'Move, rotate or look around, depending on the mode');
  shortcuts.describe('Right drag, two fingers', 'Rotate; in orbit mode: move');
  shortcuts.describe('Wheel, pinch', 'Nearer, farther; flying: slower, faster');
  shortcuts.describe('Double click', 'Fly there');
  shortcuts.describe('WASD, arrows', 'Move; with Shift faster');
  shortcuts.describe('Q, E', 'Down, up');
  shortcuts.describe('Gamepad', 'Sticks move and look, triggers go down and up');
  toolbar.add({ name: 'Show all', key: 'h', icon: 'home', opened: () => navigation.flyHome() });
  const buttons = new Map<NavigationMode, HTMLButtonElement>();
  for (const mode of kModes) {
    const button = toolbar.add({ name: kNames[mode], key: kKeys[mode], icon: mode, opened: () => (navigation.mode = mode) });
    buttons.set(mode, button);
  }
  navigation.onModeChange = (mode) => showPressed(buttons, mode);
  navigation.onModeChange(navigation.mode);
}
