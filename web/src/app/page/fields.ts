// Parts of panels: numbers to type, small buttons in rows of a list, one of several.
import { element } from './element';
import { icon, type IconName } from './icons';

const kLargest = 1e7;

export interface NumberField {
  label: HTMLLabelElement;
  set(value: number): void; // but while it is typed into
}

// `done`: it has been left, and may hold what is no number.
export function numberField(name: string, step: number, digits: number, change: (to: number) => void, done: () => void): NumberField {
  const input = element('input');
  input.type = 'number';
  input.step = String(step);
  input.addEventListener('input', () => {
    if (Number.isFinite(input.valueAsNumber) && Math.abs(input.valueAsNumber) < kLargest) change(input.valueAsNumber);
  });
  input.addEventListener('keydown', ({ key }) => {
    if (key === 'Enter' || key === 'Escape') input.blur();
  });
  input.addEventListener('blur', done);
  const set = (value: number) => {
    if (document.activeElement !== input) input.value = String(Number(value.toFixed(digits)) + 0);
  };
  return { label: element('label', 'field', name, input), set };
}

// `of`: what it is done to, for those who hear the page.
export function iconButton(what: string, of: string, picture: IconName, act: () => void): HTMLButtonElement {
  const made = element('button', 'plain', icon(picture));
  made.title = what;
  made.setAttribute('aria-label', `${what}: ${of}`);
  made.addEventListener('click', act);
  return made;
}
