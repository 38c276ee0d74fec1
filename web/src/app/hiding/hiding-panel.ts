// The list of hidden parts, and the numeric placement of the selected one.
import * as THREE from 'three';
import { kGizmoModes, type GizmoMode, type ModelGizmo } from '../models/model-gizmo';
import { element } from '../page/element';
import { iconButton, nameField, numberField, replaceRows, showPressed } from '../page/fields';
import { kNameLength, scaleWithin } from '../world/world-fields';
import type { HiddenPart } from '../world/world-file';
import type { HiddenBox, HiddenParts } from './hidden-parts';

const kAxes = ['x', 'y', 'z, up'];

export class HidingPanel {
  readonly body = element('div', 'hiding listed');
  private readonly hint = element('p', 'faint', 'The scene is not drawn inside these boxes. Models are.');
  private readonly list = element('ul');
  private readonly details = element('div', 'details');
  private readonly name = nameField(kNameLength, (to) => this.change((part) => (part.name = to)), () => this.show());
  private readonly middle = kAxes.map((axis, i) => this.field(axis, (part, to) => (part.middle[i] = to)));
  private readonly size = ['Length', 'Width', 'Height'].map((name, i) => this.field(name, (part, to) => (part.size[i] = scaleWithin(Math.max(to, 1e-3)))));
  private readonly turn = this.field('Turn, degrees', (part, to) => (part.turn = THREE.MathUtils.degToRad(to)));
  private readonly modes = new Map<GizmoMode, HTMLButtonElement>();
  private readonly add = element('button', '', '');
  private shown = '';

  constructor(private readonly parts: HiddenParts, private readonly gizmo: ModelGizmo, askForPlace: () => void) {
    const modes = element('div', 'choice');
    for (const [mode, name] of Object.entries(kGizmoModes) as [GizmoMode, string][]) {
      const button = element('button', '', mode === 'scale' ? 'Size' : name);
      button.addEventListener('click', () => (gizmo.mode = mode));
      this.modes.set(mode, button);
      modes.append(button);
    }
    gizmo.onModeChange = () => this.showMode();
    const three = (fields: typeof this.middle) => element('div', 'three', ...fields.map(({ label }) => label));
    this.details.append(this.name.label, modes, three(this.middle), three(this.size), three([this.turn]));
    this.add.addEventListener('click', askForPlace);
    this.body.append(this.hint, this.list, this.details, element('div', 'row', this.add));
    parts.onChange.add(() => this.show());
    this.asks(false);
    this.showMode();
    this.show();
  }

  // Shows whether the tool is asking for a place.
  asks(isAsking: boolean): void {
    this.add.textContent = isAsking ? 'Choose a place in the city' : 'Hide a part…';
    this.add.classList.toggle('on', isAsking);
  }

  private show(): void {
    const { list, selected, isFull } = this.parts;
    // The list is rebuilt only if it differs, so that a pressed button is not replaced.
    const now = JSON.stringify(list.map((box) => [box.id, box.name, box.hides, box === selected]));
    if (now !== this.shown) replaceRows(this.list, list.map((box) => this.row(box)));
    this.shown = now;
    this.list.hidden = list.length === 0;
    this.add.disabled = isFull;
    this.add.title = isFull ? 'The maximum number of boxes is reached' : '';
    this.details.hidden = !selected;
    if (!selected) return;
    const { name, middle, size, turn } = selected.part;
    this.name.set(name);
    this.middle.forEach(({ set }, i) => set(middle[i]));
    this.size.forEach(({ set }, i) => set(size[i]));
    this.turn.set(THREE.MathUtils.radToDeg(turn));
  }

  private showMode(): void {
    showPressed(this.modes, this.gizmo.mode);
  }

  private row(box: HiddenBox): HTMLElement {
    const { parts } = this;
    const name = element('button', 'plain name', box.name);
    name.setAttribute('aria-pressed', String(box === parts.selected));
    name.addEventListener('click', () => parts.select(box === parts.selected ? undefined : box));
    const row = element('li', box === parts.selected ? 'on' : '', name,
      iconButton(box.hides ? 'Show' : 'Hide', box.name, 'eye', () => {
        box.hides = !box.hides;
        parts.changed();
      }),
      iconButton('Delete', box.name, 'bin', () => parts.remove(box)));
    row.classList.toggle('off', !box.hides);
    return row;
  }

  private field(name: string, change: (part: HiddenPart, to: number) => void) {
    return numberField(name, 0.1, 2, (to) => this.change((part) => change(part, to)), () => this.show());
  }

  private change(how: (part: HiddenPart) => void): void {
    const { selected } = this.parts;
    if (!selected) return;
    const { part } = selected;
    how(part);
    selected.part = part;
    this.parts.changed();
  }
}
