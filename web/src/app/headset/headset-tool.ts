// The button that enters a headset, if there is one.
import type { Shortcuts } from '../page/shortcuts';
import type { Toolbar } from '../page/toolbar';
import type { Viewer } from '../viewer';
import { Headset } from './headset';

export async function addHeadset(viewer: Viewer, toolbar: Toolbar, shortcuts: Shortcuts, fail: (error: unknown) => void): Promise<void> {
  const isThere = await navigator.xr?.isSessionSupported('immersive-vr').catch(() => false);
  if (!isThere) return;
  const headset = new Headset(viewer);
  const button = toolbar.add({
    name: 'Headset', key: 'v', icon: 'headset', opened: () => void (headset.isOn ? headset.leave() : headset.enter()).catch(fail),
  });
  headset.onChange = (isOn) => {
    button.classList.toggle('on', isOn);
    button.setAttribute('aria-pressed', String(isOn));
  };
  headset.onChange(false);
  shortcuts.describe('Headset: left stick', 'Move over the ground, relative to the gaze');
  shortcuts.describe('Headset: right stick', 'Turn by 30 degrees; move down and up');
}
