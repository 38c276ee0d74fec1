// The list of models, and the numeric placement of the selected one.
import * as THREE from 'three';
import { element } from '../page/element';
import { iconButton, nameField, numberField, replaceRows, showPressed } from '../page/fields';
import type { GroundFrame } from '../measuring/geodesy';
import { kGizmoModes, type GizmoMode, type ModelGizmo } from './model-gizmo';
import { kNameLength, scaledWithin } from '../world/world-fields';
import { getPlace, setPlace } from './model-place';
import type { Models, PlacedModel } from './models';

export interface ModelActions {
  add(): void;
  save(withFiles: boolean): void;
  place(model: PlacedModel): void; // asks the user for a place in the city
}

export class ModelsPanel {
  readonly body = element('div', 'models listed');
  // Returns the size of the models' files as text.
  fileSize: () => string = () => '';
  private readonly hint = element('p', 'faint', 'Drop a model onto the city: glTF, OBJ or FBX, with its textures, or a saved world.');
  private readonly list = element('ul');
  private readonly details = element('div', 'details');
  private readonly name = nameField(kNameLength, (to) => this.change((model) => (model.name = to)), () => this.show());
  private readonly place = ['x', 'y', 'z, up'].map((axis, i) => numberField(axis, 0.1, 2, (to) => this.setPosition(i, to), () => this.show()));
  private readonly turn = numberField('Turn, degrees', 1, 1, (to) => this.setTurn(to), () => this.show());
  private readonly scale = numberField('Scale', 0.1, 4, (to) => this.setScale(to), () => this.show());
  private readonly size = element('p', 'faint');
  private readonly modes = new Map<GizmoMode, HTMLButtonElement>();
  private readonly plays = element('input');
  private readonly playing = element('label', 'line', 'Play its animation', this.plays);
  private readonly put = element('button', '', 'Put on a place…');
  private readonly save = element('button', '', 'Save');
  private readonly saveAll = element('button', '', 'Save with models');

  constructor(
    private readonly models: Models, private readonly gizmo: ModelGizmo, private readonly ground: GroundFrame, actions: ModelActions,
  ) {
    const modes = element('div', 'choice');
    for (const [mode, name] of Object.entries(kGizmoModes) as [GizmoMode, string][]) {
      const button = element('button', '', name);
      button.title = `${name} (T: the next)`;
      button.addEventListener('click', () => (gizmo.mode = mode));
      this.modes.set(mode, button);
      modes.append(button);
    }
    gizmo.onModeChange = () => this.showMode();
    this.plays.type = 'checkbox';
    this.plays.addEventListener('change', () => this.change((model) => (model.plays = this.plays.checked)));
    this.put.addEventListener('click', () => models.selected && actions.place(models.selected));
    const three = element('div', 'three', ...this.place.map(({ label }) => label));
    const two = element('div', 'three', this.turn.label, this.scale.label);
    this.details.append(this.name.label, modes, three, two, this.size, this.playing, element('div', 'row', this.put));
    const add = element('button', '', 'Add…');
    add.addEventListener('click', () => actions.add());
    this.save.addEventListener('click', () => actions.save(false));
    this.saveAll.addEventListener('click', () => actions.save(true));
    this.save.title = 'world.json: scenes, models, hidden parts and views';
    this.body.append(this.hint, this.list, this.details, element('div', 'row', add, this.save, this.saveAll));
    models.onChange.add(() => this.show());
    this.showMode();
    this.show();
  }

  // Shows whether the tool is asking for a place.
  asks(isAsking: boolean): void {
    this.put.textContent = isAsking ? 'Choose a place in the city' : 'Put on a place…';
    this.put.classList.toggle('on', isAsking);
  }

  private shown: string = '';

  private show(): void {
    const { list, selected } = this.models;
    // The list is rebuilt only if it differs, so that a pressed button is not replaced.
    const now = JSON.stringify(list.map((model) => [model.id, model.name, model.visible, model === selected]));
    if (now !== this.shown) replaceRows(this.list, list.map((model) => this.row(model)));
    this.shown = now;
    this.hint.hidden = list.length > 0;
    this.list.hidden = list.length === 0;
    this.saveAll.hidden = list.length === 0;
    this.saveAll.title = this.fileSize();
    this.details.hidden = !selected;
    if (!selected) return;
    this.name.set(selected.name);
    const { position } = getPlace(selected, new THREE.Vector3());
    this.place.forEach(({ set }, i) => set(position[i]));
    this.turn.set(THREE.MathUtils.radToDeg(toEuler(selected).y));
    this.scale.set(selected.scale.x);
    const { size } = selected.source;
    const metres = (inWorld: number) => {
      const length = inWorld / this.ground.unitsPerMetre;
      return length < 10 ? length.toFixed(2) : length.toFixed(1);
    };
    this.size.textContent = [size.x * selected.scale.x, size.z * selected.scale.z, size.y * selected.scale.y].map(metres).join(' × ') +
      (this.ground.isGeoreferenced ? ' m' : ' units');
    this.playing.hidden = !selected.mixer;
    this.plays.checked = selected.plays;
  }

  private showMode(): void {
    showPressed(this.modes, this.gizmo.mode);
  }

  private row(model: PlacedModel): HTMLElement {
    const { models } = this;
    const name = element('button', 'plain name', model.name);
    name.setAttribute('aria-pressed', String(model === models.selected));
    name.addEventListener('click', () => models.select(model === models.selected ? undefined : model));
    const show = iconButton(model.visible ? 'Hide' : 'Show', model.name, 'eye', () => {
      model.visible = !model.visible;
      models.changed();
    });
    const row = element('li', model === models.selected ? 'on' : '', name, show,
      iconButton('Duplicate', model.name, 'copy', () => models.duplicate(model)),
      iconButton('Delete', model.name, 'bin', () => models.remove(model)));
    row.classList.toggle('off', !model.visible);
    return row;
  }

  private change(how: (model: PlacedModel) => void): void {
    if (!this.models.selected) return;
    how(this.models.selected);
    this.models.changed();
  }

  private setPosition(axis: number, to: number): void {
    this.change((model) => {
      const place = getPlace(model, new THREE.Vector3());
      place.position[axis] = to;
      setPlace(model, new THREE.Vector3(), place);
    });
  }

  private setTurn(degrees: number): void {
    this.change((model) => {
      const euler = toEuler(model);
      euler.y = THREE.MathUtils.degToRad(degrees);
      model.quaternion.setFromEuler(euler);
    });
  }

  private setScale(to: number): void {
    if (to > 0) this.change(({ scale }) => scale.fromArray(scaledWithin(scale.toArray(), to / scale.x)));
  }
}

// The rotation about the vertical axis is applied first.
function toEuler({ quaternion }: THREE.Object3D): THREE.Euler {
  return new THREE.Euler().setFromQuaternion(quaternion, 'YXZ');
}
