// Components of panels: fields for numbers and names, and small buttons in rows of a list.
import { element } from './element';
import { icon, type IconName } from './icons';

const kLargest = 1e7;

export interface Field<T> {
  label: HTMLLabelElement;
  set(value: T): void; // sets the value unless the field is being edited
}

// `done` is called when the field is left; its text may not be a number.
export function numberField(name: string, step: number, digits: number, change: (to: number) => void, done: () => void): Field<number> {
  const input = element('input');
  input.type = 'number';
  input.step = String(step);
  input.addEventListener('input', () => {
    if (Number.isFinite(input.valueAsNumber) && Math.abs(input.valueAsNumber) < kLargest) change(input.valueAsNumber);
  });
  return field(name, input, (value) => String(Number(value.toFixed(digits)) + 0), done);
}

// A field for a name of limited length. Edits take effect at once; an empty text or Escape restores the previous name.
export function nameField(maximum: number, change: (to: string) => void, done: () => void): Field<string> {
  const input = element('input');
  input.maxLength = maximum;
  input.autocomplete = 'off';
  let before = '';
  input.addEventListener('focus', () => (before = input.value));
  input.addEventListener('input', () => change(input.value.trim() || before));
  input.addEventListener('keydown', ({ key, isComposing }) => {
    if (key === 'Escape' && !isComposing) change(before);
  });
  return field('Name', input, (value) => value, done);
}

// Enter and Escape leave the field.
function field<T>(name: string, input: HTMLInputElement, formatValue: (value: T) => string, done: () => void): Field<T> {
  input.addEventListener('keydown', ({ key, isComposing }) => {
    if ((key === 'Enter' || key === 'Escape') && !isComposing) input.blur();
  });
  input.addEventListener('blur', done);
  const set = (value: T) => {
    if (document.activeElement !== input) input.value = formatValue(value);
  };
  return { label: element('label', 'field', name, input), set };
}

// `of` names the object of the action for screen readers.
export function iconButton(what: string, of: string, picture: IconName, act: () => void): HTMLButtonElement {
  const button = element('button', 'plain', icon(picture));
  button.title = what;
  button.setAttribute('aria-label', `${what}: ${of}`);
  button.addEventListener('click', act);
  return button;
}

// Marks which one of several buttons is pressed.
export function showPressed<T>(buttons: ReadonlyMap<T, HTMLButtonElement>, pressed: T): void {
  buttons.forEach((button, one) => {
    button.classList.toggle('on', one === pressed);
    button.setAttribute('aria-pressed', String(one === pressed));
  });
}

// Replaces the rows of a list; the keyboard focus stays in its row, on the same button.
export function replaceRows(list: HTMLElement, rows: readonly HTMLElement[]): void {
  const buttons = (row: Element) => [...row.querySelectorAll('button')];
  const { activeElement } = document;
  const row = [...list.children].findIndex((one) => one.contains(activeElement));
  const button = row < 0 ? -1 : buttons(list.children[row]).indexOf(activeElement as HTMLButtonElement);
  list.replaceChildren(...rows);
  if (button >= 0 && rows.length > 0) buttons(rows[Math.min(row, rows.length - 1)])[button]?.focus();
}
